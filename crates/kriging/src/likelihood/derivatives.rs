//! The derivatives of the likelihood, in the notation of [`super`].
//!
//! Every element of a matrix of derivatives ∂R/∂ ln θⱼ is a correlation times a function of one coordinate's
//! difference, so sums of them are dot products of the correlations, weighted, with those functions:
//! [`Kernel::log_derivative_dots`](crate::kernel::Kernel). No such matrix is ever stored.

use rayon::prelude::*;

use super::gls::Gls;
use super::{Likelihood, point};
use crate::linalg::{LowerTriangle, Spd, dot};

/// The parameters at which the derivatives are computed, with intermediate results of the value there.
pub(super) struct EvaluationPoint<'a> {
    /// Number of parameters.
    pub(super) count: usize,
    pub(super) gls: &'a Gls,
    pub(super) z: &'a [f64],
    pub(super) beta: &'a [f64],
    /// zᵀβ.
    pub(super) quadratic: f64,
    pub(super) sigma2: f64,
    pub(super) nugget: f64,
}

impl Likelihood<'_> {
    /// The index of the parameter that holds the range of column j.
    fn parameter_of(&self, j: usize) -> usize {
        if self.form.tied { 0 } else { j }
    }

    /// The gradient of the value. `inverse` is C⁻¹.
    pub(super) fn gradient(&self, at: &EvaluationPoint<'_>, inverse: &LowerTriangle) -> Vec<f64> {
        let EvaluationPoint {
            count,
            beta,
            sigma2,
            ..
        } = *at;
        // By symmetry, and with a zero diagonal, half the whole sum is that over the lower triangle.
        let of_ranges = self.dots(|k| {
            let weight = |(inverse, b): (&f64, &f64)| inverse - b * beta[k] / sigma2;
            let below = inverse.column(k).iter().zip(&beta[k..]);
            (k, below.map(weight).collect())
        });
        let mut gradient = vec![0.0; count];
        for dots in &of_ranges {
            for (j, dot) in dots.iter().enumerate() {
                gradient[self.parameter_of(j)] += dot;
            }
        }
        let diagonal: Vec<f64> = inverse.diagonal().collect();
        if self.form.nugget {
            let trace: f64 = diagonal.iter().sum();
            gradient[count - 2] = 0.5 * at.nugget / sigma2 * (trace - dot(beta, beta) / sigma2);
        }
        let noise = &self.noise;
        let trace = dot(&diagonal, noise);
        let squares: f64 = beta.iter().zip(noise).map(|(b, v)| v * b * b).sum();
        gradient[count - 1] = 0.5
            * (self.data.len() as f64
                - trace / sigma2
                - (at.quadratic - squares / sigma2) / sigma2);
        gradient
    }

    /// The average information. `factor` is that of C.
    pub(super) fn curvature(&self, at: &EvaluationPoint<'_>, factor: &Spd) -> Vec<f64> {
        let EvaluationPoint {
            count,
            z,
            beta,
            sigma2,
            ..
        } = *at;
        let n = self.data.len();
        // uⱼ = ∂C/∂ ln θⱼ β, then those of the nugget and of σ².
        let mut directions = vec![0.0; count * n];
        for (i, dots) in self.dots(|_| (0, beta.to_vec())).iter().enumerate() {
            for (j, dot) in dots.iter().enumerate() {
                directions[self.parameter_of(j) * n + i] += dot;
            }
        }
        if self.form.nugget {
            let from_nugget = &mut directions[(count - 2) * n..(count - 1) * n];
            for (u, b) in from_nugget.iter_mut().zip(beta) {
                *u = at.nugget / sigma2 * b;
            }
        }
        for (i, u) in directions[(count - 1) * n..].iter_mut().enumerate() {
            *u = z[i] - self.noise[i] * beta[i] / sigma2;
        }

        let mut solved = directions.clone();
        factor.solve(&mut solved);
        let onto_trend = |u: &[f64]| -> Vec<f64> {
            let columns = at.gls.c_inv_f().chunks(n);
            columns.map(|s| dot(u, s)).collect()
        };
        let others: Vec<Vec<f64>> = directions.chunks(n).map(onto_trend).collect();
        let mut curvature = vec![0.0; count * count];
        for (i, u) in directions.chunks(n).enumerate() {
            let mut along = others[i].clone();
            at.gls.solve(&mut along);
            for (j, v) in solved.chunks(n).enumerate() {
                curvature[i * count + j] = 0.5 * (dot(u, v) - dot(&along, &others[j])) / sigma2;
            }
        }
        curvature
    }

    /// Σᵢ wᵢ ∂Rᵢₖ/∂ ln θⱼ for every point k and column j. `weights` gives, for a point k, the first
    /// point i of the sum and the wᵢ from there on.
    fn dots(&self, weights: impl Fn(usize) -> (usize, Vec<f64>) + Sync) -> Vec<Vec<f64>> {
        let kernel = self.form.kernel;
        let of_point = |k: usize| {
            let (first, mut weights) = weights(k);
            let at = point(&self.columns, k);
            let column = |j: usize| &self.columns[j][first..];
            let mut correlations = vec![0.0; weights.len()];
            kernel.correlations(&at, column, &mut correlations);
            kernel.multiply_by_radial_factors(&at, column, &mut weights);
            for (weight, correlation) in weights.iter_mut().zip(correlations) {
                *weight *= correlation;
            }
            let mut dots = vec![0.0; at.len()];
            kernel.log_derivative_dots(&at, column, &weights, |j, dot| dots[j] = dot);
            dots
        };
        (0..self.data.len())
            .into_par_iter()
            .with_min_len(64)
            .map(of_point)
            .collect()
    }
}
