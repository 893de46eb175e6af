//! A rate limit on log lines that strangers can cause.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Allows one line per second and counts the suppressed ones.
#[derive(Debug, Default)]
pub(crate) struct Sparing {
    last: Mutex<Option<Instant>>,
    held_back: AtomicU64,
}

impl Sparing {
    /// The number of lines suppressed since the last one, if a line may be written now.
    pub(crate) fn may_speak(&self) -> Option<u64> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_some_and(|last| last.elapsed() < Duration::from_secs(1)) {
            self.held_back.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        *last = Some(Instant::now());
        Some(self.held_back.swap(0, Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thousand_lines_become_one_that_counts_them() {
        let sparing = Sparing::default();
        assert_eq!(sparing.may_speak(), Some(0));
        for _ in 0..1000 {
            assert_eq!(sparing.may_speak(), None);
        }
        *sparing.last.lock().unwrap() = None;
        assert_eq!(sparing.may_speak(), Some(1000));
    }
}
