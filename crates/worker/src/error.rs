//! Why a worker ends without having been told to.

use protocol::exit;

/// Why a worker ended without having been told to.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The coordinator cannot be reached, or refused.
    #[error(transparent)]
    Gateway(#[from] gateway::Error),
    /// The campaign's designs are not for the simulator that this worker has.
    #[error("{reason}")]
    WrongSimulator {
        /// What is wrong and what would be right.
        reason: String,
    },
    /// The external simulator does not answer the questions that every worker answers first.
    #[error("the external simulator is of no use: {reason}")]
    Program {
        /// What it did.
        reason: String,
    },
    /// The compute threads cannot be started.
    #[error("cannot start {slots} compute threads: {reason}")]
    Threads {
        /// How many were asked for.
        slots: usize,
        /// What the system said.
        reason: String,
    },
}

impl Error {
    /// The exit code of a program that ends with this error.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Gateway(error) => error.exit_code(),
            Self::WrongSimulator { .. } => exit::REFUSED,
            Self::Program { .. } | Self::Threads { .. } => exit::FAILURE,
        }
    }
}
