//! The state of a running coordinator, as the status shows it.

use std::collections::BTreeMap;
use std::time::Duration;

use ledger::{Counts, Kind, WorkerStatus};
use serde::{Deserialize, Serialize};
use stages::searching::Progress;

use crate::number::duration;

/// The normal deviate of a two-sided 95 % interval.
pub(crate) const Z95: f64 = 1.959_963_984_540_054;

/// Silence after which a worker's slots no longer count in the estimate of the time to go.
const GONE: Duration = Duration::from_secs(15);

/// A rate with its 95 % interval.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pace {
    /// Recent samples or evaluations per second.
    pub per_second: f64,
    /// The interval is from `per_second / factor` to `per_second * factor`; none while too little is
    /// known.
    pub factor: Option<f64>,
}

impl Pace {
    /// The rate with the factor of its interval.
    #[must_use]
    pub const fn of(per_second: f64, factor: Option<f64>) -> Self {
        Self { per_second, factor }
    }

    /// The time for `count`, whose standard error is `error`; `None` without an interval of the rate.
    fn span(self, count: f64, error: f64) -> Option<Span> {
        let factor = self.factor.filter(|_| self.per_second > 0.0)?;
        // The relative errors of rate and count are independent, so the squares of their logarithms add up.
        let of_count = if count > 0.0 {
            Z95 * error / count
        } else {
            0.0
        };
        let factor = factor.ln().hypot(of_count).exp();
        let seconds = count / self.per_second;
        Some(Span {
            seconds,
            low: seconds / factor,
            high: seconds * factor,
        })
    }
}

/// The rate of each kind of work. The rate of runs is that of the evaluations on an external simulator.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Paces(pub BTreeMap<Kind, Pace>);

impl Paces {
    fn of(&self, kind: Kind) -> Pace {
        self.0.get(&kind).copied().unwrap_or_default()
    }

    /// Samples of designs and points stored per second, at the recent rate.
    #[must_use]
    pub fn samples_per_second(&self) -> f64 {
        self.of(Kind::Design).per_second + self.of(Kind::Point).per_second
    }
}

/// Durations of the recent runs of optimisers, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunSeconds {
    pub mean: f64,
    pub shortest: f64,
    pub longest: f64,
}

/// The state of a running coordinator at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct CoordinatorState {
    /// The registered workers, each with its recent samples per second.
    pub workers: Vec<(WorkerStatus, f64)>,
    /// The time of this state, on the workers' clock.
    pub now: Duration,
    /// Streams and leases by state.
    pub counts: Counts,
    /// The rates at which results arrive, by kind of work.
    pub paces: Paces,
    /// Durations of runs of optimisers; `None` until one has ended.
    pub run_seconds: Option<RunSeconds>,
    /// Progress of the searches on an external simulator; empty if workers compute whole runs.
    pub searches: Vec<Progress>,
    /// Whether leasing was stopped.
    pub is_draining: bool,
}

/// The running coordinator in the status.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CoordinatorStatus {
    /// Waiting designs, points and runs.
    pub jobs_queued: u64,
    /// Leases held by workers.
    pub jobs_leased: u64,
    /// Leases reported since the start.
    pub jobs_done: u64,
    /// Quarantined designs, points and runs.
    pub jobs_quarantined: u64,
    /// Samples stored per second, at the recent rate.
    pub samples_per_second: f64,
    /// Seconds until the stage ends at the recent rate, while samples of the DoE, of a round of
    /// infill or of the optima are taken or optimisers run; absent while too little is known.
    pub eta_seconds: Option<f64>,
    /// The lower end of the interval of `eta_seconds`. It is a 95 % interval from the uncertainty of the rate and of
    /// the missing work. For whole runs of optimisers it follows from the shortest and the longest recent run.
    pub eta_low_seconds: Option<f64>,
    /// The upper end of the interval.
    pub eta_high_seconds: Option<f64>,
    /// Whether leasing was stopped.
    pub draining: bool,
    pub workers: Vec<Worker>,
}

/// A worker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Worker {
    /// The worker's machine and process, `MACHINE:PROCESS`.
    pub host: String,
    /// Number of leases that it computes at once.
    pub slots: u32,
    /// Leases that it holds.
    pub leased: u64,
    /// Leases that it delivered.
    pub completed: u64,
    /// Failed or lost evaluations.
    pub failed: u64,
    /// Seconds since its last call.
    pub silent_seconds: f64,
    /// Whether it gets no leases for a while, after repeated failures.
    pub is_suspended: bool,
    /// Recent samples per second.
    pub samples_per_second: f64,
}

/// The missing work of a stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Backlog {
    /// A number of samples or evaluations, with its standard error.
    Counted(Kind, f64, f64),
    /// A number of runs of optimisers, by workers that compute whole runs.
    Runs(f64),
}

/// A time with the interval that it lies in.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span {
    seconds: f64,
    low: f64,
    high: f64,
}

impl Backlog {
    /// The time for this work at the recent rate; `None` while too little is known, or without a slot.
    fn span(self, running: &CoordinatorState, slots: f64) -> Option<Span> {
        match self {
            Self::Counted(kind, count, error) => running.paces.of(kind).span(count, error),
            Self::Runs(runs) => {
                let took = running.run_seconds.filter(|_| slots > 0.0)?;
                Some(Span {
                    seconds: runs * took.mean / slots,
                    // A run in progress may be about to end, or have just begun.
                    low: (runs - slots).max(0.0) / slots * took.shortest,
                    high: (runs / slots).ceil() * took.longest,
                })
            }
        }
    }
}

impl CoordinatorStatus {
    /// The part of the status about a running coordinator. The time to go follows from `left`, the missing work of the
    /// stage.
    #[must_use]
    pub fn of(running: CoordinatorState, left: Option<Backlog>) -> Self {
        let silent_for = |seen: Duration| running.now.saturating_sub(seen);
        let present = running.workers.iter().map(|(worker, _)| worker);
        let present = present.filter(|worker| silent_for(worker.last_seen) < GONE);
        let slots: usize = present.map(|worker| worker.slots).sum();
        let span = left.and_then(|left| left.span(&running, slots as f64));
        let count = |count: usize| count as u64;
        let workers = running.workers.into_iter().map(|(worker, rate)| Worker {
            host: worker.host,
            slots: u32::try_from(worker.slots).unwrap_or(u32::MAX),
            leased: count(worker.leased),
            completed: worker.delivered,
            failed: worker.failed + worker.crashed,
            silent_seconds: silent_for(worker.last_seen).as_secs_f64(),
            is_suspended: worker
                .suspended_until
                .is_some_and(|until| until > running.now),
            samples_per_second: rate,
        });
        Self {
            jobs_queued: count(running.counts.free + running.counts.waiting),
            jobs_leased: count(running.counts.leased),
            jobs_done: running.counts.delivered,
            jobs_quarantined: count(running.counts.quarantined),
            samples_per_second: running.paces.samples_per_second(),
            eta_seconds: span.map(|span| span.seconds),
            eta_low_seconds: span.map(|span| span.low),
            eta_high_seconds: span.map(|span| span.high),
            draining: running.is_draining,
            workers: workers.collect(),
        }
    }

    /// The time to go with its interval, as in `12 min (10 min to 15 min)`; `None` while too little is known.
    #[must_use]
    pub fn time_to_go(&self) -> Option<String> {
        let about = duration(self.eta_seconds?);
        let ends = self.eta_low_seconds.zip(self.eta_high_seconds);
        let ends = ends.map(|(low, high)| (duration(low), duration(high)));
        Some(match ends {
            Some((low, high)) if low != high => format!("{about} ({low} to {high})"),
            _ => about,
        })
    }
}
