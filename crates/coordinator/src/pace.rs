//! How many samples came in lately.

use std::collections::VecDeque;
use std::time::Duration;

/// What "lately" means.
const WINDOW: Duration = Duration::from_secs(20);

/// Counts are kept in steps of this length.
const STEP: Duration = Duration::from_millis(500);

/// A count over the last [`WINDOW`].
#[derive(Debug, Clone, Default)]
pub(crate) struct Pace {
    /// (start of a step, what was counted in it), ascending.
    steps: VecDeque<(Duration, u64)>,
    /// When something was counted first.
    since: Option<Duration>,
}

impl Pace {
    pub(crate) fn count(&mut self, now: Duration, amount: u64) {
        self.since.get_or_insert(now);
        match self.steps.back_mut() {
            Some((start, count)) if now < *start + STEP => *count += amount,
            _ => self.steps.push_back((now, amount)),
        }
        while self
            .steps
            .front()
            .is_some_and(|(start, _)| *start + WINDOW < now)
        {
            self.steps.pop_front();
        }
    }

    /// Per second over the window, or since the first count if that is less long ago.
    pub(crate) fn per_second(&self, now: Duration) -> f64 {
        let Some(since) = self.since else {
            return 0.0;
        };
        let span = now.saturating_sub(since).clamp(STEP, WINDOW);
        let recent = self.steps.iter().filter(|(start, _)| *start + span >= now);
        recent.map(|(_, count)| *count).sum::<u64>() as f64 / span.as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_that_of_the_last_seconds() {
        let mut pace = Pace::default();
        assert_eq!(pace.per_second(Duration::from_secs(1)), 0.0);
        for tenth in 0..600 {
            let rate = if tenth < 300 { 50 } else { 10 };
            pace.count(Duration::from_millis(100 * tenth), rate);
        }
        let rate = pace.per_second(Duration::from_secs(60));
        assert!((rate - 100.0).abs() < 5.0, "{rate} per second");
        let long_after = pace.per_second(Duration::from_secs(200));
        assert_eq!(long_after, 0.0);
    }
}
