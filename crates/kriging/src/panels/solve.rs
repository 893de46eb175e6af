//! Solutions with a Cholesky factor L.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::products::{Update, add_multiple, divide, dot, product};
use super::real::Real;
use super::{BLOCK, Column, DEPTH, Lower, ROWS, panels, rows};

/// So many vectors or fewer are solved for one by one.
const FEW: usize = 4;

/// Replaces each of the n-vectors in `vectors` by C⁻¹ times it, C = LLᵀ.
pub(crate) fn solve(factor: &Lower, vectors: &mut [f64]) {
    Arch::new().dispatch(OneByOne {
        factor,
        vectors,
        steps: &[Step::Forward, Step::Backward],
    });
}

/// Replaces each of the n-vectors in `vectors` by L⁻ᵀ times it.
pub(crate) fn transposed_half_solve(factor: &Lower, vectors: &mut [f64]) {
    Arch::new().dispatch(OneByOne {
        factor,
        vectors,
        steps: &[Step::Backward],
    });
}

/// Replaces each of the n-vectors in `vectors` by L⁻¹ times it. Whether there are a few or many changes
/// the last bits, what the others are does not.
pub(crate) fn half_solve(factor: &Lower, vectors: &mut [f64]) {
    let n = factor.n;
    if vectors.len() <= FEW * n {
        Arch::new().dispatch(OneByOne {
            factor,
            vectors,
            steps: &[Step::Forward],
        });
        return;
    }
    // The vectors as the rows of panels.
    let width = panels(n) * ROWS;
    let count = vectors.len() / n;
    let mut columns = vec![Column::ZERO; panels(count) * width];
    for (i, vector) in vectors.chunks_exact(n).enumerate() {
        let panel = &mut columns[i / ROWS * width..];
        for (column, value) in panel.iter_mut().zip(vector) {
            column.0[i % ROWS] = *value;
        }
    }
    let mut runs: Vec<Run<'_>> = columns
        .chunks_exact_mut(width)
        .map(|columns| Run { first: 0, columns })
        .collect();
    divide_rows(factor, &mut runs);
    for (i, vector) in vectors.chunks_exact_mut(n).enumerate() {
        let panel = &columns[i / ROWS * width..];
        for (column, value) in panel.iter().zip(vector) {
            *value = column.0[i % ROWS];
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Step {
    /// L⁻¹ times a vector.
    Forward,
    /// L⁻ᵀ times it.
    Backward,
}

pub(super) struct OneByOne<'a> {
    pub(super) factor: &'a Lower,
    pub(super) vectors: &'a mut [f64],
    pub(super) steps: &'a [Step],
}

impl WithSimd for OneByOne<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let n = self.factor.n;
        // A panel at a time, which then is in the cache for all vectors.
        for step in self.steps {
            for i in 0..panels(n) {
                let p = match step {
                    Step::Forward => i,
                    Step::Backward => panels(n) - 1 - i,
                };
                let panel = self.factor.panel(p);
                for vector in self.vectors.chunks_exact_mut(n) {
                    match step {
                        Step::Forward => forward(simd, panel, rows(p, n), vector),
                        Step::Backward => backward(simd, panel, rows(p, n), vector),
                    }
                }
            }
        }
    }
}

/// The rows of a panel of L⁻¹ times a vector, given those before.
#[inline(always)]
fn forward<S: Simd>(simd: S, panel: &[Column], rows: Range<usize>, vector: &mut [f64]) {
    let (left, own) = panel.split_at(rows.start);
    let (before, after) = vector.split_at_mut(rows.start);
    let after = &mut after[..rows.len()];
    let mut sum = Column::ZERO;
    sum.0[..rows.len()].copy_from_slice(after);
    for (column, x) in left.iter().zip(before) {
        add_multiple(simd, column, -*x, &mut sum);
    }
    after.copy_from_slice(&sum.0[..rows.len()]);
    for (k, column) in own[..rows.len()].iter().enumerate() {
        let x = after[k] / column.0[k];
        after[k] = x;
        for (other, l) in after[k + 1..].iter_mut().zip(&column.0[k + 1..]) {
            *other = l.mul_add(-x, *other);
        }
    }
}

/// The rows of a panel of L⁻ᵀ times a vector, given those after, and from the rows before what these
/// take off.
#[inline(always)]
fn backward<S: Simd>(simd: S, panel: &[Column], rows: Range<usize>, vector: &mut [f64]) {
    let (left, own) = panel.split_at(rows.start);
    let (before, after) = vector.split_at_mut(rows.start);
    let mut x = Column::ZERO;
    for k in (0..rows.len()).rev() {
        let column = &own[k].0;
        let pairs = column[k + 1..].iter().zip(&x.0[k + 1..]);
        let rest = pairs.fold(after[k], |rest, (l, x)| (-l).mul_add(*x, rest));
        x.0[k] = rest / column[k];
    }
    after[..rows.len()].copy_from_slice(&x.0[..rows.len()]);
    for (column, y) in left.iter().zip(before) {
        *y -= dot(simd, column, &x);
    }
}

/// A panel of a matrix from a column on, before which it is zero.
pub(super) struct Run<'a, T = f64, const R: usize = ROWS> {
    /// The first column, a multiple of R.
    pub(super) first: usize,
    pub(super) columns: &'a mut [Column<T, R>],
}

impl<T, const R: usize> Run<'_, T, R> {
    /// The columns before panel `of`'s own, and these.
    #[inline(always)]
    fn split(&mut self, of: usize) -> (&[Column<T, R>], &mut [Column<T, R>; R]) {
        let (before, after) = self.columns.split_at_mut(of * R - self.first);
        (before, &mut after.as_chunks_mut::<R>().0[0])
    }
}

/// Replaces the matrix X that consists of `runs` by X L⁻ᵀ.
pub(super) fn divide_rows<T: Real, const R: usize>(
    factor: &Lower<T, R>,
    runs: &mut [Run<'_, T, R>],
) {
    Arch::new().dispatch(DivideRows { factor, runs });
}

pub(super) struct DivideRows<'a, 'b, T, const R: usize> {
    pub(super) factor: &'a Lower<T, R>,
    pub(super) runs: &'a mut [Run<'b, T, R>],
}

impl<T: Real, const R: usize> WithSimd for DivideRows<'_, '_, T, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { factor, runs } = self;
        let count = factor.n.div_ceil(R);
        for block in (0..count).step_by(BLOCK) {
            let left = block * R;
            let end = (block + BLOCK).min(count);
            // Off the block what lies left of it, then what lies in it.
            for start in (0..left).step_by(DEPTH) {
                let last = (start + DEPTH).min(left);
                for run in runs.iter_mut().filter(|run| run.first < last) {
                    let start = start.max(run.first);
                    for of in block..end {
                        let l = &factor.panel(of)[start..last];
                        let first = run.first;
                        let (before, to) = run.split(of);
                        let x = &before[start - first..last - first];
                        product(simd, x, l, Update::Subtract, to);
                    }
                }
            }
            for run in runs.iter_mut().filter(|run| run.first < end * R) {
                let start = left.max(run.first);
                for of in start / R..end {
                    let (l, own) = factor.panel(of).split_at(of * R);
                    let first = run.first;
                    let (before, to) = run.split(of);
                    let x = &before[start - first..];
                    product(simd, x, &l[start..], Update::Subtract, to);
                    divide(simd, to, own);
                }
            }
        }
    }
}
