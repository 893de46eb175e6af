//! What a worker holds: jobs that wait, jobs that are being computed, and results that the
//! coordinator has not acknowledged yet.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use protocol::MAX_MESSAGE_BYTES;
use protocol::v1::{Job, JobAttempt, JobResult, job_result};
use tokio::sync::Notify;

/// The most results of a report: what their commit takes must stay short.
const RESULTS_PER_REPORT: usize = 4096;

/// The most bytes of results in a report, unless one alone is larger.
const BYTES_PER_REPORT: usize = MAX_MESSAGE_BYTES / 8;

/// How much a new job's time counts against the earlier ones.
const LEARNING_RATE: f64 = 0.1;

/// Jobs are fetched ahead for this long, so that the round trips vanish in the work.
const AHEAD_SECONDS: f64 = 0.1;

/// Of longer jobs none is fetched ahead: another worker may have a slot free for it.
const LONG_SECONDS: f64 = 10.0;

/// The most jobs ahead of each slot.
const AHEAD_MAX: f64 = 2000.0;

#[derive(Debug)]
struct Held {
    job: Arc<Job>,
    started: bool,
    cancelled: Arc<AtomicBool>,
}

#[derive(Debug)]
struct Finished {
    job: Arc<Job>,
    result: JobResult,
}

#[derive(Debug, Default)]
struct Inner {
    computing: BTreeMap<u64, Held>,
    finished: BTreeMap<u64, Finished>,
    /// What a job takes, in seconds: longer at once, shorter little by little, because the
    /// coordinator makes jobs larger when they prove to be short.
    seconds: Option<f64>,
    /// How many jobs ahead of each slot have proved to be right; it doubles with experience.
    ahead: usize,
    /// Jobs finished since it did.
    finished_since: usize,
}

impl Inner {
    fn learn(&mut self, seconds: f64) {
        self.seconds = Some(match self.seconds {
            Some(mean) if seconds < mean => mean + LEARNING_RATE * (seconds - mean),
            _ => seconds,
        });
        self.finished_since += 1;
        if seconds > AHEAD_SECONDS {
            (self.ahead, self.finished_since) = (1, 0);
        } else if self.finished_since > self.ahead {
            let most = AHEAD_MAX as usize;
            (self.ahead, self.finished_since) = ((2 * self.ahead).clamp(1, most), 0);
        }
    }
}

/// The jobs of a worker.
#[derive(Debug, Default)]
pub(crate) struct HeldJobs {
    inner: Mutex<Inner>,
    /// Rings whenever the jobs have changed.
    pub(crate) changed: Notify,
}

impl HeldJobs {
    fn with<T>(&self, act: impl FnOnce(&mut Inner) -> T) -> T {
        // No update can be half done when its code panics.
        act(&mut self.inner.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Adds a leased job; false if it is already held, which then is its newest attempt.
    pub(crate) fn take(&self, job: &Arc<Job>) -> bool {
        self.with(|inner| {
            if let Some(held) = inner.computing.get_mut(&job.job)
                && held.job.attempt < job.attempt
            {
                held.job = Arc::clone(job);
            }
            let known =
                inner.computing.contains_key(&job.job) || inner.finished.contains_key(&job.job);
            if !known {
                let held = Held {
                    job: Arc::clone(job),
                    started: false,
                    cancelled: Arc::default(),
                };
                inner.computing.insert(job.job, held);
            }
            !known
        })
    }

    /// Marks a job as started; returns what tells that it was cancelled, or none if the job was
    /// given up meanwhile.
    pub(crate) fn start(&self, job: u64) -> Option<Arc<AtomicBool>> {
        self.with(|inner| {
            let held = inner.computing.get_mut(&job)?;
            held.started = true;
            Some(Arc::clone(&held.cancelled))
        })
    }

    /// Replaces a computed job by its result, unless nobody needs it any more.
    pub(crate) fn finish(&self, result: JobResult) {
        self.with(|inner| {
            let seconds = result.wall_seconds;
            inner.learn(seconds);
            if let Some(held) = inner.computing.remove(&result.job)
                && !held.cancelled.load(Ordering::Relaxed)
            {
                let job = held.job;
                // The attempt that the coordinator knows of, should it have leased the job again.
                let attempt = job.attempt;
                let result = JobResult { attempt, ..result };
                inner.finished.insert(job.job, Finished { job, result });
            }
        });
        self.changed.notify_waiters();
    }

    /// Forgets jobs whose results are no longer needed; those that are being computed are told to
    /// stop.
    pub(crate) fn cancel(&self, jobs: &[u64]) {
        if jobs.is_empty() {
            return;
        }
        self.with(|inner| {
            for job in jobs {
                inner.finished.remove(job);
                match inner.computing.get(job) {
                    Some(held) if held.started => held.cancelled.store(true, Ordering::Relaxed),
                    _ => {
                        inner.computing.remove(job);
                    }
                }
            }
        });
        self.changed.notify_waiters();
    }

    /// Forgets everything, as when the coordinator has another campaign.
    pub(crate) fn cancel_all(&self) {
        let jobs: Vec<u64> = self.with(|inner| {
            let finished = inner.finished.keys();
            inner.computing.keys().chain(finished).copied().collect()
        });
        self.cancel(&jobs);
    }

    /// Forgets every job that has not started, and returns them.
    pub(crate) fn give_up_waiting(&self) -> Vec<u64> {
        let given_up = self.with(|inner| {
            let waiting: Vec<u64> = inner
                .computing
                .iter()
                .filter(|(_, held)| !held.started)
                .map(|(job, _)| *job)
                .collect();
            inner.computing.retain(|_, held| held.started);
            waiting
        });
        self.changed.notify_waiters();
        given_up
    }

    /// Forgets every job that is not finished, and returns them.
    pub(crate) fn give_up_all(&self) -> Vec<u64> {
        self.with(|inner| {
            for held in inner.computing.values() {
                held.cancelled.store(true, Ordering::Relaxed);
            }
            std::mem::take(&mut inner.computing).into_keys().collect()
        })
    }

    /// How many jobs are held and not finished.
    pub(crate) fn computing(&self) -> usize {
        self.with(|inner| inner.computing.len())
    }

    /// How many results wait for their acknowledgement.
    pub(crate) fn unacknowledged(&self) -> usize {
        self.with(|inner| inner.finished.len())
    }

    /// How many jobs to hold: the slots and, the shorter the jobs, the more ahead of them.
    pub(crate) fn capacity(&self, slots: usize) -> usize {
        let ahead = match self.with(|inner| inner.seconds) {
            None => 1,
            Some(seconds) if seconds > LONG_SECONDS => 0,
            Some(seconds) => (AHEAD_SECONDS / seconds.max(1e-9)).clamp(1.0, AHEAD_MAX) as usize,
        };
        slots * (1 + ahead.min(self.with(|inner| inner.ahead.max(1))))
    }

    /// As many of the results that wait for their acknowledgement as fit into a report.
    pub(crate) fn results(&self) -> Vec<JobResult> {
        self.with(|inner| {
            let mut bytes = 0;
            let mut results = Vec::new();
            for finished in inner.finished.values().take(RESULTS_PER_REPORT) {
                bytes += match &finished.result.outcome {
                    Some(job_result::Outcome::Result(payload)) => payload.len(),
                    Some(job_result::Outcome::Error(error)) => error.len(),
                    None => 0,
                };
                if bytes > BYTES_PER_REPORT && !results.is_empty() {
                    break;
                }
                results.push(finished.result.clone());
            }
            results
        })
    }

    /// Forgets acknowledged results.
    pub(crate) fn acknowledge(&self, results: &[JobResult]) {
        self.with(|inner| {
            for result in results {
                inner.finished.remove(&result.job);
            }
        });
        self.changed.notify_waiters();
    }

    /// All jobs for a heartbeat; finished but unacknowledged ones included, as they are still ours.
    pub(crate) fn attempts(&self) -> Vec<JobAttempt> {
        self.with(|inner| {
            let attempt = |job: &Job, started| JobAttempt {
                job: job.job,
                attempt: job.attempt,
                started,
            };
            let computing = inner.computing.values();
            let computing = computing.map(|held| attempt(&held.job, held.started));
            let finished = inner.finished.values();
            let finished = finished.map(|finished| attempt(&finished.job, true));
            computing.chain(finished).collect()
        })
    }

    /// All jobs with their payloads, for a coordinator that may have been restarted.
    pub(crate) fn jobs(&self) -> Vec<Job> {
        self.with(|inner| {
            let computing = inner.computing.values();
            let computing = computing.filter(|held| !held.cancelled.load(Ordering::Relaxed));
            let computing = computing.map(|held| Job::clone(&held.job));
            let finished = inner.finished.values();
            let finished = finished.map(|finished| Job::clone(&finished.job));
            computing.chain(finished).collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(job: u64) -> Arc<Job> {
        Arc::new(Job {
            job,
            attempt: 1,
            payload: vec![7],
        })
    }

    fn result(job: u64, wall_seconds: f64) -> JobResult {
        JobResult {
            job,
            attempt: 1,
            outcome: None,
            cpu_seconds: 0.0,
            wall_seconds,
        }
    }

    #[test]
    fn a_job_is_held_once_until_its_result_is_acknowledged() {
        let held = HeldJobs::default();
        assert!(held.take(&job(7)));
        assert!(!held.take(&job(7)), "a job leased twice is computed once");
        assert!(held.start(7).is_some());
        held.finish(result(7, 1.0));
        assert!(!held.take(&job(7)), "its result is still to be handed in");
        assert_eq!((held.computing(), held.unacknowledged()), (0, 1));
        held.acknowledge(&held.results());
        assert_eq!(held.unacknowledged(), 0);
        assert!(held.take(&job(7)));
    }

    #[test]
    fn a_job_leased_again_while_it_is_held_answers_as_its_newest_attempt() {
        let held = HeldJobs::default();
        held.take(&job(7));
        held.start(7);
        let again = Job {
            attempt: 3,
            ..Job::clone(&job(7))
        };
        assert!(!held.take(&Arc::new(again)));
        assert_eq!(held.attempts()[0].attempt, 3);
        held.finish(result(7, 1.0));
        assert_eq!(held.results()[0].attempt, 3, "an older one would be stale");
    }

    #[test]
    fn a_heartbeat_names_waiting_running_and_unacknowledged_jobs() {
        let held = HeldJobs::default();
        for id in 1..=3 {
            held.take(&job(id));
        }
        held.start(2);
        held.start(3);
        held.finish(result(3, 1.0));
        let mut named: Vec<(u64, bool)> = held
            .attempts()
            .iter()
            .map(|attempt| (attempt.job, attempt.started))
            .collect();
        named.sort_unstable();
        assert_eq!(named, [(1, false), (2, true), (3, true)]);
        assert_eq!(
            held.jobs().len(),
            3,
            "a restarted coordinator learns of all"
        );
    }

    #[test]
    fn giving_up_keeps_what_runs_and_what_is_finished() {
        let held = HeldJobs::default();
        for id in 1..=3 {
            held.take(&job(id));
        }
        held.start(2);
        held.start(3);
        held.finish(result(3, 1.0));
        assert_eq!(held.give_up_waiting(), [1]);
        assert!(
            held.start(1).is_none(),
            "a job that was given back must not be computed"
        );
        assert_eq!(held.give_up_all(), [2]);
        held.finish(result(2, 1.0));
        assert_eq!(
            held.unacknowledged(),
            1,
            "the result of a job given back is not ours"
        );
    }

    #[test]
    fn a_cancelled_job_is_told_to_stop_and_keeps_its_slot_until_it_does() {
        let held = HeldJobs::default();
        held.take(&job(1));
        held.take(&job(2));
        let cancelled = held.start(1).unwrap();
        held.cancel(&[1, 2]);
        assert!(cancelled.load(Ordering::Relaxed));
        assert_eq!(held.computing(), 1, "the one that waited is gone");
        assert!(held.jobs().is_empty());
        held.finish(result(1, 1.0));
        assert_eq!((held.computing(), held.unacknowledged()), (0, 0));
    }

    #[test]
    fn the_shorter_the_jobs_the_more_are_fetched_ahead() {
        let capacity = |jobs: usize, seconds: f64| {
            let held = HeldJobs::default();
            for _ in 0..jobs {
                held.finish(result(1, seconds));
            }
            held.capacity(2)
        };
        assert_eq!(HeldJobs::default().capacity(2), 4);
        assert_eq!(capacity(10_000, 1e-6), 2 * 2001);
        assert_eq!(capacity(1000, 0.01), 22);
        assert_eq!(capacity(10, 1.0), 4);
        assert_eq!(capacity(1, 3600.0), 2, "somebody else may have a slot free");
        assert_eq!(capacity(2, 1e-6), 4, "two short jobs prove little");

        let held = HeldJobs::default();
        for _ in 0..500 {
            held.finish(result(1, 1e-6));
        }
        assert!(held.capacity(1) > 100);
        held.finish(result(1, 0.5));
        assert_eq!(
            held.capacity(1),
            2,
            "one long job tells that they have grown"
        );
    }
}
