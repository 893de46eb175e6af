//! A number with its confidence interval, for programs.

use serde::{Deserialize, Serialize};
use stats::IntervalEstimate;

/// A measure or a difference of two, with its 95 % confidence interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Lower end of the interval; absent if the samples are too few for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// Upper end of the interval; absent if the samples are too few for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
}

impl From<IntervalEstimate> for Estimate {
    fn from(estimate: IntervalEstimate) -> Self {
        let (low, high) = estimate.interval.unzip();
        Self {
            value: estimate.value,
            low,
            high,
        }
    }
}
