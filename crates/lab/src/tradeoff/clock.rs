//! CPU time.

use rustix::time::{ClockId, clock_gettime};

/// CPU time of this process so far, in seconds.
#[must_use]
pub fn process_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
