//! The state machine.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::options::Options;
use crate::state::{Filed, Job, Lease, State, Worker};
use crate::types::{
    Completion, Counts, Details, Directive, Expired, Failure, Grant, Held, JobId, WorkerId,
    WorkerStatus,
};

/// A second lease is insurance against a slow worker; a third would insure against bad luck twice.
const LEASES_PER_JOB: usize = 2;

/// How often the time for which a worker is set aside doubles.
const MAX_DOUBLINGS: u32 = 5;

/// Jobs of one kind of payload, who holds them, and what became of them.
///
/// Every `now` is the time since one arbitrary origin. A `now` before an earlier one is harmless:
/// leases then run out a little early or late.
#[derive(Debug, Clone)]
pub struct Scheduler<J> {
    pub(crate) options: Options,
    epoch: u64,
    pub(crate) draining: bool,
    pub(crate) jobs: BTreeMap<JobId, Job<J>>,
    /// The queued jobs in the order in which they are granted.
    queue: BTreeSet<(i32, JobId)>,
    /// The jobs with at least one lease, by the first of their leases to run out.
    pub(crate) expiries: BTreeSet<(Duration, JobId)>,
    /// The jobs with exactly one lease, in the order in which they get a second one.
    tail: BTreeSet<(Duration, i32, JobId)>,
    quarantined: BTreeSet<JobId>,
    done: usize,
    pub(crate) workers: BTreeMap<WorkerId, Worker>,
}

impl<J: Clone> Scheduler<J> {
    /// A scheduler without jobs. `epoch` tells it from the ones before a restart.
    pub fn new(options: Options, epoch: u64) -> Self {
        Self {
            options,
            epoch,
            draining: false,
            jobs: BTreeMap::new(),
            queue: BTreeSet::new(),
            expiries: BTreeSet::new(),
            tail: BTreeSet::new(),
            quarantined: BTreeSet::new(),
            done: 0,
            workers: BTreeMap::new(),
        }
    }

    /// The epoch given at the start.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Stops granting jobs, or grants them again. Jobs that are held go on: their heartbeats,
    /// results and failures are taken as ever, and a worker that reattaches keeps what it holds.
    pub fn set_draining(&mut self, draining: bool) {
        self.draining = draining;
    }

    /// Changes how long a job must have been held before it is leased a second time.
    pub fn set_duplicate_after(&mut self, patience: Duration) {
        self.options.duplicate_after = patience;
    }

    /// Whether no jobs are granted for now.
    pub fn is_draining(&self) -> bool {
        self.draining
    }

    /// Adds a job, and says whether it was new; a known one stays as it is. Jobs are granted by
    /// ascending priority, then by ascending id.
    pub fn add_job(&mut self, id: JobId, payload: J, priority: i32) -> bool {
        let details = Details {
            priority,
            ..Details::default()
        };
        self.add_job_with(id, payload, details)
    }

    /// As [`Self::add_job`]. The attempts and counters of a job that was tried before a restart go on
    /// from there; whether it is given up is decided by its next crash or failure.
    pub fn add_job_with(&mut self, id: JobId, payload: J, details: Details) -> bool {
        if self.jobs.contains_key(&id) {
            return false;
        }
        self.jobs.insert(id, Job::new(id, payload, details));
        self.queue.insert((details.priority, id));
        true
    }

    /// Takes back a job that waits or is held, as if it had never been added, and returns its payload;
    /// nothing if it is done, given up or unknown. Whoever holds it is told to cancel it with its next
    /// heartbeat.
    pub fn withdraw(&mut self, id: JobId) -> Option<J> {
        let job = self.jobs.get(&id)?;
        if !matches!(job.state, State::Queued | State::Leased(_)) {
            return None;
        }
        // Out of every index; the state itself goes with the job.
        self.settle(id, State::Done);
        self.jobs.remove(&id).map(|job| job.payload)
    }

    /// Notes how many jobs a worker computes at once; 1 is assumed of one that nobody told about.
    pub fn set_slots(&mut self, worker: &WorkerId, slots: usize, now: Duration) {
        self.see(worker, now).slots = slots.max(1);
    }

    /// Grants at most `credit` jobs to a worker.
    ///
    /// When the queue runs empty, a worker that holds fewer jobs than it has slots is given second
    /// leases of jobs that others hold, those held longest first, one for each free slot. A worker that is set aside gets nothing, and one
    /// that just failed a job gets it, or one of its kin, again only when there is nothing else to do: another
    /// worker's opinion is worth more than a second one of its own.
    pub fn lease(&mut self, worker: &WorkerId, credit: usize, now: Duration) -> Vec<Grant<J>> {
        let draining = self.draining;
        let state = self.see(worker, now);
        if draining {
            return Vec::new();
        }
        if let Some(until) = state.set_aside_until {
            if now < until {
                return Vec::new();
            }
            // A fresh start, but for the length of the next time.
            state.set_aside_until = None;
            state.strikes.clear();
        }
        let free_slots = state.slots.saturating_sub(state.held.len());
        let failed = state.strikes.clone();

        let queue = || self.queue.iter().map(|&(_, id)| id);
        let mut chosen: Vec<JobId> = queue()
            .filter(|&id| failed.is_empty() || !failed.contains(&self.kin(id)))
            .take(credit)
            .collect();
        if chosen.is_empty() {
            chosen.extend(queue().take(credit));
        }
        let room = free_slots.min(credit).saturating_sub(chosen.len());
        if self.options.duplicate_tail && room > 0 {
            let ripe =
                |granted: Duration| now.saturating_sub(granted) >= self.options.duplicate_after;
            let tail = self.tail.iter().take_while(|tail| ripe(tail.0));
            let is_own = |id| self.leases(id).iter().any(|lease| lease.worker == *worker);
            let tail = tail.map(|&(_, _, id)| id).filter(|&id| !is_own(id));
            chosen.extend(tail.take(room));
        }
        chosen
            .into_iter()
            .filter_map(|id| self.grant(id, worker, now))
            .collect()
    }

    /// Extends the leases of the jobs that a worker holds, and says what to do with each.
    ///
    /// A job that is queued, because its lease ran out or the coordinator was restarted, is leased
    /// to the worker again as the attempt it names: it holds the job already. A job that somebody
    /// else was given meanwhile is continued, as a second lease, only if it has started. Anything
    /// that is done, given up or unknown is cancelled.
    ///
    /// Such a renewed lease counts as started only with the next heartbeat: the one at hand may
    /// have been overtaken by the call that gave the job back, and then nobody is to be blamed.
    pub fn heartbeat(
        &mut self,
        worker: &WorkerId,
        held: &[Held],
        now: Duration,
    ) -> Vec<(JobId, Directive)> {
        self.see(worker, now);
        held.iter()
            .map(|&h| (h.job, self.hold(worker, h, now)))
            .collect()
    }

    /// Takes note of a result, whoever it comes from, under whichever attempt, and however late.
    pub fn complete(
        &mut self,
        worker: &WorkerId,
        id: JobId,
        _attempt: u32,
        now: Duration,
    ) -> Completion {
        self.see(worker, now);
        let Some(job) = self.jobs.get(&id) else {
            return Completion::Unknown;
        };
        if matches!(job.state, State::Done) {
            return Completion::Duplicate;
        }
        self.settle(id, State::Done);
        self.done += 1;
        let state = self.see(worker, now);
        state.completed += 1;
        state.strikes.clear();
        state.times_set_aside = 0;
        Completion::First
    }

    /// Takes note that an attempt failed, with what the worker said about it.
    pub fn fail(
        &mut self,
        worker: &WorkerId,
        id: JobId,
        attempt: u32,
        error: String,
        now: Duration,
    ) -> Failure {
        self.see(worker, now);
        let is_held = self
            .leases(id)
            .iter()
            .any(|lease| lease.worker == *worker && lease.attempt == attempt);
        if !is_held {
            return Failure::Stale;
        }
        self.strike(worker, id, now);
        self.drop_lease(id, worker);
        let Some(job) = self.jobs.get_mut(&id) else {
            return Failure::Stale;
        };
        job.failures += 1;
        if job.failures >= self.options.max_failures {
            self.quarantine(id, error);
            return Failure::Quarantined;
        }
        self.queue_unless_leased(id);
        Failure::Retry
    }

    /// Takes jobs back from a worker without blaming either. Jobs that it does not hold are
    /// ignored.
    pub fn release(&mut self, worker: &WorkerId, jobs: &[JobId], now: Duration) {
        self.see(worker, now);
        for &id in jobs {
            if self.drop_lease(id, worker).is_some() {
                self.queue_unless_leased(id);
            }
        }
    }

    /// As [`Self::release`] of one attempt, whose failure counts already: it was reported to the
    /// coordinator before this one, which could not acknowledge it.
    pub fn failed_before(&mut self, worker: &WorkerId, id: JobId, attempt: u32, now: Duration) {
        let is_held = |lease: &Lease| lease.worker == *worker && lease.attempt == attempt;
        if self.leases(id).iter().any(is_held) {
            self.release(worker, &[id], now);
        }
    }

    /// Ends the leases that have run out, in the order of their jobs. Those of jobs that had
    /// started count as crashes.
    pub fn expire(&mut self, now: Duration) -> Vec<Expired> {
        let due = self.expiries.iter().take_while(|(first, _)| *first <= now);
        let due: BTreeSet<JobId> = due.map(|&(_, id)| id).collect();
        let mut over: Vec<(JobId, WorkerId)> = Vec::new();
        for id in due {
            let ended = self.leases(id).iter().filter(|lease| lease.expires <= now);
            over.extend(ended.map(|lease| (id, lease.worker.clone())));
        }
        over.into_iter()
            .filter_map(|(id, worker)| self.expire_lease(id, worker))
            .collect()
    }

    /// When the next lease runs out, unless it is extended.
    pub fn next_expiry(&self) -> Option<Duration> {
        self.expiries.first().map(|&(first, _)| first)
    }

    /// How many jobs wait for a worker.
    pub fn queued(&self) -> usize {
        self.queue.len()
    }

    /// How many jobs are in which state.
    pub fn counts(&self) -> Counts {
        Counts {
            queued: self.queue.len(),
            leased: self.expiries.len(),
            done: self.done,
            quarantined: self.quarantined.len(),
        }
    }

    /// Whether every job is done or given up.
    pub fn all_settled(&self) -> bool {
        self.queue.is_empty() && self.expiries.is_empty()
    }

    /// The jobs that were given up, with the error that was the last straw.
    pub fn quarantined(&self) -> Vec<(JobId, &str)> {
        self.quarantined
            .iter()
            .filter_map(|&id| match &self.jobs.get(&id)?.state {
                State::Quarantined { error } => Some((id, error.as_str())),
                _ => None,
            })
            .collect()
    }

    /// Queues every job that was given up again, with fresh counters of crashes and failures, and
    /// returns them in ascending order. Their attempts go on growing. What workers failed of them
    /// is forgiven: whoever retries has mended the cause.
    pub fn retry_quarantined(&mut self) -> Vec<JobId> {
        let jobs: Vec<JobId> = self.quarantined.iter().copied().collect();
        for &id in &jobs {
            self.settle(id, State::Queued);
            if let Some(job) = self.jobs.get_mut(&id) {
                job.crashes = 0;
                job.failures = 0;
                self.queue.insert((job.priority, id));
            }
            self.forgive(id);
        }
        jobs
    }

    /// Removes a job that is done or given up, and returns its payload; nothing if it is neither.
    ///
    /// So memory does not grow with what is finished. [`Counts::done`] keeps counting the job if it
    /// was done. From now on the job is as if never added: a report of it is
    /// [`Completion::Unknown`], a heartbeat that names it is answered [`Directive::Cancel`], and
    /// adding it again makes a new job, which the caller must not do to one that is done.
    pub fn forget(&mut self, id: JobId) -> Option<J> {
        let job = self.jobs.get(&id)?;
        if !matches!(job.state, State::Done | State::Quarantined { .. }) {
            return None;
        }
        self.quarantined.remove(&id);
        self.jobs.remove(&id).map(|job| job.payload)
    }

    /// The payload of a job that was added and not forgotten.
    pub fn payload(&self, id: JobId) -> Option<&J> {
        self.jobs.get(&id).map(|job| &job.payload)
    }

    /// The newest attempt of a job; 0 before the first.
    pub fn attempts(&self, id: JobId) -> Option<u32> {
        self.jobs.get(&id).map(|job| job.attempts)
    }

    /// Every worker that ever called, by name.
    pub fn workers(&self) -> Vec<WorkerStatus> {
        self.workers
            .iter()
            .map(|(id, worker)| WorkerStatus {
                worker: id.clone(),
                leased: worker.held.len(),
                started: worker
                    .held
                    .iter()
                    .flat_map(|&job| self.leases(job))
                    .filter(|lease| lease.worker == *id && lease.started)
                    .count(),
                completed: worker.completed,
                failed: worker.failed,
                crashed: worker.crashed,
                set_aside_until: worker.set_aside_until,
                last_seen: worker.last_seen,
            })
            .collect()
    }

    fn see(&mut self, worker: &WorkerId, now: Duration) -> &mut Worker {
        let state = self.workers.entry(worker.clone()).or_default();
        state.last_seen = state.last_seen.max(now);
        state
    }

    pub(crate) fn leases(&self, id: JobId) -> &[Lease] {
        match self.jobs.get(&id).map(|job| &job.state) {
            Some(State::Leased(leases)) => leases,
            _ => &[],
        }
    }

    fn grant(&mut self, id: JobId, worker: &WorkerId, now: Duration) -> Option<Grant<J>> {
        let job = self.jobs.get(&id)?;
        let attempt = job.attempts.saturating_add(1);
        let payload = job.payload.clone();
        self.add_lease(id, worker, attempt, now);
        Some(Grant {
            job: id,
            attempt,
            payload,
        })
    }

    /// Leases a job that is queued or leased to others.
    fn add_lease(&mut self, id: JobId, worker: &WorkerId, attempt: u32, now: Duration) {
        let Some(job) = self.jobs.get_mut(&id) else {
            return;
        };
        job.attempts = job.attempts.max(attempt);
        let expires = now.saturating_add(self.options.lease);
        let lease = Lease {
            worker: worker.clone(),
            attempt,
            granted: now,
            expires,
            started: false,
        };
        match &mut job.state {
            State::Leased(leases) => leases.push(lease),
            state => *state = State::Leased(vec![lease]),
        }
        self.queue.remove(&(job.priority, id));
        self.refile(id);
        self.see(worker, now).held.insert(id);
    }

    fn hold(&mut self, worker: &WorkerId, held: Held, now: Duration) -> Directive {
        let expires = now.saturating_add(self.options.lease);
        let is_set_aside = self
            .workers
            .get(worker)
            .is_some_and(|w| w.set_aside_until.is_some_and(|t| now < t));
        let Some(job) = self.jobs.get_mut(&held.job) else {
            return Directive::Cancel;
        };
        let adopt = match &mut job.state {
            State::Done | State::Quarantined { .. } => return Directive::Cancel,
            State::Queued => !is_set_aside,
            State::Leased(leases) => {
                if let Some(lease) = leases.iter_mut().find(|lease| lease.worker == *worker) {
                    // A heartbeat that was overtaken must not shorten the lease. An older attempt
                    // on the same worker is the same work, but does not tell whether the newer one
                    // has started; a newer one is from before a restart of the coordinator.
                    lease.expires = lease.expires.max(expires);
                    if held.attempt >= lease.attempt {
                        lease.attempt = held.attempt;
                        lease.started |= held.started;
                        job.attempts = job.attempts.max(held.attempt);
                    }
                    self.refile(held.job);
                    return Directive::Continue;
                }
                held.started && !is_set_aside && leases.len() < LEASES_PER_JOB
            }
        };
        if !adopt {
            return Directive::Cancel;
        }
        self.add_lease(held.job, worker, held.attempt, now);
        Directive::Continue
    }

    /// Ends a worker's lease, and leaves the job without a state that its leases agree with:
    /// [`Self::queue_unless_leased`] or [`Self::settle`] must follow.
    fn drop_lease(&mut self, id: JobId, worker: &WorkerId) -> Option<Lease> {
        let State::Leased(leases) = &mut self.jobs.get_mut(&id)?.state else {
            return None;
        };
        let place = leases.iter().position(|lease| lease.worker == *worker)?;
        if let Some(state) = self.workers.get_mut(worker) {
            state.held.remove(&id);
        }
        Some(leases.remove(place))
    }

    fn queue_unless_leased(&mut self, id: JobId) {
        if let Some(job) = self.jobs.get_mut(&id)
            && matches!(&job.state, State::Leased(leases) if leases.is_empty())
        {
            job.state = State::Queued;
            self.queue.insert((job.priority, id));
        }
        self.refile(id);
    }

    /// Brings the indices of leased jobs up to date with a job's leases.
    fn refile(&mut self, id: JobId) {
        let Some(job) = self.jobs.get_mut(&id) else {
            return;
        };
        let filed = Filed::of(&job.state);
        let before = std::mem::replace(&mut job.filed, filed);
        if before == filed {
            return;
        }
        if let Some(Filed { expires, alone }) = before {
            self.expiries.remove(&(expires, id));
            alone.map(|granted| self.tail.remove(&(granted, job.priority, id)));
        }
        if let Some(Filed { expires, alone }) = filed {
            self.expiries.insert((expires, id));
            alone.map(|granted| self.tail.insert((granted, job.priority, id)));
        }
    }

    /// Takes a job out of circulation; whoever still holds it learns so with its next heartbeat.
    fn settle(&mut self, id: JobId, state: State) {
        let Some(job) = self.jobs.get_mut(&id) else {
            return;
        };
        let before = std::mem::replace(&mut job.state, state);
        self.queue.remove(&(job.priority, id));
        self.quarantined.remove(&id);
        if let State::Leased(leases) = before {
            for lease in leases {
                if let Some(worker) = self.workers.get_mut(&lease.worker) {
                    worker.held.remove(&id);
                }
            }
        }
        self.refile(id);
    }

    fn quarantine(&mut self, id: JobId, error: String) {
        self.settle(id, State::Quarantined { error });
        self.quarantined.insert(id);
    }

    fn expire_lease(&mut self, id: JobId, worker: WorkerId) -> Option<Expired> {
        // None when the job was given up a moment ago, for its other lease.
        let lease = self.drop_lease(id, &worker)?;
        let job = self.jobs.get_mut(&id)?;
        let mut quarantined = false;
        if lease.started {
            job.crashes += 1;
            quarantined = job.crashes >= self.options.max_crashes;
            if let Some(state) = self.workers.get_mut(&worker) {
                state.crashed += 1;
            }
        }
        if quarantined {
            let error = format!(
                "{} workers went silent while they ran it, {worker} last",
                self.options.max_crashes.max(1)
            );
            self.quarantine(id, error);
        } else {
            self.queue_unless_leased(id);
        }
        let attempt = lease.attempt;
        Some(Expired {
            job: id,
            attempt,
            worker,
            crashed: lease.started,
            quarantined,
        })
    }

    fn kin(&self, id: JobId) -> JobId {
        self.jobs.get(&id).map_or(id, |job| job.kin)
    }

    /// Counts a failure against a worker, unless the job is the one to blame.
    fn strike(&mut self, worker: &WorkerId, id: JobId, now: Duration) {
        let kin = self.kin(id);
        let limit = self.options.max_worker_strikes.max(1) as usize;
        let first_time = self.options.set_aside;
        self.see(worker, now).failed += 1;
        let others_failed_it = self
            .workers
            .iter()
            .any(|(other, state)| other != worker && state.strikes.contains(&kin));
        if others_failed_it {
            // Two workers failed it: it says nothing about either of them.
            self.forgive(id);
            return;
        }
        let state = self.see(worker, now);
        state.strikes.insert(kin);
        if state.strikes.len() >= limit {
            let doublings = state.times_set_aside.min(MAX_DOUBLINGS);
            let time = first_time.saturating_mul(1 << doublings);
            state.set_aside_until = Some(now.saturating_add(time));
            state.times_set_aside = state.times_set_aside.saturating_add(1);
        }
    }

    /// Holds a job against none of those that failed it.
    fn forgive(&mut self, id: JobId) {
        let kin = self.kin(id);
        let limit = self.options.max_worker_strikes.max(1) as usize;
        for state in self.workers.values_mut() {
            if state.strikes.remove(&kin) && state.strikes.len() < limit {
                state.set_aside_until = None;
            }
        }
    }
}
