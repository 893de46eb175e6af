//! The levels of a design in the layout the optimiser scans.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

/// Points per block of a scan; columns are padded by as many, so that blocks may overrun.
const BLOCK: usize = 64;
/// Relative slack of the single-precision filter. A sum of 20 squares of exact differences errs by
/// less than 22 · 2⁻²⁴ ≈ 1.3e-6; points that pass are checked in integers.
const SLACK: f32 = 1.0 + 1e-5;

/// The points that are nearer to a given point than the radius if one variable is left out.
#[derive(Debug, Clone, Default)]
pub(crate) struct Neighbours {
    /// Indices of the points.
    pub(crate) points: Vec<usize>,
    /// Part of the squared radius that remains for the left-out variable: r² − Σ (differences)² > 0.
    pub(crate) left: Vec<i64>,
    /// Levels of the points in the left-out variable.
    pub(crate) levels: Vec<i64>,
}

impl Neighbours {
    fn clear(&mut self) {
        self.points.clear();
        self.left.clear();
        self.levels.clear();
    }
}

/// A Latin hypercube by columns, points numbered by their level in variable 0.
///
/// Numbering by variable 0 makes a scan's candidates contiguous, and swaps in the other variables
/// suffice to reach every Latin hypercube. Levels are below 2²⁴, so `f32` holds them exactly.
#[derive(Debug, Clone)]
pub(crate) struct Table {
    n: usize,
    d: usize,
    /// Length of a column in `levels`, with its padding.
    stride: usize,
    /// Level of each point, column by column.
    levels: Vec<f32>,
    /// Point of each level, column by column.
    owners: Vec<u32>,
}

impl Table {
    /// A table of the given columns for the variables 1, …, d − 1.
    pub(crate) fn new(n: usize, columns: &[Vec<u32>]) -> Self {
        let d = columns.len() + 1;
        let stride = n + BLOCK;
        let mut levels = vec![f32::INFINITY; stride * d];
        let mut owners = vec![0; n * d];
        for i in 0..n {
            levels[i] = i as f32;
            owners[i] = i as u32;
        }
        for (k, column) in (1..).zip(columns) {
            for (i, &level) in column.iter().enumerate() {
                levels[k * stride + i] = level as f32;
                owners[k * n + level as usize] = i as u32;
            }
        }
        Self {
            n,
            d,
            stride,
            levels,
            owners,
        }
    }

    pub(crate) fn points(&self) -> usize {
        self.n
    }

    pub(crate) fn variables(&self) -> usize {
        self.d
    }

    pub(crate) fn level(&self, i: usize, k: usize) -> i64 {
        self.levels[k * self.stride + i] as i64
    }

    /// The point with the given level in variable `k`.
    pub(crate) fn owner(&self, k: usize, level: i64) -> usize {
        self.owners[k * self.n + level as usize] as usize
    }

    /// Exchanges the levels of two points in variable `k`.
    pub(crate) fn swap(&mut self, i: usize, j: usize, k: usize) {
        self.levels.swap(k * self.stride + i, k * self.stride + j);
        for point in [i, j] {
            let level = self.level(point, k) as usize;
            self.owners[k * self.n + level] = point as u32;
        }
    }

    /// Replaces `found` by the points nearer to `i` than √`squared_radius` in all variables but `k`
    /// (in all variables if `k` is `None`), in ascending order. Returns the number of points scanned.
    pub(crate) fn near(
        &self,
        i: usize,
        k: Option<usize>,
        squared_radius: i64,
        found: &mut Neighbours,
    ) -> usize {
        found.clear();
        // The root may round down, and a point at exactly the radius is not near.
        let reach = (squared_radius as f64).sqrt() as usize + 1;
        let (first, last) = (i.saturating_sub(reach), (i + reach + 1).min(self.n));
        Arch::new().dispatch(Scan {
            table: self,
            i,
            k,
            squared_radius,
            run: first..last,
            found,
        });
        last - first
    }

    /// The squared distance in all variables but `skip`. Differences are below 2¹⁷, so the sum of 20
    /// squares is exact in an `f64`.
    #[inline(always)]
    fn squared_distance(&self, i: usize, j: usize, skip: usize) -> i64 {
        let columns = self.levels.chunks_exact(self.stride).enumerate();
        let squares = columns.filter(|(k, _)| *k != skip).map(|(_, column)| {
            let difference = f64::from(column[i]) - f64::from(column[j]);
            difference * difference
        });
        squares.sum::<f64>() as i64
    }
}

/// [`Table::near`] for one instruction set, which changes the speed, never the result: single
/// precision only discards far points, and the others are measured in integers.
struct Scan<'s> {
    table: &'s Table,
    i: usize,
    k: Option<usize>,
    squared_radius: i64,
    run: Range<usize>,
    found: &'s mut Neighbours,
}

impl WithSimd for Scan<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            table,
            i,
            k,
            squared_radius,
            run,
            found,
        } = self;
        // Whole numbers below 2²⁴ are exact in single precision, and so are sums that stay below.
        let exact = squared_radius < 1 << 24;
        let limit = squared_radius as f32 * if exact { 1.0 } else { SLACK };
        let skip = k.unwrap_or(table.d);
        let (before, behind) = table.levels.split_at(skip * table.stride);
        let behind = behind.get(table.stride..).unwrap_or(&[]);
        for start in run.step_by(BLOCK) {
            let sums = add_squares([0.0; BLOCK], before, table.stride, i, start);
            let sums = add_squares(sums, behind, table.stride, i, start);
            // Eight points at a time are skipped, because most are far.
            let mut near = [0_u8; BLOCK];
            for (near, sum) in near.iter_mut().zip(&sums) {
                *near = u8::from(*sum < limit);
            }
            let (eights, _) = near.as_chunks::<8>();
            for (eight, bytes) in eights.iter().enumerate() {
                let mut left = u64::from_le_bytes(*bytes);
                while left != 0 {
                    let lane = 8 * eight + left.trailing_zeros() as usize / 8;
                    left &= left - 1;
                    let point = start + lane;
                    let squared = if exact {
                        sums[lane] as i64
                    } else {
                        table.squared_distance(i, point, skip)
                    };
                    if point != i && squared < squared_radius {
                        found.points.push(point);
                        found.left.push(squared_radius - squared);
                        found.levels.push(k.map_or(0, |k| table.level(point, k)));
                    }
                }
            }
        }
    }
}

/// Adds to `sums` the squared differences from point `i` of the block at `start`, in each column of
/// `levels`.
#[inline(always)]
fn add_squares(
    mut sums: [f32; BLOCK],
    levels: &[f32],
    stride: usize,
    i: usize,
    start: usize,
) -> [f32; BLOCK] {
    for column in levels.chunks_exact(stride) {
        let here = column[i];
        for (sum, level) in sums.iter_mut().zip(&column[start..start + BLOCK]) {
            let difference = level - here;
            *sum += difference * difference;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::random_columns;
    use stats::streams::{Purpose, stream};

    /// The blocked single-precision scan against a plain loop over integers, at levels so large
    /// that single precision rounds the squares.
    #[test]
    fn scans_find_what_a_plain_loop_finds() {
        for (n, d, share) in [(2, 2, 2.0), (50, 3, 0.3), (333, 6, 0.6), (20_000, 4, 0.06)] {
            let mut rng = stream(5, Purpose::Test, n as u64, d as u64);
            let table = Table::new(n, &random_columns(n, d - 1, &mut rng));
            let squared_radius = (share * n as f64).powi(2) as i64;
            let mut found = Neighbours::default();
            for i in [0, 1, n / 2, n - 1] {
                for k in [None, Some(1), Some(d - 1)] {
                    table.near(i, k, squared_radius, &mut found);
                    let left = |j| squared_radius - table.squared_distance(i, j, k.unwrap_or(d));
                    let expected: Vec<(usize, i64)> = (0..n)
                        .filter(|&j| j != i && left(j) > 0)
                        .map(|j| (j, left(j)))
                        .collect();
                    let pairs = found.points.iter().zip(&found.left);
                    let got: Vec<(usize, i64)> = pairs.map(|(p, l)| (*p, *l)).collect();
                    assert_eq!(
                        got, expected,
                        "{n} points, {d} variables, around {i} without {k:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn swaps_move_the_owners_along() {
        let mut table = Table::new(3, &[vec![2, 0, 1]]);
        table.swap(0, 2, 1);
        let levels: Vec<i64> = (0..3).map(|i| table.level(i, 1)).collect();
        assert_eq!(levels, [1, 0, 2]);
        assert_eq!([0, 1, 2].map(|level| table.owner(1, level)), [1, 0, 2]);
    }
}
