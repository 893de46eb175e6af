//! The Cholesky factor.
//!
//! Block by block of columns: from the columns of a block the products of what is left of it are
//! subtracted, then those within the block, and the triangle on the diagonal is divided out.

use pulp::{Arch, Simd, WithSimd};

use super::products::{Corner, Update, divide, divide_tile, product, product_of_tile};
use super::{BLOCK, Column, DEPTH, Lower, ROWS, TILE, panels, start};

/// A pivot at or below zero, or so small that rounding made it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NotPositiveDefinite;

/// Replaces a matrix by its Cholesky factor.
pub(crate) fn factorise(matrix: &mut Lower) -> Result<(), NotPositiveDefinite> {
    let n = matrix.n;
    let diagonal: Vec<f64> = matrix.diagonal().collect();
    Arch::new().dispatch(Factorise(matrix))?;
    // The factor of a matrix that is singular but for rounding says nothing about the data. The
    // rounding error of a pivot is relative to its own diagonal element (Higham, "Accuracy and
    // Stability of Numerical Algorithms" (2002), section 10.1).
    let rounding = n as f64 * f64::EPSILON;
    let sound = |(l, c): (f64, &f64)| l * l > rounding * c;
    if matrix.diagonal().zip(&diagonal).all(sound) {
        Ok(())
    } else {
        Err(NotPositiveDefinite)
    }
}

pub(super) struct Factorise<'a>(pub(super) &'a mut Lower);

impl WithSimd for Factorise<'_> {
    type Output = Result<(), NotPositiveDefinite>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let count = panels(self.0.n);
        let columns = &mut self.0.columns;
        for block in (0..count).step_by(BLOCK) {
            let left = block * ROWS;
            let end = (block + BLOCK).min(count);
            for first in (0..left).step_by(DEPTH) {
                let last = (first + DEPTH).min(left);
                for p in block..count {
                    for of in block..end.min(p + 1) {
                        let (before, to) = split(columns, start::<ROWS>(p) + of * ROWS);
                        let a = &before[start::<ROWS>(p) + first..start::<ROWS>(p) + last];
                        let b = &before[start::<ROWS>(of) + first..start::<ROWS>(of) + last];
                        product(simd, a, b, Update::Subtract, to);
                    }
                }
            }
            for p in block..count {
                for of in block..end.min(p + 1) {
                    let own = of * ROWS;
                    let (before, to) = split(columns, start::<ROWS>(p) + own);
                    let a = &before[start::<ROWS>(p) + left..start::<ROWS>(p) + own];
                    let b = &before[start::<ROWS>(of) + left..start::<ROWS>(of) + own];
                    product(simd, a, b, Update::Subtract, to);
                    if of < p {
                        let corner =
                            &before[start::<ROWS>(of) + own..start::<ROWS>(of) + own + ROWS];
                        divide(simd, to, corner);
                    } else {
                        factorise_own(simd, to)?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// What lies before column `at`, and the columns of a panel there.
#[inline(always)]
fn split(columns: &mut [Column], at: usize) -> (&[Column], &mut [Column; ROWS]) {
    let (before, after) = columns.split_at_mut(at);
    (before, &mut after.as_chunks_mut::<ROWS>().0[0])
}

/// Replaces the square on the diagonal by its factor.
#[inline(always)]
fn factorise_own<S: Simd>(simd: S, square: &mut [Column; ROWS]) -> Result<(), NotPositiveDefinite> {
    for q in 0..ROWS / TILE {
        let (before, after) = square.split_at_mut(q * TILE);
        let tile = &mut after.as_chunks_mut::<TILE>().0[0];
        product_of_tile(simd, before, before, q, Update::Subtract, tile);
        let corner = factorise_corner(tile, q)?;
        divide_tile(simd, tile, &corner);
        finish_corner(tile, q, &corner);
    }
    Ok(())
}

/// The Cholesky factor of the `q`-th eight rows of a tile.
fn factorise_corner(tile: &[Column; TILE], q: usize) -> Result<Corner, NotPositiveDefinite> {
    let mut corner = Corner::new(tile, q);
    let columns = &mut corner.columns;
    for j in 0..TILE {
        let (before, after) = columns.split_at_mut(j);
        let own = &mut after[0];
        for column in before {
            for i in j..TILE {
                own[i] = (-column[i]).mul_add(column[j], own[i]);
            }
        }
        // Also where it is NaN.
        if own[j] > 0.0 {
            own[j] = own[j].sqrt();
        } else {
            return Err(NotPositiveDefinite);
        }
        corner.reciprocals[j] = 1.0 / own[j];
        for i in j + 1..TILE {
            own[i] /= own[j];
        }
        own[..j].fill(0.0);
    }
    Ok(corner)
}

/// Writes the corner's factor, and zeros above it.
fn finish_corner(tile: &mut [Column; TILE], q: usize, corner: &Corner) {
    for (column, own) in tile.iter_mut().zip(&corner.columns) {
        let (parts, _) = column.0.as_chunks_mut::<TILE>();
        parts[..q].as_flattened_mut().fill(0.0);
        parts[q] = *own;
    }
}
