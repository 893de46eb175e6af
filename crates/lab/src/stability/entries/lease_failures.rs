//! Leases of designs that crash or fail.

use std::time::Duration;

use ledger::{Failure, Ledger, Options, StreamDemand, StreamId};
use stages::names::stream_name;

use super::lease_scene::{
    LEASE, ONE, all_of, at, beat, crashed, explained, failure_of, lease, ledger, names, units,
    wanted, with_options,
};
use crate::stability::outcome::{EntryError, Outcome, variant};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 5] = [
    Entry {
        id: "lease-crash",
        title: "A design that kills its workers",
        input: "Three workers that fall silent over the same design, then a retry; one worker that falls silent five times",
        instead: "The design is quarantined at the third worker, and the campaign continues without it. A retry or a late \
                  result ends the quarantine. One worker counts once, however often it is silent.",
        check: crash,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-shared",
        title: "A worker that crashes over several designs",
        input: "60 short designs and a worker that falls silent over a lease of several designs",
        instead: "Any of the designs may be the cause: no crash is counted, and each design gets a lease of its own.",
        check: shared,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-failures",
        title: "A design that always fails",
        input: "A simulator that returns an error for one design and computes the other",
        instead: "The design waits 0.5 s, then 2 s, and is quarantined with its error at the third failure, because the \
                  worker computed the other design in between. A repeated report counts once.",
        check: failures,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-outage",
        title: "A simulator without a licence for some time",
        input: "Two workers, 40 designs and an optimiser’s run, an outage of 20 s at the start or after 1.5 s",
        instead: "Failed samples are retried. No failure counts against a design while nothing succeeds.",
        check: outage,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-bad-worker",
        title: "A worker on which everything fails",
        input: "A worker that fails three designs in a row, beside a working one and alone",
        instead: "The worker gets a sample whose result is known. If it fails that sample too, it is suspended, each time \
                  for twice as long. A worker without others is suspended for a minute at most, because then the designs \
                  may be the cause.",
        check: bad_worker,
        ..Entry::blank(Method::Leases)
    },
];

fn crash(outcome: &mut Outcome) -> Result<(), EntryError> {
    let workers = names(["a", "b", "c"]);
    let mut ledger = ledger(2, 1, &workers);
    let mut now = at(0.0);
    for worker in &workers {
        let mut grant = lease(&mut ledger, worker, now)?;
        if grant.units[0].0.stream != ONE {
            // The design that has crashed a worker is leased after all others.
            ledger.deliver(worker, grant.lease, &all_of(&grant), now);
            grant = lease(&mut ledger, worker, now)?;
        }
        beat(&mut ledger, worker, grant.lease, now);
        now += 2 * LEASE;
        crashed(outcome, &ledger.expire(now));
    }
    let quarantined = |ledger: &Ledger<()>| ledger.quarantined().count() as f64;
    outcome.at_least("designs quarantined", quarantined(&ledger), "", 1.0);
    for (stream, error) in ledger.quarantined() {
        outcome.detected("quarantined", format!("{stream}: {error}"));
    }
    explained(outcome, &ledger, now);
    outcome.holds(
        "the campaign has computed the other design",
        ledger.counts().free == 0 && ledger.counts().delivered == 1,
    );
    outcome.holds(
        "a retry makes the design available",
        ledger.retry() == [ONE],
    );
    let again = lease(&mut ledger, &workers[1], now)?;
    ledger.deliver(&workers[1], again.lease, &all_of(&again), now);
    outcome.at_most(
        "designs quarantined after the retry",
        quarantined(&ledger),
        "",
        0.0,
    );
    silence(outcome)
}

/// One worker that falls silent five times, then two others.
fn silence(outcome: &mut Outcome) -> Result<(), EntryError> {
    let [a, b, c] = names(["a", "b", "c"]);
    let mut ledger = ledger(1, 1, &[a.clone(), b.clone(), c.clone()]);
    let mut now = at(0.0);
    let mut newest = lease(&mut ledger, &a, now)?;
    for _ in 0..5 {
        beat(&mut ledger, &a, newest.lease, now);
        now += 2 * LEASE;
        let crashes = ledger.expire(now);
        outcome.holds(
            "one worker that falls silent five times quarantines nothing",
            crashes.len() == 1 && !crashes[0].quarantined,
        );
        newest = lease(&mut ledger, &a, now)?;
    }
    for (worker, is_third) in [(&b, false), (&c, false), (&a, true)] {
        ledger.release(&a, &[newest.lease], now);
        newest = lease(&mut ledger, worker, now)?;
        beat(&mut ledger, worker, newest.lease, now);
        now += 2 * LEASE;
        outcome.holds(
            "the third silent worker quarantines the design",
            ledger.expire(now)[0].quarantined == is_third,
        );
    }
    outcome.holds("the quarantine is announced", ledger.take_settled());
    let is_renewed = beat(&mut ledger, &a, newest.lease, now).is_empty();
    ledger.deliver(&a, newest.lease, &all_of(&newest), now);
    let counts = ledger.counts();
    outcome.holds(
        "a late result ends the quarantine",
        is_renewed && counts.quarantined + counts.free + counts.leased == 0,
    );
    Ok(())
}

fn shared(outcome: &mut Outcome) -> Result<(), EntryError> {
    let [a, b] = names(["a", "b"]);
    let mut ledger = with_options(Options::default(), 60, 4, &[a.clone(), b.clone()]);
    let first = lease(&mut ledger, &a, at(0.0))?;
    ledger.deliver(&a, first.lease, &all_of(&first), at(0.0));
    let grant = lease(&mut ledger, &a, at(0.0))?;
    outcome.at_least("designs of the lease", grant.units.len() as f64, "", 2.0);
    beat(&mut ledger, &a, grant.lease, at(0.0));
    let crashes = ledger.expire(at(60.0));
    crashed(outcome, &crashes);
    outcome.holds(
        "the crash counts against none of them",
        crashes
            .iter()
            .all(|crash| !crash.record.is_alone && !crash.quarantined),
    );
    let suspects: Vec<StreamId> = units(&grant).iter().map(|unit| unit.stream).collect();
    let mut largest = 0;
    while let Some(next) = ledger.lease(&b, at(60.0)) {
        if next
            .units
            .iter()
            .any(|(unit, ())| suspects.contains(&unit.stream))
        {
            largest = largest.max(next.units.len());
        }
    }
    outcome.at_most(
        "designs of a later lease that has one of these",
        largest as f64,
        "",
        1.0,
    );
    outcome.at_most(
        "designs quarantined",
        ledger.quarantined().count() as f64,
        "",
        0.0,
    );
    Ok(())
}

fn failures(outcome: &mut Outcome) -> Result<(), EntryError> {
    let [a] = names(["a"]);
    let mut ledger = ledger(2, 1, std::slice::from_ref(&a));
    let mut now = at(0.0);
    let (mut waits, mut due_after) = (Vec::new(), Vec::new());
    while ledger.quarantined().count() == 0 {
        let Some(grant) = ledger.lease(&a, now) else {
            let due = ledger.next_due(&a, now).ok_or("nothing is due")?;
            let early = now + (due - now).mul_f64(0.9);
            outcome.holds(
                "the design is not leased early",
                ledger.lease(&a, early).is_none(),
            );
            due_after.push((due - now).as_secs_f64());
            now = due;
            continue;
        };
        if grant.units[0].0.stream != ONE {
            ledger.deliver(&a, grant.lease, &all_of(&grant), now);
            continue;
        }
        let failure = failure_of(&grant);
        let (outcomes, _) = ledger.deliver(&a, grant.lease, &failure, now);
        match outcomes[..] {
            [Failure::Retry(wait)] => {
                waits.push(wait.as_secs_f64());
                let (again, _) = ledger.deliver(&a, grant.lease, &failure, now);
                outcome.holds("a repeated report is ignored", again == [Failure::Ignored]);
            }
            [quarantined @ Failure::Quarantined] => outcome.named(variant(&quarantined)),
            _ => return Err(format!("unexpected: {outcomes:?}").into()),
        }
    }
    let is_right = waits == [0.5, 2.0] && due_after == waits;
    outcome.holds("the design waits 0.5 s, then 2 s", is_right);
    outcome.at_least(
        "designs quarantined",
        ledger.quarantined().count() as f64,
        "",
        1.0,
    );
    explained(outcome, &ledger, now);
    let mut explanations = ledger.explain(now, stream_name).into_iter();
    let has_error = explanations.any(|one| one.to_string().contains("no load path"));
    outcome.holds("the explanation has the error", has_error);
    let is_retried = ledger.retry() == [ONE] && ledger.lease(&a, now).is_some();
    outcome.holds("a retry makes the design available", is_retried);
    Ok(())
}

fn outage(outcome: &mut Outcome) -> Result<(), EntryError> {
    let workers = names(["a", "b"]);
    let mut is_explained = false;
    for begins in [0.0, 1.5] {
        let mut ledger = ledger(40, 4, &workers);
        ledger.want(StreamDemand {
            is_tolerant: true,
            ..wanted(StreamId::run(3, 0), 7, 6)
        });
        let (mut now, ends) = (at(0.0), at(begins + 20.0));
        let mut has_verdict = false;
        while ledger.counts().free + ledger.counts().waiting > 0 {
            let mut is_idle = true;
            for worker in &workers {
                let Some(grant) = ledger.lease(worker, now) else {
                    continue;
                };
                is_idle = false;
                let delivery = match at(begins) <= now && now < ends {
                    true => failure_of(&grant),
                    false => all_of(&grant),
                };
                let (outcomes, _) = ledger.deliver(worker, grant.lease, &delivery, now);
                let verdict =
                    |one: &Failure| matches!(one, Failure::Conclusive | Failure::Quarantined);
                has_verdict |= outcomes.iter().any(verdict);
            }
            if is_idle && !is_explained {
                explained(outcome, &ledger, now);
                is_explained = true;
            }
            now += at(0.1);
            if now > at(1000.0) {
                return Err("the campaign does not end".into());
            }
        }
        outcome.holds("no failure of the outage is final", !has_verdict);
        let quarantined = ledger.quarantined().count() as f64;
        outcome.at_most(
            &format!("designs quarantined, outage from {begins} s"),
            quarantined,
            "",
            0.0,
        );
        let seconds = now.as_secs_f64();
        outcome.at_most(
            &format!("time of the campaign, outage from {begins} s"),
            seconds,
            "s",
            35.0,
        );
    }
    Ok(())
}

fn bad_worker(outcome: &mut Outcome) -> Result<(), EntryError> {
    let [bad, good] = names(["bad", "good"]);
    let fail_all = |ledger: &mut Ledger<()>, now| -> Option<Duration> {
        while let Some(grant) = ledger.lease(&bad, now) {
            let (_, until) = ledger.deliver(&bad, grant.lease, &failure_of(&grant), now);
            if until.is_some() {
                return until;
            }
        }
        None
    };
    let deliver_one = |ledger: &mut Ledger<()>, now| -> Result<(), EntryError> {
        let grant = lease(ledger, &good, now)?;
        ledger.deliver(&good, grant.lease, &all_of(&grant), now);
        Ok(())
    };
    let mut beside = ledger(40, 1, &[bad.clone(), good.clone()]);
    deliver_one(&mut beside, at(1.0))?;
    let until = fail_all(&mut beside, at(1.0)).ok_or("the worker was not suspended")?;
    outcome.figure("first suspension", (until - at(1.0)).as_secs_f64(), "s");
    outcome.holds(
        "the suspended worker gets nothing",
        beside.lease(&bad, at(2.0)).is_none(),
    );
    explained(outcome, &beside, at(2.0));
    deliver_one(&mut beside, at(2.0))?;
    let again = fail_all(&mut beside, until).ok_or("the worker was not suspended again")?;
    let ratio = (again - until).as_secs_f64() / (until - at(1.0)).as_secs_f64();
    outcome.holds(
        "the second suspension is twice as long",
        (ratio - 2.0).abs() < 1e-9,
    );

    let mut alone = ledger(40, 1, std::slice::from_ref(&bad));
    let (mut now, mut suspended) = (at(1.0), 0.0);
    for _ in 0..20 {
        match fail_all(&mut alone, now) {
            Some(until) => {
                suspended += (until - now).as_secs_f64();
                now = until;
            }
            None => now += at(1.0),
        }
    }
    outcome.at_most(
        "suspension of a worker without others",
        suspended,
        "s",
        60.0,
    );
    Ok(())
}
