//! What goes in and out of a ledger.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// What a stream is; leased in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A run of an optimiser: one result, or the evaluations of a generation.
    Run,
    /// A design of the DoE.
    Design,
    /// A point that gets samples of its own, as an optimum that is verified or an infill point.
    Point,
}

/// Something that needs samples, or one result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StreamId {
    /// What it is.
    pub kind: Kind,
    /// Which of its kind.
    pub index: u64,
}

impl StreamId {
    /// A design of the DoE, by its index.
    #[must_use]
    pub const fn design(index: u32) -> Self {
        Self {
            kind: Kind::Design,
            index: index as u64,
        }
    }

    /// A point, by its number.
    #[must_use]
    pub const fn point(number: u64) -> Self {
        Self {
            kind: Kind::Point,
            index: number,
        }
    }

    /// The run from a start of an approach, both by their numbers.
    #[must_use]
    pub const fn run(approach: u32, start: u32) -> Self {
        Self {
            kind: Kind::Run,
            index: (approach as u64) << 32 | start as u64,
        }
    }

    /// The approach and the start of a run.
    #[must_use]
    pub const fn run_parts(self) -> (u32, u32) {
        ((self.index >> 32) as u32, self.index as u32)
    }

    /// What it is settled together with.
    #[must_use]
    pub const fn group(self) -> Group {
        match self.kind {
            Kind::Run => Group::Runs(self.run_parts().0),
            Kind::Design => Group::Designs,
            Kind::Point => Group::Point(self.index),
        }
    }
}

/// As in file names and logs: `design-12`, `point-3`, `run-3-0`.
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

/// Streams that whoever waits for one of them waits for together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Group {
    /// The runs of one approach.
    Runs(u32),
    /// All designs of the DoE.
    Designs,
    /// One point.
    Point(u64),
}

/// The digest of everything that a stream's values depend on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Generation(pub u64);

/// Names a worker process.
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

/// Names a lease. No two leases ever have the same name: every start of a ledger has an epoch of its
/// own, in which numbers only grow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LeaseId {
    /// Which start of the ledger granted it.
    pub epoch: u64,
    /// Its number, from 1.
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
    /// What its values depend on.
    pub generation: Generation,
    /// The samples; of a run `0..1`, or evaluations.
    pub samples: Range<u32>,
}

/// What happened to a stream before a restart.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct History {
    /// How many worker processes fell silent over it, since it was last quarantined or retried.
    pub crashes: usize,
    /// How often it failed since then.
    pub failures: u32,
}

/// A stream that needs samples.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted<P> {
    /// The stream.
    pub stream: StreamId,
    /// What its values depend on.
    pub generation: Generation,
    /// What a worker needs to compute it.
    pub source: P,
    /// How many samples it is to have in all.
    pub samples: u32,
    /// Those of them that are not stored: disjoint, ascending.
    pub missing: Vec<Range<u32>>,
    /// What happened before a restart.
    pub history: History,
}

/// What a worker gets.
#[derive(Debug, Clone, PartialEq)]
pub struct Grant<P> {
    /// Under which name it holds it.
    pub lease: LeaseId,
    /// What it is to compute, each with what that takes.
    pub units: Vec<(Unit, P)>,
    /// How long that is expected to take, in seconds.
    pub seconds: f64,
    /// Whether somebody fell silent over some of it before: it should be known at once that this worker
    /// has begun with it, should it fall silent as well.
    pub announce: bool,
}

/// What a result is to the ledger.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accepted {
    /// Numbers of this stream, which it may still miss: to be stored.
    Yes,
    /// Nothing that anybody wants: of another generation, perhaps right once, or of no stream.
    Stale,
}

/// The end of a lease: what its worker brought is stored.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Delivery {
    /// What is stored.
    pub stored: Vec<Unit>,
    /// Streams that need no samples, as a design that cannot be simulated.
    pub refused: Vec<(StreamId, Generation)>,
    /// What failed, and why.
    pub failed: Vec<(StreamId, String)>,
    /// How long the worker took, in seconds.
    pub seconds: f64,
}

/// What followed from a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// The stream is tried again after this time.
    Retry(Duration),
    /// The stream was quarantined.
    GivenUp,
    /// It does not count: another failure has made the stream wait already, the lease has ended
    /// before, or the worker is leaving.
    Ignored,
}

/// A lease that ran out after its worker had begun, and so may have died of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vanished {
    /// The lease.
    pub lease: LeaseId,
    /// The worker.
    pub worker: WorkerId,
    /// The first of its streams.
    pub stream: StreamId,
    /// Whether the worker is blamed for nothing, since it held several streams and nobody knows
    /// which: each gets a lease of its own from now on.
    pub is_split: bool,
    /// Whether the stream was quarantined for it.
    pub quarantined: bool,
}

/// How much there is in which state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Streams with samples that wait for a worker.
    pub free: usize,
    /// Streams that wait after a failure.
    pub waiting: usize,
    /// Leases that are out.
    pub leased: usize,
    /// Leases that were delivered.
    pub delivered: u64,
    /// Streams that were quarantined.
    pub quarantined: usize,
    /// Results that were dropped because their stream had changed or gone.
    pub stale: u64,
}

/// What is known of a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkerStatus {
    /// The worker.
    pub worker: WorkerId,
    /// Where it runs, for people.
    pub host: String,
    /// How many leases it computes at once.
    pub slots: usize,
    /// Leases that it holds.
    pub leased: usize,
    /// Leases that it delivered.
    pub delivered: u64,
    /// Failures that it reported.
    pub failed: u64,
    /// Leases that ran out on it after it had begun.
    pub crashed: u64,
    /// Until when it gets nothing, if it is suspended.
    pub suspended_until: Option<Duration>,
    /// When it last called.
    pub last_seen: Duration,
}
