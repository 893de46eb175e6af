//! The optimiser's runs, including unfinished ones.

use std::collections::BTreeMap;

use crate::report::{OptimiserRun, approach_name, charts};
use problem::Approach;
use problem::formulation::Problem;
use serde::Serialize;

use super::Chart;
use crate::number::{count, significant};

/// All runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Convergence {
    /// The approaches with a run, in the order of the campaign's tables.
    pub approaches: Vec<ApproachRuns>,
}

/// The runs of one approach.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ApproachRuns {
    pub name: String,
    /// By start.
    pub runs: Vec<OptimiserRun>,
    /// The best value against the number of evaluations.
    pub chart: Option<Chart>,
}

/// The view of the runs, by approach and start.
#[must_use]
pub fn convergence(
    problem: &Problem,
    runs: BTreeMap<(Approach, u32), OptimiserRun>,
) -> Convergence {
    let mut by_approach: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for ((approach, _), run) in runs {
        by_approach.entry(approach).or_default().push(run);
    }
    let with_runs = problem.approaches();
    let with_runs =
        with_runs.filter_map(|approach| Some((approach, by_approach.remove(&approach)?)));
    Convergence {
        approaches: with_runs
            .map(|(approach, runs)| of_approach(problem, approach, runs))
            .collect(),
    }
}

fn of_approach(problem: &Problem, approach: Approach, runs: Vec<OptimiserRun>) -> ApproachRuns {
    let rows = runs.iter().map(|run| {
        let (evaluations, value) = run.history.last().copied().unwrap_or((0, f64::NAN));
        vec![
            run.start.to_string(),
            count(evaluations),
            significant(value, 5),
            if run.finished { "finished" } else { "running" }.to_owned(),
        ]
    });
    let columns = [
        "start",
        "last improvement (evaluations)",
        "best value",
        "state",
    ];
    let chart = Chart::new(
        charts::convergence(approach_name(problem, approach), &runs),
        &columns,
        rows.collect(),
    );
    ApproachRuns {
        name: problem.approach_name(approach).to_owned(),
        chart,
        runs,
    }
}
