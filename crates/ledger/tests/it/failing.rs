//! Failures: what counts against a sample, a worker or neither.

use std::collections::BTreeMap;
use std::time::Duration;

use ledger::{Delivery, Failure, Grant, Ledger, Options, StreamDemand, StreamId};

use crate::{all_of, at, failure_of, lease_all, ledger, units, wanted, worker};

fn alone() -> Options {
    Options {
        bundle: false,
        ..Options::default()
    }
}

/// A stream whose failures are results.
fn tolerant(stream: StreamId, samples: u32) -> StreamDemand<()> {
    StreamDemand {
        is_tolerant: true,
        ..wanted(stream, 7, 0..samples)
    }
}

#[test]
fn a_failing_sample_holds_up_no_other_sample_of_its_design() {
    let mut ledger = ledger(alone(), 1, 8, &["a"]);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    // Three samples, then a failure.
    let mut delivery = failure_of(&grant);
    delivery.failed[0].sample = Some(3);
    delivery.stored = units(&grant);
    delivery.stored[0].samples = 0..3;
    let (failed, _) = ledger.deliver(&worker("a"), grant.lease, &delivery, at(0.1));
    assert_eq!(failed, [Failure::Retry(at(0.5))]);
    let rest = ledger.lease(&worker("a"), at(0.1)).unwrap();
    assert_eq!(units(&rest)[0].samples, 4..8);
    ledger.deliver(&worker("a"), rest.lease, &all_of(&rest), at(0.2));
    assert!(ledger.lease(&worker("a"), at(0.3)).is_none(), "it waits");
    let again = ledger.lease(&worker("a"), at(0.6)).unwrap();
    assert_eq!(units(&again)[0].samples, 3..4);
}

#[test]
fn failures_of_one_sample_at_one_moment_count_once() {
    let options = Options {
        long_samples: true,
        ..alone()
    };
    let mut ledger = ledger(options, 1, 8, &["a"]);
    ledger.register(&worker("a"), "here", 8, at(0.0));
    let grants = lease_all(&mut ledger, "a", at(0.0));
    assert_eq!(grants.len(), 8, "one sample each");
    let mut fail = |grant: &Grant<()>, delivery: &Delivery| {
        let answer = ledger.deliver(&worker("a"), grant.lease, delivery, at(0.1));
        answer.0[0]
    };
    for grant in &grants[..6] {
        assert_eq!(fail(grant, &failure_of(grant)), Failure::Retry(at(0.5)));
    }
    // The analyses of a design are the same for all of its leases.
    let whole = |grant: &Grant<()>| {
        let mut delivery = failure_of(grant);
        delivery.failed[0].sample = None;
        delivery
    };
    assert_eq!(
        fail(&grants[6], &whole(&grants[6])),
        Failure::Retry(at(0.5))
    );
    assert_eq!(fail(&grants[7], &whole(&grants[7])), Failure::Ignored);
}

#[test]
fn known_samples_show_nothing_of_a_workers_simulator() {
    let options = Options {
        long_samples: true,
        known_samples: vec![2],
        ..alone()
    };
    let mut ledger = ledger(options, 1, 8, &["a"]);
    ledger.register(&worker("a"), "here", 8, at(0.0));
    let grants = lease_all(&mut ledger, "a", at(0.0));
    let mut deliver = |grant: &Grant<()>, delivery: &Delivery, now: f64| {
        ledger.deliver(&worker("a"), grant.lease, delivery, at(now));
        ledger.lease(&worker("a"), at(now + 20.0))
    };
    assert!(deliver(&grants[0], &all_of(&grants[0]), 0.1).is_none());
    let again = deliver(&grants[2], &failure_of(&grants[2]), 0.2).unwrap();
    assert!(!again.is_control, "nothing was simulated yet");
    assert_eq!(units(&again)[0].samples, 2..3);
    assert!(deliver(&grants[3], &all_of(&grants[3]), 20.3).is_none());
    let control = deliver(&again, &failure_of(&again), 20.4).unwrap();
    assert!(control.is_control);
    assert_eq!(units(&control)[0].samples, 3..4);
}

#[test]
fn a_worker_that_fails_many_streams_is_suspended_once_however_many_it_holds() {
    let mut ledger = ledger(alone(), 9, 1, &["a", "b"]);
    ledger.register(&worker("a"), "here", 9, at(0.0));
    let grants = lease_all(&mut ledger, "a", at(0.0));
    let mut suspensions = Vec::new();
    for (grant, second) in grants.iter().zip(1_u32..) {
        let now = at(f64::from(second));
        suspensions.extend(
            ledger
                .deliver(&worker("a"), grant.lease, &failure_of(grant), now)
                .1,
        );
    }
    assert_eq!(suspensions, [at(3.0) + Options::default().suspension]);
    assert!(ledger.lease(&worker("a"), at(12.0)).is_none());
    assert!(ledger.lease(&worker("b"), at(12.0)).is_some());
    assert!(ledger.lease(&worker("a"), at(13.0)).is_some());
    assert!(ledger.workers().all(|status| status.failed <= 9));
}

/// Two workers at one ledger, each of which takes a tenth of a second for a lease.
struct Shift {
    ledger: Ledger<()>,
    now: Duration,
    controls: u32,
    failed: BTreeMap<(StreamId, Option<u32>), Vec<Failure>>,
}

impl Shift {
    fn new(mut ledger: Ledger<()>) -> Self {
        for name in ["a", "b"] {
            ledger.register(&worker(name), "here", 1, at(0.0));
        }
        Self {
            ledger,
            now: at(0.0),
            controls: 0,
            failed: BTreeMap::new(),
        }
    }

    /// Works until nothing is left. `fails` decides by worker, stream, sample and time.
    fn work(&mut self, fails: impl Fn(&str, StreamId, u32, Duration) -> bool) {
        loop {
            self.ledger.check();
            let counts = self.ledger.counts();
            if counts.free + counts.waiting + counts.leased == 0 {
                return;
            }
            let mut busy = Vec::new();
            for name in ["a", "b"] {
                self.ledger.see(&worker(name), self.now);
                busy.extend(
                    self.ledger
                        .lease(&worker(name), self.now)
                        .map(|g| (name, g)),
                );
            }
            self.now += at(0.1);
            for (name, grant) in busy {
                self.controls += u32::from(grant.is_control);
                let mut delivery = all_of(&grant);
                let unit = units(&grant)[0].clone();
                let mut samples = unit.samples.clone();
                if let Some(sample) = samples.find(|s| fails(name, unit.stream, *s, self.now)) {
                    delivery.stored[0].samples.end = sample;
                    delivery.failed = failure_of(&grant).failed;
                    delivery.failed[0].sample = Some(sample);
                }
                delivery.stored.retain(|unit| !unit.samples.is_empty());
                let (failures, _) =
                    self.ledger
                        .deliver(&worker(name), grant.lease, &delivery, self.now);
                for (failure, failed) in failures.into_iter().zip(&delivery.failed) {
                    let key = (failed.stream, failed.sample);
                    self.failed.entry(key).or_default().push(failure);
                    if failure == Failure::Conclusive {
                        let mut unit = unit.clone();
                        let sample = failed.sample.unwrap();
                        unit.samples = sample..sample + 1;
                        self.ledger.conclude(&unit);
                    }
                }
            }
            assert!(self.now < at(10_000.0), "it never ends");
        }
    }
}

#[test]
fn an_outage_of_hours_quarantines_what_fails_and_is_no_result() {
    for begins in [0.0, 0.5] {
        let mut ledger = ledger(alone(), 40, 4, &[]);
        ledger.want(tolerant(StreamId::run(3, 0), 6));
        let mut shift = Shift::new(ledger);
        shift.work(|_, _, _, now| now > at(begins));
        let quarantined = shift.ledger.quarantined().count();
        assert!(quarantined > 20, "{quarantined}");
        let mut failures = shift.failed.values().flatten();
        assert!(!failures.any(|failure| *failure == Failure::Conclusive));
        assert!(shift.now < at(120.0), "{:?}", shift.now);
    }
}

#[test]
fn a_candidate_that_always_fails_is_a_result_after_three_attempts() {
    let run = StreamId::run(3, 0);
    let mut ledger = ledger(alone(), 0, 0, &[]);
    ledger.want(tolerant(run, 6));
    let mut shift = Shift::new(ledger);
    // The last two samples of a generation fail: no other work shows that the simulator works.
    shift.work(|_, stream, sample, _| stream == run && sample >= 4);
    let expected = [
        Failure::Retry(at(0.5)),
        Failure::Retry(at(2.0)),
        Failure::Conclusive,
    ];
    assert_eq!(shift.failed.len(), 2);
    for failures in shift.failed.values() {
        assert_eq!(failures[..], expected);
    }
    assert!((2..=8).contains(&shift.controls), "{}", shift.controls);
    assert!(shift.now < at(5.0), "{:?}", shift.now);
    assert_eq!(shift.ledger.quarantined().count(), 0);
}

#[test]
fn samples_that_always_fail_are_results_and_the_others_are_computed() {
    let mut ledger = ledger(alone(), 0, 0, &[]);
    for design in 0..40 {
        ledger.want(tolerant(StreamId::design(design), 25));
    }
    let mut shift = Shift::new(ledger);
    shift.work(|_, stream, sample, _| (stream.index + u64::from(sample)) % 10 == 0);
    assert_eq!(shift.failed.len(), 100);
    for ((stream, sample), failures) in &shift.failed {
        assert_eq!(
            failures.last(),
            Some(&Failure::Conclusive),
            "{stream} {sample:?}"
        );
    }
}

/// One licence for two workers: one of them fails whatever it gets while the other succeeds.
#[test]
fn a_worker_that_cannot_compute_anything_proves_nothing_against_the_designs() {
    let mut ledger = ledger(alone(), 0, 0, &[]);
    for design in 0..100 {
        ledger.want(tolerant(StreamId::design(design), 10));
    }
    let mut shift = Shift::new(ledger);
    shift.work(|name, _, _, _| name == "b");
    let mut failures = shift.failed.values().flatten();
    assert!(!failures.any(|failure| *failure == Failure::Conclusive));
    let status = shift
        .ledger
        .workers()
        .find(|status| &*status.worker.to_string() == "b");
    assert!(status.unwrap().failed < 10, "it is suspended");
}

/// A unit that is known to work can be set as the control, for example after a restart.
#[test]
fn a_worker_of_a_restarted_coordinator_gets_the_control_that_is_named() {
    let run = StreamId::run(3, 0);
    let mut ledger = ledger(alone(), 0, 0, &[]);
    let known = wanted(StreamId::design(3), 7, 0..25);
    ledger.set_control(
        ledger::Unit {
            stream: known.stream,
            generation: known.generation,
            samples: 0..25,
        },
        (),
    );
    ledger.want(tolerant(run, 1));
    let mut shift = Shift::new(ledger);
    shift.work(|_, stream, _, _| stream == run);
    assert!(shift.failed[&(run, Some(0))].contains(&Failure::Conclusive));
    assert!(shift.controls >= 2);
}

/// Another worker has computed for hours when a design fails at once.
#[test]
fn nothing_is_over_while_what_was_leased_before_may_succeed() {
    let options = Options {
        long_samples: true,
        ..alone()
    };
    let mut ledger = ledger(options, 2, 1, &["a", "b"]);
    let long = ledger.lease(&worker("a"), at(0.0)).unwrap();
    let mut now = at(1.0);
    while now < at(200.0) {
        crate::beat(&mut ledger, "a", &[&long], now);
        let Some(grant) = ledger.lease(&worker("b"), now) else {
            now += at(5.0);
            continue;
        };
        let failure = failure_of(&grant);
        let (failed, _) = ledger.deliver(&worker("b"), grant.lease, &failure, now);
        assert_ne!(failed, [Failure::Quarantined], "at {now:?}");
    }
    let said = ledger.explain(now, |stream| stream.to_string());
    assert!(
        said.iter()
            .any(|s| s.to_string().contains("nothing has succeeded")),
        "{said:?}"
    );
}

/// One machine fails a sample that another machine computes, for example because it lacks a library. Its other samples
/// succeed, so the worker passes the control.
#[test]
fn a_sample_that_fails_on_one_machine_is_tried_on_another() {
    let mut ledger = ledger(alone(), 20, 1, &[]);
    for (name, host) in [("bad", "node1:7"), ("too", "node1:8"), ("good", "node2:7")] {
        ledger.register(&worker(name), host, 1, at(0.0));
    }
    let mut failures = 0;
    for turn in 1..400 {
        let now = at(0.5 * f64::from(turn));
        // The good worker is slow.
        let name = ["bad", "too", "good"][if turn % 40 == 0 { 2 } else { turn as usize % 2 }];
        let Some(grant) = ledger.lease(&worker(name), now) else {
            continue;
        };
        let delivery = match units(&grant)[0].stream.index {
            0 if name != "good" => failure_of(&grant),
            _ => all_of(&grant),
        };
        failures += delivery.failed.len();
        ledger.deliver(&worker(name), grant.lease, &delivery, now);
        ledger.check();
    }
    assert!(failures >= 3, "{failures}");
    assert_eq!(ledger.quarantined().count(), 0);
    assert_eq!(ledger.counts().free + ledger.counts().waiting, 0);
}

/// Either of the two workers may be wrong.
#[test]
fn a_contradiction_counts_against_its_stream_alone() {
    let options = Options {
        max_worker_strikes: 1,
        ..alone()
    };
    let mut ledger = ledger(options, 2, 8, &["a"]);
    for is_contradiction in [true, false] {
        let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
        let mut delivery = failure_of(&grant);
        delivery.failed[0].is_contradiction = is_contradiction;
        let (failed, suspended) = ledger.deliver(&worker("a"), grant.lease, &delivery, at(0.1));
        assert_eq!(failed, [Failure::Retry(at(0.5))]);
        assert_eq!(suspended.is_none(), is_contradiction);
    }
}
