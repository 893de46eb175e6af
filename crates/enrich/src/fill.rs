//! Space-filling infill, for rounds in which no model can choose.

use rand::{Rng, RngExt as _};

use crate::batch::Batch;
use crate::context::Context;
use crate::{Infill, Reason};

/// Fills the batch with feasible designs far from all others.
pub(crate) fn fill(context: &Context<'_>, batch: &mut Batch) {
    let options = context.options;
    for turn in 0..options.batch {
        if batch.left < options.samples_new {
            break;
        }
        let found = far_from_others(context, batch, &mut context.rng(options.batch + turn))
            .or_else(|| by_violation(context, batch, &mut context.rng(2 * options.batch + turn)));
        let Some(x) = found else {
            break;
        };
        batch.left -= options.samples_new;
        batch.infill.push(Infill::New {
            x,
            samples: options.samples_new,
            value: 0.0,
            reason: Reason::SpaceFilling,
        });
    }
}

/// A uniformly distributed design of the box.
fn random_design<R: Rng + ?Sized>(context: &Context<'_>, rng: &mut R) -> Vec<f64> {
    let intervals = context.options.bounds.intervals().iter();
    let x = intervals.map(|(low, high)| low + (high - low) * rng.random::<f64>());
    context.rounded(&x.collect::<Vec<_>>())
}

/// The random feasible design with the largest distance to the nearest other one, weighted by the probability that it
/// can be simulated.
fn far_from_others<R>(context: &Context<'_>, batch: &Batch, rng: &mut R) -> Option<Vec<f64>>
where
    R: Rng + ?Sized,
{
    let rows = &context.rows;
    let taken: Vec<&[f64]> = rows
        .sampled
        .iter()
        .map(|row| row.x.as_slice())
        .chain(rows.failed.iter().map(Vec::as_slice))
        .chain(batch.new_designs())
        .collect();
    let mut best: Option<(f64, Vec<f64>)> = None;
    for _ in 0..context.options.search_evaluations {
        let x = random_design(context, rng);
        let violation = context.exact_criteria(&x).violation;
        let probability = context.probability(&x);
        if violation.is_nan() || violation > 0.0 || probability == 0.0 {
            continue;
        }
        let distance = taken
            .iter()
            .map(|other| context.distance(&x, other))
            .fold(f64::INFINITY, f64::min);
        let distance = probability * distance;
        if best.as_ref().is_none_or(|(most, _)| distance > *most) {
            best = Some((distance, x));
        }
    }
    best.map(|(_, x)| x)
}

/// A feasible design found by minimising the constraint violation, for when no random design is
/// feasible.
fn by_violation<R>(context: &Context<'_>, batch: &Batch, rng: &mut R) -> Option<Vec<f64>>
where
    R: Rng + ?Sized,
{
    let start = random_design(context, rng);
    let run = cmaes::RunOptions {
        search: cmaes::Options::new(context.options.bounds.clone()),
        evaluations: context.options.search_evaluations,
        tolerance: 0.0,
        restarts: cmaes::Restarts::FromBest,
        restart_at: None,
    };
    let mut violation = |x: &[f64]| cmaes::Evaluation {
        value: 0.0,
        violation: context.exact_criteria(&context.rounded(x)).violation,
    };
    let found = cmaes::minimise_run(&start, run, rng, &mut violation).ok()?;
    let x = context.rounded(&found.x);
    let is_new = !batch.new_designs().any(|other| context.is_same(other, &x));
    (found.violation <= 0.0 && is_new).then_some(x)
}
