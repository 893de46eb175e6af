//! A run of an optimiser: its input and its result.

use std::sync::Arc;

use ledger::StreamId;
use serde::{Deserialize, Serialize};

use crate::formulation::{Approach, Criteria, Design};

/// One run of an optimiser.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The approach, which selects the problem formulation.
    pub approach: Approach,
    /// The number of the start, from 0.
    pub start: u32,
    /// The values of the variables that the DoE does not vary; ignored if the approach varies all.
    pub base: Design,
    /// The kriging models as JSON, for [`Approach::Kriging`]: of the [measures](crate::formulation::Problem::measures),
    /// and then of the [modelled](crate::formulation::Problem::modelled) quantities.
    pub models: Vec<Arc<str>>,
    /// The design that the search begins at; a random point without one. A search on a model evaluates
    /// it first, a direct search begins with a shorter step.
    pub from: Option<Design>,
}

impl Run {
    /// The stream of the run's result.
    #[must_use]
    pub const fn stream(&self) -> StreamId {
        StreamId::run(self.approach.number() as u32, self.start)
    }
}

/// The best design of a run, by one of its criteria.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Solution {
    /// The design.
    pub design: Design,
    /// The criterion that the run minimised.
    pub criterion: f64,
    /// Its criteria.
    pub criteria: Criteria,
    /// Whether it satisfies all constraints.
    pub feasible: bool,
}

/// The result of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunResult {
    /// The approach, which selects the problem formulation.
    pub approach: Approach,
    /// The number of the start, from 0.
    pub start: u32,
    /// The best design by the penalised objective (5) after the printed number of evaluations, if
    /// any design was simulable.
    pub printed: Option<Solution>,
    /// The best feasible design.
    pub best: Option<Solution>,
    /// Number of times that the run continued beyond the printed evaluations to end at a feasible
    /// design.
    pub continuations: u32,
    /// Number of evaluations, including continuations.
    pub evaluations: u64,
    /// Number of calls of the simulator: one per analysis without wear, two with Archard's wear.
    pub simulator_calls: u64,
    /// The improvements as (evaluation, value): of the penalised objective, or without a penalty of the
    /// criterion.
    pub history: Vec<(u64, f64)>,
    /// The restarts besides the planned one, as (evaluation, reason).
    pub restarts: Vec<(u64, String)>,
}
