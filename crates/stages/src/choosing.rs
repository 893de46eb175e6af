//! The choice of the design that an approach ends with.

use problem::formulation::Problem;
use problem::optimise::{RunResult, Solution};
use problem::{Approach, Design};
use store::{CriteriaRow, OptimiserRunRow};

use crate::cost::Cost;
use crate::doe::Doe;
use crate::names;
use crate::optima::{NoOptimum, Optimum};

/// Chooses the best design that the runs of an approach found.
///
/// `extra` is the cost of the approach's metamodel. A run that was quarantined is not among `rows`.
pub fn choose_run(
    problem: &Problem,
    approach: Approach,
    rows: &[OptimiserRunRow],
    extra: Cost,
) -> anyhow::Result<Optimum> {
    let rows: Vec<_> = rows
        .iter()
        .filter(|row| names::approach_and_start(row.stream).is_some_and(|(of, _)| of == approach))
        .collect();
    let runs: Vec<RunResult> = rows
        .iter()
        .map(|row| serde_json::from_str(&row.result_json))
        .collect::<Result<_, _>>()?;
    let calls: u64 = runs.iter().map(|run| run.simulator_calls).sum();
    let cpu_seconds: f64 = rows.iter().map(|row| row.cpu_seconds).sum();
    let cost = Cost {
        simulator_calls: calls + extra.simulator_calls,
        cpu_seconds: cpu_seconds + extra.cpu_seconds,
    };
    let of = |found: &Solution| problem.cost(found.criterion);
    let better = |a: &&Solution, b: &&Solution| of(a).total_cmp(&of(b));
    let best = runs
        .iter()
        .filter_map(|run| run.best.as_ref())
        .min_by(better);
    let note = continuation_note(problem, &runs);
    if let Some(found) = best {
        return Ok(Optimum {
            approach,
            found: Ok(found.clone()),
            cost,
            note,
        });
    }
    let printed = runs
        .iter()
        .filter_map(|run| run.printed.as_ref())
        .min_by(better);
    let (none, note) = match printed {
        _ if runs.is_empty() => (
            NoOptimum::NothingComputed,
            "Every run of the optimiser was quarantined.".to_owned(),
        ),
        Some(found) => (
            NoOptimum::NoneFeasible,
            format!(
                "No run found a design that satisfies every constraint: the best penalised one breaks \
                 some ({}).",
                broken(problem, found)
            ),
        ),
        None => (
            NoOptimum::NoneSimulable,
            "No run found a design that can be simulated.".to_owned(),
        ),
    };
    Ok(Optimum {
        approach,
        found: Err(none),
        cost,
        note,
    })
}

/// Chooses the best design of the DoE that satisfies every constraint, with its worn pressure.
#[must_use]
pub fn choose_of_doe(problem: &Problem, base: &Design, doe: &Doe, cost: Cost) -> Optimum {
    let Doe {
        designs,
        criteria,
        responses,
        ..
    } = doe;
    let mut feasible = doe.feasible(problem, base);
    let mut best: Option<Solution> = None;
    for response in responses.iter().filter(|row| row.measure.is_finite()) {
        let better = best
            .as_ref()
            .is_none_or(|found| problem.cost(response.measure) < problem.cost(found.criterion));
        if better && let Some((design, criteria)) = feasible.remove(&response.design) {
            best = Some(Solution {
                design,
                criterion: response.measure,
                criteria,
                feasible: true,
            });
        }
    }
    // Without a response, either no design gets samples or all that get some were quarantined.
    let gets_samples = |row: &CriteriaRow| row.simulable && row.reason.is_none();
    let is_missing = criteria.len() < designs.len() || criteria.iter().any(gets_samples);
    let (found, note) = match best {
        Some(found) => (Ok(found), ""),
        None if responses.is_empty() && is_missing => (
            Err(NoOptimum::NothingComputed),
            "No design of the DoE has its samples: all were quarantined.",
        ),
        None if criteria.iter().any(|row| row.simulable) => (
            Err(NoOptimum::NoneFeasible),
            match problem.limited() {
                [] => "No design of the DoE satisfies every constraint.",
                _ => {
                    "No design of the DoE with a measure satisfies every constraint, those on measures with a probability \
                     of 95 % by its own samples."
                }
            },
        ),
        None => (
            Err(NoOptimum::NoneSimulable),
            "No design of the DoE can be simulated.",
        ),
    };
    Optimum {
        approach: Approach::BestOfDoe,
        found,
        cost,
        note: note.to_owned(),
    }
}

/// The outcome of an approach for which there is no model, with the reason.
#[must_use]
pub fn without_model(approach: Approach, reason: String) -> Optimum {
    Optimum {
        approach,
        found: Err(NoOptimum::NoModel),
        cost: Cost::default(),
        note: reason,
    }
}

/// A note on the designs at which the runs would have ended with the printed penalty weight alone.
fn continuation_note(problem: &Problem, runs: &[RunResult]) -> String {
    let Some(penalty) = problem.penalty() else {
        return String::new();
    };
    let ended: Vec<&Solution> = runs
        .iter()
        .filter(|run| run.continuations > 0)
        .filter_map(|run| run.printed.as_ref())
        .collect();
    let Some(worst) = ended
        .iter()
        .min_by(|a, b| a.criterion.total_cmp(&b.criterion))
    else {
        return String::new();
    };
    format!(
        "With the printed penalty weight p = {}, {} of {} runs ended on a design that breaks a \
         constraint (the lowest at {:.3} µm with {}); those runs went on, ranking feasible designs \
         first, until they ended on one that breaks none.",
        penalty.weight,
        ended.len(),
        runs.len(),
        worst.criterion,
        broken(problem, worst),
    )
}

/// Names the constraints that a design breaks.
fn broken(problem: &Problem, found: &Solution) -> String {
    let broken: Vec<String> = problem
        .constraints(&found.criteria)
        .iter()
        .filter(|constraint| !constraint.holds())
        .map(ToString::to_string)
        .collect();
    broken.join(", ")
}
