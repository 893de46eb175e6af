//! The conditional densities of Vecchia's product, and the derivatives of its logarithm.
//!
//! For a point with the neighbours c, in the notation of [`crate::likelihood`]: b = C_cc⁻¹ C_ci,
//! u = (−b, 1), the relative variance D = uᵀCu of the observation given its neighbours, its residual
//! r = uᵀz = r_y − μ r_1, and α = C_cc⁻¹ z_c. The point adds ½ [ln(2πσ²D) + r²/(σ²D)], whose
//! derivative follows from ∂D = uᵀ∂C u and ∂r = −αᵀ∂C u. The sums for y and for ones are kept apart,
//! because μ = Σ r_1 r_y/D / Σ r_1²/D is known only after all points.

use rayon::prelude::*;

use crate::covariance::{JITTERS, noise_ratio};
use crate::kernel::Kernel;
use crate::likelihood::Evaluation;
use crate::scaled::Scaled;

/// Points of one task; sums over tasks are taken in their order.
const CHUNK: usize = 64;

pub(super) struct Conditionals<'a> {
    kernel: Kernel,
    data: &'a Scaled,
    neighbours: &'a [Vec<u32>],
}

/// What one point contributes.
struct Term {
    variance: f64,
    of_y: f64,
    of_ones: f64,
    /// For each parameter uᵀ∂C u, α_yᵀ∂C u, α_1ᵀ∂C u; empty if not asked for.
    derivatives: Vec<[f64; 3]>,
}

impl<'a> Conditionals<'a> {
    /// `neighbours[i]` lists earlier points of `data` than point i.
    pub(super) fn new(kernel: Kernel, data: &'a Scaled, neighbours: &'a [Vec<u32>]) -> Self {
        Self {
            kernel,
            data,
            neighbours,
        }
    }

    /// The negative log likelihood and the mean μ at (ln θ₁ … ln θ_d, ln σ²).
    pub(super) fn value(&self, parameters: &[f64]) -> Option<(f64, f64)> {
        let terms = self.terms(parameters, false)?;
        let mu = mean(&terms);
        let value = self.sum(&terms, mu, parameters[parameters.len() - 1].exp());
        value.is_finite().then_some((value, mu))
    }

    /// The value with its gradient; the curvature is the sum of the squares of the points' scores,
    /// whose expectation is the information.
    pub(super) fn evaluate(&self, parameters: &[f64]) -> Option<Evaluation> {
        let terms = self.terms(parameters, true)?;
        let mu = mean(&terms);
        let count = parameters.len();
        let sigma2 = parameters[count - 1].exp();
        let value = self.sum(&terms, mu, sigma2);
        let mut gradient = vec![0.0; count];
        let mut curvature = vec![0.0; count * count];
        let mut score = vec![0.0; count];
        for term in &terms {
            let residual = term.of_y - mu * term.of_ones;
            let inner = 1.0 / (sigma2 * term.variance);
            let excess = 1.0 - residual * residual * inner;
            for (s, [uu, yu, ou]) in score.iter_mut().zip(&term.derivatives) {
                *s = 0.5 * uu / term.variance * excess - residual * (yu - mu * ou) * inner;
            }
            score[count - 1] += 0.5 * excess;
            for i in 0..count {
                gradient[i] += score[i];
                for j in 0..count {
                    curvature[i * count + j] += score[i] * score[j];
                }
            }
        }
        value.is_finite().then_some(Evaluation {
            value,
            gradient,
            curvature,
            ..Evaluation::default()
        })
    }

    fn sum(&self, terms: &[Term], mu: f64, sigma2: f64) -> f64 {
        let constant = (std::f64::consts::TAU * sigma2).ln();
        let sum: f64 = terms
            .iter()
            .map(|term| {
                let residual = term.of_y - mu * term.of_ones;
                constant + term.variance.ln() + residual * residual / (sigma2 * term.variance)
            })
            .sum();
        0.5 * sum
    }

    /// `None` if a covariance is not positive definite.
    fn terms(&self, parameters: &[f64], derivatives: bool) -> Option<Vec<Term>> {
        let (ln_sigma2, ln_ranges) = parameters.split_last()?;
        let sigma2 = ln_sigma2.exp();
        let columns: Vec<Vec<f64>> = self
            .data
            .columns
            .iter()
            .zip(ln_ranges)
            .map(|(column, ln_range)| {
                let factor = self.kernel.length_factor() * (-ln_range).exp();
                column.iter().map(|x| x * factor).collect()
            })
            .collect();
        let n = self.data.len();
        let largest = self.neighbours.iter().map(Vec::len).max().unwrap_or(0) + 1;
        let starts: Vec<usize> = (0..n).step_by(CHUNK).collect();
        let chunks: Option<Vec<Vec<Term>>> = starts
            .into_par_iter()
            .map(|start| {
                let mut local = Local::new(self.kernel, columns.len(), largest);
                let mut at = vec![0.0; columns.len()];
                let (mut noise, mut y) = (Vec::new(), Vec::new());
                (start..(start + CHUNK).min(n))
                    .map(|i| {
                        let near = &self.neighbours[i];
                        at.iter_mut().zip(&columns).for_each(|(a, c)| *a = c[i]);
                        local.gather(&columns, near, &at);
                        noise.clear();
                        y.clear();
                        for j in near.iter().map(|&j| j as usize).chain([i]) {
                            noise.push(noise_ratio(self.data.noise[j], sigma2));
                            y.push(self.data.y[j]);
                        }
                        local.term(&noise, &y, derivatives)
                    })
                    .collect()
            })
            .collect();
        Some(chunks?.into_iter().flatten().collect())
    }
}

fn mean(terms: &[Term]) -> f64 {
    let (mut above, mut below) = (0.0, 0.0);
    for term in terms {
        above += term.of_ones * term.of_y / term.variance;
        below += term.of_ones * term.of_ones / term.variance;
    }
    above / below
}

/// A prediction from a few points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Conditional {
    /// Less the mean of the process.
    pub(super) mean: f64,
    /// Over the process variance.
    pub(super) variance: f64,
    /// What it took to factorise the matrix.
    pub(super) jitter: f64,
}

/// A few points and their covariance; holds its matrices, so that they are not allocated anew.
pub(super) struct Local {
    kernel: Kernel,
    /// Number of points, the last of which is conditioned on the others.
    count: usize,
    /// Room for this many points.
    stride: usize,
    /// Coordinate-major.
    columns: Vec<Vec<f64>>,
    /// Row k holds the correlations of point k with points k + 1 … .
    correlation: Vec<f64>,
    /// The Cholesky factor, row by row.
    factor: Vec<f64>,
}

impl Local {
    pub(super) fn new(kernel: Kernel, dimensions: usize, largest: usize) -> Self {
        Self {
            kernel,
            count: 0,
            stride: largest,
            columns: vec![vec![0.0; largest]; dimensions],
            correlation: vec![0.0; largest * largest],
            factor: vec![0.0; largest * largest],
        }
    }

    /// Takes the points `near` of `columns`, and the one at `at` as the last.
    pub(super) fn gather(&mut self, columns: &[Vec<f64>], near: &[u32], at: &[f64]) {
        self.count = near.len() + 1;
        for (local, (column, at)) in self.columns.iter_mut().zip(columns.iter().zip(at)) {
            for (l, &i) in local.iter_mut().zip(near) {
                *l = column[i as usize];
            }
            local[near.len()] = *at;
        }
        let (count, stride) = (self.count, self.stride);
        let mut at = vec![0.0; columns.len()];
        for k in 0..count {
            at.iter_mut()
                .zip(&self.columns)
                .for_each(|(a, c)| *a = c[k]);
            self.kernel.correlations(
                &at,
                |j| &self.columns[j][k + 1..count],
                &mut self.correlation[k * stride + k + 1..k * stride + count],
            );
        }
    }

    /// Factorises the correlations of the first `size` points with `noise` and `jitter` on the
    /// diagonal; whether that succeeded.
    fn factorise(&mut self, noise: &[f64], size: usize, jitter: f64) -> bool {
        let stride = self.stride;
        for i in 0..size {
            let (above, row) = self.factor.split_at_mut(i * stride);
            for k in 0..i {
                let other = &above[k * stride..k * stride + k + 1];
                let inner = dot(&row[..k], &other[..k]);
                row[k] = (self.correlation[k * stride + i] - inner) / other[k];
            }
            let diagonal = 1.0 + jitter + noise[i];
            let pivot = diagonal - dot(&row[..i], &row[..i]);
            if pivot.is_nan() || pivot <= 1e-14 * diagonal {
                return false;
            }
            row[i] = pivot.sqrt();
        }
        true
    }

    /// The term of the last point. `noise` and `y` are those of all points, its own the last.
    fn term(&mut self, noise: &[f64], y: &[f64], derivatives: bool) -> Option<Term> {
        let (count, stride) = (self.count, self.stride);
        // The first jitter above zero is too small to matter.
        let sound = JITTERS[..2]
            .iter()
            .any(|&jitter| self.factorise(noise, count, jitter));
        if !sound {
            return None;
        }
        let last = count - 1;
        let row = &self.factor[last * stride..last * stride + count];
        let variance = row[last] * row[last];
        // b = L⁻ᵀ (L⁻¹ C_ci), and the last row of the factor is (L⁻¹ C_ci)ᵀ.
        let mut u = row[..last].to_vec();
        self.back_solve(&mut u);
        u.iter_mut().for_each(|b| *b = -*b);
        u.push(1.0);
        let of_y = dot(&u, y);
        let of_ones = u.iter().sum();
        let mut term = Term {
            variance,
            of_y,
            of_ones,
            derivatives: Vec::new(),
        };
        if derivatives {
            let mut of_y = y[..last].to_vec();
            self.solve(&mut of_y);
            of_y.push(0.0);
            let mut of_ones = vec![1.0; last];
            self.solve(&mut of_ones);
            of_ones.push(0.0);
            term.derivatives = self.derivatives(noise, &u, &of_y, &of_ones);
        }
        Some(term)
    }

    /// vᵀ∂C u for each parameter and v = u, α_y, α_1.
    fn derivatives(
        &mut self,
        noise: &[f64],
        u: &[f64],
        of_y: &[f64],
        of_ones: &[f64],
    ) -> Vec<[f64; 3]> {
        let (count, stride) = (self.count, self.stride);
        let mut sums = vec![[0.0; 3]; self.columns.len() + 1];
        let (mut squares, mut weights) = (vec![0.0; count], vec![vec![0.0; count]; 3]);
        let mut at = vec![0.0; self.columns.len()];
        let mut factors = vec![0.0; count];
        for k in 0..count - 1 {
            let run = k + 1..count;
            let factors = &mut factors[run.clone()];
            factors.copy_from_slice(&self.correlation[k * stride + k + 1..k * stride + count]);
            at.iter_mut()
                .zip(&self.columns)
                .for_each(|(a, c)| *a = c[k]);
            self.kernel.multiply_by_radial_factors(
                &at,
                |j| &self.columns[j][run.clone()],
                &mut squares[run.clone()],
                factors,
            );
            for (weights, v) in weights.iter_mut().zip([u, of_y, of_ones]) {
                for (j, w) in run.clone().zip(&mut weights[run.clone()]) {
                    *w = factors[j - k - 1] * (v[k] * u[j] + v[j] * u[k]);
                }
            }
            for (i, weights) in weights.iter().enumerate() {
                self.kernel.log_derivative_dots(
                    &at,
                    |j| &self.columns[j][run.clone()],
                    &weights[run.clone()],
                    |j, dot| sums[j][i] += dot,
                );
            }
        }
        for (sum, v) in sums[self.columns.len()].iter_mut().zip([u, of_y, of_ones]) {
            for ((v, u), noise) in v.iter().zip(u).zip(noise) {
                *sum -= v * u * noise;
            }
        }
        sums
    }

    /// The mean at the last point, given centred observations at the others.
    pub(super) fn predict(&mut self, noise: &[f64], observed: &[f64]) -> Conditional {
        let size = self.count - 1;
        for jitter in JITTERS {
            if self.factorise(noise, size, jitter) {
                let mut half: Vec<f64> = (0..size)
                    .map(|k| self.correlation[k * self.stride + size])
                    .collect();
                self.forward_solve(&mut half);
                let mut data = observed.to_vec();
                self.forward_solve(&mut data);
                return Conditional {
                    mean: dot(&half, &data),
                    variance: (1.0 - dot(&half, &half)).max(0.0),
                    jitter,
                };
            }
        }
        // No such matrix is known; without neighbours the prior is what is left.
        Conditional {
            mean: 0.0,
            variance: 1.0,
            jitter: JITTERS[JITTERS.len() - 1],
        }
    }

    fn solve(&self, b: &mut [f64]) {
        self.forward_solve(b);
        self.back_solve(b);
    }

    /// b ← L⁻¹b for the leading part of the factor that has the length of b.
    fn forward_solve(&self, b: &mut [f64]) {
        for i in 0..b.len() {
            let row = &self.factor[i * self.stride..];
            b[i] = (b[i] - dot(&row[..i], &b[..i])) / row[i];
        }
    }

    /// b ← L⁻ᵀb.
    fn back_solve(&self, b: &mut [f64]) {
        for i in (0..b.len()).rev() {
            let row = &self.factor[i * self.stride..];
            b[i] /= row[i];
            let value = b[i];
            for (b, l) in b[..i].iter_mut().zip(row) {
                *b -= l * value;
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 4;
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a_chunks.iter().zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    for (a, b) in a_rest.iter().zip(b_rest) {
        sums[0] += a * b;
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use super::*;
    use crate::data::{Data, merge};
    use crate::likelihood::{Form, Likelihood, Order};
    use crate::vecchia::neighbours::nearest_earlier;

    fn sample(n: usize) -> Scaled {
        let mut rng = stream(4, Purpose::Test, n as u64, 2);
        let x: Vec<f64> = (0..n * 2).map(|_| rng.random()).collect();
        let y: Vec<f64> = x
            .chunks(2)
            .map(|x| (5.0 * x[0]).sin() + x[1] + 0.3 * rng.random::<f64>())
            .collect();
        let noise_variance: Vec<f64> = (0..n).map(|_| 0.01 + 0.02 * rng.random::<f64>()).collect();
        let data = Data {
            x: &x,
            d: 2,
            y: &y,
            noise_variance: &noise_variance,
        };
        Scaled::new(&merge(&data).unwrap()).unwrap()
    }

    #[test]
    fn given_all_earlier_points_the_likelihood_is_exact() {
        let data = sample(60);
        let at = [-0.7, 0.2, 0.3];
        let all: Vec<Vec<u32>> = (0..60).map(|i| (0..i).collect()).collect();
        for kernel in Kernel::ALL {
            let ours = Conditionals::new(kernel, &data, &all)
                .evaluate(&at)
                .unwrap();
            let form = Form {
                kernel,
                ..Form::default()
            };
            let exact = Likelihood::new(form, std::borrow::Cow::Borrowed(&data), 0.0)
                .evaluate(&at, Order::Gradient)
                .unwrap();
            // Rounding times the condition of the matrix.
            assert!((ours.value - exact.value).abs() < 1e-8, "{kernel}");
            for (a, b) in ours.gradient.iter().zip(&exact.gradient) {
                assert!((a - b).abs() < 1e-7 * (1.0 + b.abs()), "{kernel}: {a} {b}");
            }
        }
    }

    #[test]
    fn the_gradient_agrees_with_differences() {
        let data = sample(80);
        let neighbours = nearest_earlier(&data.columns, 6);
        let at = [-0.7, 0.2, 0.3];
        for kernel in Kernel::ALL {
            let conditionals = Conditionals::new(kernel, &data, &neighbours);
            let exact = conditionals.evaluate(&at).unwrap();
            assert_eq!(conditionals.value(&at).unwrap().0, exact.value);
            for i in 0..3 {
                let shifted = |step: f64| {
                    let mut p = at;
                    p[i] += step;
                    conditionals.value(&p).unwrap().0
                };
                // Fourth-order differences.
                let h = 1e-3;
                let difference = (8.0 * (shifted(h) - shifted(-h)) - shifted(2.0 * h)
                    + shifted(-2.0 * h))
                    / (12.0 * h);
                let error = (difference - exact.gradient[i]).abs();
                assert!(
                    error < 1e-6 * (1.0 + difference.abs()),
                    "{kernel} {i}: {error}"
                );
            }
        }
    }
}
