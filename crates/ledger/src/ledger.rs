//! The state of a ledger and its queries.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::options::Options;
use crate::state::{Control, Lease, Stream};
use crate::types::{Counts, Generation, Group, Kind, LeaseId, StreamId, WorkerStatus};
use crate::workers::Workers;

/// Interval between full scans of the leases and workers. A scan per request would cost
/// O(workers²).
pub(crate) const SURVEY_PERIOD: Duration = Duration::from_secs(1);

/// The missing samples, the leases that cover them, and the outcome of each stream.
///
/// Every `now` is the time since one arbitrary origin. A `now` before an earlier one is harmless:
/// leases then expire a little early or late.
#[derive(Debug, Clone)]
pub struct Ledger<P> {
    pub(crate) options: Options,
    pub(crate) epoch: u64,
    /// The number of the newest lease.
    pub(crate) newest: u64,
    pub(crate) is_draining: bool,
    /// No lease is granted before this time, so that workers can first report the leases they hold
    /// from before a restart.
    pub(crate) closed_until: Duration,
    pub(crate) streams: BTreeMap<StreamId, Stream<P>>,
    /// Streams with no samples missing: the generation and the end of the samples wanted.
    pub(crate) settled: BTreeMap<StreamId, (Generation, u32)>,
    /// Streams from which work could be leased now.
    pub(crate) free: BTreeSet<StreamId>,
    /// Samples that wait after a failure, ordered by the end of the wait; `None` stands for a whole
    /// stream.
    pub(crate) waiting: BTreeSet<(Duration, StreamId, Option<u32>)>,
    pub(crate) quarantined: BTreeSet<StreamId>,
    /// Number of streams of a group that are neither settled nor quarantined.
    pub(crate) open: BTreeMap<Group, usize>,
    /// Whether a group was settled since the last call of [`Self::take_settled`].
    pub(crate) has_settled: bool,
    pub(crate) leases: BTreeMap<LeaseId, Lease>,
    /// The leases in order of expiry.
    pub(crate) expiries: BTreeSet<(Duration, LeaseId)>,
    /// The leases that share no samples with another lease, oldest first.
    pub(crate) alone: BTreeSet<(Duration, LeaseId)>,
    /// Expired leases. Their workers may still be alive, for example on a machine that slept.
    pub(crate) lapsed: BTreeMap<LeaseId, Lease>,
    pub(crate) workers: Workers,
    /// Number of successes and failures so far.
    pub(crate) turn: u64,
    /// The first failure since anything succeeded.
    pub(crate) fails_since: Option<Duration>,
    /// See [`Ledger::set_control`].
    pub(crate) control: Option<Control<P>>,
    /// Seconds per weight of delivered work, by kind of stream.
    pub(crate) pace: BTreeMap<Kind, f64>,
    /// Result of the last [`Self::patience_at`], with its time.
    pub(crate) patience: Option<(Duration, Duration)>,
    /// Result of the last [`Self::slots_present`], with its time.
    pub(crate) slots: Option<(Duration, usize)>,
    pub(crate) delivered: u64,
    pub(crate) stale: u64,
}

impl<P: Clone> Ledger<P> {
    /// Creates an empty ledger. `epoch` distinguishes it from those before a restart.
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
            turn: 0,
            fails_since: None,
            control: None,
            pace: BTreeMap::new(),
            patience: None,
            slots: None,
            delivered: 0,
            stale: 0,
        }
    }

    /// The epoch given to [`Self::new`].
    pub const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Duration of a lease.
    pub const fn lease_time(&self) -> Duration {
        self.options.lease
    }

    /// Grants no lease before this time, so that workers that hold leases from before a restart can
    /// report them first.
    pub const fn close_until(&mut self, time: Duration) {
        self.closed_until = time;
    }

    /// Stops or resumes granting leases. Leases already granted continue and are delivered as
    /// usual.
    pub const fn set_draining(&mut self, is_draining: bool) {
        self.is_draining = is_draining;
    }

    /// Whether granting leases is stopped.
    pub const fn is_draining(&self) -> bool {
        self.is_draining
    }

    // Queries.

    /// The quarantined streams, each with the error that quarantined it.
    pub fn quarantined(&self) -> impl Iterator<Item = (StreamId, &str)> {
        self.quarantined.iter().filter_map(|&id| {
            let quarantined = self.streams.get(&id)?.quarantined.as_ref()?;
            Some((id, quarantined.error.as_str()))
        })
    }

    /// The generation and the source of a stream that lacks samples.
    pub fn source(&self, stream: StreamId) -> Option<(Generation, &P)> {
        let stream = self.streams.get(&stream)?;
        Some((stream.generation, &stream.source))
    }

    /// Whether a group was settled since this function was last called.
    pub const fn take_settled(&mut self) -> bool {
        std::mem::replace(&mut self.has_settled, false)
    }

    /// Whether a worker that asked now might get a lease.
    pub fn has_work(&self) -> bool {
        !self.free.is_empty() || !self.alone.is_empty()
    }

    /// Whether no lease is held.
    pub fn is_idle(&self) -> bool {
        self.leases.is_empty()
    }

    /// Counts of streams, leases and results by state.
    pub fn counts(&self) -> Counts {
        Counts {
            free: self.free.len(),
            waiting: self.waiting_streams(),
            leased: self.leases.len(),
            delivered: self.delivered,
            quarantined: self.quarantined.len(),
            stale: self.stale,
        }
    }

    /// Number of streams that wait, or have samples that wait, after a failure.
    pub(crate) fn waiting_streams(&self) -> usize {
        let streams: BTreeSet<StreamId> = self.waiting.iter().map(|&(_, id, _)| id).collect();
        streams.len()
    }

    /// The host that a worker named; `None` if it is not registered.
    #[must_use]
    pub fn host(&self, worker: &crate::WorkerId) -> Option<&str> {
        Some(&self.workers.known.get(worker)?.host)
    }

    /// The registered workers, by name.
    pub fn workers(&self) -> impl Iterator<Item = WorkerStatus> {
        self.workers.known.iter().map(|(id, worker)| WorkerStatus {
            worker: id.clone(),
            host: worker.host.to_string(),
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
