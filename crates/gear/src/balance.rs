//! The common part of all calculations of the contact: path, stiffness and load of a pair, and the
//! search for the extremes of the deflection δ over a mesh period.

use crate::path::Path;

/// Relative size of a Newton step after which the next one would be about as large as rounding.
pub(crate) const CONVERGED: f64 = 1e-6;
/// The most Newton steps. A solution takes that many only if the loaded part of the path shrinks to a
/// point.
pub(crate) const MAX_STEPS: usize = 100;
/// Rounds of the search for extremes between the phases if contact goes on beyond the path: it then begins at an unknown
/// place within a phase step. Otherwise one round suffices.
const ROUNDS_BEYOND: usize = 3;

/// Path, stiffness and load of one pair.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    pub(crate) path: Path,
    /// 1/q at the nodes, N/mm per mm, with q the compliance per length of contact line; for whole
    /// teeth that of the beams alone. Coupled cells have none, and no `target`.
    pub(crate) stiffness: Vec<f64>,
    /// Sum of the loads: F_bt w/b for slices, whose loads are integrated over the path, and F_bt/b
    /// for whole teeth.
    pub(crate) target: f64,
}

/// Finds the deflection δ that balances the load for one gap.
pub(crate) trait Balance {
    /// δ at the phase number `k`; the solution may start from `guess`.
    fn at_phase(&mut self, k: usize, guess: f64) -> f64;

    /// δ at the phase `phi`, mm.
    fn at(&mut self, phi: f64, guess: f64) -> f64;
}

/// Extremes of δ over the mesh period.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extremes {
    pub(crate) min: f64,
    pub(crate) max: f64,
}

impl Frame {
    /// Solves δ at every phase into `delta`, and returns its extremes. δ is also solved between the
    /// phases, where the neighbouring phases predict an extreme.
    pub(crate) fn extremes(&self, balance: &mut impl Balance, delta: &mut Vec<f64>) -> Extremes {
        delta.clear();
        let mut previous = [(0.0, f64::NAN); 2];
        for (k, &phi) in self.path.phases.iter().enumerate() {
            let [(phi_1, delta_1), (phi_2, delta_2)] = previous;
            // Linear extrapolation from two solutions; NaN means that there is no guess.
            let guess = delta_1 + (delta_1 - delta_2) * (phi - phi_1) / (phi_1 - phi_2);
            let guess = if guess.is_nan() { delta_1 } else { guess };
            let solved = balance.at_phase(k, guess);
            delta.push(solved);
            previous = [(phi, solved), (phi_1, delta_1)];
        }
        let mut extremes = Extremes {
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
        };
        let mut meet = |delta: f64| {
            extremes.min = extremes.min.min(delta);
            extremes.max = extremes.max.max(delta);
        };
        delta.iter().for_each(|&delta| meet(delta));
        let (mut phases, mut values) = (self.path.phases.clone(), delta.clone());
        let rounds = if self.path.goes_beyond() {
            ROUNDS_BEYOND
        } else {
            1
        };
        for _ in 0..rounds {
            let found = [1.0, -1.0].map(|sign| self.between_phases(&phases, &values, sign));
            for (phi, guess) in found.into_iter().flatten().flatten() {
                let solved = balance.at(phi, guess);
                meet(solved);
                let k = phases.partition_point(|known| *known < phi);
                if phases.get(k) != Some(&phi) {
                    phases.insert(k, phi);
                    values.insert(k, solved);
                }
            }
        }
        extremes
    }

    /// Phases at which δ may exceed (sign 1) or fall below (sign −1) its values `delta` at `phases`, each
    /// with an estimate of δ: the best vertex of a parabola through three phases around an extreme, and
    /// the best crossing of the straight lines through the two phases before and after it. The
    /// latter finds kinks, which a spur pair has where a worn pair of teeth closes.
    fn between_phases(&self, phases: &[f64], delta: &[f64], sign: f64) -> [Option<(f64, f64)>; 2] {
        let p = self.path.base_pitch;
        let count = phases.len();
        let mut best: [Option<(f64, f64)>; 2] = [None; 2];
        let mut offer = |kind: usize, phi: f64, value: f64| {
            if value.is_finite() && best[kind].is_none_or(|(_, most)| value > most) {
                best[kind] = Some((phi, value));
            }
        };
        for k in 0..count {
            let before = if k == 0 { count - 1 } else { k - 1 };
            let after = if k + 1 == count { 0 } else { k + 1 };
            let (d0, d1) = (
                sign * (delta[k] - delta[before]),
                sign * (delta[after] - delta[k]),
            );
            if !(d0 > 0.0 && d1 <= 0.0) {
                continue;
            }
            let at = |offset: usize| (k + count + offset - 2) % count;
            let v = |offset: usize| sign * delta[at(offset)];
            // Distances between the five phases around k.
            let h = |offset: usize| (phases[at(offset + 1)] - phases[at(offset)]).rem_euclid(p);
            let (before, after) = (d0 / h(1), d1 / h(2));
            let curvature = (after - before) / (h(1) + h(2));
            let slope = (before * h(2) + after * h(1)) / (h(1) + h(2));
            let step = -0.5 * slope / curvature;
            offer(0, phases[k] + step, v(2) + 0.5 * slope * step);
            // A kink after k: the line from before k meets the line beyond the next phase.
            let beyond = (v(4) - v(3)) / h(3);
            let step = (v(3) - beyond * h(2) - v(2)) / (before - beyond);
            if step > 0.0 && step < h(2) {
                offer(1, phases[k] + step, v(2) + before * step);
            }
            // And one before k.
            let ahead = (v(1) - v(0)) / h(0);
            let step = (v(1) + ahead * h(1) - v(2)) / (after - ahead);
            if step < 0.0 && step > -h(1) {
                offer(1, phases[k] + step, v(2) + after * step);
            }
        }
        best.map(|found| found.map(|(phi, value)| (phi.rem_euclid(p), sign * value)))
    }
}

/// Replaces a negative δ by zero: a load so small that it is lost in the rounding of the gap gives
/// one. A NaN is passed on.
pub(crate) fn not_negative(delta: f64) -> f64 {
    if delta < 0.0 { 0.0 } else { delta }
}
