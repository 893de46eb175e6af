//! Data that every step of a round shares: rows, settings, exact constraints and random streams.

use std::sync::atomic::{AtomicU64, Ordering};

use stats::streams::{Purpose, StreamRng, stream};

use crate::simulability::SimulabilityModel;
use crate::state::Rows;
use crate::{ExactCriteria, Options};

/// Index of the enrichment among the random streams of [`Purpose::Optimise`].
const STREAM: u64 = 5;
/// Distance between two designs, as a share of every range, below which they are the same.
const SAME: f64 = 1e-6;

/// Data that every step of a round shares.
pub(crate) struct Context<'a> {
    pub(crate) rows: Rows,
    pub(crate) options: &'a Options,
    /// The probability that a design can be simulated.
    pub(crate) simulability: SimulabilityModel,
    /// Number of earlier rounds.
    pub(crate) round: usize,
    /// The caller's evaluation of the exact constraints and the baseline of a design.
    pub(crate) exact: &'a (dyn Fn(&[f64]) -> Option<ExactCriteria> + Sync),
    /// Number of calls of `exact`.
    pub(crate) evaluations: AtomicU64,
}

impl Context<'_> {
    /// The exact constraints and the baseline of `x`. The violation is NaN if they cannot be
    /// evaluated.
    pub(crate) fn exact_criteria(&self, x: &[f64]) -> ExactCriteria {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        (self.exact)(x).unwrap_or(ExactCriteria::from(f64::NAN))
    }

    /// The nearest design with possible values of the discrete variables.
    pub(crate) fn rounded(&self, x: &[f64]) -> Vec<f64> {
        let mut rounded = x.to_vec();
        for (x, values) in rounded.iter_mut().zip(&self.options.values) {
            let wanted = *x;
            let distance = |value: &f64| (value - wanted).abs();
            let nearest = values
                .iter()
                .min_by(|a, b| distance(a).total_cmp(&distance(b)));
            *x = nearest.copied().unwrap_or(wanted);
        }
        rounded
    }

    /// The largest difference of any variable, as a share of its range.
    pub(crate) fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let intervals = self.options.bounds.intervals().iter();
        intervals
            .zip(a.iter().zip(b))
            .map(|((low, high), (a, b))| (a - b).abs() / (high - low))
            .fold(0.0, f64::max)
    }

    /// Whether two designs differ by rounding only.
    pub(crate) fn is_same(&self, a: &[f64], b: &[f64]) -> bool {
        self.distance(a, b) < SAME
    }

    /// The probability that a design can be simulated; 0 at a failed one.
    pub(crate) fn probability(&self, x: &[f64]) -> f64 {
        let mut failed = self.rows.failed.iter();
        if failed.any(|failed| self.is_same(x, failed)) {
            return 0.0;
        }
        self.simulability.probability(x)
    }

    /// The random stream of one search of this round.
    pub(crate) fn rng(&self, turn: usize) -> StreamRng {
        let sample = ((self.round as u64) << 16) | turn as u64;
        stream(self.options.seed, Purpose::Optimise, STREAM, sample)
    }
}
