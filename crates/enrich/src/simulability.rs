//! A model of the probability that a design can be simulated, fitted to simulated and failed designs.
//!
//! The value of a new design is weighted by the probability, as in F. Bachoc, C. Helbert, V. Picheny,
//! *Gaussian process optimization with failures: classification and convergence proof*, Journal of
//! Global Optimization 78 (2020). Their classifier conditions a process on the signs of its values; here
//! an indicator, 1 at a design that was simulated and 0 at a failed one, is predicted by kriging.

use kriging::{Data, FitOptions, Model};

use crate::Options;
use crate::state::Rows;

/// Variance of the indicator's noise. A step is no realisation of a smooth process: without the noise, the range that
/// fits the designs on both sides of the step is too short for the model to learn anything between them.
const NOISE: f64 = 0.01;

/// The probability that a design can be simulated.
pub(crate) struct SimulabilityModel(Option<Model>);

impl SimulabilityModel {
    /// Learns from the rows. Without a failed design every design is taken to be simulable.
    pub(crate) fn fit(rows: &Rows, options: &Options) -> Self {
        if rows.failed.is_empty() || rows.sampled.is_empty() {
            return Self(None);
        }
        let good = rows.sampled.iter().map(|row| (&row.x, 1.0));
        let bad = rows.failed.iter().map(|x| (x, 0.0));
        let (places, indicators): (Vec<&Vec<f64>>, Vec<f64>) = good.chain(bad).unzip();
        let x: Vec<f64> = places.into_iter().flatten().copied().collect();
        let data = Data {
            x: &x,
            d: options.bounds.dimension(),
            y: &indicators,
            noise_variance: &vec![NOISE; indicators.len()],
        };
        let settings = FitOptions {
            kernel: options.kernel,
            seed: options.seed,
            starts: options.fit_starts,
            ..FitOptions::default()
        };
        Self(kriging::fit(&data, &settings).ok())
    }

    /// The probability at `x`; 1 without a model.
    pub(crate) fn probability(&self, x: &[f64]) -> f64 {
        let model = self.0.as_ref();
        model.map_or(1.0, |model| model.mean(x).clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use cmaes::Bounds;

    use super::*;
    use crate::state::{SampledDesign, State};

    /// Designs of the unit square, those right of 0.6 failed.
    fn state(count: u32) -> State {
        let fraction = |i: u32, irrational: f64| (f64::from(i + 1) * irrational).fract();
        let mut state = State::default();
        for i in 0..count {
            let x = vec![fraction(i, 0.7549), fraction(i, 0.5698)];
            if x[0] > 0.6 {
                state.failed.push(x);
                continue;
            }
            state.sampled.push(SampledDesign {
                x,
                samples: 30,
                response: 1.0,
                variance: 0.01,
                violation: 0.0,
                baseline: 0.0,
            });
        }
        state
    }

    #[test]
    fn the_side_on_which_designs_fail_is_learned() {
        let options = Options::new(Bounds::unit(2).unwrap());
        let rows = Rows::new(&state(40), &options).unwrap();
        let simulable = SimulabilityModel::fit(&rows, &options);
        let all = state(400);
        let good = all.sampled.iter().map(|row| (&row.x, true));
        let both = good.chain(all.failed.iter().map(|x| (x, false)));
        let (mut right, mut wrong) = (0, 0);
        for (x, is_good) in both.filter(|(x, _)| (x[0] - 0.6).abs() > 0.1) {
            match (simulable.probability(x) > 0.5) == is_good {
                true => right += 1,
                false => wrong += 1,
            }
        }
        assert!(right > 300 && wrong <= 3, "{right} {wrong}");
    }

    #[test]
    fn without_failures_all_designs_are_simulable() {
        let options = Options::new(Bounds::unit(2).unwrap());
        let mut sound = state(40);
        sound.failed.clear();
        let rows = Rows::new(&sound, &options).unwrap();
        let simulable = SimulabilityModel::fit(&rows, &options);
        assert_eq!(simulable.probability(&[0.9, 0.5]), 1.0);
    }
}
