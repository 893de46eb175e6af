//! The search for the new design of highest value within one region.

use cmaes::{Bounds, Evaluation, Restarts, Run, RunOptions};
use rand::{Rng, RngExt as _};
use rand_distr::StandardNormal;
use rayon::prelude::*;

use crate::context::Context;
use crate::criterion::InfillCriterion;
use crate::models::Region;
use crate::{Error, ExactCriteria};

/// Value below which the criterion counts as zero; designs are then compared by their lower quantile.
const NOTHING: f64 = 1e-9;
/// Added to a lower quantile, so that it ranks behind every expected improvement.
const LIFT: f64 = 1e9;
/// Value, in units of δ, of a design that certainly keeps its limits, while no such design is known.
const FIRST: f64 = 4.0;

/// A new design and the value of observing it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) x: Vec<f64>,
    pub(crate) value: f64,
}

/// Searches a region for the feasible design of highest value: the best of random candidates, half
/// of them near the region's best design, is improved by CMA-ES with feasibility-first ranking.
/// `None` if no feasible design was found. rayon's threads share the candidates.
pub(crate) fn search<R>(
    context: &Context<'_>,
    region: &Region,
    criterion: &dyn InfillCriterion,
    rng: &mut R,
) -> Result<Option<Candidate>, Error>
where
    R: Rng + ?Sized,
{
    let options = context.options;
    let sampled = &context.rows.sampled;
    let mut incumbents = region.incumbents.iter();
    let has_feasible = incumbents.any(|&row| sampled[row].violation <= 0.0);
    let gain = |x: &[f64], criteria: &ExactCriteria| {
        let gain = if has_feasible || criteria.holds >= 1.0 {
            criteria.holds * criterion.new_design(x, criteria.baseline)
        } else {
            // Finding a design that keeps its limits is all that counts until one is known. The probability of keeping
            // many limits is tiny almost everywhere, so the value follows its order of magnitude.
            FIRST * options.delta_um / (1.0 - criteria.holds.log10())
        };
        context.probability(x) * gain
    };
    let within = Bounds::new(region.bounds.clone())?;
    let evaluate = |x: &Vec<f64>| -> Evaluation {
        let x = &context.rounded(x)[..];
        let probability = context.probability(x);
        let criteria = if probability > 0.0 {
            context.exact_criteria(x)
        } else {
            ExactCriteria::from(f64::NAN)
        };
        let violation = criteria.violation;
        if violation.is_nan() || violation > 0.0 {
            return Evaluation {
                value: 0.0,
                violation,
            };
        }
        let value = gain(x, &criteria);
        // The lower quantile guides the search where the criterion is flat, first among the designs that
        // can probably be simulated and keep their limits.
        let value = if value > NOTHING {
            -value
        } else {
            let belief = region.model.belief(x, criteria.baseline);
            let is_likely = probability >= 0.5 && criteria.holds >= 0.5;
            let lift = if is_likely { LIFT } else { 2.0 * LIFT };
            lift + belief.response_quantile(-options.quantile_z)
        };
        Evaluation {
            value,
            violation: 0.0,
        }
    };

    let centre = &context.rows.sampled[region.best].x;
    let tries = (options.search_evaluations / 4).max(1);
    let mut candidates = candidates(region, centre, tries, rng);
    candidates.push(centre.clone());
    let mut start: Option<(Vec<f64>, Evaluation)> = None;
    let evaluations: Vec<Evaluation> = candidates.par_iter().map(evaluate).collect();
    for (x, evaluation) in candidates.into_iter().zip(evaluations) {
        let better = |(_, best): &(_, Evaluation)| evaluation.is_better_than(best);
        if within.contains(&x) && start.as_ref().is_none_or(better) {
            start = Some((x, evaluation));
        }
    }
    let Some((start, first)) = start else {
        return Ok(None);
    };
    let run = RunOptions {
        search: cmaes::Options {
            step: 0.15,
            ..cmaes::Options::new(within)
        },
        evaluations: (options.search_evaluations - options.search_evaluations / 4).max(1),
        // Near `LIFT` all relative differences are tiny, so a tolerance would end the run too early.
        tolerance: 0.0,
        restarts: Restarts::FromBest,
        restart_at: None,
    };
    let mut run = Run::new(&start, run)?;
    while !run.is_finished() {
        let generation = run.ask(rng);
        // One at a time, because designs that the geometry rules out take a fraction of the time of others.
        let candidates = generation.par_iter().with_max_len(1);
        let told: Vec<Evaluation> = candidates.map(evaluate).collect();
        run.tell(&told, rng)?;
    }
    let found = match run.outcome() {
        Ok(outcome) => {
            let evaluation = Evaluation {
                value: outcome.value,
                violation: outcome.violation,
            };
            if evaluation.is_better_than(&first) {
                (outcome.x, evaluation)
            } else {
                (start, first)
            }
        }
        Err(cmaes::Error::NothingUsable { .. }) => (start, first),
        Err(error) => return Err(error.into()),
    };
    let (x, evaluation) = found;
    let x = context.rounded(&x);
    if !evaluation.is_feasible() {
        return Ok(None);
    }
    let value = gain(&x, &context.exact_criteria(&x));
    Ok(Some(Candidate { x, value }))
}

/// Random designs of a region, in turn uniform over it and normal around its centre.
fn candidates<R>(region: &Region, centre: &[f64], tries: usize, rng: &mut R) -> Vec<Vec<f64>>
where
    R: Rng + ?Sized,
{
    let mut candidates = Vec::with_capacity(tries + 1);
    for k in 0..tries {
        let sides = region.bounds.iter().zip(centre);
        let x = sides.map(|(&(low, high), c)| {
            if k % 2 == 0 {
                low + (high - low) * rng.random::<f64>()
            } else {
                let z: f64 = rng.sample(StandardNormal);
                (c + 0.125 * (high - low) * z).clamp(low, high)
            }
        });
        candidates.push(x.collect());
    }
    candidates
}
