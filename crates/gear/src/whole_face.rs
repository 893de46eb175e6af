//! Loaded contact of whole teeth: each pair of teeth in contact is one spring.
//!
//! A line that covers the share f of the face bends both teeth over their whole width b, but is
//! pressed together over f b only. The pair carries F = (δ − g)/(Q_B/b + Q_H/(b f)) where that is
//! positive, with Q_B the compliance of the beams, Q_H that of the contact, and Q_B and the gap g
//! taken at the middle of the line. Σ F = F_bt over the pairs in contact gives δ. Wherever the line
//! lies, pressure and wear follow from the load F/b per length of line.
//!
//! The model leaves out where on the face the load lies: a corner that has just come into contact
//! bends the tooth like a load over the whole face, the pressure of a short line is too small, and
//! crowning has no meaning.

use crate::balance::{Balance, Frame, not_negative};
use crate::corrections::Lead;
use crate::path::{Line, Path, Place, Span};
use crate::periodic::PeriodicFunction;

/// The springs of one pair of gears.
#[derive(Debug, Clone)]
pub(crate) struct WholeFace {
    /// Q_H, mm per N/mm.
    hertz: f64,
    springs: Vec<Spring>,
    /// First spring of each phase, and the total at the end.
    first: Vec<usize>,
}

/// A pair of teeth in contact, or several alike.
#[derive(Debug, Clone, Copy)]
struct Spring {
    middle: Place,
    /// F/b per mm of approach, N/mm per mm.
    stiffness: f64,
}

impl Spring {
    /// A line over the share `share` of the face with its middle at `s`. `beams` is 1/Q_B at the
    /// nodes.
    fn new(path: &Path, beams: &[f64], hertz: f64, share: f64, s: f64) -> Self {
        let middle = path.place(s);
        let (c0, c1) = (beams[middle.cell], beams[middle.cell + 1]);
        let beam = c0 + middle.u * (c1 - c0);
        // 1/(1/beam + hertz/share), with one division. A load below the roots of both teeth bends neither of them.
        let stiffness = if c0.max(c1).is_infinite() {
            share / hertz
        } else {
            beam * share / (share + hertz * beam)
        };
        Self { middle, stiffness }
    }

    /// The pair of teeth whose line covers this part of the path.
    fn from_span(path: &Path, beams: &[f64], hertz: f64, span: Span) -> Self {
        let share = (span.hi - span.lo) / path.window;
        let one = Self::new(path, beams, hertz, share, 0.5 * (span.lo + span.hi));
        Self {
            stiffness: span.weight * one.stiffness,
            ..one
        }
    }

    /// The gap at the middle of the line.
    fn gap(&self, g: &[f64]) -> f64 {
        let (i, u) = (self.middle.cell, self.middle.u);
        g[i] + u * (g[i + 1] - g[i])
    }
}

impl WholeFace {
    /// `beams` is 1/Q_B at the nodes.
    pub(crate) fn new(path: &Path, beams: &[f64], hertz: f64) -> Self {
        let mut this = Self {
            hertz,
            springs: Vec::new(),
            first: vec![0],
        };
        for &phi in &path.phases {
            path.spans_at(phi, |span| {
                let spring = Spring::from_span(path, beams, hertz, span);
                this.springs.push(spring);
            });
            this.first.push(this.springs.len());
        }
        this
    }

    /// δ of the unworn pair at the phase `phi`, from 0 to below one base pitch.
    pub(crate) fn unworn(&self, frame: &Frame, phi: f64) -> f64 {
        let mut stiffness = 0.0;
        self.springs_at(frame, phi, |spring| stiffness += spring.stiffness);
        frame.target / stiffness
    }

    /// Calls `found` for each of the springs at the phase `phi`.
    fn springs_at(&self, frame: &Frame, phi: f64, mut found: impl FnMut(Spring)) {
        let Frame {
            path, stiffness, ..
        } = frame;
        path.spans_at(phi, |span| {
            found(Spring::from_span(path, stiffness, self.hertz, span));
        });
    }

    /// The greatest F/b at each node over the mesh period, for the gap `g` that is solved by `delta`
    /// at the phases: that of the pairs whose line covers the node, wherever its middle is.
    /// `is_zero_gap`: the gap is zero at all nodes.
    pub(crate) fn greatest_load(
        &self,
        frame: &Frame,
        g: &[f64],
        delta: &[f64],
        is_zero_gap: bool,
    ) -> Vec<f64> {
        let path = &frame.path;
        let (line, p) = (path.line(), path.base_pitch);
        // While a line covers the whole path all periods are alike, and two of them suffice.
        let spare = (((line.window - line.length) / p).floor() - 2.0).max(0.0) * p;
        let short = Line {
            window: line.window - spare,
            ..line
        };
        let load = |end: f64, delta: f64| {
            let covered = if end > line.length { end + spare } else { end };
            self.load(frame, g, covered, delta)
        };
        let periods = ((short.length + short.window) / p).ceil() as usize + 1;
        let ends = (0..periods).flat_map(|j| path.phases.iter().map(move |phi| j as f64 * p + phi));
        let ends: Vec<f64> = ends.collect();
        let loads = ends.iter().zip(delta.iter().cycle());
        let loads: Vec<f64> = loads.map(|(&end, &delta)| load(end, delta)).collect();
        let function = PeriodicFunction {
            phases: &ends,
            values: &loads,
            period: f64::INFINITY,
        };
        let mut exact = |end: f64| load(end, self.unworn(frame, end.rem_euclid(p)));
        let at: Option<&mut dyn FnMut(f64) -> f64> =
            if is_zero_gap { Some(&mut exact) } else { None };
        path.greatest_in_contact(&function, short.window, Lead::default(), at)
    }

    /// F/b of a pair whose line's front end is at `end`, for the gap `g` at the deflection `delta`.
    pub(crate) fn load(&self, frame: &Frame, g: &[f64], end: f64, delta: f64) -> f64 {
        let path = &frame.path;
        let (share, middle) = path.line().on_path(end);
        // The line is not in contact.
        if share <= 0.0 {
            return 0.0;
        }
        let s = path.s_in + middle;
        let spring = Spring::new(path, &frame.stiffness, self.hertz, share, s);
        (delta - spring.gap(g)).max(0.0) * spring.stiffness
    }
}

/// The balance of one sample.
pub(crate) struct WholeFaceBalance<'a> {
    pub(crate) frame: &'a Frame,
    pub(crate) teeth: &'a WholeFace,
    /// The gap at the nodes.
    pub(crate) g: &'a [f64],
    pub(crate) memory: &'a mut Memory,
}

/// Working memory, reused from sample to sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    springs: Vec<Spring>,
}

impl Balance for WholeFaceBalance<'_> {
    fn at_phase(&mut self, k: usize, _guess: f64) -> f64 {
        let springs = &self.teeth.springs[self.teeth.first[k]..self.teeth.first[k + 1]];
        self.balance(springs)
    }

    fn at(&mut self, phi: f64, _guess: f64) -> f64 {
        let mut springs = std::mem::take(&mut self.memory.springs);
        springs.clear();
        self.teeth
            .springs_at(self.frame, phi, |spring| springs.push(spring));
        let delta = self.balance(&springs);
        self.memory.springs = springs;
        delta
    }
}

impl WholeFaceBalance<'_> {
    /// Solves Σ k max(0, δ − g) = F_bt/b. With all springs counted, also those that would pull, δ is
    /// at or above the solution; each round drops the springs whose gap is above it.
    fn balance(&self, springs: &[Spring]) -> f64 {
        let (mut delta, mut count) = (f64::INFINITY, usize::MAX);
        loop {
            let (mut force, mut stiffness, mut touching) = (self.frame.target, 0.0, 0);
            for spring in springs {
                let gap = spring.gap(self.g);
                // A NaN counts as touching, and so reaches the result.
                let open = gap >= delta;
                if !open {
                    force += spring.stiffness * gap;
                    stiffness += spring.stiffness;
                    touching += 1;
                }
            }
            // None touches when the load is lost in the rounding of the gap.
            if touching == count || touching == 0 {
                return not_negative(delta);
            }
            (delta, count) = (force / stiffness, touching);
        }
    }
}
