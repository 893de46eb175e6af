//! Random wear multipliers along a flank: a stationary Gaussian process of mean 1 on roll angle.
//!
//! The process is represented by a low-rank factor, Θ(θ) = 1 + Σ_k z_k φ_k(θ), with independent
//! standard normals z_k. Pivoted Cholesky factorisation on a fixed set of candidate roll angles
//! picks the angles θ_k; φ_k are the Newton basis functions of the kernel at those angles,
//! φ_k(θ) = (k(θ, θ_k) − Σ_{i<k} φ_i(θ) φ_i(θ_k)) / √(residual variance at θ_k). They are functions
//! of the roll angle, so the field does not depend on where it is evaluated: a finer path of
//! contact samples the same field from the same normals. The factorisation stops when the largest
//! residual variance among the candidates is below [`RESIDUAL`] of the variance.
//!
//! References: H. Harbrecht, M. Peters, R. Schneider, *On the low-rank approximation by the pivoted
//! Cholesky decomposition*, Appl. Numer. Math. 62 (2012); M. Pazouki, R. Schaback, *Bases for
//! kernel-based spaces*, J. Comput. Appl. Math. 236 (2011).

use crate::input::Wear;

/// Residual variance left out, as a fraction of the variance. A smooth kernel reaches it with a
/// few modes; a rough one (exponential, spherical) uses every candidate and loses the variance
/// between two neighbouring candidates, about 1/16 of the variance at most.
const RESIDUAL: f64 = 1e-6;

/// Candidates in one correlation range, and the smallest and largest number of candidates.
const PER_RANGE: f64 = 16.0;
const CANDIDATES: (f64, f64) = (33.0, 257.0);

/// The basis functions of one gear's field at given places.
#[derive(Debug, Clone)]
pub(crate) struct Field {
    /// Mode by mode, each a run of `len` values.
    modes: Vec<f64>,
    len: usize,
}

impl Field {
    /// Evaluates the basis at the roll angles `theta`, which all lie in `interval`.
    pub(crate) fn new(wear: &Wear, interval: (f64, f64), theta: &[f64]) -> Self {
        let (start, end) = interval;
        let width = (end - start).abs();
        let count = (PER_RANGE * width / wear.range)
            .ceil()
            .clamp(CANDIDATES.0, CANDIDATES.1);
        let count = count as usize;
        let candidates: Vec<f64> = (0..count)
            .map(|k| start + (end - start) * k as f64 / (count - 1) as f64)
            .collect();
        let kernel =
            |a: f64, b: f64| wear.variance * wear.kernel.correlation((a - b).abs() / wear.range);

        let len = theta.len();
        let mut modes: Vec<f64> = Vec::new();
        let mut factor: Vec<Vec<f64>> = Vec::new();
        let mut residual = vec![wear.variance; count];
        while factor.len() < count {
            // The first of equal residuals wins, so the order of modes is fixed.
            let pivot = (0..count).fold(0, |best, k| {
                if residual[k] > residual[best] {
                    k
                } else {
                    best
                }
            });
            // A NaN is not significant either, so it ends the factorisation.
            let significant = residual[pivot] > RESIDUAL * wear.variance;
            if !significant {
                break;
            }
            let scale = 1.0 / residual[pivot].sqrt();
            let mode: Vec<f64> = (0..count)
                .map(|k| {
                    let projected: f64 = factor.iter().map(|row| row[k] * row[pivot]).sum();
                    (kernel(candidates[k], candidates[pivot]) - projected) * scale
                })
                .collect();
            let from = modes.len();
            modes.extend(theta.iter().map(|&angle| kernel(angle, candidates[pivot])));
            let (earlier, new) = modes.split_at_mut(from);
            for (row, old) in factor.iter().zip(earlier.chunks_exact(len)) {
                let coefficient = row[pivot];
                for (value, old) in new.iter_mut().zip(old) {
                    *value -= coefficient * old;
                }
            }
            for value in new {
                *value *= scale;
            }
            for (left, value) in residual.iter_mut().zip(&mode) {
                *left -= value * value;
            }
            residual[pivot] = 0.0;
            factor.push(mode);
        }
        Self { modes, len }
    }

    /// Number of modes.
    pub(crate) fn rank(&self) -> usize {
        self.modes.len() / self.len
    }

    /// Fills `out` with 1 + Σ z_k φ_k, clamped at zero because wear cannot add material.
    pub(crate) fn evaluate(&self, z: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.len, 1.0);
        for (mode, &z) in self.modes.chunks_exact(self.len).zip(z) {
            for (value, mode) in out.iter_mut().zip(mode) {
                *value += z * mode;
            }
        }
        for value in out {
            *value = value.max(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Kernel;

    fn wear(kernel: Kernel) -> Wear {
        Wear {
            max_depth: 0.0035,
            kernel,
            range: 0.2,
            variance: 0.01,
        }
    }

    fn angles(count: usize) -> Vec<f64> {
        (0..count)
            .map(|k| 0.1 + 0.5 * k as f64 / (count - 1) as f64)
            .collect()
    }

    /// Φ Φᵀ must be the kernel matrix, up to the stated residual.
    #[test]
    fn smooth_kernels_are_reproduced() {
        let theta = angles(41);
        for (kernel, tolerance) in [
            // The off-diagonal error is bounded by the residual variance, 1e-6.
            (Kernel::SquaredExponential, 2e-6),
            // Candidates are 1/16 range apart; between them a Matérn process keeps a residual.
            (Kernel::Matern52, 2e-5),
            (Kernel::Matern32, 1e-3),
        ] {
            let wear = wear(kernel);
            let field = Field::new(&wear, (0.1, 0.6), &theta);
            for i in 0..41 {
                for j in 0..41 {
                    let sum: f64 = field
                        .modes
                        .chunks_exact(41)
                        .map(|mode| mode[i] * mode[j])
                        .sum();
                    let exact = kernel.correlation((theta[i] - theta[j]).abs() / 0.2);
                    assert!(
                        (sum / 0.01 - exact).abs() < tolerance,
                        "{kernel} {i} {j}: {sum}"
                    );
                }
            }
        }
    }

    #[test]
    fn rough_kernels_lose_little_variance_between_candidates() {
        let theta = angles(1001);
        for kernel in [Kernel::Exponential, Kernel::Spherical] {
            let field = Field::new(&wear(kernel), (0.1, 0.6), &theta);
            for i in 0..1001 {
                let sum: f64 = field
                    .modes
                    .chunks_exact(1001)
                    .map(|mode| mode[i] * mode[i])
                    .sum();
                // Midway between candidates 1/16 range apart: tanh(1/32) for the exponential,
                // 1.5 times that for the spherical kernel's steeper start.
                assert!(
                    sum / 0.01 > 0.95 && sum / 0.01 < 1.0 + 1e-9,
                    "{kernel}: {sum}"
                );
            }
        }
    }

    #[test]
    fn a_finer_grid_samples_the_same_field() {
        let wear = wear(Kernel::SquaredExponential);
        let (coarse, fine) = (angles(11), angles(101));
        let z = [
            0.3, -1.2, 0.7, 2.0, -0.4, 0.1, 1.0, -0.8, 0.6, 0.2, -0.1, 0.5,
        ];
        let sample = |theta: &[f64]| {
            let field = Field::new(&wear, (0.1, 0.6), theta);
            assert!(field.rank() <= z.len());
            let mut out = Vec::new();
            field.evaluate(&z, &mut out);
            out
        };
        let (coarse, fine) = (sample(&coarse), sample(&fine));
        for k in 0..11 {
            assert!((coarse[k] - fine[10 * k]).abs() < 1e-12);
        }
    }

    #[test]
    fn a_negative_multiplier_is_clamped() {
        let theta = angles(5);
        let field = Field::new(
            &Wear {
                variance: 4.0,
                ..wear(Kernel::SquaredExponential)
            },
            (0.1, 0.6),
            &theta,
        );
        let mut out = Vec::new();
        field.evaluate(&[-5.0; 12], &mut out);
        assert!(out.contains(&0.0) && out.iter().all(|&v| v >= 0.0));
    }

    #[test]
    fn no_variance_means_no_modes() {
        let wear = Wear {
            variance: 0.0,
            ..wear(Kernel::Exponential)
        };
        assert_eq!(Field::new(&wear, (0.1, 0.6), &angles(5)).rank(), 0);
    }
}
