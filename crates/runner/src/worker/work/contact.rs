//! How long the coordinator has been away, and when this worker leaves because of it.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tracing::{info, warn};

use super::SharedState;
use crate::worker::error::Error;

/// How long the coordinator may be away before the worker says so and writes its results to a file.
pub(super) const SILENCE: Duration = Duration::from_secs(10);

/// The answers of the coordinator.
#[derive(Debug, Default)]
pub(super) struct Contact {
    /// The first call without an answer since the last answer.
    away_since: Mutex<Option<Instant>>,
}

impl Contact {
    fn since(&self) -> MutexGuard<'_, Option<Instant>> {
        // A panic cannot leave an update half done.
        self.away_since
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes that a call was answered.
    pub(super) fn answered(&self) {
        *self.since() = None;
    }

    /// Notes that a call was not answered.
    pub(super) fn missed(&self) {
        self.since().get_or_insert_with(Instant::now);
    }

    /// How long the coordinator has been away, if it is.
    pub(super) fn away(&self) -> Option<Duration> {
        self.since().map(|since| since.elapsed())
    }
}

impl SharedState {
    /// Waits until the coordinator has been away for the time limit of the options. Time in which
    /// jobs are computed does not count: their results will be wanted. A coordinator that has removed
    /// its access file does not come back: the wait is short.
    pub(super) async fn away(&self) -> Error {
        let limit = self.options.give_up_after;
        let mut has_complained = false;
        let mut idle_since = Instant::now();
        loop {
            tokio::time::sleep(limit.min(Duration::from_millis(200))).await;
            let computing = self.held.computing();
            if computing > 0 {
                idle_since = Instant::now();
            }
            let Some(away) = self.contact.away() else {
                if std::mem::take(&mut has_complained) {
                    info!("the coordinator answers again");
                }
                continue;
            };
            let waited = away.min(idle_since.elapsed());
            if away > SILENCE && !has_complained {
                has_complained = true;
                let leaving_in = limit.saturating_sub(waited).as_secs();
                let address = self.connection.address();
                if computing > 0 {
                    warn!(%address, computing, leaving_in, "the coordinator does not answer; running jobs \
                        are finished before the time limit begins");
                } else {
                    warn!(%address, leaving_in, "the coordinator does not answer");
                }
            }
            if waited > SILENCE && self.connection.is_abandoned() {
                let address = self.connection.address();
                return crate::gateway::Error::Gone { address }.into();
            }
            if waited > limit {
                return crate::gateway::Error::Away {
                    address: self.connection.address(),
                    seconds: limit.as_secs(),
                }
                .into();
            }
        }
    }
}
