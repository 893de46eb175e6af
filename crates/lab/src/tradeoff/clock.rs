//! CPU time.

use rustix::time::{ClockId, clock_gettime};

/// CPU time of this process so far, in seconds.
#[must_use]
pub fn process_seconds() -> f64 {
    seconds(ClockId::ProcessCPUTime)
}

/// CPU time of this thread so far, in microseconds.
pub(crate) fn thread_micros() -> f64 {
    1e6 * seconds(ClockId::ThreadCPUTime)
}

fn seconds(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
