//! What a ledger holds, and what is known from it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::options::Options;
use crate::state::{Lease, Stream};
use crate::types::{Counts, Generation, Group, Kind, LeaseId, StreamId, WorkerStatus};
use crate::workers::Workers;

/// What means looking at all leases, or at all workers, is worked out so often: not for each of a
/// thousand workers that ask.
pub(crate) const SURVEY_PERIOD: Duration = Duration::from_secs(1);

/// What is missing, who computes it, and what became of it.
///
/// Every `now` is the time since one arbitrary origin. A `now` before an earlier one is harmless:
/// leases then run out a little early or late.
#[derive(Debug, Clone)]
pub struct Ledger<P> {
    pub(crate) options: Options,
    pub(crate) epoch: u64,
    /// The number of the newest lease.
    pub(crate) newest: u64,
    pub(crate) is_draining: bool,
    /// Until when nothing is leased, so that workers can say what they hold from before a restart.
    pub(crate) closed_until: Duration,
    pub(crate) streams: BTreeMap<StreamId, Stream<P>>,
    /// Streams that need nothing more: what their values depended on, and the end of what was wanted.
    pub(crate) settled: BTreeMap<StreamId, (Generation, u32)>,
    /// The streams from which something could be leased now.
    pub(crate) free: BTreeSet<StreamId>,
    /// The streams that wait after a failure, by the end of that.
    pub(crate) waiting: BTreeSet<(Duration, StreamId)>,
    pub(crate) quarantined: BTreeSet<StreamId>,
    /// How many streams of a group are neither settled nor quarantined.
    pub(crate) open: BTreeMap<Group, usize>,
    /// Whether a group was settled since somebody last asked.
    pub(crate) has_settled: bool,
    pub(crate) leases: BTreeMap<LeaseId, Lease>,
    /// The leases by the time at which they run out.
    pub(crate) expiries: BTreeSet<(Duration, LeaseId)>,
    /// The leases whose samples nobody else has, the oldest first.
    pub(crate) alone: BTreeSet<(Duration, LeaseId)>,
    /// Leases that ran out: their workers may only have slept.
    pub(crate) lapsed: BTreeMap<LeaseId, Lease>,
    pub(crate) workers: Workers,
    /// Seconds per weight of what was delivered, by kind.
    pub(crate) pace: BTreeMap<Kind, f64>,
    /// When it was worked out how long a lease is left to its worker alone, and how long that is.
    pub(crate) patience: Option<(Duration, Duration)>,
    /// When the slots of the workers were counted, and how many they were.
    pub(crate) slots: Option<(Duration, usize)>,
    pub(crate) delivered: u64,
    pub(crate) stale: u64,
}

impl<P: Clone> Ledger<P> {
    /// A ledger in which nothing is wanted. `epoch` tells it from the ones before a restart.
    pub fn new(options: Options, epoch: u64) -> Self {
        Self {
            options,
            epoch,
            newest: 0,
            is_draining: false,
            closed_until: Duration::ZERO,
            streams: BTreeMap::new(),
            settled: BTreeMap::new(),
            free: BTreeSet::new(),
            waiting: BTreeSet::new(),
            quarantined: BTreeSet::new(),
            open: BTreeMap::new(),
            has_settled: false,
            leases: BTreeMap::new(),
            expiries: BTreeSet::new(),
            alone: BTreeSet::new(),
            lapsed: BTreeMap::new(),
            workers: Workers::default(),
            pace: BTreeMap::new(),
            patience: None,
            slots: None,
            delivered: 0,
            stale: 0,
        }
    }

    /// The epoch given at the start.
    pub const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// How long a lease lasts.
    pub const fn lease_time(&self) -> Duration {
        self.options.lease
    }

    /// Leases nothing before this time, so that whoever holds something from before a restart can say
    /// so before others are given it.
    pub const fn close_until(&mut self, time: Duration) {
        self.closed_until = time;
    }

    /// Stops leasing, or goes on with it. What is held goes on, and is delivered as ever.
    pub const fn set_draining(&mut self, is_draining: bool) {
        self.is_draining = is_draining;
    }

    /// Whether nothing is leased for now.
    pub const fn is_draining(&self) -> bool {
        self.is_draining
    }

    // What is known.

    /// What was quarantined, each with the error that was the last straw.
    pub fn quarantined(&self) -> impl Iterator<Item = (StreamId, &str)> {
        self.quarantined.iter().filter_map(|&id| {
            let quarantined = self.streams.get(&id)?.quarantined.as_ref()?;
            Some((id, quarantined.error.as_str()))
        })
    }

    /// Whether a group was settled since this was last asked.
    pub const fn take_settled(&mut self) -> bool {
        std::mem::replace(&mut self.has_settled, false)
    }

    /// Whether a worker that asked now might get something.
    pub fn has_work(&self) -> bool {
        !self.free.is_empty() || !self.alone.is_empty()
    }

    /// Whether no lease is out.
    pub fn is_idle(&self) -> bool {
        self.leases.is_empty()
    }

    /// How much there is in which state.
    pub fn counts(&self) -> Counts {
        Counts {
            free: self.free.len(),
            waiting: self.waiting.len(),
            leased: self.leases.len(),
            delivered: self.delivered,
            quarantined: self.quarantined.len(),
            stale: self.stale,
        }
    }

    /// The registered workers, by name.
    pub fn workers(&self) -> impl Iterator<Item = WorkerStatus> {
        self.workers.known.iter().map(|(id, worker)| WorkerStatus {
            worker: id.clone(),
            host: worker.host.clone(),
            slots: worker.slots,
            leased: worker.held.len(),
            delivered: worker.delivered,
            failed: worker.failed,
            crashed: worker.crashed,
            suspended_until: worker.suspended_until,
            last_seen: worker.last_seen,
        })
    }
}
