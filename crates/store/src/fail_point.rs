//! Points at which a test ends the process as `kill -9` does. See the crate's documentation.

use std::str::FromStr;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// The fail point that was set, and how often the process has reached it.
static SET: OnceLock<(FailPoint, AtomicU32)> = OnceLock::new();

/// A place in the code at which the process ends.
#[derive(Clone, Debug)]
pub struct FailPoint {
    name: String,
    /// The number of times that the process passes the point before.
    passes: u32,
    /// The time for which the process goes on after it reached the point.
    delay: Duration,
}

impl FailPoint {
    /// Ends this process at the point. Of several points the first one counts.
    pub fn set(self) {
        let _ = SET.set((self, AtomicU32::new(0)));
    }
}

impl FromStr for FailPoint {
    type Err = std::num::ParseIntError;

    /// Reads `NAME`, `NAME:PASSES` or `NAME:PASSES:MICROSECONDS`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut fields = text.splitn(3, ':');
        let name = fields.next().unwrap_or_default().to_owned();
        let mut number = || fields.next().map_or(Ok(0), str::parse::<u32>);
        Ok(Self {
            name,
            passes: number()?,
            delay: Duration::from_micros(number()?.into()),
        })
    }
}

/// Ends the process if it is to end at this point.
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
