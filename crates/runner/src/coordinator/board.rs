//! The ledger behind a lock, with real time and notifications. The service and the engine share it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::protocol::MAX_MESSAGE_BYTES;
use campaign::Campaign;
use campaign::task::Source;
use ledger::{
    Crash, Delivery, Failure, Generation, Grant, History, Kind, LeaseId, Ledger, Options,
    StreamDemand, StreamId, Unit, Verdict, WorkerId, WorkerStatus,
};
use results::running::Running;
use stages::searching::Progress;
use tokio::sync::Notify;
use tokio::time::Instant;

use crate::coordinator::pace::{Meters, Runs};

/// No further lease is added to a response once its sources reach this many bytes.
const BYTES_PER_ANSWER: usize = MAX_MESSAGE_BYTES / 8;

/// The limits of a lease request.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    /// Maximum number of leases.
    pub leases: usize,
    /// No further lease is added once the leases are expected to take this long, in seconds.
    pub seconds: f64,
}

/// The instruction to all workers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// Keep working.
    Work,
    /// Leave: the campaign is finished.
    Finished,
    /// Leave: the coordinator ends before the campaign is finished.
    Leave,
}

struct Inner {
    ledger: Ledger<Arc<Source>>,
    /// Crashes and failures before this coordinator started, by stream name.
    histories: BTreeMap<StreamId, History>,
    /// Rates of stored samples, of all workers and of each.
    meters: Meters,
    of_workers: BTreeMap<WorkerId, Meters>,
    /// Durations of whole optimiser runs.
    runs: Runs,
    /// Progress of the searches on an external simulator.
    searches: Vec<Progress>,
    /// Workers whose results are being stored.
    reporting: BTreeSet<WorkerId>,
    /// Whether the engine has posted its first plan. Before, the service refuses workers.
    is_ready: bool,
    course: Course,
    retries: u64,
    /// Number of the current state, for clients that watch for changes.
    revision: u64,
}

/// The ledger of a campaign.
pub struct Board {
    inner: Mutex<Inner>,
    epoch: u64,
    origin: Instant,
    /// Notified when a job may have become free.
    available: Notify,
    /// Notified when a group of streams is settled.
    settled: Notify,
    /// Notified when the revision grows.
    changed: Notify,
}

/// The limits of a campaign's ledger.
#[must_use]
pub fn options(campaign: &Campaign) -> Options {
    Options {
        long_samples: campaign.is_external(),
        max_failures: campaign.simulator.attempts(),
        retry_for: campaign.simulator.retry_for(),
        ..Options::default()
    }
}

impl Board {
    /// Creates a board without jobs.
    #[must_use]
    pub fn new(options: Options, epoch: u64) -> Self {
        Self {
            epoch,
            inner: Mutex::new(Inner {
                ledger: Ledger::new(options, epoch),
                histories: BTreeMap::new(),
                meters: Meters::default(),
                of_workers: BTreeMap::new(),
                runs: Runs::default(),
                searches: Vec::new(),
                reporting: BTreeSet::new(),
                is_ready: false,
                course: Course::Work,
                retries: 0,
                revision: 1,
            }),
            origin: Instant::now(),
            available: Notify::new(),
            settled: Notify::new(),
            changed: Notify::new(),
        }
    }

    /// A number that differs after every start of the coordinator.
    #[must_use]
    pub const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Duration of a lease.
    #[must_use]
    pub fn lease_time(&self) -> Duration {
        self.lock().ledger.lease_time()
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // A panic cannot leave an update half done, so the state stays usable.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        self.origin.elapsed()
    }

    /// Applies a change and notifies the tasks that wait for it.
    fn change<T>(&self, act: impl FnOnce(&mut Inner, Duration) -> T) -> T {
        let mut inner = self.lock();
        let result = act(&mut inner, self.now());
        self.ring(inner);
        result
    }

    fn ring(&self, mut inner: MutexGuard<'_, Inner>) {
        inner.revision += 1;
        let has_settled = inner.ledger.take_settled();
        let has_work = inner.ledger.counts().free > 0 || inner.course != Course::Work;
        drop(inner);
        if has_work {
            self.available.notify_waiters();
        }
        if has_settled {
            self.settled.notify_waiters();
        }
        self.changed.notify_waiters();
    }

    // For the engine.

    /// Restores the crashes and failures of streams from before a restart.
    pub fn remember(&self, histories: Vec<store::StreamHistory>) {
        let known = histories.into_iter().map(|history| {
            let counted = History {
                crashes: history.crashes as usize,
                failures: history.failures,
            };
            (history.stream, counted)
        });
        self.lock().histories = known.collect();
    }

    /// Grants no lease for this long, so that workers that hold leases from before a restart can
    /// report them first.
    pub fn delay_leases(&self, grace: Duration) {
        let until = self.now() + grace;
        self.change(|inner, _| inner.ledger.close_until(until));
    }

    /// Adds missing samples to the ledger. Samples known already keep their state.
    pub fn want(&self, wanted: Vec<StreamDemand<Arc<Source>>>) {
        self.change(|inner, _| {
            for mut wanted in wanted {
                if !inner.histories.is_empty() {
                    wanted.history = inner.histories.remove(&wanted.stream).unwrap_or_default();
                }
                inner.ledger.want(wanted);
            }
        });
    }

    /// Names a unit whose samples are stored: workers whose jobs fail get it to show that they can
    /// compute anything.
    pub fn set_control(&self, unit: Unit, source: Arc<Source>) {
        self.lock().ledger.set_control(unit, source);
    }

    /// Forgets streams whose samples are no longer needed.
    pub fn forget(&self, which: impl Fn(StreamId) -> bool) {
        self.change(|inner, _| inner.ledger.forget(which));
    }

    /// Lets workers register: the first plan is posted.
    pub fn open(&self) {
        self.lock().is_ready = true;
    }

    /// Whether the first plan is posted.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.lock().is_ready
    }

    /// Ends the expired leases and returns those that had started: each may be a crash.
    pub fn expire(&self) -> Vec<Crash> {
        let now = self.now();
        let mut inner = self.lock();
        let before = inner.ledger.counts();
        let vanished = inner.ledger.expire(now);
        if inner.ledger.counts() != before {
            self.ring(inner);
        }
        vanished
    }

    /// The quarantined streams.
    #[must_use]
    pub fn quarantined(&self) -> BTreeSet<StreamId> {
        let inner = self.lock();
        inner
            .ledger
            .quarantined()
            .map(|(stream, _)| stream)
            .collect()
    }

    /// Returns a future that ends when the next group of streams is settled.
    pub fn watch(&self) -> tokio::sync::futures::Notified<'_> {
        self.settled.notified()
    }

    /// Whether leasing was stopped and no lease is left.
    #[must_use]
    pub fn is_drained(&self) -> bool {
        let inner = self.lock();
        inner.ledger.is_draining() && inner.ledger.is_idle()
    }

    /// Waits until [`is_drained`](Self::is_drained).
    pub async fn drained(&self) {
        loop {
            let changed = self.changed.notified();
            if self.is_drained() {
                return;
            }
            changed.await;
        }
    }

    /// Sets the instruction to all workers.
    pub fn set_course(&self, course: Course) {
        self.change(|inner, _| inner.course = course);
    }

    /// Number of retries that found quarantined streams.
    #[must_use]
    pub fn retries(&self) -> u64 {
        self.lock().retries
    }

    /// Tells all workers that the campaign is finished, unless there were more retries than `seen`:
    /// a retry may arrive while the report is written. Returns whether the campaign is finished.
    #[must_use]
    pub fn finish(&self, seen: u64) -> bool {
        self.change(|inner, _| {
            let is_finished = inner.retries == seen;
            if is_finished {
                inner.course = Course::Finished;
            }
            is_finished
        })
    }

    /// Waits until a finished campaign has work again, which a retry adds.
    pub async fn reopened(&self) {
        loop {
            let changed = self.changed.notified();
            if self.lock().course == Course::Work {
                return;
            }
            changed.await;
        }
    }

    /// Whether every worker that called within the duration of a lease has been told to leave.
    #[must_use]
    pub fn all_dismissed(&self) -> bool {
        let inner = self.lock();
        let recently = inner.ledger.lease_time();
        inner.ledger.all_dismissed(recently, self.now())
    }

    // For workers.

    /// Registers a worker with the leases that it holds from before a restart. Returns those that
    /// are no longer needed.
    pub fn register(
        &self,
        worker: &WorkerId,
        host: &str,
        slots: u32,
        held: &[(LeaseId, Vec<Unit>)],
    ) -> Vec<LeaseId> {
        self.change(|inner, now| {
            inner.ledger.register(worker, host, slots as usize, now);
            let needless = held.iter().filter(|(id, units)| {
                let is_needed = inner.ledger.adopt(worker, *id, units, now);
                !is_needed
            });
            needless.map(|(id, _)| *id).collect()
        })
    }

    /// Records that a worker called. Returns false if the worker is not registered.
    #[must_use]
    pub fn is_known(&self, worker: &WorkerId) -> bool {
        let now = self.now();
        self.lock().ledger.see(worker, now)
    }

    /// Grants leases up to the limits of `room`. Waits up to `wait` for a free job, and returns no
    /// lease if none becomes free or the worker is to leave.
    pub async fn lease(
        &self,
        worker: &WorkerId,
        room: Room,
        wait: Duration,
    ) -> Vec<Grant<Arc<Source>>> {
        let deadline = Instant::now() + wait;
        loop {
            let available = self.available.notified();
            let due = {
                let mut inner = self.lock();
                if inner.course != Course::Work {
                    return Vec::new();
                }
                let grants = inner.grant(worker, room, self.now());
                if !grants.is_empty() {
                    inner.revision += 1;
                    drop(inner);
                    self.changed.notify_waiters();
                    return grants;
                }
                inner.ledger.next_due(worker, self.now())
            };
            // Some jobs become free with time, without a notification.
            let due = due.map_or(deadline, |due| deadline.min(self.origin + due));
            let _ = tokio::time::timeout_at(due, available).await;
            if Instant::now() >= deadline {
                return Vec::new();
            }
        }
    }

    /// Extends the leases that a worker holds and returns those that are no longer needed.
    pub fn heartbeat(&self, worker: &WorkerId, held: &[(LeaseId, bool)]) -> Vec<LeaseId> {
        let now = self.now();
        self.lock().ledger.heartbeat(worker, held, now)
    }

    /// Takes released leases back. `leaving` says that the worker asks for no more.
    pub fn release(&self, worker: &WorkerId, leases: &[LeaseId], leaving: bool) {
        self.change(|inner, now| {
            if leaving {
                inner.ledger.leaves(worker, now);
            }
            inner.ledger.release(worker, leases, now);
        });
    }

    /// Marks that the results of a worker are being stored. Returns none while those of an earlier
    /// call are.
    #[must_use]
    pub fn begin_report(self: &Arc<Self>, worker: &WorkerId) -> Option<Reporting> {
        let is_first = self.lock().reporting.insert(worker.clone());
        is_first.then(|| Reporting {
            board: Arc::clone(self),
            worker: worker.clone(),
        })
    }

    /// Whether the results of a unit are to be stored.
    #[must_use]
    pub fn accept(&self, unit: &Unit) -> Verdict {
        self.lock().ledger.accept(unit)
    }

    /// Ends a lease whose results are stored. Returns the consequence of each failure, and the
    /// duration of the suspension if the failures suspended the worker.
    pub fn deliver(
        &self,
        worker: &WorkerId,
        lease: LeaseId,
        delivery: Delivery,
    ) -> (Vec<Failure>, Option<Duration>) {
        self.change(|inner, now| {
            // A worker may report any number, but no lease can have lasted longer than this
            // coordinator.
            let seconds = delivery.seconds.min(now.as_secs_f64());
            let delivery = Delivery {
                seconds,
                ..delivery
            };
            inner.meters.count(now, &delivery.stored);
            let own = inner.of_workers.entry(worker.clone()).or_default();
            own.count(now, &delivery.stored);
            let of_run = |unit: &Unit| unit.stream.kind == Kind::Run;
            // A lease has one whole run, or none.
            if inner.searches.is_empty() && delivery.stored.iter().any(of_run) {
                inner.runs.count(seconds);
            }
            let (failures, until) = inner.ledger.deliver(worker, lease, &delivery, now);
            (failures, until.map(|until| until.saturating_sub(now)))
        })
    }

    /// The generation and the source of a stream that lacks samples.
    #[must_use]
    pub fn source(&self, stream: StreamId) -> Option<(Generation, Arc<Source>)> {
        let inner = self.lock();
        let (generation, source) = inner.ledger.source(stream)?;
        Some((generation, Arc::clone(source)))
    }

    /// Settles samples in whose place a failure is stored.
    pub fn conclude(&self, unit: &Unit) {
        self.change(|inner, _| inner.ledger.conclude(unit));
    }

    /// Settles a design in whose place a failure is stored.
    pub fn refuse(&self, stream: StreamId, generation: Generation) {
        self.change(|inner, _| inner.ledger.refuse(stream, generation));
    }

    /// Quarantines a stream whose failure cannot be stored as a result.
    pub fn give_up(&self, stream: StreamId, error: &str) {
        self.change(|inner, _| inner.ledger.give_up(stream, error));
    }

    /// Returns the instruction to workers, and records that `worker` has been told if it is to
    /// leave.
    #[must_use]
    pub fn course_for(&self, worker: &WorkerId) -> Course {
        let mut inner = self.lock();
        if inner.course != Course::Work {
            inner.ledger.dismiss(worker);
        }
        inner.course
    }

    // For clients.

    /// Frees the quarantined streams and returns them.
    pub fn retry(&self) -> Vec<StreamId> {
        let retried = self.change(|inner, _| {
            let retried = inner.ledger.retry();
            if !retried.is_empty() {
                inner.retries += 1;
                inner.course = Course::Work;
            }
            retried
        });
        // Wakes the engine, which counts the retried streams as settled.
        self.settled.notify_waiters();
        retried
    }

    /// Stops or resumes leasing. Returns the number of leases that workers hold.
    pub fn drain(&self, is_draining: bool) -> usize {
        self.change(|inner, _| {
            inner.ledger.set_draining(is_draining);
            inner.ledger.counts().leased
        })
    }

    /// Whether leasing was stopped.
    #[must_use]
    pub fn is_draining(&self) -> bool {
        self.lock().ledger.is_draining()
    }

    /// Waits up to `wait` for a revision other than `seen` and returns the current one.
    pub async fn changed(&self, seen: u64, wait: Duration) -> u64 {
        let deadline = Instant::now() + wait;
        loop {
            let changed = self.changed.notified();
            let revision = self.lock().revision;
            if revision != seen || tokio::time::timeout_at(deadline, changed).await.is_err() {
                return revision;
            }
        }
    }

    /// Returns the reasons why no job, or no further job, is being computed.
    #[must_use]
    pub fn explain(&self) -> Vec<String> {
        let inner = self.lock();
        if inner.course == Course::Finished {
            return vec!["the campaign is finished".to_owned()];
        }
        let reasons = inner.ledger.explain(self.now());
        reasons.iter().map(ToString::to_string).collect()
    }

    /// Records the progress of the searches on an external simulator.
    pub fn show_searches(&self, searches: Vec<Progress>) {
        self.lock().searches = searches;
    }

    /// The part of the status that only the running coordinator knows.
    #[must_use]
    pub fn live(&self) -> Running {
        let now = self.now();
        let inner = self.lock();
        let rate = |worker: WorkerStatus| {
            let own = inner.of_workers.get(&worker.worker);
            let rate = own.map_or(0.0, |own| own.paces(now).samples_per_second());
            (worker, rate)
        };
        Running {
            workers: inner.ledger.workers().map(rate).collect(),
            now,
            counts: inner.ledger.counts(),
            paces: inner.meters.paces(now),
            run_seconds: inner.runs.seconds(),
            searches: inner.searches.clone(),
            is_draining: inner.ledger.is_draining(),
        }
    }
}

impl Inner {
    fn grant(&mut self, worker: &WorkerId, room: Room, now: Duration) -> Vec<Grant<Arc<Source>>> {
        let mut grants = Vec::new();
        let (mut worth, mut bytes) = (0.0, 0);
        let is_room = |worth: f64, bytes: usize| worth < room.seconds && bytes < BYTES_PER_ANSWER;
        while grants.len() < room.leases && (grants.is_empty() || is_room(worth, bytes)) {
            let Some(grant) = self.ledger.lease(worker, now) else {
                break;
            };
            worth += grant.seconds;
            bytes += grant
                .units
                .iter()
                .map(|(_, source)| source.bytes())
                .sum::<usize>();
            grants.push(grant);
        }
        grants
    }
}

/// Marks, until it is dropped, that results of a worker are being stored.
pub struct Reporting {
    board: Arc<Board>,
    worker: WorkerId,
}

impl Drop for Reporting {
    fn drop(&mut self) {
        self.board.lock().reporting.remove(&self.worker);
    }
}
