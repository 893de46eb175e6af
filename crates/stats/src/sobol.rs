//! The scrambled Sobol sequence of the crate sobol_burley: its limits and its coordinates.

/// Length of the sequence: sobol_burley's direction numbers have 16 bits.
pub const SOBOL_POINTS: usize = 1 << 16;
/// Number of dimensions of the sequence.
pub const SOBOL_DIMENSIONS: usize = sobol_burley::NUM_DIMENSIONS as usize;
/// Spacing of the sequence's single-precision coordinates.
pub const SOBOL_SPACING: f64 = 1.0 / (1 << 24) as f64;

/// A coordinate of point `index` < [`SOBOL_POINTS`] in `dimension` < [`SOBOL_DIMENSIONS`], in the open unit interval.
/// Half a spacing keeps it away from 0.
#[must_use]
pub fn sobol_coordinate(index: u32, dimension: u32, scramble: u32) -> f64 {
    f64::from(sobol_burley::sample(index, dimension, scramble)) + 0.5 * SOBOL_SPACING
}
