//! Doubts about the recommended design of a campaign.

use problem::formulation::Problem;
use stages::fitting::ModelSummary;

use crate::number::{percent, shortest};
use crate::report::variable_name;
use crate::snapshot::Snapshot;

/// Distance from a bound, relative to the range, within which a value counts as at the bound.
const AT_BOUND: f64 = 1e-3;
/// Nominal coverage of the leave-one-out intervals.
const PROMISED: f64 = 0.9;

/// The doubts that the rows of a campaign show.
pub(crate) fn of(snapshot: &Snapshot) -> Vec<String> {
    let mut doubts = at_bounds(snapshot);
    if let Some((model, _)) = &snapshot.model {
        doubts.extend(of_coverage(&snapshot.problem, model));
    }
    doubts
}

/// A doubt for each continuous variable at a bound.
fn at_bounds(snapshot: &Snapshot) -> Vec<String> {
    let problem = &snapshot.problem;
    let recommended = snapshot.optima.recommended();
    let Some(best) = recommended.and_then(|best| best.optimum.feasible()) else {
        return Vec::new();
    };
    let values = problem.free_values(&best.design);
    let places = problem.unit_point(&values);
    let coordinates = problem.coordinates().iter().zip(values).zip(places);
    coordinates
        .filter(|((coordinate, _), place)| {
            let is_continuous = coordinate.values.is_empty();
            is_continuous && !(AT_BOUND..=1.0 - AT_BOUND).contains(place)
        })
        .map(|((coordinate, value), _)| {
            let [low, high] = coordinate.range;
            format!(
                "The recommended design has {} = {}, at an end of its range from {low} to {high}: a wider range \
                 may have a better design.",
                variable_name(problem, &coordinate.name),
                shortest(value, 0..=4)
            )
        })
        .collect()
}

/// A doubt about the model's intervals, if their coverage lies more than two standard deviations of the binomial
/// distribution below the nominal one.
fn of_coverage(problem: &Problem, model: &ModelSummary) -> Option<String> {
    let observations = model.residuals.len() as f64;
    let deviation = (PROMISED * (1.0 - PROMISED) / observations).sqrt();
    let remedy = match problem.campaign().kriging.calibrate {
        true => "more designs (doe.designs) make the model better",
        false => "kriging.calibrate = true widens them",
    };
    (model.coverage90 < PROMISED - 2.0 * deviation).then(|| {
        format!(
            "The intervals of the kriging model are too narrow: {} of the observations lie within their leave-one-out {} \
             intervals: {remedy}.",
            percent(model.coverage90),
            percent(PROMISED),
        )
    })
}
