//! Transitions of streams: stored, failed, quarantined, reopened.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use crate::ledger::Ledger;
use crate::ranges::subtract;
use crate::state::{FailedAttempts, Quarantine, Stream};
use crate::types::{Failure, FailureReport, Generation, LeaseId, StreamId, Unit, WorkerId};

/// Factor by which each wait after a failure is longer than the one before.
const RETRY_GROWTH: u32 = 4;

/// The machine of a host, which is named `MACHINE:PROCESS`.
fn machine(host: &str) -> &str {
    host.rsplit_once(':').map_or(host, |(machine, _)| machine)
}

impl<P: Clone> Ledger<P> {
    /// Updates the set of free streams after any change to a stream.
    pub(crate) fn file(&mut self, id: StreamId) {
        let stream = self.streams.get(&id);
        if stream.is_some_and(Stream::has_free) {
            self.free.insert(id);
        } else {
            self.free.remove(&id);
        }
    }

    /// Ends the waits after failures that are due.
    pub(crate) fn wake(&mut self, now: Duration) {
        while let Some(&(until, id, sample)) = self.waiting.first()
            && until <= now
        {
            self.waiting.pop_first();
            if let Some(stream) = self.streams.get_mut(&id) {
                if let Some(failing) = stream.failing.get_mut(&sample) {
                    failing.waits_until = None;
                }
                if let Some(sample) = sample {
                    let held = self.held(id, &(sample..sample + 1));
                    if let Some(stream) = self.streams.get_mut(&id) {
                        stream.free_again(&(sample..sample + 1), &held);
                    }
                }
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
        let crashes = &mut stream.crashes;
        crashes.retain(|_, crash| !unit.samples.contains(&crash.first));
        let settled = stream.failing.keys().copied();
        let settled = settled.filter(|sample| sample.is_some_and(|s| unit.samples.contains(&s)));
        for sample in settled.collect::<Vec<_>>() {
            let failing = stream.failing.remove(&sample);
            if let Some(until) = failing.and_then(|failing| failing.waits_until) {
                self.waiting.remove(&(until, unit.stream, sample));
            }
        }
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
        for (sample, failing) in &stream.failing {
            if let Some(until) = failing.waits_until {
                self.waiting.remove(&(until, id, *sample));
            }
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

    pub(crate) fn begin_quarantine(&mut self, id: StreamId, error: String, for_crashes: bool) {
        let Some(stream) = self.streams.get_mut(&id) else {
            return;
        };
        stream.quarantined = Some(Quarantine { error, for_crashes });
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
        failed: &FailureReport,
        now: Duration,
    ) -> (Failure, Option<Duration>) {
        let ignored = (Failure::Ignored, None);
        let id = failed.stream;
        let Some(state) = self.workers.known.get_mut(worker) else {
            return ignored;
        };
        let Some(stream) = self.streams.get_mut(&id) else {
            return ignored;
        };
        if state.is_leaving || stream.quarantined.is_some() {
            return ignored;
        }
        state.failed += u64::from(!failed.is_contradiction);
        let succeeded_at = state.succeeded_at;
        let machine = Arc::from(machine(&state.host));
        self.turn += 1;
        self.fails_since.get_or_insert(now);
        let is_hopeless = self.is_hopeless(now);
        let suspended = match failed.is_contradiction {
            true => None,
            false => self.strike(worker, id, now),
        };
        let has_others = self.other_machines(worker, now);
        let options = &self.options;
        let Some(stream) = self.streams.get_mut(&id) else {
            return ignored;
        };
        // A sample that is no longer missing was delivered in another way.
        let is_missing = |sample: u32| stream.missing.iter().any(|range| range.contains(&sample));
        if !failed.sample.is_none_or(is_missing) {
            return (Failure::Ignored, suspended);
        }
        let before = stream.earlier_failures.min(options.max_failures - 1);
        let failing = stream.failing.entry(failed.sample);
        let failing = failing.or_insert_with(|| FailedAttempts {
            attempts: before,
            counted: before,
            ..FailedAttempts::default()
        });
        if failing.waits_until.is_some() {
            // The lease was granted before the failure that the sample waits for, and most likely
            // failed for the same reason.
            return (Failure::Ignored, suspended);
        }
        stream.earlier_failures = 0;
        failing.machines.insert(machine);
        // The first attempt counts. A later one counts only if the worker has succeeded since the attempt before.
        failing.counted += u32::from(failing.attempts == 0 || failing.turn < succeeded_at);
        failing.attempts += 1;
        failing.turn = self.turn;
        let is_conclusive = failing.counted >= options.max_failures.max(1)
            && (failing.machines.len() > 1 || !has_others);
        let is_over = is_hopeless && failing.attempts >= options.max_failures.max(1);
        let growth = RETRY_GROWTH.saturating_pow(failing.attempts - 1);
        let wait = options.retry_after.saturating_mul(growth);
        let wait = wait.min(options.longest_wait);
        let is_result = is_conclusive && stream.is_tolerant;
        if (is_conclusive || is_over) && !is_result {
            failing.waits_until = None;
            self.begin_quarantine(id, failed.error.clone(), false);
            return (Failure::Quarantined, suspended);
        }
        let until = now.saturating_add(wait);
        failing.waits_until = Some(until);
        self.waiting.insert((until, id, failed.sample));
        if let Some(sample) = failed.sample {
            subtract(&mut stream.free, &(sample..sample + 1));
        }
        self.file(id);
        let failure = match is_result {
            true => Failure::Conclusive,
            false => Failure::Retry(wait),
        };
        (failure, suspended)
    }

    /// Whether a worker on another machine could compute the samples that this worker fails.
    pub(crate) fn other_machines(&self, worker: &WorkerId, now: Duration) -> bool {
        let host = self.workers.known.get(worker).map(|state| &state.host);
        let mut present = self.workers.present(2 * self.options.lease, now);
        present.any(|other| {
            let can_work = !other.is_leaving && !other.is_suspended(now);
            can_work && host.is_some_and(|host| machine(host) != machine(&other.host))
        })
    }

    /// Whether a sample of a stream has failed on this machine alone, so often that only another one can tell whether
    /// the sample or the machine is at fault.
    pub(crate) fn has_failed_enough(&self, id: StreamId, host: &str) -> bool {
        let failing = self.streams.get(&id).map(|stream| &stream.failing);
        let mut failing = failing.into_iter().flat_map(BTreeMap::values);
        failing.any(|failing| {
            failing.counted >= self.options.max_failures.max(1)
                && failing
                    .machines
                    .iter()
                    .all(|failed| **failed == *machine(host))
        })
    }

    /// Counts a failure against a worker. Returns the end of the suspension if that suspends it.
    ///
    /// If there is a control, the worker gets it before any suspension. After an outage longer than
    /// [`Options::retry_for`](crate::Options::retry_for) no worker is suspended, since waiting does not help.
    fn strike(&mut self, worker: &WorkerId, id: StreamId, now: Duration) -> Option<Duration> {
        let has_too_many = self.workers.strike(worker, id, &self.options, now);
        if !has_too_many || self.control.is_some() || self.is_hopeless(now) {
            return None;
        }
        self.workers.suspend(worker, &self.options, now)
    }

    /// Records that a worker has failed its control. Returns the end of its suspension.
    pub(crate) fn fail_control(&mut self, worker: &WorkerId, now: Duration) -> Option<Duration> {
        let state = self.workers.known.get_mut(worker)?;
        if state.is_leaving {
            return None;
        }
        state.failed += 1;
        self.turn += 1;
        self.fails_since.get_or_insert(now);
        if self.is_hopeless(now) {
            return None;
        }
        self.workers.suspend(worker, &self.options, now)
    }
}
