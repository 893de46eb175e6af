//! Random interleavings of every call, late, repeated, overtaken and invented ones included,
//! against the plain model.

use std::collections::{BTreeMap, BTreeSet};

use proptest::prelude::*;
use proptest::sample::select;
use proptest_state_machine::{ReferenceStateMachine, StateMachineTest, prop_state_machine};
use scheduler::{
    Completion, Counts, Details, Explanation, Held, JobId, Options, Scheduler, WorkerId,
};

use crate::model::{Answer, Call, End, Holding, Model};
use crate::{at, worker};

const WORKERS: usize = 4;
const JOBS: u64 = 8;

/// The scheduler, and what an onlooker has seen of it.
struct Watched {
    scheduler: Scheduler<u64>,
    done: BTreeSet<JobId>,
    attempts: BTreeMap<JobId, u32>,
}

struct Machine;

fn a_worker() -> impl Strategy<Value = WorkerId> {
    (0..WORKERS).prop_map(|index| worker(&index.to_string()))
}

/// One number more than there are jobs, so that some are never added.
fn a_job() -> impl Strategy<Value = JobId> {
    (0..=JOBS).prop_map(JobId)
}

/// Who says that it holds what: mostly the truth, often what was once true, sometimes anything.
fn a_holding(model: &Model) -> BoxedStrategy<Holding> {
    let invented = (a_worker(), a_job(), 0..6_u32).prop_map(|(worker, job, attempt)| Holding {
        worker,
        job,
        attempt,
    });
    let current: Vec<Holding> = model.leases.iter().map(|l| l.held.clone()).collect();
    if current.is_empty() && model.history.is_empty() {
        return invented.boxed();
    }
    let past = select(model.history.clone());
    if current.is_empty() {
        return prop_oneof![4 => past, 1 => invented].boxed();
    }
    prop_oneof![8 => select(current), 3 => past, 1 => invented].boxed()
}

fn a_heartbeat(model: &Model) -> BoxedStrategy<Call> {
    let also = prop::collection::vec((a_holding(model), any::<bool>()), 0..4);
    let leases = model.leases.clone();
    (a_worker(), any::<bool>(), any::<bool>(), also)
        .prop_map(move |(worker, honest, start, also)| {
            let own = leases.iter().filter(|l| honest && l.held.worker == worker);
            let own = own.map(|l| (l.held.clone(), start));
            let held = own.chain(also).map(|(holding, started)| Held {
                job: holding.job,
                attempt: holding.attempt,
                started,
            });
            Call::Heartbeat {
                held: held.collect(),
                worker,
            }
        })
        .boxed()
}

impl ReferenceStateMachine for Machine {
    type State = Model;
    type Transition = Call;

    fn init_state() -> BoxedStrategy<Model> {
        (1..4_u32, 1..4_u32, 1..4_u32, any::<bool>(), 0..=JOBS)
            .prop_map(
                |(max_crashes, max_failures, strikes, duplicate_tail, jobs)| {
                    let mut model = Model::new(Options {
                        lease: at(5),
                        max_crashes,
                        max_failures,
                        max_worker_strikes: strikes,
                        set_aside: at(4),
                        duplicate_tail,
                        duplicate_after: at(2),
                    });
                    for job in (0..jobs).map(JobId) {
                        model.call(&Call::Add { job, priority: 0 });
                    }
                    model
                },
            )
            .boxed()
    }

    fn transitions(model: &Model) -> BoxedStrategy<Call> {
        let release = (a_holding(model), prop::collection::vec(a_job(), 0..3));
        prop_oneof![
            2 => (a_job(), -1..2).prop_map(|(job, priority)| Call::Add { job, priority }),
            6 => (a_worker(), 0..4_usize).prop_map(|(worker, credit)| Call::Lease { worker, credit }),
            1 => (a_worker(), 1..4_usize).prop_map(|(worker, slots)| Call::Slots { worker, slots }),
            6 => a_heartbeat(model),
            3 => a_holding(model).prop_map(|holding| Call::Complete { holding }),
            4 => a_holding(model).prop_map(|holding| Call::Fail { holding }),
            1 => a_holding(model).prop_map(|holding| Call::FailedBefore { holding }),
            2 => release.prop_map(|(holding, mut jobs)| {
                jobs.push(holding.job);
                Call::Release { worker: holding.worker, jobs }
            }),
            4 => (1..6_u64).prop_map(|seconds| Call::Wait { seconds }),
            4 => Just(Call::Expire),
            1 => Just(Call::Retry),
            1 => prop::bool::weighted(0.3).prop_map(Call::Drain),
            1 => a_job().prop_map(|job| Call::Forget { job }),
            1 => a_job().prop_map(|job| Call::Withdraw { job }),
            1 => Just(Call::Restart),
        ]
        .boxed()
    }

    /// A coordinator never adds what its store has, so neither does the test.
    fn preconditions(model: &Model, call: &Call) -> bool {
        !matches!(call, Call::Add { job, .. }
            if model.stored.contains(job) && !model.jobs.contains_key(job))
    }

    fn apply(mut model: Model, call: &Call) -> Model {
        model.call(call);
        model
    }
}

impl StateMachineTest for Machine {
    type SystemUnderTest = Watched;
    type Reference = Self;

    fn init_test(model: &Model) -> Watched {
        Watched {
            scheduler: restarted(model),
            done: BTreeSet::new(),
            attempts: BTreeMap::new(),
        }
    }

    fn apply(mut watched: Watched, model: &Model, call: Call) -> Watched {
        let now = model.now;
        let s = &mut watched.scheduler;
        let answer = match call {
            Call::Add { job, priority } => {
                Answer::Added(s.add_job_with(job, job.0, Model::details(job, priority)))
            }
            Call::Withdraw { job } => {
                let withdrawn = s.withdraw(job);
                if withdrawn.is_some() {
                    watched.attempts.remove(&job);
                }
                Answer::Forgot(withdrawn)
            }
            Call::Slots { worker, slots } => {
                s.set_slots(&worker, slots, now);
                Answer::None
            }
            Call::Lease { worker, credit } => Answer::Granted(s.lease(&worker, credit, now)),
            Call::Heartbeat { worker, held } => Answer::Told(s.heartbeat(&worker, &held, now)),
            Call::Complete { holding: h } => {
                let completion = s.complete(&h.worker, h.job, h.attempt, now);
                let first = completion == Completion::First;
                assert!(!first || watched.done.insert(h.job), "done reopened");
                Answer::Completed(completion)
            }
            Call::Fail { holding: h } => {
                Answer::Failed(s.fail(&h.worker, h.job, h.attempt, "no".to_owned(), now))
            }
            Call::FailedBefore { holding: h } => {
                s.failed_before(&h.worker, h.job, h.attempt, now);
                Answer::None
            }
            Call::Release { worker, jobs } => {
                s.release(&worker, &jobs, now);
                Answer::None
            }
            Call::Expire => Answer::RanOut(s.expire(now)),
            Call::Retry => Answer::Retried(s.retry_quarantined()),
            Call::Drain(draining) => {
                s.set_draining(draining);
                Answer::None
            }
            Call::Forget { job } => {
                watched.attempts.remove(&job);
                Answer::Forgot(s.forget(job))
            }
            Call::Restart => {
                *s = restarted(model);
                Answer::None
            }
            Call::Wait { .. } => Answer::None,
        };
        assert_eq!(answer, model.answer);
        if let Answer::Granted(grants) = &answer {
            for grant in grants {
                assert!(!watched.done.contains(&grant.job), "a done job was granted");
                let newest = watched.attempts.get(&grant.job);
                assert!(newest.is_none_or(|n| grant.attempt > *n), "attempts grow");
            }
        }
        for id in model.jobs.keys() {
            let attempts = watched.scheduler.attempts(*id).unwrap();
            let before = watched.attempts.insert(*id, attempts);
            assert!(before.is_none_or(|n| attempts >= n), "attempts shrank");
        }
        watched
    }

    fn check_invariants(watched: &Watched, model: &Model) {
        let s = &watched.scheduler;
        assert_eq!(s.epoch(), model.epoch);
        assert_eq!(s.is_draining(), model.draining);
        let (queued, leased) = (model.queued().len(), model.leased().len());
        let given_up = model.given_up();
        let counts = Counts {
            queued,
            leased,
            done: model.done,
            quarantined: given_up.len(),
        };
        assert_eq!(s.counts(), counts);
        assert_eq!(s.queued(), queued);
        assert_eq!(s.quarantined(), given_up);
        assert_eq!(s.all_settled(), queued + leased == 0);
        assert_eq!(s.workers(), model.workers());
        assert_eq!(
            s.next_expiry(),
            model.leases.iter().map(|l| l.expires).min()
        );
        for id in (0..=JOBS).map(JobId) {
            let job = model.jobs.get(&id);
            assert_eq!(s.payload(id).copied(), job.map(|_| id.0));
            assert_eq!(s.attempts(id), job.map(|job| job.attempts));
        }

        // A job is in exactly one state; two leases at most, of different workers.
        let done = model.jobs.values().filter(|job| job.end == Some(End::Done));
        let settled = done.count() + given_up.len();
        assert_eq!(queued + leased + settled, model.jobs.len());
        for id in model.leased() {
            let holders = model.holders(id);
            let distinct: BTreeSet<&WorkerId> = holders.iter().collect();
            assert!(holders.len() <= 2 && distinct.len() == holders.len());
        }
        explained(s, model, counts);
    }

    /// Whatever happened, one good worker finishes what is left, in one lease per job.
    fn teardown(mut watched: Watched, model: Model) {
        let s = &mut watched.scheduler;
        s.set_draining(false);
        let now = model.now + at(1000);
        s.expire(now);
        let open = s.counts().queued;
        let good = worker("good");
        let grants = s.lease(&good, usize::MAX, now);
        assert_eq!(grants.len(), open);
        for grant in grants {
            let completion = s.complete(&good, grant.job, grant.attempt, now);
            assert_eq!(completion, Completion::First);
        }
        assert!(s.all_settled());
    }
}

fn restarted(model: &Model) -> Scheduler<u64> {
    let mut scheduler = Scheduler::new(model.options.clone(), model.epoch);
    for (id, job) in &model.jobs {
        let details = Details {
            history: Model::past(job),
            ..Model::details(*id, job.priority)
        };
        assert!(scheduler.add_job_with(*id, id.0, details));
    }
    scheduler
}

/// What is explained agrees with what is so.
fn explained(s: &Scheduler<u64>, model: &Model, counts: Counts) {
    let reasons = s.explain(model.now);
    assert!(!reasons.is_empty());
    let draining = |reason: &Explanation| matches!(reason, Explanation::Draining { .. });
    assert_eq!(reasons.iter().any(draining), model.draining);
    for reason in reasons {
        let sentence = reason.to_string();
        assert!(
            !sentence.contains('\n') && sentence.len() < 600,
            "{sentence}"
        );
        let nothing_open = counts.queued + counts.leased == 0;
        match reason {
            Explanation::NothingAdded => assert!(nothing_open && model.done == 0),
            Explanation::AllDone { done } => {
                assert!(nothing_open && counts.quarantined == 0 && done == model.done);
            }
            Explanation::OnlyQuarantined { quarantined, .. } => {
                assert!(nothing_open && quarantined == counts.quarantined);
            }
            Explanation::Draining { leased, queued } => {
                assert_eq!((leased, queued), (counts.leased, counts.queued));
            }
            Explanation::NoWorkers { known, open, .. } => {
                assert_eq!(known, s.workers().len());
                assert_eq!(open, counts.queued + counts.leased);
                let silent = |w: &scheduler::WorkerStatus| model.now - w.last_seen > at(5);
                assert!(s.workers().iter().all(silent));
            }
            Explanation::SetAside {
                set_aside,
                present,
                queued,
                next_in,
            } => {
                assert!(set_aside > 0 && set_aside <= present && present <= s.workers().len());
                assert!(queued == counts.queued && queued > 0 && !next_in.is_zero());
            }
            Explanation::LastLeases {
                leased, workers, ..
            } => {
                assert!(counts.queued == 0 && leased == counts.leased);
                let holding = s.workers().into_iter().filter(|w| w.leased > 0);
                assert_eq!(workers, holding.map(|w| w.worker).collect::<Vec<_>>());
            }
            Explanation::NotAsked { queued, workers } => {
                assert!(counts.leased == 0 && queued == counts.queued && workers > 0);
            }
            Explanation::Running {
                leased,
                workers,
                queued,
            } => {
                assert_eq!((leased, queued), (counts.leased, counts.queued));
                assert_eq!(workers, s.workers().iter().filter(|w| w.leased > 0).count());
            }
        }
    }
}

prop_state_machine! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        cases: 1000,
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_interleaving_tells_the_scheduler_from_the_model(sequential 1..120 => Machine);
}
