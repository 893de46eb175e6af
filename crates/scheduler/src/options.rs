//! How patient a scheduler is.

use std::time::Duration;

/// The limits a [`Scheduler`](crate::Scheduler) works with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// How long a job stays with a worker that does not mention it. Several heartbeats long, so
    /// that a lost one is no loss of work.
    pub lease: Duration,
    /// A job that was running on this many workers when they went silent is quarantined. At
    /// least 1 is assumed.
    pub max_crashes: u32,
    /// A job that failed this many times is quarantined. At least 1 is assumed.
    pub max_failures: u32,
    /// A worker that failed this many different jobs, without finishing any in between, is set
    /// aside. At least 1 is assumed.
    pub max_worker_strikes: u32,
    /// How long a worker is set aside the first time; each time in a row is twice as long, up to
    /// 32 times. Not for good: with bad jobs and few workers the campaign would stand still.
    pub set_aside: Duration,
    /// Whether idle workers get jobs that another worker holds when nothing else is left.
    pub duplicate_tail: bool,
    /// How long a job must have been held before it is leased a second time: about twice what a
    /// job usually takes, as a second lease of a job that is nearly done is wasted work.
    pub duplicate_after: Duration,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            lease: Duration::from_secs(60),
            max_crashes: 3,
            max_failures: 3,
            max_worker_strikes: 3,
            set_aside: Duration::from_secs(30),
            duplicate_tail: true,
            duplicate_after: Duration::ZERO,
        }
    }
}
