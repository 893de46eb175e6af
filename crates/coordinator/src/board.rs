//! Jobs and workers behind one lock: where the service and the engine meet.
//!
//! The scheduler decides; the board adds what it must not know: real time, the tasks themselves,
//! who the workers are, and the bells that wake whoever waits.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use campaign::plan::JobKind;
use campaign::task::Task;
use protocol::v1::{Job, JobAttempt};
use scheduler::{Completion, Failure, JobId, Scheduler, WorkerId};
use tokio::sync::Notify;

/// A task with its payload for the wire, made once.
#[derive(Debug)]
pub struct Posted {
    /// The task.
    pub task: Task,
    payload: Vec<u8>,
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

struct Inner {
    scheduler: Scheduler<Arc<Posted>>,
    tasks: BTreeMap<u64, Arc<Posted>>,
    /// Jobs that are neither done nor given up, by group.
    open: BTreeMap<Group, BTreeSet<u64>>,
    workers: BTreeMap<String, WorkerInfo>,
    quarantined: BTreeSet<u64>,
    finished: bool,
}

/// Jobs that are settled together before the engine looks again: all sampling, or one approach's
/// runs, or one point's samples.
type Group = (JobKind, u64);

/// The jobs of a campaign and its workers.
pub struct Board {
    inner: Mutex<Inner>,
    origin: Instant,
    epoch: u64,
    /// Rings when jobs may have become available.
    available: Notify,
    /// Rings when a group of jobs is settled.
    settled: Notify,
}

impl Board {
    /// An empty board.
    #[must_use]
    pub fn new(options: scheduler::Options, epoch: u64) -> Self {
        Self {
            inner: Mutex::new(Inner {
                scheduler: Scheduler::new(options, epoch),
                tasks: BTreeMap::new(),
                open: BTreeMap::new(),
                workers: BTreeMap::new(),
                quarantined: BTreeSet::new(),
                finished: false,
            }),
            origin: Instant::now(),
            epoch,
            available: Notify::new(),
            settled: Notify::new(),
        }
    }

    /// Differs after every start of the coordinator.
    #[must_use]
    pub const fn epoch(&self) -> u64 {
        self.epoch
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // No update of the board can be half done when its code panics, so it stays usable.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        self.origin.elapsed()
    }

    /// Puts jobs on the board; those already there stay as they are.
    pub fn post(&self, jobs: Vec<(u64, Task)>) {
        let mut inner = self.lock();
        for (job, task) in jobs {
            if inner.tasks.contains_key(&job) {
                continue;
            }
            let payload = serde_json::to_vec(&task).expect("plain numbers and names serialise");
            let posted = Arc::new(Posted { task, payload });
            inner.scheduler.add_job(JobId(job), Arc::clone(&posted), 0);
            inner.tasks.insert(job, posted);
            inner.open.entry(group(job)).or_default().insert(job);
        }
        drop(inner);
        self.available.notify_waiters();
    }

    /// The task of a job on the board.
    #[must_use]
    pub fn task(&self, job: u64) -> Option<Arc<Posted>> {
        self.lock().tasks.get(&job).cloned()
    }

    /// Notes a worker; it stays known until the coordinator ends.
    pub fn register(&self, worker_id: &str, host: &str, slots: u32) {
        self.lock().workers.insert(
            worker_id.to_owned(),
            WorkerInfo {
                host: host.to_owned(),
                slots,
                last_seen: Instant::now(),
                told_finished: false,
            },
        );
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

    /// Leases up to `credit` jobs, waiting up to `wait` for the first; none when the time is up or
    /// the campaign is finished.
    pub async fn lease(&self, worker_id: &str, credit: usize, wait: Duration) -> Vec<Job> {
        let worker = WorkerId(worker_id.to_owned());
        let deadline = tokio::time::Instant::now() + wait;
        loop {
            let available = self.available.notified();
            {
                let mut inner = self.lock();
                if inner.finished {
                    return Vec::new();
                }
                let grants = inner.scheduler.lease(&worker, credit, self.now());
                if !grants.is_empty() {
                    return grants
                        .into_iter()
                        .map(|grant| Job {
                            job: grant.job.0,
                            attempt: grant.attempt,
                            payload: grant.payload.payload.clone(),
                        })
                        .collect();
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

    /// Marks a job as done, its result being in the store.
    pub fn complete(&self, worker_id: &str, job: u64, attempt: u32) -> Completion {
        let worker = WorkerId(worker_id.to_owned());
        let now = self.now();
        let mut inner = self.lock();
        let completion = inner.scheduler.complete(&worker, JobId(job), attempt, now);
        self.settle(&mut inner, job);
        completion
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
            inner.quarantined.insert(job);
            self.settle(&mut inner, job);
        }
        drop(inner);
        self.available.notify_waiters();
        failure
    }

    /// Takes unfinished jobs back, without blame.
    pub fn release(&self, worker_id: &str, jobs: &[u64]) {
        let worker = WorkerId(worker_id.to_owned());
        let jobs: Vec<JobId> = jobs.iter().map(|job| JobId(*job)).collect();
        let now = self.now();
        self.lock().scheduler.release(&worker, &jobs, now);
        self.available.notify_waiters();
    }

    /// Takes back the jobs of workers that have not been heard of for a whole lease.
    ///
    /// Returns those that had started, as (job, attempt, worker, whether the job was given up).
    pub fn expire(&self) -> Vec<(u64, u32, String, bool)> {
        let now = self.now();
        let mut inner = self.lock();
        let expired = inner.scheduler.expire(now);
        if expired.is_empty() {
            return Vec::new();
        }
        for job in expired.iter().filter(|expired| expired.quarantined) {
            inner.quarantined.insert(job.job.0);
            self.settle(&mut inner, job.job.0);
        }
        drop(inner);
        self.available.notify_waiters();
        expired
            .into_iter()
            .filter(|expired| expired.crashed || expired.quarantined)
            .map(|expired| {
                (
                    expired.job.0,
                    expired.attempt,
                    expired.worker.0,
                    expired.quarantined,
                )
            })
            .collect()
    }

    fn settle(&self, inner: &mut Inner, job: u64) {
        let group = group(job);
        if let Some(open) = inner.open.get_mut(&group) {
            open.remove(&job);
            if open.is_empty() {
                inner.open.remove(&group);
                self.settled.notify_waiters();
            }
        }
        // With fewer jobs left, some may be leased a second time.
        self.available.notify_waiters();
    }

    /// Jobs that were given up.
    #[must_use]
    pub fn quarantined(&self) -> BTreeSet<u64> {
        self.lock().quarantined.clone()
    }

    /// How many groups of jobs are open, and a future that ends when one more is settled.
    pub fn watch(&self) -> (usize, tokio::sync::futures::Notified<'_>) {
        let settled = self.settled.notified();
        (self.lock().open.len(), settled)
    }

    /// Tells all workers that the campaign is finished.
    pub fn finish(&self) {
        self.lock().finished = true;
        self.available.notify_waiters();
    }

    /// Whether the campaign is finished; notes that `worker_id` has been told so.
    #[must_use]
    pub fn is_finished_for(&self, worker_id: &str) -> bool {
        let mut inner = self.lock();
        let finished = inner.finished;
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

    /// The registered workers.
    #[must_use]
    pub fn workers(&self) -> Vec<(String, WorkerInfo)> {
        self.lock()
            .workers
            .iter()
            .map(|(id, info)| (id.clone(), info.clone()))
            .collect()
    }
}

/// The group that a job is settled with.
fn group(job: u64) -> Group {
    match JobKind::of(job) {
        Some(JobKind::Sample) | None => (JobKind::Sample, 0),
        Some(kind) => (kind, (job & 0x00ff_ffff_ffff_ffff) >> 28),
    }
}
