//! The inverse of a covariance matrix from its Cholesky factor, in the place of one matrix.
//!
//! With W = L⁻¹ the inverse is WᵀW. Both steps take about n³/3 multiplications, nearly all of them in
//! products of large rectangles, which run at the processor's full speed:
//!
//! - W by halves: W₂₁ = −W₂₂ (L₂₁ W₁₁);
//! - panel I of WᵀW is the product of W's rows from I on; it needs no row above, so it can take the
//!   place of W's rows I.
//!
//! Products with a triangle go by panels of [`PANEL`] rows, so that most of its zeros are left out, and by
//! strips of [`STRIP`] within a panel's own triangle; from the right by halves, since a strip of columns
//! would have the whole other factor arranged anew for its few columns.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::linalg::triangular_solve::solve_upper_triangular_in_place;
use faer::prelude::{Reborrow as _, ReborrowMut as _};
use faer::{Accum, MatMut, MatRef, Par};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

/// Rows of a panel.
const PANEL: usize = 384;
/// Rows or columns of a strip. The zeros within strips cost n² times this.
const STRIP: usize = 48;

/// Writes the lower triangle of C⁻¹ to `inverse` (n × n), given the lower triangle of C's factor.
pub(crate) fn invert(factor: &[f64], n: usize, inverse: &mut [f64]) {
    let mut tile = vec![0.0; (n * PANEL.min(n)).max(middle(n).pow(2))];
    let mut w = MatMut::from_column_major_slice_mut(inverse, n, n);
    let factor = MatRef::from_column_major_slice(factor, n, n);
    invert_triangle(factor, w.rb_mut(), &mut tile);
    square(w, &mut tile);
}

/// Random vectors the mean of whose squares is C⁻¹: see [`Probes::new`].
pub(crate) struct Probes {
    n: usize,
    /// n × count, column-major; divided by √count.
    vectors: Vec<f64>,
}

impl Probes {
    /// `count` vectors s = L⁻ᵀz, z of random signs, L the factor of C. The mean of ssᵀ over them is a
    /// random matrix whose expectation is C⁻¹.
    ///
    /// A trace tr(C⁻¹ ∂C) estimated by it errs by √(2 Σ_{i≠j} Aᵢⱼ²/`count`), A = L⁻¹ ∂C L⁻ᵀ (M. F.
    /// Hutchinson, Commun. Statist. Simula. 19 (1990) 433–450). The likelihood's derivative is half the
    /// trace and its expected information ½ Σ Aᵢⱼ², so that it errs by no more than 1/√`count` of its own
    /// standard deviation over data: a Newton step then ends that share of the parameters' standard
    /// errors off.
    pub(crate) fn new(factor: &[f64], n: usize, count: usize) -> Self {
        let mut rng = stream(0, Purpose::Fit, 3, n as u64);
        let size = (count as f64).sqrt().recip();
        let mut vectors: Vec<f64> = (0..n * count)
            .map(|_| if rng.random() { size } else { -size })
            .collect();
        solve_upper_triangular_in_place(
            MatRef::from_column_major_slice(factor, n, n).transpose(),
            MatMut::from_column_major_slice_mut(&mut vectors, n, count),
            Par::Seq,
        );
        Self { n, vectors }
    }

    /// The mean's rows from `start` on of its `width` columns from `start` on, column-major, in the
    /// place of `tile`.
    pub(crate) fn columns(&self, start: usize, width: usize, tile: &mut Vec<f64>) {
        let (n, rows) = (self.n, self.n - start);
        let count = self.vectors.len() / n;
        let vectors = MatRef::from_column_major_slice(&self.vectors, n, count);
        tile.resize(rows * width, 0.0);
        matmul(
            MatMut::from_column_major_slice_mut(tile, rows, width),
            Accum::Replace,
            vectors.subrows(start, rows),
            vectors.subrows(start, width).transpose(),
            1.0,
            Par::Seq,
        );
    }
}

/// Where a triangle of n rows is cut in two.
fn middle(n: usize) -> usize {
    (n / 2).next_multiple_of(STRIP)
}

/// Writes L⁻¹ to the lower triangle of `w`, and zeros above it within the strips on the diagonal.
fn invert_triangle(l: MatRef<'_, f64>, mut w: MatMut<'_, f64>, tile: &mut [f64]) {
    let n = l.nrows();
    if n <= STRIP {
        w.fill(0.0);
        invert_lower_triangular(w, l, Par::Seq);
        return;
    }
    let half = middle(n);
    let (mut w11, _, w21, mut w22) = w.split_at_mut(half, half);
    let (l11, _, l21, l22) = l.split_at(half, half);
    invert_triangle(l11, w11.rb_mut(), tile);
    invert_triangle(l22, w22.rb_mut(), tile);
    let rows = n - half;
    let mut tile = MatMut::from_column_major_slice_mut(&mut tile[..rows * half], rows, half);
    times_triangle(l21, w11.rb(), tile.rb_mut());
    minus_triangle_times(w22.rb(), tile.rb(), w21);
}

/// `to` = A W, W a lower triangle.
fn times_triangle(a: MatRef<'_, f64>, w: MatRef<'_, f64>, to: MatMut<'_, f64>) {
    let n = w.nrows();
    if n <= STRIP {
        product(to, Accum::Replace, a, w, 1.0);
        return;
    }
    let half = middle(n);
    let (w11, _, w21, w22) = w.split_at(half, half);
    let (a1, a2) = a.split_at_col(half);
    let (mut left, right) = to.split_at_col_mut(half);
    times_triangle(a1, w11, left.rb_mut());
    product(left, Accum::Add, a2, w21, 1.0);
    times_triangle(a2, w22, right);
}

/// `to` = −W B, W a lower triangle.
fn minus_triangle_times(w: MatRef<'_, f64>, b: MatRef<'_, f64>, mut to: MatMut<'_, f64>) {
    let n = w.nrows();
    for start in (0..n).step_by(PANEL) {
        let end = (start + PANEL).min(n);
        for i in (start..end).step_by(STRIP) {
            let height = STRIP.min(end - i);
            let strip = w.submatrix(i, start, height, i + height - start);
            let b = b.subrows(start, i + height - start);
            product(
                to.rb_mut().subrows_mut(i, height),
                Accum::Replace,
                strip,
                b,
                -1.0,
            );
        }
        let panel = w.submatrix(start, 0, end - start, start);
        let to = to.rb_mut().subrows_mut(start, end - start);
        product(to, Accum::Add, panel, b.subrows(0, start), -1.0);
    }
}

/// Replaces the lower triangle W by that of WᵀW.
fn square(mut w: MatMut<'_, f64>, tile: &mut [f64]) {
    let n = w.nrows();
    for start in (0..n).step_by(PANEL) {
        let end = (start + PANEL).min(n);
        let rows = end - start;
        // Left of the panel's own triangle.
        let mut left = MatMut::from_column_major_slice_mut(&mut tile[..rows * start], rows, start);
        for k in (start..end).step_by(STRIP) {
            let height = STRIP.min(end - k);
            let strip = w.rb().submatrix(k, k, end - k, height).transpose();
            let right = w.rb().submatrix(k, 0, end - k, start);
            product(
                left.rb_mut().subrows_mut(k - start, height),
                Accum::Replace,
                strip,
                right,
                1.0,
            );
        }
        let below = w.rb().subrows(end, n - end);
        let (panel, right) = (
            below.subcols(start, rows).transpose(),
            below.subcols(0, start),
        );
        product(left.rb_mut(), Accum::Add, panel, right, 1.0);
        w.rb_mut()
            .submatrix_mut(start, 0, rows, start)
            .copy_from(left);
        for k in (start..end).step_by(STRIP) {
            let height = STRIP.min(end - k);
            let width = k + height - start;
            let mut own =
                MatMut::from_column_major_slice_mut(&mut tile[..height * width], height, width);
            let below = w.rb().subrows(k, n - k);
            let strip = below.subcols(k, height).transpose();
            product(
                own.rb_mut(),
                Accum::Replace,
                strip,
                below.subcols(start, width),
                1.0,
            );
            w.rb_mut()
                .submatrix_mut(k, start, height, width)
                .copy_from(own);
        }
    }
}

fn product(to: MatMut<'_, f64>, accum: Accum, a: MatRef<'_, f64>, b: MatRef<'_, f64>, factor: f64) {
    if to.ncols() > 0 && a.ncols() > 0 {
        matmul(to, accum, a, b, factor, Par::Seq);
    }
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
        for n in [1, 2, 47, 48, 49, 95, 96, 97, 200, 257, 400] {
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

    /// The mean over samples of the sampled matrix is the inverse, and a trace by it errs as little as
    /// its documentation says.
    #[test]
    fn a_sampled_inverse_is_right_on_average() {
        let n = 60;
        let mut matrix = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                let distance = (i as f64 - j as f64).abs();
                matrix[j * n + i] = (-0.2 * distance).exp() + if i == j { 0.1 } else { 0.0 };
            }
        }
        factorise(&mut matrix, n).unwrap();
        let mut exact = vec![0.0; n * n];
        invert(&matrix, n, &mut exact);
        let count = 20_000;
        let probes = Probes::new(&matrix, n, count);
        let mut column = Vec::new();
        for k in 0..n {
            probes.columns(k, 1, &mut column);
            for i in k..n {
                let (a, b) = (exact[k * n + i], column[i - k]);
                // The standard error of a mean of products is at most √(2 C⁻¹ᵢᵢ C⁻¹ₖₖ/count).
                let scale = (exact[k * n + k] * exact[i * n + i]).sqrt();
                let error = (2.0 / count as f64).sqrt() * scale;
                assert!((a - b).abs() < 5.0 * error, "{i} {k}: {a} {b}");
            }
        }
    }
}
