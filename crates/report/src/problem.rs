//! What the report of a campaign with a problem of the user's is made from: names, units and numbers.

use crate::data::{Header, KrigingFit, Percentile};
use crate::summary::Summary;

/// Everything that the report of an external campaign shows.
#[derive(Debug, Clone, PartialEq)]
pub struct ProblemReport {
    /// Which campaign, how large, at what cost.
    pub header: Header,
    /// The head of the report.
    pub summary: Summary,
    /// What is minimised is the percentile of this response.
    pub response: String,
    /// Its unit; empty for a number without one.
    pub unit: String,
    /// What each approach found, in the order in which it is to be shown.
    pub optima: Vec<ProblemOptimum>,
    /// The kriging model, if there is one.
    pub kriging: Vec<KrigingFit>,
    /// Remarks and warnings.
    pub notes: Vec<String>,
}

/// What one approach found.
#[derive(Debug, Clone, PartialEq)]
pub struct ProblemOptimum {
    /// The approach.
    pub approach: String,
    /// The variables of its best design, or why there is none.
    pub design: Result<Vec<NamedValue>, String>,
    /// What the approach minimised.
    pub criterion: f64,
    /// The percentile verified with samples of its own.
    pub p90: Percentile,
    /// What constraints are set on, with whether each holds.
    pub constraints: Vec<(NamedValue, bool)>,
    /// Calls of the simulator, including those of a design of experiments it needs.
    pub simulator_calls: u64,
}

/// A number with its name and unit.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedValue {
    /// The name.
    pub name: String,
    /// The unit; empty for a number without one.
    pub unit: String,
    /// The number.
    pub value: f64,
}
