//! What goes in and out of a scheduler.

use std::fmt;
use std::time::Duration;

/// Names a job; the same for the same work after every restart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JobId(pub u64);

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Names a worker; the same for as long as its process lives.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WorkerId(pub String);

impl fmt::Display for WorkerId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// What is known of a job from before a restart.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct History {
    /// The newest attempt; 0 before the first.
    pub attempts: u32,
    /// How many workers went silent while they ran it, since it was last given up or retried.
    pub crashes: u32,
    /// How often it failed since then.
    pub failures: u32,
}

/// What sets a job apart from others.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Details {
    /// Jobs are granted by ascending priority.
    pub priority: i32,
    /// Jobs of one kin fail for one reason, as the samples of one design do: together they count as
    /// one when a worker is blamed. None for a job that is its own.
    pub kin: Option<JobId>,
    /// What happened before a restart.
    pub history: History,
}

/// A job, leased to a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grant<J> {
    /// The job.
    pub job: JobId,
    /// Which lease of the job this is, from 1.
    pub attempt: u32,
    /// What to do.
    pub payload: J,
}

/// A job that a worker says it holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Held {
    /// The job.
    pub job: JobId,
    /// The attempt under which it was granted.
    pub attempt: u32,
    /// Whether it is being computed, not only waiting for a slot.
    pub started: bool,
}

/// What a worker is to do with a job it holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Directive {
    /// Carry on.
    Continue,
    /// Stop: its result is no longer needed.
    Cancel,
}

/// What a result was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Completion {
    /// The first one of its job, which is done from now on.
    First,
    /// One more of a job that was done already.
    Duplicate,
    /// One of a job that was never added.
    Unknown,
}

/// What followed from a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// The job will be, or is being, tried again.
    Retry,
    /// The job was given up.
    Quarantined,
    /// The worker does not hold that attempt, as when a call is repeated: nothing changed.
    Stale,
}

/// A lease that ran out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Expired {
    /// The job.
    pub job: JobId,
    /// The attempt that ended.
    pub attempt: u32,
    /// The worker that held it.
    pub worker: WorkerId,
    /// Whether it had started, and so counts as a crash.
    pub crashed: bool,
    /// Whether the job was given up for it.
    pub quarantined: bool,
}

/// How many jobs are in which state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Waiting for a worker.
    pub queued: usize,
    /// Held by at least one worker.
    pub leased: usize,
    /// Done.
    pub done: usize,
    /// Given up.
    pub quarantined: usize,
}

/// What is known of a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkerStatus {
    /// The worker.
    pub worker: WorkerId,
    /// Jobs leased to it.
    pub leased: usize,
    /// Those of them that it reported as started.
    pub started: usize,
    /// First results it brought.
    pub completed: u64,
    /// Failures it reported.
    pub failed: u64,
    /// Leases of started jobs that ran out on it.
    pub crashed: u64,
    /// Until when it gets no jobs, if it was set aside.
    pub set_aside_until: Option<Duration>,
    /// When it last called.
    pub last_seen: Duration,
}
