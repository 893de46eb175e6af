//! The cost of kriging models of the percentile, and their errors at held-out designs.

use ::kriging::{Data, Kernel, Method, Nugget, Response, Settings, Surrogate, Trend};
use anyhow::{Context as _, bail};
use problem::formulation::{Design, Problem};
use rand::seq::SliceRandom as _;
use stats::streams::{Purpose, stream};
use store::ResponseRow;
use studies::finished;

use crate::summary::{quantile, root_mean_square};
use crate::tradeoff::clock::process_seconds;
use crate::tradeoff::data::{self, Doe};
use crate::tradeoff::front::Rule;
use crate::tradeoff::size::Size;
use crate::tradeoff::table::{Row, Table};
use crate::tradeoff::view::{self, Reading};

pub(crate) const LEAD: &str = "Error of the model's mean at held-out designs, a fifth of the campaign's DoE, against CPU time. The truth is the \
     percentile of 500 samples (100 in a quick run). The held-out designs with the lowest tenth of the percentiles are \
     near the optimum. “Vecchia” predicts from the nearest designs, with a constant trend and known noise. All other \
     settings are those of the campaign's [kriging], whose covariance, method and response are marked at the largest \
     number of designs.";

const COLUMNS: [&str; 7] = [
    "fit (CPU s)",
    "prediction (CPU µs a point)",
    "1 − Q²",
    "RMSE near the optimum (µm)",
    "RMSE (µm)",
    "Q²",
    "coverage of 90 % intervals (%)",
];

/// Errors closer than this cannot be distinguished with a few hundred held-out designs.
const NEAR: Rule = Rule::NearBest(0.1);

pub(crate) const PAIRS: &[view::Pair] = &[
    view::Pair {
        cost: 0,
        error: 2,
        reading: Reading::Choice(NEAR),
    },
    view::Pair {
        cost: 1,
        error: 3,
        reading: Reading::Choice(NEAR),
    },
];

/// Numbers of designs for a fit, besides all of them.
const COUNTS: [usize; 3] = [250, 500, 1000];
/// Size of the DoE in a quick run: 1000 designs for the fit and a fifth held out, if all are simulable.
const QUICK: u32 = 1250;
/// One in this many designs is held out.
const HELD_OUT: usize = 5;
/// The normal deviate of a two-sided 90 % interval.
const Z90: f64 = 1.644_853_626_951_472;

/// The held-out designs and the true percentiles there.
struct TestSet {
    x: Vec<f64>,
    truth: Vec<f64>,
}

pub(crate) fn run(
    problem: &Problem,
    size: Size,
    progress: &mut dyn FnMut(&str),
) -> anyhow::Result<Table> {
    let mut campaign = problem.campaign().clone();
    let all = campaign.doe.designs;
    campaign.doe.designs = match size {
        Size::Full => all,
        Size::Quick => all.min(QUICK),
        Size::Designs(count) => all.min(10 * count),
    };
    let seed = campaign.seed;
    let problem = &Problem::new(campaign);
    let base = finished::searched_base(problem)?;
    let doe = data::sample_doe(problem, &base)?;
    let mut rows: Vec<&ResponseRow> = doe.responses.iter().collect();
    rows.shuffle(&mut stream(seed, Purpose::Test, 2, 0));
    let (held_out, training) = rows.split_at(rows.len() / HELD_OUT);
    if held_out.len() < 5 {
        bail!(
            "only {} of {} designs can be simulated: too few to hold some out",
            rows.len(),
            doe.designs.len()
        );
    }
    let test = test(problem, &base, &doe, held_out, size.pick(500, 100, 30))?;
    progress(&format!(
        "kriging: {} designs to fit to, {} held out",
        training.len(),
        held_out.len()
    ));
    let own = problem.campaign().kriging.settings(seed);
    let mut kernels = Kernel::ALL.to_vec();
    kernels.retain(|kernel| match size {
        Size::Full => true,
        Size::Quick => {
            [own.fit.kernel, Kernel::Matern52, Kernel::SquaredExponential].contains(kernel)
        }
        Size::Designs(_) => *kernel == own.fit.kernel,
    });
    let mut counts = COUNTS.to_vec();
    counts.retain(|count| *count < training.len());
    counts.push(training.len());
    let panel = format!(
        "{} at {} held-out designs",
        problem.measured().name,
        held_out.len()
    );
    let mut table = Table::new(&COLUMNS);
    for count in counts {
        for &kernel in &kernels {
            for method in [Method::Exact, Method::Vecchia] {
                for response in [Response::Plain, Response::Log] {
                    let settings = settings(&own, kernel, method, response);
                    let is_campaign = count == training.len()
                        && (kernel, response) == (own.fit.kernel, own.response)
                        && (method == Method::Vecchia) == (own.method == Method::Vecchia);
                    let measured = measure(problem, &doe, &training[..count], &settings, &test);
                    let (values, failed) = match measured {
                        Ok(values) => (values, String::new()),
                        Err(error) => (
                            vec![f64::NAN; COLUMNS.len()],
                            format!("; failed: {error:#}"),
                        ),
                    };
                    table.rows.push(Row {
                        panel: panel.clone(),
                        method: name(method, response),
                        setting: format!("{kernel}, {count} designs{failed}"),
                        is_campaign,
                        values,
                    });
                }
            }
        }
        progress(&format!("kriging: fitted to {count} designs"));
    }
    Ok(table)
}

fn settings(own: &Settings, kernel: Kernel, method: Method, response: Response) -> Settings {
    let mut settings = Settings {
        method,
        response,
        ..own.clone()
    };
    settings.fit.kernel = kernel;
    if method == Method::Vecchia {
        settings.fit.trend = Trend::Constant;
        settings.fit.nugget = Nugget::Known;
    }
    settings
}

fn name(method: Method, response: Response) -> String {
    let method = match method {
        Method::Vecchia => "Vecchia",
        _ => "exact",
    };
    let response = match response {
        Response::Plain => "plain",
        Response::Log => "log",
    };
    format!("{method}, {response}")
}

/// Computes the truth at the held-out designs from samples that are in no response.
fn test(
    problem: &Problem,
    base: &Design,
    doe: &Doe,
    held_out: &[&ResponseRow],
    samples: u64,
) -> anyhow::Result<TestSet> {
    let gears = problem.gears().context("the campaign designs no gears")?;
    let campaign = problem.campaign();
    let (mut x, mut truth) = (Vec::new(), Vec::new());
    for row in held_out {
        let at = &doe.designs[row.design as usize].x;
        let pair = gears.pair(&problem.design(at, base))?;
        let mut sampler = gears.sampler(&pair);
        let draw = |sample| {
            let mut rng = stream(campaign.seed, Purpose::Test, row.design + (1 << 40), sample);
            sampler.draw(&mut rng)
        };
        let drawn: Vec<f64> = (0..samples).map(draw).collect();
        x.extend(at);
        truth.push(campaign.sampling.verified(&drawn)?.value);
    }
    Ok(TestSet { x, truth })
}

/// Measures the values of [`COLUMNS`].
fn measure(
    problem: &Problem,
    doe: &Doe,
    rows: &[&ResponseRow],
    settings: &Settings,
    test: &TestSet,
) -> anyhow::Result<Vec<f64>> {
    let campaign = problem.campaign();
    let d = problem.dimension();
    let x: Vec<f64> = rows
        .iter()
        .flat_map(|row| doe.designs[row.design as usize].x.iter().copied())
        .collect();
    let y: Vec<f64> = rows.iter().map(|row| row.measure).collect();
    let own: Vec<f64> = rows.iter().map(|row| row.measure_variance).collect();
    let start = process_seconds();
    let samples = vec![f64::from(campaign.sampling.samples_per_design); own.len()];
    let freedom = campaign.sampling.degrees_of_freedom();
    let noise = settings.noise;
    let noise_variance = noise.variances(&x, d, own, &samples, freedom, campaign.seed)?;
    let data = Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &noise_variance,
    };
    let model = Surrogate::fit(&data, settings)?;
    let fit = process_seconds() - start;
    let start = process_seconds();
    let predictions = model.predict_many(&test.x)?;
    let points = test.truth.len() as f64;
    let prediction = 1e6 * (process_seconds() - start) / points;

    let off = predictions.iter().zip(&test.truth);
    let off: Vec<f64> = off.map(|(found, truth)| found.mean - truth).collect();
    let mean = test.truth.iter().sum::<f64>() / points;
    let about: Vec<f64> = test.truth.iter().map(|truth| truth - mean).collect();
    let rmse = root_mean_square(&off);
    let missed = (rmse / root_mean_square(&about)).powi(2);
    let lowest = quantile(&test.truth, 0.1);
    let near = off
        .iter()
        .zip(&test.truth)
        .filter(|(_, truth)| **truth <= lowest);
    let near: Vec<f64> = near.map(|(off, _)| *off).collect();
    let covered = predictions
        .iter()
        .zip(&off)
        .filter(|(found, off)| off.abs() <= Z90 * found.variance.sqrt())
        .count();
    Ok(vec![
        fit,
        prediction,
        missed,
        root_mean_square(&near),
        rmse,
        1.0 - missed,
        100.0 * covered as f64 / points,
    ])
}
