//! Random interleavings of every call, old calls repeated included.

use std::collections::{BTreeMap, BTreeSet};

use proptest::prelude::*;
use scheduler::{Completion, Counts, Failure, Held, JobId, Options, Scheduler, WorkerId};

use crate::{at, worker};

const WORKERS: usize = 4;
const JOBS: u64 = 8;

/// What happens next. A `pick` chooses among the grants that were ever made, so that calls come
/// late, twice, and after the lease is gone.
#[derive(Debug, Clone)]
enum Event {
    Add {
        job: u64,
        priority: i32,
    },
    Lease {
        worker: usize,
        credit: usize,
    },
    Heartbeat {
        worker: usize,
        picks: Vec<(usize, bool)>,
    },
    Complete {
        pick: usize,
    },
    Fail {
        pick: usize,
    },
    Release {
        pick: usize,
    },
    Wait {
        seconds: u64,
    },
    Expire,
}

fn event() -> impl Strategy<Value = Event> {
    let pick = || 0..1000_usize;
    prop_oneof![
        2 => (0..JOBS, -1..2).prop_map(|(job, priority)| Event::Add { job, priority }),
        4 => (0..WORKERS, 0..4_usize).prop_map(|(worker, credit)| Event::Lease { worker, credit }),
        3 => (0..WORKERS, prop::collection::vec((pick(), any::<bool>()), 0..4))
            .prop_map(|(worker, picks)| Event::Heartbeat { worker, picks }),
        2 => pick().prop_map(|pick| Event::Complete { pick }),
        2 => pick().prop_map(|pick| Event::Fail { pick }),
        1 => pick().prop_map(|pick| Event::Release { pick }),
        3 => (0..8_u64).prop_map(|seconds| Event::Wait { seconds }),
        2 => Just(Event::Expire),
    ]
}

/// What an onlooker knows.
#[derive(Default)]
struct Seen {
    added: BTreeSet<JobId>,
    done: BTreeSet<JobId>,
    grants: Vec<(WorkerId, JobId, u32)>,
    attempts: BTreeMap<JobId, u32>,
}

impl Seen {
    fn pick(&self, pick: usize) -> Option<(WorkerId, JobId, u32)> {
        let n = self.grants.len();
        (n > 0).then(|| self.grants[pick % n].clone())
    }
}

fn apply(s: &mut Scheduler<u64>, seen: &mut Seen, event: Event, now: &mut u64) {
    match event {
        Event::Add { job, priority } => {
            assert_eq!(
                s.add_job(JobId(job), job, priority),
                seen.added.insert(JobId(job))
            );
        }
        Event::Lease { worker: w, credit } => {
            let w = worker(&w.to_string());
            let before = leased(s, &w);
            let grants = s.lease(&w, credit, at(*now));
            assert!(grants.len() <= credit);
            assert_eq!(
                leased(s, &w),
                before + grants.len(),
                "held is what was granted"
            );
            for grant in grants {
                assert!(!seen.done.contains(&grant.job), "a done job was granted");
                assert_eq!(grant.payload, grant.job.0);
                let newest = seen.attempts.insert(grant.job, grant.attempt).unwrap_or(0);
                assert!(grant.attempt > newest, "attempts grow");
                seen.grants.push((w.clone(), grant.job, grant.attempt));
            }
        }
        Event::Heartbeat { worker: w, picks } => {
            let w = worker(&w.to_string());
            let own: Vec<_> = seen.grants.iter().filter(|g| g.0 == w).collect();
            if own.is_empty() {
                return;
            }
            let held: Vec<Held> = picks
                .into_iter()
                .map(|(pick, started)| {
                    let &(_, job, attempt) = own[pick % own.len()];
                    Held {
                        job,
                        attempt,
                        started,
                    }
                })
                .collect();
            let directives = s.heartbeat(&w, &held, at(*now));
            assert_eq!(directives.len(), held.len());
            for (job, directive) in directives {
                if seen.done.contains(&job) {
                    assert_eq!(directive, scheduler::Directive::Cancel);
                }
            }
        }
        Event::Complete { pick } => {
            let Some((w, job, attempt)) = seen.pick(pick) else {
                return;
            };
            let first = seen.done.insert(job);
            let expected = if first {
                Completion::First
            } else {
                Completion::Duplicate
            };
            assert_eq!(s.complete(&w, job, attempt, at(*now)), expected);
        }
        Event::Fail { pick } => {
            let Some((w, job, attempt)) = seen.pick(pick) else {
                return;
            };
            let before = s.counts();
            let failure = s.fail(&w, job, attempt, "no".into(), at(*now));
            let after = s.counts();
            match failure {
                Failure::Stale => assert_eq!(before, after),
                Failure::Retry => assert_eq!(before.quarantined, after.quarantined),
                Failure::Quarantined => assert_eq!(before.quarantined + 1, after.quarantined),
            }
        }
        Event::Release { pick } => {
            let Some((w, job, _)) = seen.pick(pick) else {
                return;
            };
            s.release(&w, &[job], at(*now));
        }
        Event::Wait { seconds } => *now += seconds,
        Event::Expire => {
            s.expire(at(*now));
            assert!(s.next_expiry().is_none_or(|next| next > at(*now)));
        }
    }
}

fn leased(s: &Scheduler<u64>, w: &WorkerId) -> usize {
    s.workers()
        .iter()
        .find(|status| status.worker == *w)
        .map_or(0, |status| status.leased)
}

fn check(s: &Scheduler<u64>, seen: &Seen) {
    let Counts {
        queued,
        leased,
        done,
        quarantined,
    } = s.counts();
    assert_eq!(
        queued + leased + done + quarantined,
        seen.added.len(),
        "a job was lost or doubled"
    );
    assert_eq!(done, seen.done.len(), "done reopened");
    assert_eq!(quarantined, s.quarantined().len());
    assert_eq!(s.all_settled(), queued + leased == 0);
    assert_eq!(s.next_expiry().is_some(), leased > 0);

    let leases: usize = s.workers().iter().map(|w| w.leased).sum();
    assert!(
        (leased..=2 * leased).contains(&leases),
        "{leases} leases of {leased} jobs"
    );
    for w in s.workers() {
        let granted: BTreeSet<JobId> = seen
            .grants
            .iter()
            .filter(|g| g.0 == w.worker)
            .map(|g| g.1)
            .collect();
        assert!(
            w.leased <= granted.len(),
            "{} holds more than it was ever granted",
            w.worker
        );
        assert!(w.started <= w.leased);
    }
    for (&job, &attempt) in &seen.attempts {
        assert_eq!(
            s.attempts(job),
            Some(attempt),
            "attempts grow by grants only"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_interleaving_breaks_an_invariant(
        events in prop::collection::vec(event(), 1..200),
        duplicate_tail: bool,
    ) {
        let options = Options {
            lease: at(5),
            max_crashes: 2,
            max_failures: 3,
            max_worker_strikes: 2,
            set_aside: at(4),
            duplicate_tail,
        };
        let mut s = Scheduler::new(options, 1);
        let mut seen = Seen::default();
        let mut now = 0;
        for event in events {
            apply(&mut s, &mut seen, event, &mut now);
            check(&s, &seen);
        }

        // Whatever happened, one good worker finishes what is left, in one lease per job.
        now += 100;
        s.expire(at(now));
        let good = worker("good");
        for grant in s.lease(&good, usize::MAX, at(now)) {
            prop_assert_eq!(s.complete(&good, grant.job, grant.attempt, at(now)), Completion::First);
        }
        prop_assert!(s.all_settled());
        prop_assert_eq!(s.counts().done + s.counts().quarantined, seen.added.len());
    }

    /// The same calls at the same times give the same grants.
    #[test]
    fn nothing_but_the_calls_decides(events in prop::collection::vec(event(), 1..100)) {
        let run = || {
            let mut s = Scheduler::new(Options::default(), 1);
            let mut seen = Seen::default();
            let mut now = 0;
            for event in events.clone() {
                apply(&mut s, &mut seen, event, &mut now);
            }
            (seen.grants, s.workers(), s.counts())
        };
        prop_assert_eq!(run(), run());
    }
}
