//! The program of a session: a process that is kept, or a command that is run for each request.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use super::Exec;
use super::files::Files;
use super::process::Process;

/// A simulator that accepts requests.
#[derive(Debug)]
pub(super) enum Program {
    /// A process that answers lines with lines.
    Lines(Process),
    /// A command that answers files with files.
    Files(Files),
}

impl Program {
    /// Starts the program of `exec`. Once `stop` is set, the program is ended instead of waited
    /// for.
    ///
    /// # Errors
    ///
    /// A sentence.
    pub(super) fn start(exec: &Exec, stop: Arc<AtomicBool>) -> Result<Self, String> {
        match &exec.files {
            None => Process::start(&exec.command, stop).map(Self::Lines),
            Some(files) => Files::new(&exec.command, files, stop).map(Self::Files),
        }
    }

    /// Whether the program has ended.
    pub(super) fn has_ended(&self) -> bool {
        match self {
            Self::Lines(process) => process.has_ended(),
            Self::Files(_) => false,
        }
    }

    /// Sends a line and returns the answer. After an error, the program must not be used again.
    ///
    /// # Errors
    ///
    /// A sentence with the end of the program's standard error.
    pub(super) fn ask(&mut self, line: &str, timeout: Duration) -> Result<Vec<u8>, String> {
        match self {
            Self::Lines(process) => process.ask(line, timeout),
            Self::Files(files) => files.ask(line, timeout),
        }
    }

    /// Ends the program, whose `answer` is malformed, and returns the error.
    pub(super) fn refute(&mut self, answer: &[u8], reason: &str, line: &str) -> String {
        match self {
            Self::Lines(process) => process.refute(answer, reason, line),
            Self::Files(_) => format!("the simulator's results make no sense: {reason}"),
        }
    }
}
