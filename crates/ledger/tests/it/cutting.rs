//! The size of a lease.

use ledger::{Delivery, Generation, Kind, Ledger, Options, StreamDemand, StreamId};

use crate::{all_of, at, lease_all, ledger, units, wanted, worker};

/// Number of samples in a grant.
fn samples(grant: &ledger::Grant<()>) -> usize {
    units(grant).iter().map(|unit| unit.samples.len()).sum()
}

/// A ledger that has measured the given cost of a sample.
fn taught(options: Options, designs: u32, wanted: u32, seconds_per_sample: f64) -> Ledger<()> {
    let mut ledger = ledger(options, designs, wanted, &["a"]);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    let weight = samples(&grant) + 20 * grant.units.len();
    let delivery = Delivery {
        seconds: seconds_per_sample * weight as f64,
        ..all_of(&grant)
    };
    ledger.deliver(&worker("a"), grant.lease, &delivery, at(0.0));
    ledger
}

#[test]
fn leases_take_about_a_second_once_it_is_known_what_a_sample_costs() {
    let mut cheap = taught(Options::default(), 3000, 30, 1e-4);
    let grant = cheap.lease(&worker("a"), at(0.0)).unwrap();
    assert!((0.5..1.1).contains(&grant.seconds), "{}", grant.seconds);
    assert!(grant.units.len() > 100, "designs share a lease");
    // An expensive design is split.
    let mut dear = taught(Options::default(), 2, 3000, 1e-2);
    let grant = dear.lease(&worker("a"), at(0.0)).unwrap();
    assert!(grant.units.len() == 1 && (0.5..1.1).contains(&grant.seconds));
}

/// The cost of the first designs is measured even if none of them is simulable.
#[test]
fn refused_designs_tell_what_a_design_costs() {
    let mut ledger = ledger(Options::default(), 3000, 30, &["a"]);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    let delivery = Delivery {
        refused: vec![(units(&grant)[0].stream, units(&grant)[0].generation)],
        seconds: 1e-4,
        ..Delivery::default()
    };
    ledger.deliver(&worker("a"), grant.lease, &delivery, at(0.0));
    assert!(ledger.lease(&worker("a"), at(0.0)).unwrap().units.len() > 100);
}

#[test]
fn samples_that_may_take_hours_are_leased_one_by_one() {
    let options = Options {
        long_samples: true,
        ..Options::default()
    };
    let mut ledger = ledger(options, 3, 10, &["a"]);
    assert_eq!(samples(&ledger.lease(&worker("a"), at(0.0)).unwrap()), 1);
}

#[test]
fn towards_the_end_leases_become_small_so_that_all_slots_end_together() {
    let mut ledger = taught(Options::default(), 60, 30, 1e-4);
    ledger.register(&worker("a"), "here", 8, at(0.0));
    let grant = ledger.lease(&worker("a"), at(2.0)).unwrap();
    assert!(grant.units.len() <= 60 / 8, "{}", grant.units.len());
}

#[test]
fn a_result_fits_into_a_message_whatever_samples_cost() {
    let mut ledger = taught(Options::default(), 1, 10_000_000, 1e-9);
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    assert_eq!(samples(&grant), 50_000);
}

#[test]
fn runs_come_before_designs_and_designs_before_points() {
    let mut ledger = Ledger::new(Options::default(), 1);
    ledger.register(&worker("a"), "here", 1, at(0.0));
    ledger.want(wanted(StreamId::point(3), 1, 0..5));
    ledger.want(wanted(StreamId::design(3), 1, 0..5));
    ledger.want(wanted(StreamId::run(2, 1), 1, 0..1));
    let kinds: Vec<Kind> = lease_all(&mut ledger, "a", at(0.0))
        .iter()
        .map(|grant| grant.units[0].0.stream.kind)
        .collect();
    assert_eq!(kinds, [Kind::Run, Kind::Design, Kind::Point]);
    assert_eq!(StreamId::run(2, 1).run_parts(), (2, 1));
}

/// A generation waits for its last candidate, so a worker with several leases would keep others
/// idle.
#[test]
fn candidates_of_a_run_are_not_held_ahead_however_short_they_are() {
    let options = Options {
        long_samples: true,
        ..Options::default()
    };
    let mut ledger = ledger(options, 0, 0, &["a", "b", "c", "d", "e"]);
    for generation in 0..3 {
        let evaluations = 10 * generation as u32..10 * (generation as u32 + 1);
        ledger.want(wanted(StreamId::run(2, 0), generation, evaluations));
        let mut granted = Vec::new();
        while let Some(grant) = ledger.lease(&worker("a"), at(0.0)) {
            // The worker prefetches up to two seconds of work: one such lease suffices.
            assert!(grant.seconds >= 2.0, "{}", grant.seconds);
            assert!(samples(&grant) <= 2, "ten candidates for five workers");
            granted.push(grant);
        }
        assert_eq!(granted.iter().map(samples).sum::<usize>(), 10);
        for grant in granted {
            ledger.deliver(&worker("a"), grant.lease, &all_of(&grant), at(0.0));
        }
    }
}

/// Leases of long samples are short, and each would analyse its design anew.
#[test]
fn a_design_is_analysed_once_as_long_as_there_is_other_work() {
    let options = Options {
        long_samples: true,
        ..Options::default()
    };
    let names = ["a", "b", "c"];
    let mut ledger = ledger(options, 0, 0, &names);
    for design in 0..2 {
        ledger.want(StreamDemand {
            is_analysed: false,
            ..wanted(StreamId::design(design), 7, 0..10)
        });
    }
    let stream = |ledger: &mut Ledger<()>, name: &str| {
        let grant = ledger.lease(&worker(name), at(0.0)).unwrap();
        (units(&grant)[0].stream, grant)
    };
    let (first, _) = stream(&mut ledger, "a");
    let (second, _) = stream(&mut ledger, "b");
    assert_eq!([first, second], [StreamId::design(0), StreamId::design(1)]);
    // A worker that would be idle otherwise analyses a design again.
    let (third, again) = stream(&mut ledger, "c");
    assert_eq!(third, first);
    ledger.release(&worker("c"), &[again.lease], at(0.0));
    ledger.analysed(second, Generation(7), ());
    assert_eq!(stream(&mut ledger, "c").0, second);
}

/// All slots help with the samples of a program at one point, although one could take them all in a second.
#[test]
fn the_samples_of_an_analysed_stream_are_shared_out() {
    let options = Options {
        long_samples: true,
        ..Options::default()
    };
    let names = ["a", "b", "c", "d"];
    let mut ledger = ledger(options, 0, 0, &names);
    ledger.want(wanted(StreamId::point(1), 7, 0..100));
    // A sample takes a millisecond.
    let grant = ledger.lease(&worker("a"), at(0.0)).unwrap();
    let delivery = Delivery {
        seconds: 1e-3 * (samples(&grant) + 2) as f64,
        ..all_of(&grant)
    };
    ledger.deliver(&worker("a"), grant.lease, &delivery, at(0.0));
    let taken = names.map(|name| samples(&ledger.lease(&worker(name), at(0.0)).unwrap()));
    assert!(
        taken.iter().all(|taken| (2..=9).contains(taken)),
        "{taken:?}"
    );
}

/// A round waits for its infill points. The verification of optima, whose numbers are lower, can wait.
#[test]
fn later_points_are_leased_first() {
    let mut ledger = ledger(Options::default(), 0, 0, &["a"]);
    for number in [2, 1 << 27, (1 << 27) + 5] {
        ledger.want(wanted(StreamId::point(number), 7, 0..10));
    }
    ledger.want(wanted(StreamId::design(3), 7, 0..10));
    let leased: Vec<StreamId> = lease_all(&mut ledger, "a", at(0.0))
        .iter()
        .map(|grant| units(grant)[0].stream)
        .collect();
    let points = [(1 << 27) + 5, 1 << 27, 2].map(StreamId::point);
    assert_eq!(leased[0], StreamId::design(3));
    assert_eq!(leased[1..], points);
}
