//! The negative log likelihood of kriging with known noise, or that of the posterior, and its derivatives.
//!
//! With z = y − Fμ, F the trend's basis (ones, for a constant), μ its generalised least squares
//! coefficients, C = R + jitter·I + diag(v/σ²), v the noise (a nugget τ² included), so that the K_Δ of
//! equations (19) and (20) is σ²C, and β = C⁻¹z:
//!
//! - value: n/2 ln(2πσ²) + ½ ln|C| + zᵀβ/(2σ²);
//! - ∂/∂ ln θⱼ = ½ Σₐᵦ (C⁻¹ − ββᵀ/σ²)ₐᵦ ∂Rₐᵦ/∂ ln θⱼ;
//! - ∂/∂ ln σ² = ½ (n − Σᵢ C⁻¹ᵢᵢ vᵢ/σ²) − (zᵀβ − Σᵢ vᵢβᵢ²/σ²)/(2σ²);
//! - ∂/∂ ln τ² = ½ τ²/σ² Σᵢ (C⁻¹ᵢᵢ − βᵢ²/σ²);
//! - curvature: the average of the observed and the expected information, which needs no further
//!   matrix product, ½ uᵢᵀ P uⱼ/σ² with uⱼ = ∂C/∂ ln θⱼ β and P = C⁻¹ − C⁻¹F(FᵀC⁻¹F)⁻¹FᵀC⁻¹
//!   (Gilmour, Thompson, Cullis, "Average information REML", Biometrics 51 (1995) 1440–1450).
//!
//! The trend μ is at its optimum for every θ and σ², so it adds nothing to the derivatives. With
//! unequal noise σ² has no closed form, so it is a variable of the search like the ranges.

mod derivatives;
pub(crate) mod gls;
pub(crate) mod prior;

use std::borrow::Cow;

use crate::data::scaled::ScaledData;
use crate::kernel::Kernel;
use crate::linalg::{LowerTriangle, Spd, dot};
use derivatives::EvaluationPoint;
use gls::{Gls, Trend};
use prior::{Estimator, Prior};

/// noise/σ², or 0 without noise. It is limited so that no product of two overflows.
pub(crate) fn noise_ratio(noise: f64, sigma2: f64) -> f64 {
    if noise == 0.0 {
        0.0
    } else {
        (noise / sigma2).min(1e100)
    }
}

/// C of the n points whose scaled coordinates are `columns`: their correlations, and on the
/// diagonal 1 + jitter + noise/σ², the last from `ratio`. `memory` is the memory of an earlier matrix,
/// or empty.
pub(crate) fn covariance(
    kernel: Kernel,
    columns: &[Vec<f64>],
    n: usize,
    jitter: f64,
    ratio: impl Fn(usize) -> f64 + Sync,
    memory: Vec<f64>,
) -> LowerTriangle {
    LowerTriangle::in_memory(memory, n, |k, column| {
        let at = point(columns, k);
        kernel.correlations(&at, |j| &columns[j][k..], column);
        column[0] += jitter + ratio(k);
    })
}

/// The coordinates of point k.
pub(crate) fn point(columns: &[Vec<f64>], k: usize) -> Vec<f64> {
    columns.iter().map(|column| column[k]).collect()
}

/// The order of the derivatives that an evaluation computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
pub(crate) enum Order {
    Value,
    /// The value and the gradient.
    Gradient,
    /// The value, the gradient and the curvature.
    Curvature,
}

/// The likelihood at one set of parameters.
#[derive(Debug, Clone, Default)]
pub(crate) struct Evaluation {
    pub(crate) value: f64,
    pub(crate) gradient: Vec<f64>,
    /// Row-major; empty unless asked for.
    pub(crate) curvature: Vec<f64>,
    /// zᵀC⁻¹z/n: the maximum likelihood estimate of σ² with the ratios of noise to σ² kept.
    pub(crate) next_sigma2: f64,
    /// The size of the value's rounding error.
    pub(crate) rounding: f64,
}

/// The form of the model: all but its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct ModelForm {
    pub(crate) kernel: Kernel,
    pub(crate) estimator: Estimator,
    pub(crate) trend: Trend,
    /// Whether all coordinates share one range.
    pub(crate) tied: bool,
    /// Whether a nugget is estimated.
    pub(crate) nugget: bool,
}

/// The negative log likelihood as a function of (ln θ₁ … ln θ_d, ln σ²), or of (ln θ, ln σ²) when
/// all ranges are tied; a nugget's ln τ² stands before ln σ².
pub(crate) struct Likelihood<'a> {
    form: ModelForm,
    data: Cow<'a, ScaledData>,
    /// The trend's basis, column by column.
    basis: Vec<f64>,
    /// The noise variances with the nugget.
    noise: Vec<f64>,
    /// The jitter, added to the diagonal, relative to σ².
    pub(crate) jitter: f64,
    /// `data.columns` divided by the ranges.
    columns: Vec<Vec<f64>>,
    /// Memory for two matrices, kept from one evaluation to the next.
    memory: [Vec<f64>; 2],
}

impl<'a> Likelihood<'a> {
    pub(crate) fn new(form: ModelForm, data: Cow<'a, ScaledData>, jitter: f64) -> Self {
        Self {
            form,
            basis: form.trend.basis(&data.columns, data.len(), 0.5),
            noise: data.noise.clone(),
            jitter,
            columns: data.columns.clone(),
            memory: [Vec::new(), Vec::new()],
            data,
        }
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
        let noise = &self.noise;
        let ratio = |i: usize| noise_ratio(noise[i], sigma2);
        let memory = std::mem::take(&mut self.memory[0]);
        let (kernel, jitter) = (self.form.kernel, self.jitter);
        let covariance = covariance(kernel, &self.columns, n, jitter, ratio, memory);
        let factor = Spd::factor(covariance).ok()?;

        let p = self.basis.len() / n;
        let mut solved = self.basis.clone();
        solved.extend_from_slice(&self.data.y);
        factor.solve(&mut solved);
        let mut beta = solved.split_off(p * n);
        let mut trend: Vec<f64> = self.basis.chunks(n).map(|f| dot(f, &beta)).collect();
        let gls = Gls::new(&self.basis, solved, n)?;
        gls.solve(&mut trend);
        let mut z = self.data.y.clone();
        let columns = self.basis.chunks(n).zip(gls.c_inv_f().chunks(n));
        for (coefficient, (f, s)) in trend.iter().zip(columns) {
            beta.iter_mut()
                .zip(s)
                .for_each(|(b, s)| *b -= coefficient * s);
            z.iter_mut().zip(f).for_each(|(z, f)| *z -= coefficient * f);
        }
        let quadratic = dot(&z, &beta);

        let count = n as f64;
        let value = 0.5
            * (count * (std::f64::consts::TAU.ln() + ln_sigma2)
                + factor.log_det()
                + quadratic / sigma2);
        if !value.is_finite() {
            return None;
        }
        let prior = Prior::new(self.form.estimator, self.columns.len(), ln_ranges);
        let of_prior = prior.as_ref().map_or(0.0, Prior::value);
        let mut evaluation = Evaluation {
            value: value + of_prior,
            next_sigma2: quadratic / count,
            rounding: rounding(&factor, &beta, sigma2),
            ..Evaluation::default()
        };
        let at = EvaluationPoint {
            count: parameters.len(),
            gls: &gls,
            z: &z,
            beta: &beta,
            quadratic,
            sigma2,
            nugget,
        };
        if order >= Order::Curvature {
            evaluation.curvature = self.curvature(&at, &factor);
        }
        self.memory[0] = if order >= Order::Gradient {
            let inverse = factor.into_inverse(&mut self.memory[1]);
            evaluation.gradient = self.gradient(&at, &inverse);
            inverse.into_memory()
        } else {
            factor.into_memory()
        };
        if let Some(prior) = prior
            && order >= Order::Gradient
        {
            prior.add_derivatives(&mut evaluation.gradient, &mut evaluation.curvature);
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
}

/// Relative rounding error of an element of C, its factorisation included, as measured in the value at 2000 points
/// without noise.
const ELEMENT_ERROR: f64 = 8.0 * f64::EPSILON;

/// The size of the rounding error of a value: to first order that of independent errors E of the elements of C,
/// tr(C⁻¹E)/2 − βᵀEβ/(2σ²). The squares of the pivots of C's factor stand for its eigenvalues.
fn rounding(factor: &Spd, beta: &[f64], sigma2: f64) -> f64 {
    let of_determinant: f64 = factor.pivots().map(|pivot| pivot.powi(-4)).sum();
    0.5 * ELEMENT_ERROR * (of_determinant.sqrt() + dot(beta, beta) / sigma2)
}

/// The smallest negative log likelihood of independent observations y ~ N(μ, σ² + vᵢ) over μ and
/// σ² ≥ 0: the value that a covariance without structure in x can reach.
pub(crate) fn white_noise(data: &ScaledData) -> f64 {
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
    // The scaled observations have variance 1 or less, so the optimum lies in this interval. A
    // coarse search brackets it, and a golden section search follows.
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
    use crate::data::{Data, merge_repeated};

    fn sample(n: usize, d: usize, noise: f64) -> ScaledData {
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
        ScaledData::new(&merge_repeated(&data).unwrap().0).unwrap()
    }

    #[test]
    fn gradient_agrees_with_differences() {
        for kernel in Kernel::ALL {
            for (noise, tied, nugget, trend) in [
                (0.0, false, false, Trend::Constant),
                (0.05, false, false, Trend::Constant),
                (0.05, true, false, Trend::Constant),
                (0.05, true, true, Trend::Constant),
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
                    at.insert(at.len() - 1, -4.0);
                }
                let estimator = if nugget {
                    Estimator::PosteriorMode
                } else {
                    Estimator::Likelihood
                };
                let form = ModelForm {
                    kernel,
                    estimator,
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

    #[test]
    fn curvature_is_the_average_information() {
        // Symmetric with a positive diagonal, as a sum of uᵀPu must be.
        let data = sample(200, 2, 0.05);
        let mut likelihood = Likelihood::new(ModelForm::default(), Cow::Borrowed(&data), 0.0);
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
        let mut likelihood = Likelihood::new(ModelForm::default(), Cow::Borrowed(&data), 0.0);
        let e = likelihood.evaluate(&at, Order::Curvature).unwrap();
        let closed = 0.5 * e.next_sigma2 * 50.0 / 0.4_f64.exp();
        assert!((e.curvature[8] / closed - 1.0).abs() < 1e-9);
    }

    #[test]
    fn white_noise_is_the_limit_of_short_ranges() {
        let data = sample(60, 2, 0.05);
        let mut likelihood = Likelihood::new(ModelForm::default(), Cow::Borrowed(&data), 0.0);
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
