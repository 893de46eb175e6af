//! Tests of the ledger through its public interface.

mod cutting;
mod failing;
mod life;
mod model;

use std::ops::Range;
use std::time::Duration;

use ledger::{
    Delivery, FailureReport, Generation, Grant, History, LeaseId, Ledger, Options, StreamDemand,
    StreamId, Unit, WorkerId,
};

pub(crate) const LEASE: Duration = Duration::from_secs(30);

pub(crate) fn at(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

pub(crate) fn worker(name: &str) -> WorkerId {
    WorkerId::from(name)
}

pub(crate) fn wanted(stream: StreamId, generation: u64, missing: Range<u32>) -> StreamDemand<()> {
    StreamDemand {
        stream,
        generation: Generation(generation),
        source: (),
        samples: missing.end,
        missing: std::iter::once(missing).collect(),
        history: History::default(),
        is_tolerant: false,
        is_analysed: true,
    }
}

/// A ledger that wants `samples` samples of each of `designs` designs, with these one-slot workers.
pub(crate) fn ledger(options: Options, designs: u32, samples: u32, workers: &[&str]) -> Ledger<()> {
    let mut ledger = Ledger::new(options, 1);
    for design in 0..designs {
        ledger.want(wanted(StreamId::design(design), 7, 0..samples));
    }
    for name in workers {
        ledger.register(&worker(name), "here", 1, Duration::ZERO);
    }
    ledger
}

pub(crate) fn units(grant: &Grant<()>) -> Vec<Unit> {
    grant.units.iter().map(|(unit, ())| unit.clone()).collect()
}

/// The delivery of a whole grant.
pub(crate) fn all_of(grant: &Grant<()>) -> Delivery {
    Delivery {
        stored: units(grant),
        seconds: 0.1,
        ..Delivery::default()
    }
}

pub(crate) fn failure_of(grant: &Grant<()>) -> Delivery {
    Delivery {
        failed: vec![FailureReport {
            stream: grant.units[0].0.stream,
            sample: Some(grant.units[0].0.samples.start),
            error: "no load path".to_owned(),
            is_contradiction: false,
        }],
        ..Delivery::default()
    }
}

/// Takes leases until none is granted.
pub(crate) fn lease_all(ledger: &mut Ledger<()>, name: &str, now: Duration) -> Vec<Grant<()>> {
    std::iter::from_fn(|| ledger.lease(&worker(name), now)).collect()
}

/// Sends a heartbeat with these leases as started, and returns the cancelled ones.
pub(crate) fn beat(
    ledger: &mut Ledger<()>,
    name: &str,
    grants: &[&Grant<()>],
    now: Duration,
) -> Vec<LeaseId> {
    let held: Vec<(LeaseId, bool)> = grants.iter().map(|grant| (grant.lease, true)).collect();
    ledger.heartbeat(&worker(name), &held, now)
}
