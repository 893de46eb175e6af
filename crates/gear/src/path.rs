//! The path of contact cut into cells, and the mesh period cut into phases.
//!
//! A face position z and a place s on the path are tied along a contact line,
//! s = s_in + φ + j p_bt − z tan β_b, so the line of pair j covers the window
//! [s_in + φ + j p_bt − w, s_in + φ + j p_bt] of the path, clipped to [s_in, s_out], with
//! w = b tan β_b. Integrals over the face are integrals over windows.
//!
//! Nodes are placed where the load has kinks and evenly in ω = acos(1 − 2s/L) between: that is
//! denser towards the base tangent points, where the relative curvature grows without bound.
//! Phases are placed where an end of a window meets an end of the path or the pitch point, and
//! evenly between.

use std::ops::Range;

use crate::beyond::TipSeparation;
use crate::cell_index::CellIndex;
use crate::geometry::Geometry;
use crate::input::Discretisation;

/// Window length of a spur gear, in base pitches. A spur line touches one point of the path at a
/// time; giving it this width changes results by less than the discretisation and makes the
/// limit β → 0 continuous without a second code path.
const SPUR_WINDOW: f64 = 1e-6;

/// Halvings of the cells at both ends of the path and before a kink of the compliance. A thin tip
/// is soft: its compliance grows with the logarithm of the distance from the apex, which straight
/// pieces of equal length miss.
const END_HALVINGS: i32 = 4;

/// Stretches beyond an end of the path have one cell for this many on it, at least two.
const CELLS_PER_ONE_BEYOND: usize = 4;

/// Nodes and phases closer than this, in base pitches, are one.
const MERGE: f64 = 1e-9;

/// A place on the path, located in its cell.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub(crate) s: f64,
    pub(crate) cell: usize,
    /// Fraction of the cell, 0 to 1.
    pub(crate) u: f64,
}

impl Place {
    /// The value here of a function that is given at the nodes.
    pub(crate) fn of(self, values: &[f64]) -> f64 {
        let (left, right) = (values[self.cell], values[self.cell + 1]);
        left + self.u * (right - left)
    }
}

/// The part of the path that one pair of teeth covers at one phase.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    pub(crate) lo: Place,
    pub(crate) hi: Place,
    /// Number of pairs that cover it: more than one only for the whole path under a very wide face.
    pub(crate) weight: f64,
    /// Front end of the line, which may lie beyond the path; of the first one if there are several.
    pub(crate) end: f64,
}

/// A window whose ends are not located in their cells.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span {
    pub(crate) lo: f64,
    pub(crate) hi: f64,
    /// As that of a [`Window`].
    pub(crate) weight: f64,
    end: f64,
}

/// The places where a line of contact takes its compliance and gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Touch {
    /// At every place that the line covers.
    Everywhere,
    /// In the middle of the places that the line covers.
    Middle,
    /// In the cells that strips of the face cut from the line; their width fits the even phase step.
    Cells,
}

/// Path of contact and mesh period of one pair.
#[derive(Debug, Clone)]
pub(crate) struct Path {
    /// Start of the path itself.
    pub(crate) start: f64,
    /// Where flanks may touch: the ends of the path, or places beyond them.
    pub(crate) s_in: f64,
    pub(crate) s_out: f64,
    pub(crate) base_pitch: f64,
    /// Window length w, at least that of a spur gear.
    pub(crate) window: f64,
    /// Whether the window length is the stand-in of a spur gear.
    pub(crate) spur: bool,
    /// Nodes, increasing, from s_in to s_out.
    pub(crate) s: Vec<f64>,
    cells: CellIndex,
    /// Indices of the nodes on the path itself.
    inner: Range<usize>,
    /// Gap of the tip corners at all nodes, mm; empty where contact ends with the path.
    separation: Vec<f64>,
    /// Phases in mm from where a line reaches the path itself, increasing, from 0 to below one base pitch.
    pub(crate) phases: Vec<f64>,
    /// Number of phases without those at kinks.
    pub(crate) even_phases: usize,
    windows: Vec<Window>,
    /// First window of each phase, and the total at the end.
    first: Vec<usize>,
}

impl Path {
    /// The path and the mesh period of a pair. `soft` are places at which the compliance has a kink
    /// that steepens as it is approached from inside the path; `marks` are places at which the gap
    /// has a kink. Contact goes on `beyond` the ends of the path, if that is given.
    pub(crate) fn new(
        geometry: &Geometry,
        disc: &Discretisation,
        touch: Touch,
        beyond: Option<&TipSeparation>,
        soft: &[f64],
        marks: &[f64],
    ) -> Self {
        let (s_in, s_out, p) = (geometry.s_in, geometry.s_out, geometry.base_pitch);
        let (length, pitch_point) = (s_out - s_in, geometry.s_pitch - s_in);
        let width = geometry.face_width * geometry.beta_b.tan();
        let spur = width < SPUR_WINDOW * p;
        let window = width.max(SPUR_WINDOW * p);

        // The load at s is the greatest over the phases at which s is covered. It has kinks where
        // one end of that range of phases passes a kink of the deflection.
        let mut breaks = vec![0.0, length];
        if pitch_point > 0.0 && pitch_point < length {
            breaks.push(pitch_point);
        }
        let line = Line { length, window };
        if window < p || touch == Touch::Middle {
            for offset in [
                0.0,
                length,
                window,
                -window,
                length + window,
                length - window,
            ] {
                let mut x = offset.rem_euclid(p);
                while x < length {
                    breaks.push(x);
                    x += p;
                }
            }
        }
        let inside = |places: &[f64]| -> Vec<f64> {
            let along = places.iter().map(|s| s - s_in);
            along.filter(|&x| x > 0.0 && x < length).collect()
        };
        let (soft, marks) = (inside(soft), inside(marks));
        breaks.extend(soft.iter().chain(&marks));
        let breaks = merge_close(breaks, MERGE * p, length);
        let omega = |x: f64| (1.0 - 2.0 * (s_in + x) / geometry.path_length).acos();
        let total = omega(length) - omega(0.0);
        let edge = if spur { 1.5 * window } else { 0.0 };
        // A line that looks up its compliance in one place does not average the errors of its cells:
        // with twice as many, both kinds of contact err alike.
        let cells_wanted = match touch {
            Touch::Everywhere | Touch::Cells => disc.cells,
            Touch::Middle => 2 * disc.cells,
        };
        let mut s = vec![s_in];
        for pair in breaks.windows(2) {
            let (from, to) = (omega(pair[0]), omega(pair[1]));
            let cells = parts((to - from) / total, cells_wanted);
            let mut fractions: Vec<f64> = (0..=cells).map(|k| k as f64 / cells as f64).collect();
            let halves = (1..=END_HALVINGS).map(|k| 0.5_f64.powi(k) / cells as f64);
            let steep = |x: f64| soft.iter().any(|v| (v - x).abs() <= MERGE * p);
            // A spur pair's outermost cells are as short as its window already.
            let whole_cells = pair[1] - pair[0] > 2.0 * SPUR_WINDOW * p;
            let at_start = pair[0] <= edge || (steep(pair[0]) && pair[0] < 0.5 * length);
            let at_end = pair[1] >= length - edge || (steep(pair[1]) && pair[1] > 0.5 * length);
            if at_start && whole_cells {
                fractions.splice(1..1, halves.clone().rev());
            }
            if at_end && whole_cells {
                let at = fractions.len() - 1;
                fractions.splice(at..at, halves.map(|part| 1.0 - part));
            }
            for fraction in &fractions[1..fractions.len() - 1] {
                let angle = from + (to - from) * fraction;
                s.push(0.5 * geometry.path_length * (1.0 - angle.cos()));
            }
            s.push(s_in + pair[1]);
        }
        *s.last_mut().expect("s starts with s_in") = s_out;
        let reach = beyond.map_or([0.0; 2], |beyond| beyond.reach);
        let mut inner = 0..s.len();
        let mut separation = Vec::new();
        if let Some(beyond) = beyond {
            let cells = (disc.cells / CELLS_PER_ONE_BEYOND).max(2);
            // No cells are added at an end without reach, such as an end at a base circle.
            let counts = reach.map(|reach| if reach > 0.0 { cells } else { 0 });
            let distance = |end: usize, k: usize| reach[end] * k as f64 / cells as f64;
            inner = counts[0]..counts[0] + s.len();
            s.splice(0..0, (1..=counts[0]).rev().map(|k| s_in - distance(0, k)));
            s.extend((1..=counts[1]).map(|k| s_out + distance(1, k)));
            separation.extend(s.iter().map(|s| beyond.gap(s_in - s, s - s_out)));
        }

        let mut kinks = vec![0.0, length, window, length + window];
        let places = soft.iter().chain(&marks).chain([&pitch_point]);
        match touch {
            Touch::Everywhere => {
                kinks.extend(places.flat_map(|x| [*x, x + window]));
                if window < p {
                    // Where a window passes the kinks of the wear, which follow those of the load.
                    kinks.extend([
                        -window,
                        length - window,
                        2.0 * window,
                        length + 2.0 * window,
                    ]);
                }
            }
            // A spur line passes a kink of the gap at once. A helical line smooths it, and its cells need even phases.
            Touch::Cells if spur => kinks.extend(marks.iter().chain([&pitch_point])),
            Touch::Cells => kinks = vec![0.0],
            // Where the middle passes the kinks of compliance and gap, which are among the breaks.
            Touch::Middle => kinks.extend(breaks.iter().map(|&x| line.end_at(x))),
        }
        let kinks = kinks.into_iter().map(|x| x.rem_euclid(p)).chain([p]);
        let kinks = merge_close(kinks.collect(), MERGE * p, p);
        let mut phases = Vec::with_capacity(disc.phases + kinks.len());
        for pair in kinks.windows(2) {
            let count = parts((pair[1] - pair[0]) / p, disc.phases);
            phases.extend(
                (0..count).map(|k| pair[0] + (pair[1] - pair[0]) * k as f64 / count as f64),
            );
        }

        let mut path = Self {
            start: s_in,
            s_in: s_in - reach[0],
            s_out: s_out + reach[1],
            base_pitch: p,
            window,
            spur,
            cells: CellIndex::new(&s),
            s,
            inner,
            separation,
            phases,
            even_phases: disc.phases,
            windows: Vec::new(),
            first: vec![0],
        };
        let mut windows = Vec::new();
        if touch == Touch::Everywhere {
            for k in 0..path.phases.len() {
                path.windows_at(path.phases[k], &mut windows);
                path.first.push(windows.len());
            }
        }
        path.windows = windows;
        path
    }

    /// The nodes on the path itself.
    pub(crate) fn nodes(&self) -> &[f64] {
        &self.s[self.inner.clone()]
    }

    /// Values at all nodes from those on the path, of which the first and the last are held beyond it.
    pub(crate) fn hold<T: Clone>(&self, mut values: Vec<T>) -> Vec<T> {
        let Range { start, end } = self.inner.clone();
        if let ([first, ..], [.., last]) = (&*values, &*values) {
            let (first, last) = (first.clone(), last.clone());
            values.splice(0..0, std::iter::repeat_n(first, start));
            values.extend(std::iter::repeat_n(last, self.s.len() - end));
        }
        values
    }

    /// The gap at all nodes, mm, from that on the path; `memory` may be used for it.
    pub(crate) fn gap_beyond<'a>(&self, g: &'a [f64], memory: &'a mut Vec<f64>) -> &'a [f64] {
        let ([first, ..], [.., last], true) = (g, g, self.goes_beyond()) else {
            return g;
        };
        let (before, after) = (
            &self.separation[..self.inner.start],
            &self.separation[self.inner.end..],
        );
        memory.clear();
        memory.extend(before.iter().map(|separation| first + separation));
        memory.extend_from_slice(g);
        memory.extend(after.iter().map(|separation| last + separation));
        memory
    }

    /// Whether contact goes on beyond the ends of the path.
    pub(crate) fn goes_beyond(&self) -> bool {
        !self.separation.is_empty()
    }

    /// Values at the nodes on the path from those at all nodes.
    pub(crate) fn at_nodes<'a>(&self, values: &'a [f64]) -> &'a [f64] {
        &values[self.inner.clone()]
    }

    /// Distance from `s_in` to the front end of the first line at the phase `phi`, mm.
    pub(crate) fn first_end(&self, phi: f64) -> f64 {
        (phi + (self.start - self.s_in)).rem_euclid(self.base_pitch)
    }

    /// The windows of phase number `k`.
    pub(crate) fn windows(&self, k: usize) -> &[Window] {
        &self.windows[self.first[k]..self.first[k + 1]]
    }

    /// Appends the non-empty windows at the phase `phi`, in mm.
    pub(crate) fn windows_at(&self, phi: f64, out: &mut Vec<Window>) {
        self.spans_at(phi, |span| {
            out.push(Window {
                lo: self.place(span.lo),
                hi: self.place(span.hi),
                weight: span.weight,
                end: span.end,
            });
        });
    }

    /// Calls `found` for each of the non-empty windows at the phase `phi`, in mm.
    #[inline]
    pub(crate) fn spans_at(&self, phi: f64, mut found: impl FnMut(Span)) {
        let (length, p, w) = (self.s_out - self.s_in, self.base_pitch, self.window);
        let phi = self.first_end(phi);
        let last = ((length + w - phi) / p).ceil().max(0.0) as u64;
        // Pairs from `from` to `to` cover the whole path.
        let from = ((length - phi) / p).ceil().max(0.0) as u64;
        let to = ((w - phi) / p).floor();
        let whole = if to >= from as f64 {
            to as u64 + 1 - from
        } else {
            0
        };
        for j in (0..from).chain(from + whole..=last) {
            let end = self.s_in + phi + j as f64 * p;
            let (lo, hi) = ((end - w).max(self.s_in), end.min(self.s_out));
            if lo < hi {
                found(Span {
                    lo,
                    hi,
                    weight: 1.0,
                    end,
                });
            }
        }
        if whole > 0 {
            found(Span {
                lo: self.s_in,
                hi: self.s_out,
                weight: whole as f64,
                end: self.s_in + phi + from as f64 * p,
            });
        }
    }

    /// Whether every line has a window of its own, in which its places on the path and on the face are tied.
    pub(crate) fn has_lines(&self) -> bool {
        !self.spur && self.window < self.s_out - self.s_in + self.base_pitch
    }

    /// Finds the cell of a place on the path.
    pub(crate) fn place(&self, s: f64) -> Place {
        let cell = self.cells.cell(&self.s, s);
        let u = (s - self.s[cell]) / (self.s[cell + 1] - self.s[cell]);
        Place {
            s,
            cell,
            u: u.clamp(0.0, 1.0),
        }
    }

    /// A line of contact on this path.
    pub(crate) fn line(&self) -> Line {
        Line {
            length: self.s_out - self.s_in,
            window: self.window,
        }
    }
}

/// A line of contact that moves along the path. Its front end goes from 0, where the line begins to
/// touch, to `length + window`, where it has left; places are measured from the start of contact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// Length of the path.
    pub(crate) length: f64,
    /// Length of the line, along the path.
    pub(crate) window: f64,
}

impl Line {
    /// Share of the line that lies on the path, and the middle of that part.
    pub(crate) fn on_path(self, end: f64) -> (f64, f64) {
        let (lo, hi) = ((end - self.window).max(0.0), end.min(self.length));
        ((hi - lo) / self.window, 0.5 * (lo + hi))
    }

    /// The front end with which the middle is at `x`; the first one, where the line rests there
    /// because it covers the whole path.
    fn end_at(self, x: f64) -> f64 {
        let Self { length, window } = self;
        let half = 0.5 * window.min(length);
        if x < half {
            2.0 * x
        } else if x > length - half {
            2.0 * x - length + window
        } else {
            x + half
        }
    }
}

/// Sorts the places, drops those closer than `tolerance` to a neighbour, and keeps both ends exact.
fn merge_close(mut x: Vec<f64>, tolerance: f64, end: f64) -> Vec<f64> {
    x.retain(|&v| v <= 0.0 || (v > tolerance && v < end - tolerance));
    x.sort_by(f64::total_cmp);
    x.dedup_by(|later, earlier| *later - *earlier <= tolerance);
    x.push(end);
    x
}

/// Number of equal parts of a stretch that is the fraction `share` of the whole. The small
/// reduction keeps mirrored pairs, whose shares differ by rounding, on the same grid.
fn parts(share: f64, total: usize) -> usize {
    ((share * total as f64 - 1e-6).ceil().max(1.0) as usize).min(total)
}
