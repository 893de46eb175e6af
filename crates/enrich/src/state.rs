//! The input of a round: designs, their responses, earlier rounds.

use kriging::Noise;
use serde::{Deserialize, Serialize};

use crate::{Error, Options};

/// A design whose response was sampled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampledDesign {
    /// The d variables, in the caller's units.
    pub x: Vec<f64>,
    /// The number of samples that the response was computed from, at least 1.
    pub samples: u32,
    /// The response to be minimised, such as P90 of ΔSTE. NaN or infinite marks a failure.
    pub response: f64,
    /// The variance of the response's estimate.
    pub variance: f64,
    /// The violation of all constraints, in the caller's units; 0 or less is feasible.
    pub violation: f64,
    /// [`ExactCriteria::baseline`] of the design.
    pub baseline: f64,
}

/// The criteria of a design that are known without samples of it: the exact constraints, the baseline, and the
/// probability that the other constraints hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactCriteria {
    /// The violation of the exact constraints, in the caller's units; 0 or less is feasible.
    pub violation: f64,
    /// A cheap approximation of the response, zero everywhere if there is none. One of the models is
    /// fitted to the difference between response and baseline (M. C. Kennedy, A. O'Hagan, *Predicting the
    /// output from a complex computer code when fast approximations are available*, Biometrika 87 (2000)
    /// 1–13, with the factor 1).
    pub baseline: f64,
    /// Factor by which the value of a new design is multiplied, such as the probability that it keeps the constraints
    /// that only samples show; 1 if there are none.
    pub holds: f64,
}

impl From<f64> for ExactCriteria {
    /// A violation without a baseline.
    fn from(violation: f64) -> Self {
        Self {
            violation,
            baseline: 0.0,
            holds: 1.0,
        }
    }
}

/// The outcome of an earlier round.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoundRecord {
    /// [`Decision::expected_improvement`](crate::Decision::expected_improvement) of the round.
    pub expected_improvement: Option<f64>,
    /// Number of infill points that the round asked for.
    pub asked: u32,
    /// Number of these that could not be simulated or sampled.
    pub failed: u32,
}

/// The input of [`decide`](crate::decide). The order of the designs is the caller's.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    /// Designs with a response, one entry per design.
    pub sampled: Vec<SampledDesign>,
    /// Designs that could not be simulated or sampled.
    pub failed: Vec<Vec<f64>>,
    /// The rounds so far.
    pub rounds: Vec<RoundRecord>,
}

/// The usable part of a state: finite responses, one entry per design.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    pub(crate) sampled: Vec<SampledDesign>,
    /// The index of each row in the state; for merged entries, that of the first.
    pub(crate) index: Vec<usize>,
    pub(crate) failed: Vec<Vec<f64>>,
    /// The number of entries merged into others.
    pub(crate) merged: usize,
    /// The number of responses that were not finite.
    pub(crate) not_numbers: usize,
}

impl Rows {
    pub(crate) fn new(state: &State, options: &Options) -> Result<Self, Error> {
        let expected = options.bounds.dimension();
        let all = state.sampled.iter().map(|s| &s.x).chain(&state.failed);
        for (index, x) in all.enumerate() {
            if x.len() != expected || x.iter().any(|v| !v.is_finite()) {
                return Err(Error::Design { index, expected });
            }
        }
        let mut rows = Self {
            sampled: Vec::new(),
            index: Vec::new(),
            failed: state.failed.clone(),
            merged: 0,
            not_numbers: 0,
        };
        for (index, entry) in state.sampled.iter().enumerate() {
            if !entry.response.is_finite() || entry.violation.is_nan() {
                rows.not_numbers += 1;
                rows.failed.push(entry.x.clone());
                continue;
            }
            let value = entry.variance;
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::Variance { index, value });
            }
            match rows.sampled.iter_mut().find(|row| row.x == entry.x) {
                Some(row) => {
                    rows.merged += 1;
                    merge(row, entry);
                }
                None => {
                    rows.sampled.push(entry.clone());
                    rows.index.push(index);
                }
            }
        }
        if options.noise == Noise::Smoothed {
            smooth_noise(&mut rows.sampled, options);
        }
        Ok(rows)
    }

    /// The rows to improve on: the feasible ones of `among`, or all of `among` if none is feasible.
    pub(crate) fn incumbents(&self, among: &[usize]) -> Vec<usize> {
        let feasible = |i: &&usize| self.sampled[**i].violation <= 0.0;
        let some: Vec<usize> = among.iter().filter(feasible).copied().collect();
        if some.is_empty() {
            among.to_vec()
        } else {
            some
        }
    }
}

/// Replaces the variance of each response by that of a model of the variances of single samples.
/// Variances that cannot be modelled stay.
fn smooth_noise(rows: &mut [SampledDesign], options: &Options) {
    let x: Vec<f64> = rows.iter().flat_map(|row| row.x.iter().copied()).collect();
    let own: Vec<f64> = rows.iter().map(|row| row.variance).collect();
    let samples = rows.iter().map(|row| f64::from(row.samples.max(2)));
    let samples: Vec<f64> = samples.collect();
    let mut counts = samples.clone();
    counts.sort_by(f64::total_cmp);
    // The median count: most designs have been sampled once.
    let freedom = counts
        .get(counts.len() / 2)
        .map_or(1.0, |count| count - 1.0);
    let d = options.bounds.dimension();
    let smooth = options
        .noise
        .variances(&x, d, own, &samples, freedom, options.seed);
    for (row, variance) in rows.iter_mut().zip(smooth.unwrap_or_default()) {
        row.variance = variance;
    }
}

/// Joins two estimates of one response, weighted by their numbers of samples.
fn merge(row: &mut SampledDesign, other: &SampledDesign) {
    let (a, b) = (
        f64::from(row.samples.max(1)),
        f64::from(other.samples.max(1)),
    );
    let share = b / (a + b);
    row.response += share * (other.response - row.response);
    row.variance = (1.0 - share).powi(2) * row.variance + share.powi(2) * other.variance;
    row.samples = row.samples.saturating_add(other.samples);
}

#[cfg(test)]
mod tests {
    use cmaes::Bounds;
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use super::*;

    /// Variances that scatter by a factor around 0.36/samples.
    #[test]
    fn smoothed_variances_are_those_of_the_samples_taken() {
        let mut rng = stream(5, Purpose::Test, 0, 0);
        let sampled = (0..80).map(|i| {
            let place = f64::from(i);
            let scatter = rng.random::<f64>() - 0.5;
            let samples = if i % 7 == 0 { 72 } else { 36 };
            SampledDesign {
                x: vec![(0.37 * place).fract(), (0.71 * place).fract()],
                samples,
                response: 1.0,
                variance: 0.36 * scatter.exp() / f64::from(samples),
                violation: 0.0,
                baseline: 0.0,
            }
        });
        let state = State {
            sampled: sampled.collect(),
            ..State::default()
        };
        let bounds = Bounds::new(vec![(0.0, 1.0), (0.0, 1.0)]).unwrap();
        let worst = |noise| {
            let options = Options {
                noise,
                ..Options::new(bounds.clone())
            };
            let rows = Rows::new(&state, &options).unwrap();
            let factor = |row: &SampledDesign| row.variance * f64::from(row.samples) / 0.36;
            let factors = rows.sampled.iter().map(|row| factor(row).ln().abs());
            factors.fold(0.0, f64::max)
        };
        assert!(worst(Noise::Own) > 0.45);
        let smoothed = worst(Noise::Smoothed);
        assert!(smoothed < 0.25, "{smoothed}");
    }
}
