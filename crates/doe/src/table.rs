//! The levels of a design in the layout the optimiser scans.

/// Points per block of a scan; columns are padded by as many, so that blocks may overrun.
const BLOCK: usize = 16;
/// Relative slack of the single-precision filter. A sum of 20 squares of exact differences errs by
/// less than 22 · 2⁻²⁴ ≈ 1.3e-6; what passes is checked in integers.
const SLACK: f32 = 1.0 + 1e-5;

/// A point near another one in all variables but one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Neighbour {
    /// The other point.
    pub(crate) point: usize,
    /// What is left of the squared radius for the missing variable: r² − Σ (differences)² > 0.
    pub(crate) left: i64,
    /// The other point's level in the missing variable.
    pub(crate) level: i64,
}

impl Neighbour {
    /// What is left of the squared radius when the point in the middle is at `level`.
    pub(crate) fn left_at(&self, level: i64) -> i64 {
        let difference = self.level - level;
        self.left - difference * difference
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
    stride: usize,
    levels: Vec<f32>,
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

    /// Replaces `found` by the points nearer to `i` than √`squared_radius` in all variables but
    /// `k` (all variables, when `k` is none), in ascending order. Returns how many points it
    /// looked at.
    pub(crate) fn near(
        &self,
        i: usize,
        k: Option<usize>,
        squared_radius: i64,
        found: &mut Vec<Neighbour>,
    ) -> usize {
        found.clear();
        // The root may round down, and a point at exactly the radius is not near.
        let reach = (squared_radius as f64).sqrt() as usize + 1;
        let (first, last) = (i.saturating_sub(reach), (i + reach + 1).min(self.n));
        let limit = squared_radius as f32 * SLACK;
        let skip = k.unwrap_or(self.d);
        let mut start = first;
        while start < last {
            let mut sums = [0.0_f32; BLOCK];
            for c in (0..self.d).filter(|&c| c != skip) {
                let column = &self.levels[c * self.stride..];
                let here = column[i];
                for (sum, level) in sums.iter_mut().zip(&column[start..start + BLOCK]) {
                    let difference = level - here;
                    *sum += difference * difference;
                }
            }
            // `f32::min` takes care of NaN, which this does not need, and would not vectorise.
            if sums
                .iter()
                .fold(f32::INFINITY, |a, &b| if b < a { b } else { a })
                < limit
            {
                for (point, _) in (start..).zip(sums).filter(|(_, sum)| *sum < limit) {
                    if point == i {
                        continue;
                    }
                    let left = squared_radius - self.squared_distance(i, point, skip);
                    if left > 0 {
                        let level = k.map_or(0, |k| self.level(point, k));
                        found.push(Neighbour { point, left, level });
                    }
                }
            }
            start += BLOCK;
        }
        last - first
    }

    fn squared_distance(&self, i: usize, j: usize, skip: usize) -> i64 {
        (0..self.d)
            .filter(|&k| k != skip)
            .map(|k| {
                let difference = self.level(i, k) - self.level(j, k);
                difference * difference
            })
            .sum()
    }
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
            let mut found = Vec::new();
            for i in [0, 1, n / 2, n - 1] {
                for k in [None, Some(1), Some(d - 1)] {
                    table.near(i, k, squared_radius, &mut found);
                    let left = |j| squared_radius - table.squared_distance(i, j, k.unwrap_or(d));
                    let expected: Vec<(usize, i64)> = (0..n)
                        .filter(|&j| j != i && left(j) > 0)
                        .map(|j| (j, left(j)))
                        .collect();
                    let got: Vec<(usize, i64)> = found.iter().map(|f| (f.point, f.left)).collect();
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
