//! The growth of costs with the numbers of designs, points, samples and variables.

use std::hint::black_box;

use ::kriging::{Data, FitOptions, Model, VecchiaOptions, fit, fit_vecchia};
use anyhow::Context as _;
use cmaes::{Bounds, CmaEs};
use problem::formulation::Problem;
use rand::RngExt as _;
use rand_distr::StandardNormal;
use stats::streams::{Purpose, stream};

use crate::tradeoff::clock::{micros, process_seconds};
use crate::tradeoff::data;
use crate::tradeoff::size::Size;
use crate::tradeoff::table::{Row, Table};
use crate::tradeoff::view::{self, Reading};

pub(crate) const LEAD: &str = "CPU time of one step against the size of its task, with the power law that fits best. A maximin design has a \
     budget of exchanges in proportion to n + 320 and to the number of variables. An exact fit factorises an n × n matrix \
     for each likelihood: n³ in the end, before which building the matrix, n² for each variable, and the subsets where the \
     search begins take a share. Vecchia’s fit takes its parameters from 1000 points; then it looks for neighbours, n² for \
     each variable. A prediction costs n for its mean and n² for its variance. A generation of CMA-ES costs d² for each \
     candidate and d³ for eigenvectors. A design costs its contact and its samples.";

const COLUMNS: [&str; 3] = ["size", "CPU time (s)", "exponent since the size before"];

pub(crate) const PAIRS: &[view::Pair] = &[view::Pair {
    cost: 0,
    error: 1,
    reading: Reading::Growth,
}];

/// Variables of tasks whose number of points varies: the DoE of the paper has six.
const VARIABLES: usize = 6;
/// Standard deviation of the noise of observations.
const NOISE: f64 = 0.05;
/// Number of points of a timed prediction.
const PREDICTED: usize = 200;
/// Number of generations of a timed search.
const GENERATIONS: usize = 200;

/// A task that is timed at growing sizes.
struct Step<'a> {
    /// The panel, named by the quantity that grows and the task, as in `Designs of a DoE`.
    growing: &'static str,
    /// The method, and the sizes that do not grow.
    method: String,
    unit: &'static str,
    sizes: &'a [usize],
}

impl Step<'_> {
    /// Adds a row for each size, whose CPU time in seconds `cost` measures.
    fn measure(
        &self,
        table: &mut Table,
        mut cost: impl FnMut(usize) -> anyhow::Result<f64>,
    ) -> anyhow::Result<()> {
        let mut before: Option<[f64; 2]> = None;
        for &size in self.sizes {
            let at = [size as f64, cost(size)?];
            let exponent = before.map_or(f64::NAN, |before| {
                (at[1] / before[1]).ln() / (at[0] / before[0]).ln()
            });
            before = Some(at);
            table.rows.push(Row {
                panel: self.growing.to_owned(),
                method: self.method.clone(),
                setting: match size {
                    1 => format!("1 {}", self.unit.trim_end_matches('s')),
                    _ => format!("{size} {}", self.unit),
                },
                is_campaign: false,
                values: vec![at[0], at[1], exponent],
            });
        }
        Ok(())
    }
}

pub(crate) fn run(
    problem: &Problem,
    size: Size,
    progress: &mut dyn FnMut(&str),
) -> anyhow::Result<Table> {
    let mut table = Table::new(&COLUMNS);
    let count: &[usize] = size.pick(&[500, 1000, 2000, 4000], &[250, 500, 1000], &[50, 100]);
    let variables: &[usize] = size.pick(&[2, 5, 10, 20], &[2, 5, 10, 20], &[2, 5]);
    let fixed = size.pick(1000, 300, 40);

    Step {
        growing: "Designs of a DoE",
        method: format!("maximin Latin hypercube, {VARIABLES} variables"),
        unit: "designs",
        sizes: count,
    }
    .measure(&mut table, |n| making(n, VARIABLES))?;
    Step {
        growing: "Variables of a DoE",
        method: format!("maximin Latin hypercube, {fixed} designs"),
        unit: "variables",
        sizes: variables,
    }
    .measure(&mut table, |d| making(fixed, d))?;
    progress("growth: designs of experiments");

    let mut predictions = Vec::new();
    Step {
        growing: "Points of an exact fit",
        method: format!("maximum likelihood, {VARIABLES} variables"),
        unit: "points",
        sizes: count,
    }
    .measure(&mut table, |n| {
        let (seconds, model) = fitting(n, VARIABLES, |data| fit(data, &FitOptions::default()))?;
        predictions.push(predicting(&model)?);
        Ok(seconds)
    })?;
    Step {
        growing: "Variables of an exact fit",
        method: format!("maximum likelihood, {fixed} points"),
        unit: "variables",
        sizes: variables,
    }
    .measure(&mut table, |d| {
        Ok(fitting(fixed, d, |data| fit(data, &FitOptions::default()))?.0)
    })?;
    let mut predictions = predictions.into_iter();
    Step {
        growing: "Points behind a prediction",
        method: "mean and variance by an exact model".to_owned(),
        unit: "points",
        sizes: count,
    }
    .measure(&mut table, |_| {
        predictions.next().context("a model for each number")
    })?;
    Step {
        growing: "Points of Vecchia’s fit",
        method: format!("Vecchia, {VARIABLES} variables"),
        unit: "points",
        sizes: size.pick(&[2000, 8000, 32_000], &[500, 1000, 2000], &[50, 100]),
    }
    .measure(&mut table, |n| {
        let options = VecchiaOptions::default();
        Ok(fitting(n, VARIABLES, |data| fit_vecchia(data, &options))?.0)
    })?;
    progress("growth: kriging");

    Step {
        growing: "Variables of a search",
        method: "a generation of CMA-ES without its objective".to_owned(),
        unit: "variables",
        sizes: size.pick(&[2, 5, 10, 20, 50], &[2, 5, 10, 20, 50], &[2, 5]),
    }
    .measure(&mut table, searching)?;
    let mut rng = stream(problem.campaign().seed, Purpose::Test, 3, 0);
    let pair = data::nearly_feasible(problem, &mut rng)?.next();
    let pair = pair.context("no random design is nearly feasible")?;
    let gears = problem.gears().context("the campaign designs no gears")?;
    let contact = micros(|| {
        let grid = gears.discretisation();
        gear::Pair::with_corrections(pair.input(), pair.corrections(), grid).ok()
    });
    let mut sampler = gears.sampler(&pair);
    Step {
        growing: "Samples of a design",
        method: "contact and samples".to_owned(),
        unit: "samples",
        sizes: size.pick(&[1, 10, 100, 1000], &[1, 10, 100, 1000], &[1, 10]),
    }
    .measure(&mut table, |k| {
        let samples = micros(|| {
            for sample in 0..k as u64 {
                black_box(sampler.draw(&mut stream(2009, Purpose::Test, 0, sample)));
            }
        });
        Ok(1e-6 * (contact + samples))
    })?;
    progress("growth: searches and samples");
    Ok(table)
}

/// CPU time of a maximin design, in seconds.
fn making(n: usize, d: usize) -> anyhow::Result<f64> {
    let options = doe::Options {
        seed: 2009,
        effort: 1.0,
    };
    let start = process_seconds();
    black_box(doe::Method::Maximin.design(n, d, &options)?);
    Ok(process_seconds() - start)
}

/// CPU time of `fit` in seconds, and the model: for `n` random points with noisy observations of a smooth function of
/// all `d` coordinates.
fn fitting<M>(
    n: usize,
    d: usize,
    fit: impl FnOnce(&Data<'_>) -> Result<M, ::kriging::Error>,
) -> anyhow::Result<(f64, M)> {
    let mut rng = stream(2009, Purpose::Test, n as u64, d as u64);
    let x: Vec<f64> = (0..n * d).map(|_| rng.random()).collect();
    let of = |x: &[f64]| {
        let waves = x
            .iter()
            .zip(1..)
            .map(|(x, j)| (3.0 * x).sin() / f64::from(j));
        let noise: f64 = rng.sample(StandardNormal);
        waves.sum::<f64>() + NOISE * noise
    };
    let y: Vec<f64> = x.chunks_exact(d).map(of).collect();
    let start = process_seconds();
    let model = fit(&Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &vec![NOISE * NOISE; n],
    })?;
    Ok((process_seconds() - start, model))
}

/// CPU time of one prediction in seconds.
fn predicting(model: &Model) -> anyhow::Result<f64> {
    let mut rng = stream(2009, Purpose::Test, 4, 0);
    let x: Vec<f64> = (0..PREDICTED * VARIABLES).map(|_| rng.random()).collect();
    let start = process_seconds();
    black_box(model.predict_many(&x)?);
    Ok((process_seconds() - start) / PREDICTED as f64)
}

/// CPU time of a generation of CMA-ES in `d` variables, in seconds.
fn searching(d: usize) -> anyhow::Result<f64> {
    let mut rng = stream(2009, Purpose::Test, 5, d as u64);
    let mut search = CmaEs::new(&vec![0.3; d], cmaes::Options::new(Bounds::unit(d)?))?;
    let start = process_seconds();
    for _ in 0..GENERATIONS {
        let candidates = search.ask(&mut rng);
        let value = |x: &Vec<f64>| x.iter().map(|x| (x - 0.5).powi(2)).sum();
        let values: Vec<f64> = candidates.iter().map(value).collect();
        search.tell(&values)?;
    }
    Ok((process_seconds() - start) / GENERATIONS as f64)
}
