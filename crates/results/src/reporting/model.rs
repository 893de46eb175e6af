//! The kriging model, for the report: its quality, its parameters, and what it says.

use campaign::Design;
use kriging::Surrogate;
use stages::fitting::ModelSummary;
use stats::SensitivityPlan;
use stats::streams::{Purpose, stream};

use crate::report::{KrigingFit, LeaveOneOut, Parameter, Slice, VariableIndices, variable_name};
use crate::snapshot::Snapshot;

/// Points of a slice.
const POINTS: usize = 31;
/// Rows of the plan for Sobol' indices.
const ROWS: usize = 512;
/// Names the random numbers of the indices' intervals, which the report does not show.
const STREAM: u64 = 3;

/// The model of the percentile, if there is one, with slices through `through`.
pub(super) fn kriging(
    snapshot: &Snapshot,
    through: Option<&Design>,
) -> anyhow::Result<Option<KrigingFit>> {
    let Some((model, surrogate)) = &snapshot.model else {
        return Ok(None);
    };
    let problem = &snapshot.problem;
    let percentile = problem.campaign().sampling.percentile_name();
    let parameter = |name: &str, value: f64, unit: &str| Parameter {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
    };
    let unit = &*problem.sampled().unit;
    let squared = match unit {
        "" => String::new(),
        unit => format!("{unit}²"),
    };
    let mut parameters = vec![
        parameter("µ", model.mu, unit),
        parameter("σ²", model.sigma2, &squared),
        parameter("−log likelihood", model.negative_log_likelihood, ""),
    ];
    parameters.extend(
        problem
            .free_names()
            .zip(&model.ranges)
            .map(|(name, range)| {
                let name = variable_name(&snapshot.problem, name);
                parameter(&format!("range in {name}"), range.unwrap_or(f64::NAN), "")
            }),
    );
    let slices = match through {
        Some(design) => slices(snapshot, surrogate, design)?,
        None => Vec::new(),
    };
    let left_out = model.leave_one_out();
    let left_out = left_out.map(|point| LeaveOneOut {
        design: point.number,
        standardised: point.standardised,
        observed: point.observed,
        predicted: point.predicted,
    });
    Ok(Some(KrigingFit {
        title: format!("{percentile} over {}", fitted_to(snapshot, model)),
        unit: unit.to_owned(),
        kernel: model.kernel.clone(),
        parameters,
        q2: model.q2,
        rmse: model.rmse,
        coverage_90: model.coverage90,
        warnings: model.warnings.clone(),
        leave_one_out: left_out.collect(),
        slices,
        indices: indices(snapshot, surrogate)?,
    }))
}

/// What the model was fitted to, in words.
fn fitted_to(snapshot: &Snapshot, model: &ModelSummary) -> String {
    let is_of_doe = |(number, _): &&(u64, f64)| *number < snapshot.designs.len() as u64;
    let designs = model.residuals.iter().filter(is_of_doe).count();
    match model.residuals.len() - designs {
        0 => format!("{} designs", model.points),
        infill => format!("{designs} designs and {infill} infill points"),
    }
}

/// The model along each variable of the DoE, with the others at a design.
fn slices(
    snapshot: &Snapshot,
    surrogate: &Surrogate,
    design: &Design,
) -> anyhow::Result<Vec<Slice>> {
    let centre = snapshot.problem.free_values(design);
    let coordinates = snapshot.problem.coordinates().iter().enumerate();
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
            let symbol = variable_name(&snapshot.problem, &coordinate.name);
            Ok(Slice {
                variable: coordinate.name.to_string(),
                label: match &*coordinate.unit {
                    "" => symbol,
                    unit => format!("{symbol} ({unit})"),
                },
                at: centre[j],
                points: points.collect(),
            })
        })
        .collect()
}

/// Sobol' indices of the model's mean over the box of the DoE; none of a model that does not vary.
fn indices(snapshot: &Snapshot, surrogate: &Surrogate) -> anyhow::Result<Vec<VariableIndices>> {
    let problem = &snapshot.problem;
    let seed = problem.campaign().seed;
    let Ok(plan) = SensitivityPlan::new(problem.dimension(), ROWS, seed as u32) else {
        // Of one variable among more than the sequence has dimensions nothing is said.
        return Ok(Vec::new());
    };
    let points = (0..plan.len()).flat_map(|index| problem.free_point(&plan.point(index)));
    let outputs = surrogate.means(&points.collect::<Vec<_>>())?;
    let rng = &mut stream(seed, Purpose::Test, STREAM, 0);
    let Ok(found) = plan.analyse(&outputs, 40, rng) else {
        return Ok(Vec::new());
    };
    let names = problem.free_names();
    let both = found.first.iter().zip(&found.total);
    Ok(names
        .zip(both)
        .map(|(name, (first, total))| VariableIndices {
            variable: variable_name(&snapshot.problem, name),
            first: first.value,
            total: total.value,
        })
        .collect())
}
