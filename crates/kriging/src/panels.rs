//! Symmetric and triangular matrices in panels of rows, as their products want them.
//!
//! A panel is [`ROWS`] rows of a matrix, stored column by column. The Cholesky factor, its inverse and
//! the inverse of the matrix then are sums of one kind, A Bᵀ of two runs of a panel's columns, and both
//! runs lie in memory as the processor reads them: nothing is packed or transposed. A library packs both
//! factors of every product of rectangles, and has many with thin ones along a triangle's edge; for n of
//! a few thousand faer takes longer for factor and inverse alone than a whole likelihood with its gradient
//! takes here (`--example timings` has both).
//!
//! Rows and columns beyond n, up to whole panels, are those of the unit matrix.
//!
//! Every element is a sum over its terms in one order, with fused multiplications and additions,
//! whatever the processor's vectors: the bits of a factor are the same on every machine.
//!
//! Numbers are of double precision, and for [`SingleInverse`] of single precision ([`Real`]), in panels of
//! twice as many rows.

mod factor;
mod inverse;
mod products;
mod real;
mod single;
mod solve;

use std::ops::Range;

pub(crate) use factor::factorise;
pub(crate) use inverse::{Narrow, Upper, invert_transposed, square};
pub(crate) use products::{add_multiple, dot};
use real::Real;
pub(crate) use single::SingleInverse;
pub(crate) use solve::{half_solve, solve, transposed_half_solve};

/// Rows of a panel: three of the widest vectors.
pub(crate) const ROWS: usize = 24;
/// Columns that are divided by a triangle together, in registers. A panel's own columns are a multiple.
const TILE: usize = 8;
/// Panels whose rows are the right factors of one panel's products before the next one's turn.
const BLOCK: usize = 8;
/// The most terms of a sum that are added in one go, a multiple of any panel's rows. With that many columns
/// (18 kB) a panel stays in the first-level cache, and the panels of a block in the second-level one;
/// with fewer, sums go through memory more often.
const DEPTH: usize = 96;

/// A column of a panel of R rows.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(crate) struct Column<T = f64, const R: usize = ROWS>(pub(crate) [T; R]);

impl<T: Real, const R: usize> Column<T, R> {
    const ZERO: Self = Self([T::ZERO; R]);
}

/// Number of panels of n rows.
pub(crate) fn panels(n: usize) -> usize {
    n.div_ceil(ROWS)
}

/// The lower triangle of a matrix, in panels of R rows. Panel p has the columns up to its last row.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lower<T = f64, const R: usize = ROWS> {
    n: usize,
    columns: Vec<Column<T, R>>,
}

impl<T: Real, const R: usize> Lower<T, R> {
    /// Makes it an n × n matrix of any numbers.
    pub(crate) fn resize(&mut self, n: usize) {
        self.n = n;
        self.columns.resize(start::<R>(n.div_ceil(R)), Column::ZERO);
    }

    /// The columns of panel p, R (p + 1) of them. Above the diagonal of the matrix the last ones may hold
    /// anything, but zeros in a factor.
    pub(crate) fn panel(&self, p: usize) -> &[Column<T, R>] {
        &self.columns[start::<R>(p)..start::<R>(p + 1)]
    }

    pub(crate) fn panel_mut(&mut self, p: usize) -> &mut [Column<T, R>] {
        &mut self.columns[start::<R>(p)..start::<R>(p + 1)]
    }
}

impl Lower {
    pub(crate) fn len(&self) -> usize {
        self.n
    }

    /// Element i, j with j ≤ i.
    pub(crate) fn get(&self, i: usize, j: usize) -> f64 {
        self.panel(i / ROWS)[j].0[i % ROWS]
    }

    pub(crate) fn get_mut(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.panel_mut(i / ROWS)[j].0[i % ROWS]
    }

    pub(crate) fn diagonal(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.n).map(|i| self.get(i, i))
    }

    /// The n × n matrix of elements i, j with j ≤ i.
    pub(crate) fn from_fn(n: usize, element: impl Fn(usize, usize) -> f64) -> Self {
        let mut matrix = Self::default();
        matrix.resize(n);
        matrix.pad();
        for i in 0..n {
            for j in 0..=i {
                *matrix.get_mut(i, j) = element(i, j);
            }
        }
        matrix
    }

    /// Makes the columns and rows beyond n those of the unit matrix.
    pub(crate) fn pad(&mut self) {
        let n = self.n;
        let Some(last) = panels(n).checked_sub(1) else {
            return;
        };
        let beyond = rows(last, n).len();
        for (j, column) in self.panel_mut(last).iter_mut().enumerate() {
            if j < n {
                column.0[beyond..].fill(0.0);
            } else {
                *column = unit(last, j);
            }
        }
    }
}

/// The first column of panel p among all of a [`Lower`].
fn start<const R: usize>(p: usize) -> usize {
    R * p * (p + 1) / 2
}

/// The rows of panel p that are the matrix's.
pub(crate) fn rows(p: usize, n: usize) -> Range<usize> {
    p * ROWS..((p + 1) * ROWS).min(n)
}

/// Column j of the unit matrix's panel p.
fn unit<T: Real, const R: usize>(p: usize, j: usize) -> Column<T, R> {
    let mut column = Column::ZERO;
    if j >= p * R {
        column.0[j - p * R] = T::ONE;
    }
    column
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, Scalar, Simd, WithSimd};
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use super::factor::Factorise;
    use super::inverse::{Square, unit_rows};
    use super::single::{SINGLE_ROWS, round};
    use super::solve::{DivideRows, OneByOne, Step};
    use super::*;

    /// Sizes around those of panels, blocks and runs of terms.
    const SIZES: [usize; 12] = [1, 7, 8, 23, 24, 25, 49, 191, 192, 193, 384, 500];

    /// A covariance with a condition of about 100.
    fn element(i: usize, j: usize) -> f64 {
        (-0.2 * i.abs_diff(j) as f64).exp() + if i == j { 0.1 } else { 0.0 }
    }

    fn factor(n: usize) -> Lower {
        let mut matrix = Lower::from_fn(n, element);
        factorise(&mut matrix).unwrap();
        matrix
    }

    fn vectors(n: usize, count: usize) -> Vec<f64> {
        let mut rng = stream(11, Purpose::Test, n as u64, count as u64);
        (0..n * count).map(|_| rng.random::<f64>() - 0.5).collect()
    }

    #[test]
    fn the_factor_squared_is_the_matrix() {
        for n in SIZES {
            let factor = factor(n);
            for i in 0..n {
                for j in 0..=i {
                    let sum: f64 = (0..=j).map(|k| factor.get(i, k) * factor.get(j, k)).sum();
                    assert!((sum - element(i, j)).abs() < 2e-15, "{n} {i} {j}: {sum}");
                }
                // Products of panels rely on the zeros.
                for j in i + 1..panels(i + 1) * ROWS {
                    assert_eq!(factor.panel(i / ROWS)[j].0[i % ROWS], 0.0);
                }
            }
        }
    }

    #[test]
    fn the_inverse_times_the_matrix_is_the_unit_matrix() {
        let (mut upper, mut inverse) = (Upper::default(), Lower::default());
        // What the last size left must not matter.
        for n in SIZES {
            invert_transposed(&factor(n), &mut upper);
            square(&upper, &mut inverse);
            for i in 0..n {
                for j in 0..n {
                    let of = |k: usize| inverse.get(k.max(j), k.min(j));
                    let sum: f64 = (0..n).map(|k| element(i, k) * of(k)).sum();
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((sum - expected).abs() < 1e-14, "{n} {i} {j}: {sum}");
                }
            }
            for (i, sum) in upper.squares().into_iter().enumerate() {
                assert!((sum / inverse.get(i, i) - 1.0).abs() < 1e-14);
            }
        }
    }

    /// Also where the condition is 1e9 and more, and of whatever size the matrix before was.
    #[test]
    fn the_inverse_in_single_precision() {
        let smooth = |i: usize, j: usize| {
            let distance = i.abs_diff(j) as f64 / 100.0;
            (-distance * distance).exp() + if i == j { 1e-7 } else { 0.0 }
        };
        let mut single = SingleInverse::default();
        for n in SIZES.into_iter().chain(SIZES.into_iter().rev()) {
            check_single(factor(n), &mut single, 3e-6);
            let mut factor = Lower::from_fn(n, smooth);
            factorise(&mut factor).unwrap();
            check_single(factor, &mut single, 1e-3);
        }
    }

    /// Compares the inverses in both precisions. The largest error is relative to the diagonal.
    fn check_single(factor: Lower, single: &mut SingleInverse, largest: f64) {
        let n = factor.len();
        let (mut upper, mut inverse) = (Upper::default(), Lower::default());
        single.invert(&factor);
        invert_transposed(&factor, &mut upper);
        square(&upper, &mut inverse);
        for p in 0..panels(n) {
            let mut panel = vec![Column([f64::NAN; ROWS]); (p + 1) * ROWS];
            single.panel(p, &mut panel);
            for i in rows(p, n) {
                for (j, column) in panel[..=i].iter().enumerate() {
                    let scale = (inverse.get(i, i) * inverse.get(j, j)).sqrt();
                    let error = (column.0[i % ROWS] - inverse.get(i, j)).abs() / scale;
                    assert!(error < largest, "{n} {i} {j}: {error}");
                }
            }
        }
    }

    #[test]
    fn solutions_solve() {
        for n in SIZES {
            let factor = factor(n);
            let times = |x: &[f64], i: usize| -> f64 { (0..n).map(|k| element(i, k) * x[k]).sum() };
            for count in [1, 3, 5, 30] {
                let right = vectors(n, count);
                let mut whole = right.clone();
                solve(&factor, &mut whole);
                let mut by_halves = right.clone();
                half_solve(&factor, &mut by_halves);
                transposed_half_solve(&factor, &mut by_halves);
                for ((x, y), right) in whole
                    .chunks(n)
                    .zip(by_halves.chunks(n))
                    .zip(right.chunks(n))
                {
                    for (i, right) in right.iter().enumerate() {
                        assert!((times(x, i) - right).abs() < 1e-14, "{n} {count} {i}");
                        assert!((times(y, i) - right).abs() < 1e-14, "{n} {count} {i}");
                    }
                }
            }
        }
    }

    /// A vector's half solution is the same whatever the others are.
    #[test]
    fn vectors_do_not_mix() {
        let n = 200;
        let factor = factor(n);
        let mut first = vectors(n, 10);
        let mut second = first.clone();
        second.truncate(7 * n);
        second[..n].fill(1e300);
        half_solve(&factor, &mut first);
        half_solve(&factor, &mut second);
        assert_eq!(first[n..7 * n], second[n..]);
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        for n in SIZES {
            for k in [0, n / 2, n - 1] {
                for value in [0.0, -1.0, f64::NAN] {
                    let mut matrix = Lower::from_fn(n, element);
                    *matrix.get_mut(k, k) = value;
                    assert!(factorise(&mut matrix).is_err(), "{n} {k} {value}");
                }
            }
        }
        // Two equal rows: the pivot is rounding.
        let mut twice = Lower::from_fn(100, |i, j| element(i.min(98), j.min(98)));
        assert!(factorise(&mut twice).is_err());
    }

    /// Vectors of any width and none at all give the same bits.
    #[test]
    fn vectors_of_the_processor_change_no_bit() {
        #[inline(always)]
        fn inverse<S: Simd, T: Real, const R: usize>(
            simd: S,
            factor: &Lower<T, R>,
        ) -> Vec<Column<T, R>> {
            let mut upper = Upper::default();
            let mut runs = unit_rows(factor.n, &mut upper);
            let divide = DivideRows {
                factor,
                runs: &mut runs,
            };
            divide.with_simd(simd);
            let mut inverse = Lower::default();
            inverse.resize(factor.n);
            let square = Square {
                v: &upper,
                to: &mut inverse,
            };
            square.with_simd(simd);
            inverse.columns
        }

        struct All(usize);
        impl WithSimd for All {
            type Output = (Vec<Column>, Vec<Column<f32, SINGLE_ROWS>>, Vec<f64>);

            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
                let n = self.0;
                let mut factor = Lower::from_fn(n, element);
                Factorise(&mut factor).with_simd(simd).unwrap();
                let mut single = Lower::default();
                round(&factor, &mut single);
                let inverses = (inverse(simd, &factor), inverse(simd, &single));
                let mut solved = vectors(n, 2);
                let solve = OneByOne {
                    factor: &factor,
                    vectors: &mut solved,
                    steps: &[Step::Forward, Step::Backward],
                };
                solve.with_simd(simd);
                (inverses.0, inverses.1, solved)
            }
        }
        // With more than one block in single precision, too.
        let n = 410;
        let without = All(n).with_simd(Scalar::new());
        let check = |with| assert!(with == without);
        check(Arch::new().dispatch(All(n)));
        // What a processor with wider ones does not use.
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            check(Simd::vectorize(simd, All(n)));
        }
    }

    #[test]
    fn a_narrow_matrix_squared() {
        let (n, width) = (100, 5);
        let s = vectors(n, width);
        let narrow = Narrow::new(&s, n);
        for p in 0..panels(n) {
            let mut panel = vec![Column([f64::NAN; ROWS]); (p + 1) * ROWS];
            narrow.square_panel(p, &mut panel);
            for i in rows(p, n) {
                for (j, column) in panel[..=i].iter().enumerate() {
                    let sum: f64 = (0..width).map(|k| s[k * n + i] * s[k * n + j]).sum();
                    assert!((column.0[i % ROWS] - sum).abs() < 1e-15);
                }
            }
        }
    }
}
