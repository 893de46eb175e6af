//! What a worker holds: jobs that wait, jobs that are being computed, and results that the
//! coordinator has not acknowledged yet.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use campaign::task::TaskResult;
use protocol::MAX_MESSAGE_BYTES;
use protocol::v1::{Job, JobAttempt, JobResult, job_result};
use tokio::sync::Notify;

/// The most results of a report: what their commit takes must stay short.
const RESULTS_PER_REPORT: usize = 4096;

/// The most bytes of results in a report, unless one alone is larger.
const BYTES_PER_REPORT: usize = MAX_MESSAGE_BYTES / 8;

/// Work is held for this long per slot, in seconds, that which is being computed included: enough
/// that round trips vanish in it. Of jobs that take longer none is held ahead: another worker may
/// have a slot free for it.
const HELD_SECONDS: f64 = 2.0;

/// More is asked for when less than this part of it is left.
const LOW: f64 = 0.75;

/// The most jobs per slot, however short they are.
const HELD_JOBS: usize = 2000;

/// How much more work to ask for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wanted {
    /// At most this many jobs.
    pub(crate) jobs: usize,
    /// No more once they are worth this, in seconds.
    pub(crate) seconds: f64,
}

/// What was finished of a job that is still being computed, and what it took until then.
#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) result: TaskResult,
    pub(crate) cpu_seconds: f64,
    pub(crate) wall_seconds: f64,
}

#[derive(Debug)]
struct Held {
    job: Arc<Job>,
    started: bool,
    cancelled: Arc<AtomicBool>,
    part: Option<Part>,
}

#[derive(Debug)]
struct Finished {
    job: Arc<Job>,
    result: JobResult,
}

impl Finished {
    fn is_failure(&self) -> bool {
        matches!(self.result.outcome, Some(job_result::Outcome::Error(_)))
    }
}

#[derive(Debug, Default)]
struct Inner {
    computing: BTreeMap<u64, Held>,
    /// Results, by their jobs.
    finished: BTreeMap<u64, Finished>,
    /// Failures, by their numbers: a job that failed may be leased again before the coordinator has
    /// acknowledged that it did.
    failed: BTreeMap<u64, Finished>,
    /// The number of the newest result or failure.
    serial: u64,
}

impl Inner {
    /// Numbers a result and keeps it until it is acknowledged.
    fn add_result(&mut self, job: Arc<Job>, result: JobResult) {
        self.serial += 1;
        let serial = self.serial;
        let result = JobResult { serial, ..result };
        let id = job.job;
        let finished = Finished { job, result };
        if finished.is_failure() {
            self.failed.insert(serial, finished);
        } else {
            self.finished.insert(id, finished);
        }
    }

    /// What waits for its acknowledgement.
    fn unacknowledged(&self) -> impl Iterator<Item = &Finished> {
        self.finished.values().chain(self.failed.values())
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
                    part: None,
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

    /// Keeps what is finished of a job, should there be no time for the rest.
    pub(crate) fn keep(&self, job: u64, part: Part) {
        self.with(|inner| {
            if let Some(held) = inner.computing.get_mut(&job) {
                held.part = Some(part);
            }
        });
    }

    /// Replaces a computed job by its result, which gets its number here, unless nobody needs it any
    /// more.
    pub(crate) fn finish(&self, result: JobResult) {
        self.with(|inner| {
            if let Some(held) = inner.computing.remove(&result.job)
                && !held.cancelled.load(Ordering::Relaxed)
            {
                let job = held.job;
                // The attempt that the coordinator knows of, should it have leased the job again.
                let attempt = job.attempt;
                inner.add_result(job, JobResult { attempt, ..result });
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
            inner
                .failed
                .retain(|_, failed| !jobs.contains(&failed.job.job));
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
            let unacknowledged = inner.unacknowledged().map(|finished| finished.job.job);
            inner
                .computing
                .keys()
                .copied()
                .chain(unacknowledged)
                .collect()
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

    /// Ends every job that is not finished: those of which a part was kept are finished with that,
    /// the others are forgotten and returned.
    pub(crate) fn give_up_all(&self) -> Vec<u64> {
        let given_up = self.with(|inner| {
            let mut given_up = Vec::new();
            for (id, held) in std::mem::take(&mut inner.computing) {
                let is_wanted = !held.cancelled.swap(true, Ordering::Relaxed);
                let part = held.part.filter(|_| is_wanted);
                let payload = part.as_ref().map(|part| serde_json::to_vec(&part.result));
                let (Some(part), Some(Ok(payload))) = (part, payload) else {
                    given_up.push(id);
                    continue;
                };
                let result = JobResult {
                    job: id,
                    attempt: held.job.attempt,
                    outcome: Some(job_result::Outcome::Result(payload)),
                    cpu_seconds: part.cpu_seconds,
                    wall_seconds: part.wall_seconds,
                    serial: 0,
                };
                inner.add_result(held.job, result);
            }
            given_up
        });
        self.changed.notify_waiters();
        given_up
    }

    /// How many jobs are held and not finished.
    pub(crate) fn computing(&self) -> usize {
        self.with(|inner| inner.computing.len())
    }

    /// How many results wait for their acknowledgement.
    pub(crate) fn unacknowledged(&self) -> usize {
        self.with(|inner| inner.unacknowledged().count())
    }

    /// What to ask for with `slots` slots; none while enough is held.
    pub(crate) fn wanted(&self, slots: usize) -> Option<Wanted> {
        self.with(|inner| {
            let held = inner.computing.len();
            let worth: f64 = inner.computing.values().map(|held| held.job.seconds).sum();
            let (jobs, seconds) = (HELD_JOBS * slots, HELD_SECONDS * slots as f64);
            let is_low = worth < LOW * seconds && (held as f64) < LOW * jobs as f64;
            (held < slots || is_low).then(|| Wanted {
                jobs: jobs - held,
                seconds: seconds - worth,
            })
        })
    }

    /// As many of the results that wait for their acknowledgement as fit into a report.
    pub(crate) fn results(&self) -> Vec<JobResult> {
        self.with(|inner| {
            let mut bytes = 0;
            let mut results = Vec::new();
            for finished in inner.unacknowledged().take(RESULTS_PER_REPORT) {
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
            for JobResult { job, serial, .. } in results {
                inner.failed.remove(serial);
                // Another result of the job, of which the coordinator has not heard, must stay.
                if inner
                    .finished
                    .get(job)
                    .is_some_and(|finished| finished.result.serial == *serial)
                {
                    inner.finished.remove(job);
                }
            }
        });
        self.changed.notify_waiters();
    }

    /// All jobs for a heartbeat; finished but unacknowledged ones included, as they are still ours. Not
    /// those that failed: the coordinator may have taken note of that already, and would take the call
    /// for a sign that they are being computed again.
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
            let finished = inner.unacknowledged();
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
            seconds: 1.0,
        })
    }

    fn result(job: u64, wall_seconds: f64) -> JobResult {
        JobResult {
            job,
            attempt: 1,
            outcome: None,
            cpu_seconds: 0.0,
            wall_seconds,
            serial: 0,
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
    fn a_job_that_failed_may_be_leased_again_before_its_failure_is_acknowledged() {
        let held = HeldJobs::default();
        let failure = |attempt| JobResult {
            attempt,
            outcome: Some(job_result::Outcome::Error("no load path".to_owned())),
            ..result(7, 1.0)
        };
        held.take(&job(7));
        held.start(7);
        held.finish(failure(1));
        assert_eq!(held.jobs().len(), 1, "a restarted coordinator learns of it");
        assert!(held.attempts().is_empty(), "it is not being computed");
        let first = held.results();

        let again = Job {
            attempt: 2,
            ..Job::clone(&job(7))
        };
        assert!(held.take(&Arc::new(again)), "another attempt");
        held.start(7);
        held.finish(failure(2));
        let both: Vec<(u32, u64)> = held
            .results()
            .iter()
            .map(|result| (result.attempt, result.serial))
            .collect();
        assert_eq!(both, [(1, 1), (2, 2)]);
        held.acknowledge(&first);
        assert_eq!(held.results()[0].serial, 2, "only what was reported");
        held.cancel(&[7]);
        assert_eq!(held.unacknowledged(), 0);
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
    fn giving_up_hands_in_what_is_finished_of_a_job() {
        let held = HeldJobs::default();
        for id in 1..=3 {
            held.take(&job(id));
            held.start(id);
        }
        let part = || Part {
            result: TaskResult::Verify {
                point: "archard".to_owned(),
                first: 4,
                samples_um: vec![1.5, 2.5],
            },
            cpu_seconds: 3.0,
            wall_seconds: 4.0,
        };
        held.keep(1, part());
        held.keep(3, part());
        held.cancel(&[3]);
        assert_eq!(held.give_up_all(), [2, 3], "nobody needs the third");
        let results = held.results();
        assert_eq!(results.len(), 1);
        let Some(job_result::Outcome::Result(payload)) = &results[0].outcome else {
            panic!("a result")
        };
        let read: TaskResult = serde_json::from_slice(payload).unwrap();
        assert_eq!((results[0].job, read), (1, part().result));
        // The sample that was in the way ends after all: the part has gone its way.
        held.finish(result(1, 9.0));
        assert_eq!(held.results(), results);
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
    fn the_shorter_the_jobs_the_more_are_held_ahead() {
        let held = |jobs: u64, seconds: f64| {
            let held = HeldJobs::default();
            for id in 0..jobs {
                held.take(&Arc::new(Job {
                    seconds,
                    ..Job::clone(&job(id))
                }));
            }
            held.wanted(2)
        };
        let wanted = |jobs, seconds| Some(Wanted { jobs, seconds });
        assert_eq!(held(0, 0.0), wanted(4000, 4.0));
        assert_eq!(held(2, 1.0), wanted(3998, 2.0));
        assert_eq!(held(4, 1.0), None);
        assert_eq!(held(1, 3600.0), wanted(3999, -3596.0), "a slot is free");
        assert_eq!(held(2, 3600.0), None, "somebody else may have a slot free");
        assert_eq!(held(2500, 1e-6), wanted(1500, 4.0 - 0.0025));
        assert_eq!(held(3500, 1e-6), None, "they are asked for by the handful");
    }
}
