//! `coordinator sensitivity`: how the recommended design's P90 depends on the scenario of wear, and
//! on tolerances.
//!
//! Two questions, two tables. The first varies one parameter of the wear field at a time by a factor
//! and samples again. The second lets small deviations of all inputs (see `inputs`) vary together and splits the
//! variance that follows among them (Sobol' indices).

use std::ops::Range;

use anyhow::{Context as _, anyhow};
use problem::formulation::Problem;
use problem::formulation::gears::LoadedCases;
use problem::optimise::COMMON;
use problem::task::VERIFICATION;
use rayon::prelude::*;
use stats::streams::{Purpose, stream};
use stats::{IntervalEstimate, Sensitivity, SensitivityPlan};

use crate::finished::FeasibleOptimum;
use crate::samples::in_pieces;

mod inputs;
mod tables;

pub use inputs::{Input, Tolerances};
use inputs::{Nominal, WEAR};
pub use tables::write_tables;

/// The stream of the wear profiles from which the field of a single sample is drawn.
const FIELDS: u64 = (1 << 40) + 1;

/// Number of bootstrap samples behind an interval.
const RESAMPLES: usize = 1000;

/// Text of the error for a campaign of another kind, which the commands refuse.
const NO_GEARS: &str = "a campaign of gears is needed";

/// A changed parameter of the wear field, with the percentile that follows.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// The parameter that is changed.
    pub parameter: &'static str,
    /// The factor by which it is changed.
    pub factor: f64,
    /// P90 from the campaign's number of verification samples.
    pub p90: IntervalEstimate,
}

/// The indices of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Indices {
    /// The output, in words.
    pub output: String,
    pub inputs: Vec<Input>,
    /// The indices of all inputs.
    pub sensitivity: Sensitivity,
}

/// P90 of the design as verified, and with the wear field's variance, range and depth halved and
/// doubled. The random numbers are those of the verification.
///
/// # Errors
///
/// The design cannot be simulated, which is not expected for one from the campaign's store.
pub fn scenarios(problem: &Problem, optimum: &FeasibleOptimum) -> anyhow::Result<Vec<Scenario>> {
    let gears = problem.gears().context(NO_GEARS)?;
    let pair = gears.pair(&optimum.design)?;
    let mut scenarios = vec![("as designed", 1.0, *gears.wear())];
    for (parameter, change) in WEAR {
        scenarios.extend([0.5, 2.0].map(|factor| {
            let mut wear = *gears.wear();
            change(&mut wear, factor);
            (parameter, factor, wear)
        }));
    }
    scenarios
        .into_par_iter()
        .map(|(parameter, factor, wear)| {
            let samples = in_pieces(optimum.verified.len() as u32, |samples| {
                let cases = gears.cases_of(pair.clone(), &wear)?;
                draw(problem, &cases, VERIFICATION, samples)
            })?;
            Ok(Scenario {
                parameter,
                factor,
                p90: problem.campaign().sampling.verified(&samples)?,
            })
        })
        .collect()
}

/// Samples of the objective ΔSTE of a loaded pair, µm, which combines the values of all cases. Sample i uses the stream
/// (campaign's seed, purpose, number, i).
fn draw(
    problem: &Problem,
    cases: &LoadedCases,
    (purpose, number): (Purpose, u64),
    samples: Range<u32>,
) -> anyhow::Result<Vec<f64>> {
    let mut sampler = cases.sampler();
    let seed = problem.campaign().seed;
    let mut all = stats::Samples::none(problem.sampled().len());
    for index in samples {
        let sample = sampler.draw(&mut stream(seed, purpose, number, index.into()));
        let checked = problem.check_sample(&sample);
        checked.map_err(|(name, why)| anyhow!("{name} of sample {index} {why}"))?;
        all.push(&sample);
    }
    Ok(problem.objective().values(&all))
}

/// First-order and total indices of two outputs: P90 from the common samples of a direct search, and ΔSTE of one worn
/// pair. The wear field of that pair is an additional input, which includes the deviations of manufacture if the
/// campaign has a scatter of them. Each analysis has `rows` rows.
///
/// # Errors
///
/// The design has no module, tolerances leave no design that can be simulated, nothing varies, or
/// the simulator fails.
pub fn indices(
    problem: &Problem,
    optimum: &FeasibleOptimum,
    tolerances: &Tolerances,
    rows: usize,
) -> anyhow::Result<Vec<Indices>> {
    let sampling = &problem.campaign().sampling;
    let nominal = Nominal::new(problem, optimum.design.clone(), tolerances)?;
    let inputs = nominal.inputs();
    let of_percentile = |point: &[f64]| -> anyhow::Result<f64> {
        let Some(cases) = nominal.deviated(point) else {
            return Ok(f64::NAN);
        };
        let samples = draw(problem, &cases, COMMON, 0..sampling.samples_per_design)?;
        Ok(sampling
            .verified(&samples)
            .map_or(f64::NAN, |p90| p90.value))
    };
    let of_sample = |point: &[f64]| -> anyhow::Result<f64> {
        let Some(cases) = nominal.deviated(point) else {
            return Ok(f64::NAN);
        };
        // The field is drawn from 2³² numbered ones, so that its number is a uniform input.
        let number = (point[inputs.len()] * f64::from(u32::MAX)) as u32;
        let number = number.min(u32::MAX - 1);
        let fields = (Purpose::Wear, FIELDS);
        let samples = draw(problem, &cases, fields, number..number + 1)?;
        Ok(samples[0])
    };
    // One stream per sample draws the wear and the deviations of manufacture.
    let gears = problem.gears().context(NO_GEARS)?;
    let field = match gears.scatter() == gear::Scatter::default() {
        true => "wear field",
        false => "wear field and manufacture",
    };
    let field = Input {
        name: field.to_owned(),
        deviation: None,
        unit: "",
    };
    let with_field = [&inputs[..], &[field]].concat();
    let seed = problem.campaign().seed;
    let measure = problem.campaign().measure_name();
    Ok(vec![
        analyse(seed, rows, 0, &measure, inputs.clone(), of_percentile)?,
        analyse(
            seed,
            rows,
            1,
            "ΔSTE of one worn pair",
            with_field,
            of_sample,
        )?,
    ])
}

/// The indices of the output `value` of a point. `number` distinguishes the analyses of a campaign.
fn analyse(
    seed: u64,
    rows: usize,
    number: u32,
    output: &str,
    inputs: Vec<Input>,
    value: impl Fn(&[f64]) -> anyhow::Result<f64> + Sync,
) -> anyhow::Result<Indices> {
    let plan = SensitivityPlan::new(inputs.len(), rows, number)?;
    let outputs: anyhow::Result<Vec<f64>> = (0..plan.len())
        .into_par_iter()
        .map(|index| value(&plan.point(index)))
        .collect();
    let mut rng = stream(seed, Purpose::Wear, FIELDS + 1, u64::from(number));
    let sensitivity = plan
        .analyse(&outputs?, RESAMPLES, &mut rng)
        .with_context(|| format!("the indices of {output}"))?;
    Ok(Indices {
        output: output.to_owned(),
        inputs,
        sensitivity,
    })
}

#[cfg(test)]
mod tests;
