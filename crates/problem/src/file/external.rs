//! The sections of a campaign with `kind = "external"`: its problem is stated in the file and
//! simulated by a program of the user's.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// The sections that only external campaigns have.
#[derive(Debug, Clone, PartialEq)]
pub struct ExternalSections {
    /// `[[variables]]`, at least one.
    pub variables: Vec<VariableSection>,
    /// `[[constraints]]`
    pub constraints: Vec<ConstraintSection>,
    /// `[response]`
    pub response: ResponseSection,
}

/// A variable of the design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VariableSection {
    /// The name that the program uses.
    pub name: String,
    /// Its unit; empty for a number without one.
    #[serde(default)]
    pub unit: String,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
}

/// A deterministic response of the program, with limits that a feasible design satisfies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstraintSection {
    /// The name that the program uses.
    pub name: String,
    /// Its unit; empty for a number without one.
    #[serde(default)]
    pub unit: String,
    /// Smallest valid value.
    pub min: Option<f64>,
    /// Largest valid value.
    pub max: Option<f64>,
}

/// The random response whose measure is optimised.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResponseSection {
    /// The name that the program uses.
    pub name: String,
    /// Its unit; empty for a number without one.
    #[serde(default)]
    pub unit: String,
    /// Whether the program also computes the response without random effects.
    #[serde(default)]
    pub baseline: bool,
    /// Smallest plausible value: a smaller one is a failure of its sample.
    pub min: Option<f64>,
    /// Largest plausible value: a larger one is a failure of its sample.
    pub max: Option<f64>,
}

/// Names with another meaning in requests, answers and exported tables.
const RESERVED: [&str; 21] = [
    "id",
    "refused",
    "error",
    "design",
    "sample",
    "seed",
    "request",
    "simulable",
    "feasible",
    "samples",
    "reason",
    "point",
    "round",
    "violation",
    "failed",
    "approach",
    "start",
    "evaluation",
    "criterion",
    "simulator_calls",
    "cpu_seconds",
];

impl ExternalSections {
    /// Checks the sections. `measure` is the prefix of columns with the measure.
    pub(super) fn validate(&self, source: Source<'_>, measure: &str) -> Result<(), FileError> {
        let is_column = |name: &str| {
            let rest = name.strip_prefix(measure);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
        };
        let mut names = BTreeSet::new();
        let mut named = |section: &str, name: &str, unit: &str| {
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            source.require(
                !name.is_empty() && name.len() <= 64 && name.chars().all(plain),
                &format!("{section}.name"),
                name,
                "1 to 64 letters, digits, hyphens or underscores",
            )?;
            source.require(
                !RESERVED.contains(&name) && !is_column(name),
                &format!("{section}.name"),
                name,
                "another name: requests, answers and tables use this one for something else",
            )?;
            source.require(
                names.insert(name.to_owned()),
                &format!("{section}.name"),
                name,
                "a name that no other variable, constraint or response has",
            )?;
            source.require(
                unit.chars().count() <= 16 && !unit.chars().any(char::is_control),
                &format!("{section}.unit"),
                unit,
                "at most 16 characters",
            )
        };
        source.require(
            (1..=doe::MAX_VARIABLES).contains(&self.variables.len()),
            "variables",
            self.variables.len(),
            &format!("1 to {} sections [[variables]]", doe::MAX_VARIABLES),
        )?;
        for (index, variable) in self.variables.iter().enumerate() {
            let section = format!("variables[{}]", index + 1);
            named(&section, &variable.name, &variable.unit)?;
            let (low, high) = (variable.low, variable.high);
            source.require(
                low.is_finite(),
                &format!("{section}.low"),
                low,
                "a finite number",
            )?;
            source.require(
                high.is_finite() && low < high && (high - low).is_finite(),
                &format!("{section}.high"),
                high,
                &format!("a finite number above low, which is {low:?}"),
            )?;
        }
        for (index, constraint) in self.constraints.iter().enumerate() {
            let section = format!("constraints[{}]", index + 1);
            named(&section, &constraint.name, &constraint.unit)?;
            let limits = [constraint.min, constraint.max];
            if limits == [None, None] {
                let key = format!("{section}.max");
                return Err(source.missing(&key, "given, or min, or both"));
            }
            check_limits(source, &section, limits)?;
        }
        let response = &self.response;
        named("response", &response.name, &response.unit)?;
        check_limits(source, "response", [response.min, response.max])
    }
}

/// Requires that limits, the smallest and the largest value, leave a range.
fn check_limits(
    source: Source<'_>,
    section: &str,
    [min, max]: [Option<f64>; 2],
) -> Result<(), FileError> {
    for (key, limit) in [("min", min), ("max", max)] {
        source.require(
            limit.is_none_or(f64::is_finite),
            &format!("{section}.{key}"),
            limit.unwrap_or_default(),
            "a finite number",
        )?;
    }
    if let (Some(min), Some(max)) = (min, max) {
        source.require(
            min < max,
            &format!("{section}.max"),
            max,
            &format!("a number above min, which is {min:?}"),
        )?;
    }
    Ok(())
}
