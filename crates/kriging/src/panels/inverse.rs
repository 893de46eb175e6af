//! The inverse of a matrix from its factor L: with V = L⁻ᵀ it is V Vᵀ.
//!
//! V is I L⁻ᵀ: the unit matrix's rows are treated as those of the matrix below the factor would be.
//! For each row of V, a column of L⁻¹, that is forward substitution, whose residual is small (Higham,
//! "Accuracy and Stability of Numerical Algorithms" (2002), section 14.2).

use pulp::{Arch, Simd, WithSimd};

use super::products::{Update, product};
use super::real::Real;
use super::solve::{Run, divide_rows};
use super::{BLOCK, Column, DEPTH, Lower, ROWS, panels, rows, start, unit};

/// An upper triangle, in panels of R rows. Panel p has the columns from its first row on.
#[derive(Debug, Clone, Default)]
pub(crate) struct Upper<T = f64, const R: usize = ROWS> {
    n: usize,
    columns: Vec<Column<T, R>>,
}

impl<T: Real, const R: usize> Upper<T, R> {
    /// The columns of panel p.
    fn panel(&self, p: usize) -> &[Column<T, R>] {
        let count = self.n.div_ceil(R);
        &self.columns[start_upper::<R>(p, count)..start_upper::<R>(p + 1, count)]
    }
}

impl Upper {
    /// Every row's sum of squares: the diagonal of V Vᵀ.
    pub(crate) fn squares(&self) -> Vec<f64> {
        let mut squares = vec![0.0; self.n];
        for (p, of_panel) in squares.chunks_mut(ROWS).enumerate() {
            for column in self.panel(p) {
                for (sum, value) in of_panel.iter_mut().zip(column.0) {
                    *sum += value * value;
                }
            }
        }
        squares
    }
}

/// The first column of panel p of `count` among all of an [`Upper`].
fn start_upper<const R: usize>(p: usize, count: usize) -> usize {
    start::<R>(count) - start::<R>(count - p)
}

/// Writes L⁻ᵀ to `inverse`.
pub(crate) fn invert_transposed<T: Real, const R: usize>(
    factor: &Lower<T, R>,
    inverse: &mut Upper<T, R>,
) {
    divide_rows(factor, &mut unit_rows(factor.n, inverse));
}

/// Makes `inverse` the n × n unit matrix; its rows.
pub(super) fn unit_rows<T: Real, const R: usize>(
    n: usize,
    inverse: &mut Upper<T, R>,
) -> Vec<Run<'_, T, R>> {
    let count = n.div_ceil(R);
    inverse.n = n;
    inverse.columns.clear();
    inverse.columns.resize(start::<R>(count), Column::ZERO);
    let mut rest = &mut inverse.columns[..];
    let mut runs = Vec::with_capacity(count);
    for p in 0..count {
        let (columns, after) = rest.split_at_mut((count - p) * R);
        for (j, column) in columns[..R].iter_mut().enumerate() {
            *column = unit(p, p * R + j);
        }
        let first = p * R;
        runs.push(Run { first, columns });
        rest = after;
    }
    runs
}

/// Writes V Vᵀ to `to`.
pub(crate) fn square<T: Real, const R: usize>(v: &Upper<T, R>, to: &mut Lower<T, R>) {
    to.resize(v.n);
    Arch::new().dispatch(Square { v, to });
}

pub(super) struct Square<'a, T, const R: usize> {
    pub(super) v: &'a Upper<T, R>,
    pub(super) to: &'a mut Lower<T, R>,
}

impl<T: Real, const R: usize> WithSimd for Square<'_, T, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        const { assert!(DEPTH.is_multiple_of(R), "a run of columns is whole panels") };
        let Self { v, to } = self;
        let n = v.n.next_multiple_of(R);
        for first in (0..n).step_by(DEPTH) {
            let last = (first + DEPTH).min(n);
            for block in (0..last.div_ceil(R)).step_by(BLOCK) {
                for p in block..last / R {
                    let own = p * R;
                    let from = first.max(own);
                    // The first terms of a sum are those on the diagonal.
                    let update = if own >= first {
                        Update::Replace
                    } else {
                        Update::Add
                    };
                    let a = &v.panel(p)[from - own..last - own];
                    let (squares, _) = to.panel_mut(p).as_chunks_mut::<R>();
                    let end = (block + BLOCK).min(p + 1);
                    for (of, to) in (block..end).zip(&mut squares[block..end]) {
                        let b = &v.panel(of)[from - of * R..last - of * R];
                        product(simd, a, b, update, to);
                    }
                }
            }
        }
    }
}

/// A matrix S of n rows and few columns, for S Sᵀ.
#[derive(Debug, Clone)]
pub(crate) struct Narrow {
    width: usize,
    /// Panel after panel.
    columns: Vec<Column>,
}

impl Narrow {
    /// From the n-vectors that are S's columns.
    pub(crate) fn new(vectors: &[f64], n: usize) -> Self {
        let width = vectors.len() / n;
        let mut columns = Vec::with_capacity(panels(n) * width);
        for p in 0..panels(n) {
            for vector in vectors.chunks_exact(n) {
                let mut column = Column::ZERO;
                column.0[..rows(p, n).len()].copy_from_slice(&vector[rows(p, n)]);
                columns.push(column);
            }
        }
        Self { width, columns }
    }

    /// Writes panel p of the lower triangle of S Sᵀ to `to`.
    pub(crate) fn square_panel(&self, p: usize, to: &mut [Column]) {
        Arch::new().dispatch(SquarePanel { s: self, p, to });
    }
}

struct SquarePanel<'a> {
    s: &'a Narrow,
    p: usize,
    to: &'a mut [Column],
}

impl WithSimd for SquarePanel<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let panels: Vec<&[Column]> = self.s.columns.chunks_exact(self.s.width).collect();
        let (squares, _) = self.to.as_chunks_mut::<ROWS>();
        for (b, to) in panels[..=self.p].iter().zip(squares) {
            product(simd, panels[self.p], b, Update::Replace, to);
        }
    }
}
