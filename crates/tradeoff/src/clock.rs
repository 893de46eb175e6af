//! CPU time.

use rustix::time::{ClockId, clock_gettime};

/// CPU seconds of this process so far.
#[must_use]
pub fn process_seconds() -> f64 {
    seconds(ClockId::ProcessCPUTime)
}

/// CPU microseconds of this thread so far.
pub(crate) fn thread_micros() -> f64 {
    1e6 * seconds(ClockId::ThreadCPUTime)
}

fn seconds(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
