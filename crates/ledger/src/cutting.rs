//! Cutting samples into leases whose size follows the cost of a sample.
//!
//! A sample may take microseconds or hours. The cuts affect only the running time, because every
//! sample has its own random stream.

use std::collections::BTreeSet;
use std::ops::Range;
use std::time::Duration;

use crate::ledger::Ledger;
use crate::types::{Kind, StreamId, Unit, WorkerId};

/// Intended duration of a lease in seconds: much longer than a round trip, and short enough that
/// losing a worker loses little.
pub(crate) const TARGET_SECONDS: f64 = 1.0;
/// Expected duration in seconds of a one-sample lease while the cost of a long sample is unknown.
/// It is long enough that no worker prefetches a second lease.
pub(crate) const UNKNOWN_SECONDS: f64 = 2.0;
/// A lease gets at most the work left per slot divided by this, so that all slots finish together.
const PARTS_PER_SLOT: u64 = 3;
/// Cost of computing a design's criteria, in samples of the built-in simulator.
const DESIGN_WEIGHT: u64 = 20;
/// Cost of computing a design's criteria, in samples of a slow simulator, which is called for two states of a design.
/// With the weight of the built-in simulator, the first lease of one sample would make samples look cheap, and a few
/// workers would get all designs.
const LONG_DESIGN_WEIGHT: u64 = 2;
/// Maximum number of samples in a lease, whatever they cost: its results must pass even a slow
/// connection before the call times out.
const SAMPLES_MAX: u64 = 50_000;
/// Weight of the first leases, before the cost of a sample is known.
const FIRST_WEIGHT: u64 = DESIGN_WEIGHT + 10;

impl<P: Clone> Ledger<P> {
    /// Cost of computing a design's criteria, in samples.
    pub(crate) const fn design_weight(&self) -> u64 {
        match self.options.long_samples {
            true => LONG_DESIGN_WEIGHT,
            false => DESIGN_WEIGHT,
        }
    }

    /// Cost of units, in samples.
    pub(crate) fn weight(&self, units: &[Unit]) -> f64 {
        let weight = |unit: &Unit| unit.samples.len() as u64 + self.design_weight();
        units.iter().map(weight).sum::<u64>() as f64
    }

    /// The units that a worker gets next when the present workers have `slots` slots in total.
    /// Empty when nothing is free.
    pub(crate) fn cut(&self, worker: &WorkerId, slots: usize, now: Duration) -> Vec<Unit> {
        let failed = self.workers.known.get(worker).map(|state| &state.strikes);
        let has_failed = |id: &StreamId| failed.is_some_and(|failed| failed.contains(id));
        let Some(first) = self.first_free(worker, now) else {
            return Vec::new();
        };
        let target = self.target(first, slots);
        let mut units: Vec<Unit> = Vec::new();
        let (mut weight, mut samples) = (0, 0);
        for &id in self.free.range(first..) {
            let Some(stream) = self.streams.get(&id) else {
                continue;
            };
            let is_single = !stream.crashes.is_empty()
                || !stream.failing.is_empty()
                || id.kind != Kind::Design
                || !self.options.bundle;
            let is_left_out = has_failed(&id) || self.is_in_doubt(id);
            if !units.is_empty() && (is_single || id.kind != first.kind || is_left_out) {
                break;
            }
            let Some(range) = stream.free.first() else {
                continue;
            };
            let count = range.len() as u64;
            let room = target.saturating_sub(weight + self.design_weight());
            // Every lease of a design computes its criteria again unless they are known, so a design is split only
            // when it is too large for one lease.
            let take = if units.is_empty() {
                count.min(room.max(1))
            } else if count <= room && samples + count <= SAMPLES_MAX {
                count
            } else {
                break;
            };
            let take = take.min(SAMPLES_MAX);
            units.push(Unit {
                stream: id,
                generation: stream.generation,
                samples: range.start..range.start + take as u32,
            });
            weight += take + self.design_weight();
            samples += take;
            if is_single || weight >= target {
                break;
            }
        }
        units
    }

    /// The stream that a worker gets next. Isolated streams come last, since the worker must first have delivered
    /// everything else. Streams that the worker has failed come after others. With slow simulators, a design that
    /// another lease is analysing comes after other designs. Streams that only another machine may compute, and those
    /// in doubt, are left out.
    fn first_free(&self, worker: &WorkerId, now: Duration) -> Option<StreamId> {
        let state = self.workers.known.get(worker)?;
        let is_for_others = |id: &StreamId| {
            self.has_failed_enough(*id, &state.host) && self.other_machines(worker, now)
                || self.is_in_doubt(*id)
        };
        let rank = |id: StreamId| {
            let is_repeated = self.options.long_samples && self.is_being_analysed(id);
            (
                self.is_isolated(id),
                state.strikes.contains(&id),
                is_repeated,
            )
        };
        // Later points first: a round waits for its infill points, and the verification of optima, whose numbers are
        // lower, fills the time in which the round ends and the next one is decided.
        let first_point = StreamId::point(0);
        let points = self.free.range(first_point..).rev();
        let ordered = self.free.range(..first_point).chain(points);
        let mut best = None;
        for &id in ordered.filter(|id| !is_for_others(id)) {
            let rank = rank(id);
            if best.is_none_or(|(least, _)| rank < least) {
                best = Some((rank, id));
            }
            if rank == (false, false, false) {
                break;
            }
        }
        best.map(|(_, id)| id)
    }

    /// Whether a lease computes the analyses of a design, which another lease would compute again.
    fn is_being_analysed(&self, id: StreamId) -> bool {
        let stream = self.streams.get(&id);
        stream.is_some_and(|stream| !stream.is_analysed && !stream.leases.is_empty())
    }

    /// Maximum weight of a lease that begins with this stream.
    fn target(&self, first: StreamId, slots: usize) -> u64 {
        let affordable = match self.pace.get(&first.kind) {
            Some(pace) => (TARGET_SECONDS / pace).min(1e9) as u64,
            None if self.options.long_samples => 0,
            None => FIRST_WEIGHT,
        };
        // An estimate instead of an exact count, which would visit every stream: all free streams
        // are assumed to be as large as this one.
        let stream = self.streams.get(&first);
        let free = stream.into_iter().flat_map(|stream| &stream.free);
        let of_stream = free.map(Range::len).sum::<usize>() as u64;
        let left = self.free.len() as u64 * (of_stream + self.design_weight());
        let share = left / (PARTS_PER_SLOT * slots.max(1) as u64);
        // Splitting a cheap design only so that all slots finish together would compute its
        // criteria twice. The evaluations of a run share no such work, nor do the samples of a program whose
        // design is analysed.
        let is_analysed = stream.is_some_and(|stream| stream.is_analysed);
        let shares_nothing = first.kind == Kind::Run || self.options.long_samples && is_analysed;
        let whole = match shares_nothing {
            true => 0,
            false => of_stream + self.design_weight(),
        };
        affordable
            .min(share.max(whole))
            .max(self.design_weight() + 1)
    }

    /// The workers that hold leases.
    pub(crate) fn holders_of_leases(&self) -> BTreeSet<&WorkerId> {
        self.leases.values().map(|lease| &lease.worker).collect()
    }
}
