//! `[[random]]` and `[[correlations]]`: random inputs of a program, whose distributions the file states.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stats::{Copula, Family, Marginal};

use super::FileError;
use super::formula::Formula;
use super::validate::Source;

/// A random input of the program. Every sample gets its value, instead of a seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RandomSection {
    /// The name that the program uses.
    pub name: String,
    /// Its unit; empty for a number without one.
    #[serde(default)]
    pub unit: String,
    /// The distribution.
    pub distribution: Family,
    /// Mean of `"normal"`, `"lognormal"` and `"gumbel"`; of `"truncated-normal"` before it is cut.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean: Option<Parameter>,
    /// Standard deviation of the same families as the mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sd: Option<Parameter>,
    /// Least value of `"uniform"`, `"triangular"`, `"beta"` and `"truncated-normal"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub low: Option<Parameter>,
    /// Greatest value of the same families as the least one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub high: Option<Parameter>,
    /// Most probable value of `"triangular"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<Parameter>,
    /// Shape of `"weibull"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<Parameter>,
    /// Scale of `"weibull"`, which 63 % of the values stay below.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<Parameter>,
    /// First shape parameter of `"beta"`: a larger one moves the values towards `high`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha: Option<Parameter>,
    /// Second shape parameter of `"beta"`: a larger one moves the values towards `low`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beta: Option<Parameter>,
    /// The measured values of `"table"`, each as probable as the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<f64>>,
}

/// A number, or a formula of variables in quotation marks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected a number, or a formula of variables such as \"0.01 * width\""
)]
#[schemars(title = "a number, or a formula of variables")]
pub enum Parameter {
    /// The same for all designs.
    Number(f64),
    /// A formula of the design's variables, such as `"0.01 * width"`.
    Formula(String),
}

/// A correlation of two random inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CorrelationSection {
    /// The names of two random inputs.
    pub between: [String; 2],
    /// Correlation of their normal scores (Gaussian copula), which for normal inputs is their own. Between −1 and 1,
    /// both excluded.
    pub value: f64,
}

impl RandomSection {
    /// The parameter with this key.
    pub(crate) fn parameter(&self, key: &str) -> Option<&Parameter> {
        let (_, parameter) = self
            .parameters()
            .into_iter()
            .find(|(name, _)| *name == key)?;
        parameter
    }

    fn parameters(&self) -> [(&'static str, Option<&Parameter>); 9] {
        [
            ("mean", self.mean.as_ref()),
            ("sd", self.sd.as_ref()),
            ("low", self.low.as_ref()),
            ("high", self.high.as_ref()),
            ("mode", self.mode.as_ref()),
            ("shape", self.shape.as_ref()),
            ("scale", self.scale.as_ref()),
            ("alpha", self.alpha.as_ref()),
            ("beta", self.beta.as_ref()),
        ]
    }

    /// Checks the parameters, whose formulas may use `variables`. Whether formulas make a distribution depends on the
    /// design.
    pub(super) fn validate(
        &self,
        source: Source<'_>,
        section: &str,
        variables: &[&str],
    ) -> Result<(), FileError> {
        let keys = self.distribution.parameters();
        let name = serde_json::to_string(&self.distribution).expect("a name serialises");
        for (key, parameter) in self.parameters() {
            let place = format!("{section}.{key}");
            let is_wanted = keys.contains(&key);
            match parameter {
                None if is_wanted => {
                    let expected = format!("given: {name} takes {}", keys.join(", "));
                    return Err(source.missing(&place, &expected));
                }
                Some(found) if !is_wanted => {
                    let expected = format!("absent: {name} takes {}", keys.join(", "));
                    return Err(source.refuse(&place, found, expected));
                }
                Some(Parameter::Number(number)) => {
                    source.require(number.is_finite(), &place, number, "a finite number")?
                }
                Some(Parameter::Formula(text)) => {
                    let formula = Formula::parse(text, variables);
                    formula.map_err(|why| source.refuse(&place, text, why))?;
                }
                None => {}
            }
        }
        self.validate_numbers(source, section)?;
        let place = format!("{section}.values");
        let is_table = self.distribution == Family::Table;
        match &self.values {
            None if is_table => Err(source.missing(&place, "given: \"table\" draws from them")),
            Some(values) if !is_table => {
                let expected = "absent: only \"table\" draws from values";
                Err(source.refuse(&place, values, expected))
            }
            Some(values) => source.require(
                values.len() >= 2 && values.iter().all(|value| value.is_finite()),
                &place,
                values,
                "two or more finite numbers",
            ),
            None => Ok(()),
        }
    }

    /// Requires that the parameters make a distribution, if all of them are numbers.
    fn validate_numbers(&self, source: Source<'_>, section: &str) -> Result<(), FileError> {
        let keys = self.distribution.parameters();
        let number = |key: &&str| match self.parameter(key) {
            Some(Parameter::Number(number)) => Some(*number),
            _ => None,
        };
        let Some(numbers) = keys.iter().map(number).collect::<Option<Vec<f64>>>() else {
            return Ok(());
        };
        // `validate` checks the values of a table.
        let makes_one = Marginal::new(self.distribution, &numbers, &[0.0, 1.0]).is_some();
        let name = serde_json::to_string(&self.distribution).expect("a name serialises");
        let given = keys.iter().zip(&numbers);
        let given: Vec<String> = given
            .map(|(key, number)| format!("{key} = {number:?}"))
            .collect();
        source.require(
            makes_one,
            &format!("{section}.distribution"),
            format!("{} with {}", name.trim_matches('"'), given.join(", ")),
            &format!("one that exists: {}", self.distribution.needs()),
        )
    }
}

impl CorrelationSection {
    /// The copula of these random inputs; `None` unless the matrix of their correlations is positive definite. Pairs
    /// without a section are independent.
    pub(crate) fn copula(all: &[Self], inputs: &[RandomSection]) -> Option<Copula> {
        Copula::new(inputs.len(), |i, j| {
            let pair = [&*inputs[i].name, &*inputs[j].name];
            let is_pair = |one: &&Self| {
                let [first, second] = &one.between;
                pair == [&**first, &**second] || pair == [&**second, &**first]
            };
            all.iter().find(is_pair).map_or(0.0, |one| one.value)
        })
    }

    /// Checks correlations of these random inputs.
    pub(super) fn validate(
        all: &[Self],
        source: Source<'_>,
        inputs: &[RandomSection],
    ) -> Result<(), FileError> {
        let names: Vec<&str> = inputs.iter().map(|input| &*input.name).collect();
        for (index, one) in all.iter().enumerate() {
            let section = format!("correlations[{}]", index + 1);
            let place = format!("{section}.between");
            let [first, second] = &one.between;
            let is_known = |name: &String| names.contains(&name.as_str());
            source.require(
                is_known(first) && is_known(second) && first != second,
                &place,
                &one.between,
                &format!("the names of two random inputs: {}", names.join(", ")),
            )?;
            let same = |other: &&Self| {
                other.between == one.between || other.between == [second.clone(), first.clone()]
            };
            source.require(
                !all[..index].iter().any(|other| same(&other)),
                &place,
                &one.between,
                "a pair that has no other correlation",
            )?;
            source.between(&format!("{section}.value"), one.value, -1.0, 1.0)?;
        }
        if let Some(last) = all.last()
            && Self::copula(all, inputs).is_none()
        {
            return Err(source.refuse(
                &format!("correlations[{}].value", all.len()),
                last.value,
                "one that can hold together with the others: their matrix must be positive definite",
            ));
        }
        Ok(())
    }
}
