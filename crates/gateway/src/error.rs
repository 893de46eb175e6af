//! Errors of workers and commands that talk to a coordinator.

use std::path::PathBuf;

use protocol::{Refusal, exit};

use crate::access::AccessError;
use crate::files::CredentialError;
use crate::tls::TlsFault;

/// An error that ends a program's communication with its coordinator.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The address is not a URL of a coordinator.
    #[error("{url:?} is no address of a coordinator: give one such as https://127.0.0.1:7400")]
    Address {
        /// The given address.
        url: String,
    },
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
    /// An access file cannot be used.
    #[error(transparent)]
    Access(#[from] AccessError),
    /// The connection is encrypted, but there is no certificate to authenticate the coordinator.
    #[error(
        "{url} needs --access FILE, the coordinator's access file; or --tls-ca FILE, the ca.pem \
         that `coordinator keygen` made"
    )]
    NoAuthority {
        /// The address.
        url: String,
    },
    /// A certificate authority was given for an unencrypted connection.
    #[error(
        "--access and --tls-ca are for encrypted connections, and {url} is an open one: is it https://?"
    )]
    NeedlessAuthority {
        /// The address.
        url: String,
    },
    /// The token would be sent unencrypted.
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
    /// The TLS handshake failed because of a certificate or the protocol.
    #[error("the coordinator at {url} {fault}")]
    Tls {
        /// The address.
        url: String,
        /// The fault.
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
        /// The error of the last attempt.
        reason: String,
    },
    /// The coordinator answered before, but has been away for too long.
    #[error("the coordinator at {url} has been away for {seconds} s; giving up")]
    Away {
        /// The address.
        url: String,
        /// Time without an answer.
        seconds: u64,
    },
    /// The coordinator refused this program permanently.
    #[error("the coordinator at {url} refused: {message}")]
    Refused {
        /// The address.
        url: String,
        /// The kind of refusal.
        refusal: Refusal,
        /// The coordinator's message.
        message: String,
    },
    /// The coordinator's answer violates the protocol.
    #[error("the coordinator at {url} gave an answer that makes no sense: {reason}")]
    Nonsense {
        /// The address.
        url: String,
        /// The violation.
        reason: String,
    },
    /// The coordinator could not carry out the request.
    #[error("the coordinator at {url} could not answer: {reason}")]
    Failed {
        /// The address.
        url: String,
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
