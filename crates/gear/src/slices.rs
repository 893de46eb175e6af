//! Loaded contact of thin uncoupled slices: the deflection δ of the mesh at every phase.
//!
//! A slice at s with compliance q and missing material g carries max(0, δ − g)/q per mm of contact
//! line. The mesh is in balance when, over all windows of the path (see `path`),
//! Σ ∫ max(0, δ − g)/q ds = F_bt w/b, with w the window length and b the face width.
//!
//! 1/q and g are linear in each cell, so all integrals are exact sums of polynomials. While every
//! slice touches, δ is a ratio of prefix sums. Otherwise the touching set {g < δ} is kept as one
//! interval for each valley of g, whose ends move along the flank as δ changes; the force is then
//! still a handful of prefix-sum differences for any number of cells. The force is convex
//! and increasing in δ, so Newton's method falls monotonically after its first step.
//!
//! A gap that also grows along the face, by `slope` from its leading end to the trailing one, is tied to
//! the place on the path: the line with its front end at e touches s at the share (e − s)/w of the face.
//! The part with s belongs to the gap of all lines, the one with e lowers the δ of this line.

use std::borrow::Cow;

use crate::balance::{Balance, CONVERGED, Frame, MAX_STEPS, not_negative};
use crate::path::{Path, Place, Window};

/// Prefix integrals of the stiffness 1/q.
#[derive(Debug, Clone)]
pub(crate) struct Slices {
    /// Prefix integral of 1/q.
    area: Vec<f64>,
    /// ∫ g/q over a cell is `weights[0]` g_left + `weights[1]` g_right.
    weights: Vec<[f64; 2]>,
}

impl Slices {
    /// `stiffness` is 1/q at the nodes.
    pub(crate) fn new(path: &Path, stiffness: &[f64]) -> Self {
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
        Self { area, weights }
    }

    /// δ of the unworn pair at the phase `phi`, from 0 to below one base pitch.
    pub(crate) fn unworn(&self, frame: &Frame, phi: f64, windows: &mut Vec<Window>) -> f64 {
        windows.clear();
        frame.path.windows_at(phi, windows);
        let area: f64 = windows
            .iter()
            .map(|window| {
                let area = |place| self.area_at(frame, place);
                window.weight * (area(window.hi) - area(window.lo))
            })
            .sum();
        frame.target / area
    }

    /// Prefix integral of 1/q up to a place.
    fn area_at(&self, frame: &Frame, place: Place) -> f64 {
        let (i, u) = (place.cell, place.u);
        let h = frame.path.s[i + 1] - frame.path.s[i];
        let (c0, c1) = (frame.stiffness[i], frame.stiffness[i + 1]);
        self.area[i] + h * u * (c0 + 0.5 * u * (c1 - c0))
    }
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
struct PrefixIntegrals {
    s: f64,
    area: f64,
    gap: f64,
}

/// A window with its prefix integrals.
#[derive(Debug, Clone, Copy)]
struct Span {
    lo: PrefixIntegrals,
    hi: PrefixIntegrals,
    weight: f64,
    /// δ less the δ of its line.
    shift: f64,
}

/// Working memory, reused from sample to sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    gap_area: Vec<f64>,
    valleys: Vec<Valley>,
    touching: Vec<(PrefixIntegrals, PrefixIntegrals)>,
    spans: Vec<Span>,
    windows: Vec<Window>,
}

/// The balance of one sample.
pub(crate) struct SliceBalance<'a> {
    gap: Gap<'a>,
    memory: &'a mut Memory,
}

impl<'a> SliceBalance<'a> {
    /// `g` is the gap at the nodes, `slope` its growth along the face, mm; only lines with [windows of their
    /// own](Path::has_lines) may have one.
    pub(crate) fn new(
        frame: &'a Frame,
        slices: &'a Slices,
        g: &'a [f64],
        slope: f64,
        memory: &'a mut Memory,
    ) -> Self {
        let gap = Gap::new(frame, slices, g, slope, memory);
        Self { gap, memory }
    }
}

impl Balance for SliceBalance<'_> {
    fn at_phase(&mut self, k: usize, guess: f64) -> f64 {
        let windows = self.gap.frame.path.windows(k);
        self.gap.balance(windows, guess, self.memory)
    }

    fn at(&mut self, phi: f64, guess: f64) -> f64 {
        let mut windows = std::mem::take(&mut self.memory.windows);
        windows.clear();
        self.gap.frame.path.windows_at(phi, &mut windows);
        let delta = self.gap.balance(&windows, guess, self.memory);
        self.memory.windows = windows;
        delta
    }
}

/// The gap of one sample, with the prefix integrals of the stiffness.
struct Gap<'a> {
    frame: &'a Frame,
    slices: &'a Slices,
    /// Gap at the nodes that all lines share.
    g: Cow<'a, [f64]>,
    slope: f64,
    /// Largest gap on the path.
    greatest: f64,
}

impl<'a> Gap<'a> {
    fn new(
        frame: &'a Frame,
        slices: &'a Slices,
        g: &'a [f64],
        slope: f64,
        memory: &mut Memory,
    ) -> Self {
        let path = &frame.path;
        let g: Cow<'a, [f64]> = if slope == 0.0 {
            g.into()
        } else {
            let share = |s: f64| (s - path.s_in) / path.window;
            let sloped = path.s.iter().zip(g).map(|(&s, g)| g - slope * share(s));
            sloped.collect()
        };
        let sums = &mut memory.gap_area;
        sums.clear();
        let mut sum = 0.0;
        sums.push(sum);
        for (g, weight) in g.windows(2).zip(&slices.weights) {
            sum += weight[0] * g[0] + weight[1] * g[1];
            sums.push(sum);
        }
        let greatest = g.iter().fold(0.0, |most: f64, &g| most.max(g));
        let valleys = &mut memory.valleys;
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
        Self {
            frame,
            slices,
            g,
            slope,
            greatest,
        }
    }

    /// δ less the δ of the line of a window.
    fn shift(&self, window: &Window) -> f64 {
        let path = &self.frame.path;
        // The slope's own gap is zero at one end of the face.
        self.slope * (window.end - path.s_in) / path.window - self.slope.min(0.0)
    }

    /// Prefix integrals up to a place.
    fn integrals_at(&self, place: Place, gap_area: &[f64]) -> PrefixIntegrals {
        let (i, u) = (place.cell, place.u);
        let h = self.frame.path.s[i + 1] - self.frame.path.s[i];
        let (c0, g0) = (self.frame.stiffness[i], self.g[i]);
        let (dc, dg) = (self.frame.stiffness[i + 1] - c0, self.g[i + 1] - g0);
        let gap =
            gap_area[i] + h * u * (g0 * c0 + u * (0.5 * (g0 * dc + c0 * dg) + u * dg * dc / 3.0));
        PrefixIntegrals {
            s: place.s,
            area: self.slices.area_at(self.frame, place),
            gap,
        }
    }

    /// Solves Σ ∫ max(0, δ − g)/q ds = target over the windows, from `guess` if something touches
    /// there.
    fn balance(&self, windows: &[Window], guess: f64, memory: &mut Memory) -> f64 {
        let Memory {
            gap_area,
            valleys,
            touching,
            spans,
            ..
        } = memory;
        spans.clear();
        let (mut area, mut gap, mut most) = (0.0, 0.0, 0.0_f64);
        for window in windows {
            let span = Span {
                lo: self.integrals_at(window.lo, gap_area),
                hi: self.integrals_at(window.hi, gap_area),
                weight: window.weight,
                shift: self.shift(window),
            };
            let own = span.weight * (span.hi.area - span.lo.area);
            area += own;
            gap += span.weight * (span.hi.gap - span.lo.gap) + span.shift * own;
            most = most.max(span.shift);
            spans.push(span);
        }
        let full = (self.frame.target + gap) / area;
        if full >= self.greatest + most {
            return full;
        }
        let mut delta = if guess > 0.0 { guess } else { full };
        let mut has_restarted = false;
        for _ in 0..MAX_STEPS {
            let (force, rate) = self.force(delta, spans, valleys, touching, gap_area);
            if rate <= 0.0 || rate.is_nan() {
                // Nothing touches: the guess was below every gap. With all slices counted as
                // touching, δ can only be too large, and from there Newton's method falls to the
                // solution. If it falls to where nothing touches, the load is zero to rounding, and
                // δ is the lowest gap.
                if delta == full || has_restarted {
                    break;
                }
                has_restarted = true;
                delta = full;
                continue;
            }
            let step = (force - self.frame.target) / rate;
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
        touching: &mut Vec<(PrefixIntegrals, PrefixIntegrals)>,
        gap_area: &[f64],
    ) -> (f64, f64) {
        let (mut force, mut rate) = (0.0, 0.0);
        let mut shift = f64::NAN;
        for span in spans {
            let delta = delta - span.shift;
            // Without a slope all lines have one δ.
            if span.shift != shift {
                shift = span.shift;
                self.find_touching(delta, valleys, touching, gap_area);
            }
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

    /// Finds the parts of the path whose gap is below `delta`.
    fn find_touching(
        &self,
        delta: f64,
        valleys: &mut [Valley],
        touching: &mut Vec<(PrefixIntegrals, PrefixIntegrals)>,
        gap_area: &[f64],
    ) {
        let g = &*self.g;
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
            let node = |i: usize| PrefixIntegrals {
                s: self.frame.path.s[i],
                area: self.slices.area[i],
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
    }

    /// The place in `cell` where the gap equals `delta`.
    fn crossing(&self, cell: usize, delta: f64, gap_area: &[f64]) -> PrefixIntegrals {
        let (g0, g1) = (self.g[cell], self.g[cell + 1]);
        let u = ((delta - g0) / (g1 - g0)).clamp(0.0, 1.0);
        let (s0, s1) = (self.frame.path.s[cell], self.frame.path.s[cell + 1]);
        self.integrals_at(
            Place {
                s: s0 + u * (s1 - s0),
                cell,
                u,
            },
            gap_area,
        )
    }
}

#[cfg(test)]
mod tests {
    use crate::corrections::Corrections;
    use crate::general::plain;
    use crate::input::{Discretisation, PairInput};
    use crate::mesh::Scratch;
    use crate::pair::Pair;

    /// A slope along the face gives the same δ from prefix sums, line by line, as from pieces of the lines, which a
    /// negligible crowning selects.
    #[test]
    fn a_slope_along_the_face_needs_no_pieces() {
        for slope in [0.003, -0.011] {
            for face_width in [4.0, 20.0, 30.0] {
                let input = PairInput {
                    face_width: [face_width; 2],
                    ..plain()
                };
                let disc = Discretisation::default();
                let even = Pair::new(&input, &disc).expect("feasible");
                let corrections = Corrections::default().with_crowning(1e-14);
                let crowned =
                    Pair::with_corrections(&input, &corrections, &disc).expect("feasible");
                assert!(even.mesh.frame.path.has_lines());
                let nodes = even.path().len();
                let gap: Vec<f64> = (0..nodes)
                    .map(|k| 4e-3 * (7.0 * k as f64 / nodes as f64).sin().powi(2))
                    .collect();
                let (mut sums, mut pieces) = (Scratch::default(), Scratch::default());
                even.mesh.solve_tilted(&gap, slope, &mut sums);
                crowned.mesh.solve_tilted(&gap, slope, &mut pieces);
                let most = sums.delta.iter().fold(0.0, |most: f64, &d| most.max(d));
                for (a, b) in sums.delta.iter().zip(&pieces.delta) {
                    assert!(
                        (a - b).abs() < 1e-9 * most,
                        "{slope} on {face_width}: {a} {b}"
                    );
                }
            }
        }
    }
}
