//! `[[responses]]` of an external campaign.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A random response of the program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResponseSection {
    /// The name that the program uses.
    pub name: String,
    /// Its unit; empty for a number without one.
    #[serde(default)]
    pub unit: String,
    /// Whether the program also computes it without random effects. Only for the response of the objective.
    #[serde(default)]
    pub baseline: bool,
    /// Smallest plausible value: a smaller one is a failure of its sample.
    pub min: Option<f64>,
    /// Largest plausible value: a larger one is a failure of its sample.
    pub max: Option<f64>,
}
