//! Fits a model to a CSV file and scores it on another: one JSON object on standard output.
//!
//! `cargo run --release -p kriging --example fit_csv -- --train F.csv --test G.csv [--kernel matern-5-2]
//! [--method exact|vecchia] [--accuracy exact|fine|standard|coarse] [--seed 0] [--trend constant|linear] [--nugget true] [--calibrate true]`
//!
//! The method vecchia is the accuracy standard.
//!
//! Columns of the training file: the coordinates, then `y` and `noise_var`, then anything. Columns
//! of the test file: the coordinates, then the noise-free truth. Files without a header (first field
//! a number) are read by position.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command-line example"
)]

use std::error::Error;
use std::process::ExitCode;
use std::time::Instant;

use kriging::{Accuracy, Data, FitOptions, Model, Surrogate, Trend, fit_with_accuracy};

const USAGE: &str = "usage: fit_csv --train F.csv --test G.csv [--kernel NAME] [--method exact|vecchia] [--accuracy exact|fine|standard|coarse] \
                     [--seed N] \
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
    let (mut train, mut test, mut options) = (None, None, FitOptions::default());
    let mut accuracy = Accuracy::Exact;
    let mut arguments = std::env::args().skip(1);
    while let Some(flag) = arguments.next() {
        let value = arguments.next().ok_or(USAGE)?;
        match flag.as_str() {
            "--train" => train = Some(value),
            "--test" => test = Some(value),
            "--kernel" => options.kernel = value.parse()?,
            "--method" => {
                accuracy = match value.as_str() {
                    "exact" => Accuracy::Exact,
                    "vecchia" => Accuracy::Standard,
                    _ => return Err(USAGE.into()),
                }
            }
            "--accuracy" => accuracy = value.parse()?,
            "--trend" => {
                options.trend = match value.as_str() {
                    "constant" => Trend::Constant,
                    "linear" => Trend::Linear,
                    _ => return Err(USAGE.into()),
                }
            }
            "--nugget" => options.nugget = value.parse()?,
            "--calibrate" => options.calibrate = value.parse()?,
            "--seed" => options.seed = value.parse()?,
            _ => return Err(USAGE.into()),
        }
    }
    let Table {
        header,
        rows: train,
    } = read(&train.ok_or(USAGE)?)?;
    let test = read(&test.ok_or(USAGE)?)?.rows;

    let width = train.first().map_or(0, Vec::len);
    let d = match header.iter().position(|name| name == "y") {
        Some(column) => column,
        None => width
            .checked_sub(2)
            .ok_or("the training file needs coordinates, y, noise_var")?,
    };
    let x: Vec<f64> = train.iter().flat_map(|row| row[..d].to_vec()).collect();
    let y: Vec<f64> = train.iter().map(|row| row[d]).collect();
    let noise_variance: Vec<f64> = train.iter().map(|row| row[d + 1]).collect();
    let data = Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &noise_variance,
    };

    let start = Instant::now();
    let model = fit_with_accuracy(&data, &options, accuracy)?;
    let fit_seconds = start.elapsed().as_secs_f64();
    let score = Score::new(&model, &y, &test)?;
    let parameters = model.parameters();
    let exact = match &model {
        Surrogate::Exact(model) => Some(model),
        _ => None,
    };
    let loo = exact.map(Model::leave_one_out);
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
        "loo_q2": loo.as_ref().map(|loo| loo.q2),
        "loo_coverage90": loo.as_ref().map(|loo| loo.coverage90),
        "mu": parameters.mu,
        "sigma2": parameters.sigma2,
        "ranges": parameters.ranges,
        "slopes": parameters.slopes,
        "nugget": parameters.nugget,
        "calibration": exact.map_or(1.0, Model::calibration),
        "method": method(&model),
        "warnings": warnings,
    });
    println!("{report}");
    Ok(())
}

/// What the model is, in words.
fn method(model: &Surrogate) -> String {
    match model {
        Surrogate::Exact(model) => format!(
            "exact: maximum likelihood, {:?} trend, {}",
            model.trend(),
            model.kernel()
        ),
        Surrogate::Vecchia(model) => format!(
            "vecchia: predictions from {} of {} points, {}",
            model.conditioning(),
            model.points(),
            model.kernel()
        ),
        _ => String::new(),
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
    fn new(model: &Surrogate, y: &[f64], test: &[Vec<f64>]) -> Result<Self, Box<dyn Error>> {
        let d = model.dimensions();
        let x: Vec<f64> = test.iter().flat_map(|row| row[..d].to_vec()).collect();
        let truth: Vec<f64> = test.iter().map(|row| row[d]).collect();
        let count = truth.len() as f64;

        let start = Instant::now();
        let predictions = model.predict_many(&x)?;
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
        for (p, t) in predictions.iter().zip(&truth) {
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

/// A CSV file of numbers.
#[derive(Default)]
struct Table {
    /// Empty if there is none.
    header: Vec<String>,
    rows: Vec<Vec<f64>>,
}

fn read(path: &str) -> Result<Table, Box<dyn Error>> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .from_path(path)?;
    let mut table = Table::default();
    for (i, record) in reader.records().enumerate() {
        let record = record?;
        let numbers: Result<Vec<f64>, _> = record.iter().map(str::parse).collect();
        match numbers {
            Ok(row) => table.rows.push(row),
            Err(_) if i == 0 => table.header = record.iter().map(str::to_owned).collect(),
            Err(error) => return Err(format!("{path}, line {}: {error}", i + 1).into()),
        }
    }
    Ok(table)
}
