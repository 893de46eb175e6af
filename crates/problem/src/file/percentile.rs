//! The percentile of a set of samples: its name, its estimates and its interval. Nothing else computes one.

use stats::{NormalOptions, OrderStatistic, VarianceFormula};

use super::{ControlVariate, FailedSamples, PercentileRule, Sampling, WearCoefficients};

/// Significance level of Lilliefors' test, as in the paper.
pub const SIGNIFICANCE: f64 = 0.05;
/// Confidence of the intervals of verified percentiles.
const CONFIDENCE: f64 = 0.95;

impl Sampling {
    /// The level of the paper's percentile.
    pub(super) const LEVEL: f64 = 0.9;

    /// The level of the percentile: the share of the samples below it.
    #[must_use]
    pub fn level(&self) -> f64 {
        match self.counts_above {
            // 1 − 0.9 is not 0.1 to the last bit.
            true => ((1.0 - self.level) * 1e9).round() / 1e9,
            false => self.level,
        }
    }

    /// The name of the percentile: P90, P99.5.
    #[must_use]
    pub fn percentile_name(&self) -> String {
        // Six digits, so that 99.9 is not 99.90000000000001.
        format!("P{}", (self.level() * 1e6).round() / 1e4)
    }

    /// The prefix of columns with the percentile: p90, p99_5.
    #[must_use]
    pub fn percentile_column(&self) -> String {
        self.percentile_name().to_lowercase().replace('.', "_")
    }

    /// The names of a gear pair's columns with the percentile and its interval: p90_um, p90_low_um,
    /// p90_high_um.
    #[must_use]
    pub fn percentile_columns(&self) -> [String; 3] {
        let name = self.percentile_column();
        ["um", "low_um", "high_um"].map(|end| format!("{name}_{end}"))
    }

    /// The options of the percentile's estimate from normal samples, by the campaign's rule.
    #[must_use]
    pub fn normal(&self) -> NormalOptions {
        match self.rule_of_percentile() {
            PercentileRule::Paper => self.paper(),
            _ => NormalOptions {
                z: stats::normal_quantile(self.level()),
                variance: VarianceFormula::Exact,
                unbiased: true,
            },
        }
    }

    /// The percentile of verification samples, with a 95 % interval that assumes no distribution. Every table,
    /// page and decision takes the percentile of a verified design from here.
    ///
    /// # Errors
    ///
    /// Those of [`stats::order_statistic`].
    pub fn verified(&self, samples: &[f64]) -> Result<OrderStatistic, stats::Error> {
        stats::order_statistic(&self.counted(samples), self.level(), CONFIDENCE)
    }

    /// The difference of the verified percentiles of `first` and `second`, with its interval. The samples of
    /// both have the same random numbers. `None` without an interval.
    #[must_use]
    pub fn difference(&self, first: &[f64], second: &[f64]) -> Option<OrderStatistic> {
        if self.failed == FailedSamples::LeftOut {
            // A pair lacks its numbers where one of the two failed.
            let pairs = first.iter().zip(second);
            let pairs = pairs.filter(|(a, b)| a.is_finite() && b.is_finite());
            let (first, second): (Vec<f64>, Vec<f64>) = pairs.unzip();
            return stats::paired_difference(&first, &second, self.level(), CONFIDENCE).ok()?;
        }
        let (first, second) = (self.counted(first), self.counted(second));
        let difference =
            stats::paired_difference(&first, &second, self.level(), CONFIDENCE).ok()??;
        difference.value.is_finite().then_some(difference)
    }

    /// The fewest samples with which a verified percentile has an interval.
    #[must_use]
    pub fn verified_min_samples(&self) -> usize {
        stats::order_interval_min_samples(self.level(), CONFIDENCE)
    }

    /// The percentile of a design of the DoE from independent samples, by the campaign's rule. It is
    /// [infinitely bad](Self::failed_sample) if too many samples have failed.
    ///
    /// # Errors
    ///
    /// Too few samples, or one that is not a number.
    pub fn estimate(&self, samples: &[f64]) -> Result<stats::Choice, stats::Error> {
        match Self::count_failed(samples) {
            0 => self.estimate_at(samples, self.level()),
            failed => Ok(self.estimate_of_others(samples, failed)),
        }
    }

    /// The estimate at a level that need not be the campaign's.
    pub(super) fn estimate_at(
        &self,
        samples: &[f64],
        level: f64,
    ) -> Result<stats::Choice, stats::Error> {
        let rule = self.rule_of_percentile();
        let mut normal = self.normal();
        if level != self.level() {
            normal.z = stats::normal_quantile(level);
        }
        stats::choose_p90(
            samples,
            &stats::ChoiceRule {
                level,
                significance: match rule {
                    PercentileRule::Paper | PercentileRule::Normal => 0.0,
                    PercentileRule::HarrellDavis => 1.0,
                    PercentileRule::Chosen | PercentileRule::ChosenBootstrap => SIGNIFICANCE,
                },
                normal,
                harrell_davis: rule.harrell_davis().unwrap_or_default(),
            },
        )
    }

    /// The paper's estimate (8) of the percentile, for the comparison with its tables.
    ///
    /// # Errors
    ///
    /// Too few samples, or one that is not a number.
    pub fn papers_estimate(&self, samples: &[f64]) -> Result<stats::Percentile, stats::Error> {
        stats::normal_p90(samples, &self.paper())
    }

    /// The estimator of the percentile. If the file names none: `chosen`, which has the smallest error in the worst
    /// case, and `normal` for samples that depend on each other or have a control variate, for which `chosen` does
    /// not exist.
    #[must_use]
    pub fn rule_of_percentile(&self) -> PercentileRule {
        let is_plain = self.control == ControlVariate::None
            && self.coefficients == WearCoefficients::Independent;
        self.percentile.unwrap_or(match is_plain {
            true => PercentileRule::Chosen,
            false => PercentileRule::Normal,
        })
    }

    /// A warning if the estimator needs more samples at this level, or assumes normal ones far in the tail.
    pub(super) fn doubt(&self) -> Option<String> {
        let (k, level) = (self.samples_per_design, self.level());
        let name = self.percentile_name();
        let needed = stats::harrell_davis_min_samples(level);
        match self.rule_of_percentile().harrell_davis() {
            Some(_) if (k as usize) < needed => Some(format!(
                "sampling.samples_per_design is {k}: {name} of a design whose samples are not normal takes \
                 {needed}; with fewer it is m + z s as of normal samples, and may be far off"
            )),
            None if level.max(1.0 - level) > 0.95 => Some(format!(
                "{name} is estimated as m + z s, which assumes normal samples: of an exponential response it \
                 lies a standard deviation and more from the percentile; sampling.percentile = \"chosen\" \
                 with {needed} samples a design does not assume that"
            )),
            _ => None,
        }
    }

    /// The paper's estimate, which rounds z at the paper's level.
    fn paper(&self) -> NormalOptions {
        let of_paper = NormalOptions::default();
        let level = self.level();
        if level == Self::LEVEL {
            return of_paper;
        }
        NormalOptions {
            z: stats::normal_quantile(level),
            ..of_paper
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Campaign;

    #[test]
    fn the_percentile_has_the_name_and_the_z_of_its_level() {
        let parse = |more: &str| {
            let text = Campaign::PAPER
                .replace("compare_with_paper = true", "compare_with_paper = false")
                .replace("[sampling]\n", &format!("[sampling]\n{more}\n"));
            Campaign::parse("paper.toml", &text).map_err(|error| error.to_string())
        };
        let of = |level: &str| parse(&format!("level = {level}")).unwrap().sampling;
        assert_eq!(of("0.9").normal().z, stats::PAPER_Z90);
        assert_eq!(
            parse("level = 0.9").unwrap().digest(),
            parse("").unwrap().digest()
        );
        assert_eq!(of("0.9").percentile_columns()[1], "p90_low_um");
        let high = of("0.995");
        assert_eq!(high.percentile_name(), "P99.5");
        assert_eq!(high.percentile_columns()[0], "p99_5_um");
        // Tables of the normal distribution: z(0.995) = 2.575829.
        assert!((high.normal().z - 2.575_829).abs() < 1e-6);
        let samples: Vec<f64> = (0..40).map(f64::from).collect();
        // Too few for an interval, and by rank the largest of them.
        let verified = high.verified(&samples).unwrap();
        assert_eq!((verified.value, verified.interval), (39.0, None));
        assert_eq!(high.verified_min_samples(), 736);
        assert_eq!(of("0.1").percentile_name(), "P10");
        assert_eq!(of("0.1").normal().z, -stats::EXACT_Z90);
        for level in ["0.0", "1.0", "95"] {
            let error = parse(&format!("level = {level}")).unwrap_err();
            assert!(error.contains("sampling.level"), "{error}");
        }
        let text = Campaign::PAPER.replace("[sampling]\n", "[sampling]\nlevel = 0.95\n");
        let error = Campaign::parse("paper.toml", &text)
            .unwrap_err()
            .to_string();
        assert!(error.contains("compare_with_paper"), "{error}");
    }
}
