//! The state of a search: a design, the energy of each of its points, and the swaps that reduce it.

use pulp::{Arch, Simd, WithSimd};
use rand::RngExt as _;
use stats::streams::StreamRng;

use crate::design::random_columns;
use crate::table::{Neighbours, Table};

/// Random levels examined for a point before the best of them is tried; at most a quarter of all
/// levels, since the best of all would always be the same one.
const SAMPLES: usize = 16;
/// Partners tried in one call of [`Search::repair`].
const PARTNERS: usize = 4;
/// Overhead of a scan and of the choice of a level, in points. It was measured, so that the budget
/// is proportional to time at every size.
const SCAN_OVERHEAD: u64 = 500;
/// Place of a point that is not in the list `active`.
const INACTIVE: u32 = u32::MAX;
/// Index that excludes no point from a sum of energies.
const NO_POINT: usize = usize::MAX;

/// The current design, and the best one so far.
///
/// **Invariant.** `energy[i]` is the sum over all j of the energy of the pair (i, j) at the current
/// radius; `active` lists the points where it is positive, and `place` says where in that list.
#[derive(Debug)]
pub(crate) struct Search {
    table: Table,
    rng: StreamRng,
    squared_radius: i64,
    /// Number of bits by which differences of squared distances are shifted right: they then fit 20 bits, and sums of
    /// their squares fit 64.
    shift: u32,
    energy: Vec<i64>,
    active: Vec<u32>,
    place: Vec<u32>,
    best: Table,
    best_squared: i64,
    spent: u64,
    /// Buffers for the neighbours of the two points of a swap.
    near_first: Neighbours,
    near_second: Neighbours,
}

impl Search {
    pub(crate) fn new(table: Table, rng: StreamRng) -> Self {
        let n = table.points();
        Self {
            best: table.clone(),
            table,
            rng,
            squared_radius: 0,
            shift: 0,
            energy: vec![0; n],
            active: Vec::new(),
            place: vec![INACTIVE; n],
            best_squared: 0,
            spent: 0,
            near_first: Neighbours::default(),
            near_second: Neighbours::default(),
        }
    }

    pub(crate) fn points(&self) -> usize {
        self.table.points()
    }

    /// The work so far, in coordinates read.
    pub(crate) fn spent(&self) -> u64 {
        self.spent
    }

    pub(crate) fn best(&self) -> &Table {
        &self.best
    }

    /// Whether the best design is known to be optimal: its smallest squared distance has reached
    /// the mean one, n(n + 1)d/6, which is the same for all Latin hypercubes.
    pub(crate) fn is_optimal(&self) -> bool {
        let (n, d) = (self.table.points() as i64, self.table.variables() as i64);
        6 * (self.best_squared + 1) > n * (n + 1) * d
    }

    /// Measures the smallest squared distance of the current design, and keeps the design if it is
    /// the best.
    pub(crate) fn measure(&mut self) -> i64 {
        let (n, d) = (self.table.points(), self.table.variables());
        let mut smallest = (n * n * d) as i64; // more than any pair has
        for i in 0..n {
            self.spent += cost(self.table.near(i, None, smallest, &mut self.near_first), d);
            smallest -= self.near_first.left.iter().copied().max().unwrap_or(0);
        }
        self.keep_if_best(smallest);
        smallest
    }

    /// Keeps the current design, which must have no energy, if it is the best.
    pub(crate) fn keep(&mut self) {
        self.keep_if_best(self.squared_radius);
    }

    /// Returns to the best design. The energies are out of date until the radius is set.
    pub(crate) fn restore(&mut self) {
        self.table.clone_from(&self.best);
    }

    /// Starts again from a random design; the best one is kept. The energies are out of date until
    /// the radius is set.
    pub(crate) fn randomise(&mut self) {
        let (n, d) = (self.table.points(), self.table.variables());
        self.table = Table::new(n, &random_columns(n, d - 1, &mut self.rng));
        self.spent += cost(n, d);
    }

    /// Sets the radius, in levels, below which pairs have energy.
    pub(crate) fn set_squared_radius(&mut self, squared_radius: i64) {
        self.squared_radius = squared_radius;
        self.shift = (squared_radius.max(1).ilog2() + 1).saturating_sub(20);
        self.active.clear();
        self.place.fill(INACTIVE);
        self.energy.fill(0);
        let mut near = std::mem::take(&mut self.near_first);
        for i in 0..self.table.points() {
            let seen = self.table.near(i, None, squared_radius, &mut near);
            self.spent += cost(seen, self.table.variables());
            self.add(
                i,
                near.left.iter().map(|left| self.pair_energy(*left)).sum(),
            );
        }
        self.near_first = near;
    }

    pub(crate) fn has_energy(&self) -> bool {
        !self.active.is_empty()
    }

    /// The slack for [`Search::repair`]: `heat` times the energy of two coinciding points, but
    /// never so small that a tiny design, with few distances to choose from, cannot move at all.
    pub(crate) fn slack(&self, heat: f64) -> f64 {
        let (least, full) = (self.pair_energy(1), self.pair_energy(self.squared_radius));
        (heat * full as f64).max(4.0 * least as f64)
    }

    /// Tries to lower the energy of a random point by a swap in a random variable. A swap may add
    /// energy up to a uniform threshold below `slack`.
    pub(crate) fn repair(&mut self, slack: i64) {
        Arch::new().dispatch(Repair {
            search: self,
            slack,
        });
    }

    #[inline(always)]
    fn try_swaps(&mut self, slack: i64) {
        let (n, d) = (self.table.points(), self.table.variables());
        let Some(last) = self.active.len().checked_sub(1) else {
            return;
        };
        let first = self.active[self.rng.random_range(0..=last as u32) as usize] as usize;
        let k = self.rng.random_range(1..d as u32) as usize;
        let mut near_first = std::mem::take(&mut self.near_first);
        let mut near_second = std::mem::take(&mut self.near_second);

        let seen = self
            .table
            .near(first, Some(k), self.squared_radius, &mut near_first);
        self.spent += cost(seen, d);
        let from = self.table.level(first, k);
        let shift = self.shift;
        let here = energy_at(&near_first, shift, from, NO_POINT);
        for _ in 0..PARTNERS {
            let Some((there, to)) = self.sample_level(&near_first, from, n) else {
                break;
            };
            if there > here + slack {
                break;
            }
            let second = self.table.owner(k, to);
            let seen = self
                .table
                .near(second, Some(k), self.squared_radius, &mut near_second);
            self.spent += cost(seen, d);
            // The distance between the two points does not change, so both sums leave it out.
            let before = energy_at(&near_first, shift, from, second)
                + energy_at(&near_second, shift, to, first);
            let after = energy_at(&near_first, shift, to, second)
                + energy_at(&near_second, shift, from, first);
            let allowed = if slack > 0 {
                self.rng.random_range(0..slack)
            } else {
                0
            };
            if after <= before + allowed {
                self.table.swap(first, second, k);
                self.move_energy(first, &near_first, from, to, second);
                self.move_energy(second, &near_second, to, from, first);
                break;
            }
        }
        self.near_first = near_first;
        self.near_second = near_second;
    }

    /// The least energy among a few random levels other than `from`, and its level. A level without
    /// energy ends the sampling.
    #[inline(always)]
    fn sample_level(&mut self, near: &Neighbours, from: i64, n: usize) -> Option<(i64, i64)> {
        let mut best: Option<(i64, i64)> = None;
        for _ in 0..SAMPLES.min(n.div_ceil(4)) {
            let level = i64::from(self.rng.random_range(0..n as u32));
            if level == from {
                continue;
            }
            let energy = energy_at(near, self.shift, level, NO_POINT);
            if best.is_none_or(|(least, _)| energy < least) {
                best = Some((energy, level));
            }
            if energy == 0 {
                break;
            }
        }
        best
    }

    /// Updates the energies for a move of `point` between two levels. Its distance to `except` is
    /// unchanged.
    #[inline(always)]
    fn move_energy(&mut self, point: usize, near: &Neighbours, from: i64, to: i64, except: usize) {
        let mut total = 0;
        for (i, &other) in near.points.iter().enumerate() {
            if other == except {
                continue;
            }
            let (left, level) = (near.left[i], near.levels[i]);
            let energy = |at: i64| pair_energy(left - square(level - at), self.shift);
            let change = energy(to) - energy(from);
            self.add(other, change);
            total += change;
        }
        self.add(point, total);
    }

    fn pair_energy(&self, left: i64) -> i64 {
        pair_energy(left, self.shift)
    }

    /// Adds `change` to the energy of a point and updates the list of active points.
    fn add(&mut self, point: usize, change: i64) {
        self.energy[point] += change;
        let place = self.place[point];
        if self.energy[point] > 0 && place == INACTIVE {
            self.place[point] = self.active.len() as u32;
            self.active.push(point as u32);
        } else if self.energy[point] == 0 && place != INACTIVE {
            self.active.swap_remove(place as usize);
            if let Some(&moved) = self.active.get(place as usize) {
                self.place[moved as usize] = place;
            }
            self.place[point] = INACTIVE;
        }
    }

    /// Keeps the current design if its smallest squared distance exceeds that of the best.
    fn keep_if_best(&mut self, squared: i64) {
        if squared > self.best_squared {
            self.best_squared = squared;
            self.best.clone_from(&self.table);
        }
    }
}

/// The energy of a pair whose squared distance is `left` below the squared radius: the square of `left`, scaled; zero
/// unless `left` is positive. The shift is unsigned because few vector units shift signed 64-bit integers.
#[inline(always)]
fn pair_energy(left: i64, shift: u32) -> i64 {
    let scaled = (left.cast_unsigned() >> shift)
        .wrapping_add(1)
        .cast_signed();
    if left > 0 { square(scaled) } else { 0 }
}

/// The square of a number that fits 32 bits. Vector units multiply those several times as fast as 64 bits.
#[inline(always)]
fn square(number: i64) -> i64 {
    let number = i64::from(number as i32);
    number * number
}

/// The energy of a point with these neighbours if it were at `level` of the left-out variable, without the pair with
/// the point `except`.
#[inline(always)]
fn energy_at(near: &Neighbours, shift: u32, level: i64, except: usize) -> i64 {
    let others = near.points.iter().zip(near.left.iter().zip(&near.levels));
    others
        .map(|(point, (left, other))| {
            let energy = pair_energy(left - square(other - level), shift);
            if *point == except { 0 } else { energy }
        })
        .sum()
}

/// [`Search::repair`] for one instruction set. Energies are integers, so the result is the same for all. A closure in its
/// place is not inlined, and the search takes twice as long.
struct Repair<'s> {
    search: &'s mut Search,
    slack: i64,
}

impl WithSimd for Repair<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.search.try_swaps(self.slack);
    }
}

/// The budget spent on a scan of `seen` points.
fn cost(seen: usize, variables: usize) -> u64 {
    (seen as u64 + SCAN_OVERHEAD) * variables as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use stats::streams::{Purpose, stream};

    /// Compares the energies updated swap by swap with energies computed from scratch.
    #[test]
    fn swaps_keep_the_books() {
        for (n, d) in [(2, 2), (17, 3), (120, 6), (40, 20)] {
            let mut rng = stream(3, Purpose::Test, n as u64, d as u64);
            let table = Table::new(n, &random_columns(n, d - 1, &mut rng));
            let mut search = Search::new(table, rng);
            let radius = 3 * search.measure() / 2 + 1;
            search.set_squared_radius(radius);
            for slack in [0, search.slack(0.1) as i64] {
                for _ in 0..500 {
                    search.repair(slack);
                }
                let mut kept = search.active.clone();
                let energy = search.energy.clone();
                search.set_squared_radius(radius);
                assert_eq!(energy, search.energy);
                kept.sort_unstable();
                search.active.sort_unstable();
                assert_eq!(kept, search.active);
                search.set_squared_radius(radius); // restores `place` after the sort
            }
        }
    }
}
