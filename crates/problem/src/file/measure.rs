//! The measure of a set of samples: its estimates and its interval. Nothing else computes one.

use stats::{IntervalEstimate, Measure, NormalOptions, VarianceFormula};

use super::objective::PAPERS;
use super::{ControlVariate, EstimatorRule, FailedSamples, Sampling, WearCoefficients};

/// Significance level of Lilliefors' test, as in the paper.
pub const SIGNIFICANCE: f64 = 0.05;
/// Confidence of the intervals of verified measures.
const CONFIDENCE: f64 = 0.95;

impl Sampling {
    /// The measure of the response, in the user's sign.
    #[must_use]
    pub fn measure(&self) -> Measure {
        self.objective.measure()
    }

    /// The prefix of columns with the measure: p90, expected.
    #[must_use]
    pub fn measure_column(&self) -> String {
        self.objective.column()
    }

    /// The names of a gear pair's columns with the measure and its interval: p90_um, p90_low_um,
    /// p90_high_um.
    #[must_use]
    pub fn measure_columns(&self) -> [String; 3] {
        let name = self.measure_column();
        ["um", "low_um", "high_um"].map(|end| format!("{name}_{end}"))
    }

    /// The options of the estimate from normal samples, by the campaign's rule. The z of a probability is 0.
    #[must_use]
    pub fn normal(&self) -> NormalOptions {
        self.normal_of(self.measure())
    }

    fn normal_of(&self, measure: Measure) -> NormalOptions {
        let z = measure.normal_factor().unwrap_or_default();
        match self.estimator_rule() {
            EstimatorRule::Paper if measure == PAPERS => NormalOptions::default(),
            EstimatorRule::Paper => NormalOptions {
                z,
                ..NormalOptions::default()
            },
            _ => NormalOptions {
                z,
                variance: VarianceFormula::Exact,
                unbiased: true,
            },
        }
    }

    /// The measure of verification samples, with a 95 % interval that assumes no distribution. Every table,
    /// page and decision takes the measure of a verified design from here.
    ///
    /// # Errors
    ///
    /// Those of [`Measure::verified`].
    pub fn verified(&self, samples: &[f64]) -> Result<IntervalEstimate, stats::Error> {
        self.verified_at(samples, CONFIDENCE)
    }

    /// Like [`verified`](Self::verified), with an interval of this confidence.
    pub(crate) fn verified_at(
        &self,
        samples: &[f64],
        confidence: f64,
    ) -> Result<IntervalEstimate, stats::Error> {
        self.measure().verified(&self.counted(samples), confidence)
    }

    /// The difference of the verified measures of `first` and `second`, with its interval. The samples of
    /// both have the same random numbers. `None` without an interval.
    #[must_use]
    pub fn difference(&self, first: &[f64], second: &[f64]) -> Option<IntervalEstimate> {
        let measure = self.measure();
        if self.failed == FailedSamples::LeftOut {
            // A pair of samples is left out if one of the two failed.
            let pairs = first.iter().zip(second);
            let pairs = pairs.filter(|(a, b)| a.is_finite() && b.is_finite());
            let (first, second): (Vec<f64>, Vec<f64>) = pairs.unzip();
            return measure.difference(&first, &second, CONFIDENCE).ok()?;
        }
        let (first, second) = (self.counted(first), self.counted(second));
        let difference = measure.difference(&first, &second, CONFIDENCE).ok()??;
        difference.value.is_finite().then_some(difference)
    }

    /// The fewest samples with which a verified measure has an interval.
    #[must_use]
    pub fn verified_min_samples(&self) -> usize {
        self.measure().interval_min_samples(CONFIDENCE)
    }

    /// The measure of a design of the DoE from independent samples, by the campaign's rule. It is
    /// [infinitely bad](Self::failed_sample) if too many samples have failed.
    ///
    /// # Errors
    ///
    /// Too few samples, or one that is not a number.
    pub fn estimate(&self, samples: &[f64]) -> Result<stats::Choice, stats::Error> {
        match Self::count_failed(samples) {
            0 => self.estimate_of(samples, self.measure()),
            failed => Ok(self.estimate_of_others(samples, failed)),
        }
    }

    /// The estimate of a measure that need not be the campaign's.
    pub(super) fn estimate_of(
        &self,
        samples: &[f64],
        measure: Measure,
    ) -> Result<stats::Choice, stats::Error> {
        let rule = self.estimator_rule();
        stats::choose(
            samples,
            &stats::ChoiceRule {
                measure,
                significance: match rule {
                    EstimatorRule::Paper | EstimatorRule::Normal => 0.0,
                    EstimatorRule::DistributionFree => 1.0,
                    EstimatorRule::Chosen | EstimatorRule::ChosenBootstrap => SIGNIFICANCE,
                },
                normal: self.normal_of(measure),
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
        stats::normal_p90(
            samples,
            &Self {
                estimator: Some(EstimatorRule::Paper),
                ..self.clone()
            }
            .normal(),
        )
    }

    /// The estimator of the measure. If the file names none: `chosen`, which has the smallest error in the worst
    /// case, and `normal` for samples that depend on each other or have a control variate, for which `chosen` does
    /// not exist.
    #[must_use]
    pub fn estimator_rule(&self) -> EstimatorRule {
        let is_plain = self.control == ControlVariate::None
            && self.coefficients == WearCoefficients::Independent;
        self.estimator.unwrap_or(match is_plain {
            true => EstimatorRule::Chosen,
            false => EstimatorRule::Normal,
        })
    }

    /// A warning if the estimator needs more samples for this measure, or assumes normal ones far in the tail.
    pub(super) fn doubt(&self, name: &str) -> Option<String> {
        let k = self.samples_per_design;
        let (level, needed) = match self.measure() {
            Measure::Percentile { level } | Measure::TailMean { level, .. } => {
                (level, self.measure().free_min_samples())
            }
            Measure::Exceedance { .. } => {
                return Some(format!(
                    "{name} of a design is estimated from {k} samples: a probability far below 1/{k} is that of a \
                     normal response, or (0 + ½)/({k} + 1) where the samples are not normal"
                ));
            }
            Measure::Mean | Measure::MeanPlusSd { .. } => return None,
        };
        match self.estimator_rule().harrell_davis() {
            Some(_) if (k as usize) < needed => Some(format!(
                "sampling.samples_per_design is {k}: {name} of a design whose samples are not normal takes \
                 {needed}; with fewer it is m + z s as of normal samples, and may be far off"
            )),
            None if level.max(1.0 - level) > 0.95 => Some(format!(
                "{name} is estimated as m + z s, which assumes normal samples: of an exponential response it \
                 lies a standard deviation and more from the percentile; sampling.estimator = \"chosen\" \
                 with {needed} samples a design does not assume that"
            )),
            Some(_) => self.doubt_of_tail(name),
            _ => None,
        }
    }

    /// A warning if the mean of a tail is that of few samples.
    fn doubt_of_tail(&self, name: &str) -> Option<String> {
        let Measure::TailMean { level, is_lower } = self.measure() else {
            return None;
        };
        let share = if is_lower { level } else { 1.0 - level };
        let k = self.samples_per_design;
        let needed = (FEW_OF_TAIL / share - 1e-6).ceil();
        (f64::from(k) < needed).then(|| {
            format!(
                "sampling.samples_per_design is {k}: the tail of {name} then has {:.1} samples of a design, and where it is \
                 heavy, the estimate and its standard error are too small; {needed} samples a design have \
                 {FEW_OF_TAIL} in the tail",
                share * f64::from(k)
            )
        })
    }
}

/// Number of samples in a tail below which its mean is doubtful.
const FEW_OF_TAIL: f64 = 10.0;

#[cfg(test)]
mod tests {
    use crate::Campaign;

    #[test]
    fn the_percentile_has_the_name_and_the_z_of_its_level() {
        let parse = |more: &str| {
            let text = Campaign::PAPER
                .replace("compare_with_paper = true", "compare_with_paper = false")
                .replace(
                    "[sampling]\n",
                    &format!("[objective]\n{more}\n[sampling]\n"),
                );
            Campaign::parse("paper.toml", &text).map_err(|error| error.to_string())
        };
        let of = |level: &str| parse(&format!("level = {level}")).unwrap().sampling;
        assert_eq!(of("0.9").normal().z, stats::PAPER_Z90);
        assert_eq!(
            parse("level = 0.9").unwrap().digest(),
            parse("").unwrap().digest()
        );
        assert_eq!(of("0.9").measure_columns()[1], "p90_low_um");
        let high = of("0.995");
        assert_eq!(high.objective.name(["y", "mm"]), "P99.5");
        assert_eq!(high.measure_columns()[0], "p99_5_um");
        // Tables of the normal distribution: z(0.995) = 2.575829.
        assert!((high.normal().z - 2.575_829).abs() < 1e-6);
        let samples: Vec<f64> = (0..40).map(f64::from).collect();
        // 40 samples are too few for an interval, and the percentile is the largest of them.
        let verified = high.verified(&samples).unwrap();
        assert_eq!((verified.value, verified.interval), (39.0, None));
        assert_eq!(high.verified_min_samples(), 736);
        assert_eq!(of("0.1").objective.name(["y", ""]), "P10");
        assert_eq!(of("0.1").normal().z, -stats::EXACT_Z90);
        for level in ["0.0", "1.0", "95"] {
            let error = parse(&format!("level = {level}")).unwrap_err();
            assert!(error.contains("objective.level"), "{error}");
        }
        let text =
            Campaign::PAPER.replace("[sampling]\n", "[objective]\nlevel = 0.95\n[sampling]\n");
        let error = Campaign::parse("paper.toml", &text)
            .unwrap_err()
            .to_string();
        assert!(error.contains("compare_with_paper"), "{error}");
    }
}
