//! The robust prior on the ranges.
//!
//! Where points are few for their dimension, the likelihood is often highest at ranges that vanish or grow
//! beyond all bounds. The jointly robust prior of M. Gu (Bayesian Analysis 14 (2019) 857–885) keeps the mode
//! away from both: with tⱼ = cⱼ/θⱼ, t = Σ tⱼ, its density is proportional to tᵃ exp(−b t). The constants
//! are the paper's defaults a = 0.2, b = n^(−1/d) (a + d), cⱼ = n^(−1/d) times the coordinate's extent,
//! which is 1 here.

use serde::{Deserialize, Serialize};

/// What the covariance parameters maximise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// The likelihood.
    #[default]
    Likelihood,
    /// The likelihood times the jointly robust prior of M. Gu (2019) on the inverse ranges, which keeps the
    /// ranges off zero and infinity where points are few for their dimension.
    PosteriorMode,
}

impl Estimator {
    /// −ln of the prior's density, up to a constant, where all `d` ranges are given or one stands for all.
    pub(crate) fn of_prior(self, n: usize, d: usize, ln_ranges: &[f64]) -> f64 {
        Prior::new(self, n, d, ln_ranges).map_or(0.0, |prior| prior.value())
    }
}

const A: f64 = 0.2;

/// −ln of the prior's density at one set of ranges, up to a constant, and its derivatives in ln θ.
pub(super) struct Prior {
    b: f64,
    /// tⱼ of every range.
    terms: Vec<f64>,
    t: f64,
}

impl Prior {
    /// None if the estimator has no prior.
    pub(super) fn new(
        estimator: Estimator,
        n: usize,
        d: usize,
        ln_ranges: &[f64],
    ) -> Option<Self> {
        if estimator == Estimator::Likelihood {
            return None;
        }
        let c = (n as f64).powf(-1.0 / d as f64);
        // A shared range stands for all coordinates.
        let repeated = (d / ln_ranges.len().max(1)) as f64;
        let of_range = |ln_range: &f64| repeated * c * (-ln_range).exp();
        let terms: Vec<f64> = ln_ranges.iter().map(of_range).collect();
        Some(Self {
            b: c * (A + d as f64),
            t: terms.iter().sum(),
            terms,
        })
    }

    pub(super) fn value(&self) -> f64 {
        self.b * self.t - A * self.t.ln()
    }

    /// Adds to the first elements of the gradient, and to those of the curvature, a matrix of as many rows,
    /// if it is not empty: where the prior's is indefinite, a positive semidefinite part of it.
    pub(super) fn add_derivatives(&self, gradient: &mut [f64], curvature: &mut [f64]) {
        let count = gradient.len();
        let slope = self.b - A / self.t;
        for (j, of_j) in self.terms.iter().enumerate() {
            gradient[j] -= slope * of_j;
            if curvature.is_empty() {
                continue;
            }
            for (k, of_k) in self.terms.iter().enumerate() {
                curvature[j * count + k] += A * of_j * of_k / (self.t * self.t);
            }
            curvature[j * count + j] += slope.max(0.0) * of_j;
        }
    }
}
