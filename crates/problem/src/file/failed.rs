//! Failed samples: their value, and the measure of a design that has some.

use std::borrow::Cow;

use stats::Measure;

use super::{Aim, FailedSamples, Sampling};

impl Sampling {
    /// Whether a failed sample is a result, which is stored.
    #[must_use]
    pub fn tolerates_failures(&self) -> bool {
        self.failed != FailedSamples::QuarantinesDesign
    }

    /// The value that stands for a failed sample: infinitely bad.
    #[must_use]
    pub const fn failed_sample(&self) -> f64 {
        match self.objective.aim {
            Aim::Maximise => f64::NEG_INFINITY,
            Aim::Minimise => f64::INFINITY,
        }
    }

    /// Number of failed samples among these.
    #[must_use]
    pub fn count_failed(samples: &[f64]) -> usize {
        samples.iter().filter(|sample| sample.is_infinite()).count()
    }

    /// The samples that a measure without a distribution is computed from.
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

    /// The estimate of the measure if `failed` of the samples have failed.
    pub(super) fn estimate_of_others(&self, samples: &[f64], failed: usize) -> stats::Choice {
        let finite: Vec<f64> = samples.iter().copied().filter(|s| s.is_finite()).collect();
        let share = failed as f64 / samples.len() as f64;
        let (mean, sd) = stats::mean_sd(&finite).unwrap_or_default();
        let counts_as_worst = matches!(
            self.failed,
            FailedSamples::Worst | FailedSamples::QuarantinesDesign
        );
        let of_others = match (self.failed, self.measure()) {
            (FailedSamples::LeftOut, measure) => self.estimate_of(&finite, measure).ok(),
            (_, Measure::Percentile { level }) if counts_as_worst => {
                self.percentile_of_others(&finite, level, share, sd)
            }
            (_, measure @ Measure::Exceedance { .. }) if counts_as_worst => {
                self.probability_of_others(&finite, measure, share)
            }
            _ => None,
        };
        if let Some(estimate) = of_others {
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
            chosen: stats::Estimate {
                method: stats::Method::Normal,
                n: none.n,
                value: none.p90,
                variance: none.variance,
            },
            p_value: None,
        }
    }

    /// The percentile of all samples, computed from those that have not failed; `share` is the share of failed samples.
    fn percentile_of_others(
        &self,
        finite: &[f64],
        level: f64,
        share: f64,
        sd: f64,
    ) -> Option<stats::Choice> {
        let rest = 1.0 - share;
        // The level among the other samples, and its derivative by the share. Failed samples count as the
        // smallest values if the response is maximised, and as the largest ones if it is minimised.
        let (level, by_share) = match self.objective.aim {
            Aim::Maximise => ((level - share) / rest, (level - 1.0) / rest.powi(2)),
            Aim::Minimise => (level / rest, level / rest.powi(2)),
        };
        if !(level > 0.0 && level < 1.0) {
            return None;
        }
        let mut estimate = self
            .estimate_of(finite, Measure::Percentile { level })
            .ok()?;
        // The share of failures is an estimate, too. Its variance enters by the slope of a normal
        // distribution's quantile at this level.
        let z = stats::normal_quantile(level);
        let slope = sd * std::f64::consts::TAU.sqrt() * (0.5 * z * z).exp();
        let n = finite.len() as f64 / rest;
        let variance = (slope * by_share).powi(2) * share * rest / n;
        estimate.chosen.variance += variance;
        estimate.normal.variance += variance;
        Some(estimate)
    }

    /// The probability over all samples. The failed `share` counts as being on the bad side of the limit.
    fn probability_of_others(
        &self,
        finite: &[f64],
        measure: Measure,
        share: f64,
    ) -> Option<stats::Choice> {
        let mut estimate = self.estimate_of(finite, measure).ok()?;
        let (rest, chosen) = (1.0 - share, &mut estimate.chosen);
        let bad = match self.objective.aim {
            Aim::Maximise => 0.0,
            Aim::Minimise => 1.0,
        };
        let n = finite.len() as f64 / rest;
        let of_share = (bad - chosen.value).powi(2) * share * rest / n;
        chosen.value = rest * chosen.value + share * bad;
        chosen.variance = rest * rest * chosen.variance + of_share;
        Some(estimate)
    }
}

#[cfg(test)]
mod tests {
    use crate::Campaign;

    use super::*;

    fn sampling(failed: FailedSamples, counts_above: bool) -> Sampling {
        let aim = match counts_above {
            true => Aim::Maximise,
            false => Aim::Minimise,
        };
        let campaign = Campaign::parse("wear.toml", Campaign::WEAR).unwrap();
        let mut objective = campaign.sampling.objective;
        objective.aim = aim;
        Sampling {
            failed,
            objective,
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
                let estimate = of.estimate(&samples(&of, failed)).unwrap().chosen.value;
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
            // There is no percentile if a tenth or more have failed.
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
            if estimate.value.is_finite() {
                values.push(estimate.value);
                stated.push(estimate.variance);
            }
        }
        let (_, sd) = stats::mean_sd(&values).unwrap();
        stated.sort_by(f64::total_cmp);
        let ratio = stated[stated.len() / 2] / (sd * sd);
        // Without the variance of the share the ratio is 0.4.
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
