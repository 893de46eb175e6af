//! Loaded contact of slices whose gap depends on the place along the face: crowning, and a helix slope where lines have
//! no windows of their own.
//!
//! At the phase φ the line of pair j touches s at the face position z/b = (s_in + φ + j p_bt − s)/w,
//! so each line has a gap of its own, g(s) + C_β (1 − 2 z/b)² + slope · z/b. The gap is taken as linear between
//! the nodes of the path and [`PIECES`] even parts of the line; the force of each piece is then
//! exact, with its end of contact inside it where there is one. The force is convex and increasing
//! in δ, and the first guess, all slices touching, is at or above the solution, so Newton's method
//! falls monotonically.

use crate::balance::{Balance, CONVERGED, Frame, MAX_STEPS, not_negative};
use crate::corrections::Lead;

/// The fewest even parts of a line. A parabola taken as straight in sixty-fourths is off by
/// C_β/4096 at most.
const PIECES: usize = 64;

/// A piece of a contact line: gap and stiffness at both ends, linear between.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    length: f64,
    gap: [f64; 2],
    stiffness: [f64; 2],
}

impl Piece {
    /// ∫ max(0, δ − g)/q ds and its derivative.
    fn force(&self, delta: f64) -> (f64, f64) {
        let [d0, d1] = self.gap.map(|g| delta - g);
        let [c0, c1] = self.stiffness;
        let closed = |h: f64, d: [f64; 2], c: [f64; 2]| {
            (
                h * (d[0] * (2.0 * c[0] + c[1]) + d[1] * (c[0] + 2.0 * c[1])) / 6.0,
                0.5 * h * (c[0] + c[1]),
            )
        };
        match (d0 > 0.0, d1 > 0.0) {
            (true, true) => closed(self.length, [d0, d1], [c0, c1]),
            (false, false) => (0.0, 0.0),
            (first, _) => {
                let u = d0 / (d0 - d1);
                let c = c0 + u * (c1 - c0);
                if first {
                    closed(u * self.length, [d0, 0.0], [c0, c])
                } else {
                    closed((1.0 - u) * self.length, [0.0, d1], [c, c1])
                }
            }
        }
    }
}

/// The balance of one sample.
pub(crate) struct CrownedBalance<'a> {
    pub(crate) frame: &'a Frame,
    pub(crate) lead: Lead,
    /// The gap at the nodes, to which that along the face is added.
    pub(crate) g: &'a [f64],
    pub(crate) pieces: &'a mut Vec<Piece>,
}

impl Balance for CrownedBalance<'_> {
    fn at_phase(&mut self, k: usize, guess: f64) -> f64 {
        self.at(self.frame.path.phases[k], guess)
    }

    fn at(&mut self, phi: f64, _guess: f64) -> f64 {
        balance(self.frame, self.lead, self.g, phi, self.pieces)
    }
}

/// δ at the phase `phi` (mm) for the gap `g` at the nodes on top of that along the face.
fn balance(frame: &Frame, lead: Lead, g: &[f64], phi: f64, pieces: &mut Vec<Piece>) -> f64 {
    let path = &frame.path;
    let w = path.window;
    pieces.clear();
    let phi = path.first_end(phi);
    let last = ((path.s_out - path.s_in + w - phi) / path.base_pitch).ceil();
    for j in 0..=last.max(0.0) as u64 {
        let end = path.s_in + phi + j as f64 * path.base_pitch;
        let (lo, hi) = ((end - w).max(path.s_in), end.min(path.s_out));
        if lo >= hi {
            continue;
        }
        let part = w / PIECES as f64;
        let mut cell = path.place(lo).cell;
        let at = |cell: usize, s: f64| {
            let (s0, s1) = (path.s[cell], path.s[cell + 1]);
            let u = (s - s0) / (s1 - s0);
            let linear = |v: &[f64]| v[cell] + u * (v[cell + 1] - v[cell]);
            let gap = linear(g) + lead.gap((end - s) / w);
            (gap, linear(&frame.stiffness))
        };
        let mut s = lo;
        let (mut gap, mut stiffness) = at(cell, s);
        let mut next_part = (((s - (end - w)) / part).floor() + 1.0).max(1.0);
        while s < hi {
            let node = path.s[cell + 1];
            let even = end - w + next_part * part;
            let next = node.min(even).min(hi);
            let (next_gap, next_stiffness) = at(cell, next);
            if next > s {
                pieces.push(Piece {
                    length: next - s,
                    gap: [gap, next_gap],
                    stiffness: [stiffness, next_stiffness],
                });
            }
            if node <= next && cell + 2 < path.s.len() {
                cell += 1;
            }
            if even <= next {
                next_part += 1.0;
            }
            if next >= hi {
                break;
            }
            (s, gap, stiffness) = (next, next_gap, next_stiffness);
        }
    }
    let (mut area, mut load, mut greatest) = (0.0, frame.target, 0.0_f64);
    for piece in pieces.iter() {
        let ([g0, g1], [c0, c1]) = (piece.gap, piece.stiffness);
        area += 0.5 * piece.length * (c0 + c1);
        load += piece.length * (g0 * (2.0 * c0 + c1) + g1 * (c0 + 2.0 * c1)) / 6.0;
        greatest = greatest.max(g0).max(g1);
    }
    let mut delta = load / area;
    if delta >= greatest {
        return delta;
    }
    for _ in 0..MAX_STEPS {
        let (mut force, mut rate) = (0.0, 0.0);
        for piece in pieces.iter() {
            let (f, r) = piece.force(delta);
            force += f;
            rate += r;
        }
        // Only a pair without load gets here: its flanks touch in a point.
        let loaded = rate > 0.0;
        if !loaded {
            break;
        }
        let step = (force - frame.target) / rate;
        delta -= step;
        if step.abs() <= CONVERGED * delta {
            break;
        }
    }
    not_negative(delta)
}
