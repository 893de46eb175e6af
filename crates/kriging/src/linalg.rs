//! Symmetric positive definite matrices, over faer.
//!
//! Only this module knows how a matrix lies in memory, which instructions the processor has, and
//! how many threads there are. Every result is the same to the bit for any number of threads: faer
//! shares out rows and columns of a product, never the terms of a sum. Between processors whose
//! vectors differ in width, the last bits differ.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Jitters in the order of trial: additions to the diagonal of a covariance matrix, relative to the
/// process variance.
pub(crate) const JITTERS: [f64; 6] = [0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4];

/// Number of rows from which threads gain more than they cost.
const SHARED: usize = 1000;

/// The threads for a matrix of n rows.
fn threads(n: usize) -> Par {
    if n < SHARED { Par::Seq } else { Par::rayon(0) }
}

/// Runs a loop with the widest vectors that the processor has. The loop must be inlined into `body`.
#[inline(always)]
pub(crate) fn vectorised<R>(body: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(body)
}

/// Σ aᵢ bᵢ, in an order that can be vectorised.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    vectorised(
        #[inline(always)]
        || sum_of(a, b, |a, b| a * b),
    )
}

/// Σ f(aᵢ, bᵢ), in an order that can be vectorised.
#[inline(always)]
pub(crate) fn sum_of(a: &[f64], b: &[f64], f: impl Fn(f64, f64) -> f64) -> f64 {
    const LANES: usize = 8;
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a_chunks.iter().zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += f(a[lane], b[lane]);
        }
    }
    for (lane, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
        sums[lane] += f(*a, *b);
    }
    sums.iter().sum()
}

/// The lower triangle of an n × n matrix, column by column.
#[derive(Debug, Clone)]
pub(crate) struct LowerTriangle {
    n: usize,
    /// n rows of every column. Numbers above the diagonal are arbitrary.
    values: Vec<f64>,
}

impl LowerTriangle {
    /// The matrix whose column k, from the diagonal down, `fill` writes.
    pub(crate) fn from_columns(n: usize, fill: impl Fn(usize, &mut [f64]) + Sync) -> Self {
        Self::in_memory(Vec::new(), n, fill)
    }

    /// [`LowerTriangle::from_columns`] in the memory of an earlier matrix: new memory would cost the system
    /// a tenth of a fit.
    pub(crate) fn in_memory(
        mut values: Vec<f64>,
        n: usize,
        fill: impl Fn(usize, &mut [f64]) + Sync,
    ) -> Self {
        values.resize(n * n, 0.0);
        let each = |(k, column): (usize, &mut [f64])| fill(k, &mut column[k..]);
        if n < SHARED {
            values.chunks_exact_mut(n.max(1)).enumerate().for_each(each);
        } else {
            values.par_chunks_exact_mut(n).enumerate().for_each(each);
        }
        Self { n, values }
    }

    /// The memory of the matrix, for [`LowerTriangle::in_memory`].
    pub(crate) fn into_memory(self) -> Vec<f64> {
        self.values
    }

    /// Column k from the diagonal down.
    pub(crate) fn column(&self, k: usize) -> &[f64] {
        &self.values[k * self.n + k..(k + 1) * self.n]
    }

    pub(crate) fn diagonal(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.n).map(|k| self.column(k)[0])
    }

    fn view(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.values, self.n, self.n)
    }

    fn view_mut(&mut self) -> MatMut<'_, f64> {
        MatMut::from_column_major_slice_mut(&mut self.values, self.n, self.n)
    }
}

/// A matrix without a Cholesky factor: its first `pivot` rows and columns have one, the first
/// `pivot` + 1 have not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NotPositiveDefinite {
    pub(crate) pivot: usize,
}

/// A symmetric positive definite matrix A, stored as its Cholesky factor L, A = L Lᵀ.
#[derive(Debug, Clone)]
pub(crate) struct Spd {
    factor: LowerTriangle,
}

impl Spd {
    /// Factorises a matrix, given by its lower triangle.
    pub(crate) fn factor(mut matrix: LowerTriangle) -> Result<Self, NotPositiveDefinite> {
        let (n, par) = (matrix.n, threads(matrix.n));
        let mut memory =
            MemBuffer::new(cholesky_in_place_scratch::<f64>(n, par, Default::default()));
        let factorised = cholesky_in_place(
            matrix.view_mut(),
            Default::default(),
            par,
            MemStack::new(&mut memory),
            Default::default(),
        );
        if let Err(LltError::NonPositivePivot { index: pivot }) = factorised {
            return Err(NotPositiveDefinite { pivot });
        }
        // A NaN passes faer's comparison of a pivot with zero.
        let is_sound = |pivot: f64| pivot > 0.0 && pivot.is_finite();
        let unsound = matrix.diagonal().position(|pivot| !is_sound(pivot));
        unsound.map_or(Ok(Self { factor: matrix }), |pivot| {
            Err(NotPositiveDefinite { pivot })
        })
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.factor.n
    }

    /// The diagonal of L.
    pub(crate) fn pivots(&self) -> impl Iterator<Item = f64> + '_ {
        self.factor.diagonal()
    }

    /// ln |A|.
    pub(crate) fn log_det(&self) -> f64 {
        2.0 * self.pivots().map(f64::ln).sum::<f64>()
    }

    /// b ← L⁻¹b for each column b of n numbers.
    pub(crate) fn half_solve(&self, columns: &mut [f64]) {
        let (b, par) = self.columns(columns);
        solve_lower_triangular_in_place(self.factor.view(), b, par);
    }

    /// b ← A⁻¹b for each column b of n numbers.
    pub(crate) fn solve(&self, columns: &mut [f64]) {
        self.half_solve(columns);
        let (b, par) = self.columns(columns);
        solve_upper_triangular_in_place(self.factor.view().transpose(), b, par);
    }

    /// The columns as a matrix, and one thread only, since callers predict many batches at once.
    fn columns<'a>(&self, columns: &'a mut [f64]) -> (MatMut<'a, f64>, Par) {
        let n = self.len();
        let count = columns.len() / n.max(1);
        let view = MatMut::from_column_major_slice_mut(columns, n, count);
        (view, Par::Seq)
    }

    /// The memory of L, for [`LowerTriangle::in_memory`].
    pub(crate) fn into_memory(self) -> Vec<f64> {
        self.factor.into_memory()
    }

    /// A⁻¹, in the memory of L. `memory` holds L⁻¹ in between.
    pub(crate) fn into_inverse(self, memory: &mut Vec<f64>) -> LowerTriangle {
        let half = self.half_inverse(std::mem::take(memory));
        let mut inverse = self.factor;
        let n = inverse.n;
        triangular::matmul(
            inverse.view_mut(),
            BlockStructure::TriangularLower,
            Accum::Replace,
            half.view().transpose(),
            BlockStructure::TriangularUpper,
            half.view(),
            BlockStructure::TriangularLower,
            1.0,
            threads(n),
        );
        *memory = half.into_memory();
        inverse
    }

    /// The diagonal of A⁻¹.
    pub(crate) fn inverse_diagonal(&self) -> Vec<f64> {
        let half = self.half_inverse(Vec::new());
        let square = |k: usize| dot(half.column(k), half.column(k));
        (0..self.len()).map(square).collect()
    }

    /// L⁻¹, in the memory `values`.
    pub(crate) fn half_inverse(&self, mut values: Vec<f64>) -> LowerTriangle {
        values.resize(self.factor.values.len(), 0.0);
        let mut half = LowerTriangle {
            n: self.len(),
            values,
        };
        invert_lower_triangular(half.view_mut(), self.factor.view(), threads(self.len()));
        half
    }

    /// The matrix with m more rows and columns. `cross` holds the m new columns in the old n rows,
    /// `corner` the new columns in the new rows. `None` if a new row depends on the others up to rounding.
    pub(crate) fn append_rows(&self, mut cross: Vec<f64>, corner: &LowerTriangle) -> Option<Self> {
        let (n, m) = (self.len(), corner.n);
        self.half_solve(&mut cross);
        let row = |k: usize| &cross[k * n..(k + 1) * n];
        let left = LowerTriangle::from_columns(m, |k, column| {
            for ((i, left), value) in (k..).zip(column).zip(corner.column(k)) {
                *left = value - dot(row(k), row(i));
            }
        });
        let last = Self::factor(left).ok()?;
        let rounding = (n + m) as f64 * f64::EPSILON;
        let mut both = last.pivots().zip(corner.diagonal());
        if both.any(|(pivot, whole)| pivot * pivot <= rounding * whole) {
            return None;
        }
        let factor = LowerTriangle::from_columns(n + m, |k, column| {
            if k < n {
                let (old, new) = column.split_at_mut(n - k);
                old.copy_from_slice(self.factor.column(k));
                new.iter_mut().enumerate().for_each(|(i, v)| *v = row(i)[k]);
            } else {
                column.copy_from_slice(last.factor.column(k - n));
            }
        });
        Some(Self { factor })
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use super::*;

    /// A covariance of n points on a line, and the points.
    fn matrix(n: usize) -> LowerTriangle {
        let mut rng = stream(3, Purpose::Test, n as u64, 0);
        let at: Vec<f64> = (0..n).map(|_| rng.random::<f64>()).collect();
        LowerTriangle::from_columns(n, |k, column| {
            for (i, value) in (k..).zip(column) {
                let h = 30.0 * (at[i] - at[k]);
                *value = (-h * h).exp() + if i == k { 0.1 } else { 0.0 };
            }
        })
    }

    fn times(matrix: &LowerTriangle, x: &[f64]) -> Vec<f64> {
        let element = |i: usize, j: usize| matrix.column(i.min(j))[i.abs_diff(j)];
        let row = |i: usize| (0..x.len()).map(|j| element(i, j) * x[j]).sum();
        (0..x.len()).map(row).collect()
    }

    #[test]
    fn solutions_and_inverses_are_those_of_the_matrix() {
        for n in [1, 2, 7, 40, 131] {
            let matrix = matrix(n);
            let spd = Spd::factor(matrix.clone()).unwrap();
            let x: Vec<f64> = (0..2 * n).map(|i| (i as f64).sin()).collect();
            let mut b = times(&matrix, &x[..n]);
            b.extend(times(&matrix, &x[n..]));
            spd.solve(&mut b);
            assert!(b.iter().zip(&x).all(|(b, x)| (b - x).abs() < 1e-11), "{n}");
            let inverse = spd.clone().into_inverse(&mut Vec::new());
            let back = times(&inverse, &times(&matrix, &x[..n]));
            assert!(back.iter().zip(&x).all(|(b, x)| (b - x).abs() < 1e-11));
            let diagonal = spd.inverse_diagonal();
            let pairs = diagonal.iter().zip(inverse.diagonal());
            assert!(pairs.into_iter().all(|(a, b)| (a / b - 1.0).abs() < 1e-12));
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_named_by_its_pivot() {
        let with = |value: f64| {
            let mut matrix = matrix(60);
            matrix.values[17 * 60 + 17] = value;
            Spd::factor(matrix).unwrap_err().pivot
        };
        assert_eq!(with(0.0), 17);
        assert_eq!(with(-3.0), 17);
        assert!(with(f64::NAN) >= 17);
        assert!(with(f64::INFINITY) >= 17);
    }

    #[test]
    fn appended_rows_give_the_factor_of_the_longer_matrix() {
        let (n, m) = (50, 9);
        let longer = matrix(n + m);
        let part = |from: usize, to: usize| {
            LowerTriangle::from_columns(to - from, |k, column| {
                column.copy_from_slice(&longer.column(from + k)[..to - from - k]);
            })
        };
        let cross = (n..n + m).flat_map(|i| (0..n).map(move |k| (i, k)));
        let cross = cross.map(|(i, k)| longer.column(k)[i - k]).collect();
        let short = Spd::factor(part(0, n)).unwrap();
        let long = short.append_rows(cross, &part(n, n + m)).unwrap();
        let direct = Spd::factor(longer).unwrap();
        for (a, b) in long.pivots().zip(direct.pivots()) {
            assert!((a - b).abs() < 1e-12);
        }
        let once_more: Vec<f64> = (0..n).map(|i| short_row(&short, i)).collect();
        let corner = LowerTriangle::from_columns(1, |_, column| column[0] = 1.1);
        assert!(short.append_rows(once_more, &corner).is_none());
    }

    /// Element i of the first column of the matrix, its row and column once more.
    fn short_row(spd: &Spd, i: usize) -> f64 {
        spd.factor.column(0)[0] * spd.factor.column(0)[i]
    }

    #[test]
    fn threads_change_no_bit() {
        let n = SHARED + 75;
        let matrix = matrix(n);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let spd = Spd::factor(matrix.clone()).unwrap();
                (
                    spd.log_det(),
                    spd.into_inverse(&mut Vec::new()).column(n / 2).to_vec(),
                )
            })
        };
        let one = with(1);
        assert_eq!(with(2), one);
        assert_eq!(with(4), one);
    }
}
