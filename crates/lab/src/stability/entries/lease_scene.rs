//! Helpers that the entries of leases share.

use std::time::Duration;

use ledger::{
    Crash, Delivery, Generation, Grant, History, LeaseId, Ledger, Options, StreamDemand, StreamId,
    Unit, WorkerId,
};

use stages::names::stream_name;

use crate::stability::outcome::{EntryError, Outcome, variant};

pub(super) const LEASE: Duration = Duration::from_secs(30);

pub(super) const ONE: StreamId = StreamId::design(0);

pub(super) fn at(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

pub(super) fn wanted(stream: StreamId, generation: u64, samples: u32) -> StreamDemand<()> {
    StreamDemand {
        stream,
        generation: Generation(generation),
        source: (),
        samples,
        missing: std::iter::once(0..samples).collect(),
        history: History::default(),
        is_tolerant: false,
        is_analysed: true,
    }
}

/// A ledger with a demand of `samples` samples for each design and with these workers of one slot.
/// Each lease has one design.
pub(super) fn ledger(designs: u32, samples: u32, workers: &[WorkerId]) -> Ledger<()> {
    let options = Options {
        bundle: false,
        ..Options::default()
    };
    with_options(options, designs, samples, workers)
}

pub(super) fn with_options(
    options: Options,
    designs: u32,
    samples: u32,
    workers: &[WorkerId],
) -> Ledger<()> {
    let mut ledger = Ledger::new(options, 1);
    for design in 0..designs {
        ledger.want(wanted(StreamId::design(design), 7, samples));
    }
    for worker in workers {
        ledger.register(worker, "here", 1, Duration::ZERO);
    }
    ledger
}

pub(super) fn names<const N: usize>(names: [&str; N]) -> [WorkerId; N] {
    names.map(WorkerId::from)
}

pub(super) fn lease(
    ledger: &mut Ledger<()>,
    worker: &WorkerId,
    now: Duration,
) -> Result<Grant<()>, EntryError> {
    Ok(ledger.lease(worker, now).ok_or("nothing was leased")?)
}

pub(super) fn units(grant: &Grant<()>) -> Vec<Unit> {
    grant.units.iter().map(|(unit, ())| unit.clone()).collect()
}

pub(super) fn all_of(grant: &Grant<()>) -> Delivery {
    Delivery {
        stored: units(grant),
        seconds: 0.1,
        ..Delivery::default()
    }
}

pub(super) fn failure_of(grant: &Grant<()>) -> Delivery {
    let failed = grant.units.iter().map(|(unit, ())| ledger::FailureReport {
        stream: unit.stream,
        sample: Some(unit.samples.start),
        error: "no load path".to_owned(),
        is_contradiction: false,
    });
    Delivery {
        failed: failed.collect(),
        ..Delivery::default()
    }
}

/// Sends a heartbeat for a lease that has begun. Returns the cancelled leases.
pub(super) fn beat(
    ledger: &mut Ledger<()>,
    worker: &WorkerId,
    id: LeaseId,
    now: Duration,
) -> Vec<LeaseId> {
    ledger.heartbeat(worker, &[(id, true)], now)
}

/// Whether every sample that was demanded is stored.
pub(super) fn is_settled(ledger: &Ledger<()>) -> bool {
    ledger.is_idle() && !ledger.has_work()
}

/// Records crashes: leases that expired after their job had started.
pub(super) fn crashed(outcome: &mut Outcome, crashes: &[Crash]) {
    if let Some(crash) = crashes.first() {
        outcome.named(variant(crash));
    }
}

/// Records the sentences that `coordinator explain` would print.
pub(super) fn explained(outcome: &mut Outcome, ledger: &Ledger<()>, now: Duration) {
    for explanation in ledger.explain(now, stream_name) {
        outcome.detected(variant(&explanation), &explanation);
    }
}
