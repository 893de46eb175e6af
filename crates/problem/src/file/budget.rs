//! `[budget]`: what a campaign may cost.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// `[budget]`, optional: what the campaign may cost, over all its stages and runs. Once it is used up, no more jobs are
/// leased. A larger budget and the same command continue.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Calls of the program: evaluations, samples and failures.
    pub calls: Option<u64>,
    /// Samples alone: of the DoE, infill, direct searches and verification.
    pub samples: Option<u64>,
    /// Hours during which a coordinator works on the campaign.
    pub hours: Option<f64>,
}

impl Budget {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        for (key, count) in [("calls", self.calls), ("samples", self.samples)] {
            let key = format!("budget.{key}");
            source.require(count != Some(0), &key, 0, "at least 1")?;
        }
        self.hours
            .map_or(Ok(()), |hours| source.positive("budget.hours", hours))
    }
}
