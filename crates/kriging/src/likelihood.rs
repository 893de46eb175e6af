//! The negative log likelihood of kriging with known noise, and its derivatives.
//!
//! With z = y − Fμ, F the trend's basis (ones, for a constant), μ its generalised least squares
//! coefficients, C as in [`crate::covariance`], β = C⁻¹z, v the noise (a nugget τ² included):
//!
//! - value: n/2 ln(2πσ²) + ½ ln|C| + zᵀβ/(2σ²);
//! - ∂/∂ ln θⱼ = ½ Σₐᵦ (C⁻¹ − ββᵀ/σ²)ₐᵦ ∂Rₐᵦ/∂ ln θⱼ;
//! - ∂/∂ ln σ² = ½ (n − Σᵢ C⁻¹ᵢᵢ vᵢ/σ²) − (zᵀβ − Σᵢ vᵢβᵢ²/σ²)/(2σ²);
//! - ∂/∂ ln τ² = ½ τ²/σ² Σᵢ (C⁻¹ᵢᵢ − βᵢ²/σ²);
//! - curvature: the average of the observed and the expected information, which needs no further
//!   matrix product, ½ uᵢᵀ P uⱼ/σ² with uⱼ = ∂C/∂ ln θⱼ β and P = C⁻¹ − C⁻¹F(FᵀC⁻¹F)⁻¹FᵀC⁻¹
//!   (Gilmour, Thompson, Cullis, "Average information REML", Biometrics 51 (1995) 1440–1450).
//!
//! Of many points C⁻¹ is computed in single precision, in half the time: it is needed for the gradient
//! only, which steers a search, and the value's accuracy is the factor's. How accurate it is, tr(C⁻¹C)
//! tells, which is n.
//!
//! The trend μ is at its optimum for every θ and σ², so it adds nothing to the derivatives. With
//! unequal noise σ² has no closed form, so it is a variable of the search like the ranges.

use std::borrow::Cow;

use pulp::{Arch, Simd, WithSimd};

use crate::covariance::{self, add_to_diagonal, coordinates, fill_correlations, log_determinant};
use crate::gls::{Gls, Trend};
use crate::kernel::{Kernel, LANES};
use crate::panels::{
    Column, Lower, ROWS, SingleInverse, Upper, factorise, invert_transposed, panels, rows, solve,
    square,
};
use crate::probes::Probes;
use crate::scaled::Scaled;

/// Columns whose weights in the gradient are computed together: they stay in the first-level cache.
const RUN: usize = 64;

/// From so many points on, where it takes most of the time, the gradient's inverse is computed in single
/// precision.
const SINGLE_FROM: usize = 1000;

/// The most that rounding may have added to tr(C⁻¹C) for an inverse in single precision to be taken. Its
/// terms are larger than those of the derivatives: for conditions of 1e4 to 1e13 the errors of these were 9 to
/// 730 times smaller.
const TRACE_ERROR: f64 = 1.0;

/// What an evaluation computes beyond the value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
pub(crate) enum Order {
    Value,
    Gradient,
    /// The gradient, too.
    Curvature,
}

/// The likelihood at one set of parameters.
#[derive(Debug, Clone)]
pub(crate) struct Evaluation {
    pub(crate) value: f64,
    pub(crate) gradient: Vec<f64>,
    /// Row-major; empty unless asked for.
    pub(crate) curvature: Vec<f64>,
    /// zᵀC⁻¹z/n: the process variance that would be best if the noise grew with it.
    pub(crate) next_sigma2: f64,
}

/// Which model's likelihood it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Form {
    pub(crate) kernel: Kernel,
    pub(crate) trend: Trend,
    /// Whether all coordinates share one range.
    pub(crate) tied: bool,
    /// Whether a nugget is estimated.
    pub(crate) nugget: bool,
}

/// The negative log likelihood as a function of (ln θ₁ … ln θ_d, ln σ²), or of (ln θ, ln σ²) when
/// all ranges are tied; a nugget's ln τ² stands before ln σ². Holds its matrices, so that evaluations
/// do not allocate them again.
pub(crate) struct Likelihood<'a> {
    form: Form,
    data: Cow<'a, Scaled>,
    /// The trend's basis, column by column.
    basis: Vec<f64>,
    /// The noise variances with the nugget.
    noise: Vec<f64>,
    /// Added to the diagonal, relative to σ².
    pub(crate) jitter: f64,
    /// How many random vectors stand for the inverse in the gradient, see
    /// [`Probes`]; zero for the inverse itself.
    pub(crate) probes: usize,
    /// `data.columns` divided by the ranges.
    columns: Vec<Vec<f64>>,
    correlation: Lower,
    factor: Lower,
    /// L⁻ᵀ.
    half_inverse: Upper,
    inverse: Lower,
    single: SingleInverse,
    /// Whether single precision is enough for the inverse, as far as is known.
    pub(crate) in_single: bool,
}

/// Where the gradient is wanted.
struct At<'a> {
    /// Number of parameters.
    count: usize,
    beta: &'a [f64],
    /// zᵀβ.
    quadratic: f64,
    sigma2: f64,
    nugget: f64,
}

/// C⁻¹ or a random matrix in its place.
enum Inverse<'a> {
    Whole(&'a Lower),
    /// In single precision. A panel is written to `panel`.
    Single {
        inverse: &'a SingleInverse,
        panel: Vec<Column>,
    },
    /// A panel at a time, in `panel`: the whole matrix would be memory to no purpose.
    Sampled {
        probes: Probes,
        panel: Vec<Column>,
    },
}

impl Inverse<'_> {
    fn panel(&mut self, p: usize) -> &[Column] {
        match self {
            Self::Whole(matrix) => matrix.panel(p),
            Self::Single { inverse, panel } => {
                panel.resize((p + 1) * ROWS, Column([0.0; ROWS]));
                inverse.panel(p, panel);
                panel
            }
            Self::Sampled { probes, panel } => {
                panel.resize((p + 1) * ROWS, Column([0.0; ROWS]));
                probes.panel(p, panel);
                panel
            }
        }
    }
}

impl<'a> Likelihood<'a> {
    pub(crate) fn new(form: Form, data: Cow<'a, Scaled>, jitter: f64) -> Self {
        Self {
            form,
            basis: form.trend.basis(&data.columns, data.len(), 0.5),
            noise: data.noise.clone(),
            jitter,
            probes: 0,
            columns: data.columns.clone(),
            in_single: data.len() >= SINGLE_FROM,
            data,
            correlation: Lower::default(),
            factor: Lower::default(),
            half_inverse: Upper::default(),
            inverse: Lower::default(),
            single: SingleInverse::default(),
        }
    }

    /// Whether there are enough points for an inverse in single precision.
    pub(crate) fn may_be_in_single(&self) -> bool {
        self.data.len() >= SINGLE_FROM
    }

    /// The memory of one of the matrices, which the next evaluation would have to ask for again.
    pub(crate) fn take_matrix(&mut self) -> Lower {
        std::mem::take(&mut self.factor)
    }

    /// Evaluates at `parameters`; `None` if the covariance is not positive definite there.
    pub(crate) fn evaluate(&mut self, parameters: &[f64], order: Order) -> Option<Evaluation> {
        let n = self.data.len();
        let (ln_sigma2, rest) = parameters.split_last()?;
        let sigma2 = ln_sigma2.exp();
        let (ln_ranges, nugget) = if self.form.nugget {
            let (ln_nugget, ln_ranges) = rest.split_last()?;
            let nugget = ln_nugget.exp();
            for (with, without) in self.noise.iter_mut().zip(&self.data.noise) {
                *with = without + nugget;
            }
            (ln_ranges, nugget)
        } else {
            (rest, 0.0)
        };

        self.scale_columns(ln_ranges);
        // Derivatives need the correlations again.
        let copy = (order > Order::Value).then_some(&mut self.correlation);
        let kernel = self.form.kernel;
        fill_correlations(kernel, &self.columns, n, &mut self.factor, copy);
        let noise = &self.noise;
        let ratio = |i: usize| covariance::noise_ratio(noise[i], sigma2);
        add_to_diagonal(ratio, self.jitter, &mut self.factor);
        factorise(&mut self.factor).ok()?;

        let p = self.basis.len() / n;
        let mut solved = self.basis.clone();
        solved.extend_from_slice(&self.data.y);
        solve(&self.factor, &mut solved);
        let mut beta = solved.split_off(p * n);
        let mut trend: Vec<f64> = self.basis.chunks(n).map(|f| dot(f, &beta)).collect();
        let gls = Gls::new(&self.basis, solved, n)?;
        gls.solve(&mut trend);
        let mut z = self.data.y.clone();
        let columns = self.basis.chunks(n).zip(gls.solved().chunks(n));
        for (coefficient, (f, s)) in trend.iter().zip(columns) {
            beta.iter_mut()
                .zip(s)
                .for_each(|(b, s)| *b -= coefficient * s);
            z.iter_mut().zip(f).for_each(|(z, f)| *z -= coefficient * f);
        }
        let quadratic = dot(&z, &beta);

        let log_determinant = log_determinant(&self.factor);
        let count = n as f64;
        let value = 0.5
            * (count * (std::f64::consts::TAU.ln() + ln_sigma2)
                + log_determinant
                + quadratic / sigma2);
        if !value.is_finite() {
            return None;
        }
        let mut evaluation = Evaluation {
            value,
            gradient: Vec::new(),
            curvature: Vec::new(),
            next_sigma2: quadratic / count,
        };
        if order >= Order::Gradient {
            let at = At {
                count: parameters.len(),
                beta: &beta,
                quadratic,
                sigma2,
                nugget,
            };
            evaluation.gradient = self.best_gradient(&at);
        }
        if order >= Order::Curvature {
            evaluation.curvature =
                self.curvature(parameters.len(), &z, &beta, sigma2, nugget, &gls);
        }
        Some(evaluation)
    }

    fn scale_columns(&mut self, ln_ranges: &[f64]) {
        for (j, (scaled, column)) in self.columns.iter_mut().zip(&self.data.columns).enumerate() {
            let ln_range = ln_ranges[if self.form.tied { 0 } else { j }];
            let factor = self.form.kernel.length_factor() * (-ln_range).exp();
            scaled
                .iter_mut()
                .zip(column)
                .for_each(|(s, c)| *s = c * factor);
        }
    }

    /// The index of the parameter that holds the range of column j.
    fn parameter_of(&self, j: usize) -> usize {
        if self.form.tied { 0 } else { j }
    }

    /// The gradient, from random vectors if these are asked for, from an inverse in single precision as long
    /// as that is accurate enough, or from one in double precision.
    fn best_gradient(&mut self, at: &At<'_>) -> Vec<f64> {
        if self.probes > 0 {
            let sampled = Inverse::Sampled {
                probes: Probes::new(&self.factor, self.probes),
                panel: Vec::new(),
            };
            return self.gradient(at, sampled).0;
        }
        if self.in_single {
            self.single.invert(&self.factor);
            let single = Inverse::Single {
                inverse: &self.single,
                panel: Vec::new(),
            };
            let (gradient, trace_error) = self.gradient(at, single);
            // Not so where it is NaN.
            self.in_single = trace_error.abs() <= TRACE_ERROR;
            if self.in_single {
                return gradient;
            }
            self.single = SingleInverse::default();
        }
        invert_transposed(&self.factor, &mut self.half_inverse);
        square(&self.half_inverse, &mut self.inverse);
        self.gradient(at, Inverse::Whole(&self.inverse)).0
    }

    /// The gradient, and by how much tr(C⁻¹C) differs from n.
    fn gradient(&self, at: &At<'_>, mut inverse: Inverse<'_>) -> (Vec<f64>, f64) {
        let At {
            count,
            beta,
            quadratic,
            sigma2,
            nugget,
        } = *at;
        let n = self.data.len();
        let kernel = self.form.kernel;
        let mut gradient = vec![0.0; count];
        let mut sums = vec![[0.0; LANES]; self.columns.len()];
        let mut diagonal = Vec::with_capacity(n);
        let mut below = Column([0.0; ROWS]);
        let mut weights = [Column([0.0; ROWS]); RUN];
        for p in 0..panels(n) {
            let own = rows(p, n);
            let points = coordinates(&self.columns, p);
            let of_rows = padded(&beta[own.clone()]);
            let (inverse, correlation) = (inverse.panel(p), self.correlation.panel(p));
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
                for weights in &*weights {
                    for (sum, weight) in below.0.iter_mut().zip(weights.0) {
                        *sum += weight;
                    }
                }
                self.multiply_by_radial_factors(&points, run.start, weights);
                kernel.log_derivative_dots_of_panel(&points, &columns, weights, &mut sums);
            }
        }
        for (j, sums) in sums.iter().enumerate() {
            gradient[self.parameter_of(j)] += sums.iter().sum::<f64>();
        }
        let sum: f64 = (0..n)
            .map(|i| diagonal[i] - beta[i] * beta[i] / sigma2)
            .sum();
        if self.form.nugget {
            gradient[count - 2] = 0.5 * nugget / sigma2 * sum;
        }
        let noise = &self.noise;
        let trace = dot(&diagonal, noise);
        let squares: f64 = beta.iter().zip(noise).map(|(b, v)| v * b * b).sum();
        gradient[count - 1] =
            0.5 * (n as f64 - trace / sigma2 - (quadratic - squares / sigma2) / sigma2);
        // That derivative is half of all weights, too, but for the jitter. Both are equal if tr(C⁻¹C) = n.
        let weights = 2.0 * below.0.iter().sum::<f64>() + (1.0 + self.jitter) * sum;
        let trace_error = weights - 2.0 * gradient[count - 1];
        (gradient, trace_error)
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

    fn curvature(
        &self,
        count: usize,
        z: &[f64],
        beta: &[f64],
        sigma2: f64,
        nugget: f64,
        gls: &Gls,
    ) -> Vec<f64> {
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

/// A column with zeros after `values`.
fn padded(values: &[f64]) -> Column {
    let mut column = Column([0.0; ROWS]);
    column.0[..values.len()].copy_from_slice(values);
    column
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The smallest negative log likelihood of independent observations y ~ N(μ, σ² + vᵢ) over μ and
/// σ² ≥ 0: what a covariance that has found no structure in x can reach.
pub(crate) fn white_noise(data: &Scaled) -> f64 {
    let value = |ln_sigma2: f64| {
        let sigma2 = ln_sigma2.exp();
        let (mut weights, mut sum, mut logs) = (0.0, 0.0, 0.0);
        for (y, v) in data.y.iter().zip(&data.noise) {
            let weight = 1.0 / (sigma2 + v);
            weights += weight;
            sum += weight * y;
            logs -= weight.ln();
        }
        let mu = sum / weights;
        let squares: f64 = data
            .y
            .iter()
            .zip(&data.noise)
            .map(|(y, v)| (y - mu).powi(2) / (sigma2 + v))
            .sum();
        0.5 * (data.len() as f64 * std::f64::consts::TAU.ln() + logs + squares)
    };
    // The scaled observations have variance 1 or less, so the optimum lies in this interval; a
    // coarse search brackets it, and golden sections close in.
    let (low, high, steps) = (-25.0, 2.0, 108);
    let step = (high - low) / f64::from(steps);
    let best = (0..=steps)
        .map(|i| low + step * f64::from(i))
        .min_by(|a, b| value(*a).total_cmp(&value(*b)))
        .unwrap_or(0.0);
    let (mut a, mut b) = (best - step, best + step);
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..40 {
        let (left, right) = (b - golden * (b - a), a + golden * (b - a));
        if value(left) < value(right) {
            b = right;
        } else {
            a = left;
        }
    }
    value(0.5 * (a + b))
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use super::*;
    use crate::data::{Data, merge};

    fn sample(n: usize, d: usize, noise: f64) -> Scaled {
        let mut rng = stream(1, Purpose::Test, n as u64, 0);
        let x: Vec<f64> = (0..n * d).map(|_| rng.random()).collect();
        let y: Vec<f64> = x
            .chunks(d)
            .map(|x| {
                let bumps = (4.0 * x[0]).sin() + x.iter().map(|x| x * x).sum::<f64>();
                bumps + 0.3 * rng.random::<f64>()
            })
            .collect();
        let noise_variance: Vec<f64> = (0..n).map(|_| noise * rng.random::<f64>()).collect();
        let data = Data {
            x: &x,
            d,
            y: &y,
            noise_variance: &noise_variance,
        };
        Scaled::new(&merge(&data).unwrap()).unwrap()
    }

    #[test]
    fn gradient_agrees_with_differences() {
        for kernel in Kernel::ALL {
            for (noise, tied, nugget, trend) in [
                (0.0, false, false, Trend::Constant),
                (0.05, false, false, Trend::Constant),
                (0.05, true, false, Trend::Constant),
                (0.05, false, true, Trend::Constant),
                (0.05, false, true, Trend::Linear),
            ] {
                let data = sample(40, 3, noise);
                let mut at = if tied {
                    vec![-0.3, 0.4]
                } else {
                    vec![-0.5, 0.1, -1.0, 0.4]
                };
                if nugget {
                    at.insert(3, -4.0);
                }
                let form = Form {
                    kernel,
                    trend,
                    tied,
                    nugget,
                };
                let mut likelihood = Likelihood::new(form, Cow::Borrowed(&data), 1e-8);
                let exact = likelihood.evaluate(&at, Order::Gradient).unwrap().gradient;
                for i in 0..at.len() {
                    let mut shifted = |step: f64| {
                        let mut p = at.clone();
                        p[i] += step;
                        likelihood.evaluate(&p, Order::Value).unwrap().value
                    };
                    // Fourth-order differences; rounding of the value is about 1e-11 where the
                    // noise-free squared exponential has condition 1e10.
                    let h = 1e-3;
                    let difference = (8.0 * (shifted(h) - shifted(-h)) - shifted(2.0 * h)
                        + shifted(-2.0 * h))
                        / (12.0 * h);
                    let error = (difference - exact[i]).abs();
                    let tolerance = 1e-6 * (1.0 + exact[i].abs());
                    assert!(
                        error < tolerance,
                        "{kernel} {noise} {i}: {difference} {}",
                        exact[i]
                    );
                }
            }
        }
    }

    /// Whatever the condition, a gradient from single precision is accurate or not used.
    #[test]
    fn gradients_from_single_precision_are_accurate_or_not_used() {
        for (kernel, noise, single) in [
            (Kernel::Exponential, 0.05, true),
            (Kernel::Matern52, 0.05, true),
            (Kernel::RadialMatern52, 0.05, true),
            (Kernel::SquaredExponential, 0.05, true),
            (Kernel::Matern52, 1e-3, true),
            (Kernel::Matern52, 1e-6, false),
            (Kernel::SquaredExponential, 1e-9, false),
        ] {
            let data = sample(SINGLE_FROM, 3, noise);
            let form = Form {
                kernel,
                nugget: true,
                ..Form::default()
            };
            let mut likelihood = Likelihood::new(form, Cow::Borrowed(&data), 1e-8);
            let at = [-0.5, 0.1, -1.0, -20.0, 0.4];
            let fast = likelihood.evaluate(&at, Order::Gradient).unwrap().gradient;
            assert_eq!(likelihood.in_single, single, "{kernel} {noise}");
            likelihood.in_single = false;
            let exact = likelihood.evaluate(&at, Order::Gradient).unwrap().gradient;
            assert_eq!(fast == exact, !single, "{kernel} {noise}");
            for (fast, exact) in fast.iter().zip(&exact) {
                assert!((fast - exact).abs() < 0.01, "{kernel} {noise}");
            }
        }
    }

    #[test]
    fn curvature_is_the_average_information() {
        // Symmetric with a positive diagonal, as a sum of uᵀPu must be.
        let data = sample(200, 2, 0.05);
        let mut likelihood = Likelihood::new(Form::default(), Cow::Borrowed(&data), 0.0);
        let at = [-0.5, 0.1, 0.4];
        let c = likelihood
            .evaluate(&at, Order::Curvature)
            .unwrap()
            .curvature;
        for i in 0..3 {
            assert!(c[i * 3 + i] > 0.0);
            for j in 0..3 {
                assert!((c[i * 3 + j] - c[j * 3 + i]).abs() < 1e-9 * c[i * 3 + i]);
            }
        }
        // For σ² alone, without noise, u = z: the closed form is ½ zᵀC⁻¹z/σ².
        let data = sample(50, 2, 0.0);
        let mut likelihood = Likelihood::new(Form::default(), Cow::Borrowed(&data), 0.0);
        let e = likelihood.evaluate(&at, Order::Curvature).unwrap();
        let closed = 0.5 * e.next_sigma2 * 50.0 / 0.4_f64.exp();
        assert!((e.curvature[8] / closed - 1.0).abs() < 1e-9);
    }

    #[test]
    fn white_noise_is_the_limit_of_short_ranges() {
        let data = sample(60, 2, 0.05);
        let mut likelihood = Likelihood::new(Form::default(), Cow::Borrowed(&data), 0.0);
        let best = (-400..200)
            .map(|i| likelihood.evaluate(&[-15.0, -15.0, 0.01 * f64::from(i)], Order::Value))
            .map(|e| e.unwrap().value)
            .fold(f64::INFINITY, f64::min);
        // The grid of 0.01 in ln σ² misses the optimum by at most n/4 · 0.005².
        assert!(
            (best - white_noise(&data)).abs() < 4e-4,
            "{best} {}",
            white_noise(&data)
        );
    }
}
