//! The cost of each stage.

use crate::number::{MISSING, count, seconds};
use crate::snapshot::Snapshot;

/// The rows of the table, and its sum.
pub(super) struct StagesView {
    /// Stage, calls of the simulator, wall time and CPU time.
    pub(super) rows: Vec<[String; 4]>,
    /// Calls, wall time and CPU time of all stages together.
    pub(super) total: [String; 4],
}

impl StagesView {
    pub(super) fn new(snapshot: &Snapshot) -> Self {
        let costs = &snapshot.costs;
        let row = |name: String, calls: u64, wall: f64, cpu: f64| {
            let calls = match calls {
                0 => MISSING.to_owned(),
                calls => count(calls),
            };
            [name, calls, seconds(wall), seconds(cpu)]
        };
        let rows = costs.iter().map(|cost| {
            let calls = snapshot.calls(cost.stage);
            row(
                cost.stage.to_string(),
                calls,
                cost.wall_seconds,
                cost.cpu_seconds,
            )
        });
        Self {
            rows: rows.collect(),
            total: row(
                "all stages".to_owned(),
                snapshot.simulator_calls(),
                total(costs.iter().map(|cost| cost.wall_seconds)),
                total(costs.iter().map(|cost| cost.cpu_seconds)),
            ),
        }
    }
}

/// The sum of the times that are known; NaN if none is.
fn total(seconds: impl Iterator<Item = f64>) -> f64 {
    let mut known = seconds.filter(|seconds| seconds.is_finite());
    let first = known.next();
    first.map_or(f64::NAN, |first| first + known.sum::<f64>())
}
