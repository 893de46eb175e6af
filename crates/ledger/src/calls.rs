//! What happens to a ledger: streams are wanted and forgotten, workers call, time passes.

use std::collections::BTreeSet;
use std::time::Duration;

use crate::ledger::{Ledger, SURVEY_PERIOD};
use crate::ranges::subtract;
use crate::state::{Lease, Stream};
use crate::types::{
    Accepted, Delivery, Failure, Grant, LeaseId, StreamId, Unit, Vanished, Wanted, WorkerId,
};
use crate::workers::Worker;

impl<P: Clone> Ledger<P> {
    // What is wanted.

    /// Notes that a stream needs samples, and says whether that is news. What is known of it already
    /// stays as it is; another generation takes the place of an earlier one, of which nothing is
    /// accepted any more.
    pub fn want(&mut self, wanted: Wanted<P>) -> bool {
        let id = wanted.stream;
        let known = self.settled.get(&id).copied().or_else(|| {
            let stream = self.streams.get(&id)?;
            Some((stream.generation, stream.end))
        });
        let mut missing = wanted.missing;
        match known {
            Some((generation, end)) if generation == wanted.generation => {
                // Whoever asks may have looked before the latest samples were stored.
                subtract(&mut missing, &(0..end));
            }
            Some(_) => self.forget(|other| other == id),
            None => {}
        }
        if missing.is_empty() {
            return false;
        }
        let end = wanted.samples;
        self.settled.remove(&id);
        if let Some(stream) = self.streams.get_mut(&id) {
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
                is_suspect: false,
                has_lapsed: wanted.history.crashes > 0,
                blame: BTreeSet::new(),
                history: wanted.history,
                failures: wanted.history.failures,
                waits_until: None,
                quarantined: None,
            };
            self.streams.insert(id, stream);
            *self.open.entry(id.group()).or_default() += 1;
        }
        self.file(id);
        true
    }

    /// Forgets streams, as when what they were chosen by is learned anew. Nothing of them is accepted
    /// any more, and whoever computes them is told to stop.
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

    /// Whether what came of a unit is to be stored; what is not is counted.
    pub fn accept(&mut self, unit: &Unit) -> Accepted {
        let open = self.streams.get(&unit.stream);
        let known = open.map(|stream| (stream.generation, stream.end));
        let known = known.or_else(|| self.settled.get(&unit.stream).copied());
        if let Some((generation, end)) = known
            && generation == unit.generation
            && unit.samples.end <= end
        {
            return Accepted::Yes;
        }
        self.stale += 1;
        Accepted::Stale
    }

    // Workers.

    /// Notes a worker; one that is known stays what it was.
    pub fn register(&mut self, worker: &WorkerId, host: &str, slots: usize, now: Duration) {
        let known = self.workers.known.entry(worker.clone());
        let state = known.or_insert_with(|| Worker::new(host, slots));
        state.slots = slots.max(1);
        self.workers.see(worker, now);
        self.slots = None;
    }

    /// Notes a sign of life; false if the worker is not registered.
    pub fn see(&mut self, worker: &WorkerId, now: Duration) -> bool {
        self.workers.see(worker, now).is_some()
    }

    /// Notes that a worker leaves: it gets nothing more, and whatever becomes of what it holds, it is
    /// not blamed.
    pub fn leaves(&mut self, worker: &WorkerId, now: Duration) {
        if let Some(state) = self.workers.see(worker, now) {
            state.is_leaving = true;
        }
    }

    /// Notes that a worker was told that there is nothing more to do.
    pub fn dismiss(&mut self, worker: &WorkerId) {
        if let Some(state) = self.workers.known.get_mut(worker) {
            state.was_dismissed = true;
        }
    }

    /// Whether everybody who called within `recently` and has not said that it leaves was dismissed.
    pub fn all_dismissed(&self, recently: Duration, now: Duration) -> bool {
        let mut present = self.workers.present(recently, now);
        present.all(|worker| worker.was_dismissed || worker.is_leaving)
    }

    // Leases.

    /// Leases something to a registered worker, or nothing if there is nothing for it.
    ///
    /// A worker that just failed a stream gets that one again only when there is nothing else to do:
    /// another worker's opinion is worth more than a second one of its own. When nothing is free, a
    /// worker with an idle slot gets what another one has held for long, as insurance against a slow
    /// one; whoever delivers first wins.
    pub fn lease(&mut self, worker: &WorkerId, now: Duration) -> Option<Grant<P>> {
        self.wake(now);
        let state = self.workers.see(worker, now)?;
        let is_kept = state.is_kept_from_work(now);
        if is_kept || self.is_draining || now < self.closed_until {
            return None;
        }
        let slots = self.slots_present(now);
        let units = self.cut(worker, slots);
        if !units.is_empty() {
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

    /// Extends what a worker holds, and returns those of its leases that nobody needs any more.
    ///
    /// A lease that ran out meanwhile is taken up again, unless enough others have its samples.
    pub fn heartbeat(
        &mut self,
        worker: &WorkerId,
        held: &[(LeaseId, bool)],
        now: Duration,
    ) -> Vec<LeaseId> {
        self.wake(now);
        self.see(worker, now);
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

    /// Takes over what a worker holds since before a restart, under its old name; false if nobody
    /// needs it.
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
        };
        self.take_up(id, lease, now)
    }

    /// Takes leases back from a worker without blaming anybody; those that it does not hold are
    /// ignored.
    pub fn release(&mut self, worker: &WorkerId, leases: &[LeaseId], now: Duration) {
        self.see(worker, now);
        for id in leases {
            if self.holds(worker, *id) {
                self.end(*id);
            }
        }
    }

    /// Ends a lease whose results are stored. What is stored counts whoever brings it; what failed
    /// counts only under a lease that this worker holds, or held until it ran out, and so once. The
    /// rest of the lease is free again.
    ///
    /// Returns what followed from each failure, and until when the worker is suspended for them, if
    /// it is.
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
        let has_brought = !delivery.stored.is_empty() || !delivery.refused.is_empty();
        if let Some(lease) = &ended {
            for unit in &lease.units {
                self.take_blame_back(worker, unit.stream);
            }
            self.delivered += 1;
            if has_brought && let Some(state) = self.workers.known.get_mut(worker) {
                state.has_delivered();
            }
            self.learn(delivery);
        }
        for unit in &delivery.stored {
            self.stored(unit);
        }
        for &(stream, generation) in &delivery.refused {
            let known = self.streams.get(&stream).map(|known| known.generation);
            if known == Some(generation) {
                self.settle(stream, u32::MAX);
            }
        }
        let mut suspended = None;
        let failures = delivery.failed.iter().map(|(stream, error)| {
            if ended.is_none() {
                return Failure::Ignored;
            }
            let (failure, until) = self.fail(worker, *stream, error, now);
            suspended = suspended.or(until);
            failure
        });
        (failures.collect(), suspended)
    }

    /// Ends the leases that have run out, in their order, and returns those that had begun: their
    /// workers may have died of them.
    pub fn expire(&mut self, now: Duration) -> Vec<Vanished> {
        self.wake(now);
        let due = self
            .expiries
            .iter()
            .take_while(|(expires, _)| *expires <= now);
        let due: Vec<LeaseId> = due.map(|&(_, id)| id).collect();
        let vanished = due.into_iter().filter_map(|id| self.expire_lease(id));
        let vanished = vanished.collect();
        self.clean(now);
        vanished
    }

    /// When something happens next by itself after `now`: a lease runs out, or something can be
    /// leased that cannot be leased now.
    pub fn next_due(&self, now: Duration) -> Option<Duration> {
        let expiry = self.expiries.first().map(|&(expires, _)| expires);
        let waiting = self.waiting.first().map(|&(until, _)| until);
        // Leases that are old enough wait for a worker with an idle slot, not for time.
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
        let suspended = self.workers.known.values();
        let suspended = suspended.filter_map(|worker| worker.suspended_until);
        let suspended = suspended.filter(|until| *until > now).min();
        [expiry, waiting, doubled, suspended, Some(self.closed_until)]
            .into_iter()
            .flatten()
            .filter(|due| *due > now)
            .min()
    }

    /// Gives what was quarantined another chance, with fresh counters, and returns it. Whoever asks for
    /// that has mended the cause: nobody waits after a failure any more, and no worker is suspended.
    pub fn retry(&mut self) -> Vec<StreamId> {
        let retried: Vec<StreamId> = self.quarantined.iter().copied().collect();
        for &id in &retried {
            self.reopen(id);
            if let Some(stream) = self.streams.get_mut(&id) {
                stream.blame.clear();
                stream.history = Default::default();
                stream.failures = 0;
                stream.is_suspect = false;
            }
        }
        for (_, id) in std::mem::take(&mut self.waiting) {
            if let Some(stream) = self.streams.get_mut(&id) {
                stream.waits_until = None;
            }
            self.file(id);
        }
        for state in self.workers.known.values_mut() {
            state.strikes.clear();
            state.suspended_until = None;
        }
        retried
    }
}
