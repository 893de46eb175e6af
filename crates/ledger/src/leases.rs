//! Granting, extending and ending leases.

use std::collections::BTreeSet;
use std::ops::Range;
use std::time::Duration;

use crate::cutting::{TARGET_SECONDS, UNKNOWN_SECONDS};
use crate::ledger::{Ledger, SURVEY_PERIOD};
use crate::ranges::{common, overlap};
use crate::state::{Lease, Stream};
use crate::types::{Delivery, Grant, Kind, LeaseId, StreamId, Unit, WorkerId};

/// Weight of a new measurement in the running mean of the cost of a sample.
const LEARNING_RATE: f64 = 0.3;
/// Upper bound on the expected duration of a lease, in seconds: ten years.
const LONGEST_LEASE: f64 = 3e8;
/// Number of lease times of silence after which a worker is forgotten. If the worker calls again, it is told to
/// register.
const FORGOTTEN_AFTER: u32 = 60;

impl<P: Clone> Ledger<P> {
    pub(crate) fn holds(&self, worker: &WorkerId, id: LeaseId) -> bool {
        let lease = self.leases.get(&id);
        lease.is_some_and(|lease| lease.worker == *worker)
    }

    pub(crate) fn holders(&self, id: StreamId) -> Vec<LeaseId> {
        let stream = self.streams.get(&id);
        stream.map_or_else(Vec::new, |stream| stream.leases.iter().copied().collect())
    }

    /// Expected duration of units, in seconds.
    pub(crate) fn expected(&self, units: &[Unit]) -> f64 {
        let pace = units
            .first()
            .and_then(|unit| self.pace.get(&unit.stream.kind));
        match pace {
            Some(pace) => pace * self.weight(units),
            None if self.options.long_samples => UNKNOWN_SECONDS,
            None => TARGET_SECONDS,
        }
    }

    /// The expected duration that a worker is told. A worker must not prefetch a second lease of
    /// candidates while other workers have none, because the next generation waits for the last
    /// candidate.
    fn as_held(&self, units: &[Unit], seconds: f64) -> f64 {
        let is_run = units.iter().any(|unit| unit.stream.kind == Kind::Run);
        if is_run && self.options.long_samples {
            seconds.max(UNKNOWN_SECONDS)
        } else {
            seconds
        }
    }

    pub(crate) fn grant(&mut self, worker: &WorkerId, units: Vec<Unit>, now: Duration) -> Grant<P> {
        self.newest += 1;
        let id = LeaseId {
            epoch: self.epoch,
            number: self.newest,
        };
        let seconds = self.expected(&units);
        let sources = units.iter().filter_map(|unit| {
            let stream = self.streams.get(&unit.stream)?;
            Some((unit.clone(), stream.source.clone()))
        });
        let granted = Grant {
            lease: id,
            units: sources.collect(),
            seconds: self.as_held(&units, seconds),
            is_control: false,
        };
        let lease = Lease {
            worker: worker.clone(),
            units,
            granted: now,
            expires: now.saturating_add(self.options.lease),
            started: false,
            seconds,
            is_control: false,
        };
        self.add(id, lease);
        granted
    }

    pub(crate) fn add(&mut self, id: LeaseId, lease: Lease) {
        for unit in &lease.units {
            if let Some(stream) = self.streams.get_mut(&unit.stream) {
                stream.take(id, &unit.samples);
            }
            self.file(unit.stream);
        }
        self.expiries.insert((lease.expires, id));
        if !lease.is_control {
            self.alone.insert((lease.granted, id));
        }
        if let Some(state) = self.workers.known.get_mut(&lease.worker) {
            state.held.insert(id);
        }
        self.leases.insert(id, lease);
    }

    /// Extends a lease that the worker holds. Returns false if it does not hold it.
    pub(crate) fn extend(
        &mut self,
        worker: &WorkerId,
        id: LeaseId,
        started: bool,
        now: Duration,
    ) -> bool {
        let expires = now.saturating_add(self.options.lease);
        let Some(lease) = self.leases.get_mut(&id) else {
            return false;
        };
        if lease.worker != *worker {
            return false;
        }
        self.expiries.remove(&(lease.expires, id));
        // A heartbeat that arrives out of order must not shorten the lease.
        lease.expires = lease.expires.max(expires);
        lease.started |= started;
        self.expiries.insert((lease.expires, id));
        true
    }

    /// Grants the units that are still needed of a lease that expired or predates a restart.
    pub(crate) fn take_up(&mut self, id: LeaseId, lease: Lease, now: Duration) -> bool {
        let units = self.needed(&lease.units);
        let rivals: BTreeSet<LeaseId> = units.iter().flat_map(|unit| self.rivals(unit)).collect();
        // If another worker holds these samples, this worker may go on only if it has started and
        // only two leases share them. If this worker itself got them again meanwhile and has not
        // started, that second lease ends.
        for rival in &rivals {
            let Some(other) = self.leases.get(rival) else {
                continue;
            };
            let is_own = other.worker == lease.worker;
            let is_doubled = || other.units.iter().any(|unit| self.rivals(unit).len() > 1);
            if is_own && other.started || !is_own && (!lease.started || is_doubled()) {
                return false;
            }
        }
        if units.is_empty() {
            return false;
        }
        self.lapsed.remove(&id);
        let mut is_doubled = false;
        for rival in rivals {
            let Some(other) = self.leases.get(&rival) else {
                continue;
            };
            if other.worker == lease.worker {
                self.end(rival);
            } else {
                self.alone.remove(&(other.granted, rival));
                is_doubled = true;
            }
        }
        let expires = now.saturating_add(self.options.lease);
        let lease = Lease {
            units,
            granted: now,
            expires,
            ..lease
        };
        self.add(id, lease);
        if is_doubled {
            self.alone.remove(&(now, id));
        }
        true
    }

    /// The leases that share samples with a unit.
    pub(crate) fn rivals(&self, unit: &Unit) -> Vec<LeaseId> {
        let holders = self.holders(unit.stream).into_iter();
        holders
            .filter(|id| {
                let lease = self.leases.get(id);
                lease.is_some_and(|lease| lease.units.iter().any(|other| meet(other, unit)))
            })
            .collect()
    }

    /// The ranges of leases that share some of these samples of a stream.
    pub(crate) fn held(&self, id: StreamId, samples: &Range<u32>) -> Vec<Range<u32>> {
        let leases = self.holders(id).into_iter();
        let leases = leases.filter_map(|id| self.leases.get(&id));
        let units = leases.flat_map(|lease| &lease.units);
        let shared = units.filter(|unit| unit.stream == id && overlap(&unit.samples, samples));
        shared.map(|unit| unit.samples.clone()).collect()
    }

    /// The parts of units that are still missing.
    pub(crate) fn needed(&self, units: &[Unit]) -> Vec<Unit> {
        let mut needed = Vec::new();
        for unit in units {
            let Some(stream) = self.streams.get(&unit.stream) else {
                continue;
            };
            let is_quarantined = stream.quarantined.as_ref().is_some_and(|g| !g.for_crashes);
            if stream.generation != unit.generation || is_quarantined {
                continue;
            }
            let missing = common(&stream.missing, &unit.samples);
            needed.extend(missing.into_iter().map(|samples| Unit {
                samples,
                ..unit.clone()
            }));
        }
        needed
    }

    /// A lease of another worker that is older than the [patience](Self::patience_at), with the units that this worker
    /// computes a second time.
    pub(crate) fn double(
        &mut self,
        worker: &WorkerId,
        now: Duration,
    ) -> Option<(LeaseId, Vec<Unit>)> {
        let patience = self.patience_at(now);
        let state = self.workers.known.get(worker)?;
        let (failed, holds_any) = (&state.strikes, !state.held.is_empty());
        let old = self.alone.iter();
        let old = old.take_while(|(granted, _)| now.saturating_sub(*granted) >= patience);
        for &(_, id) in old {
            let lease = self.leases.get(&id)?;
            let holder = self.workers.known.get(&lease.worker);
            if lease.worker == *worker || holder.is_some_and(|holder| holder.is_disconnected) {
                continue;
            }
            let mut units = self.needed(&lease.units);
            units.retain(|unit| {
                let stream = self.streams.get(&unit.stream);
                let may_be = |stream: &Stream<P>| stream.quarantined.is_none() && !stream.waits();
                stream.is_some_and(may_be) && !failed.contains(&unit.stream)
            });
            let is_suspect = |unit: &Unit| {
                let stream = self.streams.get(&unit.stream);
                stream.is_some_and(|stream| !stream.crashes.is_empty())
            };
            if units.iter().any(is_suspect) {
                // The stream that crashes workers is found only if each suspect is computed by itself.
                units.truncate(1);
            }
            units.retain(|unit| !holds_any || !self.is_isolated(unit.stream));
            if !units.is_empty() {
                return Some((id, units));
            }
        }
        None
    }

    /// Ends a lease. Its missing samples are free again, except those on another lease.
    pub(crate) fn end(&mut self, id: LeaseId) -> Option<Lease> {
        let lease = self.leases.remove(&id)?;
        self.expiries.remove(&(lease.expires, id));
        self.alone.remove(&(lease.granted, id));
        if let Some(state) = self.workers.known.get_mut(&lease.worker) {
            state.held.remove(&id);
        }
        for unit in &lease.units {
            if let Some(stream) = self.streams.get_mut(&unit.stream) {
                stream.leases.remove(&id);
            }
        }
        for unit in &lease.units {
            for other in self.rivals(unit) {
                if let Some(other_lease) = self.leases.get(&other) {
                    self.alone.insert((other_lease.granted, other));
                }
            }
            let held = self.held(unit.stream, &unit.samples);
            if let Some(stream) = self.streams.get_mut(&unit.stream) {
                stream.free_again(&unit.samples, &held);
            }
            self.file(unit.stream);
        }
        Some(lease)
    }

    /// Ends the given leases of which nothing is needed any more, and removes the units that are not needed from the
    /// others. A worker learns of an ended lease at its next heartbeat.
    pub(crate) fn prune(&mut self, leases: &[LeaseId]) {
        for &id in leases {
            let Some(lease) = self.leases.get(&id) else {
                continue;
            };
            let needed = self.needed(&lease.units);
            if needed.is_empty() {
                self.end(id);
                continue;
            }
            let gone: Vec<StreamId> = lease
                .units
                .iter()
                .map(|unit| unit.stream)
                .filter(|stream| !needed.iter().any(|unit| unit.stream == *stream))
                .collect();
            for stream in gone {
                if let Some(stream) = self.streams.get_mut(&stream) {
                    stream.leases.remove(&id);
                }
            }
            if let Some(lease) = self.leases.get_mut(&id) {
                lease.units = needed;
            }
        }
    }

    /// Updates the cost of a sample from the duration of a lease.
    pub(crate) fn learn(&mut self, delivery: &Delivery) {
        let refused = delivery.refused.iter().map(|(stream, _)| stream.kind);
        let stored = delivery.stored.iter().map(|unit| unit.stream.kind);
        let Some(kind) = stored.chain(refused).next() else {
            return;
        };
        if !delivery.seconds.is_finite() || delivery.seconds <= 0.0 {
            return;
        }
        let analysed = self.design_weight() as f64 * delivery.refused.len() as f64;
        let measured = delivery.seconds / (self.weight(&delivery.stored) + analysed);
        self.pace
            .entry(kind)
            .and_modify(|pace| *pace += LEARNING_RATE * (measured - *pace))
            .or_insert(measured);
    }

    /// Age at which a lease may be granted to a second worker: twice the longest expected duration,
    /// since a copy of a nearly finished lease is wasted work.
    pub(crate) fn patience_at(&mut self, now: Duration) -> Duration {
        if let Some((of, patience)) = self.patience
            && now.saturating_sub(of) < SURVEY_PERIOD
        {
            return patience;
        }
        let seconds = self.leases.values().map(|lease| lease.seconds);
        let longest = seconds.fold(TARGET_SECONDS, f64::max).min(LONGEST_LEASE);
        let patience = Duration::from_secs_f64(2.0 * longest);
        self.patience = Some((now, patience));
        patience
    }

    /// Total slots of the workers that called recently.
    pub(crate) fn slots_present(&mut self, now: Duration) -> usize {
        if let Some((of, slots)) = self.slots
            && now.saturating_sub(of) < SURVEY_PERIOD
        {
            return slots;
        }
        let present = self.workers.present(2 * self.options.lease, now);
        let slots = present.map(|worker| worker.slots).sum();
        self.slots = Some((now, slots));
        slots
    }

    /// Forgets expired leases that are no longer needed and workers that have been silent for long.
    pub(crate) fn clean(&mut self, now: Duration) {
        let mut lapsed = std::mem::take(&mut self.lapsed);
        lapsed.retain(|_, lease| !self.needed(&lease.units).is_empty());
        self.lapsed = lapsed;
        let long_ago = self.options.lease * FORGOTTEN_AFTER;
        self.workers.known.retain(|_, worker| {
            !worker.held.is_empty() || now.saturating_sub(worker.last_seen) < long_ago
        });
    }
}

/// Whether two units have samples in common.
fn meet(a: &Unit, b: &Unit) -> bool {
    a.stream == b.stream && overlap(&a.samples, &b.samples)
}
