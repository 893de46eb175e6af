//! Samples cut into leases whose size follows what they cost.
//!
//! A sample may take microseconds or hours. How samples are cut matters only for the time they take:
//! every one has a random stream of its own.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::ledger::Ledger;
use crate::types::{Kind, StreamId, Unit, WorkerId};

/// How long a lease should take, in seconds: much longer than a round trip, short enough that losing
/// a worker loses little.
pub(crate) const TARGET_SECONDS: f64 = 1.0;
/// How long a lease of one sample is taken to last where samples may be long, in seconds, before one
/// has come back: so long that nobody holds a second one.
pub(crate) const UNKNOWN_SECONDS: f64 = 2.0;
/// A lease gets at most this part of what is left per slot, so that all slots end together.
const PARTS_PER_SLOT: u64 = 3;
/// The criteria of a design cost about as much as this many samples of the built-in simulator.
pub(crate) const DESIGN_WEIGHT: u64 = 20;
/// The most samples of a lease, whatever they cost: even over a slow line its result must pass before
/// the call is given up.
const SAMPLES_MAX: u64 = 50_000;
/// The weight of the first leases, before anything is known about what a sample costs.
const FIRST_WEIGHT: u64 = DESIGN_WEIGHT + 10;

/// What units cost, in samples of the built-in simulator.
pub(crate) fn weight(units: &[Unit]) -> f64 {
    let weight = |unit: &Unit| unit.samples.len() as u64 + DESIGN_WEIGHT;
    units.iter().map(weight).sum::<u64>() as f64
}

impl<P: Clone> Ledger<P> {
    /// What a worker is to have next, while workers of `slots` slots in all are there; nothing when
    /// nothing is free.
    pub(crate) fn cut(&self, worker: &WorkerId, slots: usize) -> Vec<Unit> {
        let failed = self.workers.known.get(worker).map(|state| &state.strikes);
        let has_failed = |id: &StreamId| failed.is_some_and(|failed| failed.contains(id));
        let first = self.free.iter().find(|id| !has_failed(id));
        let Some(&first) = first.or_else(|| self.free.first()) else {
            return Vec::new();
        };
        let target = self.target(first, slots);
        let mut units: Vec<Unit> = Vec::new();
        let (mut weight, mut samples) = (0, 0);
        for &id in self.free.range(first..) {
            let Some(stream) = self.streams.get(&id) else {
                continue;
            };
            let is_alone = stream.is_suspect || id.kind != Kind::Design || !self.options.bundle;
            if !units.is_empty() && (is_alone || id.kind != first.kind || has_failed(&id)) {
                break;
            }
            let Some(range) = stream.free.first() else {
                continue;
            };
            let count = range.len() as u64;
            let room = target.saturating_sub(weight + DESIGN_WEIGHT);
            // A design is computed anew by every lease that samples it, so it is cut only when it is
            // too much for one.
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
            weight += take + DESIGN_WEIGHT;
            samples += take;
            if is_alone || weight >= target {
                break;
            }
        }
        units
    }

    /// How much a lease may weigh that begins with this stream.
    fn target(&self, first: StreamId, slots: usize) -> u64 {
        let affordable = match self.pace.get(&first.kind) {
            Some(pace) => (TARGET_SECONDS / pace).min(1e9) as u64,
            None if self.options.long_samples => 0,
            None => FIRST_WEIGHT,
        };
        // Counting exactly would cost more than it is worth: all that is free is taken to be as large
        // as this one.
        let free = self.streams.get(&first).map(|stream| &stream.free);
        let of_stream = free.map_or(0, |free| free.iter().map(Range::len).sum::<usize>()) as u64;
        let left = self.free.len() as u64 * (of_stream + DESIGN_WEIGHT);
        let share = left / (PARTS_PER_SLOT * slots.max(1) as u64);
        // Cutting a cheap design only to end at the same moment would compute its criteria twice. The
        // evaluations of a run have nothing in common.
        let whole = match first.kind {
            Kind::Run => 0,
            Kind::Design | Kind::Point => of_stream + DESIGN_WEIGHT,
        };
        affordable.min(share.max(whole)).max(DESIGN_WEIGHT + 1)
    }

    /// The workers that hold something.
    pub(crate) fn holders_of_leases(&self) -> BTreeSet<&WorkerId> {
        self.leases.values().map(|lease| &lease.worker).collect()
    }
}
