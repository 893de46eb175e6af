//! The registered workers and their suspensions.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use crate::options::Options;
use crate::types::{LeaseId, StreamId, WorkerId};

/// Maximum number of times that the length of a suspension doubles.
const MAX_DOUBLINGS: u32 = 5;

#[derive(Debug, Clone)]
pub(crate) struct Worker {
    pub(crate) host: Arc<str>,
    pub(crate) slots: usize,
    pub(crate) held: BTreeSet<LeaseId>,
    /// The streams that the worker failed since its last delivery.
    pub(crate) strikes: BTreeSet<StreamId>,
    /// The turn of its last success; see [`Ledger::turn`](crate::Ledger).
    pub(crate) succeeded_at: u64,
    pub(crate) suspended_until: Option<Duration>,
    /// Number of suspensions in a row, without a delivery in between.
    pub(crate) suspensions: u32,
    /// Whether the worker announced that it leaves. It gets no further leases, and its failures and
    /// crashes do not count.
    pub(crate) is_leaving: bool,
    /// Whether the worker was told that the work is done.
    pub(crate) was_dismissed: bool,
    pub(crate) delivered: u64,
    pub(crate) failed: u64,
    pub(crate) crashed: u64,
    pub(crate) last_seen: Duration,
    /// The last call that only a living worker makes.
    pub(crate) last_sign_of_life: Duration,
    /// Whether it has no connection and has not called since.
    pub(crate) is_disconnected: bool,
    /// Whether it counts as crashed and has not called since.
    pub(crate) has_crashed: bool,
}

impl Worker {
    pub(crate) fn new(host: &str, slots: usize) -> Self {
        Self {
            host: host.into(),
            slots: slots.max(1),
            held: BTreeSet::new(),
            strikes: BTreeSet::new(),
            succeeded_at: 0,
            suspended_until: None,
            suspensions: 0,
            is_leaving: false,
            was_dismissed: false,
            delivered: 0,
            failed: 0,
            crashed: 0,
            last_seen: Duration::ZERO,
            last_sign_of_life: Duration::ZERO,
            is_disconnected: false,
            has_crashed: false,
        }
    }

    /// Whether the worker gets no lease at `now`. After a suspension its next failure suspends it
    /// again.
    pub(crate) fn is_kept_from_work(&mut self, now: Duration) -> bool {
        if let Some(until) = self.suspended_until {
            if now < until {
                return true;
            }
            self.suspended_until = None;
        }
        self.is_leaving
    }

    pub(crate) fn is_suspended(&self, now: Duration) -> bool {
        self.suspended_until.is_some_and(|until| now < until)
    }

    pub(crate) fn has_delivered(&mut self, turn: u64) {
        self.delivered += 1;
        self.succeeded_at = turn;
        self.strikes.clear();
        self.suspensions = 0;
    }
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Workers {
    pub(crate) known: BTreeMap<WorkerId, Worker>,
}

impl Workers {
    /// Records that a worker called, and returns its state if it is registered.
    pub(crate) fn see(&mut self, worker: &WorkerId, now: Duration) -> Option<&mut Worker> {
        let state = self.known.get_mut(worker)?;
        state.last_seen = state.last_seen.max(now);
        Some(state)
    }

    /// Counts a failure against a worker. If another worker failed the same stream, the stream is
    /// at fault and the failure counts against neither. Returns whether the worker has failed too
    /// many.
    pub(crate) fn strike(
        &mut self,
        worker: &WorkerId,
        stream: StreamId,
        options: &Options,
        now: Duration,
    ) -> bool {
        let mut others = self.known.iter().filter(|(other, _)| *other != worker);
        if others.any(|(_, state)| state.strikes.contains(&stream)) {
            self.forgive(stream, options);
            return false;
        }
        let Some(state) = self.known.get_mut(worker) else {
            return false;
        };
        // The leases it held when it was suspended fail for the same reason.
        if state.is_suspended(now) {
            return false;
        }
        state.strikes.insert(stream);
        state.strikes.len() >= options.max_worker_strikes.max(1)
    }

    /// Suspends a worker and returns the end of the suspension.
    pub(crate) fn suspend(
        &mut self,
        worker: &WorkerId,
        options: &Options,
        now: Duration,
    ) -> Option<Duration> {
        let succeeded_at = self.known.get(worker)?.succeeded_at;
        let others_deliver = self.known.values().any(|w| w.succeeded_at > succeeded_at);
        let state = self.known.get_mut(worker)?;
        let doublings = match others_deliver {
            true => state.suspensions.min(MAX_DOUBLINGS),
            // The fault is not the worker's.
            false => 0,
        };
        let until = now.saturating_add(options.suspension.saturating_mul(1 << doublings));
        state.suspended_until = Some(until);
        state.suspensions = state.suspensions.saturating_add(1);
        Some(until)
    }

    /// Removes a stream's failure from all workers that it was counted against.
    pub(crate) fn forgive(&mut self, stream: StreamId, options: &Options) {
        let limit = options.max_worker_strikes.max(1);
        for state in self.known.values_mut() {
            if state.strikes.remove(&stream) && state.strikes.len() < limit {
                state.suspended_until = None;
            }
        }
    }

    /// The workers that called within `recently` and do not count as crashed.
    pub(crate) fn present(
        &self,
        recently: Duration,
        now: Duration,
    ) -> impl Iterator<Item = &Worker> {
        let is_present = move |worker: &&Worker| {
            !worker.has_crashed && now.saturating_sub(worker.last_seen) <= recently
        };
        self.known.values().filter(is_present)
    }
}
