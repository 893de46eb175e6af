//! The state machine.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::time::Duration;

use crate::cutting::{DESIGN_WEIGHT, TARGET_SECONDS, UNKNOWN_SECONDS, weight};
use crate::options::Options;
use crate::ranges::{common, overlap, subtract};
use crate::state::{GivenUp, Lease, Stream};
use crate::types::{
    Accepted, Counts, Delivery, Failure, Generation, Grant, Group, Kind, LeaseId, StreamId, Unit,
    Vanished, Wanted, WorkerId, WorkerStatus,
};
use crate::workers::{Worker, Workers};

/// How much a new measurement counts against the earlier ones.
const LEARNING_RATE: f64 = 0.3;
/// What means looking at all leases, or at all workers, is worked out so often: not for each of a
/// thousand workers that ask.
const SURVEY_PERIOD: Duration = Duration::from_secs(1);
/// No lease is expected to take longer than this, in seconds: ten years.
const LONGEST_LEASE: f64 = 3e8;
/// How many times longer each wait after a failure is.
const RETRY_GROWTH: u32 = 4;
/// Workers that have been silent for so many leases are forgotten; should one call again, it is told
/// to register.
const FORGOTTEN_AFTER: u32 = 60;

/// What is missing, who computes it, and what became of it.
///
/// Every `now` is the time since one arbitrary origin. A `now` before an earlier one is harmless:
/// leases then run out a little early or late.
#[derive(Debug, Clone)]
pub struct Ledger<P> {
    pub(crate) options: Options,
    epoch: u64,
    /// The number of the newest lease.
    newest: u64,
    pub(crate) is_draining: bool,
    /// Until when nothing is leased, so that workers can say what they hold from before a restart.
    closed_until: Duration,
    pub(crate) streams: BTreeMap<StreamId, Stream<P>>,
    /// Streams that need nothing more: what their values depended on, and the end of what was wanted.
    settled: BTreeMap<StreamId, (Generation, u32)>,
    /// The streams from which something could be leased now.
    pub(crate) free: BTreeSet<StreamId>,
    /// The streams that wait after a failure, by the end of that.
    pub(crate) waiting: BTreeSet<(Duration, StreamId)>,
    pub(crate) given_up: BTreeSet<StreamId>,
    /// How many streams of a group are neither settled nor given up.
    open: BTreeMap<Group, usize>,
    /// Whether a group was settled since somebody last asked.
    has_settled: bool,
    pub(crate) leases: BTreeMap<LeaseId, Lease>,
    /// The leases by the time at which they run out.
    expiries: BTreeSet<(Duration, LeaseId)>,
    /// The leases whose samples nobody else has, the oldest first.
    alone: BTreeSet<(Duration, LeaseId)>,
    /// Leases that ran out: their workers may only have slept.
    lapsed: BTreeMap<LeaseId, Lease>,
    pub(crate) workers: Workers,
    /// Seconds per weight of what was delivered, by kind.
    pub(crate) pace: BTreeMap<Kind, f64>,
    /// When it was worked out how long a lease is left to its worker alone, and how long that is.
    patience: Option<(Duration, Duration)>,
    /// When the slots of the workers were counted, and how many they were.
    slots: Option<(Duration, usize)>,
    delivered: u64,
    stale: u64,
}

impl<P: Clone> Ledger<P> {
    /// A ledger in which nothing is wanted. `epoch` tells it from the ones before a restart.
    pub fn new(options: Options, epoch: u64) -> Self {
        Self {
            options,
            epoch,
            newest: 0,
            is_draining: false,
            closed_until: Duration::ZERO,
            streams: BTreeMap::new(),
            settled: BTreeMap::new(),
            free: BTreeSet::new(),
            waiting: BTreeSet::new(),
            given_up: BTreeSet::new(),
            open: BTreeMap::new(),
            has_settled: false,
            leases: BTreeMap::new(),
            expiries: BTreeSet::new(),
            alone: BTreeSet::new(),
            lapsed: BTreeMap::new(),
            workers: Workers::default(),
            pace: BTreeMap::new(),
            patience: None,
            slots: None,
            delivered: 0,
            stale: 0,
        }
    }

    /// The epoch given at the start.
    pub const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// How long a lease lasts.
    pub const fn lease_time(&self) -> Duration {
        self.options.lease
    }

    /// Leases nothing before this time, so that whoever holds something from before a restart can say
    /// so before others are given it.
    pub const fn close_until(&mut self, time: Duration) {
        self.closed_until = time;
    }

    /// Stops leasing, or goes on with it. What is held goes on, and is delivered as ever.
    pub const fn set_draining(&mut self, is_draining: bool) {
        self.is_draining = is_draining;
    }

    /// Whether nothing is leased for now.
    pub const fn is_draining(&self) -> bool {
        self.is_draining
    }

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
        let Some(end) = missing.last().map(|range| range.end) else {
            return false;
        };
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
                given_up: None,
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

    /// Gives what was given up another chance, with fresh counters, and returns it. Whoever asks for
    /// that has mended the cause: nobody waits after a failure any more, and no worker is suspended.
    pub fn retry(&mut self) -> Vec<StreamId> {
        let retried: Vec<StreamId> = self.given_up.iter().copied().collect();
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

    // What is known.

    /// What was given up, each with the error that was the last straw.
    pub fn given_up(&self) -> impl Iterator<Item = (StreamId, &str)> {
        self.given_up.iter().filter_map(|&id| {
            let given_up = self.streams.get(&id)?.given_up.as_ref()?;
            Some((id, given_up.error.as_str()))
        })
    }

    /// Whether a group was settled since this was last asked.
    pub const fn take_settled(&mut self) -> bool {
        std::mem::replace(&mut self.has_settled, false)
    }

    /// Whether a worker that asked now might get something.
    pub fn has_work(&self) -> bool {
        !self.free.is_empty() || !self.alone.is_empty()
    }

    /// Whether no lease is out.
    pub fn is_idle(&self) -> bool {
        self.leases.is_empty()
    }

    /// How much there is in which state.
    pub fn counts(&self) -> Counts {
        Counts {
            free: self.free.len(),
            waiting: self.waiting.len(),
            leased: self.leases.len(),
            delivered: self.delivered,
            given_up: self.given_up.len(),
            stale: self.stale,
        }
    }

    /// What a lease of this kind usually takes, in seconds, once one was delivered.
    pub fn usual_seconds(&self, kind: Kind) -> Option<f64> {
        let unit = Unit {
            stream: StreamId { kind, index: 0 },
            generation: Generation::default(),
            samples: 0..1,
        };
        self.pace.get(&kind).map(|pace| pace * weight(&[unit]))
    }

    /// The registered workers, by name.
    pub fn workers(&self) -> impl Iterator<Item = WorkerStatus> {
        self.workers.known.iter().map(|(id, worker)| WorkerStatus {
            worker: id.clone(),
            host: worker.host.clone(),
            slots: worker.slots,
            leased: worker.held.len(),
            delivered: worker.delivered,
            failed: worker.failed,
            crashed: worker.crashed,
            suspended_until: worker.suspended_until,
            last_seen: worker.last_seen,
        })
    }

    /// Panics unless the books agree with each other: the crate's invariants, for tests.
    #[doc(hidden)]
    pub fn check(&self) {
        let mut open: BTreeMap<Group, usize> = BTreeMap::new();
        for (&id, stream) in &self.streams {
            assert!(!stream.missing.is_empty(), "{id} is settled");
            assert!(!self.settled.contains_key(&id), "{id} is settled and open");
            let mut free = stream.missing.clone();
            for holder in &stream.leases {
                let units = &self.leases[holder].units;
                for unit in units.iter().filter(|unit| unit.stream == id) {
                    assert_eq!(unit.generation, stream.generation, "{id}");
                    subtract(&mut free, &unit.samples);
                }
            }
            assert_eq!(
                stream.free, free,
                "{id}: free is what is missing and not leased"
            );
            let is_free = stream.has_free() && stream.waits_until.is_none();
            assert_eq!(self.free.contains(&id), is_free, "{id}");
            assert_eq!(
                self.given_up.contains(&id),
                stream.given_up.is_some(),
                "{id}"
            );
            let waits = stream.waits_until;
            assert!(
                waits.is_none_or(|until| self.waiting.contains(&(until, id))),
                "{id}"
            );
            if stream.given_up.is_none() {
                *open.entry(id.group()).or_default() += 1;
            }
        }
        assert_eq!(open, self.open);
        let known = |id: &StreamId| self.streams.contains_key(id);
        assert!(self.free.iter().chain(&self.given_up).all(known));
        assert!(self.waiting.iter().all(|(_, id)| known(id)));
        for (id, lease) in &self.leases {
            assert!(!lease.units.is_empty(), "{id} holds nothing");
            assert!(!self.lapsed.contains_key(id), "{id} ran out and did not");
            assert!(self.expiries.contains(&(lease.expires, *id)));
            for unit in &lease.units {
                assert!(self.streams[&unit.stream].leases.contains(id), "{id}");
                let rivals = self.rivals(unit);
                for sample in unit.samples.clone() {
                    let has = |rival: &&LeaseId| {
                        let mut units = self.leases[rival].units.iter();
                        units.any(|u| u.stream == unit.stream && u.samples.contains(&sample))
                    };
                    let having: Vec<&LeaseId> = rivals.iter().filter(has).collect();
                    assert!(having.len() <= 2, "{having:?} have sample {sample}");
                    let workers = having.iter().map(|id| &self.leases[id].worker);
                    let workers: BTreeSet<&WorkerId> = workers.collect();
                    assert_eq!(workers.len(), having.len(), "{having:?}: one worker");
                }
            }
        }
        assert_eq!(self.expiries.len(), self.leases.len());
        let is_out = |(_, id): &(Duration, LeaseId)| self.leases.contains_key(id);
        assert!(self.alone.iter().all(is_out));
    }

    // Streams.

    /// Puts a stream where it belongs, after any change to it.
    fn file(&mut self, id: StreamId) {
        let stream = self.streams.get(&id);
        if stream.is_some_and(|stream| stream.has_free() && stream.waits_until.is_none()) {
            self.free.insert(id);
        } else {
            self.free.remove(&id);
        }
    }

    /// Ends waits after failures that are over.
    fn wake(&mut self, now: Duration) {
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

    fn stored(&mut self, unit: &Unit) {
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

    fn settle(&mut self, id: StreamId, end: u32) {
        if let Some(generation) = self.remove(id) {
            self.settled.insert(id, (generation, end));
        }
    }

    /// Takes a stream out of everything.
    fn remove(&mut self, id: StreamId) -> Option<Generation> {
        let stream = self.streams.remove(&id)?;
        self.file(id);
        if let Some(until) = stream.waits_until {
            self.waiting.remove(&(until, id));
        }
        if !self.given_up.remove(&id) {
            self.close(id);
        }
        let holders: Vec<LeaseId> = stream.leases.into_iter().collect();
        self.prune(&holders);
        Some(stream.generation)
    }

    fn close(&mut self, id: StreamId) {
        let open = self.open.entry(id.group()).or_default();
        *open -= 1;
        if *open == 0 {
            self.open.remove(&id.group());
            self.has_settled = true;
        }
    }

    fn give_up(&mut self, id: StreamId, error: String, for_crashes: bool) {
        let Some(stream) = self.streams.get_mut(&id) else {
            return;
        };
        stream.given_up = Some(GivenUp { error, for_crashes });
        if let Some(until) = stream.waits_until.take() {
            self.waiting.remove(&(until, id));
        }
        self.given_up.insert(id);
        self.close(id);
        self.file(id);
        self.prune(&self.holders(id));
    }

    fn reopen(&mut self, id: StreamId) {
        if !self.given_up.remove(&id) {
            return;
        }
        *self.open.entry(id.group()).or_default() += 1;
        if let Some(stream) = self.streams.get_mut(&id) {
            stream.given_up = None;
        }
        self.file(id);
    }

    fn fail(
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
        if state.is_leaving || stream.given_up.is_some() {
            return ignored;
        }
        state.failed += 1;
        let suspended = self.workers.strike(worker, id, &self.options, now);
        if stream.waits_until.is_some() {
            // Leased before the failure for which it waits, and most likely failed for the same
            // reason.
            return (Failure::Ignored, suspended);
        }
        stream.failures += 1;
        if stream.failures >= self.options.max_failures.max(1) {
            self.give_up(id, error.to_owned(), false);
            return (Failure::GivenUp, suspended);
        }
        let growth = RETRY_GROWTH.saturating_pow(stream.failures - 1);
        let wait = self.options.retry_after.saturating_mul(growth);
        let until = now.saturating_add(wait);
        stream.waits_until = Some(until);
        self.waiting.insert((until, id));
        self.file(id);
        (Failure::Retry(wait), suspended)
    }

    /// A worker was only silent: the stream is not to blame for that.
    fn take_blame_back(&mut self, worker: &WorkerId, id: StreamId) {
        let Some(stream) = self.streams.get_mut(&id) else {
            return;
        };
        stream.blame.remove(worker);
        let for_crashes = stream.given_up.as_ref().is_some_and(|g| g.for_crashes);
        if for_crashes && stream.crashes() < self.options.max_crashes.max(1) {
            self.reopen(id);
        }
    }

    // Leases.

    fn holds(&self, worker: &WorkerId, id: LeaseId) -> bool {
        let lease = self.leases.get(&id);
        lease.is_some_and(|lease| lease.worker == *worker)
    }

    fn holders(&self, id: StreamId) -> Vec<LeaseId> {
        let stream = self.streams.get(&id);
        stream.map_or_else(Vec::new, |stream| stream.leases.iter().copied().collect())
    }

    /// How long units are expected to take, in seconds.
    pub(crate) fn expected(&self, units: &[Unit]) -> f64 {
        let pace = units
            .first()
            .and_then(|unit| self.pace.get(&unit.stream.kind));
        match pace {
            Some(pace) => pace * weight(units),
            None if self.options.long_samples => UNKNOWN_SECONDS,
            None => TARGET_SECONDS,
        }
    }

    fn grant(&mut self, worker: &WorkerId, units: Vec<Unit>, now: Duration) -> Grant<P> {
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
            seconds,
            announce: units.iter().any(|unit| {
                let stream = self.streams.get(&unit.stream);
                stream.is_some_and(|stream| stream.has_lapsed)
            }),
        };
        let lease = Lease {
            worker: worker.clone(),
            units,
            granted: now,
            expires: now.saturating_add(self.options.lease),
            started: false,
            seconds,
        };
        self.add(id, lease);
        granted
    }

    fn add(&mut self, id: LeaseId, lease: Lease) {
        for unit in &lease.units {
            if let Some(stream) = self.streams.get_mut(&unit.stream) {
                stream.take(id, &unit.samples);
            }
            self.file(unit.stream);
        }
        self.expiries.insert((lease.expires, id));
        self.alone.insert((lease.granted, id));
        if let Some(state) = self.workers.known.get_mut(&lease.worker) {
            state.held.insert(id);
        }
        self.leases.insert(id, lease);
    }

    /// Extends a lease that the worker holds.
    fn extend(&mut self, worker: &WorkerId, id: LeaseId, started: bool, now: Duration) -> bool {
        let expires = now.saturating_add(self.options.lease);
        let Some(lease) = self.leases.get_mut(&id) else {
            return false;
        };
        if lease.worker != *worker {
            return false;
        }
        self.expiries.remove(&(lease.expires, id));
        // A heartbeat that was overtaken must not shorten the lease.
        lease.expires = lease.expires.max(expires);
        lease.started |= started;
        self.expiries.insert((lease.expires, id));
        true
    }

    /// Makes a lease of what is still needed of one that ran out or is from before a restart.
    fn take_up(&mut self, id: LeaseId, lease: Lease, now: Duration) -> bool {
        let units = self.needed(&lease.units);
        let rivals: BTreeSet<LeaseId> = units.iter().flat_map(|unit| self.rivals(unit)).collect();
        // Another worker has begun with it, or will: this one may go on if it has begun, too. What it
        // was leased itself meanwhile, it need not begin.
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

    /// The leases that have samples of a unit.
    fn rivals(&self, unit: &Unit) -> Vec<LeaseId> {
        let holders = self.holders(unit.stream).into_iter();
        holders
            .filter(|id| {
                let lease = self.leases.get(id);
                lease.is_some_and(|lease| lease.units.iter().any(|other| meet(other, unit)))
            })
            .collect()
    }

    /// What is still missing of units.
    fn needed(&self, units: &[Unit]) -> Vec<Unit> {
        let mut needed = Vec::new();
        for unit in units {
            let Some(stream) = self.streams.get(&unit.stream) else {
                continue;
            };
            let is_given_up = stream.given_up.as_ref().is_some_and(|g| !g.for_crashes);
            if stream.generation != unit.generation || is_given_up {
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

    /// What somebody else has held for long enough that another worker is to have it, too.
    fn double(&mut self, worker: &WorkerId, now: Duration) -> Option<(LeaseId, Vec<Unit>)> {
        let patience = self.patience_at(now);
        let failed = &self.workers.known.get(worker)?.strikes;
        let old = self.alone.iter();
        let old = old.take_while(|(granted, _)| now.saturating_sub(*granted) >= patience);
        for &(_, id) in old {
            let lease = self.leases.get(&id)?;
            if lease.worker == *worker {
                continue;
            }
            let mut units = self.needed(&lease.units);
            units.retain(|unit| {
                let stream = self.streams.get(&unit.stream);
                let may_be =
                    |stream: &Stream<P>| stream.given_up.is_none() && stream.waits_until.is_none();
                stream.is_some_and(may_be) && !failed.contains(&unit.stream)
            });
            if !units.is_empty() {
                return Some((id, units));
            }
        }
        None
    }

    /// Ends a lease: what is missing of it and on no other is free again.
    fn end(&mut self, id: LeaseId) -> Option<Lease> {
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
            let mut held: Vec<Range<u32>> = Vec::new();
            for other in self.rivals(unit) {
                let Some(other_lease) = self.leases.get(&other) else {
                    continue;
                };
                let units = other_lease.units.iter();
                let shared = units.filter(|other| meet(other, unit));
                held.extend(shared.map(|unit| unit.samples.clone()));
                self.alone.insert((other_lease.granted, other));
            }
            if let Some(stream) = self.streams.get_mut(&unit.stream) {
                stream.free_again(&unit.samples, &held);
            }
            self.file(unit.stream);
        }
        Some(lease)
    }

    /// Ends those of these leases of which nothing is needed any more, and takes out of the others
    /// what is not: whoever holds one that has ended is told so by its next heartbeat.
    fn prune(&mut self, leases: &[LeaseId]) {
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

    fn expire_lease(&mut self, id: LeaseId) -> Option<Vanished> {
        let lease = self.end(id)?;
        let worker = lease.worker.clone();
        let streams: BTreeSet<StreamId> = lease.units.iter().map(|unit| unit.stream).collect();
        for id in &streams {
            if let Some(stream) = self.streams.get_mut(id) {
                stream.has_lapsed = true;
            }
        }
        let has_started = lease.started;
        self.lapsed.insert(id, lease);
        let state = self.workers.known.get_mut(&worker);
        if !has_started || state.as_ref().is_some_and(|state| state.is_leaving) {
            return None;
        }
        if let Some(state) = state {
            state.crashed += 1;
        }
        let &first = streams.first()?;
        let is_split = streams.len() > 1;
        let mut given_up = false;
        for id in streams {
            let Some(stream) = self.streams.get_mut(&id) else {
                continue;
            };
            if is_split {
                stream.is_suspect = true;
                continue;
            }
            stream.blame.insert(worker.clone());
            let crashes = stream.crashes();
            if crashes >= self.options.max_crashes.max(1) && stream.given_up.is_none() {
                given_up = true;
                let error = format!("{crashes} workers fell silent over it, {worker} last");
                self.give_up(id, error, true);
            }
        }
        Some(Vanished {
            lease: id,
            worker,
            stream: first,
            is_split,
            given_up,
        })
    }

    /// Learns what samples cost from what a lease took.
    fn learn(&mut self, delivery: &Delivery) {
        let refused = delivery.refused.iter().map(|(stream, _)| stream.kind);
        let stored = delivery.stored.iter().map(|unit| unit.stream.kind);
        let Some(kind) = stored.chain(refused).next() else {
            return;
        };
        if !delivery.seconds.is_finite() || delivery.seconds <= 0.0 {
            return;
        }
        let analysed = DESIGN_WEIGHT as f64 * delivery.refused.len() as f64;
        let measured = delivery.seconds / (weight(&delivery.stored) + analysed);
        self.pace
            .entry(kind)
            .and_modify(|pace| *pace += LEARNING_RATE * (measured - *pace))
            .or_insert(measured);
    }

    /// How long a lease is left to its worker alone: twice what one takes, as a second lease of what
    /// is nearly done is wasted work.
    fn patience_at(&mut self, now: Duration) -> Duration {
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

    /// The slots of all workers that were heard of lately.
    fn slots_present(&mut self, now: Duration) -> usize {
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

    /// Forgets what no longer matters: leases that ran out and of which nothing is needed, workers
    /// that have been away for long.
    fn clean(&mut self, now: Duration) {
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
