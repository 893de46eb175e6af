//! One process of a round.

use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use super::Violation;

/// Longer than a well-behaved process takes to end on request.
pub(crate) const FAREWELL: Duration = Duration::from_secs(20);

/// A process that logs to the folder of its round. It is killed when it is dropped.
pub(crate) struct Process {
    child: Child,
    pub(crate) name: String,
    pub(crate) since: Instant,
    /// Whether SIGSTOP was sent to it.
    pub(crate) stopped: bool,
    /// Whether SIGTERM was sent to it.
    pub(crate) is_asked: bool,
}

impl Process {
    /// Starts a command that logs to a file in the round's folder.
    pub(crate) fn start(
        mut command: Command,
        folder: &Path,
        name: String,
    ) -> Result<Self, Violation> {
        let log = File::create(folder.join(format!("{name}.log")))
            .map_err(|error| Violation(format!("no log: {error}")))?;
        let child = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn();
        Ok(Self {
            child: child.map_err(|error| Violation(format!("{name} does not start: {error}")))?,
            name,
            since: Instant::now(),
            stopped: false,
            is_asked: false,
        })
    }

    /// The exit status, if the process has ended.
    pub(crate) fn ended(&mut self) -> Result<Option<ExitStatus>, Violation> {
        let name = &self.name;
        let ended = self.child.try_wait();
        ended.map_err(|error| Violation(format!("{name} cannot be waited for: {error}")))
    }

    /// The exit status, if the process ends in time.
    pub(crate) fn ended_within(&mut self, patience: Duration) -> Option<ExitStatus> {
        let since = Instant::now();
        while since.elapsed() < patience {
            if let Ok(Some(status)) = self.ended() {
                return Some(status);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        None
    }

    /// The exit status of a process that was asked to leave.
    pub(crate) fn farewell(&mut self) -> Result<ExitStatus, Violation> {
        self.ended_within(FAREWELL).ok_or_else(|| {
            let (seconds, name) = (FAREWELL.as_secs(), &self.name);
            Violation(format!("{name} did not end within {seconds} s of SIGTERM"))
        })
    }

    /// Whether the process holds a lock on any file.
    pub(crate) fn holds_a_lock(&self) -> bool {
        // Lines such as "1: FLOCK  ADVISORY  WRITE 4711 08:02:1234 0 EOF". A waiting process has an
        // arrow.
        let locks = std::fs::read_to_string("/proc/locks").unwrap_or_default();
        let id = self.child.id().to_string();
        let is_its = |line: &str| {
            let fields: Vec<&str> = line.split_whitespace().collect();
            fields.get(1) != Some(&"->") && fields.get(4) == Some(&id.as_str())
        };
        locks.lines().any(is_its)
    }

    /// Sends a signal.
    pub(crate) fn signal(&self, signal: Signal) {
        let id = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        if let Some(id) = id {
            // The process has not been waited for, so the id is still its own.
            let _ = kill_process(id, signal);
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
