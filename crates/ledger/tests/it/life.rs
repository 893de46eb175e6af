//! The life of streams and leases, case by case.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use ledger::{Delivery, Failure, Generation, Grant, Ledger, Options, StreamId, Verdict, WorkerId};

use crate::{LEASE, all_of, at, beat, failure_of, lease_all, ledger, units, wanted, worker};

const ONE: StreamId = StreamId::design(0);

fn alone() -> Options {
    Options {
        bundle: false,
        ..Options::default()
    }
}

#[test]
fn a_result_is_accepted_by_what_it_is_and_not_by_who_brings_it() {
    let mut ledger = ledger(alone(), 1, 10, &["a", "b"]);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    assert_eq!(units(&grant)[0].samples, 0..10);
    assert_eq!(ledger.accept(&units(&grant)[0]), Verdict::Yes);
    // The delivery comes from another worker, which never leased it.
    ledger.deliver(&worker("b"), grant.lease, &all_of(&grant), at(1.0));
    assert!(ledger.is_idle() && !ledger.has_work());
    assert_eq!(beat(&mut ledger, "a", &[&grant], at(2.0)), [grant.lease]);
    // The result may come again. It is then compared with the stored one.
    assert_eq!(ledger.accept(&units(&grant)[0]), Verdict::Yes);
    // Samples beyond those wanted are not accepted.
    let mut beyond = units(&grant)[0].clone();
    beyond.samples = 9..11;
    assert_eq!(ledger.accept(&beyond), Verdict::Stale);
}

#[test]
fn what_is_settled_is_not_wanted_again_by_somebody_who_looked_too_early() {
    let mut ledger = ledger(alone(), 1, 10, &["a"]);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    ledger.deliver(&worker("a"), grant.lease, &all_of(&grant), at(1.0));
    assert!(!ledger.want(wanted(ONE, 7, 0..10)));
    assert!(ledger.want(wanted(ONE, 7, 0..20)), "more samples");
    let more = ledger.lease(&worker("a"), at(2.0)).unwrap();
    assert_eq!(units(&more)[0].samples, 10..20);
}

#[test]
fn the_rest_of_a_partial_result_is_free_at_once() {
    let mut ledger = ledger(alone(), 1, 10, &["a"]);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    let mut part = all_of(&grant);
    part.stored[0].samples = 0..6;
    ledger.deliver(&worker("a"), grant.lease, &part, at(1.0));
    assert!(ledger.has_work());
    let rest = ledger.lease(&worker("a"), at(1.0)).unwrap();
    assert_eq!(units(&rest)[0].samples, 6..10);
    assert!(rest.lease.number > grant.lease.number);
}

/// A worker that computes its leases in order, as many at a time as it has slots, and crashes with a deadly design. Its
/// connection is lost at once, another worker is started at once, and the leases of the crashed worker are free 2.5 s
/// after its crash. Returns the number of crashes and the quarantined streams.
fn crashes_of(
    slots: usize,
    deadly: &[StreamId],
    is_replaced_at_once: bool,
) -> (usize, BTreeSet<StreamId>) {
    let options = Options {
        long_samples: true,
        ..Options::default()
    };
    let mut ledger = ledger(options, 30, 4, &[]);
    let mut crashed: VecDeque<(Duration, WorkerId)> = VecDeque::new();
    let mut crashes = 0;
    let mut now = at(0.0);
    loop {
        let name = crashes.to_string();
        ledger.register(&worker(&name), "here", slots, now);
        let mut held: VecDeque<Grant<()>> = VecDeque::new();
        loop {
            while let Some((until, gone)) = crashed.pop_front_if(|(until, _)| *until <= now) {
                ledger.mark_crashed(&gone, until);
            }
            // It prefetches some leases.
            while held.len() < slots + 2
                && let Some(grant) = ledger.lease(&worker(&name), now)
            {
                held.push_back(grant);
            }
            let mut begun = held.iter().take(slots).flat_map(units);
            if begun.any(|unit| deadly.contains(&unit.stream)) {
                break;
            }
            now += at(0.1);
            match held.pop_front() {
                Some(grant) => {
                    ledger.deliver(&worker(&name), grant.lease, &all_of(&grant), now);
                }
                None if crashed.is_empty() && ledger.counts().free == 0 => {
                    let quarantined = ledger.quarantined().map(|(id, _)| id);
                    return (crashes, quarantined.collect());
                }
                None => {}
            }
        }
        crashes += 1;
        ledger.mark_disconnected(&worker(&name));
        crashed.push_back((now + at(2.5), worker(&name)));
        now += at(if is_replaced_at_once { 0.1 } else { 3.0 });
        ledger.check();
        assert!(crashes < 200, "it never ends");
    }
}

#[test]
fn a_design_that_crashes_its_workers_crashes_few_of_them_and_takes_no_other_along() {
    for (slots, at_once) in [1, 2, 16]
        .into_iter()
        .flat_map(|slots| [(slots, true), (slots, false)])
    {
        for deadly in 0..30 {
            let deadly = [StreamId::design(deadly)];
            let (crashes, quarantined) = crashes_of(slots, &deadly, at_once);
            assert!(
                crashes <= 5,
                "{crashes} workers of {slots} slots crashed on {deadly:?}, at once: {at_once}"
            );
            assert_eq!(quarantined, BTreeSet::from(deadly));
        }
        for several in [vec![0, 1, 2], vec![3, 9, 17], (3..14).collect()] {
            let deadly: Vec<StreamId> = several.into_iter().map(StreamId::design).collect();
            let (crashes, quarantined) = crashes_of(slots, &deadly, at_once);
            assert!(
                crashes <= 5 * deadly.len(),
                "{crashes} workers of {slots} slots crashed on {deadly:?}, at once: {at_once}"
            );
            assert_eq!(quarantined, deadly.into_iter().collect());
        }
    }
}

#[test]
fn a_worker_that_was_only_silent_takes_its_crashes_back() {
    let options = Options {
        max_crashes: 1,
        ..alone()
    };
    let mut ledger = ledger(options, 1, 10, &["a"]);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    let [crash] = &ledger.mark_crashed(&worker("a"), at(3.0))[..] else {
        panic!("one stream")
    };
    assert!(crash.quarantined && crash.record.is_alone);
    assert_eq!(beat(&mut ledger, "a", &[&grant], at(4.0)), []);
    assert_eq!(ledger.quarantined().count(), 0);
    ledger.deliver(&worker("a"), grant.lease, &all_of(&grant), at(5.0));
    assert!(ledger.is_idle() && !ledger.has_work());
}

#[test]
fn a_note_of_what_was_begun_replaces_what_was_guessed() {
    let mut ledger = ledger(alone(), 3, 10, &["a"]);
    ledger.register(&worker("a"), "here", 3, at(0.0));
    let held = lease_all(&mut ledger, "a", at(0.0));
    assert_eq!(ledger.mark_crashed(&worker("a"), at(3.0)).len(), 3);
    let begun = [(held[1].lease, units(&held[1])[0].clone())];
    for _ in 0..2 {
        // The note may come twice.
        let [crash] = &ledger.record_crash(&worker("a"), &begun)[..] else {
            panic!("one stream")
        };
        assert_eq!(crash.stream, StreamId::design(1));
        assert!(crash.record.is_alone);
    }
    ledger.register(&worker("b"), "here", 1, at(4.0));
    let free = lease_all(&mut ledger, "b", at(4.0));
    let free: Vec<StreamId> = free.iter().map(|grant| units(grant)[0].stream).collect();
    assert_eq!(
        free,
        [0, 2].map(StreamId::design),
        "the suspect comes alone"
    );
}

/// A machine that is switched off every evening, in the middle of the same stream.
#[test]
fn crashes_with_a_success_in_between_are_not_the_streams_fault() {
    let mut ledger = ledger(alone(), 1, 10, &[]);
    for day in 0..10 {
        let name = day.to_string();
        let now = at(100.0 * f64::from(day));
        ledger.register(&worker(&name), "here", 1, now);
        let grant = ledger.lease(&worker(&name), now).unwrap();
        let mut part = all_of(&grant);
        part.stored[0].samples.end = part.stored[0].samples.start + 1;
        ledger.deliver(&worker(&name), grant.lease, &part, now);
        ledger.lease(&worker(&name), now);
        assert!(
            ledger
                .mark_crashed(&worker(&name), now + at(3.0))
                .iter()
                .all(|crash| !crash.quarantined)
        );
    }
    assert_eq!(ledger.counts().free, 0, "all of it is stored");
}

#[test]
fn a_lease_that_its_worker_never_got_counts_as_no_crash() {
    let mut ledger = ledger(alone(), 1, 10, &["a"]);
    ledger.lease(&worker("a"), at(0.0)).unwrap();
    for beats in 1..8 {
        beat(&mut ledger, "a", &[], at(5.0 * f64::from(beats)));
        assert_eq!(ledger.expire(at(5.0 * f64::from(beats))), []);
    }
    assert!(ledger.lease(&worker("a"), at(36.0)).is_some());
}

#[test]
fn no_crash_or_failure_counts_for_a_worker_that_leaves() {
    let mut ledger = ledger(alone(), 4, 1, &["a", "b"]);
    ledger.register(&worker("a"), "here", 2, at(0.0));
    let (one, two) = (
        ledger.lease(&worker("a"), at(0.0)).unwrap(),
        ledger.lease(&worker("a"), at(0.0)).unwrap(),
    );
    beat(&mut ledger, "a", &[&one, &two], at(0.0));
    ledger.leaves(&worker("a"), at(1.0));
    assert!(ledger.lease(&worker("a"), at(1.0)).is_none());
    let (failed, _) = ledger.deliver(&worker("a"), one.lease, &failure_of(&one), at(2.0));
    assert_eq!(failed, [Failure::Ignored]);
    assert_eq!(ledger.expire(at(60.0)), []);
    let again = lease_all(&mut ledger, "b", at(60.0));
    assert_eq!(again.len(), 4, "all of it is free");
}

#[test]
fn near_the_end_an_idle_worker_gets_what_another_has_held_for_long() {
    let mut ledger = ledger(alone(), 1, 10, &["a", "b", "c"]);
    let first = ledger.lease(&worker("a"), at(0.0)).unwrap();
    assert!(ledger.lease(&worker("b"), at(1.0)).is_none());
    let second = ledger.lease(&worker("b"), at(10.0)).unwrap();
    assert_eq!(units(&second), units(&first));
    assert!(
        ledger.lease(&worker("c"), at(10.0)).is_none(),
        "two are enough"
    );
    ledger.deliver(&worker("b"), second.lease, &all_of(&second), at(11.0));
    assert_eq!(beat(&mut ledger, "a", &[&first], at(11.0)), [first.lease]);
    assert!(ledger.is_idle());
}

/// The stream's last samples were delivered in another way. The ranges that a worker still holds precede them.
#[test]
fn what_is_held_from_before_a_restart_is_accepted_though_the_last_of_it_is_stored() {
    let mut before = ledger(alone(), 1, 12, &["a"]);
    let grant = before.lease(&worker("a"), at(0.0)).unwrap();
    let mut after = Ledger::new(alone(), 2);
    let mut rest = wanted(ONE, 7, 0..12);
    rest.missing = std::iter::once(0..10).collect();
    after.want(rest);
    after.register(&worker("a"), "here", 1, at(1.0));
    assert_eq!(after.accept(&units(&grant)[0]), Verdict::Yes);
    after.deliver(&worker("a"), grant.lease, &all_of(&grant), at(2.0));
    assert!(after.is_idle());
    let mut more = units(&grant)[0].clone();
    more.samples = 12..13;
    assert_eq!(after.accept(&more), Verdict::Stale, "it was not wanted");
}

#[test]
fn a_design_that_cannot_be_simulated_is_settled_for_good() {
    let mut ledger = ledger(alone(), 1, 10, &["a"]);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    let delivery = Delivery {
        refused: vec![(ONE, Generation(7))],
        ..Delivery::default()
    };
    ledger.deliver(&worker("a"), grant.lease, &delivery, at(1.0));
    assert!(ledger.take_settled());
    assert!(!ledger.want(wanted(ONE, 7, 0..20)));
}

#[test]
fn workers_are_forgotten_when_they_have_been_away_for_long() {
    let mut ledger = ledger(alone(), 1, 1, &["a", "b"]);
    ledger.see(&worker("b"), 40 * LEASE);
    ledger.expire(61 * LEASE);
    assert!(!ledger.see(&worker("a"), 61 * LEASE));
    assert!(ledger.see(&worker("b"), 61 * LEASE));
}

#[test]
fn while_draining_nothing_is_leased_and_everything_is_taken() {
    let mut ledger = ledger(alone(), 2, 1, &["a"]);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    ledger.set_draining(true);
    assert!(ledger.lease(&worker("a"), at(0.0)).is_none());
    ledger.deliver(&worker("a"), grant.lease, &all_of(&grant), at(1.0));
    assert!(ledger.is_idle());
    ledger.set_draining(false);
    assert!(ledger.lease(&worker("a"), at(1.0)).is_some());
}
