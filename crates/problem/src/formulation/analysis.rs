//! A deterministic analysis of a design.

use super::Criteria;

/// The state in which a design is analysed without random effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// The nominal design: for a gear pair, unworn flanks.
    Nominal,
    /// The state around which the random samples scatter: for a gear pair, Archard's wear.
    Baseline,
}

/// A deterministic analysis of a design in one state.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// The sampled response without random effects: for a gear pair ΔSTE, in µm. NaN for a problem
    /// [without a baseline](super::Problem::has_baseline).
    pub value: f64,
    /// The values that constraints are set on.
    pub criteria: Criteria,
}
