//! The calls that change a ledger: streams wanted and forgotten, workers' requests, passing time.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::ledger::{Ledger, SURVEY_PERIOD};
use crate::options::lease_for;
use crate::ranges::subtract;
use crate::state::{Lease, Stream};
use crate::types::{
    Crash, Delivery, Failure, Generation, Grant, Kind, LeaseId, StreamDemand, StreamId, Unit,
    Verdict, WorkerId,
};
use crate::workers::Worker;

impl<P: Clone> Ledger<P> {
    // Streams.

    /// Registers a stream that needs samples and returns whether that adds missing samples. Samples
    /// known already keep their state. A new generation replaces the earlier one, whose results are
    /// no longer accepted.
    pub fn want(&mut self, wanted: StreamDemand<P>) -> bool {
        let id = wanted.stream;
        let known = self.settled.get(&id).copied().or_else(|| {
            let stream = self.streams.get(&id)?;
            Some((stream.generation, stream.end))
        });
        let mut missing = wanted.missing;
        match known {
            Some((generation, end)) if generation == wanted.generation => {
                // The caller may have looked before the latest samples were stored.
                subtract(&mut missing, &(0..end));
            }
            Some(_) => self.forget(|other| other == id),
            None => {}
        }
        if missing.is_empty() {
            return false;
        }
        let end = wanted.samples;
        let mut history = wanted.history;
        let is_missing = |first| missing.iter().any(|range| range.contains(&first));
        history.crashes.retain(|_, crash| is_missing(crash.first));
        if id.kind == Kind::Run {
            // The failures belong to candidates whose results are stored by now.
            history.failures = 0;
        }
        self.settled.remove(&id);
        if let Some(stream) = self.streams.get_mut(&id) {
            if wanted.is_analysed {
                (stream.source, stream.is_analysed) = (wanted.source, true);
            }
            stream.missing.extend(missing.iter().cloned());
            stream.free.extend(missing);
            stream.end = end;
        } else {
            let stream = Stream {
                generation: wanted.generation,
                source: wanted.source,
                free: missing.clone(),
                missing,
                end,
                leases: BTreeSet::new(),
                crashes: history.crashes,
                earlier_failures: history.failures,
                is_tolerant: wanted.is_tolerant,
                is_analysed: wanted.is_analysed,
                failing: BTreeMap::new(),
                quarantined: None,
            };
            self.streams.insert(id, stream);
            *self.open.entry(id.group()).or_default() += 1;
        }
        self.file(id);
        true
    }

    /// Records that the analyses of a design are known. The leases to come get `source`, which has their results.
    pub fn analysed(&mut self, id: StreamId, generation: Generation, source: P) {
        let stream = self.streams.get_mut(&id);
        if let Some(stream) = stream.filter(|stream| stream.generation == generation) {
            (stream.source, stream.is_analysed) = (source, true);
        }
    }

    /// Forgets streams, for example when the points they sample were chosen again. Their results are
    /// no longer accepted, and the workers that compute them are told to stop at their next
    /// heartbeat.
    pub fn forget(&mut self, which: impl Fn(StreamId) -> bool) {
        self.settled.retain(|id, _| !which(*id));
        let gone: Vec<StreamId> = self
            .streams
            .keys()
            .copied()
            .filter(|id| which(*id))
            .collect();
        for id in gone {
            self.remove(id);
        }
    }

    /// Whether the results of a unit are to be stored. Stale results are counted.
    pub fn accept(&mut self, unit: &Unit) -> Verdict {
        let open = self.streams.get(&unit.stream);
        let known = open.map(|stream| (stream.generation, stream.end));
        let known = known.or_else(|| self.settled.get(&unit.stream).copied());
        if let Some((generation, end)) = known
            && generation == unit.generation
            && unit.samples.end <= end
        {
            return Verdict::Yes;
        }
        self.stale += 1;
        Verdict::Stale
    }

    // Workers.

    /// Registers a worker. The counters of a known worker are kept.
    pub fn register(&mut self, worker: &WorkerId, host: &str, slots: usize, now: Duration) {
        let known = self.workers.known.entry(worker.clone());
        let state = known.or_insert_with(|| Worker::new(host, slots));
        state.slots = slots.max(1);
        self.hear(worker, now);
        self.slots = None;
        // A lease time never shrinks: workers rely on the longer one.
        let needed = lease_for(self.workers.known.len());
        self.options.lease = self.options.lease.max(needed);
    }

    /// Records that a worker called. Returns false if the worker is not registered.
    pub fn see(&mut self, worker: &WorkerId, now: Duration) -> bool {
        self.workers.see(worker, now).is_some()
    }

    /// Records a call that only a living worker makes. A report is not such a call: it may be stored after the worker's
    /// crash.
    fn hear(&mut self, worker: &WorkerId, now: Duration) {
        if let Some(state) = self.workers.see(worker, now) {
            state.last_sign_of_life = state.last_sign_of_life.max(now);
            state.is_disconnected = false;
            if state.has_crashed {
                self.take_crashes_back(worker);
            }
        }
    }

    /// Records that a worker is leaving: it gets no further leases, and the crashes and failures of the leases that it
    /// still holds do not count.
    pub fn leaves(&mut self, worker: &WorkerId, now: Duration) {
        if let Some(state) = self.workers.see(worker, now) {
            state.is_leaving = true;
        }
    }

    /// Records that a worker was told that the work is done.
    pub fn dismiss(&mut self, worker: &WorkerId) {
        if let Some(state) = self.workers.known.get_mut(worker) {
            state.was_dismissed = true;
        }
    }

    /// Whether every worker that called within `recently` was dismissed or is leaving.
    pub fn all_dismissed(&self, recently: Duration, now: Duration) -> bool {
        let mut present = self.workers.present(recently, now);
        present.all(|worker| worker.was_dismissed || worker.is_leaving)
    }

    // Leases.

    /// Grants a lease to a registered worker, or `None` if there is no work for it.
    ///
    /// A stream that this worker has failed comes after others, because a second attempt is worth more on another
    /// worker. The worker gets the stream only after it has succeeded with something else, if need be with a control.
    /// When nothing is free, a worker with an idle slot gets a copy of a lease that another worker has held for long,
    /// in case that worker is slow. The first delivery counts.
    pub fn lease(&mut self, worker: &WorkerId, now: Duration) -> Option<Grant<P>> {
        self.wake(now);
        self.hear(worker, now);
        let state = self.workers.known.get_mut(worker)?;
        let is_kept = state.is_kept_from_work(now);
        let holds_any = !state.held.is_empty();
        let is_closed = self.is_draining || now < self.closed_until;
        if is_kept || is_closed || self.holds_isolated(worker) {
            return None;
        }
        let slots = self.slots_present(now);
        let units = self.cut(worker, slots, now);
        if let [first, ..] = &*units {
            if holds_any && self.is_isolated(first.stream) {
                return None;
            }
            if self.needs_control(worker, &units, now) {
                return self.grant_control(worker, now);
            }
            return Some(self.grant(worker, units, now));
        }
        let state = self.workers.known.get(worker)?;
        if state.held.len() >= state.slots {
            return None;
        }
        let (first, units) = self.double(worker, now)?;
        if let Some(lease) = self.leases.get(&first) {
            self.alone.remove(&(lease.granted, first));
        }
        let grant = self.grant(worker, units, now);
        self.alone.remove(&(now, grant.lease));
        Some(grant)
    }

    /// Extends the leases that a worker holds and returns those that are no longer needed.
    ///
    /// A lease that expired meanwhile is taken up again if its samples are still needed. If another worker has got
    /// them by then, the lease must have started, and no third lease may cover them.
    /// [`mark_crashed`](Self::mark_crashed) is undone.
    pub fn heartbeat(
        &mut self,
        worker: &WorkerId,
        held: &[(LeaseId, bool)],
        now: Duration,
    ) -> Vec<LeaseId> {
        self.wake(now);
        self.hear(worker, now);
        let mut cancelled = Vec::new();
        for &(id, started) in held {
            let is_held = self.extend(worker, id, started, now) || {
                let lapsed = self.lapsed.get(&id);
                let lapsed = lapsed.filter(|lease| lease.worker == *worker).cloned();
                lapsed.is_some_and(|lease| {
                    let started = started || lease.started;
                    self.take_up(id, Lease { started, ..lease }, now)
                })
            };
            if !is_held {
                cancelled.push(id);
            }
        }
        cancelled
    }

    /// Takes over a lease granted before a restart, under its old id. Returns false if the lease is
    /// no longer needed.
    pub fn adopt(&mut self, worker: &WorkerId, id: LeaseId, units: &[Unit], now: Duration) -> bool {
        if id.epoch == self.epoch {
            return self.heartbeat(worker, &[(id, false)], now).is_empty();
        }
        if self.extend(worker, id, false, now) {
            return true;
        }
        let lease = Lease {
            worker: worker.clone(),
            units: units.to_vec(),
            granted: now,
            expires: now,
            started: false,
            seconds: self.expected(units),
            is_control: false,
        };
        self.take_up(id, lease, now)
    }

    /// Takes back unfinished leases without counting a failure or a crash. Leases that the worker
    /// does not hold are ignored.
    pub fn release(&mut self, worker: &WorkerId, leases: &[LeaseId], now: Duration) {
        self.see(worker, now);
        for id in leases {
            if self.holds(worker, *id) {
                self.end(*id);
            }
        }
    }

    /// Ends a lease whose results are stored. Stored samples count whichever worker delivers them.
    /// Failures count only under a lease that this worker holds or held until it expired, and thus
    /// only once. The rest of the lease is free again.
    ///
    /// Returns the consequence of each failure, and the end of the suspension if the failures
    /// suspended the worker.
    pub fn deliver(
        &mut self,
        worker: &WorkerId,
        id: LeaseId,
        delivery: &Delivery,
        now: Duration,
    ) -> (Vec<Failure>, Option<Duration>) {
        self.wake(now);
        self.see(worker, now);
        let ended = if self.holds(worker, id) {
            self.end(id)
        } else {
            let lapsed = self.lapsed.get(&id);
            if lapsed.is_some_and(|lease| lease.worker == *worker) {
                self.lapsed.remove(&id)
            } else {
                None
            }
        };
        // A unit without simulated samples is not a success, for example the criteria of a design whose samples fail.
        let has_samples = delivery
            .stored
            .iter()
            .any(|unit| self.simulated(unit).is_some());
        let has_brought = delivery.has_answers || has_samples || !delivery.refused.is_empty();
        if let Some(lease) = &ended {
            for unit in &lease.units {
                self.take_crash_back(worker, unit.stream);
            }
            if has_brought {
                self.succeeded(worker, lease, delivery);
            }
            if lease.is_control {
                let until = match delivery.failed.is_empty() {
                    true => None,
                    false => self.fail_control(worker, now),
                };
                let ignored = delivery.failed.iter().map(|_| Failure::Ignored);
                return (ignored.collect(), until);
            }
            self.delivered += 1;
            self.learn(delivery);
        }
        for unit in &delivery.stored {
            self.stored(unit);
        }
        for &(stream, generation) in &delivery.refused {
            self.refuse(stream, generation);
        }
        let mut suspended = None;
        let failures = delivery.failed.iter().map(|failed| {
            if ended.is_none() {
                return Failure::Ignored;
            }
            let (failure, until) = self.fail(worker, failed, now);
            suspended = suspended.or(until);
            failure
        });
        (failures.collect(), suspended)
    }

    /// Ends the expired leases. A worker that was silent meanwhile [counts as crashed](Self::mark_crashed). If the
    /// worker has called, it never received the lease, because its calls would have extended it. Such a lease ends
    /// without a crash.
    pub fn expire(&mut self, now: Duration) -> Vec<Crash> {
        self.wake(now);
        let mut crashes = Vec::new();
        while let Some(&(expires, id)) = self.expiries.first()
            && expires <= now
        {
            let worker = self.leases.get(&id).map(|lease| lease.worker.clone());
            let is_silent = |worker: &WorkerId| {
                let state = self.workers.known.get(worker);
                let silence = state.map(|state| now.saturating_sub(state.last_sign_of_life));
                silence.is_some_and(|silence| silence >= self.options.lease / 2)
            };
            if let Some(silent) = worker.filter(is_silent) {
                crashes.extend(self.mark_crashed(&silent, now));
            } else {
                let lease = self.end(id);
                self.lapsed.extend(lease.map(|lease| (id, lease)));
            }
        }
        self.clean(now);
        crashes
    }

    /// The next time after `now` at which the state changes by itself for a worker: a lease expires,
    /// work becomes available, or the worker's suspension ends.
    pub fn next_due(&self, worker: &WorkerId, now: Duration) -> Option<Duration> {
        let expiry = self.expiries.first().map(|&(expires, _)| expires);
        let waiting = self.waiting.first().map(|&(until, ..)| until);
        // Leases older than the patience wait for a worker with an idle slot, not for a time.
        let patience = self
            .patience
            .map_or(SURVEY_PERIOD, |(_, patience)| patience);
        let first = LeaseId {
            epoch: 0,
            number: 0,
        };
        let mut young = self.alone.range((now.saturating_sub(patience), first)..);
        let young = young.find(|(granted, _)| granted.saturating_add(patience) > now);
        let doubled = young.map(|&(granted, _)| granted.saturating_add(patience));
        let suspended = self.workers.known.get(worker);
        let suspended = suspended.and_then(|worker| worker.suspended_until);
        [expiry, waiting, doubled, suspended, Some(self.closed_until)]
            .into_iter()
            .flatten()
            .filter(|due| *due > now)
            .min()
    }

    /// Settles samples that need no results any more, because a [conclusive](Failure::Conclusive)
    /// failure is stored in their place.
    pub fn conclude(&mut self, unit: &Unit) {
        self.stored(unit);
    }

    /// Settles a stream that needs no samples any more: a failure is stored in its place, or its design gets no
    /// samples.
    pub fn refuse(&mut self, stream: StreamId, generation: Generation) {
        let known = self.streams.get(&stream).map(|known| known.generation);
        if known == Some(generation) {
            self.settle(stream, u32::MAX);
        }
    }

    /// Quarantines a stream whose [conclusive](Failure::Conclusive) failure cannot be stored.
    pub fn quarantine(&mut self, stream: StreamId, error: &str) {
        let known = self.streams.get(&stream);
        if known.is_some_and(|known| known.quarantined.is_none()) {
            self.begin_quarantine(stream, error.to_owned(), false);
        }
    }

    /// Reopens the quarantined streams with their counters reset and returns them. The cause is
    /// assumed to be fixed, so waits after failures and suspensions of workers end, too.
    pub fn retry(&mut self) -> Vec<StreamId> {
        let retried: Vec<StreamId> = self.quarantined.iter().copied().collect();
        for &id in &retried {
            self.reopen(id);
            if let Some(stream) = self.streams.get_mut(&id) {
                stream.crashes.clear();
                stream.earlier_failures = 0;
            }
        }
        self.wake(Duration::MAX);
        for id in &retried {
            if let Some(stream) = self.streams.get_mut(id) {
                stream.failing.clear();
            }
        }
        self.fails_since = None;
        for state in self.workers.known.values_mut() {
            state.strikes.clear();
            state.suspended_until = None;
        }
        retried
    }
}
