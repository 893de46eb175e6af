//! The search for the next observation within one model.

use cmaes::{Bounds, Evaluation, Restarts, RunOptions};
use rand::{Rng, RngExt as _};
use rand_distr::StandardNormal;

use crate::criterion::{Belief, knowledge_gradient};
use crate::state::Rows;
use crate::surrogate::Surrogate;
use crate::{Criterion, Error, Known, Options};

/// Designs nearer to a failed one than this share of every range are not tried.
const FAILURE_RADIUS: f64 = 0.01;
/// Designs nearer to another one than this share of every range are the same.
const SAME: f64 = 1e-6;
/// The most promising designs that the knowledge gradient compares with.
const COMPARED: usize = 20;
/// Below this, µm, an improvement is none; designs are then compared by their lower quantile.
const NOTHING: f64 = 1e-9;
/// What lifts a quantile above every improvement in the search's objective.
const LIFT: f64 = 1e9;

/// The exact part of the problem and its cost.
pub(crate) struct Exact<'a, F> {
    pub(crate) constraints: &'a F,
    pub(crate) evaluations: u64,
}

impl<F: Fn(&[f64]) -> Option<Known>> Exact<'_, F> {
    /// What is known at `x`; its violation is NaN where it cannot be evaluated.
    fn known(&mut self, x: &[f64]) -> Known {
        self.evaluations += 1;
        (self.constraints)(x).unwrap_or(Known::from(f64::NAN))
    }
}

/// A new design and what observing it is worth, µm.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pick {
    pub(crate) x: Vec<f64>,
    pub(crate) value_um: f64,
}

/// A criterion, set up for one state of a model.
pub(crate) struct Objective<'a> {
    model: &'a Surrogate,
    options: &'a Options,
    /// The reinterpolating model, where the criterion wants one.
    reinterpolated: Option<Surrogate>,
    /// What to improve on, on the modelled scale.
    threshold: f64,
    /// Designs to compare with, for the knowledge gradient, and their means.
    compared: Vec<(Vec<f64>, f64)>,
}

impl<'a> Objective<'a> {
    /// `incumbents` are the feasible rows, or all if there are none.
    pub(crate) fn new(
        model: &'a Surrogate,
        rows: &Rows,
        incumbents: &[usize],
        options: &'a Options,
    ) -> Result<Self, Error> {
        let x = |i: &usize| rows.sampled[*i].x.as_slice();
        let baseline = |i: &usize| rows.sampled[*i].baseline_um;
        let lowest = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
        let mut compared = Vec::new();
        let mut reinterpolated = None;
        let threshold = match options.criterion {
            Criterion::ExpectedQuantileImprovement => lowest(&mut incumbents.iter().map(|i| {
                let belief = model.belief(x(i), baseline(i));
                belief.mean + options.quantile_z * belief.sd
            })),
            Criterion::ReinterpolatedExpectedImprovement => {
                let exact = model.reinterpolated(rows)?;
                let threshold = lowest(
                    &mut incumbents
                        .iter()
                        .map(|i| exact.mean_above(x(i), baseline(i))),
                );
                reinterpolated = Some(exact);
                threshold
            }
            Criterion::KnowledgeGradient => {
                compared = incumbents
                    .iter()
                    .map(|i| (x(i).to_vec(), model.mean_above(x(i), baseline(i))))
                    .collect();
                compared.sort_by(|a, b| a.1.total_cmp(&b.1));
                compared.truncate(COMPARED);
                compared.first().map_or(f64::INFINITY, |c| c.1)
            }
        };
        Ok(Self {
            model,
            options,
            reinterpolated,
            threshold,
            compared,
        })
    }

    /// What `samples` samples at `x` are worth, µm.
    pub(crate) fn value_um(&self, x: &[f64], baseline: f64, samples: u32) -> f64 {
        let options = self.options;
        match (options.criterion, &self.reinterpolated) {
            (Criterion::ReinterpolatedExpectedImprovement, Some(exact)) => {
                exact.belief(x, baseline).expected_below(self.threshold)
            }
            (Criterion::KnowledgeGradient, _) => self.knowledge_um(x, baseline, samples),
            _ => self.model.belief(x, baseline).quantile_improvement(
                self.threshold,
                self.model.noise(samples),
                options.quantile_z,
            ),
        }
    }

    fn knowledge_um(&self, x: &[f64], baseline: f64, samples: u32) -> f64 {
        let belief = self.model.belief(x, baseline);
        let points: Vec<&[f64]> = self
            .compared
            .iter()
            .map(|(x, _)| x.as_slice())
            .chain([x])
            .collect();
        // A model that cannot take the observation learns nothing from it.
        let Ok(changes) = self.model.changes(x, samples, &points) else {
            return 0.0;
        };
        let means = self.compared.iter().map(|c| c.1).chain([belief.mean]);
        let lines: Vec<(f64, f64)> = means.zip(changes).collect();
        // To first order, a fall of a logarithm is a fall of the response in proportion to it. The
        // new design may be better than all compared already before it is observed.
        let least = self.threshold.min(belief.mean);
        let fall = knowledge_gradient(&lines) + (self.threshold - least).max(0.0);
        if belief.logarithm {
            fall * least.exp()
        } else {
            fall
        }
    }

    fn belief(&self, x: &[f64], baseline: f64) -> Belief {
        self.model.belief(x, baseline)
    }
}

/// Searches `region` for the feasible design of highest value: the best of random candidates and of
/// the designs there, improved by CMA-ES with feasibility-first ranking. None if nothing feasible
/// was found.
pub(crate) fn search<F, R>(
    objective: &Objective<'_>,
    region: &[(f64, f64)],
    centre: &[f64],
    rows: &Rows,
    exact: &mut Exact<'_, F>,
    rng: &mut R,
) -> Result<Option<Pick>, Error>
where
    F: Fn(&[f64]) -> Option<Known>,
    R: Rng + ?Sized,
{
    let options = objective.options;
    let samples = options.samples_new;
    let within = Bounds::new(region.to_vec())?;
    let mut evaluate = |x: &[f64]| -> Evaluation {
        let Known {
            violation,
            baseline_um,
        } = if near_failure(x, rows, options) {
            Known::from(f64::NAN)
        } else {
            exact.known(x)
        };
        if violation.is_nan() || violation > 0.0 {
            return Evaluation {
                value: 0.0,
                violation,
            };
        }
        let value = objective.value_um(x, baseline_um, samples);
        // Where nothing is expected, the search still ought to know which way is down.
        let value = if value > NOTHING {
            -value
        } else {
            LIFT + objective
                .belief(x, baseline_um)
                .quantile_um(-options.quantile_z)
        };
        Evaluation {
            value,
            violation: 0.0,
        }
    };

    let tries = (options.search_evaluations / 4).max(1);
    let mut candidates: Vec<Vec<f64>> = Vec::with_capacity(tries);
    for k in 0..tries {
        let x: Vec<f64> = region
            .iter()
            .zip(centre)
            .map(|(&(low, high), c)| {
                if k % 2 == 0 {
                    low + (high - low) * rng.random::<f64>()
                } else {
                    let z: f64 = rng.sample(StandardNormal);
                    (c + 0.125 * (high - low) * z).clamp(low, high)
                }
            })
            .collect();
        candidates.push(x);
    }
    candidates.push(centre.to_vec());
    let mut start: Option<(Vec<f64>, Evaluation)> = None;
    for x in candidates {
        let evaluation = evaluate(&x);
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
        restarts: Restarts::FromBest { planned: 0 },
    };
    let found = match cmaes::minimise_run(&start, run, rng, &mut evaluate) {
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
    if !evaluation.is_feasible() {
        return Ok(None);
    }
    let value_um = objective.value_um(&x, exact.known(&x).baseline_um, samples);
    Ok(Some(Pick { x, value_um }))
}

/// A feasible design far from all others: the best of random ones by the distance to its nearest.
pub(crate) fn fill_space<F, R>(
    taken: &[&[f64]],
    rows: &Rows,
    options: &Options,
    exact: &mut Exact<'_, F>,
    rng: &mut R,
) -> Option<Vec<f64>>
where
    F: Fn(&[f64]) -> Option<Known>,
    R: Rng + ?Sized,
{
    let mut best: Option<(f64, Vec<f64>)> = None;
    for _ in 0..options.search_evaluations {
        let x: Vec<f64> = options
            .bounds
            .intervals()
            .iter()
            .map(|(low, high)| low + (high - low) * rng.random::<f64>())
            .collect();
        let violation = exact.known(&x).violation;
        if violation.is_nan() || violation > 0.0 || near_failure(&x, rows, options) {
            continue;
        }
        let distance = taken
            .iter()
            .map(|other| distance(&x, other, options))
            .fold(f64::INFINITY, f64::min);
        if best.as_ref().is_none_or(|(most, _)| distance > *most) {
            best = Some((distance, x));
        }
    }
    best.map(|(_, x)| x)
}

fn near_failure(x: &[f64], rows: &Rows, options: &Options) -> bool {
    let near = |failed: &Vec<f64>| distance(x, failed, options) < FAILURE_RADIUS;
    rows.failed.iter().any(near)
}

/// Whether two designs differ by rounding only.
pub(crate) fn is_same(a: &[f64], b: &[f64], options: &Options) -> bool {
    distance(a, b, options) < SAME
}

/// The largest difference of any variable, as a share of its range.
pub(crate) fn distance(a: &[f64], b: &[f64], options: &Options) -> f64 {
    options
        .bounds
        .intervals()
        .iter()
        .zip(a.iter().zip(b))
        .map(|((low, high), (a, b))| (a - b).abs() / (high - low))
        .fold(0.0, f64::max)
}
