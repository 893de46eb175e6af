//! How patient a ledger is.

use std::time::Duration;

/// The limits a [`Ledger`](crate::Ledger) works with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// How long a lease lasts that its worker does not mention. Several heartbeats long, so that a
    /// lost one is no loss of work.
    pub lease: Duration,
    /// A stream that this many worker processes fell silent over is quarantined. At least 1 is assumed.
    pub max_crashes: usize,
    /// A stream that failed this many times is quarantined. At least 1 is assumed.
    pub max_failures: u32,
    /// How long a stream waits after its first failure; after each further one, four times as
    /// long. What fails for a moment, as a licence server that is away, must not fail for good.
    pub retry_after: Duration,
    /// A worker that failed this many streams, without delivering anything in between, is
    /// suspended. At least 1 is assumed.
    pub max_worker_strikes: usize,
    /// How long a worker is suspended the first time; each time in a row is twice as long, up to 32
    /// times. A worker that is the only one at work is suspended three times in a row at most: with
    /// bad streams the campaign would stand still.
    pub suspension: Duration,
    /// Whether a sample may take hours: until one has come back, a lease has a single sample.
    pub long_samples: bool,
    /// Whether several designs may share a lease. Only measurements say no.
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
