//! The files that give a program access: token, certificates, private key.
//!
//! Secrets come only from files. Everybody on a machine can see a command line, and every child
//! process inherits the environment, so both contain only the files' names.

use std::fs;
use std::io::Read as _;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};

use crate::token::{Token, TokenError};

/// The files by which a program identifies itself to a coordinator and authenticates the
/// coordinator. The fields are command-line options, for `#[command(flatten)]`.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Credentials {
    /// The file with the token; nobody but its owner may be able to read it
    #[arg(long, value_name = "FILE", env = "PITCHLINE_TOKEN_FILE")]
    pub token_file: Option<PathBuf>,
    /// The certificate authority that the coordinator's certificate must come from, for https://
    #[arg(long, value_name = "FILE.pem", env = "PITCHLINE_TLS_CA")]
    pub tls_ca: Option<PathBuf>,
    /// This program's own certificate, for a coordinator with --client-ca
    #[arg(
        long,
        value_name = "FILE.pem",
        env = "PITCHLINE_TLS_CERT",
        requires = "tls_key"
    )]
    pub tls_cert: Option<PathBuf>,
    /// The certificate's private key
    #[arg(
        long,
        value_name = "FILE.key",
        env = "PITCHLINE_TLS_KEY",
        requires = "tls_cert"
    )]
    pub tls_key: Option<PathBuf>,
}

/// The errors of files with a secret or a certificate.
#[derive(Debug, thiserror::Error)]
pub enum CredentialError {
    /// The file cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        reason: std::io::Error,
    },
    /// Others can read the file.
    #[error(
        "{} can be read by others (its mode is {mode:03o}), so it is no secret: chmod 600 {}",
        path.display(), path.display()
    )]
    Exposed {
        /// The file.
        path: PathBuf,
        /// Its permission bits.
        mode: u32,
    },
    /// The file is not a token file.
    #[error("{} is no token file: {reason}", path.display())]
    Token {
        /// The file.
        path: PathBuf,
        /// The fault of the file.
        reason: TokenError,
    },
    /// The file holds no certificate, no private key, or one that does not match.
    #[error("{} {problem}", path.display())]
    Pem {
        /// The file.
        path: PathBuf,
        /// The fault of the file.
        problem: String,
    },
}

/// Maximum size of a file of certificates or tokens, in bytes.
const LARGEST_FILE: u64 = 1 << 20;

/// Reads a file. A secret file must be readable only by its owner.
pub(crate) fn read(path: &Path, secret: bool) -> Result<String, CredentialError> {
    let unreadable = |reason| CredentialError::Unreadable {
        path: path.to_owned(),
        reason,
    };
    let file = fs::File::open(path).map_err(unreadable)?;
    // The mode is that of the open file, since its name may refer to another file a moment later.
    let mode = file.metadata().map_err(unreadable)?.mode() & 0o777;
    if secret && mode & 0o077 != 0 {
        return Err(CredentialError::Exposed {
            path: path.to_owned(),
            mode,
        });
    }
    let mut text = String::new();
    file.take(LARGEST_FILE)
        .read_to_string(&mut text)
        .map_err(unreadable)?;
    Ok(text)
}

/// Reads the tokens in a file that only its owner can read.
///
/// # Errors
///
/// The file cannot be read, can be read by others, or is not a token file.
pub fn read_tokens(path: &Path) -> Result<Vec<Token>, CredentialError> {
    Token::parse_file(&read(path, true)?).map_err(|reason| CredentialError::Token {
        path: path.to_owned(),
        reason,
    })
}

/// Reads the certificates in a PEM file, which must hold at least one.
///
/// # Errors
///
/// The file cannot be read or holds no certificate.
pub fn read_certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, CredentialError> {
    let text = read(path, false)?;
    let certificates: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(text.as_bytes()).collect();
    match certificates {
        Ok(certificates) if !certificates.is_empty() => Ok(certificates),
        _ => Err(CredentialError::Pem {
            path: path.to_owned(),
            problem: "holds no certificate in PEM form".to_owned(),
        }),
    }
}

/// Reads the private key in a PEM file that only its owner can read.
///
/// # Errors
///
/// The file cannot be read, can be read by others, or holds no private key.
pub fn read_key(path: &Path) -> Result<PrivateKeyDer<'static>, CredentialError> {
    let text = read(path, true)?;
    PrivateKeyDer::from_pem_slice(text.as_bytes()).map_err(|_| CredentialError::Pem {
        path: path.to_owned(),
        problem: "holds no private key in PEM form".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;
    use crate::token::{Role, TOKEN_BYTES};

    fn file(folder: &tempfile::TempDir, text: &str, mode: u32) -> PathBuf {
        let path = folder.path().join("secret");
        fs::write(&path, text).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
        path
    }

    #[test]
    fn a_token_that_others_can_read_is_refused_with_the_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let token = Token::new(Role::Worker, [3; TOKEN_BYTES]);
        for mode in [0o640, 0o604, 0o660, 0o644, 0o610, 0o601] {
            let path = file(&folder, token.reveal(), mode);
            let error = read_tokens(&path).unwrap_err().to_string();
            assert!(error.contains(&format!("{mode:03o}")), "{error}");
            assert!(error.ends_with(&format!("chmod 600 {}", path.display())));
            assert!(!error.contains("0303"), "{error}");
            assert!(matches!(
                read_key(&path).unwrap_err(),
                CredentialError::Exposed { .. }
            ));
        }
        for mode in [0o600, 0o400] {
            let path = file(&folder, token.reveal(), mode);
            assert_eq!(read_tokens(&path).unwrap()[0].reveal(), token.reveal());
        }
    }

    #[test]
    fn what_is_in_the_file_is_not_repeated() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(&folder, "hunter2", 0o600);
        for error in [
            read_tokens(&path).unwrap_err(),
            read_certificates(&path).unwrap_err(),
            read_key(&path).unwrap_err(),
        ] {
            let text = format!("{error} {error:?}");
            assert!(text.contains("secret"), "{text}");
            assert!(!text.contains("hunter2"), "{text}");
        }
    }
}
