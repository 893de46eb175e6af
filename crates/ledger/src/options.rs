//! Limits and time constants of a ledger.

use std::time::Duration;

/// Heartbeats of a worker in the time of a lease.
pub const HEARTBEATS_PER_LEASE: u32 = 6;

/// Heartbeats of all workers together, per second, above which leases get longer. A heartbeat costs the
/// coordinator some 200 µs, so that all of them take a tenth of a processor.
const HEARTBEATS_PER_SECOND: f64 = 500.0;

/// Shortest lease with which so many workers do not send more heartbeats than that.
pub(crate) fn lease_for(workers: usize) -> Duration {
    let period = workers as f64 / HEARTBEATS_PER_SECOND;
    Duration::from_secs_f64(period * f64::from(HEARTBEATS_PER_LEASE))
}

/// The limits of a [`Ledger`](crate::Ledger).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Duration of a lease without a heartbeat. It should span several heartbeats, so that losing
    /// one loses no work. Above 2500 workers it is longer: see [`HEARTBEATS_PER_LEASE`].
    pub lease: Duration,
    /// Crashes of different worker processes after which a stream is quarantined; at least 1.
    pub max_crashes: usize,
    /// Failures after which a stream is quarantined; at least 1.
    pub max_failures: u32,
    /// Wait of a stream after its first failure. Each further wait is four times as long, so that a
    /// passing fault, such as a licence server that is down, does not quarantine it.
    pub retry_after: Duration,
    /// Streams that a worker may fail without a delivery in between before it is suspended; at
    /// least 1.
    pub max_worker_strikes: usize,
    /// Length of a worker's first suspension. Each suspension in a row is twice as long, up to 32
    /// times. A worker that is the only one at work is suspended at most three times in a row:
    /// otherwise bad streams would halt the campaign.
    pub suspension: Duration,
    /// Whether a sample may take hours. Until the first is delivered, a lease then has a single
    /// sample.
    pub long_samples: bool,
    /// Whether several designs may share a lease. Only benchmarks set this to false.
    pub bundle: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            lease: Duration::from_secs(30),
            max_crashes: 3,
            max_failures: 3,
            retry_after: Duration::from_secs(1),
            max_worker_strikes: 3,
            suspension: Duration::from_secs(10),
            long_samples: false,
            bundle: true,
        }
    }
}
