//! What a scheduler should do, written down as plainly as possible: lists that are searched from
//! end to end, nothing remembered that can be worked out.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use scheduler::{
    Completion, Details, Directive, Expired, Failure, Grant, Held, History, JobId, Options,
    WorkerId, WorkerStatus,
};

/// What becomes of a scheduler next.
#[derive(Debug, Clone)]
pub(crate) enum Call {
    Add { job: JobId, priority: i32 },
    Slots { worker: WorkerId, slots: usize },
    Lease { worker: WorkerId, credit: usize },
    Heartbeat { worker: WorkerId, held: Vec<Held> },
    Complete { holding: Holding },
    Fail { holding: Holding },
    FailedBefore { holding: Holding },
    Release { worker: WorkerId, jobs: Vec<JobId> },
    Expire,
    Retry,
    Drain(bool),
    Forget { job: JobId },
    Withdraw { job: JobId },
    Restart,
    Wait { seconds: u64 },
}

/// Who claims to hold what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Holding {
    pub(crate) worker: WorkerId,
    pub(crate) job: JobId,
    pub(crate) attempt: u32,
}

/// What a call returned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Answer {
    None,
    Added(bool),
    Granted(Vec<Grant<u64>>),
    Told(Vec<(JobId, Directive)>),
    Completed(Completion),
    Failed(Failure),
    RanOut(Vec<Expired>),
    Retried(Vec<JobId>),
    Forgot(Option<u64>),
}

#[derive(Debug, Clone)]
pub(crate) struct Job {
    pub(crate) priority: i32,
    pub(crate) attempts: u32,
    pub(crate) crashes: u32,
    pub(crate) failures: u32,
    pub(crate) end: Option<End>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum End {
    Done,
    GivenUp(String),
}

#[derive(Debug, Clone)]
pub(crate) struct Lease {
    pub(crate) held: Holding,
    granted: Duration,
    pub(crate) expires: Duration,
    started: bool,
}

#[derive(Debug, Clone, Default)]
struct Worker {
    slots: Option<usize>,
    set_aside_until: Option<Duration>,
    times_set_aside: u32,
    completed: u64,
    failed: u64,
    crashed: u64,
    last_seen: Duration,
}

#[derive(Debug, Clone)]
pub(crate) struct Model {
    pub(crate) options: Options,
    pub(crate) now: Duration,
    pub(crate) epoch: u64,
    pub(crate) draining: bool,
    pub(crate) jobs: BTreeMap<JobId, Job>,
    pub(crate) leases: Vec<Lease>,
    /// (who failed, what), since it last finished a job.
    strikes: Vec<(WorkerId, JobId)>,
    workers: BTreeMap<WorkerId, Worker>,
    /// Done in this epoch.
    pub(crate) done: usize,
    /// Done in any epoch: what a store remembers.
    pub(crate) stored: BTreeSet<JobId>,
    /// Every grant ever made: what late and repeated calls are about.
    pub(crate) history: Vec<Holding>,
    /// What the last call should have returned.
    pub(crate) answer: Answer,
}

impl Model {
    pub(crate) fn new(options: Options) -> Self {
        Self {
            options,
            now: Duration::ZERO,
            epoch: 1,
            draining: false,
            jobs: BTreeMap::new(),
            leases: Vec::new(),
            strikes: Vec::new(),
            workers: BTreeMap::new(),
            done: 0,
            stored: BTreeSet::new(),
            history: Vec::new(),
            answer: Answer::None,
        }
    }

    pub(crate) fn call(&mut self, call: &Call) {
        self.answer = match call {
            Call::Add { job, priority } => Answer::Added(self.add(*job, *priority)),
            Call::Slots { worker, slots } => {
                self.see(worker).slots = Some(*slots);
                Answer::None
            }
            Call::Lease { worker, credit } => Answer::Granted(self.lease(worker, *credit)),
            Call::Heartbeat { worker, held } => {
                self.see(worker);
                let told = held.iter().map(|h| (h.job, self.hold(worker, *h)));
                Answer::Told(told.collect())
            }
            Call::Complete { holding } => Answer::Completed(self.complete(holding)),
            Call::Fail { holding } => Answer::Failed(self.fail(holding)),
            Call::FailedBefore { holding } => {
                if self.leases.iter().any(|l| l.held == *holding) {
                    self.see(&holding.worker);
                    self.leases.retain(|l| l.held != *holding);
                }
                Answer::None
            }
            Call::Release { worker, jobs } => {
                self.see(worker);
                self.leases
                    .retain(|l| l.held.worker != *worker || !jobs.contains(&l.held.job));
                Answer::None
            }
            Call::Expire => Answer::RanOut(self.expire()),
            Call::Retry => Answer::Retried(self.retry()),
            Call::Drain(draining) => {
                self.draining = *draining;
                Answer::None
            }
            Call::Forget { job } => Answer::Forgot(self.forget(*job)),
            Call::Withdraw { job } => Answer::Forgot(self.withdraw(*job)),
            Call::Restart => {
                self.restart();
                Answer::None
            }
            Call::Wait { seconds } => {
                self.now += Duration::from_secs(*seconds);
                Answer::None
            }
        };
    }

    fn add(&mut self, job: JobId, priority: i32) -> bool {
        let known = self.jobs.contains_key(&job);
        self.jobs.entry(job).or_insert(Job {
            priority,
            attempts: 0,
            crashes: 0,
            failures: 0,
            end: None,
        });
        !known
    }

    /// A new coordinator adds what its store does not have, with what its store knows of earlier
    /// attempts; nobody is known to it.
    fn restart(&mut self) {
        self.epoch += 1;
        self.draining = false;
        self.leases.clear();
        self.strikes.clear();
        self.workers.clear();
        self.done = 0;
        let before = std::mem::take(&mut self.jobs);
        for (id, job) in before {
            if !self.stored.contains(&id) {
                self.jobs.insert(id, Job { end: None, ..job });
            }
        }
    }

    fn see(&mut self, worker: &WorkerId) -> &mut Worker {
        let now = self.now;
        let state = self.workers.entry(worker.clone()).or_default();
        state.last_seen = now;
        state
    }

    fn lease(&mut self, worker: &WorkerId, credit: usize) -> Vec<Grant<u64>> {
        self.see(worker);
        if self.draining {
            return Vec::new();
        }
        let now = self.now;
        if let Some(until) = self.see(worker).set_aside_until {
            if now < until {
                return Vec::new();
            }
            self.see(worker).set_aside_until = None;
            self.strikes.retain(|(who, _)| who != worker);
        }
        let slots = self.see(worker).slots.unwrap_or(1);
        let own = self.leases.iter().filter(|l| l.held.worker == *worker);
        let free_slots = slots.saturating_sub(own.count());

        let mut queue = self.queued();
        queue.sort_by_key(|id| (self.jobs[id].priority, *id));
        let failed = |id: &JobId| self.strikes.contains(&(worker.clone(), Self::kin(*id)));
        let fresh: Vec<JobId> = queue.iter().copied().filter(|id| !failed(id)).collect();
        let mut chosen = if fresh.is_empty() || credit == 0 {
            queue
        } else {
            fresh
        };
        chosen.truncate(credit);
        if self.options.duplicate_tail {
            let mut tail: Vec<&Lease> = self.leases.iter().collect();
            tail.retain(|l| l.held.worker != *worker);
            tail.retain(|l| self.holders(l.held.job).len() == 1);
            tail.retain(|l| now.saturating_sub(l.granted) >= self.options.duplicate_after);
            tail.sort_by_key(|l| (l.granted, self.jobs[&l.held.job].priority, l.held.job));
            let room = credit.min(free_slots).saturating_sub(chosen.len());
            chosen.extend(tail.iter().take(room).map(|l| l.held.job));
        }
        let mut grants = Vec::new();
        for id in chosen {
            let attempt = self.jobs[&id].attempts + 1;
            self.hold_anew(worker, id, attempt);
            grants.push(Grant {
                job: id,
                attempt,
                payload: id.0,
            });
        }
        grants
    }

    fn hold_anew(&mut self, worker: &WorkerId, id: JobId, attempt: u32) {
        let held = Holding {
            worker: worker.clone(),
            job: id,
            attempt,
        };
        self.history.push(held.clone());
        let job = self.jobs.get_mut(&id).unwrap();
        job.attempts = job.attempts.max(attempt);
        self.leases.push(Lease {
            held,
            granted: self.now,
            expires: self.now + self.options.lease,
            started: false,
        });
    }

    fn hold(&mut self, worker: &WorkerId, held: Held) -> Directive {
        match self.jobs.get_mut(&held.job) {
            None => return Directive::Cancel,
            Some(job) if job.end.is_some() => return Directive::Cancel,
            Some(_) => {}
        }
        let holders = self.holders(held.job);
        if holders.contains(worker) {
            for lease in &mut self.leases {
                if lease.held.worker != *worker || lease.held.job != held.job {
                    continue;
                }
                lease.expires = self.now + self.options.lease;
                if held.attempt >= lease.held.attempt {
                    lease.held.attempt = held.attempt;
                    lease.started = lease.started || held.started;
                    let job = self.jobs.get_mut(&held.job).unwrap();
                    job.attempts = job.attempts.max(held.attempt);
                }
            }
            return Directive::Continue;
        }
        let now = self.now;
        let welcome = self
            .see(worker)
            .set_aside_until
            .is_none_or(|until| now >= until);
        let free = holders.is_empty() || (holders.len() == 1 && held.started);
        if !welcome || !free {
            return Directive::Cancel;
        }
        self.hold_anew(worker, held.job, held.attempt);
        Directive::Continue
    }

    fn complete(&mut self, holding: &Holding) -> Completion {
        self.see(&holding.worker);
        let id = holding.job;
        match self.jobs.get_mut(&id) {
            None => return Completion::Unknown,
            Some(job) if job.end == Some(End::Done) => return Completion::Duplicate,
            Some(job) => job.end = Some(End::Done),
        }
        self.leases.retain(|l| l.held.job != id);
        self.done += 1;
        self.stored.insert(id);
        self.strikes.retain(|(who, _)| *who != holding.worker);
        let worker = self.see(&holding.worker);
        worker.completed += 1;
        worker.times_set_aside = 0;
        Completion::First
    }

    fn fail(&mut self, holding: &Holding) -> Failure {
        self.see(&holding.worker);
        if !self.leases.iter().any(|l| l.held == *holding) {
            return Failure::Stale;
        }
        self.see(&holding.worker).failed += 1;
        self.strike(holding);
        self.leases.retain(|l| l.held != *holding);
        let limit = self.options.max_failures;
        let job = self.jobs.get_mut(&holding.job).unwrap();
        job.failures += 1;
        if job.failures < limit {
            return Failure::Retry;
        }
        self.give_up(holding.job, "no".to_owned());
        Failure::Quarantined
    }

    fn strike(&mut self, holding: &Holding) {
        let kin = Self::kin(holding.job);
        let blamed_already =
            |(who, what): &(WorkerId, JobId)| *what == kin && *who != holding.worker;
        if self.strikes.iter().any(blamed_already) {
            self.forgive(holding.job);
            return;
        }
        let strike = (holding.worker.clone(), kin);
        if !self.strikes.contains(&strike) {
            self.strikes.push(strike);
        }
        if self.strikes_of(&holding.worker) < self.options.max_worker_strikes {
            return;
        }
        let (now, first) = (self.now, self.options.set_aside);
        let worker = self.see(&holding.worker);
        let pause = first * 2_u32.pow(worker.times_set_aside.min(5));
        worker.set_aside_until = Some(now + pause);
        worker.times_set_aside += 1;
    }

    fn strikes_of(&self, worker: &WorkerId) -> u32 {
        self.strikes.iter().filter(|(who, _)| who == worker).count() as u32
    }

    fn forgive(&mut self, id: JobId) {
        let (struck, others): (Vec<_>, Vec<_>) = std::mem::take(&mut self.strikes)
            .into_iter()
            .partition(|(_, what)| *what == Self::kin(id));
        self.strikes = others;
        for (who, _) in struck {
            if self.strikes_of(&who) < self.options.max_worker_strikes {
                self.workers.get_mut(&who).unwrap().set_aside_until = None;
            }
        }
    }

    fn give_up(&mut self, id: JobId, error: String) {
        self.leases.retain(|l| l.held.job != id);
        self.jobs.get_mut(&id).unwrap().end = Some(End::GivenUp(error));
    }

    fn expire(&mut self) -> Vec<Expired> {
        let mut over = Vec::new();
        let ids: Vec<JobId> = self.jobs.keys().copied().collect();
        for id in ids {
            let of_this_job = |l: &&Lease| l.held.job == id;
            let of_this_job: Vec<Lease> = self.leases.iter().filter(of_this_job).cloned().collect();
            for lease in of_this_job {
                let given_up = self.jobs[&id].end.is_some();
                if lease.expires <= self.now && !given_up {
                    over.push(self.run_out(lease));
                }
            }
        }
        over
    }

    fn run_out(&mut self, lease: Lease) -> Expired {
        let Holding {
            worker,
            job: id,
            attempt,
        } = lease.held.clone();
        self.leases.retain(|l| l.held != lease.held);
        let job = self.jobs.get_mut(&id).unwrap();
        job.crashes += u32::from(lease.started);
        let quarantined = lease.started && job.crashes >= self.options.max_crashes;
        if lease.started {
            self.workers.get_mut(&worker).unwrap().crashed += 1;
        }
        if quarantined {
            let limit = self.options.max_crashes;
            let error = format!("{limit} workers went silent while they ran it, {worker} last");
            self.give_up(id, error);
        }
        Expired {
            job: id,
            attempt,
            worker,
            crashed: lease.started,
            quarantined,
        }
    }

    fn retry(&mut self) -> Vec<JobId> {
        let given_up: Vec<JobId> = self.given_up().into_iter().map(|(id, _)| id).collect();
        for &id in &given_up {
            let job = self.jobs.get_mut(&id).unwrap();
            job.end = None;
            job.crashes = 0;
            job.failures = 0;
            self.forgive(id);
        }
        given_up
    }

    fn forget(&mut self, id: JobId) -> Option<u64> {
        self.jobs.get(&id)?.end.as_ref()?;
        self.jobs.remove(&id);
        Some(id.0)
    }

    fn withdraw(&mut self, id: JobId) -> Option<u64> {
        if self.jobs.get(&id)?.end.is_some() {
            return None;
        }
        self.jobs.remove(&id);
        self.leases.retain(|l| l.held.job != id);
        Some(id.0)
    }

    /// Jobs 0 and 1 are kin, and 2 and 3.
    fn kin(id: JobId) -> JobId {
        JobId(if id.0 < 4 { id.0 / 2 * 2 } else { id.0 })
    }

    pub(crate) fn details(id: JobId, priority: i32) -> Details {
        Details {
            priority,
            // A job is its own kin if nobody says otherwise.
            kin: (id.0 < 4).then(|| Self::kin(id)),
            ..Details::default()
        }
    }

    /// What a store could know of a job.
    pub(crate) fn past(job: &Job) -> History {
        History {
            attempts: job.attempts,
            crashes: job.crashes,
            failures: job.failures,
        }
    }

    /// Who holds a job.
    pub(crate) fn holders(&self, id: JobId) -> Vec<WorkerId> {
        let leases = self.leases.iter().filter(|l| l.held.job == id);
        leases.map(|l| l.held.worker.clone()).collect()
    }

    /// The jobs that wait, by id.
    pub(crate) fn queued(&self) -> Vec<JobId> {
        let open = self.jobs.iter().filter(|(_, job)| job.end.is_none());
        let open = open.map(|(id, _)| *id);
        open.filter(|id| self.holders(*id).is_empty()).collect()
    }

    /// The jobs that are held, by id.
    pub(crate) fn leased(&self) -> BTreeSet<JobId> {
        self.leases.iter().map(|l| l.held.job).collect()
    }

    /// The jobs that were given up, with the reason.
    pub(crate) fn given_up(&self) -> Vec<(JobId, &str)> {
        let mut given_up = Vec::new();
        for (id, job) in &self.jobs {
            if let Some(End::GivenUp(error)) = &job.end {
                given_up.push((*id, error.as_str()));
            }
        }
        given_up
    }

    pub(crate) fn workers(&self) -> Vec<WorkerStatus> {
        let status = |(id, worker): (&WorkerId, &Worker)| {
            let held: Vec<&Lease> = self
                .leases
                .iter()
                .filter(|l| l.held.worker == *id)
                .collect();
            WorkerStatus {
                worker: id.clone(),
                leased: held.len(),
                started: held.iter().filter(|l| l.started).count(),
                completed: worker.completed,
                failed: worker.failed,
                crashed: worker.crashed,
                set_aside_until: worker.set_aside_until,
                last_seen: worker.last_seen,
            }
        };
        self.workers.iter().map(status).collect()
    }
}
