//! The views of the page.
//!
//! The status is that of `coordinator status`.

mod best;
mod chart;
mod convergence;
mod responses;
mod rounds;

use crate::running::Worker;
use crate::status::{FailureGroup, Status};
use serde::Serialize;

pub use best::{BestDesign, BestOfDoe, BestView, best, of_optimum};
pub use chart::Chart;
pub use convergence::{ApproachRuns, Convergence, convergence};
pub use responses::{Coordinate, Map, Point, Responses, map, responses};
pub use rounds::{Rounds, rounds};

/// The workers of a running coordinator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Workers {
    /// Whether a coordinator is running. A store alone does not record its workers.
    pub running: bool,
    /// Recent rate of stored samples, per second.
    pub samples_per_second: f64,
    pub workers: Vec<Worker>,
}

/// The workers in a status.
#[must_use]
pub fn workers(status: &Status) -> Workers {
    let live = status.live.as_ref();
    Workers {
        running: live.is_some(),
        samples_per_second: live.map_or(0.0, |live| live.samples_per_second),
        workers: live.map_or_else(Vec::new, |live| live.workers.clone()),
    }
}

/// The recorded failures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Failures {
    /// Number of recorded failures.
    pub failures: u64,
    /// The failures grouped by cause.
    pub groups: Vec<FailureGroup>,
}

/// The failures in a status.
#[must_use]
pub fn failures(status: &Status) -> Failures {
    Failures {
        failures: status.failures,
        groups: status.failure_groups.clone(),
    }
}
