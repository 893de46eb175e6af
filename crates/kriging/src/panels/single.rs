//! The inverse of a matrix in single precision, for twice the speed.

use super::inverse::{Upper, invert_transposed, square};
use super::{Column, Lower, ROWS, panels};

/// Rows of a panel in single precision: as many bytes as in double precision.
pub(super) const TWICE: usize = 2 * ROWS;

/// Smaller elements are zeros: far below what rounding leaves of a sum, and their products would be
/// subnormal, which slows some processors down.
const NEGLIGIBLE: f64 = 1e-19;

/// C⁻¹ in single precision, and what it is made of; its memory serves again.
#[derive(Debug, Clone, Default)]
pub(crate) struct SingleInverse {
    /// The factor, then the inverse.
    lower: Lower<f32, TWICE>,
    /// L⁻ᵀ.
    half: Upper<f32, TWICE>,
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
        let upper = p.is_multiple_of(2);
        for (from, to) in self.lower.panel(p / 2).iter().zip(to) {
            let halves = from.0.as_chunks::<ROWS>().0;
            to.0 = halves[usize::from(!upper)].map(f64::from);
        }
    }
}

/// Writes `factor`, rounded, to `to`.
pub(super) fn round(factor: &Lower, to: &mut Lower<f32, TWICE>) {
    let n = factor.len();
    to.resize(n);
    for p in 0..n.div_ceil(TWICE) {
        for half in 0..2 {
            let columns = to.panel_mut(p);
            let q = 2 * p + half;
            let from = if q < panels(n) { factor.panel(q) } else { &[] };
            for (j, to) in columns.iter_mut().enumerate() {
                let to = &mut to.0.as_chunks_mut::<ROWS>().0[half];
                match from.get(j) {
                    Some(from) => *to = from.0.map(rounded),
                    // Beyond the diagonal, or the last panel is half empty: there rows of the unit matrix.
                    None => {
                        *to = [0.0; ROWS];
                        if from.is_empty() && j >= q * ROWS {
                            to[j - q * ROWS] = 1.0;
                        }
                    }
                }
            }
        }
    }
}

fn rounded(x: f64) -> f32 {
    if x.abs() < NEGLIGIBLE { 0.0 } else { x as f32 }
}
