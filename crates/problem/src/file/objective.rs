//! `[objective]`: the measure of the random response, and its direction. A constraint on samples states a measure in
//! the same way.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stats::Measure;

use super::validate::Source;
use super::{Combination, FileError};

/// `[objective]`, optional: the measure of the response that is optimised. If absent, the percentile that 90 % of the
/// samples stay below is minimised.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Objective {
    /// The response that is measured; the first of `[[responses]]` if absent.
    pub response: Option<Combination>,
    /// Whether small or large values are preferred.
    #[serde(default)]
    pub aim: Aim,
    /// The measure of the response's random distribution.
    #[serde(default)]
    pub(super) measure: MeasureName,
    /// Level of a percentile or a superquantile, from 0.001 to 0.999; 0.9 if absent. Of a response that is
    /// maximised it is the share of the samples above the percentile: 0.9 stands for P10.
    pub(super) level: Option<f64>,
    /// Number of standard deviations of `"mean-plus-sd"`, which counts them towards the bad side: above the mean of
    /// a response that is minimised, below the mean of one that is maximised.
    pub(super) k: Option<f64>,
    /// Limit of `"exceedance"`, in the response's unit.
    pub(super) limit: Option<f64>,
}

/// The preferred values of the response.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Aim {
    /// Small values are good: the campaign minimises the measure, such as the percentile that 90 % of the samples
    /// stay below.
    #[default]
    Minimise,
    /// Large values are good: the response is taken with the opposite sign, so the campaign maximises the
    /// measure, such as the percentile that 90 % of the samples exceed.
    Maximise,
}

/// A measure of a random response.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MeasureName {
    /// The value that a share `level` of the samples stay below.
    #[default]
    Percentile,
    /// The expected value.
    Mean,
    /// The mean and `k` standard deviations.
    MeanPlusSd,
    /// The mean of the worst samples, those beyond the percentile at `level`: conditional value at risk (CVaR).
    Superquantile,
    /// The probability that the response exceeds `limit`. Minimised it is a probability of failure, maximised one of
    /// success.
    Exceedance,
}

/// The level of the paper's percentile.
const PAPERS_LEVEL: f64 = 0.9;
/// The paper's measure.
pub(super) const PAPERS: Measure = Measure::Percentile {
    level: PAPERS_LEVEL,
};

impl Objective {
    /// Minimises the percentile at `level`.
    #[must_use]
    pub const fn percentile(level: f64) -> Self {
        Self {
            response: None,
            aim: Aim::Minimise,
            measure: MeasureName::Percentile,
            level: Some(level),
            k: None,
            limit: None,
        }
    }

    /// The default measure with this aim.
    pub(super) fn of_aim(&self) -> Self {
        Self {
            aim: self.aim,
            ..Self::percentile(PAPERS_LEVEL)
        }
    }

    /// The measure and the limit that models and searches use in place of this measure and `limit`. They replace a
    /// probability by the equivalent percentile, which, unlike a small probability, can be estimated from few samples:
    /// P(y > 400) ≤ 0.01 exactly if P99 of y ≤ 400.
    #[must_use]
    pub fn searched(&self, limit: f64) -> (Self, f64) {
        if self.measure != MeasureName::Exceedance {
            return (self.clone(), limit);
        }
        let level = match self.aim {
            Aim::Minimise => ((1.0 - limit) * 1e9).round() / 1e9,
            Aim::Maximise => limit,
        };
        let percentile = Self {
            response: self.response.clone(),
            aim: self.aim,
            ..Self::percentile(level)
        };
        (percentile, self.limit.unwrap_or_default())
    }

    /// The objective with its defaults filled in.
    pub(super) fn resolved(self) -> Self {
        let has_level = matches!(
            self.measure,
            MeasureName::Percentile | MeasureName::Superquantile
        );
        Self {
            level: self.level.or(has_level.then_some(PAPERS_LEVEL)),
            ..self
        }
    }

    /// The measure of the response in the user's sign.
    #[must_use]
    pub fn measure(&self) -> Measure {
        let is_lower = self.aim == Aim::Maximise;
        let level = self.level.unwrap_or(PAPERS_LEVEL);
        let level = match is_lower {
            // 1 − 0.9 is not 0.1 to the last bit.
            true => ((1.0 - level) * 1e9).round() / 1e9,
            false => level,
        };
        let sign = if is_lower { -1.0 } else { 1.0 };
        match self.measure {
            MeasureName::Percentile => Measure::Percentile { level },
            MeasureName::Mean => Measure::Mean,
            MeasureName::MeanPlusSd => Measure::MeanPlusSd {
                k: sign * self.k.unwrap_or_default(),
            },
            MeasureName::Superquantile => Measure::TailMean { level, is_lower },
            MeasureName::Exceedance => Measure::Exceedance {
                limit: self.limit.unwrap_or_default(),
            },
        }
    }

    /// Whether it is the paper's: the 90th percentile is minimised.
    pub(super) fn is_papers(&self) -> bool {
        self.measure() == PAPERS
    }

    /// The level of a percentile.
    #[must_use]
    pub fn level(&self) -> Option<f64> {
        match self.measure() {
            Measure::Percentile { level } => Some(level),
            _ => None,
        }
    }

    /// The name of the measure: P90, P99.5, mean, mean + 3 sd, CVaR90, P(y > 5 mm). `response` is the response
    /// with a name and a unit.
    #[must_use]
    pub fn name(&self, [response, unit]: [&str; 2]) -> String {
        let space = if unit.is_empty() { "" } else { " " };
        match self.measure() {
            Measure::Percentile { level } => format!("P{}", hundred(level)),
            Measure::Mean => "mean".to_owned(),
            Measure::MeanPlusSd { k } if k < 0.0 => format!("mean − {} sd", -k),
            Measure::MeanPlusSd { k } => format!("mean + {k} sd"),
            Measure::TailMean { level, .. } => format!("CVaR{}", hundred(level)),
            Measure::Exceedance { limit } => {
                let limit = limit.to_string().replace('-', "−");
                format!("P({response} > {limit}{space}{unit})")
            }
        }
    }

    /// The prefix of columns with the measure: p90, p99_5, expected, mean_plus_sd, cvar90, exceedance.
    #[must_use]
    pub fn column(&self) -> String {
        match self.measure() {
            Measure::Percentile { level } => format!("p{}", hundred(level)).replace('.', "_"),
            // `mean` is the mean of a design's samples, whatever the measure.
            Measure::Mean => "expected".to_owned(),
            Measure::MeanPlusSd { k } if k < 0.0 => "mean_minus_sd".to_owned(),
            Measure::MeanPlusSd { .. } => "mean_plus_sd".to_owned(),
            Measure::TailMean { level, .. } => format!("cvar{}", hundred(level)).replace('.', "_"),
            Measure::Exceedance { .. } => "exceedance".to_owned(),
        }
    }

    /// Whether the measure is a probability, and not in the unit of the response.
    #[must_use]
    pub fn is_probability(&self) -> bool {
        self.measure == MeasureName::Exceedance
    }

    /// Checks the section `[objective]`.
    pub(super) fn validate(&self, source: Source<'_>, is_gears: bool) -> Result<(), FileError> {
        source.require(
            self.response.is_none() || !is_gears,
            "objective.response",
            &self.response,
            "absent for a gear pair, which has one",
        )?;
        source.require(
            self.aim == Aim::Minimise || !is_gears,
            "objective.aim",
            self.aim,
            "\"minimise\" for a gear pair: small transmission errors are good",
        )?;
        source.require(
            self.measure != MeasureName::Exceedance || !is_gears,
            "objective.measure",
            self.measure,
            "another measure for a gear pair, such as \"percentile\": tables and charts of gear campaigns show the measure in µm",
        )?;
        self.validate_measure(source, "objective")
    }

    /// Checks the keys of the measure in a section.
    pub(super) fn validate_measure(
        &self,
        source: Source<'_>,
        section: &str,
    ) -> Result<(), FileError> {
        use MeasureName::{Exceedance, MeanPlusSd, Percentile, Superquantile};
        let keys = [
            ("level", self.level, &[Percentile, Superquantile][..]),
            ("k", self.k, &[MeanPlusSd]),
            ("limit", self.limit, &[Exceedance]),
        ];
        for (key, value, measures) in keys {
            let key = format!("{section}.{key}");
            match value {
                Some(value) => {
                    let is_used = measures.contains(&self.measure);
                    let expected = match is_used {
                        true => "a finite number".to_owned(),
                        false => format!(
                            "absent beside measure = {}: it belongs to measure = {}",
                            listed(&[self.measure]),
                            listed(measures)
                        ),
                    };
                    source.require(is_used && value.is_finite(), &key, value, &expected)?;
                }
                // A missing level has a default.
                None if measures == [self.measure] => {
                    let expected = format!("given beside measure = {}", listed(measures));
                    return Err(source.missing(&key, &expected));
                }
                None => {}
            }
        }
        if let Some(level) = self.level {
            source.require(
                (0.001..=0.999).contains(&level),
                &format!("{section}.level"),
                level,
                "from 0.001 to 0.999: 0.9 stands for the 90th percentile",
            )?;
        }
        let key = format!("{section}.k");
        self.k
            .map_or(Ok(()), |k| source.within(&key, k, 0.0, 100.0, ""))
    }
}

/// A level in per cent, with six digits, so that 99.9 is not 99.90000000000001.
fn hundred(level: f64) -> f64 {
    (level * 1e6).round() / 1e4
}

/// The names of measures, as in the file.
fn listed(measures: &[MeasureName]) -> String {
    let name = |measure: &MeasureName| {
        serde_json::to_string(measure).expect("a name without data serialises")
    };
    measures.iter().map(name).collect::<Vec<_>>().join(" or ")
}
