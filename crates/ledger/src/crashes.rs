//! Crashes of workers, and the streams that are suspected of them.
//!
//! A worker that crashes holds leases, and any of their streams may be the cause. A crash counts against a stream only
//! if its worker held no other. Otherwise all of them are suspects, and each gets leases of its own. A suspect of two
//! crashes is computed alone, by a worker that holds nothing else, after all other work is leased. So is a stream
//! against which a crash counts. The next crash then shows whether the stream was the cause, and costs no other stream
//! anything.
//!
//! Crashes count by the first sample of the leased unit, and are forgotten when that sample is stored. Two crashes with
//! a success in between have different causes, for example a machine that is switched off every evening.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::ledger::Ledger;
use crate::state::Stream;
use crate::types::{Crash, CrashRecord, LeaseId, StreamId, Unit, WorkerId};

impl<P> Stream<P> {
    /// The largest numbers of crashes at one sample: crashes of workers that held no other stream, and all crashes.
    fn worst(&self) -> (usize, usize) {
        let mut at: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
        for crash in self.crashes.values() {
            let (alone, all) = at.entry(crash.first).or_default();
            *alone += usize::from(crash.is_alone);
            *all += 1;
        }
        let alone = at.values().map(|(alone, _)| *alone).max();
        let all = at.values().map(|(_, all)| *all).max();
        (alone.unwrap_or(0), all.unwrap_or(0))
    }

    /// Number of crashes that count against the stream.
    pub(crate) fn counted_crashes(&self) -> usize {
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
        stream.is_some_and(|stream| !stream.crashes.is_empty() && stream.is_isolated())
    }

    /// Whether a leased stream may be about to crash its worker, so that no second worker may begin with it: the worker
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

    /// Records that a worker has no connection. Its leases may have crashed it, so no other worker gets a copy of them
    /// before it is known whether the worker [comes back](Self::heartbeat) or [has crashed](Self::mark_crashed).
    pub fn mark_disconnected(&mut self, worker: &WorkerId) {
        if let Some(state) = self.workers.known.get_mut(worker) {
            state.is_disconnected = true;
        }
    }

    /// Ends the leases of a worker that seems to have crashed, and records the crash for their streams. If the worker
    /// calls again, the crash is taken back, and the worker continues with the samples that are still needed.
    pub fn mark_crashed(&mut self, worker: &WorkerId, now: Duration) -> Vec<Crash> {
        let Some(state) = self.workers.known.get_mut(worker) else {
            return Vec::new();
        };
        state.has_crashed = true;
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
            false => self.count_crash(worker, open),
        }
    }

    /// Counts the crash of a worker that left a note of the units it was computing, `begun`. This replaces the crashes
    /// that [`mark_crashed`](Self::mark_crashed) has counted for the worker. Units that are no longer missing are left
    /// out. The crashes of streams that are not wanted yet are returned, too, for their [`History`](crate::History).
    pub fn record_crash(&mut self, worker: &WorkerId, begun: &[(LeaseId, Unit)]) -> Vec<Crash> {
        self.take_crashes_back(worker);
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
        self.count_crash(worker, open.collect())
    }

    /// Counts a crash against the streams of the units that were open.
    fn count_crash(&mut self, worker: &WorkerId, open: Vec<(LeaseId, Unit)>) -> Vec<Crash> {
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
        let crash = |(stream, (lease, first)): (StreamId, (LeaseId, u32))| {
            let record = CrashRecord { is_alone, first };
            Crash {
                lease,
                worker: worker.clone(),
                stream,
                record,
                quarantined: self.count_against(worker, stream, record),
            }
        };
        first_of.into_iter().map(crash).collect()
    }

    /// Counts a crash against a stream. Returns whether that quarantined the stream.
    fn count_against(&mut self, worker: &WorkerId, id: StreamId, crash: CrashRecord) -> bool {
        let Some(stream) = self.streams.get_mut(&id) else {
            return false;
        };
        stream.crashes.insert(worker.clone(), crash);
        let counted = stream.counted_crashes();
        let is_enough = counted >= self.options.max_crashes.max(1);
        if !is_enough || stream.quarantined.is_some() {
            return false;
        }
        let error = format!("{counted} workers crashed on it, the last was {worker}");
        self.begin_quarantine(id, error, true);
        true
    }

    /// Takes back the crashes of a worker that was only silent.
    pub(crate) fn take_crashes_back(&mut self, worker: &WorkerId) {
        if let Some(state) = self.workers.known.get_mut(worker) {
            state.has_crashed = false;
        }
        let has_crashed_on = |stream: &Stream<P>| stream.crashes.contains_key(worker);
        let of_it = self.streams.iter();
        let of_it = of_it.filter(|(_, stream)| has_crashed_on(stream));
        for id in of_it.map(|(id, _)| *id).collect::<BTreeSet<_>>() {
            self.take_crash_back(worker, id);
        }
    }

    /// Takes back the crash of a worker that has delivered the stream after all.
    pub(crate) fn take_crash_back(&mut self, worker: &WorkerId, id: StreamId) {
        let Some(stream) = self.streams.get_mut(&id) else {
            return;
        };
        stream.crashes.remove(worker);
        let for_crashes = stream.quarantined.as_ref().is_some_and(|g| g.for_crashes);
        if for_crashes && stream.counted_crashes() < self.options.max_crashes.max(1) {
            self.reopen(id);
        }
    }
}
