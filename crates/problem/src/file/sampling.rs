//! `[sampling]`: the number of samples of a design, and the estimation of the measure.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stats::{HarrellDavisVariance, SequentialRule};

use super::validate::Source;
use super::{FileError, Objective};

/// `[sampling]`: how many samples a design gets, and how the measure is estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sampling {
    /// Number k of response samples per simulable design. With a precision, the size of the first
    /// batch.
    /// Left out beside `accuracy.tolerance_um`, which chooses it.
    #[serde(default)]
    #[schemars(extend("default" = null))]
    pub samples_per_design: u32,
    /// Target standard error of the measure, in its unit: each design gets samples until it is
    /// reached.
    pub precision: Option<f64>,
    /// Maximum number of samples of a design, with a precision.
    pub samples_max: Option<u32>,
    /// Constraint violation, summed as in equation (5) of the paper, above which a design gets no samples. If absent,
    /// 0 with a precision, and without one all simulable designs get samples.
    pub skip_violation: Option<f64>,
    /// The estimator of the measure. If absent, `"chosen"` for independent samples without a control variate, and
    /// `"normal"` for others.
    pub estimator: Option<EstimatorRule>,
    /// Control variate that reduces the variance of the measure.
    #[serde(default)]
    pub control: ControlVariate,
    /// The scheme by which the wear, or the random inputs, of a design's samples are drawn.
    #[serde(default)]
    pub coefficients: WearCoefficients,
    /// Number of samples in each sequence of quasi-random coefficients, a power of two; 8 if absent.
    pub group: Option<u32>,
    /// How a failed sample enters the measure; only with an external simulator. A sample has failed if its attempts are
    /// used up, or if the program answers `refused`, NaN or infinity.
    #[serde(default)]
    pub failed: FailedSamples,
    /// `[objective]`: the measure that is estimated.
    #[serde(skip)]
    pub objective: Objective,
}

/// The meaning of failed samples for the measure of their design.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FailedSamples {
    /// A failed sample counts as worse than every other: with 5 % of them P90 is the percentile of the
    /// others at 0.9/0.95, and a probability counts them as bad. A design has a percentile as long as that level is
    /// below 1. A design with a failed sample has no mean, no mean plus standard deviations and no superquantile.
    #[default]
    Worst,
    /// The measure is that of the samples that have not failed.
    LeftOut,
    /// A design with a failed sample has no measure.
    RefusesDesign,
    /// A sample whose attempts are used up quarantines its design, which waits for `coordinator retry` or for
    /// the same command again. An answer without a number is a failure, too.
    QuarantinesDesign,
}

/// The dependence between the coefficients of a design's samples: of the random wear (Karhunen–Loève), or of the
/// program's random inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WearCoefficients {
    /// The coefficients of every sample are independent.
    #[default]
    Independent,
    /// Pairs of samples have opposite signs. The variance of P90 comes from the scatter of the pairs.
    Antithetic,
    /// Groups of samples are scrambled Sobol sequences, independent of each other. The variance of P90
    /// comes from the scatter of the groups.
    QuasiRandom,
}

/// A response with known distribution that correlates with the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ControlVariate {
    /// No control variate.
    #[default]
    None,
    /// The part of ΔSTE that is linear in the coefficients of the wear. It
    /// costs two analyses per coefficient, about 26 per design. With random wear alone, the root mean square error of P90
    /// from 30 samples is an eighth of that without it in the median; with flank class 6 in `[manufacture]` it is six
    /// sevenths.
    Linearised,
}

/// The estimator of the measure of a design of the DoE or an infill point. `coordinator tradeoff` measures
/// their errors on normal and other responses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorRule {
    /// The paper's m + 1.28 s with the variance of (14). At another level z is exact.
    Paper,
    /// An unbiased m + z s, with exact z and the exact variance for normal samples.
    Normal,
    /// Harrell and Davis's estimator of a percentile with its jackknife variance, and the mean of the scores of any
    /// other measure, whatever the distribution; as `normal` if the samples are too few for the level.
    DistributionFree,
    /// Like `normal`, but like `distribution-free` if Lilliefors' test rejects normality. The default for independent samples.
    Chosen,
    /// Like `chosen`, with the exact bootstrap variance in place of the jackknife's. It has its own
    /// name because the variance decides about further samples and enters the models.
    ChosenBootstrap,
}

impl EstimatorRule {
    /// The variance estimate used for samples that are not normal; `None` if all are treated as
    /// normal.
    #[must_use]
    pub const fn harrell_davis(self) -> Option<HarrellDavisVariance> {
        match self {
            Self::Paper | Self::Normal => None,
            Self::DistributionFree | Self::Chosen => Some(HarrellDavisVariance::Jackknife),
            Self::ChosenBootstrap => Some(HarrellDavisVariance::Bootstrap),
        }
    }
}

impl Sampling {
    /// Default maximum number of samples of a design, with a precision.
    const SAMPLES_MAX: u32 = 1000;
    /// Default number of samples in a quasi-random sequence.
    const GROUP: u32 = 8;

    /// The settings for this objective.
    pub(super) fn of(self, objective: Objective) -> Self {
        Self {
            objective: objective.resolved(),
            ..self
        }
    }

    /// Degrees of freedom of a response's variance: the number of independent samples or groups of
    /// samples, less one for their mean.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> f64 {
        let groups = self.samples_per_design as usize / self.coefficients().group();
        groups.saturating_sub(1).max(1) as f64
    }

    /// The scheme by which the wear coefficients of a design's samples are drawn.
    #[must_use]
    pub fn coefficients(&self) -> stats::Sampling {
        match self.coefficients {
            WearCoefficients::Independent => stats::Sampling::Independent,
            WearCoefficients::Antithetic => stats::Sampling::Antithetic,
            WearCoefficients::QuasiRandom => stats::Sampling::Quasi {
                group: self.group.unwrap_or(Self::GROUP) as usize,
            },
        }
    }

    /// The stopping rule for a design's samples; `None` if all designs get the same number.
    #[must_use]
    pub fn rule(&self) -> Option<SequentialRule> {
        let normal = self.normal();
        self.precision.map(|precision| SequentialRule {
            precision,
            batch: self.samples_per_design as usize,
            most: self.samples_max() as usize,
            z: normal.z,
            variance: normal.variance,
        })
    }

    /// The maximum number of samples of a design.
    #[must_use]
    pub fn samples_max(&self) -> u32 {
        let k = self.samples_per_design;
        match self.precision {
            Some(_) => self.samples_max.unwrap_or(Self::SAMPLES_MAX).max(k),
            None => k,
        }
    }

    /// The constraint violation above which a design gets no samples; `None` if all simulable
    /// designs get some. With a precision the default is zero, so that a design that its
    /// constraints rule out gets none.
    #[must_use]
    pub fn skip_violation(&self) -> Option<f64> {
        self.skip_violation.or_else(|| self.precision.map(|_| 0.0))
    }

    /// Checks the section of a campaign whose program is external, and whose random effects are made of known
    /// scores.
    pub(super) fn validate(
        &self,
        source: Source<'_>,
        is_external: bool,
        has_scores: bool,
    ) -> Result<(), FileError> {
        let plain = self.control == ControlVariate::None;
        let rule = self.estimator_rule();
        source.require(
            is_external || self.failed == FailedSamples::default(),
            "sampling.failed",
            self.failed,
            "absent where the built-in model simulates, which never fails",
        )?;
        source.require(
            plain || !is_external,
            "sampling.control",
            self.control,
            "\"none\" where a program simulates: only the built-in model's response is linearised",
        )?;
        source.require(
            plain || rule.harrell_davis().is_none(),
            "sampling.estimator",
            rule,
            "\"paper\" or \"normal\" with a control variate: its estimate m + z s assumes a normal response",
        )?;
        source.require(
            rule != EstimatorRule::ChosenBootstrap || self.objective.level().is_some(),
            "sampling.estimator",
            rule,
            "another estimator, such as \"chosen\": only percentiles have a bootstrap variance, and the measure is not one",
        )?;
        let even = self.coefficients != WearCoefficients::Independent;
        source.require(
            !self.objective.is_probability() || plain && !even,
            "objective.measure",
            "exceedance",
            "another measure: with a control variate or dependent coefficients, probabilities cannot be \
             estimated from m + z s",
        )?;
        source.require(
            plain || self.precision.is_none(),
            "sampling.precision",
            self.precision,
            "absent with a control variate: every design then gets samples_per_design samples",
        )?;
        self.validate_coefficients(source, has_scores)?;
        source.count(
            "sampling.samples_per_design",
            self.samples_per_design,
            4,
            1_000_000,
        )?;
        if let Some(precision) = self.precision {
            source.positive("sampling.precision", precision)?;
        }
        if let Some(most) = self.samples_max {
            source.require(
                self.precision.is_some(),
                "sampling.samples_max",
                most,
                "left out, or beside sampling.precision: without a precision every design gets \
                 samples_per_design samples",
            )?;
            source.count(
                "sampling.samples_max",
                most,
                self.samples_per_design,
                1_000_000,
            )?;
        }
        if let Some(violation) = self.skip_violation {
            source.not_negative("sampling.skip_violation", violation)?;
        }
        Ok(())
    }

    fn validate_coefficients(&self, source: Source<'_>, has_scores: bool) -> Result<(), FileError> {
        let rule = self.estimator_rule();
        if let Some(group) = self.group {
            source.require(
                self.coefficients == WearCoefficients::QuasiRandom,
                "sampling.group",
                group,
                "left out, or beside coefficients = \"quasi-random\", whose sequences it is the \
                 length of",
            )?;
            source.require(
                group.is_power_of_two() && (2..=1024).contains(&group),
                "sampling.group",
                group,
                "a power of two from 2 to 1024",
            )?;
        }
        if self.coefficients == WearCoefficients::Independent {
            return Ok(());
        }
        let requirements = [
            (
                has_scores,
                "\"independent\" where a program draws its random effects itself: only the built-in model's wear \
                 and the inputs of [[random]] have coefficients",
            ),
            (
                self.control == ControlVariate::None,
                "\"independent\" with a control variate: its variance estimate requires independent samples",
            ),
            (
                self.precision.is_none(),
                "\"independent\" with sampling.precision: the batches of samples can then have any size",
            ),
            (
                rule.harrell_davis().is_none(),
                "\"independent\" with an estimator that tests for normality: the test requires independent samples",
            ),
        ];
        for (holds, expected) in requirements {
            source.require(holds, "sampling.coefficients", self.coefficients, expected)?;
        }
        let group = self.coefficients().group() as u32;
        let fewest = stats::GROUPED_MIN_GROUPS as u32 * group;
        let k = self.samples_per_design;
        source.require(
            k >= fewest && k.is_multiple_of(group),
            "sampling.samples_per_design",
            k,
            &format!(
                "a multiple of {group} from {fewest} on with these coefficients: the measure's variance \
                 comes from the scatter of whole groups of {group} samples"
            ),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::Campaign;

    fn parse(more: &str) -> Result<Campaign, String> {
        let line = "[sampling]\n";
        let text = Campaign::WEAR.replace(line, &format!("{line}{more}\n"));
        Campaign::parse("wear.toml", &text).map_err(|error| error.to_string())
    }

    #[test]
    fn a_campaign_without_the_new_keys_is_what_it_was() {
        let campaign = parse("").unwrap();
        assert_eq!(campaign.sampling.rule(), None);
        assert_eq!(campaign.sampling.skip_violation(), None);
        assert_eq!(campaign.sampling.samples_max(), 30);
    }

    #[test]
    fn even_coefficients_are_named_and_their_absence_changes_no_digest() {
        let coefficients = |more: &str| parse(more).unwrap().sampling.coefficients();
        assert_eq!(coefficients(""), stats::Sampling::Independent);
        assert_eq!(
            parse("coefficients = \"independent\"").unwrap().digest(),
            parse("").unwrap().digest()
        );
        let antithetic = "coefficients = \"antithetic\"";
        assert_eq!(coefficients(antithetic), stats::Sampling::Antithetic);
        assert_ne!(
            parse(antithetic).unwrap().digest(),
            parse("").unwrap().digest()
        );
        // 30 samples are 15 groups of 2.
        let quasi = "coefficients = \"quasi-random\"\ngroup = 2";
        assert_eq!(coefficients(quasi), stats::Sampling::Quasi { group: 2 });
    }

    #[test]
    fn infill_takes_independent_samples() {
        let text = include_str!("../../../../campaigns/enriched.toml");
        let even = text.replace(
            "[sampling]\n",
            "[sampling]\ncoefficients = \"antithetic\"\n",
        );
        assert_ne!(even, text);
        let error = Campaign::parse("enriched.toml", &even).unwrap_err();
        assert!(error.to_string().contains("beside [enrichment]"), "{error}");
    }

    #[test]
    fn a_precision_rules_out_what_breaks_a_constraint_unless_told_otherwise() {
        let sampling = parse("precision = 0.05").unwrap().sampling;
        assert_eq!(sampling.skip_violation(), Some(0.0));
        assert_eq!(sampling.samples_max(), 1000);
        let sampling = parse("precision = 0.05\nskip_violation = 0.5\nsamples_max = 90");
        let sampling = sampling.unwrap().sampling;
        assert_eq!(sampling.skip_violation(), Some(0.5));
        let rule = sampling.rule().unwrap();
        assert_eq!((rule.batch, rule.most, rule.precision), (30, 90, 0.05));
    }

    #[test]
    fn doubtful_values_are_refused_by_name() {
        for (text, said) in [
            ("coefficients = \"sobol\"", "coefficients"),
            ("group = 8", "sampling.group is 8"),
            (
                "coefficients = \"quasi-random\"\ngroup = 6",
                "a power of two",
            ),
            (
                "coefficients = \"quasi-random\"",
                "sampling.samples_per_design is 30, but must be a multiple of 8 from 32",
            ),
            (
                "coefficients = \"antithetic\"\ncontrol = \"linearised\"",
                "sampling.coefficients is \"antithetic\"",
            ),
            (
                "coefficients = \"antithetic\"\nprecision = 0.1",
                "sampling.coefficients is \"antithetic\"",
            ),
            (
                "coefficients = \"antithetic\"\nestimator = \"chosen\"",
                "sampling.coefficients is \"antithetic\"",
            ),
            ("precision = 0.0", "sampling.precision is 0.0"),
            ("samples_max = 50", "sampling.samples_max is 50"),
            (
                "precision = 1.0\nsamples_max = 29",
                "a whole number from 30",
            ),
            ("skip_violation = -0.1", "sampling.skip_violation is -0.1"),
            ("estimator = \"median\"", "estimator"),
            (
                "precision = 0.1\ncontrol = \"linearised\"",
                "sampling.precision is 0.1",
            ),
            (
                "estimator = \"chosen\"\ncontrol = \"linearised\"",
                "sampling.estimator is \"chosen\"",
            ),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(said) && error.contains("line"), "{error}");
        }
    }
}
