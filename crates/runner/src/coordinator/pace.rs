//! The rate of stored samples with a confidence interval, and the durations of optimiser runs.
//!
//! Deliveries are counted in batches. A batch ends with the first delivery a second or more after
//! the end of the previous batch, so a batch of a fast simulator holds a second of samples and one
//! of a slow simulator holds a single delivery. The rate is the ratio estimator R = Σaᵢ/Σdᵢ over
//! the last [`KEPT`] batches of aᵢ samples and dᵢ seconds; its variance is that of the linearised
//! ratio, n/(n−1) Σ(aᵢ − R dᵢ)²/(Σdᵢ)² (W. G. Cochran, *Sampling Techniques*, 3rd ed., 1977,
//! section 6.3). When the rate of the last [`LEAST`] batches differs from that of the earlier ones
//! by more than [`CHANGED`] standard errors of the difference, the earlier ones are forgotten:
//! workers joined or left, or samples take a different time now.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use ledger::{Delivery, Kind, Unit, WorkerId};
use results::running::{Pace, Paces, RunSeconds};

/// Minimum duration of a batch.
const BATCH: Duration = Duration::from_secs(1);
/// Maximum number of batches in an estimate.
const KEPT: usize = 20;
/// Minimum duration of [`KEPT`] batches, in seconds.
const SHORTEST: f64 = KEPT as f64 * BATCH.as_secs_f64();
/// Minimum number of batches for a confidence interval.
const LEAST: usize = 5;
/// Standard errors by which rates must differ for the earlier batches to be forgotten.
const CHANGED: f64 = 4.0;
/// Maximum standard error of a rate, relative to the rate, for a confidence interval.
const ROUGHEST: f64 = 0.5;
/// The 97.5 % quantile of Student's t with 4 to 19 degrees of freedom (n − 1 for n batches).
const STUDENT: [f64; KEPT - LEAST + 1] = [
    2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120,
    2.110, 2.101, 2.093,
];
/// Maximum number of optimiser runs in a mean.
const RUNS_KEPT: usize = 20;

/// Samples stored over a time.
#[derive(Debug, Clone, Copy)]
struct Batch {
    seconds: f64,
    samples: f64,
}

/// Counts stored samples.
#[derive(Debug, Clone, Default)]
struct Meter {
    /// The latest batches, the oldest first.
    batches: VecDeque<Batch>,
    /// The end of the last batch, or the first delivery; none before that.
    since: Option<Duration>,
    /// Samples counted after `since`.
    open: u64,
}

impl Meter {
    /// Counts a delivery. The first delivery, and the first after a long silence, only starts the
    /// clock: it is unknown when the work for it began.
    fn count(&mut self, now: Duration, samples: u64) {
        if samples == 0 {
            return;
        }
        let Some(since) = self.since.filter(|_| !self.is_silent(now)) else {
            *self = Self {
                since: Some(now),
                ..Self::default()
            };
            return;
        };
        self.open += samples;
        let lasted = now.saturating_sub(since);
        if lasted < BATCH {
            return;
        }
        if self.batches.len() == KEPT {
            self.batches.pop_front();
        }
        self.batches.push_back(Batch {
            seconds: lasted.as_secs_f64(),
            samples: std::mem::take(&mut self.open) as f64,
        });
        self.since = Some(now);
        self.forget_another_rate();
    }

    /// Forgets the earlier batches if their rate differs from that of the latest ones.
    fn forget_another_rate(&mut self) {
        let batches = self.batches.make_contiguous();
        let Some(earlier) = batches.len().checked_sub(LEAST).filter(|n| *n >= LEAST) else {
            return;
        };
        let (before, after) = batches.split_at(earlier);
        let (before, after) = (Ratio::of(before), Ratio::of(after));
        let error = before.error.hypot(after.error);
        if (after.value - before.value).abs() > CHANGED * error {
            self.batches.drain(..earlier);
        }
    }

    /// Whether the last batch ended longer ago than all batches together lasted, and longer ago
    /// than [`SHORTEST`].
    fn is_silent(&self, now: Duration) -> bool {
        let silence = now.saturating_sub(self.since.unwrap_or_default());
        let lasted: f64 = self.batches.iter().map(|batch| batch.seconds).sum();
        // Before a batch has ended, there is no length to compare with.
        !self.batches.is_empty() && silence.as_secs_f64() > lasted.max(SHORTEST)
    }

    /// The current rate; zero after a silence.
    fn pace(&self, now: Duration) -> Pace {
        let Some(since) = self.since.filter(|_| !self.is_silent(now)) else {
            return Pace::default();
        };
        let waited = now.saturating_sub(since).max(BATCH).as_secs_f64();
        let batches: Vec<Batch> = self.batches.iter().copied().collect();
        let ratio = Ratio::of(&batches);
        let with_open = (ratio.samples + self.open as f64) / (ratio.seconds + waited);
        if batches.is_empty() {
            return Pace::of(with_open, None);
        }
        // The open batch has no end yet. It counts only when it lowers the rate.
        let per_second = ratio.value.min(with_open);
        let degrees = batches.len().checked_sub(LEAST);
        let factor = degrees
            .and_then(|more| STUDENT.get(more))
            .and_then(|student| {
                let relative = (ratio.error / ratio.value).hypot(1.0 - per_second / ratio.value);
                (relative <= ROUGHEST).then(|| (student * relative).exp())
            });
        Pace::of(per_second, factor)
    }
}

/// The rate of some batches, in samples per second.
struct Ratio {
    samples: f64,
    seconds: f64,
    value: f64,
    /// The standard error of `value`.
    error: f64,
}

impl Ratio {
    fn of(batches: &[Batch]) -> Self {
        let samples: f64 = batches.iter().map(|batch| batch.samples).sum();
        let seconds: f64 = batches.iter().map(|batch| batch.seconds).sum();
        let value = samples / seconds;
        let off = |batch: &Batch| (batch.samples - value * batch.seconds).powi(2);
        let squares: f64 = batches.iter().map(off).sum();
        let n = batches.len() as f64;
        Self {
            samples,
            seconds,
            value,
            error: (n / (n - 1.0) * squares).sqrt() / seconds,
        }
    }
}

/// The rates at which workers deliver, and the durations of optimiser runs.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rates {
    total: Meters,
    by_worker: BTreeMap<WorkerId, Meters>,
    runs: Runs,
}

impl Rates {
    /// Counts the stored units of a delivery. `has_whole_runs`: a unit of a run is the whole run.
    pub(crate) fn count(
        &mut self,
        worker: &WorkerId,
        delivery: &Delivery,
        has_whole_runs: bool,
        now: Duration,
    ) {
        self.total.count(now, &delivery.stored);
        let own = self.by_worker.entry(worker.clone()).or_default();
        own.count(now, &delivery.stored);
        let is_run = |unit: &Unit| unit.stream.kind == Kind::Run;
        // A lease has one whole run, or none.
        if has_whole_runs && delivery.stored.iter().any(is_run) {
            self.runs.count(delivery.seconds);
        }
    }

    /// The current rates of all workers together.
    pub(crate) fn paces(&self, now: Duration) -> Paces {
        self.total.paces(now)
    }

    /// The current rate of a worker.
    pub(crate) fn samples_per_second(&self, worker: &WorkerId, now: Duration) -> f64 {
        let own = self.by_worker.get(worker);
        own.map_or(0.0, |own| own.paces(now).samples_per_second())
    }

    /// The mean, shortest and longest duration of the last runs; none before a run has ended.
    pub(crate) fn run_seconds(&self) -> Option<RunSeconds> {
        self.runs.seconds()
    }
}

/// A meter for each kind of work. The kinds take different times, and one may wait while another is
/// computed.
#[derive(Debug, Clone, Default)]
struct Meters(BTreeMap<Kind, Meter>);

impl Meters {
    pub(crate) fn count(&mut self, now: Duration, units: &[Unit]) {
        let mut counts: BTreeMap<Kind, u64> = BTreeMap::new();
        for unit in units {
            *counts.entry(unit.stream.kind).or_default() += unit.samples.len() as u64;
        }
        for (kind, count) in counts {
            self.0.entry(kind).or_default().count(now, count);
        }
    }

    /// The current rates.
    pub(crate) fn paces(&self, now: Duration) -> Paces {
        let paces = self.0.iter().map(|(kind, meter)| (*kind, meter.pace(now)));
        Paces(paces.collect())
    }
}

/// Durations of the last optimiser runs, in seconds.
#[derive(Debug, Clone, Default)]
struct Runs(VecDeque<f64>);

impl Runs {
    pub(crate) fn count(&mut self, seconds: f64) {
        if self.0.len() == RUNS_KEPT {
            self.0.pop_front();
        }
        self.0.push_back(seconds);
    }

    /// The mean, shortest and longest duration; none before a run has ended.
    pub(crate) fn seconds(&self) -> Option<RunSeconds> {
        let of = |pick: fn(f64, f64) -> f64| self.0.iter().copied().reduce(pick);
        Some(RunSeconds {
            mean: self.0.iter().sum::<f64>() / self.0.len() as f64,
            shortest: of(f64::min)?,
            longest: of(f64::max)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    /// Deliveries of `samples` every `every` seconds from `from` to `to`.
    fn deliver(meter: &mut Meter, (from, to): (f64, f64), every: f64, samples: u64) {
        let count = ((to - from) / every).round() as u32;
        for number in 1..=count {
            meter.count(at(from + every * f64::from(number)), samples);
        }
    }

    fn interval(pace: Pace) -> (f64, f64) {
        let factor = pace.factor.expect("the rate is known");
        (pace.per_second / factor, pace.per_second * factor)
    }

    #[test]
    fn a_steady_rate_is_known_after_five_batches() {
        let mut meter = Meter::default();
        assert_eq!(meter.pace(at(1.0)), Pace::default());
        deliver(&mut meter, (0.0, 4.0), 0.1, 5);
        assert_eq!(meter.pace(at(4.0)).factor, None, "too little is known");
        deliver(&mut meter, (4.0, 60.0), 0.1, 5);
        let pace = meter.pace(at(60.0));
        assert!((pace.per_second - 50.0).abs() < 2.0, "{pace:?}");
        assert!(pace.factor.unwrap() < 1.1, "{pace:?}");
    }

    /// Samples stored by time (s, samples), read every 10 ms, of `campaigns/wear.toml` with 1500
    /// samples of each design on two cores that other programs shared. The first leases are short.
    const SEEN: [(f64, u64); 42] = [
        (0.0, 100),
        (0.02, 230),
        (0.56, 38670),
        (0.95, 40500),
        (1.33, 40500),
        (1.73, 45000),
        (2.07, 43500),
        (2.35, 30000),
        (2.67, 40500),
        (3.03, 45000),
        (3.3, 40500),
        (3.68, 39000),
        (4.02, 40500),
        (4.34, 43500),
        (4.67, 40500),
        (5.01, 45000),
        (5.27, 39000),
        (5.6, 42000),
        (5.93, 40500),
        (6.27, 43500),
        (6.57, 40500),
        (6.9, 40500),
        (7.3, 40500),
        (7.56, 37500),
        (7.91, 40500),
        (8.24, 43500),
        (8.56, 40500),
        (8.86, 39000),
        (9.21, 46500),
        (9.5, 43500),
        (9.83, 40500),
        (10.16, 40500),
        (10.48, 39000),
        (10.79, 40500),
        (11.08, 45000),
        (11.4, 40500),
        (11.68, 39000),
        (11.96, 39000),
        (12.26, 40500),
        (12.52, 43500),
        (12.85, 39000),
        (13.14, 45000),
    ];

    #[test]
    fn a_real_start_makes_no_estimate_that_misses_what_follows() {
        let mut meter = Meter::default();
        let mut known = 0;
        for (seconds, samples) in SEEN {
            meter.count(at(seconds), samples);
            let pace = meter.pace(at(seconds));
            let Some(factor) = pace.factor else {
                continue;
            };
            known += 1;
            // The mean rate from 6.9 s on.
            let later = 132_000.0;
            let holds = pace.per_second / factor < later && later < pace.per_second * factor;
            assert!(holds, "{pace:?} at {seconds}");
        }
        assert!(known > 20, "the rate is known at {known} of 42 moments");
    }

    #[test]
    fn a_worker_that_leaves_changes_the_rate_within_seconds() {
        let mut meter = Meter::default();
        deliver(&mut meter, (0.0, 30.0), 0.1, 100);
        deliver(&mut meter, (30.0, 37.5), 0.1, 50);
        let (low, high) = interval(meter.pace(at(37.5)));
        assert!(
            low < 500.0 && high > 500.0 && high < 800.0,
            "{low} to {high}"
        );
        // As many workers again join.
        deliver(&mut meter, (37.5, 45.0), 0.1, 150);
        let (low, high) = interval(meter.pace(at(45.0)));
        assert!(
            low > 1000.0 && low < 1500.0 && high > 1500.0,
            "{low} to {high}"
        );
    }

    #[test]
    fn the_rate_falls_when_all_workers_leave_and_begins_anew_when_they_come_back() {
        let mut meter = Meter::default();
        deliver(&mut meter, (0.0, 30.0), 0.1, 100);
        let steady = meter.pace(at(30.0)).per_second;
        let later = meter.pace(at(36.0));
        assert!(later.per_second < 0.85 * steady, "{later:?}");
        assert!(later.factor.is_none_or(|factor| factor > 1.5), "{later:?}");
        assert_eq!(meter.pace(at(60.0)), Pace::default());
        // The silence does not count as a batch.
        deliver(&mut meter, (300.0, 307.0), 0.1, 10);
        let again = meter.pace(at(307.0));
        assert!((again.per_second - 100.0).abs() < 10.0, "{again:?}");
    }

    /// Four workers whose samples take ten minutes each.
    #[test]
    fn hours_between_deliveries_are_batches_like_seconds() {
        let mut meter = Meter::default();
        for round in 0..12 {
            for worker in 0..4 {
                meter.count(at(f64::from(round) * 600.0 + f64::from(worker) * 150.0), 1);
            }
        }
        let pace = meter.pace(at(7000.0));
        assert!((pace.per_second - 4.0 / 600.0).abs() < 1e-3, "{pace:?}");
        assert!(pace.factor.unwrap() < 1.2, "{pace:?}");
    }

    #[test]
    fn runs_have_a_mean_and_a_range() {
        let mut runs = Runs::default();
        assert_eq!(runs.seconds(), None);
        for seconds in 0..40 {
            runs.count(f64::from(seconds));
        }
        let found = runs.seconds().unwrap();
        assert_eq!(
            (found.shortest, found.mean, found.longest),
            (20.0, 29.5, 39.0)
        );
    }
}
