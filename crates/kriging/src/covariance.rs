//! Covariance matrices relative to the process variance, and their Cholesky factors.
//!
//! Everything is written for C = R + jitter·I + diag(noise/σ²), so that the K_Δ of equations (19)
//! and (20) is σ² C. Matrices are column-major with only the lower triangle in use.
//!
//! faer runs sequentially (`Par::Seq`): at these sizes threads inside a factorisation cost more than
//! they bring, and the result must not depend on their number.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{self, factor::LltParams};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{MatMut, MatRef, Par, Spec};

use crate::kernel::Kernel;

/// What may be added to the diagonal, relative to the process variance, in the order of trial.
pub(crate) const JITTERS: [f64; 6] = [0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4];

/// A pivot at or below zero, or so small that rounding made it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NotPositiveDefinite;

/// Fills the lower triangle of `matrix` (n × n), and of `copy` if there is one, with the correlations of
/// the points whose scaled coordinates are `columns`.
pub(crate) fn fill_correlations(
    kernel: Kernel,
    columns: &[Vec<f64>],
    n: usize,
    matrix: &mut [f64],
    mut copy: Option<&mut [f64]>,
) {
    let mut at = vec![0.0; columns.len()];
    for k in 0..n {
        for (a, column) in at.iter_mut().zip(columns) {
            *a = column[k];
        }
        let run = k * n + k..(k + 1) * n;
        let correlations = &mut matrix[run.clone()];
        correlations[0] = 1.0;
        kernel.correlations(&at, |j| &columns[j][k + 1..], &mut correlations[1..]);
        if let Some(copy) = &mut copy {
            copy[run].copy_from_slice(correlations);
        }
    }
}

/// Completes the correlations in `matrix` to C.
pub(crate) fn add_to_diagonal(
    noise_ratio: impl Fn(usize) -> f64,
    jitter: f64,
    n: usize,
    matrix: &mut [f64],
) {
    for k in 0..n {
        matrix[k * n + k] += jitter + noise_ratio(k);
    }
}

/// noise/σ², also where both vanish. Limited so that no product of two overflows.
pub(crate) fn noise_ratio(noise: f64, sigma2: f64) -> f64 {
    if noise == 0.0 {
        0.0
    } else {
        (noise / sigma2).min(1e100)
    }
}

/// Replaces the lower triangle of `matrix` by its Cholesky factor.
pub(crate) fn factorise(matrix: &mut [f64], n: usize) -> Result<(), NotPositiveDefinite> {
    let diagonal: Vec<f64> = (0..n).map(|i| matrix[i * n + i]).collect();
    let parameters = blocks();
    let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, parameters);
    let mut memory = MemBuffer::new(scratch);
    llt::factor::cholesky_in_place(
        MatMut::from_column_major_slice_mut(&mut *matrix, n, n),
        Default::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        parameters,
    )
    .map_err(|_| NotPositiveDefinite)?;
    // The factor of a matrix that is singular but for rounding says nothing about the data. The
    // rounding error of a pivot is relative to its own diagonal element (Higham, "Accuracy and
    // Stability of Numerical Algorithms" (2002), section 10.1).
    let rounding = n as f64 * f64::EPSILON;
    let sound = |(i, c): (usize, &f64)| matrix[i * n + i].powi(2) > rounding * c;
    if diagonal.iter().enumerate().all(sound) {
        Ok(())
    } else {
        Err(NotPositiveDefinite)
    }
}

/// faer's own choice of blocks, 128 wide, takes a tenth longer at the sizes of kriging.
fn blocks() -> Spec<LltParams, f64> {
    let mut parameters = Spec::<LltParams, f64>::default();
    parameters.config.block_size = 64;
    parameters.config.recursion_threshold = 64;
    parameters
}

/// ln |C| of the matrix whose factor is `factor`.
pub(crate) fn log_determinant(factor: &[f64], n: usize) -> f64 {
    2.0 * (0..n).map(|i| factor[i * n + i].ln()).sum::<f64>()
}

/// Replaces each of the n-vectors in `vectors` by C⁻¹ times it.
pub(crate) fn solve(factor: &[f64], n: usize, vectors: &mut [f64]) {
    let count = vectors.len() / n;
    let mut memory = MemBuffer::new(llt::solve::solve_in_place_scratch::<f64>(
        n,
        count,
        Par::Seq,
    ));
    llt::solve::solve_in_place(
        MatRef::from_column_major_slice(factor, n, n),
        MatMut::from_column_major_slice_mut(vectors, n, count),
        Par::Seq,
        MemStack::new(&mut memory),
    );
}

/// Replaces each of the n-vectors in `vectors` by L⁻¹ times it, L the factor.
pub(crate) fn half_solve(factor: &[f64], n: usize, vectors: &mut [f64]) {
    let count = vectors.len() / n;
    solve_lower_triangular_in_place(
        MatRef::from_column_major_slice(factor, n, n),
        MatMut::from_column_major_slice_mut(vectors, n, count),
        Par::Seq,
    );
}
