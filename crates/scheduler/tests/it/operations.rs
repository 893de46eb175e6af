//! What an operator does and asks: draining, retrying, forgetting, explaining.

use scheduler::{Completion, Counts, Directive, Explanation, Failure, JobId, Options};

use crate::{at, ids, options, running, scheduler, waiting, worker};

#[test]
fn draining_grants_nothing_and_lets_held_jobs_finish() {
    let mut s = scheduler(options(), 4);
    let (a, b) = (worker("a"), worker("b"));
    s.lease(&a, 2, at(0));
    s.set_draining(true);
    assert!(s.is_draining());
    assert!(s.lease(&b, 9, at(1)).is_empty());
    assert_eq!(s.queued(), 2);
    let told = s.heartbeat(&a, &[running(0, 1), waiting(1, 1)], at(5));
    assert!(told.iter().all(|(_, told)| *told == Directive::Continue));
    assert!(s.expire(at(14)).is_empty(), "the heartbeat counted");
    assert_eq!(s.complete(&a, JobId(0), 1, at(14)), Completion::First);
    let failure = s.fail(&a, JobId(1), 1, "no".into(), at(14));
    assert_eq!(failure, Failure::Retry);
    assert!(s.lease(&a, 9, at(14)).is_empty());
    s.set_draining(false);
    assert_eq!(ids(&s.lease(&b, 9, at(15))), [1, 2, 3]);
}

#[test]
fn draining_gives_no_second_leases_either() {
    let mut s = scheduler(
        Options {
            duplicate_tail: true,
            ..options()
        },
        1,
    );
    s.lease(&worker("a"), 1, at(0));
    s.set_draining(true);
    assert!(s.lease(&worker("b"), 1, at(1)).is_empty());
}

#[test]
fn a_retried_job_has_all_its_chances_again_and_its_attempts_go_on() {
    let mut s = scheduler(options(), 2);
    let (a, b) = (worker("a"), worker("b"));
    for (who, attempt) in [(&a, 1), (&b, 2)] {
        assert_eq!(ids(&s.lease(who, 1, at(0))), [0]);
        s.fail(who, JobId(0), attempt, "no".into(), at(0));
    }
    assert_eq!(s.quarantined(), [(JobId(0), "no")]);
    assert_eq!(s.retry_quarantined(), [JobId(0)]);
    assert!(s.quarantined().is_empty() && s.retry_quarantined().is_empty());
    assert_eq!(s.counts().queued, 2);
    // One failure is not two: the counter was reset.
    let grant = s.lease(&a, 1, at(9)).remove(0);
    assert_eq!((grant.job, grant.attempt), (JobId(0), 3));
    let failure = s.fail(&a, JobId(0), 3, "again".into(), at(9));
    assert_eq!(failure, Failure::Retry);
    assert_eq!(s.lease(&b, 1, at(9))[0].attempt, 4);
    let failure = s.fail(&b, JobId(0), 4, "again".into(), at(9));
    assert_eq!(failure, Failure::Quarantined);
}

#[test]
fn retrying_resets_crashes_too() {
    let mut s = scheduler(options(), 1);
    for attempt in 1..=2 {
        let name = worker(&format!("w{attempt}"));
        s.lease(&name, 1, at(0));
        s.heartbeat(&name, &[running(0, attempt)], at(0));
        s.expire(at(10));
    }
    assert_eq!(s.retry_quarantined(), [JobId(0)]);
    s.lease(&worker("w3"), 1, at(20));
    s.heartbeat(&worker("w3"), &[running(0, 3)], at(20));
    assert_eq!(s.expire(at(30)).len(), 1);
    assert_eq!(s.counts().queued, 1, "one crash is not two");
}

#[test]
fn retrying_forgives_the_workers_that_failed_the_jobs() {
    let once = Options {
        max_failures: 1,
        ..options()
    };
    let mut s = scheduler(once, 3);
    let a = worker("a");
    for grant in s.lease(&a, 3, at(0)) {
        s.fail(&a, grant.job, 1, "no such file".into(), at(0));
    }
    assert_eq!(s.workers()[0].set_aside_until, Some(at(100)));
    assert_eq!(s.retry_quarantined().len(), 3);
    assert_eq!(ids(&s.lease(&a, 3, at(1))), [0, 1, 2]);
}

#[test]
fn a_forgotten_job_is_as_if_never_added_but_counted() {
    let mut s = scheduler(options(), 3);
    let a = worker("a");
    s.lease(&a, 1, at(0));
    assert_eq!(s.forget(JobId(0)), None, "it is held");
    assert_eq!(s.forget(JobId(1)), None, "it waits");
    assert_eq!(s.forget(JobId(7)), None, "it was never added");
    s.complete(&a, JobId(0), 1, at(1));
    assert_eq!(s.forget(JobId(0)).as_deref(), Some("job 0"));
    assert_eq!(s.forget(JobId(0)), None);
    let counts = Counts {
        queued: 2,
        done: 1,
        ..Counts::default()
    };
    assert_eq!(s.counts(), counts, "progress never drops");
    assert_eq!((s.payload(JobId(0)), s.attempts(JobId(0))), (None, None));
    let late = s.complete(&a, JobId(0), 1, at(2));
    assert_eq!(late, Completion::Unknown);
    let told = s.heartbeat(&a, &[running(0, 1)], at(2));
    assert_eq!(told, [(JobId(0), Directive::Cancel)]);
    let stale = s.fail(&a, JobId(0), 1, "no".into(), at(2));
    assert_eq!(stale, Failure::Stale);
    s.release(&a, &[JobId(0)], at(2));
    assert_eq!(s.counts(), counts);
}

#[test]
fn a_forgotten_given_up_job_is_not_retried() {
    let once = Options {
        max_failures: 1,
        ..options()
    };
    let mut s = scheduler(once, 1);
    let a = worker("a");
    s.lease(&a, 1, at(0));
    s.fail(&a, JobId(0), 1, "no".into(), at(0));
    assert_eq!(s.forget(JobId(0)).as_deref(), Some("job 0"));
    assert!(s.retry_quarantined().is_empty());
    assert_eq!(s.counts(), Counts::default());
    assert!(s.add_job(JobId(0), "anew".into(), 0));
    assert_eq!(s.lease(&worker("b"), 1, at(1))[0].attempt, 1);
}

#[test]
fn a_late_heartbeat_of_an_older_attempt_starts_nothing() {
    let mut s = scheduler(
        Options {
            max_crashes: 1,
            ..options()
        },
        1,
    );
    let a = worker("a");
    s.lease(&a, 1, at(0));
    s.release(&a, &[JobId(0)], at(1));
    assert_eq!(s.lease(&a, 1, at(2))[0].attempt, 2);
    // Sent before the release, it arrives now; attempt 2 never started.
    let told = s.heartbeat(&a, &[running(0, 1)], at(3));
    assert_eq!(told[0].1, Directive::Continue);
    assert!(!s.expire(at(13))[0].crashed);
}

#[test]
fn a_worker_that_holds_a_newer_attempt_than_its_lease_is_believed() {
    // Attempt 4 is from before a restart; the new scheduler leased the job as attempt 1 before
    // the worker's first heartbeat.
    let mut s = scheduler(options(), 1);
    let a = worker("a");
    assert_eq!(s.lease(&a, 1, at(0))[0].attempt, 1);
    s.heartbeat(&a, &[running(0, 4)], at(1));
    assert_eq!(s.attempts(JobId(0)), Some(4));
    let failure = s.fail(&a, JobId(0), 4, "no".into(), at(2));
    assert_eq!(failure, Failure::Retry);
    assert_eq!(s.lease(&worker("b"), 1, at(3))[0].attempt, 5);
}

#[test]
fn every_reason_is_explained() {
    let second_leases = Options {
        duplicate_tail: true,
        ..options()
    };
    let mut s = scheduler(second_leases, 0);
    let (a, b) = (worker("a"), worker("b"));
    assert_eq!(s.explain(at(0)), [Explanation::NothingAdded]);

    for id in 0..4 {
        s.add_job(JobId(id), format!("job {id}"), 0);
    }
    let none = Explanation::NoWorkers {
        known: 0,
        silent_for: None,
        open: 4,
    };
    assert_eq!(s.explain(at(1)), [none]);
    s.heartbeat(&a, &[], at(2));
    let idle = Explanation::NotAsked {
        queued: 4,
        workers: 1,
    };
    assert_eq!(s.explain(at(2)), [idle]);

    s.lease(&a, 3, at(3));
    let running = Explanation::Running {
        leased: 3,
        workers: 1,
        queued: 1,
    };
    assert_eq!(s.explain(at(4)), std::slice::from_ref(&running));
    s.set_draining(true);
    let draining = Explanation::Draining {
        leased: 3,
        queued: 1,
    };
    assert_eq!(s.explain(at(4)), [draining, running]);
    s.set_draining(false);

    s.set_slots(&b, 2, at(5));
    s.lease(&b, 2, at(5));
    let last = Explanation::LastLeases {
        leased: 4,
        workers: vec![a.clone(), b.clone()],
        oldest_for: at(3),
    };
    assert_eq!(s.explain(at(6)), [last]);

    for id in 0..3 {
        s.fail(&a, JobId(id), 1, "no disk".into(), at(6));
    }
    let reasons = s.explain(at(7));
    let aside = Explanation::SetAside {
        set_aside: 1,
        present: 2,
        next_in: at(99),
        queued: 2,
    };
    assert_eq!(reasons[0], aside);
    assert!(matches!(reasons[1], Explanation::Running { leased: 2, .. }));
    let silent = Explanation::NoWorkers {
        known: 2,
        silent_for: Some(at(94)),
        open: 4,
    };
    assert_eq!(s.explain(at(100)), [silent]);
}

#[test]
fn what_is_left_at_the_end_is_explained() {
    let once = Options {
        max_failures: 1,
        ..options()
    };
    let mut s = scheduler(once, 2);
    let a = worker("a");
    s.lease(&a, 2, at(0));
    s.complete(&a, JobId(1), 1, at(1));
    s.fail(&a, JobId(0), 1, "no disk".into(), at(1));
    let left = Explanation::OnlyQuarantined {
        quarantined: 1,
        error: "no disk".into(),
    };
    assert_eq!(s.explain(at(2)), [left]);
    s.retry_quarantined();
    let grant = s.lease(&a, 1, at(3)).remove(0);
    s.complete(&a, grant.job, grant.attempt, at(4));
    assert_eq!(s.explain(at(500)), [Explanation::AllDone { done: 2 }]);
}

#[test]
fn sentences_say_what_to_do() {
    let sentence = Explanation::LastLeases {
        leased: 1,
        workers: (0..5).map(|n| worker(&format!("w{n}"))).collect(),
        oldest_for: at(61),
    };
    assert_eq!(
        sentence.to_string(),
        "nothing is queued; 1 job still held by w0, w1, w2 and 2 more, the oldest for 61 s: wait, \
         or stop a worker that hangs, and its jobs go to others"
    );
    let sentence = Explanation::OnlyQuarantined {
        quarantined: 2,
        error: "no disk".into(),
    };
    assert_eq!(
        sentence.to_string(),
        "nothing is left but 2 jobs that were given up, the first because of \"no disk\": mend the \
         cause, then run `coordinator retry --quarantined`"
    );
}
