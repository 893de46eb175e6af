//! What the board tells of itself.

use std::collections::BTreeMap;
use std::time::Duration;

use scheduler::Counts;

use super::Board;

/// What only the running coordinator knows.
#[derive(Debug, Clone, PartialEq)]
pub struct Live {
    /// The registered workers.
    pub workers: Vec<LiveWorker>,
    /// Jobs by state; done ones are forgotten and counted apart.
    pub counts: Counts,
    /// Jobs done since the start.
    pub done: u64,
    /// Samples stored per second, lately.
    pub samples_per_second: f64,
    /// What a run of an optimiser takes, in seconds, once one has ended.
    pub run_seconds: Option<f64>,
    /// Whether leasing was stopped.
    pub is_draining: bool,
}

/// A registered worker, as people see it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LiveWorker {
    /// Its name on the wire.
    pub id: String,
    /// Where it runs.
    pub host: String,
    /// How many jobs it computes at once.
    pub slots: u32,
    /// Jobs that it holds.
    pub leased: usize,
    /// Jobs that it has finished.
    pub completed: u64,
    /// Jobs that failed on it or died with it.
    pub failed: u64,
    /// How long ago it was heard of.
    pub silent_for: Duration,
    /// Whether it gets no jobs for a while, having failed too many.
    pub is_set_aside: bool,
}

impl Board {
    /// Why nothing, or nothing more, is being computed.
    #[must_use]
    pub fn explain(&self) -> Vec<String> {
        let now = self.now();
        let inner = self.lock();
        if inner.is_finished {
            return vec!["the campaign is finished".to_owned()];
        }
        let mut sentences: Vec<String> = inner
            .scheduler
            .explain(now)
            .iter()
            .map(ToString::to_string)
            .collect();
        if inner.batches.has_free() {
            sentences.push(
                "samples are waiting to be cut into jobs: every worker that asks gets some"
                    .to_owned(),
            );
        }
        sentences
    }

    /// What only the running coordinator knows.
    #[must_use]
    pub fn live(&self) -> Live {
        let now = self.now();
        let inner = self.lock();
        let of: BTreeMap<String, scheduler::WorkerStatus> = inner
            .scheduler
            .workers()
            .into_iter()
            .map(|status| (status.worker.0.clone(), status))
            .collect();
        let workers = inner.workers.iter().map(|(id, info)| {
            let status = of.get(id);
            LiveWorker {
                id: id.clone(),
                host: info.host.clone(),
                slots: info.slots,
                leased: status.map_or(0, |status| status.leased),
                completed: status.map_or(0, |status| status.completed),
                failed: status.map_or(0, |status| status.failed + status.crashed),
                silent_for: info.last_seen.elapsed(),
                is_set_aside: status
                    .and_then(|status| status.set_aside_until)
                    .is_some_and(|until| until > now),
            }
        });
        Live {
            workers: workers.collect(),
            counts: inner.scheduler.counts(),
            done: inner.done,
            samples_per_second: inner.pace.per_second(now),
            run_seconds: inner.posted_seconds,
            is_draining: inner.scheduler.is_draining(),
        }
    }
}
