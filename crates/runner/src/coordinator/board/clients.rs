//! The calls of clients: status, explanations, `drain` and `retry`.

use std::time::Duration;

use ledger::{StreamId, WorkerStatus};
use results::running::CoordinatorState;
use stages::names;
use tokio::time::Instant;

use super::{Board, Course};

impl Board {
    /// Frees the quarantined streams and returns them.
    pub fn retry(&self) -> Vec<StreamId> {
        let retried = self.change(|inner, _| {
            let retried = inner.ledger.retry();
            if !retried.is_empty() {
                inner.retries += 1;
                inner.course = Course::Work;
            }
            retried
        });
        // Wakes the engine, which counts the retried streams as settled.
        self.settled.notify_waiters();
        retried
    }

    /// Stops or resumes leasing. Returns the number of leases that workers hold.
    pub fn drain(&self, is_draining: bool) -> usize {
        self.change(|inner, _| {
            inner.ledger.set_draining(is_draining);
            inner.ledger.counts().leased
        })
    }

    /// Whether leasing was stopped.
    #[must_use]
    pub fn is_draining(&self) -> bool {
        self.lock().ledger.is_draining()
    }

    /// Whether a client has asked for the next revision within this time.
    #[must_use]
    pub fn is_watched(&self, within: Duration) -> bool {
        let last = self.lock().watched;
        last.is_some_and(|last| self.now().saturating_sub(last) < within)
    }

    /// Waits up to `wait` for a revision other than `seen` and returns the current one.
    pub async fn changed(&self, seen: u64, wait: Duration) -> u64 {
        self.lock().watched = Some(self.now());
        let deadline = Instant::now() + wait;
        loop {
            let changed = self.changed.notified();
            let revision = self.lock().revision;
            if revision != seen || tokio::time::timeout_at(deadline, changed).await.is_err() {
                return revision;
            }
        }
    }

    /// Returns the reasons why no job, or no further job, is being computed.
    #[must_use]
    pub fn explain(&self) -> Vec<String> {
        let inner = self.lock();
        if inner.course == Course::Finished {
            return vec!["the campaign is finished".to_owned()];
        }
        let reasons = inner.ledger.explain(self.now(), names::stream_name);
        reasons.iter().map(ToString::to_string).collect()
    }

    /// The part of the status that only the running coordinator knows.
    #[must_use]
    pub fn live(&self) -> CoordinatorState {
        let now = self.now();
        let inner = self.lock();
        let rate = |worker: WorkerStatus| {
            let rate = inner.rates.samples_per_second(&worker.worker, now);
            (worker, rate)
        };
        CoordinatorState {
            workers: inner.ledger.workers().map(rate).collect(),
            now,
            counts: inner.ledger.counts(),
            paces: inner.rates.paces(now),
            run_seconds: inner.rates.run_seconds(),
            searches: inner.searches.clone(),
            is_draining: inner.ledger.is_draining(),
        }
    }
}
