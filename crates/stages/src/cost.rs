//! The cost of samples, models and approaches.

use std::collections::{BTreeMap, BTreeSet};

use ledger::Kind;
use problem::formulation::{Design, Problem};
use rayon::prelude::*;
use store::{CriteriaRow, InfillRow, JobTimeRow, RoundRow};

use crate::calls;
use crate::infill::bits;
use crate::linear::LinearResponse;

/// The cost of an approach.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cost {
    pub simulator_calls: u64,
    /// CPU time, seconds.
    pub cpu_seconds: f64,
}

/// The cost of the DoE's samples, for the approaches that use them; `control_analyses` are those of
/// its control variates.
#[must_use]
pub fn sampling(
    problem: &Problem,
    criteria: &[CriteriaRow],
    samples: u64,
    control_analyses: u64,
    times: &[JobTimeRow],
) -> Cost {
    let is_design = |row: &&JobTimeRow| row.stream.kind == Kind::Design;
    Cost {
        simulator_calls: calls::sampling(problem, criteria, samples) + control_analyses,
        cpu_seconds: times
            .iter()
            .filter(is_design)
            .map(|row| row.cpu_seconds)
            .sum(),
    }
}

/// The cost of the DoE, the infill points and the rounds' decisions.
#[must_use]
pub fn enrichment(
    problem: &Problem,
    sampling: Cost,
    rounds: &[RoundRow],
    infill: &[InfillRow],
    control_analyses: u64,
    times: &[JobTimeRow],
) -> Cost {
    let numbers: BTreeSet<u64> = infill.iter().map(|row| row.number).collect();
    let calls = calls::infill(problem, rounds, infill) + control_analyses;
    Cost {
        simulator_calls: sampling.simulator_calls + calls,
        cpu_seconds: sampling.cpu_seconds
            + rounds.iter().map(|round| round.cpu_seconds).sum::<f64>()
            + infill_seconds(times, &numbers),
    }
}

/// The analyses that the control variates of infill points took.
#[must_use]
pub fn control_analyses(problem: &Problem, base: &Design, infill: &[InfillRow]) -> u64 {
    let places: BTreeMap<_, &[f64]> = infill.iter().map(|row| (bits(&row.x), &*row.x)).collect();
    let linear = |x: &[f64]| LinearResponse::of(problem.gears()?, &problem.design(x, base)).ok();
    let linear = places.par_iter().filter_map(|(_, x)| linear(x));
    linear.map(|linear| linear.analyses()).sum()
}

/// The CPU time of the samples of these infill points, seconds.
#[must_use]
pub fn infill_seconds(times: &[JobTimeRow], numbers: &BTreeSet<u64>) -> f64 {
    let is_infill =
        |row: &&JobTimeRow| row.stream.kind == Kind::Point && numbers.contains(&row.stream.index);
    times
        .iter()
        .filter(is_infill)
        .map(|row| row.cpu_seconds)
        .sum()
}
