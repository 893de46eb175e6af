//! The inverse of a matrix in single precision, for twice the speed.

use super::inverse::{Upper, invert_transposed, square};
use super::{Column, Lower, ROWS, panels, unit};

/// Rows of a panel in single precision: as many bytes as in double precision.
pub(super) const SINGLE_ROWS: usize = 2 * ROWS;

/// Smaller elements are zeros: far below what rounding leaves of a sum, and their products would be
/// subnormal, which slows some processors down.
const NEGLIGIBLE: f64 = 1e-19;

/// C⁻¹ in single precision, and what it is made of; its memory serves again.
#[derive(Debug, Clone, Default)]
pub(crate) struct SingleInverse {
    /// The factor, then the inverse.
    lower: Lower<f32, SINGLE_ROWS>,
    /// L⁻ᵀ.
    half: Upper<f32, SINGLE_ROWS>,
}

impl SingleInverse {
    /// Computes C⁻¹ from the factor of C.
    pub(crate) fn invert(&mut self, factor: &Lower) {
        round(factor, &mut self.lower);
        invert_transposed(&self.lower, &mut self.half);
        square(&self.half, &mut self.lower);
    }

    /// Writes panel p of C⁻¹, one of [`ROWS`] rows, to `to`.
    pub(crate) fn panel(&self, p: usize, to: &mut [Column]) {
        for (from, to) in self.lower.panel(p / 2).iter().zip(to) {
            to.0 = from.0.as_chunks::<ROWS>().0[p % 2].map(f64::from);
        }
    }
}

/// Writes `factor`, rounded, to `to`.
pub(super) fn round(factor: &Lower, to: &mut Lower<f32, SINGLE_ROWS>) {
    let n = factor.len();
    to.resize(n);
    // Panels of double precision are halves here. The last half may lie beyond them: it is the unit matrix's.
    for p in 0..2 * n.div_ceil(SINGLE_ROWS) {
        for (j, to) in to.panel_mut(p / 2).iter_mut().enumerate() {
            let half = if p < panels(n) {
                let column = factor.panel(p).get(j);
                column.map_or([0.0; ROWS], |column| column.0.map(rounded))
            } else {
                unit(p, j).0
            };
            to.0.as_chunks_mut::<ROWS>().0[p % 2] = half;
        }
    }
}

fn rounded(x: f64) -> f32 {
    if x.abs() < NEGLIGIBLE { 0.0 } else { x as f32 }
}
