//! The estimator of a measure for one design with few samples: that of a normal response, unless Lilliefors' test
//! rejects normality.

use crate::quantile::HarrellDavisVariance;
use crate::{Error, Estimate, Measure, NormalOptions, Percentile, lilliefors, normal_p90};

/// The rule that chooses an estimator for one design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChoiceRule {
    /// The measure; `normal.z` must be its [normal factor](Measure::normal_factor).
    pub measure: Measure,
    /// Significance level: normality is rejected when Lilliefors' p-value is below it; 1 rejects it
    /// without a test.
    pub significance: f64,
    /// The normal estimator, used unless normality is rejected.
    pub normal: NormalOptions,
    /// The variance of Harrell and Davis's estimator, used for a percentile when normality is rejected.
    pub harrell_davis: HarrellDavisVariance,
}

impl Default for ChoiceRule {
    fn default() -> Self {
        Self {
            measure: Measure::Percentile { level: 0.9 },
            significance: 0.05,
            normal: NormalOptions::default(),
            harrell_davis: HarrellDavisVariance::default(),
        }
    }
}

/// The result of [`choose`], with the numbers on which the choice was based.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// The chosen estimate.
    pub chosen: Estimate,
    /// The mean, the standard deviation and m + z s of the samples, chosen or not.
    pub normal: Percentile,
    /// Lilliefors' p-value; `None` when the test does not apply (too few samples, or all equal).
    pub p_value: Option<f64>,
}

/// Estimates the measure of one design for a [normal response](Measure::of_normal), or
/// [without a distribution](Measure::distribution_free) if normality is rejected. Fewer than
/// [`Measure::free_min_samples`] samples are always treated as normal, because they do not reach the tail.
///
/// Normality of normal samples is rejected with the probability `significance`.
///
/// # Errors
///
/// [`Error::OutOfRange`] unless 0 ≤ `significance` ≤ 1, and the errors of [`normal_p90`].
pub fn choose(samples: &[f64], rule: &ChoiceRule) -> Result<Choice, Error> {
    let significance = rule.significance;
    if !(0.0..=1.0).contains(&significance) {
        return Err(Error::OutOfRange {
            name: "significance",
            value: significance,
            expected: "from 0 to 1",
        });
    }
    let measure = rule.measure;
    let normal = normal_p90(samples, &rule.normal)?;
    let p_value = lilliefors(samples).ok().map(|test| test.p_value);
    let rejected = significance == 1.0 || p_value.is_some_and(|p| p < significance);
    let chosen = if rejected && samples.len() >= measure.free_min_samples() {
        measure.distribution_free(samples, rule.harrell_davis)?
    } else {
        measure.of_normal(&normal)
    };
    Ok(Choice {
        chosen,
        normal,
        p_value,
    })
}
