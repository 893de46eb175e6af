//! One run of CMA-ES on one of the formulations.
//!
//! A run has two parts. The *printed* part is the paper's: the penalised objective (5) with its
//! static weight, a fixed number of evaluations, one restart half-way. On this simulator the
//! printed weight can be too small to be exact: then the penalised winner breaks a constraint. So
//! a run whose printed winner is infeasible *continues* with feasibility-first ranking, which needs
//! no weight, until it ends on a feasible design, and the result keeps both.

use cmaes::{Bounds, Evaluation, Restarts, RunOptions, minimise_run};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};
use stats::streams::{Purpose, stream};

use crate::formulation::{Approach, Criteria, Frozen, Problem, Variables};
use crate::simulator::{NoAnswer, Simulator};

/// How often a run whose printed winner is infeasible continues before it gives up.
const CONTINUATIONS: u32 = 10;

/// The violation of a design that cannot be simulated, when ranked feasibility first: more than
/// any real design's, whose violations are of order one.
const FAILURE_VIOLATION: f64 = 1e6;

/// A design that a run found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Found {
    /// The design.
    pub variables: Variables,
    /// The criterion that the run minimised, µm.
    pub criterion_um: f64,
    /// Its criteria.
    pub criteria: Criteria,
    /// Whether it satisfies every constraint.
    pub feasible: bool,
}

/// One run's result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunResult {
    /// Which problem.
    pub approach: Approach,
    /// Which of its starts, from 0.
    pub start: u32,
    /// The best design by the penalised objective (5) after the printed number of evaluations, if
    /// any design could be simulated.
    pub printed: Option<Found>,
    /// The best feasible design.
    pub best: Option<Found>,
    /// How many times the run continued beyond the printed evaluations to end on a feasible design.
    pub continuations: u32,
    /// Evaluations, continuations included.
    pub evaluations: u64,
    /// Calls of the simulator: one per unworn analysis, two with Archard's wear.
    pub simulator_calls: u64,
    /// Improvements of the penalised objective: (evaluation, value).
    pub history: Vec<(u64, f64)>,
    /// Why the search restarted, besides the planned restart: (evaluation, reason).
    pub restarts: Vec<(u64, String)>,
}

/// The criterion of one formulation, with the bookkeeping of a run.
struct Objective<'a> {
    simulator: &'a dyn Simulator,
    problem: &'a Problem,
    approach: Approach,
    frozen: Frozen,
    model: Option<kriging::Model>,
    simulator_calls: u64,
    printed: Option<(f64, Found)>,
    best: Option<Found>,
    /// Why the simulator failed; from then on it is not asked again.
    failed: Option<String>,
}

/// An evaluated design, before it is known whether it is an improvement.
struct Candidate {
    found: Found,
    violation: f64,
}

/// Runs the optimiser from start number `start` of `approach`.
///
/// `model` is the kriging model as JSON, for [`Approach::Kriging`].
///
/// # Errors
///
/// A sentence: the model is missing or cannot be read, or the simulator failed. A run in which no
/// design could be simulated is a result.
pub fn run(
    simulator: &dyn Simulator,
    approach: Approach,
    start: u32,
    frozen: &Frozen,
    model: Option<&str>,
) -> Result<RunResult, String> {
    let model = match (approach, model) {
        (Approach::Kriging, Some(json)) => Some(
            kriging::Model::from_json(json)
                .map_err(|error| format!("the kriging model cannot be read: {error}"))?,
        ),
        (Approach::Kriging, None) => return Err("the task brings no kriging model".to_owned()),
        (Approach::BestOfDoe | Approach::EnrichedKriging, _) => {
            return Err(format!("{} is chosen, not optimised", approach.name()));
        }
        _ => None,
    };
    let problem = simulator.problem();
    let settings = problem.campaign().optimise;
    let dimension = approach.variables();
    let bounds = Bounds::unit(dimension).map_err(|error| error.to_string())?;
    let mut rng = stream(
        problem.campaign().seed,
        Purpose::Optimise,
        approach.number(),
        u64::from(start),
    );
    let origin: Vec<f64> = (0..dimension).map(|_| rng.random()).collect();
    let mut objective = Objective {
        simulator,
        problem,
        approach,
        frozen: *frozen,
        model,
        simulator_calls: 0,
        printed: None,
        best: None,
        failed: None,
    };

    let planned = settings.run(bounds);
    let outcome = minimise_run(
        &origin,
        planned.clone(),
        &mut rng,
        &mut |unit: &[f64]| objective.penalised(unit),
    )
    .map_err(|error| error.to_string())?;
    let history = outcome
        .history
        .iter()
        .map(|(evaluation, result)| (*evaluation as u64, result.value))
        .collect();
    let restarts = outcome
        .restarts
        .iter()
        .filter_map(|restart| match restart.cause {
            cmaes::Cause::Planned => None,
            cause => Some((restart.evaluations as u64, cause.to_string())),
        })
        .collect();
    let mut evaluations = outcome.evaluations as u64;
    let printed = objective.printed.map(|(_, found)| found);

    // The printed winner is feasible exactly when nothing is left to do.
    let mut continuations = 0;
    if objective.failed.is_none() && printed.is_some_and(|found| !found.feasible) {
        let least = settings.evaluations / 2;
        let mut options = RunOptions {
            evaluations: settings.restart_at.unwrap_or(least).max(least) as usize,
            restarts: Restarts::FromBest { planned: 0 },
            ..planned
        };
        // The constrained optimum lies near the penalised one: look there first.
        options.search.step /= 3.0;
        let mut origin = outcome.x;
        while continuations < CONTINUATIONS && (continuations == 0 || objective.best.is_none()) {
            continuations += 1;
            let outcome = minimise_run(
                &origin,
                options.clone(),
                &mut rng,
                &mut |unit: &[f64]| objective.feasibility_first(unit),
            )
            .map_err(|error| error.to_string())?;
            evaluations += outcome.evaluations as u64;
            origin = outcome.x;
        }
    }

    if let Some(error) = objective.failed {
        return Err(error);
    }
    Ok(RunResult {
        approach,
        start,
        printed,
        best: objective.best,
        continuations,
        evaluations,
        simulator_calls: objective.simulator_calls,
        history,
        restarts,
    })
}

impl Objective<'_> {
    /// The penalised objective (5); designs that cannot be simulated get the failure value.
    fn penalised(&mut self, unit: &[f64]) -> f64 {
        let failure = self.problem.campaign().optimise.failure_value;
        let Some(candidate) = self.evaluate(unit) else {
            return failure;
        };
        let value = self
            .problem
            .penalised(candidate.found.criterion_um, candidate.violation);
        if !value.is_finite() {
            return failure;
        }
        if self.printed.is_none_or(|(best, _)| value < best) {
            self.printed = Some((value, candidate.found));
        }
        value
    }

    /// The criterion and the violation, to be ranked feasibility first.
    fn feasibility_first(&mut self, unit: &[f64]) -> Evaluation {
        match self.evaluate(unit) {
            Some(Candidate { found, violation }) => {
                // On the edge itself the violation is zero, but the inequalities are strict.
                let violation = if found.feasible {
                    0.0
                } else {
                    violation.max(f64::MIN_POSITIVE)
                };
                Evaluation {
                    value: found.criterion_um,
                    violation,
                }
            }
            None => Evaluation {
                value: 0.0,
                violation: FAILURE_VIOLATION,
            },
        }
    }

    /// Simulates a design and keeps it if it is the best feasible one so far; none when it cannot
    /// be simulated.
    fn evaluate(&mut self, unit: &[f64]) -> Option<Candidate> {
        if self.failed.is_some() {
            return None;
        }
        match self.try_evaluate(unit) {
            Ok(candidate) => candidate,
            Err(NoAnswer::Refused(_)) => None,
            Err(NoAnswer::Failed(error)) => {
                self.failed = Some(format!("simulator call {}: {error}", self.simulator_calls));
                None
            }
        }
    }

    fn try_evaluate(&mut self, unit: &[f64]) -> Result<Option<Candidate>, NoAnswer> {
        let problem = self.problem;
        let variables = match self.approach {
            Approach::NoWear => match problem.full_point(unit) {
                Ok(variables) => variables,
                Err(_) => return Ok(None),
            },
            _ => Variables::robust(&problem.robust_point(unit), &self.frozen),
        };
        self.simulator_calls += 1;
        let mut design = self.simulator.prepare(&variables)?;
        let (criterion_um, pressure) = match self.approach {
            Approach::Archard => {
                self.simulator_calls += 1;
                let analysis = design.archard()?;
                (analysis.delta_ste_um, analysis.hertz_pressure_mpa)
            }
            _ => {
                let analysis = design.unworn()?;
                let criterion_um = self.model.as_ref().map_or(analysis.delta_ste_um, |model| {
                    model.mean(&variables.robust_part())
                });
                (criterion_um, analysis.hertz_pressure_mpa)
            }
        };
        let mut criteria = design.criteria(pressure);
        let violation = problem.violation(&criteria);
        if !(criterion_um.is_finite() && violation.is_finite()) {
            return Ok(None);
        }
        let mut feasible = problem.is_feasible(&criteria);
        let improves = self
            .best
            .is_none_or(|best| criterion_um < best.criterion_um);
        if feasible && improves && self.approach == Approach::Kriging {
            // The search takes the pressure of the unworn pair, one call as in the paper. What is
            // kept as an optimum must satisfy its limit worn, too; that costs a call now and then.
            self.simulator_calls += 1;
            criteria.hertz_pressure_mpa = design.archard()?.hertz_pressure_mpa;
            feasible = problem.is_feasible(&criteria);
        }
        let found = Found {
            variables,
            criterion_um,
            criteria,
            feasible,
        };
        if feasible && improves {
            self.best = Some(found);
        }
        Ok(Some(Candidate { found, violation }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Campaign;
    use crate::file::Restarts;

    fn problem(change: impl FnOnce(&mut Campaign)) -> Problem {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.optimise.evaluations = 400;
        campaign.optimise.restart_at = Some(200);
        change(&mut campaign);
        Problem::new(campaign)
    }

    fn archard(problem: &Problem) -> RunResult {
        run(
            problem,
            Approach::Archard,
            0,
            &problem.printed_frozen(),
            None,
        )
        .unwrap()
    }

    #[test]
    fn a_run_is_a_function_of_campaign_approach_and_start() {
        let problem = problem(|_| {});
        let first = archard(&problem);
        assert_eq!(first, archard(&problem));
        let other = run(
            &problem,
            Approach::Archard,
            1,
            &problem.printed_frozen(),
            None,
        )
        .unwrap();
        assert_ne!(first.best, other.best);
        let json = serde_json::to_string(&first).unwrap();
        assert_eq!(serde_json::from_str::<RunResult>(&json).unwrap(), first);
    }

    #[test]
    fn the_kinds_of_restarts_give_different_runs_that_are_reproducible() {
        let of = |restarts, restart_at| {
            let problem = problem(|campaign| {
                // A search for one minimum needs some 1000 evaluations.
                campaign.optimise.evaluations = 4000;
                campaign.optimise.restarts = restarts;
                campaign.optimise.restart_at = restart_at;
            });
            let run = archard(&problem);
            assert_eq!(run, archard(&problem), "{restarts:?}");
            assert!(!run.restarts.is_empty(), "{restarts:?}");
            run
        };
        let kinds = [
            of(Restarts::FromBest, Some(2000)),
            of(Restarts::Ipop, None),
            of(Restarts::Bipop, None),
        ];
        let [from_best, ipop, bipop] = kinds.map(|run| run.restarts);
        assert!(from_best != ipop && ipop != bipop && bipop != from_best);
    }

    #[test]
    fn a_weight_that_is_too_small_is_said_and_made_up_for() {
        let problem = problem(|campaign| campaign.optimise.penalty = 1e-3);
        let result = archard(&problem);
        let printed = result.printed.unwrap();
        assert!(!printed.feasible, "the weight was meant to be too small");
        assert!(result.continuations > 0);
        assert!(result.evaluations > 400);
        let best = result
            .best
            .expect("the run goes on until it finds a feasible design");
        assert!(best.feasible && problem.is_feasible(&best.criteria));
        assert_eq!(problem.violation(&best.criteria), 0.0);
    }

    #[test]
    fn constraints_that_nothing_satisfies_end_without_an_optimum() {
        let problem = problem(|campaign| {
            campaign.constraints.contact_ratio_min = 50.0;
            campaign.optimise.evaluations = 60;
            campaign.optimise.restart_at = Some(30);
        });
        let result = archard(&problem);
        assert_eq!(result.best, None);
        assert_eq!(result.continuations, CONTINUATIONS);
        assert!(result.printed.is_some_and(|found| !found.feasible));
    }

    #[test]
    fn calls_are_counted_as_the_paper_does() {
        let problem = problem(|_| {});
        let frozen = problem.printed_frozen();
        let unworn = run(&problem, Approach::NoWear, 0, &frozen, None).unwrap();
        assert!(
            unworn.simulator_calls <= unworn.evaluations,
            "one call per analysis at most"
        );
        let worn = archard(&problem);
        assert!(
            worn.simulator_calls > worn.evaluations,
            "two calls per analysis"
        );
        assert!(worn.simulator_calls <= 2 * worn.evaluations);
    }

    #[test]
    fn a_kriging_run_needs_a_model_that_can_be_read() {
        let problem = problem(|_| {});
        let frozen = problem.printed_frozen();
        assert!(run(&problem, Approach::Kriging, 0, &frozen, None).is_err());
        let error = run(&problem, Approach::Kriging, 0, &frozen, Some("{}")).unwrap_err();
        assert!(error.contains("cannot be read"), "{error}");
    }
}
