//! The errors that end a worker.

use crate::exit::{self, HasExitCode};

/// An error that ends a worker.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The coordinator cannot be reached, or refused.
    #[error(transparent)]
    Gateway(#[from] crate::gateway::Error),
    /// The campaign needs another simulator than the one that this worker has.
    #[error("{reason}")]
    WrongSimulator {
        /// The mismatch, and the options that resolve it.
        reason: String,
    },
    /// The external simulator fails on the probe questions, which every worker asks first.
    #[error("the external simulator is unusable: {reason}")]
    Program {
        /// The program's failure.
        reason: String,
    },
    /// The compute threads cannot be started.
    #[error("cannot start {slots} compute threads: {reason}")]
    Threads {
        /// The number of threads.
        slots: usize,
        /// The system's error.
        reason: String,
    },
}

impl HasExitCode for Error {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Gateway(error) => error.exit_code(),
            Self::WrongSimulator { .. } => exit::REFUSED,
            Self::Program { .. } | Self::Threads { .. } => exit::FAILURE,
        }
    }
}
