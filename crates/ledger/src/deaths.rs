//! Deaths of workers, and the streams that are suspected of them.
//!
//! A worker that dies holds leases, and any of their streams may be the cause. A death counts against a stream only if
//! its worker held no other. Otherwise all of them are suspects, and each gets leases of its own. A suspect that was
//! present at two deaths is computed alone, by a worker that holds nothing else, after all other work is leased. So is
//! a stream against which a death counts. The next death then shows whether the stream was the cause, and costs no
//! other stream anything.
//!
//! Deaths count by the first sample of the held unit, and are forgotten when that sample is stored: two deaths with a
//! success in between have different causes, for example a machine that is switched off every evening.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::ledger::Ledger;
use crate::state::Stream;
use crate::types::{Crash, Death, LeaseId, StreamId, Unit, WorkerId};

impl<P> Stream<P> {
    /// The largest numbers of deaths at one sample: deaths of workers that held no other stream, and all deaths.
    fn worst(&self) -> (usize, usize) {
        let mut at: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
        for death in self.deaths.values() {
            let (alone, all) = at.entry(death.first).or_default();
            *alone += usize::from(death.is_alone);
            *all += 1;
        }
        let alone = at.values().map(|(alone, _)| *alone).max();
        let all = at.values().map(|(_, all)| *all).max();
        (alone.unwrap_or(0), all.unwrap_or(0))
    }

    /// Number of deaths that count against the stream.
    pub(crate) fn crashes(&self) -> usize {
        self.worst().0
    }

    /// Whether the stream is computed only by a worker that holds nothing else.
    pub(crate) fn is_isolated(&self) -> bool {
        let (alone, all) = self.worst();
        alone > 0 || all > 1
    }
}

impl<P: Clone> Ledger<P> {
    /// Whether a stream is computed only by a worker that holds nothing else.
    pub(crate) fn is_isolated(&self, id: StreamId) -> bool {
        let stream = self.streams.get(&id);
        stream.is_some_and(|stream| !stream.deaths.is_empty() && stream.is_isolated())
    }

    /// Whether a held stream may be about to kill its worker, so that no second worker may begin with it: the holder
    /// has no connection, or the stream is computed alone.
    pub(crate) fn is_in_doubt(&self, id: StreamId) -> bool {
        let holders = self.holders(id);
        let is_disconnected = |id: &LeaseId| {
            let lease = self.leases.get(id);
            let holder = lease.and_then(|lease| self.workers.known.get(&lease.worker));
            holder.is_some_and(|holder| holder.is_disconnected)
        };
        !holders.is_empty() && (self.is_isolated(id) || holders.iter().any(is_disconnected))
    }

    /// Whether the worker holds a stream that is computed alone.
    pub(crate) fn holds_isolated(&self, worker: &WorkerId) -> bool {
        let held = self.workers.known.get(worker).map(|state| &state.held);
        let mut held = held.into_iter().flatten();
        // A worker with such a lease holds no other.
        let (Some(id), None) = (held.next(), held.next()) else {
            return false;
        };
        let units = self.leases.get(id).map(|lease| &lease.units);
        let mut units = units.into_iter().flatten();
        units.any(|unit| self.is_isolated(unit.stream))
    }

    /// Records that a worker has no connection. Its leases may have killed it, so no other worker gets a copy of them
    /// before it is known whether the worker [comes back](Self::heartbeat) or [has died](Self::mark_dead).
    pub fn mark_disconnected(&mut self, worker: &WorkerId) {
        if let Some(state) = self.workers.known.get_mut(worker) {
            state.is_disconnected = true;
        }
    }

    /// Ends the leases of a worker that seems to have died, and records the death for their streams. If the worker
    /// calls again, the death is taken back, and the worker continues with the samples that are still needed.
    pub fn mark_dead(&mut self, worker: &WorkerId, now: Duration) -> Vec<Crash> {
        let Some(state) = self.workers.known.get_mut(worker) else {
            return Vec::new();
        };
        state.is_dead = true;
        let is_leaving = state.is_leaving;
        let held: Vec<LeaseId> = state.held.iter().copied().collect();
        let mut open = Vec::new();
        for id in held {
            if let Some(lease) = self.end(id) {
                open.extend(lease.units.iter().cloned().map(|unit| (id, unit)));
                self.lapsed.insert(id, lease);
            }
        }
        self.clean(now);
        match is_leaving {
            true => Vec::new(),
            false => self.count_death(worker, open),
        }
    }

    /// Counts the death of a worker that left a note of the units it was computing, `begun`. This replaces the deaths
    /// that [`mark_dead`](Self::mark_dead) has counted for the worker. Units that are no longer missing are left out.
    /// The deaths of streams that are not wanted yet are returned, too, for their [`History`](crate::History).
    pub fn record_death(&mut self, worker: &WorkerId, begun: &[(LeaseId, Unit)]) -> Vec<Crash> {
        self.take_deaths_back(worker);
        if let Some(state) = self.workers.known.remove(worker) {
            for id in state.held {
                self.end(id);
            }
            self.slots = None;
        }
        self.lapsed.retain(|_, lease| lease.worker != *worker);
        let is_open = |unit: &Unit| match self.streams.contains_key(&unit.stream) {
            true => !self.needed(std::slice::from_ref(unit)).is_empty(),
            false => !self.settled.contains_key(&unit.stream),
        };
        let open = begun.iter().filter(|(_, unit)| is_open(unit)).cloned();
        self.count_death(worker, open.collect())
    }

    /// Counts a death against the streams of the units that were open.
    fn count_death(&mut self, worker: &WorkerId, open: Vec<(LeaseId, Unit)>) -> Vec<Crash> {
        let mut first_of: BTreeMap<StreamId, (LeaseId, u32)> = BTreeMap::new();
        for (lease, unit) in open {
            let first = first_of.entry(unit.stream);
            let first = first.or_insert((lease, unit.samples.start));
            first.1 = first.1.min(unit.samples.start);
        }
        if let Some(state) = self.workers.known.get_mut(worker)
            && !first_of.is_empty()
        {
            state.crashed += 1;
        }
        let is_alone = first_of.len() == 1;
        let crash = |(stream, (lease, first)): (StreamId, (LeaseId, u32))| Crash {
            lease,
            worker: worker.clone(),
            stream,
            death: Death { is_alone, first },
            quarantined: self.count_against(worker, stream, Death { is_alone, first }),
        };
        first_of.into_iter().map(crash).collect()
    }

    /// Counts a death against a stream. Returns whether that quarantined the stream.
    fn count_against(&mut self, worker: &WorkerId, id: StreamId, death: Death) -> bool {
        let Some(stream) = self.streams.get_mut(&id) else {
            return false;
        };
        stream.deaths.insert(worker.clone(), death);
        let crashes = stream.crashes();
        let is_enough = crashes >= self.options.max_crashes.max(1);
        if !is_enough || stream.quarantined.is_some() {
            return false;
        }
        let error = format!("{crashes} workers died on it, the last was {worker}");
        self.quarantine(id, error, true);
        true
    }

    /// Takes back the deaths of a worker that was only silent.
    pub(crate) fn take_deaths_back(&mut self, worker: &WorkerId) {
        if let Some(state) = self.workers.known.get_mut(worker) {
            state.is_dead = false;
        }
        let has_died_on = |stream: &Stream<P>| stream.deaths.contains_key(worker);
        let of_it = self.streams.iter();
        let of_it = of_it.filter(|(_, stream)| has_died_on(stream));
        for id in of_it.map(|(id, _)| *id).collect::<BTreeSet<_>>() {
            self.take_death_back(worker, id);
        }
    }

    /// Takes back the death of a worker that has delivered the stream after all.
    pub(crate) fn take_death_back(&mut self, worker: &WorkerId, id: StreamId) {
        let Some(stream) = self.streams.get_mut(&id) else {
            return;
        };
        stream.deaths.remove(worker);
        let for_crashes = stream.quarantined.as_ref().is_some_and(|g| g.for_crashes);
        if for_crashes && stream.crashes() < self.options.max_crashes.max(1) {
            self.reopen(id);
        }
    }
}
