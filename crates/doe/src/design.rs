//! Designs, and how evenly they fill the unit box.

use rand::{Rng, RngExt as _};
use stats::streams::{Purpose, stream};

use crate::Error;

/// The largest number of points. An optimised design of more points would take minutes.
pub(crate) const MAX_POINTS: usize = 100_000;
/// The largest number of variables.
pub const MAX_VARIABLES: usize = 20;

/// n points in the open unit box (0, 1)ᵈ. Designs of [`crate::maximin`] and [`random_lhs`] are
/// Latin hypercubes of cell centres: each coordinate is (level + ½)/n, and each level 0, …, n − 1
/// is taken exactly once in each variable. A Latin hypercube that [`crate::enlarge`] extended has one
/// point per stratum; a design of [`crate::sobol`] may have several or none.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// The number of points.
    pub n: usize,
    /// The number of variables.
    pub d: usize,
    /// The points, row by row: coordinate k of point i is `points[i * d + k]`.
    pub points: Vec<f64>,
}

impl Design {
    /// The design with these levels, row by row: `d` for each of `n` points.
    pub(crate) fn from_levels(n: usize, d: usize, levels: impl Iterator<Item = u32>) -> Self {
        Self {
            n,
            d,
            points: levels.map(|level| cell_centre(level, n)).collect(),
        }
    }

    /// Point `i`: d coordinates in (0, 1).
    ///
    /// # Panics
    ///
    /// When `i` is not below `n`, like indexing a slice.
    #[must_use]
    pub fn point(&self, i: usize) -> &[f64] {
        &self.points[i * self.d..(i + 1) * self.d]
    }

    /// The smallest Euclidean distance between two points, in units of the box's edge. Costs far
    /// less than all n²/2 pairs unless the points crowd together in the first variable.
    #[must_use]
    pub fn min_distance(&self) -> f64 {
        let mut order: Vec<&[f64]> = self.points.chunks_exact(self.d).collect();
        order.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut smallest = f64::INFINITY;
        for (i, a) in order.iter().enumerate() {
            for b in &order[i + 1..] {
                let ahead = b[0] - a[0];
                if ahead * ahead >= smallest {
                    break;
                }
                let squared: f64 = a.iter().zip(*b).map(|(u, v)| (u - v) * (u - v)).sum();
                smallest = smallest.min(squared);
            }
        }
        smallest.sqrt()
    }

    /// The centred L₂ discrepancy CD₂ (the root of Hickernell's eq. (5.1b)): the difference between
    /// the share of points in a box and the volume of the box, averaged over all boxes that end at
    /// the nearest corner of the unit box. Lower is more even. Costs n²d/2 steps.
    ///
    /// F. J. Hickernell, *A generalized discrepancy and quadrature error bound*, Mathematics of
    /// Computation 67, 1998.
    #[must_use]
    pub fn centred_discrepancy(&self) -> f64 {
        let n = self.n as f64;
        let offsets: Vec<f64> = self.points.iter().map(|x| (x - 0.5).abs()).collect();
        let single: f64 = offsets
            .chunks_exact(self.d)
            .map(|z| {
                z.iter()
                    .map(|z| 1.0 + 0.5 * z - 0.5 * z * z)
                    .product::<f64>()
            })
            .sum();
        let mut double = 0.0;
        for i in 0..self.n {
            let (x, z) = (self.point(i), &offsets[i * self.d..]);
            for j in 0..=i {
                let (u, w) = (self.point(j), &offsets[j * self.d..]);
                let product: f64 = (0..self.d)
                    .map(|k| 1.0 + 0.5 * (z[k] + w[k] - (x[k] - u[k]).abs()))
                    .product();
                double += if i == j { product } else { 2.0 * product };
            }
        }
        let constant = (13.0_f64 / 12.0).powi(self.d as i32);
        // Rounding can take a perfect design, with one point per cell, just below zero.
        (constant - 2.0 / n * single + double / (n * n))
            .max(0.0)
            .sqrt()
    }

    /// Whether the design is a Latin hypercube to the last bit: in every variable, each of the n
    /// cell centres is the coordinate of exactly one point.
    #[must_use]
    pub fn is_latin(&self) -> bool {
        self.points.len() == self.n * self.d
            && (0..self.d).all(|k| {
                let mut column: Vec<f64> = self
                    .points
                    .iter()
                    .skip(k)
                    .step_by(self.d)
                    .copied()
                    .collect();
                column.sort_by(f64::total_cmp);
                let centres = (0..self.n as u32).map(|level| cell_centre(level, self.n));
                column.iter().copied().eq(centres)
            })
    }

    /// Whether each of the n strata [level/n, (level + 1)/n) of every variable holds exactly one
    /// point, wherever in the stratum it is.
    #[must_use]
    pub fn is_stratified(&self) -> bool {
        self.points.iter().all(|x| (0.0..1.0).contains(x))
            && (0..self.d).all(|k| self.strata(k, self.n).iter().all(|taken| *taken))
    }

    /// Whether each of `count` strata of variable `k` holds a point. The points are in the unit box;
    /// its far edge belongs to the last stratum.
    pub(crate) fn strata(&self, k: usize, count: usize) -> Vec<bool> {
        let mut taken = vec![false; count];
        for x in self.points.iter().skip(k).step_by(self.d) {
            // The product may round up to count.
            let level = ((x * count as f64) as usize).min(count - 1);
            taken[level] = true;
        }
        taken
    }
}

/// A Latin hypercube of `n` points in `d` variables drawn uniformly among all of them; the same for
/// the same `seed`.
///
/// # Errors
///
/// [`Error::Points`] or [`Error::Variables`] for a size out of range.
pub fn random_lhs(n: usize, d: usize, seed: u64) -> Result<Design, Error> {
    check(n, d)?;
    let mut rng = stream(seed, Purpose::Doe, 0, 0);
    let columns = random_columns(n, d, &mut rng);
    let rows = (0..n).flat_map(|i| columns.iter().map(move |column| column[i]));
    Ok(Design::from_levels(n, d, rows))
}

/// One uniformly drawn permutation of 0, …, n − 1 per variable.
pub(crate) fn random_columns<R: Rng>(n: usize, d: usize, rng: &mut R) -> Vec<Vec<u32>> {
    let column = |_| {
        let mut levels: Vec<u32> = (0..n as u32).collect();
        for i in (1..n).rev() {
            levels.swap(i, rng.random_range(0..=i as u32) as usize);
        }
        levels
    };
    (0..d).map(column).collect()
}

/// [`Error::Points`] or [`Error::Variables`] for a size out of range.
pub(crate) fn check(n: usize, d: usize) -> Result<(), Error> {
    if !(2..=MAX_POINTS).contains(&n) {
        return Err(Error::Points { n });
    }
    if !(1..=MAX_VARIABLES).contains(&d) {
        return Err(Error::Variables { d });
    }
    Ok(())
}

/// (level + ½)/n.
pub(crate) fn cell_centre(level: u32, n: usize) -> f64 {
    (f64::from(level) + 0.5) / n as f64
}
