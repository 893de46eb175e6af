//! What came of a scenario.

use serde::Serialize;

/// CPU time of a call beside the ledger, seconds: socket, TLS, HTTP/2 and their system calls. Measured with
/// `cargo run --release -p coordinator --example load -- noop`, whose leases take two calls each.
pub const CALL_SECONDS: f64 = 40e-6;

/// CPU time of a sample in the store, seconds, commit included; measured with the same program's `overhead`.
pub const SAMPLE_SECONDS: f64 = 0.5e-6;

/// Calls by kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Calls {
    /// Introductions.
    pub register: u64,
    /// Requests for leases.
    pub lease: u64,
    /// Results.
    pub report: u64,
    /// Signs of life.
    pub heartbeat: u64,
    /// Leases given back.
    pub release: u64,
}

impl Calls {
    /// All of them.
    #[must_use]
    pub const fn all(&self) -> u64 {
        self.register + self.lease + self.report + self.heartbeat + self.release
    }
}

/// What came of a scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rehearsed {
    /// Simulated time, seconds.
    pub seconds: f64,
    /// Samples that were delivered.
    pub samples: u64,
    /// Samples that were computed and lost with their workers.
    pub lost_samples: u64,
    /// Share of the slots' time in which they computed what was delivered.
    pub busy: f64,
    /// Calls by kind.
    pub calls: Calls,
    /// Bytes of leases and results.
    pub message_bytes: u64,
    /// The most leases that were out.
    pub most_leases: u64,
    /// Jobs that were quarantined: none of them failed, so there should be none.
    pub quarantined: u64,
    /// CPU time of the ledger and of messages, seconds; measured, so it differs from run to run.
    pub ledger_cpu_seconds: f64,
}

impl Rehearsed {
    /// Processors that the coordinator keeps busy: the ledger's measured time, and calls and samples by
    /// [`CALL_SECONDS`] and [`SAMPLE_SECONDS`].
    #[must_use]
    pub fn coordinator_cores(&self) -> f64 {
        let beside = self.calls.all() as f64 * CALL_SECONDS + self.samples as f64 * SAMPLE_SECONDS;
        (self.ledger_cpu_seconds + beside) / self.seconds
    }
}
