//! Covariance matrices relative to the process variance.
//!
//! Everything is written for C = R + jitter·I + diag(noise/σ²), so that the K_Δ of equations (19)
//! and (20) is σ² C.

use crate::kernel::Kernel;
use crate::panels::{Lower, ROWS, panels, rows};

/// What may be added to the diagonal, relative to the process variance, in the order of trial.
pub(crate) const JITTERS: [f64; 6] = [0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4];

/// Makes `matrix`, and `copy` if there is one, the correlations of the n points whose scaled coordinates
/// are `columns`.
pub(crate) fn fill_correlations(
    kernel: Kernel,
    columns: &[Vec<f64>],
    n: usize,
    matrix: &mut Lower,
    mut copy: Option<&mut Lower>,
) {
    matrix.resize(n);
    if let Some(copy) = &mut copy {
        copy.resize(n);
    }
    for p in 0..panels(n) {
        let all: Vec<&[f64]> = columns.iter().map(|c| &c[..rows(p, n).end]).collect();
        let panel = matrix.panel_mut(p);
        kernel.correlations_of_panel(&coordinates(columns, p), &all, &mut panel[..rows(p, n).end]);
        if p + 1 == panels(n) {
            matrix.pad();
        }
        if let Some(copy) = &mut copy {
            copy.panel_mut(p).copy_from_slice(matrix.panel(p));
        }
    }
}

/// The coordinates of the points of panel p, those of one more coordinate after the other; beyond the
/// last point there are copies of it.
pub(crate) fn coordinates(columns: &[Vec<f64>], p: usize) -> Vec<[f64; ROWS]> {
    let of_column = |column: &Vec<f64>| {
        let last = column.len() - 1;
        std::array::from_fn(|r| column[(p * ROWS + r).min(last)])
    };
    columns.iter().map(of_column).collect()
}

/// Completes the correlations in `matrix` to C.
pub(crate) fn add_to_diagonal(noise_ratio: impl Fn(usize) -> f64, jitter: f64, matrix: &mut Lower) {
    for k in 0..matrix.len() {
        *matrix.get_mut(k, k) += jitter + noise_ratio(k);
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

/// ln |C| of the matrix whose Cholesky factor is `factor`.
pub(crate) fn log_determinant(factor: &Lower) -> f64 {
    2.0 * factor.diagonal().map(f64::ln).sum::<f64>()
}
