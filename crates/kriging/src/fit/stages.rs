//! From starts on a few points to the optimum on all of them.

use std::borrow::Cow;

use rayon::prelude::*;
use tracing::info;

use super::newton::{Limits, Outcome, minimise};
use super::starts::{STAGED, Search, TOLERANCE};
use crate::Error;
use crate::data::scaled::ScaledData;
use crate::likelihood::{Likelihood, Order};
use crate::linalg::JITTERS;

/// Number of points on which starts are compared.
pub(super) const SCREENING: usize = 300;
/// Ratio of the numbers of points of successive stages of polishing.
const GROWTH: f64 = 2.5;
/// Number of optima found in one stage that the next stage follows.
const FOLLOWED: usize = 2;
/// Tolerance of a search on a subset, in place of [`TOLERANCE`].
pub(super) const SUBSET_TOLERANCE: f64 = 1e-2;
/// Number of points from which every likelihood is reported. One likelihood then takes about a second on one core.
const REPORTED: usize = 3000;
/// Iterations that take the curvature from the likelihood in a search on a subset, which ends early.
const RENEWED: usize = 3;
/// Iterations that take the curvature from the likelihood in the last search, which quasi-Newton updates bring to
/// convergence.
const RENEWED_LAST: usize = 2;

/// A maximum of the likelihood and the jitter of its covariance matrices.
pub(super) struct Optimum {
    pub(super) outcome: Outcome,
    pub(super) jitter: f64,
}

impl Search<'_> {
    /// The optimum of the highest likelihood found.
    pub(super) fn run(&self) -> Result<Optimum, Error> {
        let n = self.data.len();
        let mut sizes = vec![n];
        while let Some(&last) = sizes.last()
            && last > STAGED
        {
            let next = (last as f64 / GROWTH) as usize;
            sizes.push(next.max(SCREENING));
        }
        sizes.reverse();

        let mut candidates = self.screen(&self.subset(sizes[0]))?;
        for (stage, &size) in sizes.iter().enumerate() {
            let last = size == n;
            let subset = self.subset(size);
            if last && stage > 0 {
                candidates = self.best_of(&subset, candidates);
            }
            let polished: Vec<Optimum> = candidates
                .par_iter()
                .filter_map(|(start, jitter)| self.polish(&subset, start, *jitter, last))
                .collect();
            let mut distinct: Vec<Optimum> = Vec::new();
            for optimum in by_value(polished) {
                let same = |other: &Optimum| {
                    (other.outcome.value - optimum.outcome.value).abs() < 0.1
                        && distance(&other.outcome.at, &optimum.outcome.at) < 0.1
                };
                if !distinct.iter().any(same) {
                    distinct.push(optimum);
                }
            }
            if last {
                if let Some(best) = distinct.into_iter().next() {
                    return Ok(best);
                }
                break;
            }
            candidates = distinct
                .into_iter()
                .take(FOLLOWED)
                .map(|optimum| (optimum.outcome.at, optimum.jitter))
                .collect();
        }
        Err(Error::not_positive_definite(None))
    }

    /// The candidate whose likelihood on `subset` is highest: a few hundred points may have
    /// preferred another.
    fn best_of(
        &self,
        subset: &ScaledData,
        candidates: Vec<(Vec<f64>, f64)>,
    ) -> Vec<(Vec<f64>, f64)> {
        if candidates.len() < 2 {
            return candidates;
        }
        let value = |(at, jitter): &(Vec<f64>, f64)| {
            let mut likelihood = Likelihood::new(self.form(), Cow::Borrowed(subset), *jitter);
            let evaluation = likelihood.evaluate(at, Order::Value);
            evaluation.map_or(f64::INFINITY, |evaluation| evaluation.value)
        };
        let values: Vec<f64> = candidates.par_iter().map(value).collect();
        let by_value = candidates.into_iter().zip(values);
        let best = by_value.min_by(|(_, a), (_, b)| a.total_cmp(b));
        best.into_iter().map(|(candidate, _)| candidate).collect()
    }

    /// Searches from `start`. The jitter grows while the search keeps running into matrices that are
    /// not positive definite and more jitter raises the likelihood.
    pub(super) fn polish(
        &self,
        subset: &ScaledData,
        start: &[f64],
        jitter: f64,
        last: bool,
    ) -> Option<Optimum> {
        let limits = Limits {
            lower: &self.lower,
            upper: &self.upper,
            max_iterations: self.options.max_iterations,
            renewed: if last { RENEWED_LAST } else { RENEWED },
            tolerance: if last {
                self.tolerance
            } else {
                SUBSET_TOLERANCE
            },
        };
        let mut likelihood = Likelihood::new(self.form(), Cow::Borrowed(subset), jitter);
        let points = subset.len();
        let mut likelihoods = 0;
        let mut best: Option<Optimum> = None;
        for jitter in JITTERS.into_iter().filter(|j| *j >= jitter) {
            likelihood.jitter = jitter;
            let from = best.as_ref().map_or(start, |optimum| &optimum.outcome.at);
            let evaluate = |at: &[f64], curvature: bool| {
                let order = if curvature {
                    Order::Curvature
                } else {
                    Order::Gradient
                };
                let evaluation = likelihood.evaluate(at, order);
                likelihoods += 1;
                if points >= REPORTED {
                    let found = evaluation.as_ref().map(|evaluation| evaluation.value);
                    info!(
                        points,
                        likelihoods,
                        negative_log_likelihood = found,
                        "searching the parameters"
                    );
                }
                evaluation
            };
            let Some(outcome) = minimise(evaluate, from, &limits) else {
                continue;
            };
            let better = best
                .as_ref()
                .is_none_or(|b| outcome.value < b.outcome.value - TOLERANCE);
            if !better {
                break;
            }
            let met_failure = outcome.met_failure;
            best = Some(Optimum { outcome, jitter });
            if !met_failure {
                break;
            }
        }
        best
    }
}

/// The optima, the highest likelihood first.
fn by_value(mut optima: Vec<Optimum>) -> Vec<Optimum> {
    optima.sort_by(|a, b| a.outcome.value.total_cmp(&b.outcome.value));
    optima
}

/// The largest difference of a parameter.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}
