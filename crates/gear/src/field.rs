//! Random wear multipliers along a flank: a stationary Gaussian process of mean 1 on roll angle.
//!
//! The process is represented by a truncated Karhunen–Loève expansion on the interval of roll
//! angles that the flank passes, Θ(θ) = 1 + Σ_k z_k ψ_k(θ) with independent standard normals z_k
//! and ψ_k the eigenfunctions of the covariance, scaled by the roots of their eigenvalues. A
//! sample costs O(n r) for n places and r modes. The expansion is found in two steps:
//!
//! 1. Pivoted Cholesky factorisation on a dense set of candidate roll angles picks angles θ_k; the
//!    Newton basis functions of the kernel at those angles,
//!    φ_k(θ) = (k(θ, θ_k) − Σ_{i<k} φ_i(θ) φ_i(θ_k)) / √(residual variance at θ_k), span it. They are
//!    functions of the roll angle, so the field does not depend on where it is evaluated: a finer
//!    path of contact samples the same field from the same normals.
//! 2. The eigenpairs of the small matrix ∫ φ_i φ_j dθ / (length of the interval), taken by the
//!    trapezoidal rule on the candidates, rotate that basis into the Karhunen–Loève one. Modes are
//!    kept from the strongest on until [`TRUNCATION`] of the variance is left.
//!
//! **Truncation error.** The covariance of the truncated field is below the exact one in the sense
//! of quadratic forms: no direction gains variance. The share lost, as a mean over the interval, is
//! 1 − Σ λ_k/σ² (λ_k the eigenvalues kept; [`Field::left_out`]). It is at most 10⁻⁵ for the smooth
//! kernels. A rough kernel's eigenvalues fall like 1/k², and the number of modes is limited to
//! [`MAX_RANK`]: over 2.5 ranges the exponential kernel loses 1.3 % of the variance and the spherical
//! one 2.2 %, all of it in waves shorter than a tenth of the range. For these two the stated share is
//! a tenth too low, because it is taken on the candidates and chosen angles, where nothing is lost,
//! are among them. A smooth kernel meets the limit only where the flank rolls through ten ranges or
//! more.
//!
//! **Negative multipliers.** A Gaussian multiplier can be negative, wear cannot: Θ < 0 counts as 0.
//! At the paper's variance of 0.01 that takes a deviation of ten standard deviations. The clamp
//! raises the mean of Θ by σ (φ(t) − t Φ(−t)), t = 1/σ: 7e-26 at σ = 0.1, 8.5e-3 σ at σ = 0.5.
//!
//! References: H. Harbrecht, M. Peters, R. Schneider, *On the low-rank approximation by the pivoted
//! Cholesky decomposition*, Appl. Numer. Math. 62 (2012); H. Harbrecht, M. Peters, M. Siebenmorgen,
//! *Efficient approximation of random fields for numerical applications*, Numer. Linear Algebra
//! Appl. 22 (2015), for step 2; M. Pazouki, R. Schaback, *Bases for kernel-based spaces*,
//! J. Comput. Appl. Math. 236 (2011).

use nalgebra::{DMatrix, SymmetricEigen};

use crate::input::{Kernel, Wear};

/// Share of the variance that may be left out by dropping modes.
const TRUNCATION: f64 = 1e-5;

/// The factorisation stops when no candidate has more than this share of its variance left.
const RESIDUAL: f64 = 1e-6;

/// Number of candidates in one correlation range, and their smallest number, for kernels with a
/// derivative at h = 0 that bounds the variation between two candidates.
const SMOOTH: (f64, f64) = (24.0, 33.0);
/// The same for kernels without such a derivative.
const ROUGH: (f64, f64) = (64.0, 193.0);
/// The largest number of candidates.
const MOST: f64 = 513.0;

/// The most basis functions. The number is well below the largest number of candidates, so that the
/// variance lost between two chosen angles shows at the candidates between them.
const MAX_RANK: usize = 64;

/// The modes of one gear's field at given places.
#[derive(Debug, Clone)]
pub(crate) struct Field {
    /// Mode by mode, strongest first, each a run of `len` values.
    modes: Vec<f64>,
    len: usize,
    left_out: f64,
}

impl Field {
    /// Evaluates the modes at the roll angles `theta`, which all lie in `interval`.
    pub(crate) fn new(wear: &Wear, interval: (f64, f64), theta: &[f64]) -> Self {
        let newton = NewtonBasis::new(wear, interval, theta);
        let (len, rank) = (theta.len(), newton.at_candidates.len());
        let mut field = Self {
            modes: Vec::new(),
            len,
            left_out: 0.0,
        };
        if rank == 0 {
            return field;
        }
        let mut gram = DMatrix::zeros(rank, rank);
        let count = newton.at_candidates[0].len();
        for (i, a) in newton.at_candidates.iter().enumerate() {
            for (j, b) in newton.at_candidates[..=i].iter().enumerate() {
                let inner: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                let ends = a[0] * b[0] + a[count - 1] * b[count - 1];
                let mean = (inner - 0.5 * ends) / (count - 1) as f64;
                gram[(i, j)] = mean;
                gram[(j, i)] = mean;
            }
        }
        let eigen = SymmetricEigen::new(gram);
        let pairs = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter());
        let mut pairs: Vec<_> = pairs.collect();
        pairs.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let mut left = wear.variance;
        for (value, vector) in pairs {
            if left <= TRUNCATION * wear.variance {
                break;
            }
            left -= value;
            // An eigenvector's sign is arbitrary. Fixing it at the start of the interval keeps
            // equal normals giving similar fields for similar designs.
            let start: f64 = vector
                .iter()
                .zip(&newton.at_candidates)
                .map(|(v, mode)| v * mode[0])
                .sum();
            let from = field.modes.len();
            field.modes.resize(from + len, 0.0);
            let mode = &mut field.modes[from..];
            for (v, basis) in vector.iter().zip(newton.at_places.chunks_exact(len)) {
                let v = v * start.signum();
                for (value, basis) in mode.iter_mut().zip(basis) {
                    *value += v * basis;
                }
            }
        }
        field.left_out = (left / wear.variance).max(0.0);
        field
    }

    /// Share of the variance left out by truncation, as a mean over the interval.
    pub(crate) const fn left_out(&self) -> f64 {
        self.left_out
    }

    /// Number of modes.
    pub(crate) fn rank(&self) -> usize {
        self.modes.len() / self.len
    }

    /// Fills `out` with 1 + Σ z_k ψ_k, clamped at zero because wear cannot add material.
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

/// The kernel's Newton basis at the angles chosen by pivoted Cholesky factorisation.
struct NewtonBasis {
    /// Function by function, its values at the candidates.
    at_candidates: Vec<Vec<f64>>,
    /// Function by function, each a run of values at the places asked for.
    at_places: Vec<f64>,
}

impl NewtonBasis {
    fn new(wear: &Wear, interval: (f64, f64), theta: &[f64]) -> Self {
        let (start, end) = interval;
        let width = (end - start).abs();
        let (per_range, least) = match wear.kernel {
            Kernel::SquaredExponential | Kernel::Matern52 => SMOOTH,
            Kernel::Matern32 | Kernel::Exponential | Kernel::Spherical => ROUGH,
        };
        // In this order, because a NaN must give the least number.
        let count = (per_range * width / wear.range).ceil().max(least).min(MOST) as usize;
        let candidates: Vec<f64> = (0..count)
            .map(|k| start + (end - start) * k as f64 / (count - 1) as f64)
            .collect();
        let kernel =
            |a: f64, b: f64| wear.variance * wear.kernel.correlation((a - b).abs() / wear.range);

        let len = theta.len();
        let mut at_places: Vec<f64> = Vec::new();
        let mut at_candidates: Vec<Vec<f64>> = Vec::new();
        let mut residual = vec![wear.variance; count];
        while at_candidates.len() < MAX_RANK {
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
            let mut mode: Vec<f64> = candidates
                .iter()
                .map(|&angle| kernel(angle, candidates[pivot]))
                .collect();
            let from = at_places.len();
            at_places.extend(theta.iter().map(|&angle| kernel(angle, candidates[pivot])));
            let (earlier, new) = at_places.split_at_mut(from);
            for (row, old) in at_candidates.iter().zip(earlier.chunks_exact(len)) {
                let coefficient = row[pivot];
                subtract(&mut mode, coefficient, row);
                subtract(new, coefficient, old);
            }
            for value in mode.iter_mut().chain(new) {
                *value *= scale;
            }
            for (left, value) in residual.iter_mut().zip(&mode) {
                *left -= value * value;
            }
            residual[pivot] = 0.0;
            at_candidates.push(mode);
        }
        Self {
            at_candidates,
            at_places,
        }
    }
}

/// a −= k b.
fn subtract(a: &mut [f64], k: f64, b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a -= k * b;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::WearLaw;

    fn wear(kernel: Kernel) -> Wear {
        Wear {
            law: WearLaw::Archard { max_depth_um: 3.5 },
            kernel,
            range: 0.2,
            variance: 0.01,
            life: None,
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
            // The variance lost by truncation, 1e-5 on average, gathers at the ends of the interval.
            (Kernel::SquaredExponential, 5e-5),
            (Kernel::Matern52, 2e-4),
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

    /// The stated truncation against the variance that is missing on a grid that shares no angle
    /// with the candidates but the ends.
    #[test]
    fn truncation_is_what_is_missing() {
        let theta = angles(1001);
        for (kernel, low, high) in [
            (Kernel::SquaredExponential, 0.0, 1e-5),
            (Kernel::Matern52, 0.0, 1e-5),
            (Kernel::Matern32, 0.0, 2e-5),
            // The optimal expansion of 64 modes over 2.5 ranges loses 2 · 2.5/(π² · 64) = 0.8 % of
            // the exponential kernel's variance and 1.5 times that of the spherical one's.
            (Kernel::Exponential, 0.008, 0.02),
            (Kernel::Spherical, 0.012, 0.03),
        ] {
            let field = Field::new(&wear(kernel), (0.1, 0.6), &theta);
            let variance = |i: usize| -> f64 {
                let modes = field.modes.chunks_exact(1001);
                modes.map(|mode| mode[i] * mode[i]).sum::<f64>() / 0.01
            };
            let mut missing = 0.0;
            for i in 0..1001 {
                assert!(
                    variance(i) < 1.0 + 1e-9,
                    "{kernel}: variance is never gained"
                );
                missing += (1.0 - variance(i)) / 1001.0;
            }
            assert!(field.left_out() >= low && field.left_out() <= high);
            // Chosen angles lie on the candidates, where nothing is missing of a rough kernel.
            assert!(
                (field.left_out() - missing).abs() < 1e-6 + 0.2 * missing,
                "{kernel}"
            );
        }
    }

    /// The properties of a Karhunen–Loève expansion: modes are orthogonal over the interval,
    /// strongest first, and eigenfunctions of the covariance, ∫ k(θ, t) ψ(t) dt = λ ψ(θ).
    #[test]
    fn modes_are_eigenfunctions() {
        // Simpson's rule, unlike the trapezoidal one that the modes were found with.
        const COUNT: usize = 401;
        let theta = angles(COUNT);
        let weight = |i: usize| {
            let w = if i == 0 || i == COUNT - 1 {
                1.0
            } else {
                2.0 + 2.0 * (i % 2) as f64
            };
            w / (3 * (COUNT - 1)) as f64
        };
        let field = Field::new(&wear(Kernel::SquaredExponential), (0.1, 0.6), &theta);
        let modes: Vec<&[f64]> = field.modes.chunks_exact(COUNT).collect();
        let inner =
            |a: &[f64], b: &[f64]| -> f64 { (0..COUNT).map(|i| weight(i) * a[i] * b[i]).sum() };
        let values: Vec<f64> = modes.iter().map(|mode| inner(mode, mode)).collect();
        assert!(values.windows(2).all(|w| w[0] > w[1]));
        for (i, a) in modes.iter().enumerate() {
            for b in &modes[..i] {
                // The trapezoidal rule on 80 cells is good to about 1e-4 of the strongest mode.
                assert!(inner(a, b).abs() < 2e-4 * values[0]);
            }
        }
        for place in [0, 77, 200, 400] {
            let kernel: Vec<f64> = theta
                .iter()
                .map(|t| {
                    0.01 * Kernel::SquaredExponential.correlation((t - theta[place]).abs() / 0.2)
                })
                .collect();
            let image = inner(&kernel, modes[0]);
            assert!(
                (image / (values[0] * modes[0][place]) - 1.0).abs() < 1e-3,
                "{image}"
            );
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
