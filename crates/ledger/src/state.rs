//! The state of a stream, a lease and a control.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use crate::ranges::{common, join, subtract};
use crate::types::{CrashRecord, Generation, LeaseId, Unit, WorkerId};

#[derive(Debug, Clone)]
pub(crate) struct Stream<P> {
    pub(crate) generation: Generation,
    pub(crate) source: P,
    /// Samples that are not stored: disjoint, ascending.
    pub(crate) missing: Vec<Range<u32>>,
    /// The part of `missing` that is on no lease and does not wait after a failure of its own.
    pub(crate) free: Vec<Range<u32>>,
    /// The end of the samples ever wanted.
    pub(crate) end: u32,
    /// The leases with units of this stream.
    pub(crate) leases: BTreeSet<LeaseId>,
    /// The crashes of workers that held the stream, which then gets leases of its own.
    pub(crate) crashes: BTreeMap<WorkerId, CrashRecord>,
    /// Failures before a restart. They count for the sample that fails next.
    pub(crate) earlier_failures: u32,
    /// See [`StreamDemand::is_tolerant`](crate::StreamDemand::is_tolerant).
    pub(crate) is_tolerant: bool,
    /// See [`StreamDemand::is_analysed`](crate::StreamDemand::is_analysed).
    pub(crate) is_analysed: bool,
    /// The missing samples that have failed, and under `None` the failures of the whole stream.
    pub(crate) failing: BTreeMap<Option<u32>, FailedAttempts>,
    /// The reason for the quarantine.
    pub(crate) quarantined: Option<Quarantine>,
}

/// The failed attempts of a sample, or of a stream as a whole.
#[derive(Debug, Clone, Default)]
pub(crate) struct FailedAttempts {
    /// Number of failed attempts.
    pub(crate) attempts: u32,
    /// Number of those that count against the sample.
    pub(crate) counted: u32,
    /// The machines of the workers that failed.
    pub(crate) machines: BTreeSet<Arc<str>>,
    /// The turn of the last one; see [`Ledger::turn`](crate::Ledger).
    pub(crate) turn: u64,
    /// The end of the wait after it.
    pub(crate) waits_until: Option<Duration>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Quarantine {
    pub(crate) error: String,
    /// Whether crashes were the reason. Such a quarantine ends if one of the workers delivers late or calls again,
    /// since its crash is then taken back.
    pub(crate) for_crashes: bool,
}

impl<P> Stream<P> {
    /// Whether samples can be leased.
    pub(crate) fn has_free(&self) -> bool {
        self.quarantined.is_none() && !self.free.is_empty() && !self.waits()
    }

    /// Whether the whole stream waits after a failure.
    pub(crate) fn waits(&self) -> bool {
        let whole = self.failing.get(&None);
        whole.is_some_and(|failing| failing.waits_until.is_some())
    }

    /// The samples that wait after a failure of their own.
    pub(crate) fn waiting(&self) -> impl Iterator<Item = Range<u32>> {
        let waiting = self.failing.iter();
        let waiting = waiting.filter(|(_, failing)| failing.waits_until.is_some());
        waiting.filter_map(|(sample, _)| sample.map(|sample| sample..sample + 1))
    }

    /// The turn of the last failure that a lease of these samples would repeat.
    pub(crate) fn failed_at(&self, samples: &Range<u32>) -> Option<u64> {
        let of = |sample: Option<u32>| self.failing.get(&sample).map(|failing| failing.turn);
        of(None).max(of(Some(samples.start)))
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
        for sample in self.waiting() {
            subtract(&mut freed, &sample);
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
    /// Whether the lease is a control, which has no units of its own: see [`Ledger::control`].
    ///
    /// [`Ledger::control`]: crate::Ledger
    pub(crate) is_control: bool,
}

/// A unit that a worker has computed.
#[derive(Debug, Clone)]
pub(crate) struct Control<P> {
    pub(crate) unit: Unit,
    pub(crate) source: P,
}
