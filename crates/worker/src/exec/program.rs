//! Who answers the questions of a session: a process that is kept, or a program that is run for each.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use super::Exec;
use super::files::Files;
use super::process::Process;

/// A simulator, ready to be asked.
#[derive(Debug)]
pub(super) enum Program {
    /// Answers lines with lines.
    Lines(Process),
    /// Answers files with files.
    Files(Files),
}

impl Program {
    /// Starts what `exec` names. Once `stop` is set, it is ended instead of waited for.
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

    /// Whether it cannot be asked any more.
    pub(super) fn has_ended(&self) -> bool {
        match self {
            Self::Lines(process) => process.has_ended(),
            Self::Files(_) => false,
        }
    }

    /// Asks a line and returns the answer. After an error it is of no use any more.
    ///
    /// # Errors
    ///
    /// A sentence with what the program said last.
    pub(super) fn ask(&mut self, line: &str, timeout: Duration) -> Result<Vec<u8>, String> {
        match self {
            Self::Lines(process) => process.ask(line, timeout),
            Self::Files(files) => files.ask(line, timeout),
        }
    }

    /// Ends the program, whose `answer` makes no sense, and says so.
    pub(super) fn refute(&mut self, answer: &[u8], reason: &str, line: &str) -> String {
        match self {
            Self::Lines(process) => process.refute(answer, reason, line),
            Self::Files(_) => format!("the simulator's results make no sense: {reason}"),
        }
    }
}
