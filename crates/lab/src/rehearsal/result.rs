//! The result of a scenario.

use serde::Serialize;

/// CPU time of a call besides the ledger, in seconds: socket, TLS, HTTP/2 and their system calls.
/// The threads of a coordinator took 1.9 s for 10 000 heartbeats in `cargo bench -p coordinator
/// --bench load -- crowd`, with one connection per worker, on two shared processors.
pub const CALL_SECONDS: f64 = 190e-6;

/// CPU time of a sample in the coordinator and its store, in seconds, commit included. Measured with
/// the same program's `overhead`.
pub const SAMPLE_SECONDS: f64 = 2e-6;

/// Numbers of calls by kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Calls {
    pub register: u64,
    pub lease: u64,
    pub report: u64,
    pub heartbeat: u64,
    pub release: u64,
}

impl Calls {
    /// The number of calls of all kinds.
    #[must_use]
    pub const fn all(&self) -> u64 {
        self.register + self.lease + self.report + self.heartbeat + self.release
    }
}

/// The result of a scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rehearsal {
    /// Simulated time, in seconds.
    pub seconds: f64,
    /// Number of delivered samples.
    pub samples: u64,
    /// Number of samples lost with their workers.
    pub lost_samples: u64,
    /// Share of the slots' time spent on delivered samples.
    pub busy: f64,
    pub calls: Calls,
    /// Size of all leases and results, in bytes.
    pub message_bytes: u64,
    /// Maximum number of leases at a time.
    pub most_leases: u64,
    /// Number of quarantined jobs. No job fails, so there should be none.
    pub quarantined: u64,
    /// CPU time of the ledger and of messages, in seconds; measured, so it differs from run to run.
    pub ledger_cpu_seconds: f64,
}

impl Rehearsal {
    /// Number of processors that the coordinator keeps busy: the ledger's measured time, plus calls
    /// and samples by [`CALL_SECONDS`] and [`SAMPLE_SECONDS`].
    #[must_use]
    pub fn coordinator_cores(&self) -> f64 {
        let beside = self.calls.all() as f64 * CALL_SECONDS + self.samples as f64 * SAMPLE_SECONDS;
        (self.ledger_cpu_seconds + beside) / self.seconds
    }
}
