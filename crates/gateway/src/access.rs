//! Access files: one file with everything a worker or a command needs to reach a coordinator.
//!
//! A coordinator writes the file when it starts: its addresses, its certificate, one token for
//! workers and one for commands. Only the file's owner can read it. A second file beside it,
//! FILE.key, holds the certificate's private key and the lock that distinguishes a running
//! coordinator's file from an old one. No other program needs it.
//!
//! A restarted coordinator keeps its certificate and tokens, so running workers need not read the
//! file again. They read it anyway for every new connection, and so follow a coordinator that
//! moved.

mod held;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject as _;
use serde::{Deserialize, Serialize};

use crate::files::{self, CredentialError};
use crate::keygen::KeygenError;
use crate::token::{Role, Token};

pub use held::Held;

/// The host name in every access file's certificate. A client trusts only the certificate in its
/// file, so the name need not be the machine's, and the file is valid wherever it is copied.
pub const SERVER_NAME: &str = "pitchline";

const ENDING: &str = "access";

/// The contents of an access file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Access {
    /// The campaign's name.
    pub campaign: String,
    /// The addresses where the coordinator listens, as `host:port`. Clients try them in order.
    pub addresses: Vec<String>,
    /// The token for workers. A copy for commands only can leave it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    worker_token: Option<String>,
    /// The token for commands. A copy for workers only can leave it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    client_token: Option<String>,
    /// The coordinator's certificate, in PEM form.
    certificate: String,
}

/// The errors of access files.
#[derive(Debug, thiserror::Error)]
pub enum AccessError {
    /// The file cannot be read, or others can read it.
    #[error(transparent)]
    File(#[from] CredentialError),
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
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file or its folder.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// No default folder is known.
    #[error("neither XDG_STATE_HOME nor HOME is set: say where the access file is, --access FILE")]
    NoFolder,
    /// The certificate or the tokens cannot be made.
    #[error(transparent)]
    Keygen(#[from] KeygenError),
}

impl Access {
    /// Reads an access file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, can be read by others, or is not an access file.
    pub fn read(path: &Path) -> Result<Self, AccessError> {
        let malformed = |reason: String| AccessError::Malformed {
            path: path.to_owned(),
            reason,
        };
        let text = files::read(path, true)?;
        // The parser's full message would quote the line, which may hold a token.
        let access: Self = toml::from_str(&text).map_err(|error| {
            let line = error
                .span()
                .map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            malformed(format!("line {line}: {}", error.message()))
        })?;
        if access.addresses.is_empty() {
            return Err(malformed("addresses is empty".to_owned()));
        }
        for (address, parts) in access.addresses.iter().zip(access.hosts()) {
            parts.ok_or_else(|| malformed(format!("{address:?} is no address: HOST:PORT")))?;
        }
        for (role, token) in [
            (Role::Worker, &access.worker_token),
            (Role::Client, &access.client_token),
        ] {
            let sound = |text: &String| Token::parse(text).is_some_and(|t| t.role() == role);
            if !token.as_ref().is_none_or(sound) {
                return Err(malformed(format!("{role}_token is no {role}'s token")));
            }
        }
        access.certificate(path)?;
        Ok(access)
    }

    /// The addresses, each split into host and port.
    pub(crate) fn hosts(&self) -> impl Iterator<Item = Option<(String, u16)>> {
        self.addresses.iter().map(|address| host_and_port(address))
    }

    /// The certificate in the file, which was read from `path`.
    pub(crate) fn certificate(&self, path: &Path) -> Result<CertificateDer<'static>, AccessError> {
        CertificateDer::from_pem_slice(self.certificate.as_bytes()).map_err(|_| {
            AccessError::Malformed {
                path: path.to_owned(),
                reason: "certificate is none in PEM form".to_owned(),
            }
        })
    }

    /// The token for `role`, or the other role's token if there is none: the coordinator then
    /// explains the refusal.
    pub(crate) fn token(&self, role: Role) -> Option<Token> {
        let (own, other) = match role {
            Role::Worker => (&self.worker_token, &self.client_token),
            Role::Client => (&self.client_token, &self.worker_token),
        };
        own.as_ref()
            .or(other.as_ref())
            .and_then(|t| Token::parse(t))
    }
}

/// Splits `host:port`, optionally preceded by a scheme.
pub(crate) fn host_and_port(address: &str) -> Option<(String, u16)> {
    let uri: tonic::codegen::http::Uri = address.parse().ok()?;
    let host = uri.host()?.trim_start_matches('[').trim_end_matches(']');
    Some((host.to_owned(), uri.port_u16()?))
}

/// The default folder of access files: `pitchline` in `XDG_STATE_HOME` or in `~/.local/state`.
///
/// # Errors
///
/// Neither `XDG_STATE_HOME` nor `HOME` is set.
pub fn folder() -> Result<PathBuf, AccessError> {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let state = set("XDG_STATE_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(PathBuf::from(set("HOME")?).join(".local/state")));
    Ok(state.ok_or(AccessError::NoFolder)?.join("pitchline"))
}

/// The default access file of the campaign with this name.
///
/// # Errors
///
/// See [`folder`].
pub fn default_file(campaign: &str) -> Result<PathBuf, AccessError> {
    Ok(folder()?.join(format!("{campaign}.{ENDING}")))
}

/// The access files in the default folder, ordered by name; empty if the folder does not exist.
pub(crate) fn all() -> Result<Vec<PathBuf>, AccessError> {
    let Ok(entries) = fs::read_dir(folder()?) else {
        return Ok(Vec::new());
    };
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|ending| ending == ENDING))
        .collect();
    files.sort_unstable();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use std::net::SocketAddr;
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    fn address(text: &str) -> SocketAddr {
        text.parse().unwrap()
    }

    #[test]
    fn a_damaged_or_exposed_file_is_refused_without_its_secrets() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.access");
        let mut held = Held::take(&path, "c").unwrap();
        held.publish(address("0.0.0.0:7400"), &[]).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let access = Access::read(&path).unwrap();
        assert_eq!(access.addresses.last().unwrap(), "127.0.0.1:7400");
        let secret = access.worker_token.unwrap();
        for (from, to, part) in [
            ("addresses", "adresses", "adresses"),
            ("127.0.0.1:7400", "here", "\"here\""),
            ("pitchline-worker-", "pitchline-woker-", "worker_token"),
            ("pitchline-worker-", "pitchline-client-", "worker_token"),
            ("worker_token = \"", "worker_token = ", "line "),
            ("BEGIN CERT", "BEGIN CART", "certificate"),
        ] {
            fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let error = Access::read(&path).unwrap_err();
            let sentence = format!("{error} {error:?}");
            assert!(sentence.contains(part), "no {part:?} in {sentence}");
            assert!(!sentence.contains(&secret[20..]), "{sentence}");
        }
        fs::write(&path, &text).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        let error = Access::read(&path).unwrap_err().to_string();
        assert!(error.contains("chmod 600"), "{error}");
    }

    #[test]
    fn a_copy_may_leave_a_token_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.access");
        let mut held = Held::take(&path, "c").unwrap();
        held.publish(address("127.0.0.1:7400"), &[]).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let without: String = text
            .split_inclusive('\n')
            .filter(|line| !line.starts_with("client_token"))
            .collect();
        fs::write(&path, without).unwrap();
        let access = Access::read(&path).unwrap();
        assert_eq!(access.token(Role::Worker).unwrap().role(), Role::Worker);
        assert_eq!(access.token(Role::Client).unwrap().role(), Role::Worker);
    }
}
