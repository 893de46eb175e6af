//! Which jobs there are: cut from samples when they are asked for, taken over from before a restart,
//! withdrawn when nobody needs them any more.

use std::sync::Arc;
use std::time::Duration;

use campaign::batches::TARGET_SECONDS;
use campaign::plan;
use campaign::task::Task;
use protocol::MAX_MESSAGE_BYTES;
use protocol::v1::Job;
use scheduler::{Details, History, JobId, WorkerId};
use tokio::time::Instant;

use super::{Inner, Posted};
use crate::ingest;

/// So many jobs wait, if there are samples to cut them from: a worker that has just failed one is to
/// find another.
const WAITING: usize = 4;

/// The most bytes of jobs in an answer, unless one alone is larger.
const BYTES_PER_LEASE: usize = MAX_MESSAGE_BYTES / 8;

/// What means looking at all jobs that are out, or at all workers, is worked out so often: not for
/// each of a thousand workers that ask.
const SURVEY_PERIOD: Duration = Duration::from_secs(1);

/// No job is taken to last longer than this, in seconds: ten years.
const LONGEST_JOB: f64 = 3e8;

impl Inner {
    /// Grants jobs one by one, cutting them from samples as they are needed.
    pub(super) fn grant(
        &mut self,
        worker: &WorkerId,
        credit: usize,
        seconds: f64,
        (lease, now): (Duration, Duration),
    ) -> Vec<Job> {
        let is_old = |of: Duration| now.saturating_sub(of) >= SURVEY_PERIOD;
        let slots = match self.slots_present {
            Some((of, slots)) if !is_old(of) => slots,
            _ => self.count_slots(lease, now),
        };
        let mut jobs = Vec::new();
        let (mut worth, mut bytes) = (0.0, 0);
        while jobs.len() < credit && (jobs.is_empty() || worth < seconds && bytes < BYTES_PER_LEASE)
        {
            while !self.scheduler.is_draining()
                && self.scheduler.queued() < WAITING
                && let Some((job, task)) = self.batches.draw(slots)
            {
                self.add_job(job, Posted::new(task));
            }
            if self.scheduler.queued() == 0 && self.patience_of.is_none_or(is_old) {
                self.patience_of = Some(now);
                let patience = 2.0 * self.longest_job();
                self.scheduler
                    .set_duplicate_after(Duration::from_secs_f64(patience));
            }
            let Some(grant) = self.scheduler.lease(worker, 1, now).pop() else {
                break;
            };
            let expected = self.batches.expected(grant.job.0);
            let seconds = expected.unwrap_or_else(|| self.posted_seconds());
            worth += seconds;
            bytes += grant.payload.payload.len();
            jobs.push(Job {
                job: grant.job.0,
                attempt: grant.attempt,
                payload: grant.payload.payload.clone(),
                seconds,
            });
        }
        jobs
    }

    /// The slots of all workers that were heard of lately.
    fn count_slots(&mut self, lease: Duration, now: Duration) -> usize {
        let moment = Instant::now();
        let present = self.workers.values();
        let present = present.filter(|worker| moment - worker.last_seen <= 2 * lease);
        let slots = present.map(|worker| worker.slots as usize).sum();
        self.slots_present = Some((now, slots));
        slots
    }

    /// Whether a job that a worker holds from before a restart is needed; if so, it is on the board
    /// afterwards.
    pub(super) fn take_over(&mut self, job: &Job) -> bool {
        if let Some(posted) = self.scheduler.payload(JobId(job.job)) {
            return posted.payload == job.payload;
        }
        let Ok(task) = serde_json::from_slice::<Task>(&job.payload) else {
            return false;
        };
        if !self.batches.adopt(job.job, &task) {
            return false;
        }
        let posted = Arc::new(Posted {
            task,
            payload: job.payload.clone(),
        });
        self.add_job(job.job, posted)
    }

    pub(super) fn add_job(&mut self, job: u64, posted: Arc<Posted>) -> bool {
        let history = if self.histories.is_empty() {
            History::default()
        } else {
            let name = ingest::job_name(job);
            self.histories.remove(&name).unwrap_or_default()
        };
        let details = Details {
            kin: Some(JobId(plan::kin(job))),
            history,
            ..Details::default()
        };
        self.scheduler.add_job_with(JobId(job), posted, details)
    }

    /// Takes back jobs for samples of designs and points that were given up meanwhile.
    pub(super) fn withdraw_needless(&mut self) {
        for job in self.batches.needless() {
            if self.scheduler.withdraw(JobId(job)).is_some() {
                self.batches.close(job, None);
            }
        }
    }

    pub(super) fn posted_seconds(&self) -> f64 {
        self.posted_seconds.unwrap_or(TARGET_SECONDS)
    }

    /// How long those jobs usually take that are out, in seconds; the slowest kind counts.
    pub(super) fn longest_job(&self) -> f64 {
        let is_running = self.open_runs.values().any(|runs| !runs.is_empty());
        let run = is_running.then(|| self.posted_seconds());
        let cut = self.batches.longest_expected();
        let longest = cut.into_iter().chain(run).fold(TARGET_SECONDS, f64::max);
        longest.min(LONGEST_JOB)
    }
}
