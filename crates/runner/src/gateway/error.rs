//! The errors of this crate.

use std::io;
use std::path::PathBuf;

use crate::exit::{self, HasExitCode};
use crate::protocol::Refusal;

use crate::gateway::tls::TlsFault;

/// An error of an access file, or one that ends a program's communication with its coordinator.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// There is no access file, or none yet.
    #[error(
        "no coordinator's access file {place}: start `coordinator serve` on this machine, or give a \
         copy of its file with --access FILE"
    )]
    NoAccess {
        /// The place where it was expected.
        place: String,
    },
    /// The default folder has several access files.
    #[error("there are several coordinators: choose one with --access FILE ({files})")]
    SeveralCoordinators {
        /// Their access files.
        files: String,
    },
    /// No default folder is known.
    #[error("neither XDG_STATE_HOME nor HOME is set: say where the access file is, --access FILE")]
    NoFolder,
    /// The file cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        reason: io::Error,
    },
    /// Others can read the file.
    #[error(
        "{} can be read by others (its mode is {mode:03o}): chmod 600 {}",
        path.display(), path.display()
    )]
    Exposed {
        /// The file.
        path: PathBuf,
        /// Its permission bits.
        mode: u32,
    },
    /// The file is not an access file, or not one of this coordinator.
    #[error("the access file {} cannot be used: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The fault of the file.
        reason: String,
    },
    /// Another coordinator uses the file.
    #[error(
        "another coordinator uses the access file {}: stop it, or give this one a file of its own \
         with --access FILE",
        path.display()
    )]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// The file cannot be written.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file or its folder.
        path: PathBuf,
        /// The error of the operating system.
        reason: io::Error,
    },
    /// The certificate or the tokens cannot be made.
    #[error("cannot make a certificate and tokens: {reason}")]
    Secrets {
        /// The error of the random numbers or of the certificate.
        reason: String,
    },
    /// The TLS handshake failed because of the certificate or the protocol.
    #[error("the coordinator at {address} {fault}")]
    Tls {
        /// The coordinator's address.
        address: String,
        /// The fault.
        fault: TlsFault,
    },
    /// No coordinator ever answered.
    #[error(
        "no coordinator answers at {address} ({reason}): is `coordinator serve` running, and does it \
         listen on that address?"
    )]
    Unreachable {
        /// The coordinator's address.
        address: String,
        /// The error of the last attempt.
        reason: String,
    },
    /// The coordinator answered before, but has been away for too long.
    #[error("the coordinator at {address} has been away for {seconds} s; giving up")]
    Away {
        /// The coordinator's address.
        address: String,
        /// Time without an answer.
        seconds: u64,
    },
    /// The coordinator refused this program permanently.
    #[error("the coordinator at {address} refused: {message}")]
    Refused {
        /// The coordinator's address.
        address: String,
        /// The kind of refusal.
        refusal: Refusal,
        /// The coordinator's message.
        message: String,
    },
    /// The coordinator's answer violates the protocol.
    #[error("the coordinator at {address} sent an invalid answer: {reason}")]
    InvalidAnswer {
        /// The coordinator's address.
        address: String,
        /// The violation.
        reason: String,
    },
    /// The coordinator could not carry out the request.
    #[error("the coordinator at {address} could not answer: {reason}")]
    Failed {
        /// The coordinator's address.
        address: String,
        /// The coordinator's message.
        reason: String,
    },
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

impl HasExitCode for Error {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Unreachable { .. } | Self::Away { .. } | Self::NoAccess { .. } => {
                exit::UNREACHABLE
            }
            Self::Refused { .. } | Self::Tls { .. } => exit::REFUSED,
            Self::SeveralCoordinators { .. } => exit::USAGE,
            Self::NoFolder
            | Self::Unreadable { .. }
            | Self::Exposed { .. }
            | Self::Malformed { .. }
            | Self::Write { .. } => exit::FILE_ACCESS,
            Self::InUse { .. } => exit::CANNOT_LISTEN,
            Self::Secrets { .. } | Self::InvalidAnswer { .. } | Self::Failed { .. } => {
                exit::FAILURE
            }
        }
    }
}
