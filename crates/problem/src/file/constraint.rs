//! `[[constraints]]` of an external campaign: limits of deterministic responses and of measures of samples.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::Source;
use super::{
    Aim, Combination, FileError, MeasureName, Objective, ResponseSection, Sampling, Verify,
};

/// A limit that a feasible design keeps: on a deterministic response of the program, or, with `measure`, on a measure of
/// its samples.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstraintSection {
    /// The name of the deterministic response, which the program uses; of a constraint on samples, a name for tables.
    pub name: String,
    /// Its unit; empty for a number without one. A measure of samples has the unit of its response.
    #[serde(default)]
    pub unit: String,
    /// Smallest valid value.
    pub min: Option<f64>,
    /// Largest valid value. A constraint on samples has one of the two.
    pub max: Option<f64>,
    /// Whether the program takes next to no time for the deterministic responses. A search on the model then calls the
    /// program for every candidate. Otherwise the responses are modelled, and the program is called for promising candidates.
    /// All constraints on deterministic responses have the same value.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub cheap: bool,
    /// The measure of the samples that is limited; absent for a deterministic response.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measure: Option<MeasureName>,
    /// The response that is measured; the first of `[[responses]]` if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub response: Option<Combination>,
    /// Level of a percentile or a superquantile, as in `[objective]`: with `max` the share of the samples below it, with
    /// `min` the share above it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level: Option<f64>,
    /// Number of standard deviations of `"mean-plus-sd"`, towards the limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k: Option<f64>,
    /// The value of the response whose probability of being exceeded is limited by `max` or `min`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
}

impl ConstraintSection {
    /// The measure that is limited; `None` for a deterministic response.
    #[must_use]
    pub fn limited(&self) -> Option<Objective> {
        let limited = Objective {
            response: self.response.clone(),
            aim: match self.max {
                Some(_) => Aim::Minimise,
                None => Aim::Maximise,
            },
            measure: self.measure?,
            level: self.level,
            k: self.k,
            limit: self.limit,
        };
        Some(limited.resolved())
    }

    /// The limit of a measure.
    pub(crate) fn limit_of_measure(&self) -> Option<f64> {
        self.max.or(self.min)
    }

    /// The smallest number of samples that show with a confidence of 95 % that a probability keeps its limit if none of
    /// them is on the bad side. `None` for another measure.
    fn samples_to_show(&self) -> Option<u32> {
        self.limited().filter(Objective::is_probability)?;
        let bad = match (self.max, self.min) {
            (Some(max), _) => max,
            (None, min) => 1.0 - min?,
        };
        Some((0.05_f64.ln() / (1.0 - bad).ln()).ceil() as u32)
    }

    pub(super) fn validate(
        &self,
        source: Source<'_>,
        section: &str,
        responses: &[ResponseSection],
    ) -> Result<(), FileError> {
        let key = |key: &str| format!("{section}.{key}");
        let limits = [self.min, self.max];
        if limits == [None, None] {
            return Err(source.missing(&key("max"), "given, or min, or both"));
        }
        source.limits(section, limits)?;
        let Some(limited) = self.limited() else {
            let given = [
                ("response", self.response.is_some()),
                ("level", self.level.is_some()),
                ("k", self.k.is_some()),
                ("limit", self.limit.is_some()),
            ];
            let beside = given.iter().find(|(_, is_given)| *is_given);
            return match beside {
                None => Ok(()),
                Some(_) => Err(source.missing(
                    &key("measure"),
                    "given for a constraint on samples, such as \"percentile\" or \"exceedance\"",
                )),
            };
        };
        source.require(
            !self.cheap,
            &key("cheap"),
            self.cheap,
            "absent with measure: a measure needs samples, which are not cheap",
        )?;
        if let [Some(min), Some(_)] = limits {
            let expected = "absent beside max: two limits of a measure are two constraints";
            return Err(source.refuse(&key("min"), min, expected));
        }
        if !self.unit.is_empty() {
            let expected = "absent: a measure has the unit of its response";
            return Err(source.refuse(&key("unit"), &self.unit, expected));
        }
        limited.validate_measure(source, section)?;
        if let Some(response) = &self.response {
            response.validate(source, &key("response"), responses)?;
        }
        if limited.is_probability() {
            let (name, limit) = match limits {
                [Some(min), _] => ("min", min),
                [_, max] => ("max", max.unwrap_or_default()),
            };
            let expected = "a probability from 0.000001 to 0.999999";
            let is_probability = (1e-6..=1.0 - 1e-6).contains(&limit);
            source.require(is_probability, &key(name), limit, expected)?;
        }
        Ok(())
    }

    /// Advice about a constraint on a measure of samples that is valid but doubtful.
    pub(super) fn warnings(
        &self,
        responses: &[ResponseSection],
        sampling: &Sampling,
        verify: &Verify,
    ) -> Vec<String> {
        let (Some(stated), Some(limit)) = (self.limited(), self.limit_of_measure()) else {
            return Vec::new();
        };
        let response = Combination::quantity(stated.response.as_ref(), responses);
        let named = |objective: &Objective| objective.name([&response.name, &response.unit]);
        let (searched, _) = stated.searched(limit);
        let name = format!("{}, the constraint {:?},", named(&searched), self.name);
        let doubt = sampling.clone().of(searched).doubt(&name);
        let verified = verify.first();
        let too_few = self.samples_to_show().filter(|needed| verified < *needed);
        let too_few = too_few.map(|needed| {
            format!(
                "verify.samples is {verified}: to show with a confidence of 95 % that {} keeps its limit of {limit} takes \
                 at least {needed}, none of them on the bad side",
                named(&stated)
            )
        });
        doubt.into_iter().chain(too_few).collect()
    }
}
