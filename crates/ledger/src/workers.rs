//! Who the workers are, and which of them get nothing for a while.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::options::Options;
use crate::types::{LeaseId, StreamId, WorkerId};

/// How often the time of a suspension doubles.
const MAX_DOUBLINGS: u32 = 5;
/// How often in a row a worker is suspended when nobody else is there to work: by then it is the
/// streams that are to blame, or what all workers need, and waiting does not mend it.
const MAX_ALONE: u32 = 3;

#[derive(Debug, Clone)]
pub(crate) struct Worker {
    pub(crate) host: String,
    pub(crate) slots: usize,
    pub(crate) held: BTreeSet<LeaseId>,
    /// The streams that it failed since it last delivered anything.
    pub(crate) strikes: BTreeSet<StreamId>,
    pub(crate) suspended_until: Option<Duration>,
    /// In a row, without delivering in between.
    pub(crate) suspensions: u32,
    /// It said that it leaves: it gets nothing more, and is blamed for nothing.
    pub(crate) is_leaving: bool,
    /// It was told that there is nothing more to do.
    pub(crate) was_dismissed: bool,
    pub(crate) delivered: u64,
    pub(crate) failed: u64,
    pub(crate) crashed: u64,
    pub(crate) last_seen: Duration,
}

impl Worker {
    pub(crate) fn new(host: &str, slots: usize) -> Self {
        Self {
            host: host.to_owned(),
            slots: slots.max(1),
            held: BTreeSet::new(),
            strikes: BTreeSet::new(),
            suspended_until: None,
            suspensions: 0,
            is_leaving: false,
            was_dismissed: false,
            delivered: 0,
            failed: 0,
            crashed: 0,
            last_seen: Duration::ZERO,
        }
    }

    /// Whether it gets nothing at `now`; the end of a suspension is a fresh start, but for the length
    /// of the next one.
    pub(crate) fn is_kept_from_work(&mut self, now: Duration) -> bool {
        if let Some(until) = self.suspended_until {
            if now < until {
                return true;
            }
            self.suspended_until = None;
            self.strikes.clear();
        }
        self.is_leaving
    }

    pub(crate) fn is_suspended(&self, now: Duration) -> bool {
        self.suspended_until.is_some_and(|until| now < until)
    }

    pub(crate) fn has_delivered(&mut self) {
        self.delivered += 1;
        self.strikes.clear();
        self.suspensions = 0;
    }
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Workers {
    pub(crate) known: BTreeMap<WorkerId, Worker>,
}

impl Workers {
    /// Notes a sign of life.
    pub(crate) fn see(&mut self, worker: &WorkerId, now: Duration) -> Option<&mut Worker> {
        let state = self.known.get_mut(worker)?;
        state.last_seen = state.last_seen.max(now);
        Some(state)
    }

    /// Counts a failure against a worker, unless others failed the same stream, which then is to
    /// blame. Returns until when the worker is suspended, if that is news.
    pub(crate) fn strike(
        &mut self,
        worker: &WorkerId,
        stream: StreamId,
        options: &Options,
        now: Duration,
    ) -> Option<Duration> {
        let mut others = self.known.iter().filter(|(other, _)| *other != worker);
        if others.any(|(_, state)| state.strikes.contains(&stream)) {
            self.forgive(stream, options);
            return None;
        }
        let mut others = self.known.iter().filter(|(other, _)| *other != worker);
        let is_at_work = |state: &Worker| {
            let silence = now.saturating_sub(state.last_seen);
            !state.is_leaving && !state.is_suspended(now) && silence <= options.lease
        };
        let is_alone = !others.any(|(_, state)| is_at_work(state));
        let state = self.known.get_mut(worker)?;
        // Whatever it held when it was suspended fails for the same reason.
        if state.is_suspended(now) {
            return None;
        }
        state.strikes.insert(stream);
        if state.strikes.len() < options.max_worker_strikes.max(1) {
            return None;
        }
        if is_alone && state.suspensions >= MAX_ALONE {
            state.strikes.clear();
            return None;
        }
        let doublings = state.suspensions.min(MAX_DOUBLINGS);
        let until = now.saturating_add(options.suspension.saturating_mul(1 << doublings));
        state.suspended_until = Some(until);
        state.suspensions = state.suspensions.saturating_add(1);
        Some(until)
    }

    /// Holds a stream against none of those that failed it.
    pub(crate) fn forgive(&mut self, stream: StreamId, options: &Options) {
        let limit = options.max_worker_strikes.max(1);
        for state in self.known.values_mut() {
            if state.strikes.remove(&stream) && state.strikes.len() < limit {
                state.suspended_until = None;
            }
        }
    }

    /// Those that called within `recently`.
    pub(crate) fn present(
        &self,
        recently: Duration,
        now: Duration,
    ) -> impl Iterator<Item = &Worker> {
        let is_present = move |worker: &&Worker| now.saturating_sub(worker.last_seen) <= recently;
        self.known.values().filter(is_present)
    }
}
