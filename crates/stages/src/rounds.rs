//! Rounds of infill that were decided: in words, and what the last one recommends.

use anyhow::Context as _;
use campaign::formulation::Problem;
use campaign::optimise::Found;
use campaign::{Approach, Frozen, Variables};
use enrich::{Recommendation, Stop};
use store::{OptimumRow, RoundRow};

use crate::choosing::optimum;
use crate::cost::Cost;
use crate::infill::Point;

/// A round as the store keeps it, read.
#[derive(Debug, Clone, PartialEq)]
pub struct Round {
    /// Its row.
    pub row: RoundRow,
    /// The best design when it was decided.
    pub recommendation: Option<Recommendation>,
    /// Why the enrichment ends, if this round says so.
    pub stop: Option<Stop>,
}

impl Round {
    /// Reads the JSON of a row.
    ///
    /// # Errors
    ///
    /// It is not what this version writes.
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

/// A stop in a sentence.
#[must_use]
pub fn sentence(stop: &Stop) -> String {
    match stop {
        Stop::Converged {
            expected_improvement_um,
            half_width_um,
        } => format!(
            "The enrichment has converged: in two rounds at most {expected_improvement_um:.4} µm were \
             to be gained, and the prediction is known to ±{half_width_um:.4} µm."
        ),
        Stop::Budget { samples } => {
            format!("The enrichment ended with its samples: {samples} are left.")
        }
        Stop::Rounds { rounds } => {
            format!("The enrichment ended after {rounds} rounds, which is all that it may have.")
        }
        Stop::OnlyFailures => {
            "The enrichment ended because every infill point of two rounds failed.".to_owned()
        }
        Stop::NothingFeasible => {
            "The enrichment ended because it found no design that satisfies every constraint."
                .to_owned()
        }
    }
}

/// The row of the design that the last round recommends.
///
/// # Errors
///
/// The round was decided for another problem.
pub fn recommended(
    problem: &Problem,
    frozen: &Frozen,
    last: &Round,
    cost: Cost,
) -> anyhow::Result<OptimumRow> {
    let approach = Approach::EnrichedKriging;
    let Some(best) = &last.recommendation else {
        let note = last.stop.as_ref().map_or_else(String::new, sentence);
        return optimum(approach, None, cost, note);
    };
    let x = best.x.as_slice().try_into();
    let x: Point = x.context("a recommendation of another problem")?;
    let variables = Variables::robust(&x, frozen);
    let pair = problem.pair(&variables)?;
    let worn = pair.archard(problem.wear()).analysis;
    let criteria = problem.criteria(&pair, worn.hertz_pressure_mpa);
    let found = Found {
        variables,
        criterion_um: best.predicted_um,
        criteria,
        feasible: problem.is_feasible(&criteria),
    };
    optimum(approach, Some(&found), cost, String::new())
}
