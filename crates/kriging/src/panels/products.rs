//! The sums of products of which everything here is made.

use pulp::Simd;

use super::real::Real;
use super::{Column, TILE};

// Without these features of pulp a processor with such vectors would compute with none, thirty times as
// slowly.
#[cfg(target_arch = "x86_64")]
const _: () = {
    _ = (pulp::Arch::V3, pulp::Arch::V4);
};

/// What a sum of products does to the numbers in its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Update {
    Subtract,
    Add,
    Replace,
}

/// Updates `to` by Σₖ aₖ bₖᵀ, aₖ the columns of `a` and bₖ those of `b`.
#[inline(always)]
pub(super) fn product<S: Simd, T: Real, const R: usize>(
    simd: S,
    a: &[Column<T, R>],
    b: &[Column<T, R>],
    update: Update,
    to: &mut [Column<T, R>; R],
) {
    // As many sums as fit into the registers beside three vectors: with one more, compilers put some
    // of them into memory.
    match R / T::lanes::<S>() {
        3 => sums::<S, T, R, 3, 8>(simd, a, b, 0, update, to),
        6 => sums::<S, T, R, 3, 3>(simd, a, b, 0, update, to),
        12 => sums::<S, T, R, 6, 2>(simd, a, b, 0, update, to),
        _ => sums::<S, T, R, 4, 2>(simd, a, b, 0, update, to),
    }
}

/// Updates `tile` by Σₖ aₖ bₖᵀ, aₖ the columns of `a` and bₖ the `q`-th eight rows of those of `b`.
#[inline(always)]
pub(super) fn product_of_tile<S: Simd, T: Real, const R: usize>(
    simd: S,
    a: &[Column<T, R>],
    b: &[Column<T, R>],
    q: usize,
    update: Update,
    tile: &mut [Column<T, R>; TILE],
) {
    match R / T::lanes::<S>() {
        3 => sums::<S, T, R, 3, 8>(simd, a, b, q, update, tile),
        6 => sums::<S, T, R, 2, 4>(simd, a, b, 2 * q, update, tile),
        _ => sums::<S, T, R, 4, 2>(simd, a, b, 4 * q, update, tile),
    }
}

/// Updates the columns `to`, V vectors of W columns at a time, by products with as many rows of `b`, from
/// the `first` W rows on.
#[inline(always)]
fn sums<S: Simd, T: Real, const R: usize, const V: usize, const W: usize>(
    simd: S,
    a: &[Column<T, R>],
    b: &[Column<T, R>],
    first: usize,
    update: Update,
    to: &mut [Column<T, R>],
) {
    let (parts, _) = to.as_chunks_mut::<W>();
    for (w, part) in parts.iter_mut().enumerate() {
        for v in 0..R / (V * T::lanes::<S>()) {
            let mut sums = [[T::ZERO.splat(simd); V]; W];
            // What is subtracted from is there from the beginning: of a smooth function's covariance
            // the first terms leave little, and what is little is rounded little.
            if update != Update::Replace {
                for (sums, column) in sums.iter_mut().zip(&*part) {
                    *sums = T::vectors::<S>(&column.0).as_chunks::<V>().0[v];
                }
            }
            for (a, b) in a.iter().zip(b) {
                let a = &T::vectors::<S>(&a.0).as_chunks::<V>().0[v];
                let b = &b.0.as_chunks::<W>().0[first + w];
                for (sums, b) in sums.iter_mut().zip(b) {
                    let b = b.splat(simd);
                    for (sum, a) in sums.iter_mut().zip(a) {
                        *sum = match update {
                            Update::Subtract => T::negate_mul_add(simd, *a, b, *sum),
                            Update::Add | Update::Replace => T::mul_add(simd, *a, b, *sum),
                        };
                    }
                }
            }
            for (sums, column) in sums.iter().zip(&mut *part) {
                T::vectors_mut::<S>(&mut column.0).as_chunks_mut::<V>().0[v] = *sums;
            }
        }
    }
}

/// The part of a factor on its diagonal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner<T = f64> {
    /// Column by column.
    pub(super) columns: [[T; TILE]; TILE],
    pub(super) reciprocals: [T; TILE],
}

impl<T: Real> Corner<T> {
    /// The `q`-th of a panel's, whose columns are `columns`.
    #[inline(always)]
    pub(super) fn new<const R: usize>(columns: &[Column<T, R>], q: usize) -> Self {
        let mut corner = Self {
            columns: [[T::ZERO; TILE]; TILE],
            reciprocals: [T::ZERO; TILE],
        };
        for (i, (to, from)) in corner.columns.iter_mut().zip(columns).enumerate() {
            *to = from.0.as_chunks::<TILE>().0[q];
            corner.reciprocals[i] = T::ONE / to[i];
        }
        corner
    }
}

/// Replaces X by X L⁻ᵀ; the columns of L are `factor`, a panel's own.
#[inline(always)]
pub(super) fn divide<S: Simd, T: Real, const R: usize>(
    simd: S,
    x: &mut [Column<T, R>; R],
    factor: &[Column<T, R>],
) {
    for q in 0..R / TILE {
        let (before, after) = x.split_at_mut(q * TILE);
        let tile = &mut after.as_chunks_mut::<TILE>().0[0];
        product_of_tile(simd, before, factor, q, Update::Subtract, tile);
        divide_tile(simd, tile, &Corner::new(&factor[q * TILE..], q));
    }
}

/// Replaces X by X L⁻ᵀ, L a corner.
#[inline(always)]
pub(super) fn divide_tile<S: Simd, T: Real, const R: usize>(
    simd: S,
    tile: &mut [Column<T, R>; TILE],
    corner: &Corner<T>,
) {
    for v in 0..R / T::lanes::<S>() {
        let mut x = [T::ZERO.splat(simd); TILE];
        for (x, column) in x.iter_mut().zip(&*tile) {
            *x = T::vectors::<S>(&column.0)[v];
        }
        for i in 0..TILE {
            // A division by way of the reciprocal, which is faster. With the remainder it is as exact.
            let reciprocal = corner.reciprocals[i].splat(simd);
            let divisor = corner.columns[i][i].splat(simd);
            let quotient = T::mul(simd, x[i], reciprocal);
            let remainder = T::negate_mul_add(simd, quotient, divisor, x[i]);
            x[i] = T::mul_add(simd, remainder, reciprocal, quotient);
            for k in i + 1..TILE {
                x[k] = T::negate_mul_add(simd, x[i], corner.columns[i][k].splat(simd), x[k]);
            }
        }
        for (x, column) in x.iter().zip(&mut *tile) {
            T::vectors_mut::<S>(&mut column.0)[v] = *x;
        }
    }
}

/// Adds a multiple of a column to `sum`.
#[inline(always)]
pub(crate) fn add_multiple<S: Simd>(simd: S, column: &Column, x: f64, sum: &mut Column) {
    let x = simd.splat_f64s(x);
    let sums = S::as_mut_simd_f64s(&mut sum.0).0;
    for (sum, l) in sums.iter_mut().zip(S::as_simd_f64s(&column.0).0) {
        *sum = simd.mul_add_f64s(*l, x, *sum);
    }
}

/// The inner product of two columns.
#[inline(always)]
pub(crate) fn dot<S: Simd>(simd: S, a: &Column, b: &Column) -> f64 {
    let mut sums = [0.0; TILE];
    let (a, b) = (a.0.as_chunks::<TILE>().0, b.0.as_chunks::<TILE>().0);
    for (a, b) in a.iter().zip(b) {
        let vectors = S::as_mut_simd_f64s(&mut sums).0.iter_mut();
        let pairs = S::as_simd_f64s(a).0.iter().zip(S::as_simd_f64s(b).0);
        for (sum, (a, b)) in vectors.zip(pairs) {
            *sum = simd.mul_add_f64s(*a, *b, *sum);
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
