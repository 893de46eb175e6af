//! Points at which a test ends the process as `kill -9` does. See the crate's documentation.

use std::str::FromStr;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

const NAMES: [&str; 4] = ["before_commit", "after_commit", "checkpoint", "creation"];

/// The fail point that was set, and how often the process has reached it.
static SET: OnceLock<(FailPoint, AtomicU32)> = OnceLock::new();

/// A place in the code at which the process ends.
#[derive(Clone, Debug)]
pub struct FailPoint {
    name: String,
    /// How often the process passes the point before it ends there.
    passes: u32,
    /// The time between reaching the point and the end of the process.
    delay: Duration,
}

impl FailPoint {
    /// Makes this process end at the point. Only the first call in a process has an effect.
    pub fn set(self) {
        let _ = SET.set((self, AtomicU32::new(0)));
    }
}

impl FromStr for FailPoint {
    type Err = String;

    /// Reads `NAME`, `NAME:PASSES` or `NAME:PASSES:MICROSECONDS`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let read = || {
            let mut fields = text.splitn(3, ':');
            let name = fields
                .next()
                .filter(|name| NAMES.contains(name))?
                .to_owned();
            let mut number = || {
                fields
                    .next()
                    .map_or(Some(0), |text| text.parse::<u32>().ok())
            };
            Some(Self {
                name,
                passes: number()?,
                delay: Duration::from_micros(number()?.into()),
            })
        };
        read().ok_or_else(|| {
            format!(
                "NAME, NAME:PASSES or NAME:PASSES:MICROSECONDS is expected, NAME being one of {}",
                NAMES.join(", ")
            )
        })
    }
}

/// Ends the process if this is the fail point that was set and its passes are used up.
pub(crate) fn at(name: &str) {
    let Some((point, reached)) = SET.get() else {
        return;
    };
    if point.name != name || reached.fetch_add(1, Ordering::Relaxed) != point.passes {
        return;
    }
    if point.delay.is_zero() {
        std::process::abort();
    }
    std::thread::spawn(|| {
        std::thread::sleep(point.delay);
        std::process::abort();
    });
}
