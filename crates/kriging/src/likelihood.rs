//! The negative log likelihood of ordinary kriging with known noise, and its derivatives.
//!
//! With z = y − μ1, μ the generalised least squares mean, C as in [`crate::covariance`], β = C⁻¹z:
//!
//! - value: n/2 ln(2πσ²) + ½ ln|C| + zᵀβ/(2σ²);
//! - ∂/∂ ln θⱼ = ½ Σₐᵦ (C⁻¹ − ββᵀ/σ²)ₐᵦ ∂Rₐᵦ/∂ ln θⱼ;
//! - ∂/∂ ln σ² = ½ (n − Σᵢ C⁻¹ᵢᵢ vᵢ/σ²) − (zᵀβ − Σᵢ vᵢβᵢ²/σ²)/(2σ²);
//! - curvature: the average of the observed and the expected information, which needs no further
//!   matrix product, ½ uᵢᵀ P uⱼ/σ² with uⱼ = ∂C/∂ ln θⱼ β and P = C⁻¹ − C⁻¹11ᵀC⁻¹/1ᵀC⁻¹1
//!   (Gilmour, Thompson, Cullis, "Average information REML", Biometrics 51 (1995) 1440–1450).
//!
//! The mean μ is at its optimum for every θ and σ², so it adds nothing to the derivatives. With
//! unequal noise σ² has no closed form, so it is a variable of the search like the ranges.

use crate::covariance::{self, complete, factorise, fill_correlations, log_determinant};
use crate::data::Scaled;
use crate::kernel::Kernel;

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

/// The negative log likelihood as a function of (ln θ₁ … ln θ_d, ln σ²), or of (ln θ, ln σ²) when
/// all ranges are tied. Holds its matrices, so that evaluations do not allocate them again.
pub(crate) struct Likelihood<'a> {
    kernel: Kernel,
    data: &'a Scaled,
    tied: bool,
    /// Added to the diagonal, relative to σ².
    pub(crate) jitter: f64,
    /// `data.columns` divided by the ranges.
    columns: Vec<Vec<f64>>,
    correlation: Vec<f64>,
    factor: Vec<f64>,
    inverse: Vec<f64>,
}

impl<'a> Likelihood<'a> {
    pub(crate) fn new(kernel: Kernel, data: &'a Scaled, tied: bool, jitter: f64) -> Self {
        Self {
            kernel,
            data,
            tied,
            jitter,
            columns: data.columns.clone(),
            correlation: Vec::new(),
            factor: Vec::new(),
            inverse: Vec::new(),
        }
    }

    /// Evaluates at `parameters`; `None` if the covariance is not positive definite there.
    pub(crate) fn evaluate(&mut self, parameters: &[f64], order: Order) -> Option<Evaluation> {
        let n = self.data.len();
        let (ln_sigma2, ln_ranges) = parameters.split_last()?;
        let sigma2 = ln_sigma2.exp();

        self.scale_columns(ln_ranges);
        self.correlation.resize(n * n, 0.0);
        self.factor.resize(n * n, 0.0);
        fill_correlations(self.kernel, &self.columns, n, &mut self.correlation);
        let noise = &self.data.noise;
        let ratio = |i: usize| covariance::noise_ratio(noise[i], sigma2);
        complete(&self.correlation, ratio, self.jitter, n, &mut self.factor);
        factorise(&mut self.factor, n).ok()?;

        let mut solved = vec![1.0; 2 * n];
        solved[n..].copy_from_slice(&self.data.y);
        covariance::solve(&self.factor, n, &mut solved);
        let (ones, beta) = solved.split_at_mut(n);
        let ones_sum: f64 = ones.iter().sum();
        let mu = beta.iter().sum::<f64>() / ones_sum;
        beta.iter_mut().zip(&*ones).for_each(|(b, o)| *b -= mu * o);
        let z: Vec<f64> = self.data.y.iter().map(|y| y - mu).collect();
        let quadratic = dot(&z, beta);

        let log_determinant = log_determinant(&self.factor, n);
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
            self.inverse.resize(n * n, 0.0);
            covariance::invert(&self.factor, n, &mut self.inverse);
            evaluation.gradient = self.gradient(parameters.len(), beta, quadratic, sigma2);
        }
        if order >= Order::Curvature {
            let means = Means { ones, ones_sum };
            evaluation.curvature = self.curvature(parameters.len(), &z, beta, sigma2, &means);
        }
        Some(evaluation)
    }

    fn scale_columns(&mut self, ln_ranges: &[f64]) {
        for (j, (scaled, column)) in self.columns.iter_mut().zip(&self.data.columns).enumerate() {
            let ln_range = ln_ranges[if self.tied { 0 } else { j }];
            let factor = self.kernel.length_factor() * (-ln_range).exp();
            scaled
                .iter_mut()
                .zip(column)
                .for_each(|(s, c)| *s = c * factor);
        }
    }

    /// The index of the parameter that holds the range of column j.
    fn parameter_of(&self, j: usize) -> usize {
        if self.tied { 0 } else { j }
    }

    fn gradient(&self, count: usize, beta: &[f64], quadratic: f64, sigma2: f64) -> Vec<f64> {
        let n = self.data.len();
        let mut gradient = vec![0.0; count];
        let mut weights = vec![0.0; n];
        for k in 0..n {
            let run = k * n + k + 1..(k + 1) * n;
            let weights = &mut weights[k + 1..];
            let scaled = beta[k] / sigma2;
            for (((w, i), r), b) in weights
                .iter_mut()
                .zip(&self.inverse[run.clone()])
                .zip(&self.correlation[run])
                .zip(&beta[k + 1..])
            {
                *w = (i - scaled * b) * r;
            }
            for (j, column) in self.columns.iter().enumerate() {
                gradient[self.parameter_of(j)] +=
                    self.kernel
                        .log_derivative_dot(column[k], &column[k + 1..], weights);
            }
        }
        let noise = &self.data.noise;
        let trace: f64 = (0..n).map(|i| self.inverse[i * n + i] * noise[i]).sum();
        let squares: f64 = beta.iter().zip(noise).map(|(b, v)| v * b * b).sum();
        gradient[count - 1] =
            0.5 * (n as f64 - trace / sigma2 - (quadratic - squares / sigma2) / sigma2);
        gradient
    }

    fn curvature(
        &self,
        count: usize,
        z: &[f64],
        beta: &[f64],
        sigma2: f64,
        means: &Means<'_>,
    ) -> Vec<f64> {
        let n = self.data.len();
        let mut directions = vec![0.0; count * n];
        let mut derivative = vec![0.0; n];
        for k in 0..n {
            let correlation = &self.correlation[k * n + k + 1..(k + 1) * n];
            let derivative = &mut derivative[k + 1..];
            for (j, column) in self.columns.iter().enumerate() {
                self.kernel
                    .derivatives(column[k], &column[k + 1..], correlation, derivative);
                let p = self.parameter_of(j);
                let direction = &mut directions[p * n..(p + 1) * n];
                direction[k] += dot(derivative, &beta[k + 1..]);
                let from = beta[k];
                direction[k + 1..]
                    .iter_mut()
                    .zip(&*derivative)
                    .for_each(|(u, d)| *u += d * from);
            }
        }
        let noise = &self.data.noise;
        for (i, u) in directions[(count - 1) * n..].iter_mut().enumerate() {
            *u = z[i] - noise[i] * beta[i] / sigma2;
        }

        let mut solved = directions.clone();
        covariance::solve(&self.factor, n, &mut solved);
        let mut curvature = vec![0.0; count * count];
        for i in 0..count {
            let u = &directions[i * n..(i + 1) * n];
            let along = dot(u, means.ones) / means.ones_sum;
            for j in 0..count {
                let v = &solved[j * n..(j + 1) * n];
                let other = dot(&directions[j * n..(j + 1) * n], means.ones);
                curvature[i * count + j] = 0.5 * (dot(u, v) - along * other) / sigma2;
            }
        }
        curvature
    }
}

/// C⁻¹1 and its sum.
struct Means<'a> {
    ones: &'a [f64],
    ones_sum: f64,
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
            for (noise, tied) in [(0.0, false), (0.05, false), (0.05, true)] {
                let data = sample(40, 3, noise);
                let at = if tied {
                    vec![-0.3, 0.4]
                } else {
                    vec![-0.5, 0.1, -1.0, 0.4]
                };
                let mut likelihood = Likelihood::new(kernel, &data, tied, 1e-8);
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
        let mut likelihood = Likelihood::new(Kernel::Matern52, &data, false, 0.0);
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
        let mut likelihood = Likelihood::new(Kernel::Matern52, &data, false, 0.0);
        let e = likelihood.evaluate(&at, Order::Curvature).unwrap();
        let closed = 0.5 * e.next_sigma2 * 50.0 / 0.4_f64.exp();
        assert!((e.curvature[8] / closed - 1.0).abs() < 1e-9);
    }

    #[test]
    fn white_noise_is_the_limit_of_short_ranges() {
        let data = sample(60, 2, 0.05);
        let mut likelihood = Likelihood::new(Kernel::Matern52, &data, false, 0.0);
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
