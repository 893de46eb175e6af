//! Rounds of infill that were decided, and the recommendation of the last one.

use anyhow::Context as _;
use enrich::{Recommendation, Stop};
use problem::formulation::Problem;
use problem::optimise::Solution;
use problem::simulator::{Simulator as _, State};
use problem::{Approach, Criteria, Design};
use store::RoundRow;

use crate::cost::Cost;
use crate::optima::{NoOptimum, Optimum};

/// A round as the store keeps it, read.
#[derive(Debug, Clone, PartialEq)]
pub struct Round {
    pub row: RoundRow,
    /// The best design at the time of the decision.
    pub recommendation: Option<Recommendation>,
    /// The reason to stop, if the enrichment ends with this round.
    pub stop: Option<Stop>,
}

impl Round {
    pub fn read(row: RoundRow) -> serde_json::Result<Self> {
        let recommendation = row.recommendation_json.as_deref();
        let stop = row.stop_json.as_deref();
        Ok(Self {
            recommendation: recommendation.map(serde_json::from_str).transpose()?,
            stop: stop.map(serde_json::from_str).transpose()?,
            row,
        })
    }
}

/// The design that the last round recommends; `evaluated` are its deterministic criteria if only an
/// external program knows them, and `limited` the values by which constraints on samples are judged.
pub fn recommended(
    problem: &Problem,
    base: &Design,
    last: &Round,
    evaluated: Option<Criteria>,
    limited: &[f64],
    cost: Cost,
) -> anyhow::Result<Optimum> {
    let approach = Approach::EnrichedKriging;
    let Some(best) = &last.recommendation else {
        let note = last.stop.as_ref().map_or_else(String::new, Stop::to_string);
        let none = match last.stop {
            Some(Stop::NothingFeasible) => NoOptimum::NoneFeasible,
            Some(Stop::OnlyFailures) => NoOptimum::NothingComputed,
            _ => NoOptimum::NoModel,
        };
        return Ok(Optimum {
            approach,
            found: Err(none),
            cost,
            note,
        });
    };
    anyhow::ensure!(
        best.x.len() == problem.dimension(),
        "a recommendation of another problem"
    );
    let design = problem.design(&best.x, base);
    let criteria = match problem.gears() {
        Some(_) => problem.prepare(&design)?.analyse(State::Baseline)?.criteria,
        None if problem.deterministic().is_empty() => Criteria::new(Vec::new()),
        None => evaluated.context("the recommended design was never evaluated")?,
    };
    let criteria = problem.with_limited(&criteria, limited);
    let found = Solution {
        design,
        criterion: best.predicted,
        feasible: problem.is_feasible(&criteria),
        criteria,
    };
    Ok(Optimum {
        approach,
        found: Ok(found),
        cost,
        note: String::new(),
    })
}
