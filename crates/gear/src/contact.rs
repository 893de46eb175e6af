//! Loaded contact of thin uncoupled slices: the deflection δ of the mesh at every phase.
//!
//! A slice at s with compliance q and missing material g carries max(0, δ − g)/q per mm of contact
//! line. The mesh is in balance when, over all windows of the path (see `path`),
//! Σ ∫ max(0, δ − g)/q ds = F_bt w/b, with w the window length and b the face width.
//!
//! 1/q and g are linear in each cell, so all integrals are exact sums of polynomials. While every
//! slice touches, δ is a ratio of prefix sums. Otherwise the touching set {g < δ} is kept as one
//! interval for each valley of g, whose ends move along the flank as δ changes; the force is then
//! still a handful of prefix-sum differences, whatever the number of cells. The force is convex
//! and increasing in δ, so Newton's method falls monotonically after its first step.

use crate::crowned::{self, Piece};
use crate::path::{Path, Place, Window};

/// Relative size of a Newton step after which the next one would be below rounding.
const CONVERGED: f64 = 1e-9;
/// Newton steps at most. Reached only when the loaded part of the path shrinks to a point.
const MAX_STEPS: usize = 100;

/// Path, compliance and load of one pair.
#[derive(Debug, Clone)]
pub(crate) struct Mesh {
    pub(crate) path: Path,
    /// 1/q at the nodes, N/mm per mm.
    pub(crate) stiffness: Vec<f64>,
    /// Prefix integral of 1/q.
    area: Vec<f64>,
    /// ∫ g/q over a cell is `weights[0]` g_left + `weights[1]` g_right.
    weights: Vec<[f64; 2]>,
    /// F_bt w/b.
    pub(crate) target: f64,
    /// Lengthwise crowning, mm at the ends of the face.
    pub(crate) crowning: f64,
}

/// A strip of the path whose gap falls to one lowest node and rises again.
#[derive(Debug, Clone, Copy)]
struct Valley {
    left: usize,
    bottom: usize,
    right: usize,
    /// First and last node below δ at the last evaluation; ends move from there.
    first: usize,
    last: usize,
}

/// A place with the prefix integrals of 1/q and g/q.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    s: f64,
    area: f64,
    gap: f64,
}

/// A window with its prefix integrals.
#[derive(Debug, Clone, Copy)]
struct Span {
    lo: Sum,
    hi: Sum,
    weight: f64,
}

/// Working memory of a solution, reused from sample to sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scratch {
    gap_area: Vec<f64>,
    valleys: Vec<Valley>,
    touching: Vec<(Sum, Sum)>,
    spans: Vec<Span>,
    windows: Vec<Window>,
    pieces: Vec<Piece>,
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
    /// `stiffness` is 1/q at the nodes; `target` is F_bt w/b.
    pub(crate) fn new(path: Path, stiffness: Vec<f64>, target: f64, crowning: f64) -> Self {
        let mut area = Vec::with_capacity(stiffness.len());
        let mut weights = Vec::with_capacity(stiffness.len());
        let mut sum = 0.0;
        area.push(sum);
        for (s, c) in path.s.windows(2).zip(stiffness.windows(2)) {
            let h = s[1] - s[0];
            sum += 0.5 * h * (c[0] + c[1]);
            area.push(sum);
            weights.push([h * (2.0 * c[0] + c[1]) / 6.0, h * (c[0] + 2.0 * c[1]) / 6.0]);
        }
        Self {
            path,
            stiffness,
            area,
            weights,
            target,
            crowning,
        }
    }

    /// Solves δ for the gap `g` at the nodes, at every phase, and refines its extremes.
    ///
    /// The extremes are the greatest and least over the phases and over places between them found
    /// from the neighbouring phases, where δ is solved anew.
    pub(crate) fn solve(&self, g: &[f64], scratch: &mut Scratch) -> Extremes {
        let gap = Gap::new(self, g, scratch);
        let phases = &self.path.phases;
        scratch.delta.clear();
        let mut previous = [(0.0, f64::NAN); 2];
        for (k, &phi) in phases.iter().enumerate() {
            let [(phi_1, delta_1), (phi_2, delta_2)] = previous;
            // Linear extrapolation where there are two solutions; NaN asks for a fresh start.
            let guess = delta_1 + (delta_1 - delta_2) * (phi - phi_1) / (phi_1 - phi_2);
            let guess = if guess.is_nan() { delta_1 } else { guess };
            let delta = if self.crowning > 0.0 {
                crowned::balance(self, g, phi, &mut scratch.pieces)
            } else {
                gap.balance(self.path.windows(k), guess, scratch)
            };
            scratch.delta.push(delta);
            previous = [(phi, delta), (phi_1, delta_1)];
        }
        let mut extremes = Extremes {
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
        };
        for &delta in &scratch.delta {
            extremes.min = extremes.min.min(delta);
            extremes.max = extremes.max.max(delta);
        }
        for sign in [1.0, -1.0] {
            for (phi, guess) in self
                .between_phases(&scratch.delta, sign)
                .into_iter()
                .flatten()
            {
                let delta = if self.crowning > 0.0 {
                    crowned::balance(self, g, phi, &mut scratch.pieces)
                } else {
                    let mut windows = std::mem::take(&mut scratch.windows);
                    windows.clear();
                    self.path.windows_at(phi, &mut windows);
                    let delta = gap.balance(&windows, guess, scratch);
                    scratch.windows = windows;
                    delta
                };
                extremes.min = extremes.min.min(delta);
                extremes.max = extremes.max.max(delta);
            }
        }
        extremes
    }

    /// δ of the unworn pair at any phase.
    pub(crate) fn unworn(&self, phi: f64, windows: &mut Vec<Window>) -> f64 {
        windows.clear();
        self.path
            .windows_at(phi.rem_euclid(self.path.base_pitch), windows);
        let area: f64 = windows
            .iter()
            .map(|window| window.weight * (self.area_at(window.hi) - self.area_at(window.lo)))
            .sum();
        self.target / area
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

    /// Prefix integral of 1/q up to a place.
    fn area_at(&self, place: Place) -> f64 {
        let (i, u) = (place.cell, place.u);
        let h = self.path.s[i + 1] - self.path.s[i];
        let (c0, c1) = (self.stiffness[i], self.stiffness[i + 1]);
        self.area[i] + h * u * (c0 + 0.5 * u * (c1 - c0))
    }
}

/// δ of a load so small that it is lost in the rounding of the gap may come out below zero; a NaN
/// is passed on.
pub(crate) fn not_negative(delta: f64) -> f64 {
    if delta < 0.0 { 0.0 } else { delta }
}

/// The gap of one sample, with what is needed to integrate it quickly.
struct Gap<'a> {
    mesh: &'a Mesh,
    g: &'a [f64],
    /// Largest gap on the path.
    greatest: f64,
}

impl<'a> Gap<'a> {
    fn new(mesh: &'a Mesh, g: &'a [f64], scratch: &mut Scratch) -> Self {
        let sums = &mut scratch.gap_area;
        sums.clear();
        let mut sum = 0.0;
        sums.push(sum);
        for (g, weight) in g.windows(2).zip(&mesh.weights) {
            sum += weight[0] * g[0] + weight[1] * g[1];
            sums.push(sum);
        }
        let greatest = g.iter().fold(0.0, |most: f64, &g| most.max(g));
        let valleys = &mut scratch.valleys;
        valleys.clear();
        let end = g.len() - 1;
        let mut left = 0;
        while left < end {
            let mut bottom = left;
            while bottom < end && g[bottom + 1] <= g[bottom] {
                bottom += 1;
            }
            let mut right = bottom;
            while right < end && g[right + 1] > g[right] {
                right += 1;
            }
            // A NaN stops both walks: step over its cell, the sums carry it to the result.
            right = right.max(left + 1);
            valleys.push(Valley {
                left,
                bottom,
                right,
                first: bottom,
                last: bottom,
            });
            left = right;
        }
        Self { mesh, g, greatest }
    }

    /// Prefix integrals up to a place.
    fn sum_at(&self, place: Place, gap_area: &[f64]) -> Sum {
        let (i, u) = (place.cell, place.u);
        let h = self.mesh.path.s[i + 1] - self.mesh.path.s[i];
        let (c0, g0) = (self.mesh.stiffness[i], self.g[i]);
        let (dc, dg) = (self.mesh.stiffness[i + 1] - c0, self.g[i + 1] - g0);
        let gap =
            gap_area[i] + h * u * (g0 * c0 + u * (0.5 * (g0 * dc + c0 * dg) + u * dg * dc / 3.0));
        Sum {
            s: place.s,
            area: self.mesh.area_at(place),
            gap,
        }
    }

    /// Solves Σ ∫ max(0, δ − g)/q ds = target over the windows, from `guess` if it is any good.
    fn balance(&self, windows: &[Window], guess: f64, scratch: &mut Scratch) -> f64 {
        let Scratch {
            gap_area,
            valleys,
            touching,
            spans,
            ..
        } = scratch;
        spans.clear();
        let (mut area, mut gap) = (0.0, 0.0);
        for window in windows {
            let span = Span {
                lo: self.sum_at(window.lo, gap_area),
                hi: self.sum_at(window.hi, gap_area),
                weight: window.weight,
            };
            area += span.weight * (span.hi.area - span.lo.area);
            gap += span.weight * (span.hi.gap - span.lo.gap);
            spans.push(span);
        }
        let full = (self.mesh.target + gap) / area;
        if full >= self.greatest {
            return full;
        }
        let mut delta = if guess > 0.0 { guess } else { full };
        for _ in 0..MAX_STEPS {
            let (force, rate) = self.force(delta, spans, valleys, touching, gap_area);
            if rate <= 0.0 || rate.is_nan() {
                // Nothing touches: the guess was below every gap. With all slices counted as
                // touching δ can only be too large, which is the side Newton falls from.
                if delta == full {
                    break;
                }
                delta = full;
                continue;
            }
            let step = (force - self.mesh.target) / rate;
            delta -= step;
            if step.abs() <= CONVERGED * delta {
                break;
            }
        }
        not_negative(delta)
    }

    /// Σ ∫ max(0, δ − g)/q ds over the spans and its derivative.
    fn force(
        &self,
        delta: f64,
        spans: &[Span],
        valleys: &mut [Valley],
        touching: &mut Vec<(Sum, Sum)>,
        gap_area: &[f64],
    ) -> (f64, f64) {
        let g = self.g;
        touching.clear();
        for valley in valleys {
            let closed = g[valley.bottom] < delta;
            if !closed {
                continue;
            }
            while valley.first > valley.left && g[valley.first - 1] < delta {
                valley.first -= 1;
            }
            while g[valley.first] >= delta {
                valley.first += 1;
            }
            while valley.last < valley.right && g[valley.last + 1] < delta {
                valley.last += 1;
            }
            while g[valley.last] >= delta {
                valley.last -= 1;
            }
            let node = |i: usize| Sum {
                s: self.mesh.path.s[i],
                area: self.mesh.area[i],
                gap: gap_area[i],
            };
            let lo = if valley.first > valley.left {
                self.crossing(valley.first - 1, delta, gap_area)
            } else {
                node(valley.first)
            };
            let hi = if valley.last < valley.right {
                self.crossing(valley.last, delta, gap_area)
            } else {
                node(valley.last)
            };
            touching.push((lo, hi));
        }
        let (mut force, mut rate) = (0.0, 0.0);
        for span in spans {
            for (lo, hi) in touching.iter() {
                let lo = if lo.s > span.lo.s { lo } else { &span.lo };
                let hi = if hi.s < span.hi.s { hi } else { &span.hi };
                if lo.s < hi.s {
                    let area = span.weight * (hi.area - lo.area);
                    force += delta * area - span.weight * (hi.gap - lo.gap);
                    rate += area;
                }
            }
        }
        (force, rate)
    }

    /// The place in `cell` where the gap equals `delta`.
    fn crossing(&self, cell: usize, delta: f64, gap_area: &[f64]) -> Sum {
        let (g0, g1) = (self.g[cell], self.g[cell + 1]);
        let u = ((delta - g0) / (g1 - g0)).clamp(0.0, 1.0);
        let (s0, s1) = (self.mesh.path.s[cell], self.mesh.path.s[cell + 1]);
        self.sum_at(
            Place {
                s: s0 + u * (s1 - s0),
                cell,
                u,
            },
            gap_area,
        )
    }
}
