//! Transitions of streams: stored, failed, quarantined, reopened.

use std::time::Duration;

use crate::ledger::Ledger;
use crate::ranges::subtract;
use crate::state::Quarantine;
use crate::types::{Failure, Generation, LeaseId, StreamId, Unit, WorkerId};

/// Factor by which each wait after a failure is longer than the one before.
const RETRY_GROWTH: u32 = 4;

impl<P: Clone> Ledger<P> {
    /// Updates the set of free streams after any change to a stream.
    pub(crate) fn file(&mut self, id: StreamId) {
        let stream = self.streams.get(&id);
        if stream.is_some_and(|stream| stream.has_free() && stream.waits_until.is_none()) {
            self.free.insert(id);
        } else {
            self.free.remove(&id);
        }
    }

    /// Ends the waits after failures that are due.
    pub(crate) fn wake(&mut self, now: Duration) {
        while let Some(&(until, id)) = self.waiting.first()
            && until <= now
        {
            self.waiting.pop_first();
            if let Some(stream) = self.streams.get_mut(&id) {
                stream.waits_until = None;
            }
            self.file(id);
        }
    }

    pub(crate) fn stored(&mut self, unit: &Unit) {
        let Some(stream) = self.streams.get_mut(&unit.stream) else {
            return;
        };
        if stream.generation != unit.generation {
            return;
        }
        subtract(&mut stream.missing, &unit.samples);
        subtract(&mut stream.free, &unit.samples);
        if stream.missing.is_empty() {
            let end = stream.end;
            self.settle(unit.stream, end);
        } else {
            self.file(unit.stream);
            self.prune(&self.holders(unit.stream));
        }
    }

    pub(crate) fn settle(&mut self, id: StreamId, end: u32) {
        if let Some(generation) = self.remove(id) {
            self.settled.insert(id, (generation, end));
        }
    }

    /// Removes a stream from all collections and from its leases.
    pub(crate) fn remove(&mut self, id: StreamId) -> Option<Generation> {
        let stream = self.streams.remove(&id)?;
        self.file(id);
        if let Some(until) = stream.waits_until {
            self.waiting.remove(&(until, id));
        }
        if !self.quarantined.remove(&id) {
            self.close(id);
        }
        let holders: Vec<LeaseId> = stream.leases.into_iter().collect();
        self.prune(&holders);
        Some(stream.generation)
    }

    pub(crate) fn close(&mut self, id: StreamId) {
        let open = self.open.entry(id.group()).or_default();
        *open -= 1;
        if *open == 0 {
            self.open.remove(&id.group());
            self.has_settled = true;
        }
    }

    pub(crate) fn quarantine(&mut self, id: StreamId, error: String, for_crashes: bool) {
        let Some(stream) = self.streams.get_mut(&id) else {
            return;
        };
        stream.quarantined = Some(Quarantine { error, for_crashes });
        if let Some(until) = stream.waits_until.take() {
            self.waiting.remove(&(until, id));
        }
        self.quarantined.insert(id);
        self.close(id);
        self.file(id);
        self.prune(&self.holders(id));
    }

    pub(crate) fn reopen(&mut self, id: StreamId) {
        if !self.quarantined.remove(&id) {
            return;
        }
        *self.open.entry(id.group()).or_default() += 1;
        if let Some(stream) = self.streams.get_mut(&id) {
            stream.quarantined = None;
        }
        self.file(id);
    }

    pub(crate) fn fail(
        &mut self,
        worker: &WorkerId,
        id: StreamId,
        error: &str,
        now: Duration,
    ) -> (Failure, Option<Duration>) {
        let ignored = (Failure::Ignored, None);
        let Some(state) = self.workers.known.get_mut(worker) else {
            return ignored;
        };
        let Some(stream) = self.streams.get_mut(&id) else {
            return ignored;
        };
        if state.is_leaving || stream.quarantined.is_some() {
            return ignored;
        }
        state.failed += 1;
        let suspended = self.workers.strike(worker, id, &self.options, now);
        if stream.waits_until.is_some() {
            // The lease was granted before the failure that the stream waits for, and most likely
            // failed for the same reason.
            return (Failure::Ignored, suspended);
        }
        stream.failures += 1;
        if stream.failures >= self.options.max_failures.max(1) {
            self.quarantine(id, error.to_owned(), false);
            return (Failure::Quarantined, suspended);
        }
        let growth = RETRY_GROWTH.saturating_pow(stream.failures - 1);
        let wait = self.options.retry_after.saturating_mul(growth);
        let until = now.saturating_add(wait);
        stream.waits_until = Some(until);
        self.waiting.insert((until, id));
        self.file(id);
        (Failure::Retry(wait), suspended)
    }

    /// Takes back the crash of a worker that was only silent.
    pub(crate) fn take_crash_back(&mut self, worker: &WorkerId, id: StreamId) {
        let Some(stream) = self.streams.get_mut(&id) else {
            return;
        };
        stream.crashed_on_it.remove(worker);
        let for_crashes = stream.quarantined.as_ref().is_some_and(|g| g.for_crashes);
        if for_crashes && stream.crashes() < self.options.max_crashes.max(1) {
            self.reopen(id);
        }
    }
}
