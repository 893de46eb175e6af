//! Growth of designs: new points among existing ones.
//!
//! The points of a Latin hypercube of n lie 1/n apart in every variable, so each of N > n strata
//! holds at most one of them. The other N − n strata are free, and the new points take their
//! centres. A design that has grown before is no longer a grid of cell centres, and some of its points may
//! share a stratum; more strata are then free than there are new points, and each new point still
//! gets one of its own.
//!
//! A search decides which new point takes which stratum, so that all points are far apart. It is a simpler form of
//! the search of [`crate::maximin`]: at a distance r, each pair of points nearer than r has the potential energy
//! (1 − δ²/r²)². In one variable, two new points swap coordinates, or one new point swaps with an unused stratum, if
//! that does not raise the energy. When no energy is left, r is raised.

use rand::RngExt as _;
use stats::streams::{Purpose, StreamRng, stream};

use crate::design::{cell_centre, check};
use crate::{Design, Error, Options};

/// Swaps tried per variable and new point; the budget adds 100 to the number of new points.
const SWAPS: f64 = 300.0;
/// The largest budget of a search, in coordinates read.
const LARGEST_BUDGET: f64 = 4e9;
/// The first rise of the squared distance, as a fraction of it.
const FIRST_RISE: f64 = 0.5;
/// The smallest rise, at which the search ends.
const LAST_RISE: f64 = 1e-3;
/// Swaps tried per new point before a distance counts as out of reach.
const PATIENCE: usize = 60;
/// Energy that may be rounding: the pair's squared distance is within 3·10⁻⁵ of the squared radius.
const NEGLIGIBLE: f64 = 1e-9;

/// A design of `n` points that begins with those of `existing`, unchanged; the new points are kept
/// away from the old ones and from each other. Each new point has a stratum to itself among the n of
/// every variable. If the existing points have one each too, as in a Latin hypercube, every stratum
/// holds exactly one point; otherwise existing points may share a stratum and leave others empty.
/// The same input gives the same design.
///
/// The smallest distance is at most that of the old points, and below that of a new
/// [`crate::maximin`] design of n points. Growth in several steps gives another design than growth
/// at once.
///
/// # Errors
///
/// The errors of [`check_enlarge`], and [`Error::Effort`] for an effort that is negative or not
/// finite.
pub fn enlarge(existing: &Design, n: usize, options: &Options) -> Result<Design, Error> {
    check_enlarge(existing, n)?;
    let d = existing.d;
    let effort = options.effort;
    if !(effort >= 0.0 && effort.is_finite()) {
        return Err(Error::Effort { effort });
    }
    // Each size has a stream of its own, so that repeated growth does not reuse random numbers.
    let mut rng = stream(options.seed, Purpose::Doe, n as u64, 2);
    let mut design = Design {
        n,
        d,
        points: existing.points.clone(),
    };
    design.points.resize(n * d, 0.0);
    let new = n - existing.n;
    let mut spare = Vec::with_capacity(d);
    for k in 0..d {
        let taken = existing.strata(k, n);
        let mut free: Vec<u32> = (0..n as u32).filter(|&l| !taken[l as usize]).collect();
        for i in (1..free.len()).rev() {
            free.swap(i, rng.random_range(0..=i as u32) as usize);
        }
        for (i, &level) in (existing.n..n).zip(&free) {
            design.points[i * d + k] = cell_centre(level, n);
        }
        let left_over = free.iter().skip(new);
        spare.push(left_over.map(|&level| cell_centre(level, n)).collect());
    }
    let has_choice = new > 1 || spare.iter().any(|spare: &Vec<f64>| !spare.is_empty());
    if has_choice && d > 1 {
        Ok(Growth::new(design, existing.n, spare, rng).spread(effort))
    } else {
        Ok(design)
    }
}

/// Checks whether [`enlarge`] can make `n` points of `existing`, without the search, so that a
/// caller can refuse before it changes anything.
///
/// # Errors
///
/// [`Error::Points`] or [`Error::Variables`] for a size out of range, [`Error::Shrinking`] unless `n`
/// exceeds the number of existing points, [`Error::Coordinates`] for a design whose coordinates do
/// not fit its size, [`Error::Outside`] for a point that is not in the unit box.
pub fn check_enlarge(existing: &Design, n: usize) -> Result<(), Error> {
    let d = existing.d;
    check(n, d)?;
    if n <= existing.n {
        return Err(Error::Shrinking {
            n,
            existing: existing.n,
        });
    }
    if existing.points.len() != existing.n * d {
        return Err(Error::Coordinates {
            n: existing.n,
            d,
            got: existing.points.len(),
        });
    }
    let outside = |x: &f64| !(0.0..=1.0).contains(x);
    match existing.points.iter().position(outside) {
        Some(index) => Err(Error::Outside {
            point: index / d,
            variable: index % d,
            value: existing.points[index].to_string(),
        }),
        None => Ok(()),
    }
}

/// The state of the search: the enlarged design and the energies of its new points.
struct Growth {
    design: Design,
    /// Number of existing points, which come first and do not move.
    fixed: usize,
    /// Centres of free strata that no point takes, by variable.
    spare: Vec<Vec<f64>>,
    /// The largest number of spare centres in one variable.
    most_spare: usize,
    rng: StreamRng,
    squared_radius: f64,
    /// Energy of each new point: the sum over its pairs with all others.
    energy: Vec<f64>,
}

impl Growth {
    fn new(design: Design, fixed: usize, spare: Vec<Vec<f64>>, rng: StreamRng) -> Self {
        Self {
            energy: vec![0.0; design.n - fixed],
            design,
            fixed,
            most_spare: spare.iter().map(Vec::len).max().unwrap_or(0),
            spare,
            rng,
            squared_radius: 0.0,
        }
    }

    /// Swaps coordinates until the budget is spent or the smallest rise of the radius fails. Returns the design of
    /// the largest radius reached.
    fn spread(mut self, effort: f64) -> Design {
        let (n, d, new) = (self.design.n, self.design.d, self.energy.len());
        let swaps = SWAPS * d as f64 * (new as f64 + 100.0);
        let largest = LARGEST_BUDGET / (n * d) as f64;
        let mut left = (effort * swaps.min(largest)) as usize;
        let mut best = self.design.clone();
        let mut floor = self.smallest_squared_distance();
        let mut rise = FIRST_RISE;
        while left > 0 && rise > LAST_RISE {
            self.set_squared_radius(floor * (1.0 + rise));
            let mut patience = (PATIENCE * new).min(left);
            left -= patience;
            while patience > 0 {
                let Some(first) = self.point_with_energy() else {
                    break;
                };
                self.repair(first);
                patience -= 1;
            }
            left += patience;
            if self.point_with_energy().is_none() {
                best.clone_from(&self.design);
                // Pairs of old points may be nearer than the radius, which no swap can change.
                floor = self.squared_radius;
            } else {
                rise *= 0.5;
            }
        }
        best
    }

    /// The smallest squared distance of a new point from any other.
    fn smallest_squared_distance(&self) -> f64 {
        (self.fixed..self.design.n)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| self.squared_distance(i, j))
            .fold(f64::INFINITY, f64::min)
    }

    fn squared_distance(&self, i: usize, j: usize) -> f64 {
        let pairs = self.design.point(i).iter().zip(self.design.point(j));
        pairs.map(|(a, b)| (a - b) * (a - b)).sum()
    }

    fn set_squared_radius(&mut self, squared_radius: f64) {
        self.squared_radius = squared_radius;
        for i in self.fixed..self.design.n {
            self.energy[i - self.fixed] = self.energy_of(i);
        }
    }

    /// The energy of point `i`: the sum over all others.
    fn energy_of(&self, i: usize) -> f64 {
        (0..self.design.n)
            .filter(|&j| j != i)
            .map(|j| self.pair_energy(self.squared_distance(i, j)))
            .sum()
    }

    fn pair_energy(&self, squared: f64) -> f64 {
        let left = 1.0 - squared / self.squared_radius;
        if left > 0.0 { left * left } else { 0.0 }
    }

    /// Returns the first new point with energy, counted from a random index.
    fn point_with_energy(&mut self) -> Option<usize> {
        let new = self.energy.len();
        let start = self.rng.random_range(0..new as u32) as usize;
        (start..new)
            .chain(0..start)
            .find(|&i| self.energy[i] > NEGLIGIBLE)
            .map(|i| i + self.fixed)
    }

    /// Swaps a coordinate of `first` with one of another new point, or with a spare one, if the
    /// energy does not grow.
    fn repair(&mut self, first: usize) {
        let (n, d) = (self.design.n, self.design.d);
        // Indices beyond the points stand for spare coordinates.
        let places = self.fixed as u32..(n + self.most_spare) as u32;
        let second = self.rng.random_range(places) as usize;
        if second == first {
            return;
        }
        let k = self.rng.random_range(0..d as u32) as usize;
        let a = first * d + k;
        let from = self.design.points[a];
        let is_point = second < n;
        let to = if is_point {
            self.design.points[second * d + k]
        } else if let Some(to) = self.spare[k].get(second - n) {
            *to
        } else {
            return;
        };
        let moves = [(first, from, to), (second, to, from)];
        let moves = if is_point { &moves[..] } else { &moves[..1] };
        let mut change = 0.0;
        let mut changes: Vec<(usize, f64)> = Vec::new();
        // The distance between the two points does not change.
        for j in (0..n).filter(|&j| j != first && j != second) {
            let x = self.design.points[j * d + k];
            let mut of_other = 0.0;
            for &(point, old, new) in moves {
                let before = self.squared_distance(point, j);
                let after = before - (x - old).powi(2) + (x - new).powi(2);
                if before < self.squared_radius || after < self.squared_radius {
                    of_other += self.pair_energy(after) - self.pair_energy(before);
                }
            }
            change += of_other;
            if of_other != 0.0 {
                changes.push((j, of_other));
            }
        }
        if change <= 0.0 {
            self.design.points[a] = to;
            if is_point {
                self.design.points[second * d + k] = from;
            } else {
                self.spare[k][second - n] = from;
            }
            for (j, difference) in changes {
                if j >= self.fixed {
                    self.energy[j - self.fixed] += difference;
                }
            }
            // Computed from scratch, so that rounding does not accumulate.
            for &(point, ..) in moves {
                self.energy[point - self.fixed] = self.energy_of(point);
            }
        }
    }
}
