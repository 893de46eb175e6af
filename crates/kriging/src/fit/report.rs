//! Warnings about a search and its parameters.

use super::stages::{Optimum, SCREENING};
use super::starts::Search;
use crate::data::scaled::ScaledData;
use crate::likelihood::white_noise;
use crate::{Error, Warning};

/// Distance from a bound, in the logarithm, within which a parameter counts as at the bound: more
/// than the first step away from a bound, and far less than a change that predictions would show.
const NEAR: f64 = 1e-2;
/// Multiple of its lower bound below which a variance counts as at the bound: the likelihood is so
/// flat there that a search may stop on the way.
const NO_VARIANCE: f64 = 100.0;
/// Decrease of the log likelihood below which a range is not determined.
const FLAT: f64 = 0.5;
/// Distinct points per estimated parameter below which there are few of them.
const FEW: usize = 2;

/// The warning about `parameters` estimated from few points.
pub(crate) fn few_points(distinct: usize, parameters: usize) -> Option<Warning> {
    (distinct < FEW * parameters).then_some(Warning::FewPoints {
        distinct,
        parameters,
    })
}

/// The warning about a log likelihood that hardly exceeds that of a constant plus noise. `value` is
/// the model's negative log likelihood, `needed` the number of its additional parameters.
pub(crate) fn no_structure(data: &ScaledData, value: f64, needed: usize) -> Option<Warning> {
    let gain = white_noise(data) - value;
    let needed = needed as f64;
    (gain < needed).then_some(Warning::NoStructure { gain, needed })
}

/// [`Error::NoStructure`] if one of the warnings is [`Warning::NoStructure`].
pub(crate) fn check_structure(warnings: &[Warning]) -> Result<(), Error> {
    let refused = warnings.iter().find_map(|warning| match *warning {
        Warning::NoStructure { gain, needed } => Some(Error::NoStructure { gain, needed }),
        _ => None,
    });
    refused.map_or(Ok(()), Err)
}

impl Search<'_> {
    /// All warnings about the parameters at the optimum. `distinct` is the number of distinct points.
    pub(super) fn warnings(&self, optimum: &Optimum, distinct: usize) -> Vec<Warning> {
        let d = self.data.active.len();
        let trend = self.options.trend.coefficients(d);
        let few_points = few_points(distinct, self.lower.len() + trend);
        // Parameters beyond those of a constant plus noise.
        let slopes = trend - 1;
        let needed = optimum.outcome.at.len() - 1 + slopes;
        let ln_ranges = &optimum.outcome.at[..if self.tied { 1 } else { d }];
        let of_prior = self.options.estimator.penalty(d, ln_ranges);
        let value = optimum.outcome.value - of_prior;
        let no_structure = no_structure(self.data, value, needed);
        let of_points = few_points.into_iter().chain(no_structure);
        let of_search = self
            .bound_warnings(optimum)
            .into_iter()
            .chain(self.search_warnings(optimum));
        of_points.chain(of_search).collect()
    }

    /// Whether parameter p ended at its upper or its lower bound.
    fn is_at_bound(&self, at: &[f64], p: usize, upper: bool) -> bool {
        if upper {
            at[p] >= self.upper[p] - NEAR
        } else {
            at[p] <= self.lower[p] + NEAR
        }
    }

    /// The warnings about parameters that ended at a bound.
    pub(super) fn bound_warnings(&self, optimum: &Optimum) -> Vec<Warning> {
        let at = &optimum.outcome.at;
        let active = &self.data.active;
        let mut warnings = Vec::new();
        // A range that several coordinates share has a warning of its own.
        let is_shared = self.tied && active.len() > 1;
        let own_ranges = if is_shared { 0 } else { active.len() };
        for upper in [false, true] {
            let coordinates: Vec<usize> = (0..own_ranges)
                .filter(|&p| self.is_at_bound(at, p, upper))
                .map(|p| active[p])
                .collect();
            if !coordinates.is_empty() {
                warnings.push(Warning::RangesAtBound { coordinates, upper });
            }
        }
        let of_variance = |p: usize| {
            let lower = at[p] <= self.lower[p] + NO_VARIANCE.ln();
            (lower || self.is_at_bound(at, p, true)).then_some(!lower)
        };
        let last = at.len() - 1;
        let of_sigma2 = of_variance(last).map(|upper| Warning::ProcessVarianceAtBound { upper });
        warnings.extend(of_sigma2);
        if self.options.nugget.is_estimated() {
            let of_nugget = of_variance(last - 1).map(|upper| Warning::NuggetAtBound { upper });
            warnings.extend(of_nugget);
        }
        warnings
    }

    /// The warnings about the course of the search and about ranges that the data do not determine.
    pub(super) fn search_warnings(&self, optimum: &Optimum) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if !optimum.outcome.converged {
            warnings.push(Warning::NotConverged {
                iterations: optimum.outcome.iterations,
            });
        }
        if self.tied {
            warnings.push(Warning::SharedRange {
                distinct: self.data.len(),
                dimensions: self.data.active.len(),
            });
            return warnings;
        }
        let coordinates = self.flat_ranges(optimum);
        if !coordinates.is_empty() {
            warnings.push(Warning::FlatRanges { coordinates });
        }
        warnings
    }

    /// The coordinates whose ranges the data do not determine. Ranges at a bound have their own
    /// warning.
    fn flat_ranges(&self, optimum: &Optimum) -> Vec<usize> {
        let at = &optimum.outcome.at;
        let active = &self.data.active;
        // A range that some points determine is determined by all; only the others are tested on
        // all points.
        let some = self.subset(SCREENING.min(self.data.len()));
        let mut flat: Vec<usize> = (0..active.len())
            .filter(|&p| !self.is_at_bound(at, p, false) && !self.is_at_bound(at, p, true))
            .collect();
        let all = self.data.len() > some.len();
        for data in std::iter::once(&some).chain(all.then_some(self.data)) {
            flat = self.flat_ranges_on(data, optimum, flat);
        }
        flat.into_iter().map(|p| active[p]).collect()
    }

    /// The ranges of `among` that `data` do not determine.
    fn flat_ranges_on(
        &self,
        data: &ScaledData,
        optimum: &Optimum,
        among: Vec<usize>,
    ) -> Vec<usize> {
        let at = &optimum.outcome.at;
        if among.is_empty() {
            return among;
        }
        let value = |at: Vec<f64>| Some(self.value_at(data, at, optimum.jitter)?.0);
        let Some(here) = value(at.clone()) else {
            return Vec::new();
        };
        let is_flat = |p: &usize| {
            [-std::f64::consts::LN_2, std::f64::consts::LN_2]
                .into_iter()
                .all(|step| {
                    let mut moved = at.clone();
                    moved[*p] = (moved[*p] + step).clamp(self.lower[*p], self.upper[*p]);
                    value(moved).is_some_and(|there| there - here < FLAT)
                })
        };
        among.into_iter().filter(is_flat).collect()
    }
}
