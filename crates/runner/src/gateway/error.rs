//! The errors of access files and of the communication with a coordinator.

use std::io;
use std::path::PathBuf;

use crate::protocol::Refusal;

use crate::gateway::tls::TlsFault;

/// An error of an access file, or one that ends a program's communication with its coordinator.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(
        "no coordinator's access file {place}: start `coordinator serve` on this machine, or give a \
         copy of its file with --access FILE"
    )]
    NoAccess { place: String },
    #[error("there are several coordinators: choose one with --access FILE ({files})")]
    SeveralCoordinators { files: String },
    #[error("neither XDG_STATE_HOME nor HOME is set: say where the access file is, --access FILE")]
    NoFolder,
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable { path: PathBuf, reason: io::Error },
    #[error(
        "{} can be read by others (its mode is {mode:03o}): chmod 600 {}",
        path.display(), path.display()
    )]
    Exposed { path: PathBuf, mode: u32 },
    #[error("the access file {} cannot be used: {reason}", path.display())]
    Malformed { path: PathBuf, reason: String },
    #[error(
        "another coordinator uses the access file {}: stop it, or give this one a file of its own \
         with --access FILE",
        path.display()
    )]
    InUse { path: PathBuf },
    #[error("cannot write {}: {reason}", path.display())]
    Write { path: PathBuf, reason: io::Error },
    #[error("cannot make a certificate and tokens: {reason}")]
    Secrets { reason: String },
    #[error("the coordinator at {address} {fault}")]
    Tls { address: String, fault: TlsFault },
    #[error(
        "no coordinator answers at {address} ({reason}): is `coordinator serve` running, and does it \
         listen on that address?"
    )]
    Unreachable { address: String, reason: String },
    #[error("the coordinator at {address} has been away for {seconds} s; giving up")]
    Away { address: String, seconds: u64 },
    #[error(
        "nothing listens at {address}, and the coordinator's access file is gone, as at the end of a \
         campaign; giving up"
    )]
    Gone { address: String },
    #[error("the coordinator at {address} refused: {message}")]
    Refused {
        address: String,
        refusal: Refusal,
        message: String,
    },
    #[error("the coordinator at {address} sent an invalid answer: {reason}")]
    InvalidAnswer { address: String, reason: String },
    #[error("the coordinator at {address} could not answer: {reason}")]
    Failed { address: String, reason: String },
}

impl Error {
    /// Whether the coordinator and the program do not accept each other's secrets.
    pub(crate) const fn is_about_secrets(&self) -> bool {
        matches!(
            self,
            Self::Refused {
                refusal: Refusal::Unknown,
                ..
            } | Self::Tls {
                fault: TlsFault::Untrusted,
                ..
            }
        )
    }
}
