//! The optimiser's runs, including unfinished ones.

use std::collections::BTreeMap;

use crate::report::{OptimiserRun, charts};
use problem::formulation::Problem;
use serde::Serialize;

use super::{Chart, SCHEMA_VERSION};
use crate::number::rounded;

/// All runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Convergence {
    pub schema_version: u32,
    /// The approaches with a run, in the order of the campaign's tables.
    pub approaches: Vec<ApproachRuns>,
}

/// The runs of one approach.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ApproachRuns {
    pub name: String,
    /// By start.
    pub runs: Vec<Run>,
    /// The best value against the number of evaluations.
    pub chart: Option<Chart>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Run {
    /// Number of the start, from 1.
    pub start: usize,
    /// Whether the run is finished. Runs on an external simulator are also shown while they are in
    /// progress.
    pub finished: bool,
    /// Every improvement, as the number of evaluations and the best value.
    pub history: Vec<(u64, f64)>,
    /// Numbers of evaluations at which the run restarted.
    pub restarts: Vec<u64>,
}

/// The view of the runs, by approach and start. The flag says whether a run is finished.
#[must_use]
pub fn convergence(
    problem: &Problem,
    runs: BTreeMap<(problem::Approach, usize), (OptimiserRun, bool)>,
) -> Convergence {
    let mut by_approach: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for ((approach, _), run) in runs {
        by_approach.entry(approach).or_default().push(run);
    }
    let with_runs = problem.approaches();
    let with_runs =
        with_runs.filter_map(|approach| Some((approach, by_approach.remove(&approach)?)));
    Convergence {
        schema_version: SCHEMA_VERSION,
        approaches: with_runs
            .map(|(approach, runs)| of_approach(problem.approach_name(approach), runs))
            .collect(),
    }
}

fn of_approach(name: &str, runs: Vec<(OptimiserRun, bool)>) -> ApproachRuns {
    let drawn: Vec<OptimiserRun> = runs.iter().map(|(run, _)| run.clone()).collect();
    let rows = runs.iter().map(|(run, finished)| {
        let (evaluations, value) = run.best.last().copied().unwrap_or((0, f64::NAN));
        vec![
            run.start.to_string(),
            evaluations.to_string(),
            rounded(value, 5).to_string(),
            if *finished { "finished" } else { "running" }.to_owned(),
        ]
    });
    let columns = [
        "start",
        "last improvement (evaluations)",
        "best value",
        "state",
    ];
    let chart = Chart::new(
        charts::convergence(&format!("Approach {name}"), &drawn),
        &columns,
        rows.collect(),
    );
    ApproachRuns {
        name: name.to_owned(),
        chart,
        runs: runs
            .into_iter()
            .map(|(run, finished)| Run {
                start: run.start,
                finished,
                history: run.best,
                restarts: run.restarts,
            })
            .collect(),
    }
}
