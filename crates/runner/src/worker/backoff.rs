//! Growing pauses between attempts, randomised so that many workers do not call at the same time.

use std::time::Duration;

use rand::RngExt as _;
use rand::rngs::SmallRng;

const FIRST: Duration = Duration::from_millis(50);
const LONGEST: Duration = Duration::from_secs(5);

/// Exponentially growing pauses.
#[derive(Debug)]
pub(crate) struct Backoff {
    next: Duration,
    rng: SmallRng,
}

impl Backoff {
    pub(crate) fn new() -> Self {
        Self {
            next: FIRST,
            rng: rand::make_rng(),
        }
    }

    /// Waits for a random time between half of the current pause and all of it, then doubles it.
    pub(crate) async fn pause(&mut self) {
        let pause = self.next.mul_f64(self.rng.random_range(0.5..=1.0));
        self.next = (self.next * 2).min(LONGEST);
        tokio::time::sleep(pause).await;
    }

    /// Starts again with the shortest pause.
    pub(crate) fn reset(&mut self) {
        self.next = FIRST;
    }
}
