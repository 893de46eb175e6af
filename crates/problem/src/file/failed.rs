//! Failed samples: their value, and the percentile of a design that has some.

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Sampling;

/// The meaning of failed samples for the percentile of their design.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FailedSamples {
    /// A failed sample counts as worse than every other: with 5 % of them P90 is the percentile of the
    /// others at 0.9/0.95. A design has a percentile as long as that level is below 1.
    #[default]
    Worst,
    /// The percentile is that of the samples that have not failed.
    LeftOut,
    /// A design with a failed sample has no percentile.
    RefusesDesign,
    /// A sample that fails for good quarantines its design, which waits for `coordinator retry` or for
    /// the same command again. One that is answered with no number is a failure, too.
    QuarantinesDesign,
}

impl Sampling {
    /// Whether a failed sample is a result, which is stored.
    #[must_use]
    pub fn tolerates_failures(&self) -> bool {
        self.failed != FailedSamples::QuarantinesDesign
    }

    /// The value that stands for a failed sample: infinitely bad.
    #[must_use]
    pub const fn failed_sample(&self) -> f64 {
        match self.counts_above {
            true => f64::NEG_INFINITY,
            false => f64::INFINITY,
        }
    }

    /// Number of failed samples among these.
    #[must_use]
    pub fn count_failed(samples: &[f64]) -> usize {
        samples.iter().filter(|sample| sample.is_infinite()).count()
    }

    /// The samples that a percentile without a distribution is computed from.
    pub(super) fn counted<'a>(&self, samples: &'a [f64]) -> Cow<'a, [f64]> {
        match self.failed {
            _ if Self::count_failed(samples) == 0 => Cow::Borrowed(samples),
            FailedSamples::Worst | FailedSamples::QuarantinesDesign => Cow::Borrowed(samples),
            FailedSamples::LeftOut => {
                let finite = samples.iter().copied().filter(|sample| sample.is_finite());
                Cow::Owned(finite.collect())
            }
            FailedSamples::RefusesDesign => Cow::Owned(vec![self.failed_sample(); samples.len()]),
        }
    }

    /// The estimate from samples of which `failed` have failed.
    pub(super) fn estimate_of_others(&self, samples: &[f64], failed: usize) -> stats::Choice {
        let finite: Vec<f64> = samples.iter().copied().filter(|s| s.is_finite()).collect();
        let share = failed as f64 / samples.len() as f64;
        // The level among the others, and its derivative by the share.
        let (level, by_share) = match self.failed {
            FailedSamples::LeftOut => (self.level(), 0.0),
            FailedSamples::RefusesDesign => (1.0, 0.0),
            FailedSamples::Worst | FailedSamples::QuarantinesDesign => match self.counts_above {
                // The failed samples lie below all others.
                true => (
                    (self.level() - share) / (1.0 - share),
                    (self.level() - 1.0) / (1.0 - share).powi(2),
                ),
                false => (
                    self.level() / (1.0 - share),
                    self.level() / (1.0 - share).powi(2),
                ),
            },
        };
        let (mean, sd) = stats::mean_sd(&finite).unwrap_or_default();
        if level > 0.0
            && level < 1.0
            && let Ok(mut estimate) = self.estimate_at(&finite, level)
        {
            // The share of failures is an estimate, too. Its variance enters by the slope of a normal
            // distribution's quantile at this level.
            let z = stats::normal_quantile(level);
            let slope = sd * std::f64::consts::TAU.sqrt() * (0.5 * z * z).exp();
            let of_share = share * (1.0 - share) / samples.len() as f64;
            let variance = (slope * by_share).powi(2) * of_share;
            estimate.chosen.variance += variance;
            estimate.normal.variance += variance;
            return estimate;
        }
        let none = stats::Percentile {
            n: samples.len(),
            mean,
            sd,
            p90: self.failed_sample(),
            variance: 0.0,
        };
        stats::Choice {
            normal: none,
            chosen: stats::Quantile {
                method: stats::Method::Normal,
                n: none.n,
                p90: none.p90,
                variance: none.variance,
            },
            p_value: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Campaign;

    use super::*;

    fn sampling(failed: FailedSamples, counts_above: bool) -> Sampling {
        let campaign = Campaign::parse("wear.toml", Campaign::WEAR).unwrap();
        Sampling {
            failed,
            counts_above,
            ..campaign.sampling
        }
    }

    /// 200 normal quantiles, and `failed` samples that failed.
    fn samples(of: &Sampling, failed: usize) -> Vec<f64> {
        let normal = (0..200).map(|i| stats::normal_quantile((f64::from(i) + 0.5) / 200.0));
        normal.chain(vec![of.failed_sample(); failed]).collect()
    }

    #[test]
    fn a_failed_sample_counts_as_the_worst_or_is_left_out_or_refuses_its_design() {
        for above in [false, true] {
            let p90 = |policy, failed| {
                let of = sampling(policy, above);
                let estimate = of.estimate(&samples(&of, failed)).unwrap().chosen.p90;
                if above { -estimate } else { estimate }
            };
            let near = |value: f64, z: f64| assert!((value - z).abs() < 0.02, "{value} {z}");
            use FailedSamples::{LeftOut, RefusesDesign, Worst};
            for policy in [Worst, LeftOut, RefusesDesign] {
                near(p90(policy, 0), 1.2816);
            }
            // 10 of 210 failed: the level among the others is 0.9/(200/210) = 0.945.
            near(p90(Worst, 10), 1.598);
            near(p90(LeftOut, 10), 1.2816);
            assert_eq!(p90(RefusesDesign, 1), f64::INFINITY);
            // A tenth and more leave no percentile.
            assert_eq!(p90(Worst, 23), f64::INFINITY);
            near(p90(LeftOut, 23), 1.2816);
        }
    }

    /// The stated variance is that of repeated estimates, including the variance of the share of failures.
    #[test]
    fn the_variance_counts_the_error_of_the_share() {
        use rand::RngExt as _;
        let of = sampling(FailedSamples::Worst, false);
        let rng = &mut stats::streams::stream(1, stats::streams::Purpose::Test, 0, 0);
        let (mut values, mut stated) = (Vec::new(), Vec::new());
        while values.len() < 4000 {
            let drawn: Vec<f64> = (0..120)
                .map(|_| match rng.random::<f64>() < 0.04 {
                    true => of.failed_sample(),
                    false => stats::normal_quantile(rng.random()),
                })
                .collect();
            let estimate = of.estimate(&drawn).unwrap().chosen;
            // A few estimates in hundreds have too many failures for a percentile.
            if estimate.p90.is_finite() {
                values.push(estimate.p90);
                stated.push(estimate.variance);
            }
        }
        let (_, sd) = stats::mean_sd(&values).unwrap();
        stated.sort_by(f64::total_cmp);
        let ratio = stated[stated.len() / 2] / (sd * sd);
        // Without the share's part it is 0.4.
        assert!((0.7..1.2).contains(&ratio), "{ratio}");
    }

    #[test]
    fn a_verified_percentile_counts_failed_samples_by_rank() {
        let p90 = |policy, failed| {
            let of = sampling(policy, false);
            of.verified(&samples(&of, failed)).unwrap().value
        };
        use FailedSamples::{LeftOut, RefusesDesign, Worst};
        assert!((p90(Worst, 10) - 1.598).abs() < 0.03);
        assert_eq!(p90(Worst, 40), f64::INFINITY);
        assert!((p90(LeftOut, 40) - 1.2816).abs() < 0.03);
        assert_eq!(p90(RefusesDesign, 1), f64::INFINITY);
    }
}
