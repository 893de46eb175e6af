//! Leases that are taken, computed, cancelled, released and acknowledged.

use super::outbox::UNACKNOWLEDGED_BYTES;
use super::*;

const ANY: usize = usize::MAX;

fn id(number: u64) -> LeaseId {
    LeaseId { epoch: 1, number }
}

fn lease(number: u64, seconds: f64) -> Arc<Lease> {
    Arc::new(Lease {
        id: id(number),
        units: Vec::new(),
        seconds,
    })
}

fn taken(numbers: std::ops::RangeInclusive<u64>) -> HeldLeases {
    let held = HeldLeases::default();
    for number in numbers {
        assert!(held.take(&lease(number, 1.0)));
    }
    held
}

fn samples(count: usize) -> UnitResult {
    UnitResult {
        samples: vec![1.5; count],
        ..UnitResult::default()
    }
}

fn failure() -> UnitResult {
    UnitResult {
        error: Some("no load path".to_owned()),
        ..UnitResult::default()
    }
}

#[test]
fn a_lease_is_held_once_until_its_result_is_acknowledged() {
    let held = taken(7..=7);
    assert!(!held.take(&lease(7, 1.0)), "an answer that came twice");
    assert!(held.start(id(7)).is_some());
    held.add(id(7), samples(3), 1.0);
    held.finish(id(7));
    assert!(
        !held.take(&lease(7, 1.0)),
        "its result is still to be reported"
    );
    assert_eq!((held.computing(), held.unacknowledged()), (0, 1));
    let (results, bytes) = held.results(ANY);
    assert!(bytes > 24, "{bytes}");
    held.acknowledge(&results);
    assert_eq!(held.unacknowledged(), 0);
}

#[test]
fn failures_are_numbered_and_stand_beside_what_was_computed() {
    let held = taken(1..=2);
    for number in 1..=2 {
        held.start(id(number));
        held.add(id(number), failure(), 1.0);
        held.add(id(number), samples(1), 1.0);
        held.finish(id(number));
    }
    let (results, _) = held.results(ANY);
    let serials: Vec<u64> = results
        .iter()
        .flat_map(|result| result.results.iter().map(|unit| unit.serial))
        .collect();
    assert_eq!(serials, [1, 0, 2, 0]);
}

#[test]
fn a_heartbeat_names_waiting_running_and_unacknowledged_leases() {
    let held = taken(1..=3);
    held.start(id(2));
    held.start(id(3));
    held.finish(id(3));
    let mut named: Vec<(u64, bool)> = held
        .states()
        .iter()
        .map(|state| (state.id.unwrap().number, state.started))
        .collect();
    named.sort_unstable();
    assert_eq!(named, [(1, false), (2, true), (3, true)]);
    assert_eq!(
        held.leases().len(),
        3,
        "a restarted coordinator learns of all"
    );
}

#[test]
fn a_release_keeps_running_and_finished_leases() {
    let held = taken(1..=3);
    held.start(id(2));
    held.start(id(3));
    held.finish(id(3));
    assert_eq!(held.release_waiting(), [id(1)]);
    assert!(
        held.start(id(1)).is_none(),
        "a released lease must not be computed"
    );
    assert_eq!(held.release_all(), [id(2)]);
    held.finish(id(2));
    assert_eq!(
        held.unacknowledged(),
        1,
        "the report of a released lease is not kept"
    );
}

#[test]
fn a_release_of_all_reports_the_finished_part_of_a_lease() {
    let held = taken(1..=4);
    for number in 1..=4 {
        held.start(id(number));
    }
    held.add(id(1), samples(2), 1.0);
    held.keep(id(1), samples(1), 2.0);
    held.keep(id(3), samples(1), 2.0);
    held.add(id(4), samples(2), 1.0);
    held.cancel(&[id(3)]);
    assert_eq!(held.release_all(), [id(2), id(3)], "3 is cancelled");
    let (results, _) = held.results(ANY);
    let counts: Vec<Vec<usize>> = results
        .iter()
        .map(|result| {
            result
                .results
                .iter()
                .map(|unit| unit.samples.len())
                .collect()
        })
        .collect();
    assert_eq!(counts, [vec![2, 1], vec![2]]);
    assert_eq!(results[0].wall_seconds, 2.0);
    // The sample ends after the part was kept: the kept part stays the result.
    held.finish(id(1));
    assert_eq!(held.results(ANY).0, results);
}

#[test]
fn a_cancelled_lease_is_told_to_stop_and_keeps_its_slot_until_it_does() {
    let held = taken(1..=3);
    held.start(id(3));
    held.finish(id(3));
    let cancelled = held.start(id(1)).unwrap();
    held.cancel(&[id(1), id(2), id(3)]);
    assert!(cancelled.load(Ordering::Relaxed));
    assert_eq!(held.computing(), 1, "the one that waited is gone");
    held.finish(id(1));
    assert_eq!(held.computing(), 0);
    assert_eq!(held.unacknowledged(), 1, "what is finished is reported");
}

#[test]
fn results_go_by_as_many_as_a_slow_line_bears() {
    let held = taken(1..=3);
    for number in 1..=3 {
        held.start(id(number));
        held.add(id(number), samples(1000), 1.0);
        held.finish(id(number));
    }
    assert_eq!(held.results(ANY).0.len(), 3);
    assert_eq!(held.results(17_000).0.len(), 2);
    assert_eq!(held.results(10).0.len(), 1, "one alone, however large");
}

#[test]
fn what_nobody_acknowledges_keeps_the_worker_from_asking_for_more() {
    let held = taken(1..=1);
    held.start(id(1));
    held.add(id(1), samples(UNACKNOWLEDGED_BYTES / 8), 1.0);
    assert!(held.wanted(2).is_some());
    held.finish(id(1));
    assert_eq!(held.wanted(2), None);
    held.acknowledge(&held.results(ANY).0);
    assert!(held.wanted(2).is_some());
}
