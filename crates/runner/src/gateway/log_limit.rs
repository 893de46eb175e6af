//! A rate limit on log lines that strangers can cause.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Allows one line per second and counts the suppressed ones.
#[derive(Debug, Default)]
pub(crate) struct LogLimit {
    last: Mutex<Option<Instant>>,
    suppressed: AtomicU64,
}

impl LogLimit {
    /// The number of lines suppressed since the last one, if a line may be written now.
    pub(crate) fn permit(&self) -> Option<u64> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_some_and(|last| last.elapsed() < Duration::from_secs(1)) {
            self.suppressed.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        *last = Some(Instant::now());
        Some(self.suppressed.swap(0, Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thousand_lines_become_one_that_counts_them() {
        let limit = LogLimit::default();
        assert_eq!(limit.permit(), Some(0));
        for _ in 0..1000 {
            assert_eq!(limit.permit(), None);
        }
        *limit.last.lock().unwrap() = None;
        assert_eq!(limit.permit(), Some(1000));
    }
}
