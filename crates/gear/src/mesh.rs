//! The mesh of one pair: where its teeth touch, how stiffly, and the deflection δ over a mesh period.
//!
//! How the load of a phase is shared is one of three calculations behind the trait [`Balance`]:
//! slices of straight flanks (`slices`), of crowned ones (`crowned`), or whole teeth (`whole_face`).

use crate::crowned::{CrownedBalance, Piece};
use crate::path::{Path, Unrolled, Window};
use crate::slices::{self, SliceBalance, Slices};
use crate::whole_face::{self, WholeFace, WholeFaceBalance};

/// Relative size of a Newton step after which the next one would be below rounding.
pub(crate) const CONVERGED: f64 = 1e-9;
/// Newton steps at most. Reached only when the loaded part of the path shrinks to a point.
pub(crate) const MAX_STEPS: usize = 100;

/// Path, stiffness and load of one pair.
#[derive(Debug, Clone)]
pub(crate) struct Mesh {
    pub(crate) path: Path,
    /// 1/q at the nodes, N/mm per mm, with q the compliance per length of contact line; for whole
    /// teeth that of the beams alone.
    pub(crate) stiffness: Vec<f64>,
    /// What the loads add up to: F_bt w/b for slices, whose loads are integrated over the path, and
    /// F_bt/b for whole teeth.
    pub(crate) target: f64,
    contact: Contact,
}

#[derive(Debug, Clone)]
enum Contact {
    Slices(Slices),
    /// Slices of flanks with this lengthwise crowning, mm at the ends of the face.
    Crowned(f64),
    WholeFace(WholeFace),
}

/// Finds the deflection δ that balances the load for one gap.
pub(crate) trait Balance {
    /// δ at the phase number `k`; `guess` is used if it is any good.
    fn at_phase(&mut self, k: usize, guess: f64) -> f64;

    /// δ at the phase `phi`, mm.
    fn at(&mut self, phi: f64, guess: f64) -> f64;
}

/// Working memory of a solution, reused from sample to sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scratch {
    slices: slices::Memory,
    pieces: Vec<Piece>,
    springs: whole_face::Memory,
    /// δ at each phase.
    pub(crate) delta: Vec<f64>,
}

/// Extremes of δ over the mesh period.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extremes {
    pub(crate) min: f64,
    pub(crate) max: f64,
}

impl Mesh {
    /// The mesh of thin slices. `stiffness` is 1/q at the nodes; `target` is F_bt w/b.
    pub(crate) fn slices(path: Path, stiffness: Vec<f64>, target: f64, crowning: f64) -> Self {
        let contact = if crowning > 0.0 {
            Contact::Crowned(crowning)
        } else {
            Contact::Slices(Slices::new(&path, &stiffness))
        };
        Self {
            path,
            stiffness,
            target,
            contact,
        }
    }

    /// The mesh of whole teeth, for a path with [`Touch::Middle`](crate::path::Touch). `beams` is
    /// 1/Q_B at the nodes and `hertz` Q_H, mm per N/mm; `target` is F_bt/b.
    pub(crate) fn whole_face(path: Path, beams: Vec<f64>, hertz: f64, target: f64) -> Self {
        Self {
            contact: Contact::WholeFace(WholeFace::new(&path, &beams, hertz)),
            path,
            stiffness: beams,
            target,
        }
    }

    /// Solves δ for the gap `g` at the nodes, at every phase, and refines its extremes.
    ///
    /// The extremes are the greatest and least over the phases and over places between them found
    /// from the neighbouring phases, where δ is solved anew.
    pub(crate) fn solve(&self, g: &[f64], scratch: &mut Scratch) -> Extremes {
        let Scratch {
            slices,
            pieces,
            springs,
            delta,
        } = scratch;
        match &self.contact {
            Contact::Slices(kind) => {
                self.extremes(&mut SliceBalance::new(self, kind, g, slices), delta)
            }
            Contact::Crowned(crowning) => self.extremes(
                &mut CrownedBalance {
                    mesh: self,
                    crowning: *crowning,
                    g,
                    pieces,
                },
                delta,
            ),
            Contact::WholeFace(teeth) => self.extremes(
                &mut WholeFaceBalance {
                    mesh: self,
                    teeth,
                    g,
                    memory: springs,
                },
                delta,
            ),
        }
    }

    fn extremes(&self, balance: &mut impl Balance, delta: &mut Vec<f64>) -> Extremes {
        delta.clear();
        let mut previous = [(0.0, f64::NAN); 2];
        for (k, &phi) in self.path.phases.iter().enumerate() {
            let [(phi_1, delta_1), (phi_2, delta_2)] = previous;
            // Linear extrapolation where there are two solutions; NaN asks for a fresh start.
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
        for sign in [1.0, -1.0] {
            for (phi, guess) in self.between_phases(delta, sign).into_iter().flatten() {
                meet(balance.at(phi, guess));
            }
        }
        extremes
    }

    /// δ at any phase where no gap keeps the flanks apart; NaN for crowned ones, which always have
    /// a gap.
    pub(crate) fn unworn(&self, phi: f64, windows: &mut Vec<Window>) -> f64 {
        let phi = phi.rem_euclid(self.path.base_pitch);
        match &self.contact {
            Contact::Slices(slices) => slices.unworn(self, phi, windows),
            Contact::WholeFace(teeth) => teeth.unworn(self, phi, windows),
            Contact::Crowned(_) => f64::NAN,
        }
    }

    /// The greatest load per length of contact line at each node over the mesh period, N/mm, for the
    /// gap `g` whose solution is in `scratch`.
    ///
    /// `unworn` says that nothing but bending keeps the flanks apart: δ between the phases is then
    /// computed instead of interpolated.
    pub(crate) fn greatest_load(
        &self,
        g: &[f64],
        scratch: &Scratch,
        peak: f64,
        unworn: bool,
    ) -> Vec<f64> {
        let mut windows = Vec::new();
        let mut exact = |phi: f64| self.unworn(phi, &mut windows);
        let (crowning, at): (f64, Option<&mut dyn FnMut(f64) -> f64>) = match &self.contact {
            Contact::WholeFace(teeth) => {
                return teeth.greatest_load(self, g, &scratch.delta, unworn);
            }
            Contact::Crowned(crowning) => (*crowning, None),
            Contact::Slices(_) if unworn => (0.0, Some(&mut exact)),
            Contact::Slices(_) => (0.0, None),
        };
        let path = &self.path;
        let greatest = if path.window >= path.base_pitch && crowning == 0.0 {
            vec![peak; path.s.len()]
        } else {
            let unrolled = Unrolled {
                phases: &path.phases,
                values: &scratch.delta,
                period: path.base_pitch,
            };
            path.greatest_in_contact(&unrolled, path.window, crowning, at)
        };
        let closed = greatest
            .iter()
            .zip(g)
            .map(|(delta, g)| (delta - g).max(0.0));
        closed
            .zip(&self.stiffness)
            .map(|(closed, c)| closed * c)
            .collect()
    }

    /// Where δ may exceed (sign 1) or fall below (sign −1) its values at the phases, each with an
    /// estimate of δ: the best vertex of a parabola through three phases around an extreme, and
    /// the best crossing of the straight lines through the two phases before and after it. The
    /// latter finds kinks, which a spur pair has where a worn pair of teeth closes.
    fn between_phases(&self, delta: &[f64], sign: f64) -> [Option<(f64, f64)>; 2] {
        let (phases, p) = (&self.path.phases, self.path.base_pitch);
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

/// δ of a load so small that it is lost in the rounding of the gap may come out below zero; a NaN
/// is passed on.
pub(crate) fn not_negative(delta: f64) -> f64 {
    if delta < 0.0 { 0.0 } else { delta }
}
