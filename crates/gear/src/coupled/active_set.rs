//! The cells that touch: one small linear system for each guess, until no cell pulls or overlaps.
//!
//! With A the inverse of the compliance of all cells, a = A 1 and gaps g, the forces are F = δ a − A g − A λ. λ is the
//! overlap of the cells that are held open, and zero elsewhere; it follows from their forces, which are zero, and δ
//! from the sum of all forces. Cells whose force would pull are opened, and open cells that would overlap are closed.
//! After [`FREE_ROUNDS`] only the first offender changes in a round, which cannot cycle.

use crate::vectors::with_vectors;

use super::matrix::{Lanes, Matrix, add_multiple, greatest, lanes, sum};

/// Rounds in which all offenders change at once. One or two are usual, eight the most seen.
const FREE_ROUNDS: usize = 25;
/// Share of the load below which a pulling force is rounding.
const FORCE_TOLERANCE: f64 = 1e-9;
/// Share of the greatest gap below which an overlap is rounding.
const GAP_TOLERANCE: f64 = 1e-10;

/// The stiffness of the cells of one phase.
#[derive(Debug, Clone, Default)]
pub(super) struct Stiffness {
    /// Inverse of the compliance, N/mm.
    matrix: Matrix,
    /// Its row sums.
    sums: Vec<Lanes>,
    /// The sum of all.
    sum: f64,
}

impl Stiffness {
    /// The inverse of a compliance; `None` if it is not positive definite.
    pub(super) fn of(mut compliance: Matrix) -> Option<Self> {
        compliance.invert().then_some(())?;
        let mut sums = vec![[0.0; 8]; lanes(compliance.n)];
        for i in 0..compliance.n {
            add_multiple(&mut sums, 1.0, compliance.lanes_of(i));
        }
        Some(Self {
            matrix: compliance,
            sum: sum(&sums),
            sums,
        })
    }
}

/// The gaps and the load of the cells of a phase.
#[derive(Debug, Clone, Copy)]
pub(super) struct Loading<'a> {
    pub(super) stiffness: &'a Stiffness,
    /// Gaps of the cells, mm.
    pub(super) gap: &'a [f64],
    /// Load of all cells together, N.
    pub(super) load: f64,
    /// Whether each cell is open at the start.
    pub(super) is_open: &'a [bool],
}

/// Working memory, with the forces of the last solution.
#[derive(Debug, Clone, Default)]
pub(super) struct Memory {
    forces: Vec<Lanes>,
    /// A g.
    product: Vec<Lanes>,
    is_open: Vec<bool>,
    /// The open cells.
    open: Vec<usize>,
    /// Cholesky factor of the part of A that belongs to the open cells, row by row, with the reciprocals of its
    /// diagonal.
    factor: Vec<f64>,
    /// Solutions for a and for A g.
    solutions: [Vec<f64>; 2],
}

impl Memory {
    /// Forces of the last solution, N.
    pub(super) fn forces(&self) -> &[f64] {
        &self.forces.as_flattened()[..self.is_open.len()]
    }

    /// Whether each cell was open in the last solution.
    pub(super) fn is_open(&self) -> &[bool] {
        &self.is_open
    }

    /// The deflection δ, mm, at which the cells carry the load; their forces are in
    /// [`forces`](Self::forces). NaN for gaps that are not numbers.
    pub(super) fn balance(&mut self, loading: Loading<'_>) -> f64 {
        with_vectors(
            #[inline(always)]
            || self.balance_here(loading),
        )
    }

    #[inline(always)]
    fn balance_here(&mut self, loading: Loading<'_>) -> f64 {
        let Loading {
            stiffness,
            gap,
            load,
            is_open,
        } = loading;
        let n = gap.len();
        let (matrix, sums) = (&stiffness.matrix, &stiffness.sums);
        matrix.multiply(gap, &mut self.product);
        let least_overlap = GAP_TOLERANCE * greatest(gap).max(1e-3);
        let strongest = greatest(self.product.as_flattened());
        let pull = -(FORCE_TOLERANCE * load).max(1e-13 * strongest);
        let all_product = sum(&self.product);
        self.is_open.clear();
        self.is_open.extend_from_slice(is_open);
        for round in 0..FREE_ROUNDS + 8 * n {
            self.list_open(gap);
            self.solve_open(stiffness);
            let (mut force, mut rate) = (load + all_product, stiffness.sum);
            let [for_sums, for_product] = &self.solutions;
            for ((&i, for_sums), for_product) in self.open.iter().zip(for_sums).zip(for_product) {
                let sum = sums.as_flattened()[i];
                force -= sum * for_product;
                rate -= sum * for_sums;
            }
            let delta = force / rate;
            self.forces.clear();
            self.forces.resize(lanes(n), [0.0; 8]);
            add_multiple(&mut self.forces, delta, sums);
            add_multiple(&mut self.forces, -1.0, &self.product);
            for ((&i, for_sums), for_product) in self.open.iter().zip(for_sums).zip(for_product) {
                let overlap = delta * for_sums - for_product;
                add_multiple(&mut self.forces, -overlap, matrix.lanes_of(i));
            }
            if !self.change(delta, least_overlap, pull, round >= FREE_ROUNDS) {
                for &i in &self.open {
                    self.forces.as_flattened_mut()[i] = 0.0;
                }
                return delta;
            }
        }
        f64::NAN
    }

    /// Lists the open cells. If all are open, the one with the least gap is closed, because some cell must carry the
    /// load.
    #[inline(always)]
    fn list_open(&mut self, gap: &[f64]) {
        self.open.clear();
        self.open
            .extend((0..gap.len()).filter(|&i| self.is_open[i]));
        if self.open.len() == gap.len() {
            let least = (0..gap.len()).min_by(|&i, &j| gap[i].total_cmp(&gap[j]));
            if let Some(least) = least {
                self.is_open[least] = false;
                self.open.remove(least);
            }
        }
    }

    /// Solves A_oo x = a_o and A_oo x = (A g)_o for the open cells o.
    #[inline(always)]
    fn solve_open(&mut self, stiffness: &Stiffness) {
        let (sums, product) = (stiffness.sums.as_flattened(), self.product.as_flattened());
        let k = self.open.len();
        let [for_sums, for_product] = &mut self.solutions;
        for_sums.clear();
        for_product.clear();
        self.factor.clear();
        for (p, &i) in self.open.iter().enumerate() {
            let row = stiffness.matrix.row(i);
            let start = self.factor.len();
            for (q, &j) in self.open[..=p].iter().enumerate() {
                let above = q * (q + 1) / 2;
                let product = dot(
                    &self.factor[start..start + q],
                    &self.factor[above..above + q],
                );
                let rest = row[j] - product;
                self.factor.push(if q == p {
                    rest.sqrt().recip()
                } else {
                    rest * self.factor[above + q]
                });
            }
            let factor = &self.factor[start..start + p];
            let diagonal = self.factor[start + p];
            for_sums.push((sums[i] - dot(factor, for_sums)) * diagonal);
            for_product.push((product[i] - dot(factor, for_product)) * diagonal);
        }
        for p in (0..k).rev() {
            let start = p * (p + 1) / 2;
            let diagonal = self.factor[start + p];
            for solution in [&mut *for_sums, &mut *for_product] {
                solution[p] *= diagonal;
                let value = solution[p];
                let factor = &self.factor[start..start + p];
                for (solution, factor) in solution.iter_mut().zip(factor) {
                    *solution -= value * factor;
                }
            }
        }
    }

    /// Opens cells that pull and closes those that overlap; only the first one if `only_first`. Returns
    /// whether anything changed.
    #[inline(always)]
    fn change(&mut self, delta: f64, least_overlap: f64, pull: f64, only_first: bool) -> bool {
        let mut has_changed = false;
        let mut next_open = 0;
        for i in 0..self.is_open.len() {
            let offends = if self.open.get(next_open) == Some(&i) {
                let overlap = delta * self.solutions[0][next_open] - self.solutions[1][next_open];
                next_open += 1;
                overlap > least_overlap
            } else {
                self.forces.as_flattened()[i] < pull
            };
            if offends {
                self.is_open[i] = !self.is_open[i];
                has_changed = true;
                if only_first {
                    break;
                }
            }
        }
        has_changed
    }
}

/// The sum of products, in four interleaved parts so that it uses the vector units.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut parts = [0.0; 4];
    let (mut left, mut right) = (a.chunks_exact(4), b.chunks_exact(4));
    for (a, b) in left.by_ref().zip(right.by_ref()) {
        for ((part, a), b) in parts.iter_mut().zip(a).zip(b) {
            *part += a * b;
        }
    }
    let rest: f64 = left
        .remainder()
        .iter()
        .zip(right.remainder())
        .map(|(a, b)| a * b)
        .sum();
    (parts[0] + parts[2]) + (parts[1] + parts[3]) + rest
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::matrix::tests::matrix;
    use super::*;

    /// The compliance of `n` cells with random coupling, and its stiffness.
    fn cells(n: usize, numbers: &[f64]) -> (Matrix, Stiffness) {
        let compliance = matrix(n, |i, j| {
            let shared: f64 = (0..3)
                .map(|k| numbers[i * 3 + k] * numbers[j * 3 + k])
                .sum();
            1e-5 * (shared + if i == j { 1.0 } else { 0.0 })
        });
        let stiffness = Stiffness::of(compliance.clone()).unwrap();
        (compliance, stiffness)
    }

    fn balance(
        memory: &mut Memory,
        stiffness: &Stiffness,
        gap: &[f64],
        load: f64,
        is_open: impl Fn(usize) -> bool,
    ) -> f64 {
        let is_open: Vec<bool> = (0..gap.len()).map(is_open).collect();
        memory.balance(Loading {
            stiffness,
            gap,
            load,
            is_open: &is_open,
        })
    }

    proptest! {
        /// Forces push, carry the load, move all touching cells alike, and leave the others apart, from
        /// whatever cells the search starts.
        #[test]
        fn the_contact_conditions_hold(
            numbers in prop::collection::vec(-1.0..1.0_f64, 36),
            gaps in prop::collection::vec(0.0..0.1_f64, 12),
            exponent in -3.0..5.0_f64,
            start in any::<u16>(),
        ) {
            let (load, n) = (10_f64.powf(exponent), gaps.len());
            let (compliance, stiffness) = cells(n, &numbers);
            let mut memory = Memory::default();
            let delta = balance(&mut memory, &stiffness, &gaps, load, |i| start >> i & 1 == 1);
            let forces = memory.forces();
            prop_assert!((forces.iter().sum::<f64>() / load - 1.0).abs() < 1e-6);
            for i in 0..n {
                let moved: f64 = compliance.row(i).iter().zip(forces).map(|(c, force)| c * force).sum();
                let left = gaps[i] + moved - delta;
                prop_assert!(forces[i] >= -1e-8 * load - 1e-7, "{i} pulls by {}", forces[i]);
                prop_assert!(left > -1e-9, "{i} overlaps by {left}");
                prop_assert!(memory.is_open()[i] || left < 1e-9, "{i} floats at {left}");
            }
        }
    }

    /// Three cells by hand: without coupling each is a spring of 1e5 N/mm.
    #[test]
    fn springs_share_a_load() {
        let (_, stiffness) = cells(3, &[0.0; 9]);
        let mut memory = Memory::default();
        // All closed: δ = (600/1e5 + 0.003)/3.
        let delta = balance(&mut memory, &stiffness, &[0.0, 0.001, 0.002], 600.0, |_| {
            false
        });
        assert!((delta - 0.003).abs() < 1e-12);
        assert!((memory.forces()[2] - 100.0).abs() < 1e-6);
        // The third stays open, though the search starts with it alone closed.
        let delta = balance(&mut memory, &stiffness, &[0.0, 0.001, 0.1], 600.0, |i| {
            i < 2
        });
        assert!((delta - 0.0035).abs() < 1e-12);
        assert_eq!(memory.is_open(), [false, false, true]);
        assert_eq!(memory.forces()[2], 0.0);
    }

    #[test]
    fn degenerate_gaps_and_loads_end_the_search() {
        let (_, stiffness) = cells(3, &[0.5; 9]);
        let mut memory = Memory::default();
        // All open at first, and gaps of metres.
        let delta = balance(&mut memory, &stiffness, &[1e3, 1.5e3, 2e3], 1.0, |_| true);
        assert!((delta - 1e3).abs() < 0.1);
        // Without a load the flanks touch in the least gap.
        let delta = balance(&mut memory, &stiffness, &[0.3, 0.1, 0.2], 0.0, |_| false);
        assert!((delta - 0.1).abs() < 1e-9);
        assert!(
            balance(&mut memory, &stiffness, &[0.0, f64::NAN, 0.0], 1.0, |_| {
                false
            })
            .is_nan()
        );
    }
}
