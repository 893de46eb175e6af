//! The scenario of a simulation.

use serde::Serialize;

/// A cluster and its jobs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scenario {
    pub workers: u32,
    /// Number of jobs that a worker computes at once.
    pub slots: u32,
    /// Mean time of a sample, in seconds; single leases vary by 20 %.
    pub sample_seconds: f64,
    pub samples_per_design: u32,
    /// Simulated time, in seconds.
    pub seconds: f64,
    /// Duration of a lease, in seconds; longer with more than 2500 workers.
    pub lease_seconds: f64,
    /// Mean time of a message one way, in seconds.
    pub network_seconds: f64,
    /// Mean time between failures of a worker, in seconds; none if workers never fail.
    pub failure_seconds: Option<f64>,
    /// Preemption of many workers at once.
    pub wave: Option<Wave>,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Repeated preemption of many workers at once.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wave {
    /// Time between two waves, in seconds.
    pub every_seconds: f64,
    /// Share of the workers that a wave takes.
    pub share: f64,
    /// Time until the workers are back, in seconds.
    pub away_seconds: f64,
}

impl Scenario {
    /// Returns a scenario of workers with one slot that never fail. Its time is enough for several samples each.
    #[must_use]
    pub fn new(workers: u32, sample_seconds: f64) -> Self {
        Self {
            workers,
            slots: 1,
            sample_seconds,
            samples_per_design: 30,
            seconds: (5.0 * sample_seconds).max(20.0),
            lease_seconds: 30.0,
            network_seconds: 1e-3,
            failure_seconds: None,
            wave: None,
            seed: 1,
        }
    }
}
