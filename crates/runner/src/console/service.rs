//! Messages to the service manager that started the program, sd_notify(3). Without one, none are
//! sent.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// Reports that the program is ready, so that a service of `Type=notify` counts as started. If the
/// message cannot be sent, the service manager's own time limit applies.
pub fn ready() {
    let _ = sd_notify::notify(&[NotifyState::Ready]);
}

/// The service manager's watchdog, which restarts a program that does not report in time.
#[derive(Debug)]
pub struct Watchdog {
    /// Interval between reports; `None` without a watchdog.
    period: Option<Duration>,
    fed: Option<Instant>,
}

impl Watchdog {
    /// The watchdog named by the environment.
    #[must_use]
    pub fn from_environment() -> Self {
        Self {
            // A third of the limit, so that one report may be late.
            period: sd_notify::watchdog_enabled().map(|time| time / 3),
            fed: None,
        }
    }

    /// Reports to the watchdog if a report is due.
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
