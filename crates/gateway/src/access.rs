//! Access files: all that a worker or a command needs to reach a coordinator, in one file.
//!
//! A coordinator writes the file when it starts: its addresses, its certificate, one token for
//! workers and one for commands. Only the file's owner can read it. The certificate's private key and
//! the lock that tells a running coordinator's file from an old one are in a second file beside it,
//! FILE.key, which no other program needs.
//!
//! A restarted coordinator keeps certificate and tokens, so workers that run need not read the file
//! again; they do so all the same whenever they connect, and follow a coordinator that moved.

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

/// The name in every access file's certificate. A client trusts the one certificate in its file, so
/// the name need not be the machine's, and the file serves wherever it is copied.
pub const SERVER_NAME: &str = "pitchline";

const ENDING: &str = "access";

/// What an access file says.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Access {
    /// The campaign's name.
    pub campaign: String,
    /// Where the coordinator listens, as `host:port`; clients try one after the other.
    pub addresses: Vec<String>,
    /// The token for workers; a copy for commands alone can leave it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    worker_token: Option<String>,
    /// The token for commands; a copy for workers alone can leave it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    client_token: Option<String>,
    /// The coordinator's certificate, in PEM form.
    certificate: String,
}

/// Why an access file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AccessError {
    /// It cannot be read, or others can read it.
    #[error(transparent)]
    File(#[from] CredentialError),
    /// It is no access file, or not this coordinator's.
    #[error("the access file {} cannot be used: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Another coordinator uses it.
    #[error(
        "another coordinator uses the access file {}: stop it, or give this one a file of its own \
         with --access FILE",
        path.display()
    )]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file or its folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// There is no folder to keep it in.
    #[error("neither XDG_STATE_HOME nor HOME is set: say where the access file is, --access FILE")]
    NoFolder,
    /// Its certificate or tokens cannot be made.
    #[error(transparent)]
    Keygen(#[from] KeygenError),
}

impl Access {
    /// Reads an access file.
    ///
    /// # Errors
    ///
    /// It cannot be read, can be read by others, or is no access file.
    pub fn read(path: &Path) -> Result<Self, AccessError> {
        let malformed = |reason: String| AccessError::Malformed {
            path: path.to_owned(),
            reason,
        };
        let text = files::read(path, true)?;
        // The parser's message would quote the line, which may hold a token.
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

    /// The addresses in parts.
    pub(crate) fn hosts(&self) -> impl Iterator<Item = Option<(String, u16)>> {
        self.addresses.iter().map(|address| host_and_port(address))
    }

    /// The certificate of the file, which was read from `path`.
    pub(crate) fn certificate(&self, path: &Path) -> Result<CertificateDer<'static>, AccessError> {
        CertificateDer::from_pem_slice(self.certificate.as_bytes()).map_err(|_| {
            AccessError::Malformed {
                path: path.to_owned(),
                reason: "certificate is none in PEM form".to_owned(),
            }
        })
    }

    /// The token for `role`; the other one when there is none, so that the coordinator can say what
    /// is wrong with it.
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

/// Splits `host:port`, with or without a scheme before it.
pub(crate) fn host_and_port(address: &str) -> Option<(String, u16)> {
    let uri: tonic::codegen::http::Uri = address.parse().ok()?;
    let host = uri.host()?.trim_start_matches('[').trim_end_matches(']');
    Some((host.to_owned(), uri.port_u16()?))
}

/// The folder where access files are kept by default: `pitchline` in `XDG_STATE_HOME`, or in
/// `~/.local/state`.
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

/// The access file of the campaign of this name in the default folder.
///
/// # Errors
///
/// See [`folder`].
pub fn default_file(campaign: &str) -> Result<PathBuf, AccessError> {
    Ok(folder()?.join(format!("{campaign}.{ENDING}")))
}

/// The access files in the default folder, by name; none when there is no folder.
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
