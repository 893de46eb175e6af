//! Leases of designs that crash or fail.

use std::time::Duration;

use ledger::{Failure, Ledger, Options, StreamId};

use super::lease_scene::{
    LEASE, ONE, all_of, at, beat, explained, failure_of, lease, ledger, names, units, vanished,
    with_options,
};
use crate::stability::outcome::{Failed, Outcome, variant};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 5] = [
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
        input: "A simulator that returns an error for one design and computes the other",
        instead: "The design waits 0.5 s, then 2 s, and is quarantined with its error at the third failure, since the \
                  worker computes the other one in between.",
        check: failures,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-outage",
        title: "A simulator that has no licence for a while",
        input: "40 designs, of which all fail for 20 s",
        instead: "What fails is tried again, and nothing counts against a design while nothing succeeds.",
        check: outage,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-bad-worker",
        title: "A worker on which everything fails",
        input: "A worker that fails three designs in a row, beside a sound one, and alone",
        instead: "It gets a sample that is known, and if it fails that, too, nothing for a while, which doubles each \
                  time. Alone it is suspended for a minute at most, since then the designs are to blame.",
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
    let mut ledger = ledger(2, 1, std::slice::from_ref(&a));
    let mut now = at(0.0);
    let mut waits = Vec::new();
    while ledger.quarantined().count() == 0 {
        let Some(grant) = ledger.lease(&a, now) else {
            now = ledger.next_due(&a, now).ok_or("nothing is due")?;
            continue;
        };
        if grant.units[0].0.stream != ONE {
            ledger.deliver(&a, grant.lease, &all_of(&grant), now);
            continue;
        }
        let (outcomes, _) = ledger.deliver(&a, grant.lease, &failure_of(&grant), now);
        match outcomes[..] {
            [Failure::Retry(wait)] => waits.push(wait.as_secs_f64()),
            [quarantined @ Failure::Quarantined] => found.named(variant(&quarantined)),
            _ => return Err(format!("unexpected: {outcomes:?}").into()),
        }
    }
    found.holds("it waits 0.5 s, then 2 s", waits == [0.5, 2.0]);
    found.at_least(
        "designs quarantined",
        ledger.quarantined().count() as f64,
        "",
        1.0,
    );
    explained(found, &ledger, now);
    Ok(())
}

fn outage(found: &mut Outcome) -> Result<(), Failed> {
    let [a] = names(["a"]);
    let mut ledger = ledger(40, 1, std::slice::from_ref(&a));
    let (mut now, over) = (at(0.0), at(20.0));
    let mut is_explained = false;
    while ledger.counts().free + ledger.counts().waiting > 0 {
        let Some(grant) = ledger.lease(&a, now) else {
            if !is_explained {
                explained(found, &ledger, now);
            }
            is_explained = true;
            now = ledger.next_due(&a, now).ok_or("nothing is due")?;
            continue;
        };
        let delivery = match now < over {
            true => failure_of(&grant),
            false => all_of(&grant),
        };
        ledger.deliver(&a, grant.lease, &delivery, now);
    }
    found.at_most(
        "designs quarantined",
        ledger.quarantined().count() as f64,
        "",
        0.0,
    );
    found.at_most("all samples are there after", now.as_secs_f64(), "s", 35.0);
    Ok(())
}

fn bad_worker(found: &mut Outcome) -> Result<(), Failed> {
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
    let deliver_one = |ledger: &mut Ledger<()>, now| -> Result<(), Failed> {
        let grant = lease(ledger, &good, now)?;
        ledger.deliver(&good, grant.lease, &all_of(&grant), now);
        Ok(())
    };
    let mut beside = ledger(40, 1, &[bad.clone(), good.clone()]);
    deliver_one(&mut beside, at(1.0))?;
    let until = fail_all(&mut beside, at(1.0)).ok_or("it was not suspended")?;
    found.figure("suspended for", (until - at(1.0)).as_secs_f64(), "s");
    found.holds(
        "the bad one gets nothing",
        beside.lease(&bad, at(2.0)).is_none(),
    );
    explained(found, &beside, at(2.0));
    deliver_one(&mut beside, at(2.0))?;
    let again = fail_all(&mut beside, until).ok_or("it was not suspended again")?;
    let ratio = (again - until).as_secs_f64() / (until - at(1.0)).as_secs_f64();
    found.holds(
        "the second time is twice as long",
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
    found.at_most("suspension of one that is alone", suspended, "s", 60.0);
    Ok(())
}
