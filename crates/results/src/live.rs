//! What only a running coordinator knows.

use std::time::Duration;

use ledger::{Counts, WorkerStatus};
use serde::{Deserialize, Serialize};

/// After this long without a word, a worker is taken not to help any more.
const GONE: Duration = Duration::from_secs(15);

/// The state of a running coordinator at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Running {
    /// The registered workers.
    pub workers: Vec<WorkerStatus>,
    /// When this was so.
    pub now: Duration,
    /// Streams and leases by state.
    pub counts: Counts,
    /// Samples stored per second, lately.
    pub samples_per_second: f64,
    /// What a run of an optimiser takes, in seconds, once one has ended.
    pub run_seconds: Option<f64>,
    /// Whether leasing was stopped.
    pub is_draining: bool,
}

/// What the status shows of a running coordinator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Live {
    /// Designs, points and runs that wait; leases that are out; leases that were delivered since the
    /// start; designs, points and runs that were given up.
    pub jobs_queued: u64,
    /// See `jobs_queued`.
    pub jobs_leased: u64,
    /// See `jobs_queued`.
    pub jobs_done: u64,
    /// See `jobs_queued`.
    pub jobs_given_up: u64,
    /// Samples stored per second, lately.
    pub samples_per_second: f64,
    /// Seconds until the stage ends at the rate of late, while samples of the DoE, of a round of
    /// infill or of the optima are taken or optimisers run.
    pub eta_seconds: Option<f64>,
    /// Whether leasing was stopped.
    pub draining: bool,
    /// The workers.
    pub workers: Vec<Worker>,
}

/// A worker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Worker {
    /// Where it runs.
    pub host: String,
    /// How many leases it computes at once.
    pub slots: u32,
    /// Leases that it holds.
    pub leased: u64,
    /// Leases that it delivered.
    pub completed: u64,
    /// What failed on it or died with it.
    pub failed: u64,
    /// Seconds since it was heard of.
    pub silent_seconds: f64,
    /// Whether it gets nothing for a while, having failed too many.
    pub set_aside: bool,
}

impl Live {
    /// What the status shows of `running`. The time to go follows from the samples that the stage lacks,
    /// or from the runs of optimisers that are missing.
    #[must_use]
    pub fn of(running: Running, samples_left: Option<f64>, runs_left: Option<f64>) -> Self {
        let silent_for = |seen: Duration| running.now.saturating_sub(seen);
        let present = running.workers.iter();
        let present = present.filter(|worker| silent_for(worker.last_seen) < GONE);
        let slots: usize = present.map(|worker| worker.slots).sum();
        let rate = running.samples_per_second;
        let eta_seconds = match (runs_left, running.run_seconds) {
            (Some(runs), Some(seconds)) if slots > 0 => Some(runs * seconds / slots as f64),
            _ => samples_left
                .filter(|_| rate > 0.0)
                .map(|samples| samples / rate),
        };
        let count = |count: usize| count as u64;
        let workers = running.workers.into_iter().map(|worker| Worker {
            host: worker.host,
            slots: u32::try_from(worker.slots).unwrap_or(u32::MAX),
            leased: count(worker.leased),
            completed: worker.delivered,
            failed: worker.failed + worker.crashed,
            silent_seconds: silent_for(worker.last_seen).as_secs_f64(),
            set_aside: worker
                .suspended_until
                .is_some_and(|until| until > running.now),
        });
        Self {
            jobs_queued: count(running.counts.free + running.counts.waiting),
            jobs_leased: count(running.counts.leased),
            jobs_done: running.counts.delivered,
            jobs_given_up: count(running.counts.given_up),
            samples_per_second: rate,
            eta_seconds,
            draining: running.is_draining,
            workers: workers.collect(),
        }
    }
}
