//! A weakly informative prior on the ranges.
//!
//! When points are few for their dimension, the likelihood is often highest at ranges that
//! functions in practice do not have. The prior is log-normal for every range in units of its
//! coordinate's extent, ln θ ~ N(√2 + ½ ln d, 3): distances grow with √d, and so do the ranges that
//! make sense (C. Hvarfner, E. O. Hellsten, L. Nardi, *Vanilla Bayesian optimization performs great
//! in high dimensions*, ICML 2024). The prior is weak: a few points per dimension more overrule it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The criterion that the covariance parameters maximise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// The likelihood.
    #[default]
    Likelihood,
    /// The likelihood times a log-normal prior on the ranges, for few points per dimension.
    PosteriorMode,
}

impl Estimator {
    /// −ln of the prior's density, up to a constant, at all `d` ranges or at one that all
    /// coordinates share.
    pub(crate) fn penalty(self, d: usize, ln_ranges: &[f64]) -> f64 {
        Prior::new(self, d, ln_ranges).map_or(0.0, |prior| prior.value())
    }
}

/// Variance of ln θ.
const VARIANCE: f64 = 3.0;

/// −ln of the prior's density at one set of ranges, up to a constant, and its derivatives in ln θ.
pub(super) struct Prior {
    /// ln θ minus its mean, for each range.
    deviations: Vec<f64>,
    /// Number of coordinates that share each range.
    repeated: f64,
}

impl Prior {
    /// `None` if the estimator has no prior.
    pub(super) fn new(estimator: Estimator, d: usize, ln_ranges: &[f64]) -> Option<Self> {
        if estimator == Estimator::Likelihood {
            return None;
        }
        let mean = std::f64::consts::SQRT_2 + 0.5 * (d as f64).ln();
        Some(Self {
            deviations: ln_ranges.iter().map(|ln_range| ln_range - mean).collect(),
            repeated: (d / ln_ranges.len().max(1)) as f64,
        })
    }

    pub(super) fn value(&self) -> f64 {
        let squares: f64 = self.deviations.iter().map(|z| z * z).sum();
        0.5 * self.repeated * squares / VARIANCE
    }

    /// Adds the derivatives to the first elements of the gradient and of the diagonal of the
    /// curvature, a matrix with as many rows as the gradient, or empty.
    pub(super) fn add_derivatives(&self, gradient: &mut [f64], curvature: &mut [f64]) {
        let count = gradient.len();
        for (j, z) in self.deviations.iter().enumerate() {
            gradient[j] += self.repeated * z / VARIANCE;
            if let Some(element) = curvature.get_mut(j * count + j) {
                *element += self.repeated / VARIANCE;
            }
        }
    }
}
