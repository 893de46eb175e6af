//! What the built-in model shows of the optima, and the runs that found them.

use std::collections::BTreeMap;

use campaign::Approach;
use campaign::formulation::Problem;
use campaign::optimise::RunResult;
use stages::names;
use store::OptimiserRunRow;

use crate::converged::difference_um;
use crate::report::{Illustration, OptimiserRun, contact, drawing, ste};
use crate::snapshot::Snapshot;

/// Drawings and curves of the optima; none of those that the built-in model does not simulate.
pub(super) fn illustrations(snapshot: &Snapshot) -> BTreeMap<Approach, Illustration> {
    let problem = &snapshot.problem;
    let built_in = !problem.campaign().is_external();
    let Some(gears) = problem.gears().filter(|_| built_in) else {
        return BTreeMap::new();
    };
    let illustration = |optimum: &stages::optima::Optimum| {
        let found = optimum.found.as_ref().ok()?;
        let pair = gears.pair(&found.design).ok()?;
        let illustration = Illustration {
            converged_difference_um: difference_um(problem, &found.design),
            drawing: drawing(&pair),
            ste: ste(&pair, gears.wear()),
            contact: Some(contact(&pair, Some(gears.wear()))),
        };
        Some((optimum.approach, illustration))
    };
    let optima = snapshot.optima.iter();
    optima
        .filter_map(|verified| illustration(&verified.optimum))
        .collect()
}

/// The finished runs by approach.
pub(super) fn runs(snapshot: &Snapshot) -> anyhow::Result<BTreeMap<Approach, Vec<OptimiserRun>>> {
    let mut runs: BTreeMap<Approach, Vec<OptimiserRun>> = BTreeMap::new();
    for row in &snapshot.runs {
        if let Some((approach, _)) = names::approach_and_start(row.stream) {
            let run = run(&snapshot.problem, row)?;
            runs.entry(approach).or_default().push(run);
        }
    }
    Ok(runs)
}

/// A finished run of an optimiser, for [`chart_convergence`](crate::report::chart_convergence).
///
/// # Errors
///
/// The row is not what this version writes.
pub fn run(problem: &Problem, row: &OptimiserRunRow) -> anyhow::Result<OptimiserRun> {
    let run: RunResult = serde_json::from_str(&row.result_json)?;
    let mut restarts: Vec<u64> = run.restarts.iter().map(|(at, _)| *at).collect();
    restarts.extend(problem.campaign().optimise.restart_at.map(u64::from));
    restarts.sort_unstable();
    Ok(OptimiserRun {
        start: run.start as usize + 1,
        best: run.history,
        restarts,
    })
}
