//! Leases of designs that crash or fail.

use std::time::Duration;

use ledger::{Failure, Ledger, Options, StreamId};

use super::lease_scene::{
    LEASE, ONE, all_of, at, beat, explained, failure_of, lease, ledger, names, units, vanished,
    with_options,
};
use crate::outcome::{Failed, Outcome, variant};
use crate::{Entry, Method};

pub(super) const ENTRIES: [Entry; 4] = [
    Entry {
        id: "lease-crash",
        title: "A design that kills its workers",
        input: "Three workers that fall silent over the same design, then a retry",
        instead: "The design is quarantined, the campaign goes on without it, and a retry gives it another chance.",
        check: crash,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-shared",
        title: "A lease of several designs that kills its worker",
        input: "60 short designs, of which one worker holds several when it falls silent",
        instead: "Nobody knows which design it was: none is blamed, and each of them gets a lease of its own.",
        check: shared,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-failures",
        title: "A design that fails again and again",
        input: "A simulator that returns an error three times",
        instead: "The design waits 1 s, then 4 s, and is quarantined with its error at the third failure.",
        check: failures,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-bad-worker",
        title: "A worker on which everything fails",
        input: "A worker that fails three designs in a row, beside a sound one, and alone",
        instead: "It gets nothing for a while, which doubles each time. Alone it is suspended three times at most, since \
                  then the designs are to blame.",
        check: bad_worker,
        ..Entry::blank(Method::Leases)
    },
];

fn crash(found: &mut Outcome) -> Result<(), Failed> {
    let workers = names(["a", "b", "c"]);
    let mut ledger = ledger(2, 1, &workers);
    let mut now = at(0.0);
    // The second design is computed meanwhile.
    for worker in &workers {
        let grant = lease(&mut ledger, worker, now)?;
        if grant.units[0].0.stream != ONE {
            return Err("the first design was expected first".into());
        }
        beat(&mut ledger, worker, grant.lease, now);
        now += 2 * LEASE;
        vanished(found, &ledger.expire(now));
    }
    found.at_least(
        "designs quarantined",
        ledger.quarantined().count() as f64,
        "",
        1.0,
    );
    for (stream, error) in ledger.quarantined() {
        found.detected("quarantined", format!("{stream}: {error}"));
    }
    explained(found, &ledger, now);
    let other = lease(&mut ledger, &workers[0], now)?;
    found.holds(
        "the campaign goes on with the other design",
        other.units[0].0.stream != ONE,
    );
    ledger.deliver(&workers[0], other.lease, &all_of(&other), now);
    found.holds("a retry gives it back", ledger.retry() == [ONE]);
    let again = lease(&mut ledger, &workers[1], now)?;
    ledger.deliver(&workers[1], again.lease, &all_of(&again), now);
    found.at_most(
        "designs quarantined after the retry",
        ledger.quarantined().count() as f64,
        "",
        0.0,
    );
    Ok(())
}

fn shared(found: &mut Outcome) -> Result<(), Failed> {
    let [a, b] = names(["a", "b"]);
    let mut ledger = with_options(Options::default(), 60, 4, &[a.clone(), b.clone()]);
    let first = lease(&mut ledger, &a, at(0.0))?;
    ledger.deliver(&a, first.lease, &all_of(&first), at(0.0));
    let grant = lease(&mut ledger, &a, at(0.0))?;
    found.at_least("designs of the lease", grant.units.len() as f64, "", 2.0);
    beat(&mut ledger, &a, grant.lease, at(0.0));
    let gone = ledger.expire(at(60.0));
    vanished(found, &gone);
    found.holds(
        "the lease is split",
        gone.iter().any(|one| one.is_split && !one.quarantined),
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
    found.at_most(
        "designs of a lease with one of them, afterwards",
        largest as f64,
        "",
        1.0,
    );
    found.at_most(
        "designs quarantined",
        ledger.quarantined().count() as f64,
        "",
        0.0,
    );
    Ok(())
}

fn failures(found: &mut Outcome) -> Result<(), Failed> {
    let [a] = names(["a"]);
    let mut ledger = ledger(1, 1, std::slice::from_ref(&a));
    let mut now = at(0.0);
    let mut waits = Vec::new();
    for _ in 0..3 {
        let grant = lease(&mut ledger, &a, now)?;
        let (outcomes, _) = ledger.deliver(&a, grant.lease, &failure_of(&grant), now);
        match outcomes[..] {
            [Failure::Retry(wait)] => {
                waits.push(wait.as_secs_f64());
                now += wait;
            }
            [quarantined @ Failure::Quarantined] => found.named(variant(&quarantined)),
            _ => return Err(format!("unexpected: {outcomes:?}").into()),
        }
    }
    found.holds("it waits 1 s, then 4 s", waits == [1.0, 4.0]);
    found.at_least(
        "designs quarantined",
        ledger.quarantined().count() as f64,
        "",
        1.0,
    );
    explained(found, &ledger, now);
    Ok(())
}

fn bad_worker(found: &mut Outcome) -> Result<(), Failed> {
    let [bad, good] = names(["bad", "good"]);
    let fail_three = |ledger: &mut Ledger<()>, now| -> Result<Option<Duration>, Failed> {
        let mut until = None;
        for _ in 0..3 {
            let Some(grant) = ledger.lease(&bad, now) else {
                break;
            };
            until = until.or(ledger
                .deliver(&bad, grant.lease, &failure_of(&grant), now)
                .1);
        }
        Ok(until)
    };
    let mut beside = ledger(40, 1, &[bad.clone(), good.clone()]);
    beside.see(&good, at(1.0));
    let until = fail_three(&mut beside, at(1.0))?.ok_or("it was not suspended")?;
    found.figure("suspended for", (until - at(1.0)).as_secs_f64(), "s");
    found.holds(
        "the bad one gets nothing",
        beside.lease(&bad, at(2.0)).is_none(),
    );
    found.holds(
        "the sound one gets work",
        beside.lease(&good, at(2.0)).is_some(),
    );
    explained(found, &beside, at(2.0));
    let again = fail_three(&mut beside, until)?.ok_or("it was not suspended again")?;
    let ratio = (again - until).as_secs_f64() / (until - at(1.0)).as_secs_f64();
    found.holds(
        "the second time is twice as long",
        (ratio - 2.0).abs() < 1e-9,
    );

    let mut alone = ledger(40, 1, std::slice::from_ref(&bad));
    let (mut now, mut suspensions) = (at(1.0), 0.0);
    for _ in 0..10 {
        match fail_three(&mut alone, now)? {
            Some(until) => {
                suspensions += 1.0;
                now = until;
            }
            None => now += at(1.0),
        }
    }
    found.at_most("suspensions of one that is alone", suspensions, "", 3.0);
    Ok(())
}
