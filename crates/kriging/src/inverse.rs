//! The inverse of a covariance matrix from its Cholesky factor, in the place of one matrix.
//!
//! With W = L⁻¹ the inverse is WᵀW. Both steps take about n³/3 multiplications and are written so
//! that nearly all of them are products of large rectangles, which run at the processor's full
//! speed, with panels of [`PANEL`] columns or rows:
//!
//! - W by halves: W₂₁ = −W₂₂ (L₂₁ W₁₁), panel by panel, so that the zeros of W₁₁ and W₂₂ are left out;
//! - panel I of WᵀW is the product of W's rows from I on; it needs no row above, so it can take the
//!   place of W's rows I.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::prelude::{Reborrow as _, ReborrowMut as _};
use faer::{Accum, MatMut, MatRef, Par};

/// Rows or columns of a panel. The zeros within panels cost n² times this.
const PANEL: usize = 48;

/// Writes the lower triangle of C⁻¹ to `inverse` (n × n), given the lower triangle of C's factor.
pub(crate) fn invert(factor: &[f64], n: usize, inverse: &mut [f64]) {
    let mut tile = vec![0.0; PANEL.min(n) * n];
    let mut w = MatMut::from_column_major_slice_mut(inverse, n, n);
    let factor = MatRef::from_column_major_slice(factor, n, n);
    invert_triangle(factor, w.rb_mut(), &mut tile);
    for i in (0..n).step_by(PANEL) {
        let rows = PANEL.min(n - i);
        let mut tile =
            MatMut::from_column_major_slice_mut(&mut tile[..rows * (i + rows)], rows, i + rows);
        let below = w.rb().subrows(i, n - i);
        product(
            tile.rb_mut(),
            below.subcols(i, rows).transpose(),
            below.subcols(0, i + rows),
            1.0,
        );
        w.rb_mut()
            .submatrix_mut(i, 0, rows, i + rows)
            .copy_from(tile);
    }
}

/// Writes L⁻¹ to the lower triangle of `w`, and zeros above it within the panels on the diagonal.
fn invert_triangle(l: MatRef<'_, f64>, mut w: MatMut<'_, f64>, tile: &mut [f64]) {
    let n = l.nrows();
    if n <= PANEL {
        w.fill(0.0);
        invert_lower_triangular(w, l, Par::Seq);
        return;
    }
    let half = (n / 2).next_multiple_of(PANEL);
    let (mut w11, _, mut w21, mut w22) = w.split_at_mut(half, half);
    let (l11, _, l21, l22) = l.split_at(half, half);
    invert_triangle(l11, w11.rb_mut(), tile);
    invert_triangle(l22, w22.rb_mut(), tile);
    for j in (0..half).step_by(PANEL) {
        product(
            w21.rb_mut().subcols_mut(j, PANEL),
            l21.subcols(j, half - j),
            w11.rb().submatrix(j, j, half - j, PANEL),
            1.0,
        );
    }
    // From the bottom up: a panel needs those above it as they were.
    for i in (0..n - half).step_by(PANEL).rev() {
        let rows = PANEL.min(n - half - i);
        let mut tile = MatMut::from_column_major_slice_mut(&mut tile[..rows * half], rows, half);
        product(
            tile.rb_mut(),
            w22.rb().submatrix(i, 0, rows, i + rows),
            w21.rb().subrows(0, i + rows),
            -1.0,
        );
        w21.rb_mut().subrows_mut(i, rows).copy_from(tile);
    }
}

fn product(to: MatMut<'_, f64>, a: MatRef<'_, f64>, b: MatRef<'_, f64>, factor: f64) {
    matmul(to, Accum::Replace, a, b, factor, Par::Seq);
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use super::*;
    use crate::covariance::factorise;

    /// At sizes around the panels': C C⁻¹ is the unit matrix.
    #[test]
    fn it_is_the_inverse() {
        for n in [1, 2, 47, 48, 49, 95, 96, 97, 200, 257] {
            let mut rng = stream(11, Purpose::Test, n as u64, 0);
            let root: Vec<f64> = (0..n * n).map(|_| rng.random::<f64>() - 0.5).collect();
            let mut matrix = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..n {
                    let sum: f64 = (0..n).map(|k| root[k * n + i] * root[k * n + j]).sum();
                    matrix[j * n + i] = sum + if i == j { 1.0 } else { 0.0 };
                }
            }
            let mut factor = matrix.clone();
            factorise(&mut factor, n).unwrap();
            // What is there before must not matter.
            let mut inverse = vec![f64::NAN; n * n];
            invert(&factor, n, &mut inverse);
            let of = |i: usize, j: usize| inverse[i.min(j) * n + i.max(j)];
            for i in 0..n {
                for j in 0..n {
                    let sum: f64 = (0..n).map(|k| matrix[k * n + i] * of(k, j)).sum();
                    let expected = if i == j { 1.0 } else { 0.0 };
                    // Rounding times the condition, about 10 to 100.
                    assert!((sum - expected).abs() < 1e-11, "{n} {i} {j}: {sum}");
                }
            }
        }
    }
}
