//! Limits and time constants of a ledger.

use std::time::Duration;

/// Heartbeats of a worker in the time of a lease.
pub const HEARTBEATS_PER_LEASE: u32 = 6;

/// Heartbeats of all workers together, per second, above which leases get longer. A heartbeat costs the coordinator
/// some 200 µs, so this number takes a tenth of a processor.
const HEARTBEATS_PER_SECOND: f64 = 500.0;

/// Minimum lease that keeps the heartbeats of this many workers below [`HEARTBEATS_PER_SECOND`].
pub(crate) fn lease_for(workers: usize) -> Duration {
    let period = workers as f64 / HEARTBEATS_PER_SECOND;
    Duration::from_secs_f64(period * f64::from(HEARTBEATS_PER_LEASE))
}

/// The limits of a [`Ledger`](crate::Ledger).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Duration of a lease without a heartbeat. It should span several heartbeats, so that losing one loses no work.
    /// The ledger lengthens it if the heartbeats of all workers would exceed 500 per second: above 2500 workers with
    /// the default of 30 s.
    pub lease: Duration,
    /// Crashes of different worker processes after which a stream is quarantined; at least 1.
    pub max_crashes: usize,
    /// Failed attempts of a sample, or of a design's analyses, after which the failure is final; at least 1. An attempt
    /// after the first counts only if its worker has succeeded with something else since the attempt before: otherwise
    /// the fault may be in something that all designs depend on.
    pub max_failures: u32,
    /// Wait after a first failure. Each further wait is four times as long, up to
    /// [`Self::longest_wait`].
    pub retry_after: Duration,
    /// The longest wait after a failure.
    pub longest_wait: Duration,
    /// How long everything may fail before streams with [`Self::max_failures`] failed attempts are
    /// quarantined. A shorter outage, for example of a licence server, only delays the campaign.
    pub retry_for: Duration,
    /// Streams that a worker may fail without a delivery in between before it gets a control; at least 1. The worker is
    /// suspended if it fails the control, too, or if there is no control.
    pub max_worker_strikes: usize,
    /// Length of a worker's first suspension. Each suspension in a row is twice as long while other
    /// workers deliver, up to 32 times.
    pub suspension: Duration,
    /// Whether a sample may take hours. Until the first is delivered, a lease then has a single
    /// sample.
    pub long_samples: bool,
    /// Number of samples known beforehand, for each of the first designs. A worker that delivers only these has not
    /// shown that its simulator works.
    pub known_samples: Vec<u32>,
    /// Whether several designs may share a lease. Only benchmarks set this to false.
    pub bundle: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            lease: Duration::from_secs(30),
            max_crashes: 3,
            max_failures: 3,
            retry_after: Duration::from_millis(500),
            longest_wait: Duration::from_secs(15),
            retry_for: Duration::from_secs(60),
            max_worker_strikes: 3,
            suspension: Duration::from_secs(10),
            long_samples: false,
            known_samples: Vec::new(),
            bundle: true,
        }
    }
}
