//! The runs of the optimisers.

use std::collections::BTreeMap;

use problem::Approach;
use problem::formulation::Problem;
use problem::optimise::RunResult;
use serde::Serialize;
use stages::names;
use store::OptimiserRunRow;

use crate::snapshot::Snapshot;

/// A run of an optimiser from one start.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OptimiserRun {
    /// The start's number, from 0, as in the run's name.
    pub start: u32,
    /// Whether the run is finished. The live page also shows runs on an external simulator while they are in
    /// progress.
    pub finished: bool,
    /// (evaluations so far, best penalised objective so far), in the order of the run.
    pub history: Vec<(u64, f64)>,
    /// Evaluations at which the run restarted.
    pub restarts: Vec<u64>,
}

impl OptimiserRun {
    /// Reads a finished run.
    ///
    /// # Errors
    ///
    /// The row is not what this version writes.
    pub fn read(problem: &Problem, row: &OptimiserRunRow) -> anyhow::Result<Self> {
        let run: RunResult = serde_json::from_str(&row.result_json)?;
        let mut restarts: Vec<u64> = run.restarts.iter().map(|(at, _)| *at).collect();
        restarts.extend(problem.campaign().optimise.restart_at.map(u64::from));
        restarts.sort_unstable();
        Ok(Self {
            start: run.start,
            finished: true,
            history: run.history,
            restarts,
        })
    }
}

/// The finished runs by approach.
pub(super) fn finished(
    snapshot: &Snapshot,
) -> anyhow::Result<BTreeMap<Approach, Vec<OptimiserRun>>> {
    let mut runs: BTreeMap<Approach, Vec<OptimiserRun>> = BTreeMap::new();
    for row in &snapshot.runs {
        if let Some((approach, _)) = names::approach_and_start(row.stream) {
            let run = OptimiserRun::read(&snapshot.problem, row)?;
            runs.entry(approach).or_default().push(run);
        }
    }
    Ok(runs)
}
