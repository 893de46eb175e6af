//! The state of a stream and of a lease.

use std::collections::BTreeSet;
use std::ops::Range;
use std::time::Duration;

use crate::ranges::{common, join, subtract};
use crate::types::{Generation, History, LeaseId, Unit, WorkerId};

#[derive(Debug, Clone)]
pub(crate) struct Stream<P> {
    pub(crate) generation: Generation,
    pub(crate) source: P,
    /// Samples that are not stored: disjoint, ascending.
    pub(crate) missing: Vec<Range<u32>>,
    /// The part of `missing` that is on no lease.
    pub(crate) free: Vec<Range<u32>>,
    /// The end of the samples ever wanted.
    pub(crate) end: u32,
    /// The leases with units of this stream.
    pub(crate) leases: BTreeSet<LeaseId>,
    /// Whether the stream gets leases of its own, because a worker crashed on a lease that it
    /// shared.
    pub(crate) is_suspect: bool,
    /// Whether a lease of the stream ever expired.
    pub(crate) has_lapsed: bool,
    /// The worker processes that crashed on this stream alone.
    pub(crate) crashed_on_it: BTreeSet<WorkerId>,
    pub(crate) history: History,
    pub(crate) failures: u32,
    /// The end of the wait after a failure.
    pub(crate) waits_until: Option<Duration>,
    /// The reason for the quarantine.
    pub(crate) quarantined: Option<Quarantine>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Quarantine {
    pub(crate) error: String,
    /// Whether crashes were the reason. A late delivery takes back the crash of its worker.
    pub(crate) for_crashes: bool,
}

impl<P> Stream<P> {
    pub(crate) fn crashes(&self) -> usize {
        self.history.crashes + self.crashed_on_it.len()
    }

    /// Whether samples could be leased, apart from a wait after a failure.
    pub(crate) fn has_free(&self) -> bool {
        self.quarantined.is_none() && !self.free.is_empty()
    }

    pub(crate) fn take(&mut self, lease: LeaseId, samples: &Range<u32>) {
        subtract(&mut self.free, samples);
        self.leases.insert(lease);
    }

    /// Frees the missing part of `samples`, except what the other leases hold, given by `held`.
    pub(crate) fn free_again(&mut self, samples: &Range<u32>, held: &[Range<u32>]) {
        let mut freed = common(&self.missing, samples);
        for range in held {
            subtract(&mut freed, range);
        }
        for range in &freed {
            subtract(&mut self.free, range);
        }
        self.free.extend(freed);
        join(&mut self.free);
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Lease {
    pub(crate) worker: WorkerId,
    pub(crate) units: Vec<Unit>,
    pub(crate) granted: Duration,
    pub(crate) expires: Duration,
    pub(crate) started: bool,
    /// Expected duration, in seconds.
    pub(crate) seconds: f64,
}
