//! Functions of the mesh phase, and their greatest values where a place on the path is in contact.

use std::collections::VecDeque;

use crate::corrections::Lead;
use crate::path::Path;

/// More than the relative error of a value between two phases.
const INTERPOLATION: f64 = 0.02;

/// A periodic function of the phase, given at some phases of the first period. Phases of later periods
/// continue their numbering.
pub(crate) struct PeriodicFunction<'a> {
    pub(crate) phases: &'a [f64],
    pub(crate) values: &'a [f64],
    pub(crate) period: f64,
}

impl PeriodicFunction<'_> {
    fn phase(&self, k: usize) -> f64 {
        let count = self.phases.len();
        if k < count {
            return self.phases[k];
        }
        (k / count) as f64 * self.period + self.phases[k % count]
    }

    fn value(&self, k: usize) -> f64 {
        let count = self.values.len();
        self.values[if k < count { k } else { k % count }]
    }

    /// The value at `phi`, linearly between the phases `k` and `k + 1`, to which `k` is moved up.
    pub(crate) fn between(&self, phi: f64, k: &mut usize) -> f64 {
        while self.phase(*k + 1) <= phi {
            *k += 1;
        }
        let (x0, x1) = (self.phase(*k), self.phase(*k + 1));
        let (v0, v1) = (self.value(*k), self.value(*k + 1));
        v0 + (v1 - v0) * ((phi - x0) / (x1 - x0)).clamp(0.0, 1.0)
    }
}

impl Path {
    /// The greatest value of a function of the phase over the phases at which each node on the path is in
    /// contact, less the gap of the face at the place where it is touched then. `function` is
    /// interpolated linearly between its phases unless `at` gives its value at any phase. `window` is the
    /// length of a line.
    pub(crate) fn greatest_in_contact(
        &self,
        function: &PeriodicFunction<'_>,
        window: f64,
        lead: Lead,
        mut at: Option<&mut dyn FnMut(f64) -> f64>,
    ) -> Vec<f64> {
        // A spur line touches over the whole face at once, where the gap is least too.
        let (lead, least) = if self.spur {
            (Lead::default(), lead.least())
        } else {
            (lead, 0.0)
        };
        // Ranges of phases start later from node to node, so each phase enters and leaves once. If the
        // gap is the same all along the face, a phase is dropped once a later one reaches its value.
        let mut inside: VecDeque<usize> = VecDeque::new();
        let (mut entered, mut before_start, mut before_end) = (0, 0, 0);
        let mut greatest = Vec::with_capacity(self.nodes().len());
        for s in self.nodes() {
            let mut start = s - self.start;
            let mut end = start + window;
            // The corner of a helical tooth touches before the pair takes load; a spur tooth has
            // no such corner, so it is judged with its whole line in contact.
            if self.spur {
                start = start.max(window);
                end = end.min(self.s_out - self.start);
            }
            while function.phase(entered) < end {
                let value = function.value(entered);
                while inside
                    .back()
                    .is_some_and(|&k| lead.is_even() && function.value(k) <= value)
                {
                    inside.pop_back();
                }
                inside.push_back(entered);
                entered += 1;
            }
            while inside.front().is_some_and(|&k| function.phase(k) <= start) {
                inside.pop_front();
            }
            let mut most = f64::NEG_INFINITY;
            if !lead.is_even() {
                for &k in &inside {
                    let z = (function.phase(k) - start) / window;
                    most = most.max(function.value(k) - lead.gap(z));
                }
            } else if let Some(&k) = inside.front() {
                most = function.value(k);
            }
            // Both ends of the line are at an end of the face.
            let ends = [
                (start, &mut before_start, lead.gap(0.0)),
                (end, &mut before_end, lead.gap(1.0)),
            ];
            for (phi, before, gap) in ends {
                let value = function.between(phi, before);
                // A value far below the greatest so far stays below it without the error of the interpolation.
                let value = match &mut at {
                    Some(at) if value + INTERPOLATION * value.abs() > most + gap => at(phi),
                    _ => value,
                };
                most = most.max(value - gap);
            }
            greatest.push(most - least);
        }
        greatest
    }
}
