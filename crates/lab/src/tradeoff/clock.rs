//! CPU time.

use std::hint::black_box;

use runner::cpu::thread_seconds;
use rustix::time::{ClockId, clock_gettime};

/// CPU time of this process so far, in seconds.
#[must_use]
pub fn process_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Number of measurements of a time.
const REPEATED: u32 = 5;

/// CPU time of `work`, in microseconds: the minimum of several runs, because caches are cold at
/// first and the processor is shared.
pub(crate) fn micros<T>(mut work: impl FnMut() -> T) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..REPEATED {
        let start = thread_seconds();
        black_box(work());
        least = least.min(thread_seconds() - start);
    }
    1e6 * least
}
