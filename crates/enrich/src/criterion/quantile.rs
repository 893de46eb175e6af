//! Expected quantile improvement.

use super::{InfillCriterion, least};
use crate::Options;
use crate::belief::Belief;
use crate::state::SampledDesign;
use crate::surrogate::Surrogate;

/// [`Criterion::ExpectedQuantileImprovement`](crate::Criterion::ExpectedQuantileImprovement).
pub(super) struct QuantileImprovement<'a> {
    model: &'a Surrogate,
    options: &'a Options,
    /// The lowest quantile of the incumbents, on the modelled scale.
    lowest: f64,
}

impl<'a> QuantileImprovement<'a> {
    pub(super) fn new(
        model: &'a Surrogate,
        incumbents: &[&SampledDesign],
        options: &'a Options,
    ) -> Self {
        let quantile = |row: &&SampledDesign| {
            let belief = model.belief(&row.x, row.baseline);
            belief.quantile(options.quantile_z)
        };
        Self {
            model,
            options,
            lowest: least(incumbents.iter().map(quantile)),
        }
    }

    fn value(&self, x: &[f64], baseline: f64, samples: u32) -> f64 {
        let noise = self.model.noise(samples);
        let belief = self.model.belief(x, baseline);
        improvement_um(&belief, self.lowest, noise, self.options.quantile_z)
    }
}

impl InfillCriterion for QuantileImprovement<'_> {
    fn new_design(&self, x: &[f64], baseline: f64) -> f64 {
        self.value(x, baseline, self.options.samples_new)
    }

    fn more_samples(&self, row: &SampledDesign) -> f64 {
        self.value(&row.x, row.baseline, self.options.samples_more)
    }
}

/// The expected fall of the quantile with deviate `z` below `lowest`, by an observation with the
/// variance `noise`. The quantile after the observation is normal with the mean
/// m + z √(τ²s²/(τ² + s²)) and the variance s⁴/(τ² + s²).
fn improvement_um(belief: &Belief, lowest: f64, noise: f64, z: f64) -> f64 {
    let variance = belief.sd * belief.sd;
    belief.next_mean(noise).map_or(0.0, |next| {
        let sd_after = (noise * variance / (variance + noise)).sqrt();
        Belief {
            mean: next.mean + z * sd_after,
            ..next
        }
        .expected_below(lowest)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without noise the quantile after the observation is the observation itself.
    #[test]
    fn quantile_improvement_without_noise_is_expected_improvement() {
        let belief = Belief {
            mean: 0.4,
            sd: 0.3,
            logarithm: false,
        };
        let without = improvement_um(&belief, 0.5, 0.0, 1.28);
        assert!((without - belief.expected_below(0.5)).abs() < 1e-15);
        // An observation that is all noise has no value.
        assert!(improvement_um(&belief, 0.3, 1e12, 1.28) < 1e-6);
        let certain = Belief { sd: 0.0, ..belief };
        assert_eq!(improvement_um(&certain, 0.5, 0.0, 1.28), 0.0);
    }
}
