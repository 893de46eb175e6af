//! Expected improvement of the reinterpolating model.

use super::{InfillCriterion, least};
use crate::state::SampledDesign;
use crate::surrogate::Surrogate;
use crate::{Error, Options};

/// [`Criterion::ReinterpolatedExpectedImprovement`](crate::Criterion::ReinterpolatedExpectedImprovement).
///
/// The criterion vanishes at the designs. The value of more samples therefore follows from the mean that
/// is interpolated there, which the samples change. The new mean is normal around the current one, and
/// its expected fall below the lowest mean of the incumbents is the expected improvement again.
pub(super) struct ReinterpolatedImprovement<'a> {
    model: &'a Surrogate,
    options: &'a Options,
    /// The model that interpolates the means of `model` at the designs.
    interpolating: Surrogate,
    /// The lowest mean of the incumbents, on the modelled scale.
    lowest: f64,
}

impl<'a> ReinterpolatedImprovement<'a> {
    pub(super) fn new(
        model: &'a Surrogate,
        incumbents: &[&SampledDesign],
        options: &'a Options,
    ) -> Result<Self, Error> {
        let interpolating = model.reinterpolated()?;
        let mean = |row: &&SampledDesign| interpolating.mean_above(&row.x, row.baseline);
        Ok(Self {
            lowest: least(incumbents.iter().map(mean)),
            model,
            options,
            interpolating,
        })
    }
}

impl InfillCriterion for ReinterpolatedImprovement<'_> {
    fn new_design(&self, x: &[f64], baseline: f64) -> f64 {
        let belief = self.interpolating.belief(x, baseline);
        belief.expected_below(self.lowest)
    }

    fn more_samples(&self, row: &SampledDesign) -> f64 {
        let noise = self.model.noise(self.options.samples_more);
        let belief = self.model.belief(&row.x, row.baseline);
        belief
            .next_mean(noise)
            .map_or(0.0, |next| next.expected_below(self.lowest))
    }
}
