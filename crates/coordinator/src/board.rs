//! Jobs and workers behind one lock: where the service and the engine meet.
//!
//! The scheduler decides who computes what, [`Batches`] cuts samples into jobs at the moment they
//! are asked for; the board adds what both must not know: real time, who the workers are, and the
//! bells that wake whoever waits.

mod jobs;
mod live;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use campaign::batches::{Batches, StreamId};
use campaign::plan::{self, JobKind, OpenDesign, VerifyPoint};
use campaign::task::{SampleRange, Task};
use campaign::{Approach, Frozen};
use protocol::v1::{Job, JobAttempt};
use scheduler::{Failure, History, JobId, Scheduler, WorkerId};
use store::JobHistory;
use tokio::sync::Notify;
use tokio::time::Instant;

use crate::pace::Pace;

pub use live::{Live, LiveWorker};

/// How much a new measurement counts against the earlier ones.
const LEARNING_RATE: f64 = 0.3;

/// A task with its payload for the wire, made once.
#[derive(Debug)]
pub struct Posted {
    /// The task.
    pub task: Task,
    payload: Vec<u8>,
}

impl Posted {
    fn new(task: Task) -> Arc<Self> {
        let payload = serde_json::to_vec(&task).expect("plain numbers and names serialise");
        Arc::new(Self { task, payload })
    }
}

/// A registered worker.
#[derive(Debug, Clone)]
pub struct WorkerInfo {
    /// Where it runs, for people.
    pub host: String,
    /// How many jobs it computes at once.
    pub slots: u32,
    last_seen: Instant,
    told_finished: bool,
}

/// What a stored result settles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Covered {
    /// Samples of a design or point.
    Samples(StreamId, SampleRange),
    /// A design that cannot be simulated, or that gets no samples.
    Refused(u32),
}

/// A job whose lease ran out after it had started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vanished {
    /// The job.
    pub job: u64,
    /// The attempt.
    pub attempt: u32,
    /// Who had it.
    pub worker: String,
    /// Whether that was once too often.
    pub given_up: bool,
}

struct Inner {
    scheduler: Scheduler<Arc<Posted>>,
    batches: Batches,
    /// What went wrong before this coordinator started, by the jobs' names.
    histories: BTreeMap<String, History>,
    /// Runs that are neither done nor given up, by approach: they are settled together.
    open_runs: BTreeMap<u64, BTreeSet<u64>>,
    workers: BTreeMap<String, WorkerInfo>,
    /// Jobs done since the start; the scheduler forgets them.
    done: u64,
    pace: Pace,
    /// What a job takes that is not cut from samples, once one has come back.
    posted_seconds: Option<f64>,
    /// When it was last worked out how long a job is left to its worker alone.
    patience_of: Option<Duration>,
    /// When the slots of the workers were last counted, and how many they were.
    slots_present: Option<(Duration, usize)>,
    /// Whether the first plan is posted: before, nobody can be told what is needed.
    is_ready: bool,
    is_finished: bool,
    /// Grows with whatever a client might want to see.
    revision: u64,
}

/// The jobs of a campaign and its workers.
pub struct Board {
    inner: Mutex<Inner>,
    lease: Duration,
    origin: Instant,
    epoch: u64,
    /// Rings when jobs may have become available.
    available: Notify,
    /// Rings when a group of jobs is settled.
    settled: Notify,
    /// Rings when the revision grows.
    changed: Notify,
}

impl Board {
    /// An empty board.
    #[must_use]
    pub fn new(options: scheduler::Options, epoch: u64) -> Self {
        Self {
            lease: options.lease,
            inner: Mutex::new(Inner {
                scheduler: Scheduler::new(options, epoch),
                batches: Batches::default(),
                histories: BTreeMap::new(),
                open_runs: BTreeMap::new(),
                workers: BTreeMap::new(),
                done: 0,
                pace: Pace::default(),
                posted_seconds: None,
                patience_of: None,
                slots_present: None,
                is_ready: false,
                is_finished: false,
                revision: 1,
            }),
            origin: Instant::now(),
            epoch,
            available: Notify::new(),
            settled: Notify::new(),
            changed: Notify::new(),
        }
    }

    /// Differs after every start of the coordinator.
    #[must_use]
    pub const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// How long a worker may be silent.
    #[must_use]
    pub const fn lease_time(&self) -> Duration {
        self.lease
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // No update of the board can be half done when its code panics, so it stays usable.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        self.origin.elapsed()
    }

    /// Goes on with the attempts and counters of jobs that went wrong before a restart.
    pub fn remember(&self, histories: Vec<JobHistory>) {
        let known = histories.into_iter().map(|history| {
            let JobHistory {
                job,
                attempts,
                crashes,
                failures,
            } = history;
            let history = History {
                attempts,
                crashes,
                failures,
            };
            (job, history)
        });
        self.lock().histories = known.collect();
    }

    /// Prepares for samples that may take hours: until one is measured, a job has one sample, and
    /// nobody holds a second.
    pub fn expect_long_samples(&self) {
        let mut inner = self.lock();
        inner.batches.expect_long_samples();
    }

    /// Puts jobs on the board; those already there stay as they are.
    pub fn post(&self, jobs: Vec<(u64, Task)>) {
        let mut inner = self.lock();
        for (job, task) in jobs {
            if inner.scheduler.payload(JobId(job)).is_some() {
                continue;
            }
            inner.add_job(job, Posted::new(task));
            if JobKind::of(job) == Some(JobKind::Optimise) {
                let approach = plan::run_parts(job).0;
                inner.open_runs.entry(approach).or_default().insert(job);
            }
        }
        self.release_lock(inner);
    }

    /// Makes missing samples of the DoE available to workers.
    pub fn post_designs(&self, frozen: Frozen, designs: &[OpenDesign]) {
        let mut inner = self.lock();
        inner.batches.add_designs(frozen, designs);
        self.release_lock(inner);
    }

    /// Makes missing samples of points available to workers.
    pub fn post_points(&self, points: &[VerifyPoint]) {
        let mut inner = self.lock();
        for point in points {
            inner.batches.add_point(point);
        }
        self.release_lock(inner);
    }

    /// Forgets the runs of these approaches and the points that were chosen by them, infill included:
    /// what they rest on is learned anew. What workers still bring of them is of no use.
    pub fn forget_derived(&self, approaches: &[Approach]) {
        let numbers: Vec<u64> = approaches.iter().map(|a| a.number()).collect();
        let mut inner = self.lock();
        let is_gone = |point| campaign::enrichment::is_infill(point) || numbers.contains(&point);
        let mut jobs = inner.batches.forget_points(is_gone);
        for number in &numbers {
            jobs.extend(inner.open_runs.remove(number).into_iter().flatten());
        }
        for job in jobs {
            if inner.scheduler.withdraw(JobId(job)).is_none() {
                inner.scheduler.forget(JobId(job));
            }
        }
        self.touch(&mut inner);
    }

    fn release_lock(&self, inner: MutexGuard<'_, Inner>) {
        drop(inner);
        self.available.notify_waiters();
    }

    /// Opens the board to workers.
    pub fn open(&self) {
        self.lock().is_ready = true;
    }

    /// Whether workers can be told what is needed.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.lock().is_ready
    }

    /// The task of a job that is not done.
    #[must_use]
    pub fn task(&self, job: u64) -> Option<Arc<Posted>> {
        self.lock().scheduler.payload(JobId(job)).cloned()
    }

    /// Notes a worker with the jobs that it holds from before; it stays known until the coordinator
    /// ends. Returns those of the jobs whose results are no longer needed.
    pub fn register(&self, worker_id: &str, host: &str, slots: u32, held: &[Job]) -> Vec<u64> {
        let now = self.now();
        let worker = WorkerId(worker_id.to_owned());
        let mut inner = self.lock();
        let info = WorkerInfo {
            host: host.to_owned(),
            slots,
            last_seen: Instant::now(),
            told_finished: false,
        };
        inner.workers.insert(worker_id.to_owned(), info);
        inner.slots_present = None;
        inner.scheduler.set_slots(&worker, slots as usize, now);
        let mut cancelled = Vec::new();
        for job in held {
            if !inner.take_over(job) {
                cancelled.push(job.job);
                continue;
            }
            let held = scheduler::Held {
                job: JobId(job.job),
                attempt: job.attempt,
                started: false,
            };
            inner.scheduler.heartbeat(&worker, &[held], now);
        }
        self.touch(&mut inner);
        cancelled
    }

    /// Notes a sign of life; false if the worker is not registered.
    #[must_use]
    pub fn is_known(&self, worker_id: &str) -> bool {
        let mut inner = self.lock();
        match inner.workers.get_mut(worker_id) {
            Some(worker) => {
                worker.last_seen = Instant::now();
                true
            }
            None => false,
        }
    }

    /// Leases up to `credit` jobs, and no more once they are worth `seconds`; waits up to `wait` for
    /// the first. None when the time is up or the campaign is finished.
    pub async fn lease(
        &self,
        worker_id: &str,
        credit: usize,
        seconds: f64,
        wait: Duration,
    ) -> Vec<Job> {
        let worker = WorkerId(worker_id.to_owned());
        let deadline = Instant::now() + wait;
        loop {
            let available = self.available.notified();
            {
                let mut inner = self.lock();
                if inner.is_finished {
                    return Vec::new();
                }
                let jobs = inner.grant(&worker, credit, seconds, (self.lease, self.now()));
                if !jobs.is_empty() {
                    self.touch(&mut inner);
                    return jobs;
                }
            }
            if tokio::time::timeout_at(deadline, available).await.is_err() {
                return Vec::new();
            }
        }
    }

    /// Extends a worker's leases; returns the jobs whose results are no longer needed.
    pub fn heartbeat(&self, worker_id: &str, held: &[JobAttempt]) -> Vec<u64> {
        let worker = WorkerId(worker_id.to_owned());
        let now = self.now();
        let held: Vec<scheduler::Held> = held
            .iter()
            .map(|held| scheduler::Held {
                job: JobId(held.job),
                attempt: held.attempt,
                started: held.started,
            })
            .collect();
        let directives = self.lock().scheduler.heartbeat(&worker, &held, now);
        directives
            .into_iter()
            .filter(|(_, directive)| *directive == scheduler::Directive::Cancel)
            .map(|(job, _)| job.0)
            .collect()
    }

    /// Ends a job whose results are stored: `covered` is what they settle, `seconds` what the job
    /// took.
    pub fn complete(
        &self,
        worker_id: &str,
        job: u64,
        attempt: u32,
        covered: &[Covered],
        seconds: f64,
    ) {
        let worker = WorkerId(worker_id.to_owned());
        let now = self.now();
        // Whatever a worker says, nothing has lasted longer than this coordinator.
        let seconds = seconds.min(now.as_secs_f64());
        let mut inner = self.lock();
        for covered in covered {
            match *covered {
                Covered::Samples(stream, samples) => {
                    inner.batches.stored(stream, samples);
                    inner.pace.count(now, u64::from(samples.count));
                }
                Covered::Refused(design) => inner.batches.refused(design),
            }
        }
        inner.scheduler.complete(&worker, JobId(job), attempt, now);
        if inner.scheduler.forget(JobId(job)).is_some() {
            inner.done += 1;
            if inner.batches.expected(job).is_none() && seconds.is_finite() {
                let seconds = seconds.max(0.0);
                let known = inner.posted_seconds.unwrap_or(seconds);
                inner.posted_seconds = Some(known + LEARNING_RATE * (seconds - known));
            }
            inner.batches.close(job, Some(seconds));
            self.settle(&mut inner, job);
        }
        self.touch(&mut inner);
    }

    /// Counts a failure of a job.
    pub fn fail(&self, worker_id: &str, job: u64, attempt: u32, error: String) -> Failure {
        let worker = WorkerId(worker_id.to_owned());
        let now = self.now();
        let mut inner = self.lock();
        let failure = inner
            .scheduler
            .fail(&worker, JobId(job), attempt, error, now);
        if failure == Failure::Quarantined {
            self.give_up(&mut inner, job);
        } else {
            inner.withdraw_needless();
        }
        self.touch(&mut inner);
        self.release_lock(inner);
        failure
    }

    /// Takes an attempt back whose failure a coordinator before this one has counted.
    pub fn failed_before(&self, worker_id: &str, job: u64, attempt: u32) {
        let worker = WorkerId(worker_id.to_owned());
        let now = self.now();
        let mut inner = self.lock();
        inner
            .scheduler
            .failed_before(&worker, JobId(job), attempt, now);
        self.release_lock(inner);
    }

    /// Takes unfinished jobs back, without blame.
    pub fn release(&self, worker_id: &str, jobs: &[u64]) {
        let worker = WorkerId(worker_id.to_owned());
        let jobs: Vec<JobId> = jobs.iter().map(|job| JobId(*job)).collect();
        let now = self.now();
        let mut inner = self.lock();
        inner.scheduler.release(&worker, &jobs, now);
        self.release_lock(inner);
    }

    /// Takes back the jobs of workers that have not been heard of for a whole lease; returns those
    /// that had started.
    pub fn expire(&self) -> Vec<Vanished> {
        let now = self.now();
        let mut inner = self.lock();
        let expired = inner.scheduler.expire(now);
        if expired.is_empty() {
            return Vec::new();
        }
        for job in expired.iter().filter(|expired| expired.quarantined) {
            self.give_up(&mut inner, job.job.0);
        }
        inner.withdraw_needless();
        self.touch(&mut inner);
        self.release_lock(inner);
        expired
            .into_iter()
            .filter(|expired| expired.crashed || expired.quarantined)
            .map(|expired| Vanished {
                job: expired.job.0,
                attempt: expired.attempt,
                worker: expired.worker.0,
                given_up: expired.quarantined,
            })
            .collect()
    }

    fn give_up(&self, inner: &mut Inner, job: u64) {
        if JobKind::of(job) != Some(JobKind::Optimise) && inner.batches.give_up(job).is_none() {
            // Its designs become jobs of their own.
            inner.scheduler.forget(JobId(job));
        }
        inner.withdraw_needless();
        self.settle(inner, job);
    }

    /// Gives jobs that were given up another chance, and returns them.
    pub fn retry(&self) -> Vec<u64> {
        let mut inner = self.lock();
        let jobs = inner.scheduler.retry_quarantined();
        inner.batches.retry();
        for job in &jobs {
            if JobKind::of(job.0) == Some(JobKind::Optimise) {
                let approach = plan::run_parts(job.0).0;
                inner.open_runs.entry(approach).or_default().insert(job.0);
            }
        }
        if !jobs.is_empty() {
            inner.is_finished = false;
            self.touch(&mut inner);
        }
        self.release_lock(inner);
        self.settled.notify_waiters();
        jobs.into_iter().map(|job| job.0).collect()
    }

    /// Rings when the last job of a group is done or given up.
    fn settle(&self, inner: &mut Inner, job: u64) {
        let is_settled = match JobKind::of(job) {
            Some(JobKind::Optimise) => {
                let approach = plan::run_parts(job).0;
                let open = inner.open_runs.entry(approach).or_default();
                open.remove(&job);
                open.is_empty()
            }
            Some(JobKind::Sample) => inner.batches.designs_are_settled(),
            Some(JobKind::Verify) => inner
                .batches
                .point_is_settled(campaign::batches::parts(job).0),
            None => false,
        };
        if is_settled {
            self.settled.notify_waiters();
        }
        if inner.scheduler.queued() == 0 && !inner.batches.has_free() {
            // With fewer jobs left, some may be leased a second time.
            self.available.notify_waiters();
        }
    }

    fn touch(&self, inner: &mut Inner) {
        inner.revision += 1;
        self.changed.notify_waiters();
    }

    /// What was given up: designs and points, and runs of optimisers.
    #[must_use]
    pub fn given_up(&self) -> (BTreeSet<StreamId>, Vec<u64>) {
        let inner = self.lock();
        let runs = inner.scheduler.quarantined();
        let runs = runs.into_iter().map(|(job, _)| job.0);
        (
            inner.batches.given_up().collect(),
            runs.filter(|job| JobKind::of(*job) == Some(JobKind::Optimise))
                .collect(),
        )
    }

    /// A future that ends when one more group of jobs is settled.
    pub fn watch(&self) -> tokio::sync::futures::Notified<'_> {
        self.settled.notified()
    }

    /// Stops or resumes leasing; returns how many jobs are out.
    pub fn drain(&self, draining: bool) -> usize {
        let mut inner = self.lock();
        inner.scheduler.set_draining(draining);
        let leased = inner.scheduler.counts().leased;
        self.touch(&mut inner);
        self.release_lock(inner);
        leased
    }

    /// Whether leasing was stopped.
    #[must_use]
    pub fn is_draining(&self) -> bool {
        self.lock().scheduler.is_draining()
    }

    /// Ends when leasing was stopped and no job is out any more.
    pub async fn drained(&self) {
        loop {
            let changed = self.changed.notified();
            {
                let inner = self.lock();
                if inner.scheduler.is_draining() && inner.scheduler.counts().leased == 0 {
                    return;
                }
            }
            changed.await;
        }
    }

    /// Ends when a finished campaign has work again, as after a retry.
    pub async fn reopened(&self) {
        loop {
            let changed = self.changed.notified();
            if !self.lock().is_finished {
                return;
            }
            changed.await;
        }
    }

    /// Waits until the revision is another one than `seen`, at most for `wait`; returns it.
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

    /// Tells all workers that the campaign is finished.
    pub fn finish(&self) {
        let mut inner = self.lock();
        inner.is_finished = true;
        self.touch(&mut inner);
        self.release_lock(inner);
    }

    /// Whether the campaign is finished; notes that `worker_id` has been told so.
    #[must_use]
    pub fn is_finished_for(&self, worker_id: &str) -> bool {
        let mut inner = self.lock();
        let finished = inner.is_finished;
        if let Some(worker) = inner.workers.get_mut(worker_id) {
            worker.told_finished |= finished;
        }
        finished
    }

    /// Whether every worker heard of within `recently` has been told that the campaign is finished.
    #[must_use]
    pub fn all_told(&self, recently: Duration) -> bool {
        self.lock()
            .workers
            .values()
            .all(|worker| worker.told_finished || worker.last_seen.elapsed() > recently)
    }
}
