//! The jobs that a worker holds, from their lease to the acknowledgement of their results.

use std::collections::BTreeMap;
use std::sync::Mutex;

use protocol::v1::{JobAttempt, JobResult};
use tokio::sync::Notify;

/// A job between its lease and the end of its computation.
#[derive(Debug, Clone, Copy)]
struct Held {
    attempt: u32,
    started: bool,
}

#[derive(Debug, Default)]
struct Inner {
    computing: BTreeMap<u64, Held>,
    /// Finished, but not yet acknowledged.
    finished: Vec<JobResult>,
}

/// The list of held jobs, shared by the worker's tasks.
#[derive(Debug, Default)]
pub(crate) struct HeldJobs {
    inner: Mutex<Inner>,
    /// Rings whenever a job was finished, acknowledged or given up.
    pub(crate) changed: Notify,
}

impl HeldJobs {
    fn with<T>(&self, act: impl FnOnce(&mut Inner) -> T) -> T {
        // A poisoned list is still a list: no update can be half done.
        act(&mut self
            .inner
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    /// Adds a leased job; false if it is already held.
    pub(crate) fn take(&self, job: u64, attempt: u32) -> bool {
        self.with(|inner| {
            let known = inner.computing.contains_key(&job)
                || inner.finished.iter().any(|result| result.job == job);
            if !known {
                inner.computing.insert(
                    job,
                    Held {
                        attempt,
                        started: false,
                    },
                );
            }
            !known
        })
    }

    /// Marks a job as started; false if it was given up meanwhile.
    pub(crate) fn start(&self, job: u64) -> bool {
        self.with(|inner| {
            inner
                .computing
                .get_mut(&job)
                .map(|held| held.started = true)
        })
        .is_some()
    }

    /// Replaces a computed job by its result.
    pub(crate) fn finish(&self, result: JobResult) {
        self.with(|inner| {
            if inner.computing.remove(&result.job).is_some() {
                inner.finished.push(result);
            }
        });
        self.changed.notify_waiters();
    }

    /// Forgets jobs whose results are no longer needed, unless they are being computed anyway.
    pub(crate) fn cancel(&self, jobs: &[u64]) {
        self.with(|inner| {
            inner
                .computing
                .retain(|job, held| held.started || !jobs.contains(job))
        });
        self.changed.notify_waiters();
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
        self.with(|inner| std::mem::take(&mut inner.computing).into_keys().collect())
    }

    /// How many jobs are held and not finished.
    pub(crate) fn computing(&self) -> usize {
        self.with(|inner| inner.computing.len())
    }

    /// How many results wait for their acknowledgement.
    pub(crate) fn unacknowledged(&self) -> usize {
        self.with(|inner| inner.finished.len())
    }

    /// All results that wait for their acknowledgement.
    pub(crate) fn results(&self) -> Vec<JobResult> {
        self.with(|inner| inner.finished.clone())
    }

    /// Forgets acknowledged results.
    pub(crate) fn acknowledge(&self, results: &[JobResult]) {
        self.with(|inner| {
            inner
                .finished
                .retain(|held| !results.iter().any(|result| result.job == held.job));
        });
        self.changed.notify_waiters();
    }

    /// All jobs for a heartbeat; finished but unacknowledged ones included, as they are still ours.
    pub(crate) fn attempts(&self) -> Vec<JobAttempt> {
        self.with(|inner| {
            let computing = inner.computing.iter().map(|(job, held)| JobAttempt {
                job: *job,
                attempt: held.attempt,
                started: held.started,
            });
            let finished = inner.finished.iter().map(|result| JobAttempt {
                job: result.job,
                attempt: result.attempt,
                started: true,
            });
            computing.chain(finished).collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(job: u64) -> JobResult {
        JobResult {
            job,
            attempt: 1,
            outcome: None,
            cpu_seconds: 0.0,
        }
    }

    #[test]
    fn a_job_is_held_once_until_its_result_is_acknowledged() {
        let held = HeldJobs::default();
        assert!(held.take(7, 1));
        assert!(!held.take(7, 2), "a job leased twice is computed once");
        assert!(held.start(7));
        held.finish(result(7));
        assert!(!held.take(7, 3), "its result is still to be handed in");
        assert_eq!((held.computing(), held.unacknowledged()), (0, 1));
        held.acknowledge(&held.results());
        assert_eq!(held.unacknowledged(), 0);
        assert!(held.take(7, 4));
    }

    #[test]
    fn a_heartbeat_names_waiting_running_and_unacknowledged_jobs() {
        let held = HeldJobs::default();
        for job in 1..=3 {
            held.take(job, 1);
        }
        held.start(2);
        held.start(3);
        held.finish(result(3));
        let mut named: Vec<(u64, bool)> = held
            .attempts()
            .iter()
            .map(|attempt| (attempt.job, attempt.started))
            .collect();
        named.sort_unstable();
        assert_eq!(named, [(1, false), (2, true), (3, true)]);
    }

    #[test]
    fn giving_up_keeps_what_runs_and_what_is_finished() {
        let held = HeldJobs::default();
        for job in 1..=3 {
            held.take(job, 1);
        }
        held.start(2);
        held.start(3);
        held.finish(result(3));
        assert_eq!(held.give_up_waiting(), [1]);
        assert!(
            !held.start(1),
            "a job that was given back must not be computed"
        );
        held.cancel(&[2]);
        assert_eq!(held.computing(), 1, "what runs cannot be stopped half-way");
        assert_eq!(held.give_up_all(), [2]);
        held.finish(result(2));
        assert_eq!(
            held.unacknowledged(),
            1,
            "the result of a job given back is not ours"
        );
    }
}
