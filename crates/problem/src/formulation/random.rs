//! The random inputs of an external problem: from independent standard normal scores to the values that a program gets.

use stats::{Copula, Family, Marginal};

use super::{Design, Quantity};
use crate::file::{CorrelationSection, Formula, Parameter, RandomSection};

/// The short name of the reason for a design at which a random input has no distribution.
const NO_DISTRIBUTION: &str = "random-input";

/// The random inputs of a problem.
#[derive(Debug, Clone)]
pub struct RandomInputs {
    inputs: Vec<Input>,
    quantities: Vec<Quantity>,
    copula: Copula,
}

#[derive(Debug, Clone)]
struct Input {
    name: String,
    family: Family,
    /// In the order of the family's names.
    parameters: Vec<Value>,
    /// The values of a table, sorted.
    values: Vec<f64>,
}

#[derive(Debug, Clone)]
enum Value {
    Number(f64),
    Formula(Box<Formula>),
}

impl RandomInputs {
    /// The inputs of these sections, which are valid; `None` without any.
    pub(super) fn new(
        sections: &[RandomSection],
        correlations: &[CorrelationSection],
        variables: &[&str],
    ) -> Option<Self> {
        if sections.is_empty() {
            return None;
        }
        let quantity = |one: &RandomSection| Quantity::new(&one.name, &one.unit);
        let copula = CorrelationSection::copula(correlations, sections);
        Some(Self {
            inputs: sections
                .iter()
                .map(|section| Input::new(section, variables))
                .collect(),
            quantities: sections.iter().map(quantity).collect(),
            copula: copula.expect("validation has made it, too"),
        })
    }

    /// The names and units, in the order of the values.
    #[must_use]
    pub fn quantities(&self) -> &[Quantity] {
        &self.quantities
    }

    /// The values at a design for these independent standard normal scores.
    ///
    /// # Errors
    ///
    /// The reason why the design is not simulable: the parameters of an input make no distribution there.
    pub fn values(&self, design: &Design, scores: &[f64]) -> Result<Vec<f64>, String> {
        let scores = self.copula.correlated(scores);
        let mut inputs = self.inputs.iter().zip(scores);
        inputs.try_fold(Vec::new(), |mut values, (input, z)| {
            values.push(input.at(design)?.quantile(z));
            Ok(values)
        })
    }

    /// The means of the inputs at a design. Evaluations without random effects use them.
    ///
    /// # Errors
    ///
    /// As [`values`](Self::values).
    pub fn means(&self, design: &Design) -> Result<Vec<f64>, String> {
        let mean = |input: &Input| Ok(input.at(design)?.mean());
        self.inputs.iter().map(mean).collect()
    }
}

impl Input {
    fn new(section: &RandomSection, variables: &[&str]) -> Self {
        let family = section.distribution;
        let value = |key: &&str| match section.parameter(key)? {
            Parameter::Number(number) => Some(Value::Number(*number)),
            Parameter::Formula(text) => {
                let formula = Formula::parse(text, variables);
                let formula = formula.expect("validation has parsed it, too");
                Some(Value::Formula(Box::new(formula)))
            }
        };
        let mut values = section.values.clone().unwrap_or_default();
        values.sort_by(f64::total_cmp);
        Self {
            name: section.name.clone(),
            family,
            parameters: family.parameters().iter().filter_map(value).collect(),
            values,
        }
    }

    /// The distribution at a design.
    fn at(&self, design: &Design) -> Result<Marginal<'_>, String> {
        let number = |value: &Value| match value {
            Value::Number(number) => *number,
            Value::Formula(formula) => formula.at(design.values()),
        };
        let parameters: Vec<f64> = self.parameters.iter().map(number).collect();
        Marginal::new(self.family, &parameters, &self.values).ok_or_else(|| {
            let named = self.family.parameters().iter().zip(&parameters);
            let named: Vec<String> = named
                .map(|(key, value)| format!("{key} = {value}"))
                .collect();
            let (name, given, needed) = (&self.name, named.join(", "), self.family.needs());
            format!("{NO_DISTRIBUTION}: {name} has no distribution with {given}: it needs {needed}")
        })
    }
}
