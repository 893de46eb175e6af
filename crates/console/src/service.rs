//! Messages to the service manager that started the program, sd_notify(3). Without one they are not sent.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// Says that the program is ready, so that a service of `Type=notify` counts as started. A service manager
/// that cannot be told finds out by its own time limit.
pub fn ready() {
    let _ = sd_notify::notify(&[NotifyState::Ready]);
}

/// The service manager's watchdog, which restarts a program that has not fed it in time.
#[derive(Debug)]
pub struct Watchdog {
    /// How often to feed it; none without a watchdog.
    period: Option<Duration>,
    fed: Option<Instant>,
}

impl Watchdog {
    /// The watchdog that the environment names.
    #[must_use]
    pub fn from_environment() -> Self {
        Self {
            // Thrice in its time: one feeding may come late.
            period: sd_notify::watchdog_enabled().map(|time| time / 3),
            fed: None,
        }
    }

    /// Feeds it, if it is time.
    pub fn feed(&mut self) {
        let Some(period) = self.period else {
            return;
        };
        if self.fed.is_none_or(|fed| fed.elapsed() >= period) {
            self.fed = Some(Instant::now());
            let _ = sd_notify::notify(&[NotifyState::Watchdog]);
        }
    }
}
