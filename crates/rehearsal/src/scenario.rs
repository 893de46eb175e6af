//! What is simulated.

use serde::Serialize;

/// A cluster and its jobs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scenario {
    /// Worker processes.
    pub workers: u32,
    /// Jobs that each computes at once.
    pub slots: u32,
    /// Mean time of a sample, seconds; single ones vary by 20 %.
    pub sample_seconds: f64,
    /// Samples of a design.
    pub samples_per_design: u32,
    /// Simulated time, seconds.
    pub seconds: f64,
    /// Time of a lease, seconds; above 5000 workers it is longer.
    pub lease_seconds: f64,
    /// Mean time of a message one way, seconds.
    pub network_seconds: f64,
    /// Mean time between failures of a worker, seconds; none for workers that never fail.
    pub failure_seconds: Option<f64>,
    /// Preemption of many workers at once.
    pub wave: Option<Wave>,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Preemption of many workers at once, again and again.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wave {
    /// Time between two waves, seconds.
    pub every_seconds: f64,
    /// Share of the workers that a wave takes.
    pub share: f64,
    /// Time until they are back, seconds.
    pub away_seconds: f64,
}

impl Scenario {
    /// Workers of one slot that never fail, for so long that each has several samples.
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
