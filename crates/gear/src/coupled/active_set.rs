//! The cells that touch: one small linear system for each guess, until no cell pulls or overlaps.
//!
//! With A the inverse of the compliance of all cells, a = A 1 and gaps g, the forces are
//! F = δ a − A g − A λ. λ is the overlap of the cells that are held open, and zero elsewhere; it follows
//! from their forces, which are zero, and δ from the sum of all forces. Cells whose force would pull are opened, open ones that would overlap are closed. After
//! [`FREE_ROUNDS`] only the first offender changes in a round, which cannot cycle.

/// Rounds in which all offenders change at once. Three are usual, eight the most seen.
const FREE_ROUNDS: usize = 25;
/// Share of the load below which a pulling force is rounding.
const FORCE_TOLERANCE: f64 = 1e-9;
/// Share of the greatest gap below which an overlap is rounding.
const GAP_TOLERANCE: f64 = 1e-10;

/// The stiffness of the cells of one phase.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stiffness {
    /// Inverse of the compliance, N/mm, row by row; symmetric.
    pub(crate) matrix: Vec<f64>,
    /// Its row sums.
    pub(crate) sums: Vec<f64>,
}

/// Working memory, with the forces of the last solution.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    pub(crate) forces: Vec<f64>,
    /// A g.
    product: Vec<f64>,
    is_open: Vec<bool>,
    /// The open cells.
    open: Vec<usize>,
    /// Cholesky factor of the part of A that belongs to the open cells, row by row.
    factor: Vec<f64>,
    /// Solutions for a and for A g.
    solutions: [Vec<f64>; 2],
}

impl Memory {
    /// Whether each cell was open in the last solution.
    pub(crate) fn is_open(&self) -> &[bool] {
        &self.is_open
    }

    /// The deflection δ, mm, at which the cells carry `load`, N, over the gaps `gap`, mm; their forces are
    /// in `forces`. `start` tells which cells are open at first. NaN for gaps that are not numbers.
    #[inline(always)]
    pub(crate) fn balance(
        &mut self,
        stiffness: &Stiffness,
        gap: &[f64],
        load: f64,
        start: impl Fn(usize) -> bool,
    ) -> f64 {
        let n = gap.len();
        let (matrix, sums) = (&stiffness.matrix, &stiffness.sums);
        let row = |i: usize| &matrix[i * n..(i + 1) * n];
        self.product.clear();
        self.product.resize(n, 0.0);
        for (i, &g) in gap.iter().enumerate() {
            add_multiple(&mut self.product, g, row(i));
        }
        let greatest = gap.iter().fold(0.0, |most: f64, g| most.max(g.abs()));
        let strongest = self
            .product
            .iter()
            .fold(0.0, |most: f64, g| most.max(g.abs()));
        let least_overlap = GAP_TOLERANCE * greatest.max(1e-3);
        let pull = -(FORCE_TOLERANCE * load).max(1e-13 * strongest);
        let (all_sums, all_product) = (sums.iter().sum::<f64>(), self.product.iter().sum::<f64>());
        self.is_open.clear();
        self.is_open.extend((0..n).map(start));
        for round in 0..FREE_ROUNDS + 8 * n {
            self.list_open(gap);
            let (mut force, mut rate) = (load + all_product, all_sums);
            self.solve_open(matrix, sums, n);
            for ((&i, for_sums), for_product) in self
                .open
                .iter()
                .zip(&self.solutions[0])
                .zip(&self.solutions[1])
            {
                force -= sums[i] * for_product;
                rate -= sums[i] * for_sums;
            }
            let delta = force / rate;
            self.forces.clear();
            self.forces.extend(
                sums.iter()
                    .zip(&self.product)
                    .map(|(sum, product)| delta * sum - product),
            );
            for (p, &i) in self.open.iter().enumerate() {
                let overlap = delta * self.solutions[0][p] - self.solutions[1][p];
                add_multiple(&mut self.forces, -overlap, row(i));
            }
            if !self.change(delta, least_overlap, pull, round >= FREE_ROUNDS) {
                for &i in &self.open {
                    self.forces[i] = 0.0;
                }
                return delta;
            }
        }
        f64::NAN
    }

    /// Lists the open cells. If all are, the one with the least gap is closed: something carries the load.
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
    fn solve_open(&mut self, matrix: &[f64], sums: &[f64], n: usize) {
        let k = self.open.len();
        let [for_sums, for_product] = &mut self.solutions;
        for_sums.clear();
        for_product.clear();
        self.factor.clear();
        for (p, &i) in self.open.iter().enumerate() {
            let row = &matrix[i * n..(i + 1) * n];
            let start = self.factor.len();
            for (q, &j) in self.open[..=p].iter().enumerate() {
                let above = q * (q + 1) / 2;
                let product = dot(
                    &self.factor[start..start + q],
                    &self.factor[above..above + q],
                );
                let rest = row[j] - product;
                self.factor.push(if q == p {
                    rest.sqrt()
                } else {
                    rest / self.factor[above + q]
                });
            }
            let factor = &self.factor[start..start + p];
            let diagonal = self.factor[start + p];
            for_sums.push((sums[i] - dot(factor, for_sums)) / diagonal);
            for_product.push((self.product[i] - dot(factor, for_product)) / diagonal);
        }
        for p in (0..k).rev() {
            let start = p * (p + 1) / 2;
            let diagonal = self.factor[start + p];
            for solution in [&mut *for_sums, &mut *for_product] {
                solution[p] /= diagonal;
                let value = solution[p];
                add_multiple(&mut solution[..p], -value, &self.factor[start..start + p]);
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
                self.forces[i] < pull
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

#[inline(always)]
fn add_multiple(to: &mut [f64], factor: f64, row: &[f64]) {
    for (to, value) in to.iter_mut().zip(row) {
        *to += factor * value;
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

    use super::super::inverse::invert;
    use super::*;

    /// The compliance of `n` cells with random coupling, and its stiffness.
    fn cells(n: usize, numbers: &[f64]) -> (Vec<f64>, Stiffness) {
        let compliance: Vec<f64> = (0..n * n)
            .map(|at| {
                let (i, j) = (at / n, at % n);
                let shared: f64 = (0..3)
                    .map(|k| numbers[i * 3 + k] * numbers[j * 3 + k])
                    .sum();
                1e-5 * (shared + if i == j { 1.0 } else { 0.0 })
            })
            .collect();
        let mut matrix = compliance.clone();
        assert!(invert(&mut matrix, n, &mut Vec::new()));
        let sums = matrix.chunks_exact(n).map(|row| row.iter().sum()).collect();
        (compliance, Stiffness { matrix, sums })
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
            let delta = memory.balance(&stiffness, &gaps, load, |i| start >> i & 1 == 1);
            let forces = &memory.forces;
            prop_assert!((forces.iter().sum::<f64>() / load - 1.0).abs() < 1e-6);
            for i in 0..n {
                let row = &compliance[i * n..(i + 1) * n];
                let moved: f64 = row.iter().zip(forces).map(|(c, force)| c * force).sum();
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
        let delta = memory.balance(&stiffness, &[0.0, 0.001, 0.002], 600.0, |_| false);
        assert!((delta - 0.003).abs() < 1e-12);
        assert!((memory.forces[2] - 100.0).abs() < 1e-6);
        // The third stays open, though the search starts with it alone closed.
        let delta = memory.balance(&stiffness, &[0.0, 0.001, 0.1], 600.0, |i| i < 2);
        assert!((delta - 0.0035).abs() < 1e-12);
        assert_eq!(memory.is_open(), [false, false, true]);
        assert_eq!(memory.forces[2], 0.0);
    }

    #[test]
    fn degenerate_gaps_and_loads_end_the_search() {
        let (_, stiffness) = cells(3, &[0.5; 9]);
        let mut memory = Memory::default();
        // All open at first, and gaps of metres.
        let delta = memory.balance(&stiffness, &[1e3, 1.5e3, 2e3], 1.0, |_| true);
        assert!((delta - 1e3).abs() < 0.1);
        // Without a load the flanks touch in the least gap.
        let delta = memory.balance(&stiffness, &[0.3, 0.1, 0.2], 0.0, |_| false);
        assert!((delta - 0.1).abs() < 1e-9);
        assert!(
            memory
                .balance(&stiffness, &[0.0, f64::NAN, 0.0], 1.0, |_| false)
                .is_nan()
        );
    }
}
