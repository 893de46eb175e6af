//! The derivatives of the likelihood, as [`super`] has them.

use pulp::{Arch, Simd, WithSimd};

use super::{Likelihood, dot};
use crate::covariance::{coordinates, noise_ratio};
use crate::gls::Gls;
use crate::kernel::LANES;
use crate::panels::{
    Column, Lower, ROWS, SingleInverse, invert_transposed, panels, rows, solve, square,
};
use crate::probes::Probes;

/// Columns whose weights in the gradient are computed together: they stay in the first-level cache.
const RUN: usize = 64;

/// From so many points on, where it takes most of the time, the gradient's inverse is computed in single
/// precision.
pub(super) const SINGLE_FROM: usize = 1000;

/// The largest [`Gradient::rounding`] of an inverse in single precision that is taken. The derivatives' errors
/// are smaller (docs/kriging.md), too small to mean anything to a log likelihood.
const ROUGH: f64 = 0.3;

/// Where the derivatives are wanted.
pub(super) struct At<'a> {
    /// Number of parameters.
    pub(super) count: usize,
    pub(super) z: &'a [f64],
    pub(super) beta: &'a [f64],
    /// zᵀβ.
    pub(super) quadratic: f64,
    pub(super) sigma2: f64,
    pub(super) nugget: f64,
}

/// The gradient and how accurate it is.
pub(super) struct Gradient {
    pub(super) slopes: Vec<f64>,
    /// What rounding makes of C⁻¹C's diagonal, whose elements are sums with the gradient's weights, too:
    /// √Σ((C⁻¹C)ᵢᵢ − 1)². A sum of squares, so that no errors cancel. Of random vectors it says nothing.
    pub(super) rounding: f64,
    /// Whether an inverse in single precision was too rough.
    pub(super) needed_double: bool,
}

/// C⁻¹ or a random matrix in its place.
enum Inverse<'a> {
    Whole(&'a Lower),
    Single(&'a SingleInverse),
    Sampled(Probes),
}

impl Inverse<'_> {
    /// Panel p in double precision, computed in `memory` where it is not there: the whole matrix would be
    /// memory to no purpose.
    fn panel<'b>(&'b self, p: usize, memory: &'b mut Vec<Column>) -> &'b [Column] {
        memory.resize((p + 1) * ROWS, Column([0.0; ROWS]));
        match self {
            Self::Whole(matrix) => return matrix.panel(p),
            Self::Single(inverse) => inverse.panel(p, memory),
            Self::Sampled(probes) => probes.panel(p, memory),
        }
        memory
    }
}

impl Likelihood<'_> {
    /// The index of the parameter that holds the range of column j.
    fn parameter_of(&self, j: usize) -> usize {
        if self.form.tied { 0 } else { j }
    }

    /// The gradient, from random vectors if these are asked for, from an inverse in single precision as long
    /// as that is accurate enough, or from one in double precision.
    pub(super) fn best_gradient(&mut self, at: &At<'_>) -> Gradient {
        if self.probes > 0 {
            let probes = Probes::new(&self.factor, self.probes);
            return self.gradient(at, &Inverse::Sampled(probes));
        }
        let needed_double = if self.tries_single() {
            self.single.invert(&self.factor);
            let gradient = self.gradient(at, &Inverse::Single(&self.single));
            // Not so where it is NaN.
            if gradient.rounding <= ROUGH {
                return gradient;
            }
            self.single = SingleInverse::default();
            true
        } else {
            false
        };
        invert_transposed(&self.factor, &mut self.half_inverse);
        square(&self.half_inverse, &mut self.inverse);
        Gradient {
            needed_double,
            ..self.gradient(at, &Inverse::Whole(&self.inverse))
        }
    }

    fn gradient(&self, at: &At<'_>, inverse: &Inverse<'_>) -> Gradient {
        let At {
            count,
            beta,
            quadratic,
            sigma2,
            nugget,
            ..
        } = *at;
        let n = self.data.len();
        let kernel = self.form.kernel;
        let mut gradient = vec![0.0; count];
        let mut sums = vec![[0.0; LANES]; self.columns.len()];
        let mut diagonal = Vec::with_capacity(n);
        // The weights off the diagonal, added up by rows.
        let mut of_points = vec![0.0; n];
        let mut weights = [Column([0.0; ROWS]); RUN];
        let mut memory = Vec::new();
        for p in 0..panels(n) {
            let own = rows(p, n);
            let points = coordinates(&self.columns, p);
            let of_rows = padded(&beta[own.clone()]);
            let inverse = inverse.panel(p, &mut memory);
            let correlation = self.correlation.panel(p);
            let mut below = Column([0.0; ROWS]);
            diagonal.extend(own.clone().map(|i| inverse[i].0[i - own.start]));
            for first in (0..own.end).step_by(RUN) {
                let run = first..(first + RUN).min(own.end);
                let columns: Vec<&[f64]> = self.columns.iter().map(|c| &c[run.clone()]).collect();
                let weights = &mut weights[..run.len()];
                Arch::new().dispatch(Weights {
                    inverse: &inverse[run.clone()],
                    correlation: &correlation[run.clone()],
                    across: &beta[run.clone()],
                    along: &of_rows,
                    sigma2,
                    weights,
                });
                leave_below_diagonal(weights, run.start, p * ROWS);
                for (weights, of_point) in weights.iter().zip(&mut of_points[run.clone()]) {
                    for (sum, weight) in below.0.iter_mut().zip(weights.0) {
                        *sum += weight;
                    }
                    *of_point += total(weights);
                }
                self.multiply_by_radial_factors(&points, run.start, weights);
                kernel.log_derivative_dots_of_panel(&points, &columns, weights, &mut sums);
            }
            for (of_point, sum) in of_points[own].iter_mut().zip(below.0) {
                *of_point += sum;
            }
        }
        for (j, sums) in sums.iter().enumerate() {
            gradient[self.parameter_of(j)] += sums.iter().sum::<f64>();
        }
        if self.form.nugget {
            let sum: f64 = (0..n)
                .map(|i| diagonal[i] - beta[i] * beta[i] / sigma2)
                .sum();
            gradient[count - 2] = 0.5 * nugget / sigma2 * sum;
        }
        let noise = &self.noise;
        let trace = dot(&diagonal, noise);
        let squares: f64 = beta.iter().zip(noise).map(|(b, v)| v * b * b).sum();
        gradient[count - 1] =
            0.5 * (n as f64 - trace / sigma2 - (quadratic - squares / sigma2) / sigma2);
        Gradient {
            slopes: gradient,
            rounding: self.rounding(at, &diagonal, &of_points),
            needed_double: false,
        }
    }

    /// [`Gradient::rounding`] from the diagonal of C⁻¹ and the sums of every row's weights off the diagonal:
    /// ((C⁻¹ − ββᵀ/σ²) C)ᵢᵢ = 1 − βᵢzᵢ/σ².
    fn rounding(&self, at: &At<'_>, diagonal: &[f64], of_points: &[f64]) -> f64 {
        let At {
            z, beta, sigma2, ..
        } = *at;
        let error = |(i, sum): (usize, &f64)| {
            let element = 1.0 + self.jitter + noise_ratio(self.noise[i], sigma2);
            let own = element * (diagonal[i] - beta[i] * beta[i] / sigma2);
            sum + own - (1.0 - beta[i] * z[i] / sigma2)
        };
        let errors = of_points.iter().enumerate().map(error);
        errors.map(|error| error * error).sum::<f64>().sqrt()
    }

    /// Multiplies the weights of the derivatives of a panel's correlations, from column `first` on, by a
    /// radial kernel's common factors. The panel's points are `points`.
    fn multiply_by_radial_factors(
        &self,
        points: &[[f64; ROWS]],
        first: usize,
        weights: &mut [Column],
    ) {
        if !self.form.kernel.is_radial() {
            return;
        }
        let mut squares = [0.0; ROWS];
        for (k, weights) in (first..).zip(weights) {
            let at: Vec<f64> = self.columns.iter().map(|column| column[k]).collect();
            self.form.kernel.multiply_by_radial_factors(
                &at,
                |j| &points[j],
                &mut squares,
                &mut weights.0,
            );
        }
    }

    pub(super) fn curvature(&self, at: &At<'_>, gls: &Gls) -> Vec<f64> {
        let At {
            count,
            z,
            beta,
            sigma2,
            nugget,
            ..
        } = *at;
        let n = self.data.len();
        let mut directions = vec![0.0; count * n];
        let kernel = self.form.kernel;
        let mut factors = Vec::new();
        for p in 0..panels(n) {
            let own = rows(p, n);
            let points = coordinates(&self.columns, p);
            let columns: Vec<&[f64]> = self.columns.iter().map(|c| &c[..own.end]).collect();
            factors.clear();
            factors.extend_from_slice(&self.correlation.panel(p)[..own.end]);
            leave_below_diagonal(&mut factors, 0, p * ROWS);
            self.multiply_by_radial_factors(&points, 0, &mut factors);
            let mut down = vec![Column([0.0; ROWS]); self.columns.len()];
            kernel.derivatives_of_panel_times(
                &points,
                &columns,
                &factors,
                (&padded(&beta[own.clone()]), beta),
                &mut down,
                |j, k, sum| directions[self.parameter_of(j) * n + k] += sum,
            );
            for (j, down) in down.iter().enumerate() {
                let start = self.parameter_of(j) * n;
                let direction = &mut directions[start + own.start..start + own.end];
                for (u, sum) in direction.iter_mut().zip(down.0) {
                    *u += sum;
                }
            }
        }
        if self.form.nugget {
            let from_nugget = &mut directions[(count - 2) * n..(count - 1) * n];
            for (u, b) in from_nugget.iter_mut().zip(beta) {
                *u = nugget / sigma2 * b;
            }
        }
        let noise = &self.noise;
        for (i, u) in directions[(count - 1) * n..].iter_mut().enumerate() {
            *u = z[i] - noise[i] * beta[i] / sigma2;
        }

        let mut solved = directions.clone();
        solve(&self.factor, &mut solved);
        let mut curvature = vec![0.0; count * count];
        let onto_trend = |u: &[f64]| -> Vec<f64> {
            let columns = gls.solved().chunks(n);
            columns.map(|s| dot(u, s)).collect()
        };
        let others: Vec<Vec<f64>> = directions.chunks(n).map(onto_trend).collect();
        for i in 0..count {
            let u = &directions[i * n..(i + 1) * n];
            let mut along = others[i].clone();
            gls.solve(&mut along);
            for j in 0..count {
                let v = &solved[j * n..(j + 1) * n];
                curvature[i * count + j] = 0.5 * (dot(u, v) - dot(&along, &others[j])) / sigma2;
            }
        }
        curvature
    }
}

/// (C⁻¹ − ββᵀ/σ²)ₐᵦ Rₐᵦ for a run of a panel's columns.
struct Weights<'a> {
    inverse: &'a [Column],
    correlation: &'a [Column],
    /// β at the columns' points.
    across: &'a [f64],
    /// β at the rows'.
    along: &'a Column,
    sigma2: f64,
    weights: &'a mut [Column],
}

impl WithSimd for Weights<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let matrices = self.inverse.iter().zip(self.correlation);
        let columns = matrices.zip(self.across).zip(self.weights);
        let along = S::as_simd_f64s(&self.along.0).0;
        for (((inverse, correlation), across), weights) in columns {
            let across = simd.splat_f64s(across / self.sigma2);
            let inverse = S::as_simd_f64s(&inverse.0).0;
            let correlation = S::as_simd_f64s(&correlation.0).0;
            let weights = S::as_mut_simd_f64s(&mut weights.0).0;
            for v in 0..ROWS / S::F64_LANES {
                let product = simd.mul_f64s(across, along[v]);
                let difference = simd.sub_f64s(inverse[v], product);
                weights[v] = simd.mul_f64s(difference, correlation[v]);
            }
        }
    }
}

/// Sets a panel's columns from the `first` on to zero in the rows, counted from `start`, that are not below
/// the matrix's diagonal.
fn leave_below_diagonal(columns: &mut [Column], first: usize, start: usize) {
    for (k, column) in (first..).zip(columns) {
        if k >= start {
            column.0[..=k - start].fill(0.0);
        }
    }
}

/// The sum of a column's elements.
fn total(column: &Column) -> f64 {
    let mut sums = [0.0; LANES];
    for part in column.0.as_chunks::<LANES>().0 {
        for (sum, value) in sums.iter_mut().zip(part) {
            *sum += value;
        }
    }
    sums.iter().sum()
}

/// A column with zeros after `values`.
fn padded(values: &[f64]) -> Column {
    let mut column = Column([0.0; ROWS]);
    column.0[..values.len()].copy_from_slice(values);
    column
}
