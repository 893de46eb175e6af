//! Fits a model to a CSV file and scores it on another: one JSON object on standard output.
//!
//! `cargo run --release -p kriging --example fit_csv -- --train F.csv --test G.csv [--kernel matern-5-2]
//! [--method auto|exact|vecchia] [--estimator likelihood|posterior-mode] [--response plain|log] [--seed 0]
//! [--trend constant|linear] [--nugget true] [--calibrate true]`
//!
//! The first line of a file names its columns: `x1` … `xd`, `y` and `noise_var` in the training file,
//! `x1` … `xd` and `f_true`, the noise-free truth, in the test file, in any order. Other columns are
//! ignored. A file whose first line holds numbers only has no header; its last columns are `y` and
//! `noise_var`, or `f_true`, and those before them the coordinates.

#![expect(clippy::disallowed_methods, reason = "it measures time")]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command-line example"
)]

use std::error::Error;
use std::process::ExitCode;
use std::time::Instant;

use kriging::{Data, Settings, Surrogate};
use serde::de::DeserializeOwned;

const USAGE: &str = "usage: fit_csv --train F.csv --test G.csv [--kernel NAME] [--method auto|exact|vecchia] \
                     [--estimator likelihood|posterior-mode] [--response plain|log] [--seed N] \
                     [--trend constant|linear] [--nugget true|false] [--calibrate true|false]";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let (mut train, mut test, mut settings) = (None, None, Settings::default());
    let options = &mut settings.fit;
    let mut arguments = std::env::args().skip(1);
    while let Some(flag) = arguments.next() {
        let value = arguments.next().ok_or(USAGE)?;
        match flag.as_str() {
            "--train" => train = Some(value),
            "--test" => test = Some(value),
            "--kernel" => options.kernel = named(value)?,
            "--method" => settings.method = named(value)?,
            "--response" => settings.response = named(value)?,
            "--estimator" => options.estimator = named(value)?,
            "--trend" => options.trend = named(value)?,
            "--nugget" => options.nugget = named(value)?,
            "--calibrate" => options.calibrate = value.parse()?,
            "--seed" => options.seed = value.parse()?,
            _ => return Err(USAGE.into()),
        }
    }
    let Table {
        d,
        x,
        others: [y, noise_variance],
    } = Table::read(&train.ok_or(USAGE)?, ["y", "noise_var"], None)?;
    let test = Table::read(&test.ok_or(USAGE)?, ["f_true"], Some(d))?;
    let data = Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &noise_variance,
    };

    let start = Instant::now();
    let model = Surrogate::fit(&data, &settings)?;
    let fit_seconds = start.elapsed().as_secs_f64();
    let score = Score::new(&model, &y, &test)?;
    let parameters = model.parameters();
    let loo = model.leave_one_out();
    let warnings: Vec<String> = model.warnings().iter().map(ToString::to_string).collect();
    let report = serde_json::json!({
        "n": y.len(),
        "d": d,
        "fit_seconds": fit_seconds,
        "nll": model.negative_log_likelihood(),
        "rmse": score.rmse,
        "q2": score.q2,
        "coverage90": score.coverage90,
        "msll": score.msll,
        "predict_seconds": score.predict_seconds,
        "mean_microseconds": score.mean_microseconds,
        "means_36000_seconds": score.means_36000_seconds,
        "loo_q2": loo.q2,
        "loo_coverage90": loo.coverage90,
        "mu": parameters.mu,
        "sigma2": parameters.sigma2,
        "ranges": parameters.ranges,
        "slopes": parameters.slopes,
        "nugget": parameters.nugget,
        "calibration": model.calibration(),
        "method": described(&model),
        "warnings": warnings,
    });
    println!("{report}");
    Ok(())
}

/// The value of `T` with this name.
fn named<T: DeserializeOwned>(name: String) -> Result<T, Box<dyn Error>> {
    serde_json::from_value(name.into()).map_err(|error| format!("{error}\n{USAGE}").into())
}

/// A description of the model.
fn described(model: &Surrogate) -> String {
    let kernel = model.kernel();
    match model.vecchia() {
        None => format!("exact, {kernel}"),
        Some(near) => format!(
            "vecchia: predictions from {} of {} points, {kernel}",
            near.prediction_neighbours(),
            near.points(),
        ),
    }
}

struct Score {
    rmse: f64,
    q2: f64,
    coverage90: f64,
    msll: f64,
    predict_seconds: f64,
    mean_microseconds: f64,
    means_36000_seconds: f64,
}

impl Score {
    fn new(model: &Surrogate, y: &[f64], test: &Table<1>) -> Result<Self, Box<dyn Error>> {
        let d = model.dimensions();
        let Table {
            x, others: [truth], ..
        } = test;
        let count = truth.len() as f64;

        let start = Instant::now();
        let predictions = model.predict_many(x)?;
        let predict_seconds = start.elapsed().as_secs_f64();
        // The best of many short runs: another process may have the processor in the others.
        let mut mean_microseconds = f64::INFINITY;
        for rows in x.chunks(50 * d) {
            let start = Instant::now();
            let sum: f64 = rows.chunks_exact(d).map(|x| model.mean(x)).sum();
            let each = start.elapsed().as_secs_f64() * 1e6 * d as f64 / rows.len() as f64;
            mean_microseconds = mean_microseconds.min(each);
            assert!(sum.is_finite(), "means of finite data are finite");
        }

        let many: Vec<f64> = x.iter().copied().cycle().take(36_000 * d).collect();
        let start = Instant::now();
        model.means(&many)?;
        let means_36000_seconds = start.elapsed().as_secs_f64();

        // The trivial prediction that scores are relative to: a normal of the training data's
        // mean and variance (q2: of the test data's mean).
        let mean = y.iter().sum::<f64>() / y.len() as f64;
        let variance = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / y.len() as f64;
        let truth_mean = truth.iter().sum::<f64>() / count;
        let (mut squares, mut total, mut covered, mut loss) = (0.0, 0.0, 0, 0.0);
        for (p, t) in predictions.iter().zip(truth) {
            let error = t - p.mean;
            let v = p.variance.max(f64::MIN_POSITIVE);
            squares += error * error;
            total += (t - truth_mean).powi(2);
            covered += usize::from(error.abs() <= 1.644_853_626_951_472 * v.sqrt());
            loss += 0.5 * (v.ln() + error * error / v);
            loss -= 0.5 * (variance.ln() + (t - mean).powi(2) / variance);
        }
        Ok(Self {
            rmse: (squares / count).sqrt(),
            q2: 1.0 - squares / total,
            coverage90: f64::from(covered as u32) / count,
            msll: loss / count,
            predict_seconds,
            mean_microseconds,
            means_36000_seconds,
        })
    }
}

/// The columns of a CSV file that are asked for.
struct Table<const N: usize> {
    /// Number of coordinates.
    d: usize,
    /// Row-major.
    x: Vec<f64>,
    /// The other columns, in the order of their names.
    others: [Vec<f64>; N],
}

impl<const N: usize> Table<N> {
    /// Reads the columns `x1` … `xd` and those of the given names. The header determines d, unless
    /// it is given. Without a header the columns have this order.
    fn read(path: &str, names: [&str; N], d: Option<usize>) -> Result<Self, Box<dyn Error>> {
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .from_path(path)
            .map_err(|error| format!("{path}: {error}"))?;
        let mut records = reader.records().peekable();
        let first = match records.peek() {
            Some(Ok(record)) => record.clone(),
            _ => csv::StringRecord::new(),
        };
        let is_number = |field: &str| field.trim().parse::<f64>().is_ok();
        let header = if !first.is_empty() && first.iter().all(is_number) {
            let coordinates = (1..=first.len().saturating_sub(N)).map(|j| format!("x{j}"));
            let names = names.map(str::to_owned);
            coordinates.chain(names).collect::<csv::StringRecord>()
        } else {
            records.next();
            first
        };
        let place = |name: &str| header.iter().position(|column| column.trim() == name);
        let missing = |name: &str| {
            let found: Vec<&str> = header.iter().collect();
            format!(
                "{path}, line 1: there is no column {name}, only {}",
                found.join(", ")
            )
        };
        let mut coordinates: Vec<usize> = Vec::new();
        while let Some(column) = place(&format!("x{}", coordinates.len() + 1)) {
            coordinates.push(column);
        }
        let d = d.unwrap_or(coordinates.len().max(1));
        if coordinates.len() < d {
            return Err(missing(&format!("x{}", coordinates.len() + 1)).into());
        }
        coordinates.truncate(d);
        let mut wanted = coordinates;
        for name in names {
            wanted.push(place(name).ok_or_else(|| missing(name))?);
        }

        let (mut x, mut others) = (Vec::new(), [const { Vec::new() }; N]);
        for record in records {
            // The reader's own error names the line, but not the file.
            let record = record.map_err(|error| format!("{path}: {error}"))?;
            for (k, &column) in wanted.iter().enumerate() {
                let text = record.get(column).unwrap_or("").trim();
                let value: f64 = text.parse().map_err(|_| {
                    let line = record.position().map_or(0, csv::Position::line);
                    let name = header.get(column).unwrap_or("");
                    format!("{path}, line {line}, column {name}: {text:?} is not a number")
                })?;
                match k.checked_sub(d) {
                    None => x.push(value),
                    Some(other) => others[other].push(value),
                }
            }
        }
        if x.is_empty() {
            return Err(format!("{path}: there is no row below the header").into());
        }
        Ok(Self { d, x, others })
    }
}
