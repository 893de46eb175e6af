//! The model file: a kriging model with the names, units and bounds of its columns, as JSON.

use std::collections::HashSet;

use kriging::Surrogate;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use serde_json::value::RawValue;

use crate::modelling::{Error, InputError, Quantity};

/// A model with the names, units and bounds of its columns.
#[derive(Debug, Clone)]
pub struct ModelFile {
    /// The inputs, in the order of the model's coordinates, with the values that the fitted points span.
    pub inputs: Vec<ModelInput>,
    pub response: Quantity,
    /// The noise variance of a new observation, on the scale of the model: the nugget and the mean of the known
    /// noise variances.
    pub noise_variance: f64,
    pub surrogate: Surrogate,
}

/// An input of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelInput {
    /// The column's name.
    pub name: String,
    /// The column's unit, if known.
    pub unit: Option<String>,
    /// The lowest value among the fitted points.
    pub low: f64,
    /// The highest value among the fitted points.
    pub high: f64,
}

/// Version of the file's form; raised when a change would make programs misread it.
const SCHEMA_VERSION: u32 = 1;

/// The file's JSON object.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelObject {
    schema_version: u32,
    inputs: Vec<ModelInput>,
    response: Quantity,
    noise_variance: f64,
    /// As text: a value would keep only the last of two members with one key.
    model: Box<RawValue>,
}

/// The version alone, which is readable in an object of any version.
#[derive(Deserialize)]
struct Version {
    schema_version: u32,
}

impl ModelFile {
    /// A model of columns of these names.
    ///
    /// # Panics
    ///
    /// If there is not one input for each coordinate of the model.
    #[must_use]
    pub fn new(inputs: &[Quantity], response: Quantity, surrogate: Surrogate) -> Self {
        let bounds = surrogate.bounds();
        assert_eq!(inputs.len(), bounds.len(), "one name for each coordinate");
        let inputs = inputs.iter().zip(bounds);
        let inputs = inputs.map(|(Quantity { name, unit }, [low, high])| ModelInput {
            name: name.clone(),
            unit: unit.clone(),
            low,
            high,
        });
        Self {
            inputs: inputs.collect(),
            response,
            noise_variance: surrogate.noise_variance(),
            surrogate,
        }
    }

    /// The model as one JSON object with its `schema_version`. Numbers are read back exactly.
    ///
    /// # Errors
    ///
    /// One of the model's numbers is not finite.
    pub fn to_json(&self) -> Result<Value, Error> {
        let model = self.surrogate.to_json()?;
        let json = |error| Error::Kriging(kriging::Error::Json(error));
        serde_json::to_value(ModelObject {
            schema_version: SCHEMA_VERSION,
            inputs: self.inputs.clone(),
            response: self.response.clone(),
            noise_variance: self.noise_variance,
            model: RawValue::from_string(model).map_err(json)?,
        })
        .map_err(json)
    }

    /// Reads what [`ModelFile::to_json`] wrote, from the text of `file`.
    ///
    /// # Errors
    ///
    /// The text is not such an object, has another version, or its parts contradict each other.
    pub fn from_json(file: &str, text: &str) -> Result<Self, InputError> {
        let wrong = |message: String| InputError::in_file(file, message);
        let unreadable = |error: serde_json::Error| {
            let message =
                format!("is not a model file of `fit --out` or `export --table model`: {error}");
            wrong(message)
        };
        let Version { schema_version } = serde_json::from_str(text).map_err(unreadable)?;
        if schema_version != SCHEMA_VERSION {
            return Err(wrong(format!(
                "schema_version is {schema_version}, but this program reads {SCHEMA_VERSION}"
            )));
        }
        let stored: ModelObject = serde_json::from_str(text).map_err(unreadable)?;
        let surrogate = Surrogate::from_json(stored.model.get()).map_err(|error| {
            let cause = std::error::Error::source(&error);
            let cause = cause.map_or_else(String::new, |cause| format!(": {cause}"));
            wrong(format!("the model cannot be read: {error}{cause}"))
        })?;
        let ModelObject {
            inputs,
            response,
            noise_variance,
            ..
        } = stored;
        if noise_variance.is_nan() || noise_variance < 0.0 {
            return Err(wrong(format!(
                "noise_variance is {noise_variance}, but must not be negative"
            )));
        }
        if inputs.len() != surrogate.dimensions() {
            return Err(wrong(format!(
                "inputs has {} entries, but the model has {} coordinates",
                inputs.len(),
                surrogate.dimensions()
            )));
        }
        let mut seen = HashSet::new();
        for input in &inputs {
            let ModelInput {
                name, low, high, ..
            } = input;
            if !seen.insert(name) {
                let message = format!("inputs names {name:?} twice, but names must differ");
                return Err(wrong(message));
            }
            if low > high {
                let message = format!("low is {low}, but must not exceed high, {high}");
                return Err(wrong(message).in_column(name));
            }
        }
        Ok(Self {
            inputs,
            response,
            noise_variance,
            surrogate,
        })
    }
}
