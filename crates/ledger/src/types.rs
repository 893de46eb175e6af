//! Identifiers, inputs and outputs of a ledger.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Kinds of stream, in the order in which they are leased.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A run of an optimiser: one result, or the evaluations of a generation.
    Run,
    /// A design of the DoE.
    Design,
    /// A point with samples of its own, such as an optimum to verify or an infill point.
    Point,
}

/// Where the kind begins in [`StreamId::key`].
const KIND_SHIFT: u32 = 56;

/// Identifies a stream: a source of samples, or of one result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StreamId {
    /// The kind of stream.
    pub kind: Kind,
    /// The number within its kind.
    pub index: u64,
}

impl StreamId {
    /// The stream of a design of the DoE.
    #[must_use]
    pub const fn design(index: u32) -> Self {
        Self {
            kind: Kind::Design,
            index: index as u64,
        }
    }

    /// The stream of a point.
    #[must_use]
    pub const fn point(number: u64) -> Self {
        Self {
            kind: Kind::Point,
            index: number,
        }
    }

    /// The stream of a run: one start of one approach.
    #[must_use]
    pub const fn run(approach: u32, start: u32) -> Self {
        Self {
            kind: Kind::Run,
            index: (approach as u64) << 32 | start as u64,
        }
    }

    /// The numbers of a run's approach and start.
    #[must_use]
    pub const fn run_parts(self) -> (u32, u32) {
        ((self.index >> 32) as u32, self.index as u32)
    }

    /// The stream as one number, by which the store knows it. The upper 8 bits hold the kind. The lower bits hold the
    /// index of a design or a point, or a run's approach in 24 bits and its start in 32. A design's key is its index.
    #[must_use]
    pub const fn key(self) -> u64 {
        let kind = match self.kind {
            Kind::Design => 0,
            Kind::Point => 1,
            Kind::Run => 2,
        };
        kind << KIND_SHIFT | self.index
    }

    /// The stream with this key; `None` if no stream has it.
    #[must_use]
    pub const fn from_key(key: u64) -> Option<Self> {
        let kind = match key >> KIND_SHIFT {
            0 => Kind::Design,
            1 => Kind::Point,
            2 => Kind::Run,
            _ => return None,
        };
        let index = key & ((1 << KIND_SHIFT) - 1);
        Some(Self { kind, index })
    }

    /// The group that the stream is settled with.
    #[must_use]
    pub const fn group(self) -> Group {
        match self.kind {
            Kind::Run => Group::Runs(self.run_parts().0),
            Kind::Design => Group::Designs,
            Kind::Point => Group::Point(self.index),
        }
    }
}

/// The name in rows of the store: `design-12`, `point-3`, `run-3-0`.
impl fmt::Display for StreamId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            Kind::Run => {
                let (approach, start) = self.run_parts();
                write!(f, "run-{approach}-{start}")
            }
            Kind::Design => write!(f, "design-{}", self.index),
            Kind::Point => write!(f, "point-{}", self.index),
        }
    }
}

/// A set of streams that are awaited together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Group {
    /// The runs of one approach.
    Runs(u32),
    /// All designs of the DoE.
    Designs,
    /// One point.
    Point(u64),
}

/// The digest of everything that the values of a stream depend on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Generation(pub u64);

/// The name of a worker process.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WorkerId(Arc<str>);

impl From<&str> for WorkerId {
    fn from(name: &str) -> Self {
        Self(name.into())
    }
}

impl WorkerId {
    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for WorkerId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Identifies a lease, uniquely across restarts: every start of a ledger has its own epoch, within
/// which the numbers increase.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LeaseId {
    /// The start of the ledger that granted the lease.
    pub epoch: u64,
    /// The number of the lease, from 1.
    pub number: u64,
}

impl fmt::Display for LeaseId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08x}-{}", self.epoch >> 32, self.number)
    }
}

/// A range of one stream's samples.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unit {
    /// The stream.
    pub stream: StreamId,
    /// The generation of the stream's values.
    pub generation: Generation,
    /// The samples. For a run, `0..1` or the evaluations of a generation.
    pub samples: Range<u32>,
}

/// A crash in a stream's [`History`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CrashRecord {
    /// Whether the worker held no other stream. Only such a crash counts against the stream.
    pub is_alone: bool,
    /// The first sample that the worker held of the stream.
    pub first: u32,
}

/// Crashes and failures of a stream before a restart.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct History {
    /// The crashes of workers that held the stream, since it was last quarantined or retried.
    pub crashes: BTreeMap<WorkerId, CrashRecord>,
    /// Failures since then.
    pub failures: u32,
}

/// A stream that needs samples.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamDemand<P> {
    /// The stream.
    pub stream: StreamId,
    /// The generation of its values.
    pub generation: Generation,
    /// The data that a worker needs to compute it.
    pub source: P,
    /// The number of samples wanted in total.
    pub samples: u32,
    /// Those of the wanted samples that are not stored: disjoint, ascending.
    pub missing: Vec<Range<u32>>,
    /// Crashes and failures before a restart.
    pub history: History,
    /// Whether a failure that repeats while others succeed becomes a result of the stream, reported as
    /// [`Failure::Conclusive`], instead of quarantining it.
    pub is_tolerant: bool,
    /// Whether no lease begins with the analyses of a design: they are known, or there are none.
    pub is_analysed: bool,
}

/// A lease as granted to a worker.
#[derive(Debug, Clone, PartialEq)]
pub struct Grant<P> {
    /// The id of the lease.
    pub lease: LeaseId,
    /// The units to compute, each with the data that a worker needs for it.
    pub units: Vec<(Unit, P)>,
    /// Expected duration, in seconds.
    pub seconds: f64,
    /// Whether the lease is a control: its unit was computed before, and its result tells only
    /// whether the worker can compute anything.
    pub is_control: bool,
}

/// The ledger's verdict on a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Samples of a known stream and its present generation, to be stored.
    Yes,
    /// A result of another generation, or of no known stream.
    Stale,
}

/// The outcome of a lease, after the results are stored.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Delivery {
    /// The stored units.
    pub stored: Vec<Unit>,
    /// Streams that need no samples, such as designs that are not simulable.
    pub refused: Vec<(StreamId, Generation)>,
    /// The failures.
    pub failed: Vec<FailureReport>,
    /// Whether the worker brought any sample or refusal, even one that is not stored because it is stale.
    pub has_answers: bool,
    /// The time that the worker took, in seconds.
    pub seconds: f64,
}

/// A failure that a worker reports.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailureReport {
    /// The stream.
    pub stream: StreamId,
    /// The sample or evaluation that failed. `None` for a failure of the stream as a whole, such as
    /// of the analyses of a design.
    pub sample: Option<u32>,
    /// The error.
    pub error: String,
    /// Whether the result differs from one that another worker had delivered. Either may be wrong, so the
    /// failure counts against the stream alone.
    pub is_contradiction: bool,
}

/// The consequence of a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// The sample, or the stream as a whole, is tried again after this wait.
    Retry(Duration),
    /// The failure is a result of a [tolerant](StreamDemand::is_tolerant) stream: its attempts are used
    /// up while others succeed. The caller stores the result and
    /// [settles](crate::Ledger::conclude) it; until then it is tried again.
    Conclusive,
    /// The stream was quarantined.
    Quarantined,
    /// The failure does not count: the sample already waits after another failure, its stream is
    /// quarantined, the lease ended before or was a control, or the worker is leaving.
    Ignored,
}

/// The crash of a worker, with a stream that the worker held.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Crash {
    /// The lease.
    pub lease: LeaseId,
    /// The worker.
    pub worker: WorkerId,
    /// The stream.
    pub stream: StreamId,
    /// The part of the crash that goes into the stream's history.
    pub record: CrashRecord,
    /// Whether the crash quarantined the stream.
    pub quarantined: bool,
}

/// Counts by state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Streams with free samples.
    pub free: usize,
    /// Streams that wait after a failure.
    pub waiting: usize,
    /// Leases held by workers.
    pub leased: usize,
    /// Leases that were delivered.
    pub delivered: u64,
    /// Streams that were quarantined.
    pub quarantined: usize,
    /// Results dropped because their stream had changed or was forgotten.
    pub stale: u64,
}

/// The state of a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkerStatus {
    /// The worker.
    pub worker: WorkerId,
    /// The machine and the process it runs as, `MACHINE:PROCESS`.
    pub host: String,
    /// Number of leases it computes at once.
    pub slots: usize,
    /// Leases that it holds.
    pub leased: usize,
    /// Leases that it delivered with at least one result, controls included.
    pub delivered: u64,
    /// Failures that it reported.
    pub failed: u64,
    /// Number of times that it crashed while it held leases.
    pub crashed: u64,
    /// The end of its suspension, if it is suspended.
    pub suspended_until: Option<Duration>,
    /// When it last called.
    pub last_seen: Duration,
}
