//! Why a worker, or a command, cannot go on with its coordinator.

use std::path::PathBuf;

use protocol::{Refusal, exit};

use crate::access::AccessError;
use crate::files::CredentialError;
use crate::tls::TlsFault;

/// Why a program cannot talk to its coordinator, or not any more.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The address is no URL of a coordinator.
    #[error("{url:?} is no address of a coordinator: give one such as https://127.0.0.1:7400")]
    Address {
        /// What was given.
        url: String,
    },
    /// There is no access file, or not yet.
    #[error(
        "no coordinator's access file {place}: start `coordinator serve` on this machine, or give a \
         copy of its file with --access FILE"
    )]
    NoAccess {
        /// Where it ought to be.
        place: String,
    },
    /// The default folder has several access files.
    #[error("there are several coordinators: choose one with --access FILE ({files})")]
    SeveralCoordinators {
        /// Their access files.
        files: String,
    },
    /// An access file cannot be used.
    #[error(transparent)]
    Access(#[from] AccessError),
    /// An encrypted connection whose other end cannot be told from an impostor.
    #[error(
        "{url} needs --access FILE, the coordinator's access file; or --tls-ca FILE, the ca.pem \
         that `coordinator keygen` made"
    )]
    NoAuthority {
        /// The address.
        url: String,
    },
    /// An authority for a connection that has no use for it.
    #[error(
        "--access and --tls-ca are for encrypted connections, and {url} is an open one: is it https://?"
    )]
    NeedlessAuthority {
        /// The address.
        url: String,
    },
    /// The token would travel for everybody to read.
    #[error(
        "the token in {} would go to {url} in clear: use https:// with --tls-ca, or a tunnel to \
         http://127.0.0.1",
        path.display()
    )]
    TokenInClear {
        /// The address.
        url: String,
        /// The token's file.
        path: PathBuf,
    },
    /// A file with a secret or a certificate cannot be used.
    #[error(transparent)]
    Credentials(#[from] CredentialError),
    /// The two ends do not trust each other.
    #[error("the coordinator at {url} {fault}")]
    Tls {
        /// The address.
        url: String,
        /// What is the matter.
        fault: TlsFault,
    },
    /// No coordinator ever answered.
    #[error(
        "no coordinator answers at {url} ({reason}): is `coordinator serve` running, and does it \
         listen on that address?"
    )]
    Unreachable {
        /// The address.
        url: String,
        /// What the last attempt met.
        reason: String,
    },
    /// The coordinator answered before, but has been away for too long.
    #[error("the coordinator at {url} has been away for {seconds} s; giving up")]
    Away {
        /// The address.
        url: String,
        /// For how long.
        seconds: u64,
    },
    /// The coordinator refused this program for good.
    #[error("the coordinator at {url} refused: {message}")]
    Refused {
        /// The address.
        url: String,
        /// The kind of refusal.
        refusal: Refusal,
        /// The coordinator's sentence.
        message: String,
    },
    /// The coordinator speaks the protocol but says things that make no sense.
    #[error("the coordinator at {url} answered with nonsense: {reason}")]
    Nonsense {
        /// The address.
        url: String,
        /// What was wrong.
        reason: String,
    },
    /// The coordinator could not do what it was asked to.
    #[error("the coordinator at {url} could not answer: {reason}")]
    Failed {
        /// The address.
        url: String,
        /// What it said.
        reason: String,
    },
}

impl Error {
    /// Whether coordinator and program do not know each other's secrets.
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

    /// The exit code of a program that ends with this error.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Unreachable { .. } | Self::Away { .. } | Self::NoAccess { .. } => {
                exit::UNREACHABLE
            }
            Self::Refused { .. } | Self::Tls { .. } => exit::REFUSED,
            Self::Address { .. }
            | Self::SeveralCoordinators { .. }
            | Self::NoAuthority { .. }
            | Self::NeedlessAuthority { .. }
            | Self::TokenInClear { .. } => exit::USAGE,
            Self::Credentials(_) | Self::Access(_) => exit::FILE_ACCESS,
            Self::Nonsense { .. } | Self::Failed { .. } => exit::FAILURE,
        }
    }
}
