//! The errors that end a worker.

/// An error that ends a worker.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Gateway(#[from] crate::gateway::Error),
    #[error("{reason}")]
    WrongSimulator { reason: String },
    #[error("the external simulator is unusable: {reason}")]
    Program { reason: String },
    #[error("this machine cannot run the simulator: {reason}")]
    Machine { reason: String },
    #[error("cannot start {slots} compute threads: {reason}")]
    Threads { slots: usize, reason: String },
}
