//! The views of the page, as objects with a `schema_version`.
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

pub use best::{Best, BestDesign, BestOfDoe, best, of_optimum};
pub use chart::Chart;
pub use convergence::{Approach, Convergence, Run, convergence};
pub use responses::{Coordinate, Map, Point, Responses, map, responses};
pub use rounds::{Round, Rounds, rounds};

/// The version of all views except the status, which has its own.
pub const SCHEMA_VERSION: u32 = 1;

/// A number with its name and unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Named {
    /// The name.
    pub name: String,
    /// The unit, if the name does not contain it; empty for a number without one.
    pub unit: String,
    /// The number.
    pub value: f64,
}

/// The workers of a running coordinator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Workers {
    /// The version of this object.
    pub schema_version: u32,
    /// Whether a coordinator is running. A store alone does not record its workers.
    pub running: bool,
    /// Recent rate of stored samples, per second.
    pub samples_per_second: f64,
    /// The workers.
    pub workers: Vec<Worker>,
}

/// The workers in a status.
#[must_use]
pub fn workers(status: &Status) -> Workers {
    let live = status.live.as_ref();
    Workers {
        schema_version: SCHEMA_VERSION,
        running: live.is_some(),
        samples_per_second: live.map_or(0.0, |live| live.samples_per_second),
        workers: live.map_or_else(Vec::new, |live| live.workers.clone()),
    }
}

/// The recorded failures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Failures {
    /// The version of this object.
    pub schema_version: u32,
    /// Number of recorded failures.
    pub failures: u64,
    /// The failures grouped by cause.
    pub groups: Vec<FailureGroup>,
}

/// The failures in a status.
#[must_use]
pub fn failures(status: &Status) -> Failures {
    Failures {
        schema_version: SCHEMA_VERSION,
        failures: status.failures,
        groups: status.failure_groups.clone(),
    }
}

/// A value rounded to `digits` significant digits, for a chart or a table.
fn rounded(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = 10_f64.powi(digits - 1 - value.abs().log10().floor() as i32);
    if scale.is_finite() && scale > 0.0 {
        (value * scale).round() / scale
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_keeps_significant_digits() {
        assert_eq!(rounded(123.456_78, 6), 123.457);
        assert_eq!(rounded(-0.000_123_456_78, 6), -0.000_123_457);
        assert_eq!(rounded(0.0, 6), 0.0);
        assert_eq!(rounded(1e-320, 6), 1e-320);
        assert!(rounded(f64::NAN, 6).is_nan());
    }
}
