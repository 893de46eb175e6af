//! The response of a measure: one of `[[responses]]`, or a combination of several in each sample.

use std::borrow::Cow;
use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::Source;
use super::{FileError, ResponseSection};
use crate::quantity::Quantity;

/// `response` of an objective or of a constraint on a measure: the name of one of `[[responses]]`, or a combination that
/// is computed in each sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "the name of a response, or { greatest = [\"a\", \"b\"] }, { least = [\"a\", \"b\"] } or { sum = { a = 0.5, b = 0.5 } }"
)]
#[schemars(title = "a name, or a combination of names")]
pub enum Combination {
    /// One response.
    One(String),
    /// Several responses.
    Several(Several),
}

/// A combination of several responses in each sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Several {
    /// The greatest of them, such as the worst of several load cases.
    Greatest(Vec<String>),
    /// The least of them.
    Least(Vec<String>),
    /// Their weighted sum.
    Sum(BTreeMap<String, f64>),
}

impl Several {
    /// The combined value of its responses, in the order of [`Combination::places`].
    pub(crate) fn of(&self, values: impl Iterator<Item = f64>) -> f64 {
        match self {
            Self::Greatest(_) => values.fold(f64::NEG_INFINITY, f64::max),
            Self::Least(_) => values.fold(f64::INFINITY, f64::min),
            Self::Sum(weights) => weights.values().zip(values).map(|(w, v)| w * v).sum(),
        }
    }
}

impl Combination {
    /// The names of the combined responses.
    fn names(&self) -> Vec<&str> {
        match self {
            Self::One(name) => vec![name],
            Self::Several(Several::Greatest(names) | Several::Least(names)) => {
                names.iter().map(String::as_str).collect()
            }
            Self::Several(Several::Sum(weights)) => weights.keys().map(String::as_str).collect(),
        }
    }

    /// The indices of the combined responses in `responses`. The error is the first name that `responses` lacks.
    pub(crate) fn places(&self, responses: &[ResponseSection]) -> Result<Vec<usize>, &str> {
        let place = |name| {
            let place = responses.iter().position(|one| one.name == name);
            place.ok_or(name)
        };
        self.names().into_iter().map(place).collect()
    }

    pub(super) fn validate(
        &self,
        source: Source<'_>,
        key: &str,
        responses: &[ResponseSection],
    ) -> Result<(), FileError> {
        let names = self.names();
        let places = self.places(responses).map_err(|unknown| {
            let known: Vec<&str> = responses.iter().map(|one| &*one.name).collect();
            let expected = format!("one of [[responses]]: {}", known.join(", "));
            source.refuse(key, unknown, expected)
        })?;
        let Self::Several(several) = self else {
            return Ok(());
        };
        let is_double = (1..names.len()).any(|place| names[..place].contains(&names[place]));
        let expected = "two or more different responses";
        source.require(names.len() > 1 && !is_double, key, &names, expected)?;
        let Several::Sum(weights) = several else {
            let unit = |place: &usize| &responses[*place].unit;
            let is_same = places.iter().all(|place| unit(place) == unit(&places[0]));
            let expected = "responses of one unit: numbers of different units cannot be compared";
            return source.require(is_same, key, &names, expected);
        };
        for (name, weight) in weights {
            let key = format!("{key}.sum.{name}");
            source.require(weight.is_finite(), &key, weight, "a finite number")?;
        }
        Ok(())
    }

    /// The name and the unit of a response or of a combination of responses; those of the first response for `None`.
    pub(super) fn quantity(response: Option<&Self>, responses: &[ResponseSection]) -> Quantity {
        let unit = |name: &str| {
            let found = responses.iter().find(|one| one.name == name);
            found.map_or("", |one| &*one.unit)
        };
        let Some(combination) = response else {
            return Quantity::new(&responses[0].name, &responses[0].unit);
        };
        let names = combination.names();
        let is_one_unit = names.iter().all(|name| unit(name) == unit(names[0]));
        let of = if is_one_unit { unit(names[0]) } else { "" };
        let name: Cow<'_, str> = match combination {
            Self::One(name) => name.into(),
            Self::Several(Several::Greatest(names)) => {
                format!("greatest of {}", names.join(", ")).into()
            }
            Self::Several(Several::Least(names)) => format!("least of {}", names.join(", ")).into(),
            Self::Several(Several::Sum(weights)) => {
                let terms = weights
                    .iter()
                    .map(|(name, weight)| format!("{weight} {name}"));
                terms.collect::<Vec<_>>().join(" + ").into()
            }
        };
        Quantity::new(&name, of)
    }
}
