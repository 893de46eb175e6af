//! The criterion of a run, and what it remembers of the designs that it has evaluated.

use cmaes::Evaluation;
use serde::{Deserialize, Serialize};

use super::Found;
use crate::formulation::{Approach, Criteria, Design, Problem};
use crate::simulator::{NoAnswer, Simulator, State};
use crate::task::Run;

/// The violation of a design that cannot be simulated, when ranked feasibility first: more than any real
/// design's.
const FAILURE_VIOLATION: f64 = 1e300;

/// The criterion of one formulation.
pub(super) struct Objective<'a> {
    simulator: &'a dyn Simulator,
    problem: &'a Problem,
    approach: Approach,
    base: Design,
    model: Option<kriging::Surrogate>,
}

/// What a run remembers of the designs that it has evaluated.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Seen {
    pub(super) simulator_calls: u64,
    /// The best design by the penalised objective, or the nearest to feasible where there is no penalty,
    /// with its value.
    pub(super) printed: Option<(f64, Found)>,
    /// The best feasible design.
    pub(super) best: Option<Found>,
}

/// An evaluated design, before it is known whether it is an improvement.
struct Candidate {
    found: Found,
    violation: f64,
}

impl Seen {
    /// Keeps what the printed part of a run found, if it is the best by its value.
    fn keep(&mut self, value: f64, found: Found) {
        if self.printed.as_ref().is_none_or(|(best, _)| value < *best) {
            self.printed = Some((value, found));
        }
    }
}

/// An evaluated design, to be ranked feasibility first; none cannot be simulated.
fn ranked(candidate: Option<&Candidate>) -> Evaluation {
    candidate.map_or(
        Evaluation {
            value: 0.0,
            violation: FAILURE_VIOLATION,
        },
        |Candidate { found, violation }| Evaluation {
            value: found.criterion_um,
            // On the edge itself the violation is zero, but the inequalities are strict.
            violation: if found.feasible {
                0.0
            } else {
                violation.max(f64::MIN_POSITIVE)
            },
        },
    )
}

impl<'a> Objective<'a> {
    /// The objective of a run.
    ///
    /// # Errors
    ///
    /// A sentence: the model is missing or cannot be read, or the approach has no runs.
    pub(super) fn new(simulator: &'a dyn Simulator, run: &Run) -> Result<Self, String> {
        let model = match (run.approach, run.model.as_deref()) {
            (Approach::Kriging, Some(json)) => Some(
                kriging::Surrogate::from_json(json)
                    .map_err(|error| format!("the kriging model cannot be read: {error}"))?,
            ),
            (Approach::Kriging, None) => return Err("the task brings no kriging model".to_owned()),
            (Approach::BestOfDoe | Approach::EnrichedKriging, _) => {
                return Err(format!("{} is chosen, not optimised", run.approach.name()));
            }
            _ => None,
        };
        Ok(Self {
            simulator,
            problem: simulator.problem(),
            approach: run.approach,
            base: run.base.clone(),
            model,
        })
    }

    /// What the printed part of a run minimises: the penalised objective (5), in which designs that
    /// cannot be simulated get the failure value. Without a penalty designs are ranked feasibility first,
    /// and the nearest to feasible is kept.
    ///
    /// # Errors
    ///
    /// The simulator failed.
    pub(super) fn printed(&self, seen: &mut Seen, unit: &[f64]) -> Result<Evaluation, String> {
        let Some(penalty) = self.problem.penalty() else {
            let candidate = self.evaluate(seen, unit)?;
            let ranked = ranked(candidate.as_ref());
            if let Some(candidate) = candidate {
                seen.keep(candidate.violation, candidate.found);
            }
            return Ok(ranked);
        };
        let Some(candidate) = self.evaluate(seen, unit)? else {
            return Ok(penalty.failure_value.into());
        };
        let value = penalty.objective(candidate.found.criterion_um, candidate.violation);
        if !value.is_finite() {
            return Ok(penalty.failure_value.into());
        }
        seen.keep(value, candidate.found);
        Ok(value.into())
    }

    /// The criterion and the violation, to be ranked feasibility first.
    ///
    /// # Errors
    ///
    /// The simulator failed.
    pub(super) fn feasibility_first(
        &self,
        seen: &mut Seen,
        unit: &[f64],
    ) -> Result<Evaluation, String> {
        Ok(ranked(self.evaluate(seen, unit)?.as_ref()))
    }

    /// Simulates a design and keeps it if it is the best feasible one so far; none when it cannot
    /// be simulated.
    fn evaluate(&self, seen: &mut Seen, unit: &[f64]) -> Result<Option<Candidate>, String> {
        match self.try_evaluate(seen, unit) {
            Ok(candidate) => Ok(candidate),
            Err(NoAnswer::Refused(_)) => Ok(None),
            Err(NoAnswer::Failed(error)) => {
                Err(format!("simulator call {}: {error}", seen.simulator_calls))
            }
        }
    }

    fn try_evaluate(&self, seen: &mut Seen, unit: &[f64]) -> Result<Option<Candidate>, NoAnswer> {
        let problem = self.problem;
        let Some(design) = problem.point(self.approach, unit, &self.base) else {
            return Ok(None);
        };
        let predicted = self
            .model
            .as_ref()
            .map(|model| model.mean(&problem.free_values(&design)));
        let best = seen.best.as_ref().map(|best| best.criterion_um);
        // Without constraints there is nothing to ask about a design that is no improvement.
        if let Some(criterion_um) = predicted
            && problem.criteria().is_empty()
            && best.is_some_and(|best| criterion_um >= best)
        {
            let found = Found {
                design,
                criterion_um,
                criteria: Criteria::new(Vec::new()),
                feasible: true,
            };
            return Ok(Some(Candidate {
                found,
                violation: 0.0,
            }));
        }
        seen.simulator_calls += 1;
        let mut prepared = self.simulator.prepare(&design)?;
        let state = match self.approach {
            Approach::Baseline => {
                // Archard's wear rests on the unworn analysis.
                seen.simulator_calls += u64::from(problem.gears().is_some());
                State::Baseline
            }
            _ => State::Nominal,
        };
        let mut analysis = prepared.analyse(state)?;
        let criterion_um = predicted.unwrap_or(analysis.value_um);
        let violation = problem.violation(&analysis.criteria);
        if !(criterion_um.is_finite() && violation.is_finite()) {
            return Ok(None);
        }
        let mut feasible = problem.is_feasible(&analysis.criteria);
        let improves = best.is_none_or(|best| criterion_um < best);
        if feasible && improves && self.approach == Approach::Kriging && problem.gears().is_some() {
            // The search takes the pressure of the unworn pair, one call as in the paper. What is
            // kept as an optimum must satisfy its limit worn, too; that costs a call now and then.
            seen.simulator_calls += 1;
            analysis = prepared.analyse(State::Baseline)?;
            feasible = problem.is_feasible(&analysis.criteria);
        }
        let found = Found {
            design,
            criterion_um,
            criteria: analysis.criteria,
            feasible,
        };
        if feasible && improves {
            seen.best = Some(found.clone());
        }
        Ok(Some(Candidate { found, violation }))
    }
}
