//! The sections of a campaign with `kind = "external"`: its problem is stated in the file and
//! simulated by a program of the user's.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::Source;
use super::{
    Combination, ConstraintSection, CorrelationSection, FileError, Objective, RandomSection,
    ResponseSection, ResultLine, Sampling, Verify,
};
use crate::quantity::Quantity;

/// The sections that only external campaigns have.
#[derive(Debug, Clone, PartialEq)]
pub struct ExternalSections {
    /// `[[variables]]`, at least one.
    pub variables: Vec<VariableSection>,
    /// `[[constraints]]`
    pub constraints: Vec<ConstraintSection>,
    /// `[[random]]`
    pub random: Vec<RandomSection>,
    /// `[[correlations]]`
    pub correlations: Vec<CorrelationSection>,
    /// `[[responses]]`, at least one.
    pub responses: Vec<ResponseSection>,
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
    /// Lower bound; with `values` it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// Upper bound. Equal to the lower one, it fixes the variable.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
    /// Whether only whole numbers are possible, such as numbers of teeth.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub integer: bool,
    /// The possible values in increasing order, such as standard modules.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<f64>>,
}

/// The values that a variable may take.
#[derive(Debug, Clone, PartialEq)]
pub enum Domain {
    /// Only this one.
    Fixed(f64),
    /// All from the first to the second.
    Continuous([f64; 2]),
    /// Only these, two or more in increasing order.
    Discrete(Vec<f64>),
}

/// The most values of a discrete variable.
const MOST_VALUES: usize = 1000;

impl VariableSection {
    /// The values that the variable may take.
    #[must_use]
    pub fn domain(&self) -> Domain {
        let values = match (&self.values, self.low, self.high) {
            (Some(values), ..) => values.clone(),
            (None, Some(low), Some(high)) if low == high => vec![low],
            (None, Some(low), Some(high)) if self.integer => {
                // At most MOST_VALUES, exact in 64 bits.
                let count = (high - low) as usize;
                (0..=count).map(|step| low + step as f64).collect()
            }
            (None, low, high) => {
                return Domain::Continuous([low.unwrap_or_default(), high.unwrap_or_default()]);
            }
        };
        match values[..] {
            [fixed] => Domain::Fixed(fixed),
            _ => Domain::Discrete(values),
        }
    }

    fn validate(&self, source: Source<'_>, section: &str) -> Result<(), FileError> {
        if let Some(values) = &self.values {
            let key = format!("{section}.values");
            let is_sorted = values.windows(2).all(|pair| pair[0] < pair[1]);
            source.require(
                !values.is_empty() && values.iter().all(|value| value.is_finite()) && is_sorted,
                &key,
                values,
                "finite numbers in increasing order",
            )?;
            source.require(
                self.low.is_none() && self.high.is_none() && !self.integer,
                &key,
                values,
                "the only key about the variable's range: without low, high and integer",
            )?;
            return source.require(
                values.len() <= MOST_VALUES,
                &key,
                values.len(),
                &format!("at most {MOST_VALUES} values"),
            );
        }
        let [low_key, high_key] = ["low", "high"].map(|end| format!("{section}.{end}"));
        let Some(low) = self.low else {
            return Err(source.missing(&low_key, "given: a variable needs low and high, or values"));
        };
        let Some(high) = self.high else {
            return Err(source.missing(&high_key, "given together with low"));
        };
        const FINITE: &str = "a finite number. For a variable without a bound, give the widest range that makes sense; \
                              for one that ranges over decades, make its logarithm the variable";
        source.require(low.is_finite(), &low_key, low, FINITE)?;
        source.require(high.is_finite(), &high_key, high, FINITE)?;
        source.require(
            low <= high && (high - low).is_finite(),
            &high_key,
            high,
            &format!("a number from low, which is {low:?}, up; equal to it, it fixes the variable"),
        )?;
        if !self.integer {
            return Ok(());
        }
        for (key, bound) in [(&low_key, low), (&high_key, high)] {
            let is_whole = bound.fract() == 0.0 && bound.abs() < 1e15;
            source.require(is_whole, key, bound, "a whole number beside integer = true")?;
        }
        source.require(
            high - low < MOST_VALUES as f64,
            &high_key,
            high,
            &format!(
                "at most {MOST_VALUES} values from low: a variable with more is as good as continuous"
            ),
        )
    }
}

/// Most values of a sample.
const MOST_RESPONSES: usize = 64;

/// Names with another meaning in requests, answers and exported tables.
const RESERVED: [&str; 22] = [
    "id",
    "refused",
    "error",
    "design",
    "sample",
    "random",
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
    /// The name and the unit of a response or of a combination of responses; those of the first response for `None`.
    pub(crate) fn response_of(&self, response: Option<&Combination>) -> Quantity {
        Combination::quantity(response, &self.responses)
    }

    /// Advice about constraints on measures of samples that are valid but doubtful.
    pub(super) fn warnings(&self, sampling: &Sampling, verify: &Verify) -> Vec<String> {
        let constraints = self.constraints.iter();
        let of = |one: &ConstraintSection| one.warnings(&self.responses, sampling, verify);
        constraints.flat_map(of).collect()
    }

    /// Checks the sections, and that the response of the objective is one of them.
    pub(super) fn validate(
        &self,
        source: Source<'_>,
        objective: &Objective,
    ) -> Result<(), FileError> {
        let measure = &*objective.column();
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
                "a name that no other variable, constraint, random input or response has",
            )?;
            source.require(
                unit.chars().count() <= 16 && !unit.chars().any(char::is_control),
                &format!("{section}.unit"),
                unit,
                "at most 16 characters",
            )
        };
        source.require(
            (1..=MOST_RESPONSES).contains(&self.responses.len()),
            "responses",
            self.responses.len(),
            &format!("1 to {MOST_RESPONSES} sections [[responses]]"),
        )?;
        source.require(
            (1..=doe::MAX_VARIABLES).contains(&self.variables.len()),
            "variables",
            self.variables.len(),
            &format!("1 to {} sections [[variables]]", doe::MAX_VARIABLES),
        )?;
        for (index, variable) in self.variables.iter().enumerate() {
            let section = format!("variables[{}]", index + 1);
            named(&section, &variable.name, &variable.unit)?;
            variable.validate(source, &section)?;
        }
        let is_free = |variable: &VariableSection| !matches!(variable.domain(), Domain::Fixed(_));
        source.require(
            self.variables.iter().any(is_free),
            "variables",
            "fixed",
            "at least one that is not fixed",
        )?;
        for (index, constraint) in self.constraints.iter().enumerate() {
            let section = format!("constraints[{}]", index + 1);
            named(&section, &constraint.name, &constraint.unit)?;
            constraint.validate(source, &section, &self.responses)?;
        }
        let mut deterministic = self.constraints.iter().filter(|one| one.measure.is_none());
        let first = deterministic.next().is_some_and(|one| one.cheap);
        source.require(
            deterministic.all(|one| one.cheap == first),
            "constraints",
            "partly cheap",
            "all cheap or none: one call of the program evaluates them all",
        )?;
        for (index, input) in self.random.iter().enumerate() {
            let section = format!("random[{}]", index + 1);
            named(&section, &input.name, &input.unit)?;
            let variables: Vec<&str> = self.variables.iter().map(|one| &*one.name).collect();
            input.validate(source, &section, &variables)?;
        }
        CorrelationSection::validate(&self.correlations, source, &self.random)?;
        for (index, response) in self.responses.iter().enumerate() {
            let section = format!("responses[{}]", index + 1);
            named(&section, &response.name, &response.unit)?;
            source.limits(&section, [response.min, response.max])?;
            let is_of_objective = self.is_of_objective(&response.name, objective);
            source.require(
                !response.baseline || is_of_objective,
                &format!("{section}.baseline"),
                response.baseline,
                "absent: a response can have a baseline only if it alone is the objective",
            )?;
        }
        let combination = objective.response.as_ref();
        combination.map_or(Ok(()), |of| {
            of.validate(source, "objective.response", &self.responses)
        })
    }

    /// Checks that `simulator.read`, if it has entries, has one for each response and no others except `refused`.
    pub(super) fn validate_read(
        &self,
        source: Source<'_>,
        read: &BTreeMap<String, ResultLine>,
    ) -> Result<(), FileError> {
        let limits = self.constraints.iter().filter(|one| one.measure.is_none());
        let limits = limits.map(|one| &*one.name);
        let responses = self.responses.iter().map(|one| &*one.name);
        let names: BTreeSet<&str> = responses.chain(limits).collect();
        let lacks = names.iter().find(|name| !read.contains_key(**name));
        if let (false, Some(lacks)) = (read.is_empty(), lacks) {
            let expected =
                "given: simulator.read must have the place of every response in the result file";
            return Err(source.missing(&format!("simulator.read.{lacks}"), expected));
        }
        let unknown = read
            .keys()
            .find(|name| !names.contains(&***name) && *name != "refused");
        unknown.map_or(Ok(()), |name| {
            let known = names.into_iter().collect::<Vec<_>>().join(", ");
            let key = format!("simulator.read.{name}");
            Err(source.refuse(&key, name, format!("one of the responses: {known}")))
        })
    }

    /// Whether the objective is of this response alone.
    fn is_of_objective(&self, name: &str, objective: &Objective) -> bool {
        match &objective.response {
            None => self.responses[0].name == name,
            Some(Combination::One(of)) => of == name,
            Some(Combination::Several(_)) => false,
        }
    }
}
