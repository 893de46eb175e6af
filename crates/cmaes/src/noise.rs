//! Objectives that are themselves random: how much noise there is, and what to do about it.

use serde::{Deserialize, Serialize};

use crate::Evaluation;

/// Acceptance threshold θ of rank changes.
const THETA: f64 = 0.2;
/// Factor by which the number of samples grows and shrinks.
const SAMPLE_FACTOR: f64 = 1.5;

/// The uncertainty handling of UH-CMA-ES: some candidates of each generation are evaluated twice,
/// and where their ranks change more than chance would have it, every evaluation takes more samples;
/// when it has as many as allowed, the step size grows instead, so that differences stand out of the
/// noise.
///
/// N. Hansen, A. Niederberger, L. Guzzella, P. Koumoutsakos, *A method for handling uncertainty in
/// evolutionary optimization with an application to feedback control of combustion*, IEEE
/// Transactions on Evolutionary Computation 13(1), 2009, algorithms 3 and 4 with their parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UncertaintyHandling {
    samples: f64,
    most_samples: usize,
    #[serde(with = "crate::any_number")]
    measure: f64,
    lengthen: bool,
}

impl UncertaintyHandling {
    /// Handling that starts with 1 sample per evaluation and asks for at most `most_samples` (at
    /// least 1 is taken).
    #[must_use]
    pub fn new(most_samples: usize) -> Self {
        Self {
            samples: 1.0,
            most_samples: most_samples.max(1),
            measure: 0.0,
            lengthen: false,
        }
    }

    /// How many samples the caller should average in each evaluation of the next generation.
    #[must_use]
    pub fn samples(&self) -> usize {
        // At least 1, at most `most_samples`.
        self.samples.round() as usize
    }

    /// How many of `population` candidates to evaluate a second time: a tenth, at least two.
    #[must_use]
    pub fn reevaluations(population: usize) -> usize {
        population.div_ceil(10).max(2).min(population)
    }

    /// The last generation's measure s of rank changes: above 0, they are more than is acceptable.
    #[must_use]
    pub fn measure(&self) -> f64 {
        self.measure
    }

    /// Takes the measure of `again`, second evaluations of the first candidates, and ranks all
    /// candidates, best first, by the sum of their ranks in both evaluations.
    pub(crate) fn judge(&mut self, first: &[Evaluation], again: &[Evaluation]) -> Vec<usize> {
        let count = first.len();
        let second = |i: usize| again.get(i).unwrap_or(&first[i]);
        // Ranks, from 0, among all 2λ evaluations; those not repeated count twice. Equal ones have
        // the mean of their ranks.
        let rank_of = |e: &Evaluation| {
            let (mut below, mut equal) = (0.0, 0.0);
            for (i, once) in first.iter().enumerate() {
                for other in [once, second(i)] {
                    match other.rank(e) {
                        std::cmp::Ordering::Less => below += 1.0,
                        std::cmp::Ordering::Equal => equal += 1.0,
                        std::cmp::Ordering::Greater => {}
                    }
                }
            }
            below + (equal - 1.0_f64).max(0.0) / 2.0
        };
        let old: Vec<f64> = first.iter().map(rank_of).collect();
        let new: Vec<f64> = (0..count).map(|i| rank_of(second(i))).collect();

        let sum: f64 = (0..again.len())
            .map(|i| {
                let change = new[i] - old[i];
                // A repeated evaluation moves past itself at no cost.
                let counted = (change.abs() - 1.0).max(0.0);
                let past = |passed: bool| f64::from(u8::from(passed));
                2.0 * counted
                    - limit(new[i] - past(change > 0.0), count)
                    - limit(old[i] - past(change < 0.0), count)
            })
            .sum();
        self.measure = sum / again.len() as f64;
        let most = self.most_samples as f64;
        self.lengthen = false;
        if self.measure > 0.0 {
            if self.samples < most {
                self.samples = (SAMPLE_FACTOR * self.samples).min(most);
            } else {
                self.lengthen = true;
            }
        } else {
            self.samples = (self.samples / SAMPLE_FACTOR).max(1.0);
        }

        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| {
            (old[a] + new[a])
                .total_cmp(&(old[b] + new[b]))
                .then((old[a] - new[a]).abs().total_cmp(&(old[b] - new[b]).abs()))
        });
        order
    }

    /// What to multiply the step size by, in `dimension` variables.
    pub(crate) fn step_factor(&self, dimension: usize) -> f64 {
        if self.lengthen {
            1.0 + 2.0 / (dimension as f64 + 10.0)
        } else {
            1.0
        }
    }
}

/// The θ/2 quantile of the rank changes |1 − R|, …, |2λ − 1 − R| that chance alone would give a
/// solution of rank R (from 0) among λ candidates.
fn limit(rank: f64, population: usize) -> f64 {
    let mut changes: Vec<f64> = (1..2 * population)
        .map(|other| (other as f64 - (rank + 1.0)).abs())
        .collect();
    changes.sort_by(f64::total_cmp);
    let position = THETA / 2.0 * (changes.len() - 1) as f64;
    let below = position.floor() as usize;
    let share = position - position.floor();
    let above = changes[(below + 1).min(changes.len() - 1)];
    changes[below] + share * (above - changes[below])
}
