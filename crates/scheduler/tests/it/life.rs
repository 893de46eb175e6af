//! What becomes of a job, one event at a time.

use scheduler::{
    Completion, Counts, Details, Directive, Failure, History, JobId, Options, Scheduler,
};

use crate::{at, ids, options, running, scheduler, waiting, worker};

#[test]
fn jobs_are_granted_by_priority_and_then_by_id() {
    let mut s = Scheduler::new(options(), 7);
    for (id, priority) in [(5, 0), (1, 1), (2, 0), (9, -1)] {
        assert!(s.add_job(JobId(id), (), priority));
    }
    assert!(
        !s.add_job(JobId(9), (), 5),
        "a known job is not added again"
    );
    let a = worker("a");
    assert_eq!(ids(&s.lease(&a, 2, at(0))), [9, 2]);
    assert_eq!(ids(&s.lease(&a, 0, at(0))), [0; 0]);
    assert_eq!(ids(&s.lease(&a, 9, at(0))), [5, 1]);
    assert_eq!(ids(&s.lease(&a, 9, at(0))), [0; 0]);
    assert_eq!(s.epoch(), 7);
}

#[test]
fn the_first_result_makes_a_job_done_for_good() {
    let mut s = scheduler(options(), 1);
    let (a, b) = (worker("a"), worker("b"));
    let grant = s.lease(&a, 1, at(0)).remove(0);
    assert_eq!((grant.attempt, grant.payload.as_str()), (1, "job 0"));
    assert_eq!(s.complete(&a, JobId(0), 1, at(1)), Completion::First);
    assert_eq!(s.complete(&a, JobId(0), 1, at(1)), Completion::Duplicate);
    assert_eq!(s.complete(&b, JobId(0), 4, at(2)), Completion::Duplicate);
    assert_eq!(s.complete(&b, JobId(8), 1, at(2)), Completion::Unknown);
    assert_eq!(
        s.fail(&a, JobId(0), 1, "late".into(), at(3)),
        Failure::Stale
    );
    s.release(&a, &[JobId(0)], at(3));
    assert!(s.expire(at(1000)).is_empty());
    assert!(!s.add_job(JobId(0), String::new(), 0));
    assert!(s.lease(&b, 1, at(1000)).is_empty());
    assert_eq!(
        s.counts(),
        Counts {
            done: 1,
            ..Counts::default()
        }
    );
    assert!(s.all_settled());
}

#[test]
fn a_heartbeat_keeps_a_lease_and_silence_ends_it() {
    let mut s = scheduler(options(), 2);
    let a = worker("a");
    s.lease(&a, 2, at(0));
    assert_eq!(s.next_expiry(), Some(at(10)));
    assert_eq!(
        s.heartbeat(&a, &[running(0, 1)], at(6)),
        [(JobId(0), Directive::Continue)]
    );
    assert!(s.expire(at(9)).is_empty());
    let over = s.expire(at(10));
    assert_eq!(
        over.len(),
        1,
        "only the lease that the heartbeat did not name"
    );
    assert_eq!(
        (over[0].job, over[0].attempt, over[0].crashed),
        (JobId(1), 1, false)
    );
    assert_eq!(s.next_expiry(), Some(at(16)));
    let over = s.expire(at(16));
    assert_eq!(
        (over[0].job, over[0].crashed, over[0].quarantined),
        (JobId(0), true, false)
    );
    assert_eq!(s.next_expiry(), None);
    assert_eq!(
        s.counts(),
        Counts {
            queued: 2,
            ..Counts::default()
        }
    );
}

#[test]
fn only_jobs_that_had_started_count_crashes() {
    let mut s = scheduler(options(), 2);
    for round in 0..2 {
        let now = at(100 * round);
        let name = worker(&format!("w{round}"));
        let attempt = s.lease(&name, 2, now)[0].attempt;
        assert_eq!(u64::from(attempt), round + 1);
        s.heartbeat(&name, &[running(0, attempt), waiting(1, attempt)], now);
        s.expire(now + at(10));
    }
    let quarantined = s.quarantined();
    assert_eq!(quarantined.len(), 1);
    assert_eq!(quarantined[0].0, JobId(0));
    assert!(
        quarantined[0].1.contains("w1"),
        "names the last worker: {}",
        quarantined[0].1
    );
    assert_eq!(
        s.counts(),
        Counts {
            queued: 1,
            quarantined: 1,
            ..Counts::default()
        }
    );
    assert_eq!(
        s.heartbeat(&worker("w1"), &[running(0, 2)], at(300))[0].1,
        Directive::Cancel
    );
}

#[test]
fn a_late_result_of_a_requeued_job_is_kept() {
    let mut s = scheduler(options(), 1);
    let (slow, quick) = (worker("slow"), worker("quick"));
    s.lease(&slow, 1, at(0));
    s.expire(at(10));
    assert_eq!(s.lease(&quick, 1, at(11))[0].attempt, 2);
    assert_eq!(s.complete(&slow, JobId(0), 1, at(12)), Completion::First);
    assert_eq!(
        s.heartbeat(&quick, &[running(0, 2)], at(13))[0].1,
        Directive::Cancel
    );
    assert_eq!(
        s.complete(&quick, JobId(0), 2, at(14)),
        Completion::Duplicate
    );
}

#[test]
fn a_late_result_of_a_quarantined_job_is_kept() {
    let mut s = scheduler(
        Options {
            max_failures: 1,
            ..options()
        },
        1,
    );
    let a = worker("a");
    s.lease(&a, 1, at(0));
    assert_eq!(
        s.fail(&a, JobId(0), 1, "no".into(), at(1)),
        Failure::Quarantined
    );
    assert_eq!(s.quarantined(), [(JobId(0), "no")]);
    assert_eq!(s.complete(&a, JobId(0), 1, at(2)), Completion::First);
    assert_eq!(
        s.counts(),
        Counts {
            done: 1,
            ..Counts::default()
        }
    );
    assert!(s.quarantined().is_empty());
}

#[test]
fn failures_are_counted_once_each_up_to_the_limit() {
    let mut s = scheduler(options(), 1);
    let (a, b) = (worker("a"), worker("b"));
    s.lease(&a, 1, at(0));
    assert_eq!(
        s.fail(&a, JobId(0), 1, "first".into(), at(1)),
        Failure::Retry
    );
    assert_eq!(
        s.fail(&a, JobId(0), 1, "first".into(), at(1)),
        Failure::Stale,
        "a repeated call"
    );
    assert_eq!(s.counts().queued, 1);
    s.lease(&b, 1, at(2));
    assert_eq!(
        s.fail(&a, JobId(0), 2, "not mine".into(), at(3)),
        Failure::Stale
    );
    assert_eq!(
        s.fail(&b, JobId(0), 2, "second".into(), at(3)),
        Failure::Quarantined
    );
    assert_eq!(s.quarantined(), [(JobId(0), "second")]);
    assert!(s.all_settled());
}

#[test]
fn releasing_blames_nobody() {
    let mut s = scheduler(options(), 1);
    let a = worker("a");
    for round in 1..=5 {
        let attempt = s.lease(&a, 1, at(round))[0].attempt;
        s.heartbeat(&a, &[running(0, attempt)], at(round));
        s.release(&a, &[JobId(0), JobId(77)], at(round));
    }
    assert_eq!(s.counts().queued, 1);
    assert_eq!(s.attempts(JobId(0)), Some(5));
    assert_eq!(s.workers()[0].crashed, 0);
}

#[test]
fn an_overtaken_heartbeat_after_a_release_makes_no_crash() {
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
    s.heartbeat(&a, &[running(0, 1)], at(2));
    let over = s.expire(at(12));
    assert_eq!((over.len(), over[0].crashed), (1, false));
    assert_eq!(s.counts().queued, 1);
}

#[test]
fn after_a_restart_workers_keep_the_jobs_they_hold() {
    let mut s = scheduler(options(), 3);
    let (a, b) = (worker("a"), worker("b"));
    // From before the restart: attempt 4 of job 0 runs, attempt 2 of job 1 waits.
    let directives = s.heartbeat(&a, &[running(0, 4), waiting(1, 2), running(9, 1)], at(1));
    let told: Vec<Directive> = directives.iter().map(|d| d.1).collect();
    assert_eq!(
        told,
        [Directive::Continue, Directive::Continue, Directive::Cancel]
    );
    assert_eq!(ids(&s.lease(&b, 9, at(2))), [2]);
    // Attempts go on from where they were.
    s.release(&a, &[JobId(0), JobId(1)], at(3));
    let attempts: Vec<u32> = s.lease(&b, 9, at(4)).iter().map(|g| g.attempt).collect();
    assert_eq!(attempts, [5, 3]);
    // A job that went to another worker meanwhile is kept only by who has started it.
    let told = s.heartbeat(&a, &[running(0, 4), waiting(1, 2)], at(5));
    assert_eq!(
        told,
        [
            (JobId(0), Directive::Continue),
            (JobId(1), Directive::Cancel)
        ]
    );
    assert_eq!(s.complete(&a, JobId(0), 4, at(6)), Completion::First);
    assert_eq!(s.workers()[1].leased, 2, "b has lost job 0");
}

#[test]
fn idle_workers_get_second_leases_at_the_end_and_nobody_a_third() {
    let mut s = scheduler(
        Options {
            duplicate_tail: true,
            ..options()
        },
        3,
    );
    let (a, b, c, d) = (worker("a"), worker("b"), worker("c"), worker("d"));
    assert_eq!(ids(&s.lease(&a, 2, at(0))), [0, 1]);
    assert_eq!(ids(&s.lease(&a, 1, at(1))), [2]);
    assert!(
        s.lease(&a, 5, at(1)).is_empty(),
        "never a second lease of its own job"
    );
    s.set_slots(&b, 2, at(2));
    let second = s.lease(&b, 1, at(2));
    assert_eq!(ids(&second), [0], "the one held longest");
    assert_eq!(second[0].attempt, 2);
    let third = s.lease(&b, 9, at(2));
    assert_eq!(ids(&third), [1], "one for its other slot, and not again 0");
    assert!(s.lease(&b, 1, at(2)).is_empty(), "b has no slot free");
    assert_eq!(ids(&s.lease(&c, 9, at(3))), [2]);
    assert!(s.lease(&d, 9, at(3)).is_empty());
    assert_eq!(
        s.counts(),
        Counts {
            leased: 3,
            ..Counts::default()
        }
    );

    // One of two leases going leaves the job with the other worker.
    assert_eq!(s.fail(&b, JobId(1), 2, "no".into(), at(4)), Failure::Retry);
    s.release(&c, &[JobId(2)], at(4));
    assert_eq!(s.counts().leased, 3);
    assert_eq!(s.complete(&b, JobId(0), 2, at(5)), Completion::First);
    assert_eq!(
        s.heartbeat(&a, &[running(0, 1)], at(5))[0].1,
        Directive::Cancel
    );
    assert_eq!(s.complete(&a, JobId(0), 1, at(6)), Completion::Duplicate);
}

#[test]
fn attempts_and_counters_go_on_after_a_restart() {
    let mut s = scheduler(options(), 0);
    let history = History {
        attempts: 5,
        crashes: 1,
        failures: 1,
    };
    for job in 0..2 {
        let details = Details {
            history,
            ..Details::default()
        };
        assert!(s.add_job_with(JobId(job), "tried before".into(), details));
    }
    let a = worker("a");
    let grants = s.lease(&a, 2, at(0));
    assert_eq!(grants.iter().map(|g| g.attempt).collect::<Vec<_>>(), [6, 6]);
    let failure = s.fail(&a, JobId(0), 6, "no".into(), at(1));
    assert_eq!(failure, Failure::Quarantined, "the second of two");
    s.heartbeat(&a, &[running(1, 6)], at(1));
    let over = s.expire(at(11));
    assert!(over[0].quarantined, "the second of two");
}

#[test]
fn both_leases_of_a_job_running_out_at_once_give_it_up_once() {
    let mut s = scheduler(
        Options {
            duplicate_tail: true,
            max_crashes: 1,
            ..options()
        },
        1,
    );
    for name in ["a", "b"] {
        let attempt = s.lease(&worker(name), 1, at(0))[0].attempt;
        s.heartbeat(&worker(name), &[running(0, attempt)], at(0));
    }
    let over = s.expire(at(10));
    assert_eq!(over.len(), 1);
    assert!(over[0].quarantined);
    assert_eq!(
        s.counts(),
        Counts {
            quarantined: 1,
            ..Counts::default()
        }
    );
}

#[test]
fn a_worker_that_fails_different_jobs_in_a_row_is_set_aside() {
    let mut s = scheduler(options(), 9);
    let bad = worker("bad");
    for (now, job) in [(1, 0), (2, 1), (3, 2)] {
        let grant = s.lease(&bad, 1, at(now)).remove(0);
        assert_eq!(grant.job, JobId(job), "not the job that it just failed");
        assert_eq!(
            s.fail(&bad, grant.job, 1, "no".into(), at(now)),
            Failure::Retry
        );
    }
    assert_eq!(s.workers()[0].set_aside_until, Some(at(103)));
    assert!(s.lease(&bad, 1, at(102)).is_empty());
    assert_eq!(s.counts().queued, 9, "nothing is lost to the bad worker");
    assert_eq!(ids(&s.lease(&worker("good"), 2, at(50))), [0, 1]);

    // It gets another chance, and then a longer pause.
    for now in [103, 104, 105] {
        let grant = s.lease(&bad, 1, at(now)).remove(0);
        s.fail(&bad, grant.job, grant.attempt, "no".into(), at(now));
    }
    assert_eq!(s.workers()[0].set_aside_until, Some(at(305)));
}

#[test]
fn a_success_in_between_or_a_second_opinion_clears_a_worker() {
    let mut s = scheduler(
        Options {
            max_failures: 9,
            ..options()
        },
        9,
    );
    let (a, b) = (worker("a"), worker("b"));
    for now in 0..3 {
        let grants = s.lease(&a, 3, at(now));
        s.complete(&a, grants[2].job, grants[2].attempt, at(now));
        for grant in &grants[..2] {
            s.fail(&a, grant.job, grant.attempt, "no".into(), at(now));
        }
    }
    assert_eq!(s.workers()[0].set_aside_until, None);

    // b fails the jobs that a failed: the jobs are bad, not b, and not a.
    let mut s = scheduler(
        Options {
            max_failures: 9,
            ..options()
        },
        3,
    );
    for now in 0..3 {
        let grant = s.lease(&a, 1, at(now)).remove(0);
        s.fail(&a, grant.job, grant.attempt, "no".into(), at(now));
    }
    assert!(s.workers()[0].set_aside_until.is_some());
    for grant in s.lease(&b, 3, at(4)) {
        s.fail(&b, grant.job, grant.attempt, "no".into(), at(4));
    }
    assert!(s.workers().iter().all(|w| w.set_aside_until.is_none()));
}

#[test]
fn a_lone_worker_gets_through_bad_jobs() {
    // Jobs 0 to 4 always fail. Without an end to being set aside, this would never finish.
    let mut s = scheduler(options(), 20);
    let only = worker("only");
    let mut now = 0;
    while !s.all_settled() {
        now += 1;
        assert!(now < 2000, "still at it: {:?}", s.counts());
        for grant in s.lease(&only, 1, at(now)) {
            if grant.job.0 < 5 {
                s.fail(&only, grant.job, grant.attempt, "bad".into(), at(now));
            } else {
                s.complete(&only, grant.job, grant.attempt, at(now));
            }
        }
    }
    assert_eq!(
        s.counts(),
        Counts {
            done: 15,
            quarantined: 5,
            ..Counts::default()
        }
    );
}

#[test]
fn jobs_of_one_kin_are_one_reason_to_blame_a_worker() {
    let add = |kin: Option<u64>| {
        let mut s = scheduler(options(), 0);
        for job in 0..9 {
            let details = Details {
                kin: kin.map(JobId),
                ..Details::default()
            };
            s.add_job_with(JobId(job), format!("job {job}"), details);
        }
        s
    };
    let a = worker("a");
    let set_aside = |mut s: Scheduler<String>| {
        for grant in s.lease(&a, 3, at(0)) {
            s.fail(&a, grant.job, grant.attempt, "no".into(), at(1));
        }
        s.workers()[0].set_aside_until
    };
    assert_eq!(set_aside(add(None)), Some(at(101)));
    assert_eq!(set_aside(add(Some(7))), None);
}

#[test]
fn a_job_that_is_not_settled_can_be_withdrawn() {
    let mut s = scheduler(options(), 4);
    let a = worker("a");
    s.lease(&a, 2, at(0));
    s.complete(&a, JobId(0), 1, at(1));
    assert_eq!(s.withdraw(JobId(0)), None, "it is done");
    assert_eq!(s.withdraw(JobId(9)), None, "nobody knows it");
    assert_eq!(s.withdraw(JobId(1)).as_deref(), Some("job 1"), "it is held");
    assert_eq!(
        s.heartbeat(&a, &[running(1, 1)], at(1))[0].1,
        Directive::Cancel
    );
    assert_eq!(s.complete(&a, JobId(1), 1, at(1)), Completion::Unknown);
    assert_eq!(s.withdraw(JobId(2)).as_deref(), Some("job 2"), "it waits");
    assert_eq!(ids(&s.lease(&a, 9, at(1))), [3]);
    assert!(s.add_job(JobId(1), "again".into(), 0));
    let counts = Counts {
        queued: 1,
        leased: 1,
        done: 1,
        quarantined: 0,
    };
    assert_eq!(s.counts(), counts);
}
