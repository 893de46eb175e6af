//! Slices and Sobol' indices of the kriging model, and of the random inputs at the recommended design.

use problem::Design;
use problem::task::random_values;
use stages::names;
use stats::streams::{Purpose, stream};
use stats::{SensitivityPlan, main_effect};

use super::quantity::{label, variable_name};
use crate::snapshot::Snapshot;

/// Points of a slice.
const POINTS: usize = 31;
/// Rows of the plan for Sobol' indices.
const ROWS: usize = 512;
/// The stream of the random numbers for the indices' intervals, which the report does not show.
const STREAM: u64 = 3;

/// The model along one variable, with all others at the recommended design.
#[derive(Debug, Clone, PartialEq)]
pub struct Slice {
    /// The variable's name, for the chart's file.
    pub variable: String,
    /// The axis's label.
    pub label: String,
    /// The recommended design's value.
    pub at: f64,
    /// Value of the variable, mean, lower and upper end of the 95 % interval.
    pub points: Vec<[f64; 4]>,
}

/// Sobol' indices of one variable.
#[derive(Debug, Clone, PartialEq)]
pub struct VariableIndices {
    pub variable: String,
    /// First-order index: the variable's effect alone. The estimate of a small index may be negative.
    pub first: f64,
    /// Total index: the variable's effect including its interactions. The estimate of a small index may be negative.
    pub total: f64,
}

/// The share of one random input in the scatter of the response.
#[derive(Debug, Clone, PartialEq)]
pub struct ScatterShare {
    pub input: String,
    /// First-order Sobol' index, 0 to 1.
    pub share: f64,
}

/// The shares of the random inputs in the variance of the recommended optimum's verification samples, the largest
/// first. Empty without inputs that the campaign states, or with too few samples.
pub(super) fn scatter(snapshot: &Snapshot) -> Vec<ScatterShare> {
    let problem = &snapshot.problem;
    let (Some(inputs), Some(best)) = (problem.random(), snapshot.optima.recommended()) else {
        return Vec::new();
    };
    let (Some(found), stream) = (
        best.optimum.feasible(),
        names::verification(best.optimum.approach),
    ) else {
        return Vec::new();
    };
    let known = (0..)
        .zip(best.values(problem))
        .filter_map(|(sample, value)| {
            let values = random_values(problem, stream, &found.design, sample)?;
            value.is_finite().then_some((values, value))
        });
    let (values, output): (Vec<Vec<f64>>, Vec<f64>) = known.unzip();
    let named = inputs.quantities().iter().enumerate();
    let mut shares: Vec<ScatterShare> = named
        .filter_map(|(place, input)| {
            let column: Vec<f64> = values.iter().map(|values| values[place]).collect();
            Some(ScatterShare {
                input: input.name.to_string(),
                share: main_effect(&column, &output)?,
            })
        })
        .collect();
    shares.sort_by(|a, b| b.share.total_cmp(&a.share));
    shares
}

/// The model along each variable of the DoE through a design.
pub(super) fn slices(snapshot: &Snapshot, design: Option<&Design>) -> anyhow::Result<Vec<Slice>> {
    let (Some((_, surrogate)), Some(design)) = (&snapshot.model, design) else {
        return Ok(Vec::new());
    };
    let problem = &snapshot.problem;
    let centre = problem.free_values(design);
    let coordinates = problem.coordinates().iter().enumerate();
    coordinates
        .map(|(j, coordinate)| {
            let [low, high] = coordinate.range;
            let value = |k: usize| low + (high - low) * k as f64 / (POINTS - 1) as f64;
            let x = (0..POINTS).flat_map(|k| {
                let mut x = centre.clone();
                x[j] = value(k);
                x
            });
            let predictions = surrogate.predict_many(&x.collect::<Vec<_>>())?;
            let points = predictions.into_iter().enumerate().map(|(k, prediction)| {
                let ends = [0.025, 0.975].map(|level| surrogate.quantile(prediction, level));
                [value(k), prediction.mean, ends[0], ends[1]]
            });
            Ok(Slice {
                variable: coordinate.name.to_string(),
                label: label(&variable_name(problem, &coordinate.name), &coordinate.unit),
                at: centre[j],
                points: points.collect(),
            })
        })
        .collect()
}

/// Sobol' indices of the model's mean over the box of the DoE. Empty if the model does not vary, or has more
/// variables than the plan's sequence has dimensions.
pub(super) fn indices(snapshot: &Snapshot) -> anyhow::Result<Vec<VariableIndices>> {
    let Some((_, surrogate)) = &snapshot.model else {
        return Ok(Vec::new());
    };
    let problem = &snapshot.problem;
    let seed = problem.campaign().seed;
    let Ok(plan) = SensitivityPlan::new(problem.dimension(), ROWS, seed as u32) else {
        return Ok(Vec::new());
    };
    let points = (0..plan.len()).flat_map(|index| problem.free_point(&plan.point(index)));
    let outputs = surrogate.means(&points.collect::<Vec<_>>())?;
    let rng = &mut stream(seed, Purpose::Test, STREAM, 0);
    let Ok(found) = plan.analyse(&outputs, 40, rng) else {
        return Ok(Vec::new());
    };
    let both = found.first.iter().zip(&found.total);
    Ok(problem
        .free_names()
        .zip(both)
        .map(|(name, (first, total))| VariableIndices {
            variable: variable_name(problem, name),
            first: first.value,
            total: total.value,
        })
        .collect())
}
