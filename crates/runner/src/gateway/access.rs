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

mod issuer;
pub(crate) mod secrets;

use std::fs;
use std::path::{Path, PathBuf};

use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject as _;
use serde::{Deserialize, Serialize};

use crate::gateway::address::Address;
use crate::gateway::error::Error;
use crate::gateway::secret_file;
use crate::gateway::token::{Role, Token};

pub use issuer::Issuer;

const ENDING: &str = "access";

/// The contents of an access file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Access {
    /// The campaign's name.
    pub campaign: String,
    /// The addresses where the coordinator listens. Clients try them in order.
    pub addresses: Vec<Address>,
    /// The token for workers. A copy for commands only can leave it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    worker_token: Option<Token>,
    /// The token for commands. A copy for workers only can leave it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    client_token: Option<Token>,
    /// The coordinator's certificate, in PEM form.
    certificate: String,
}

impl Access {
    /// Reads an access file.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = secret_file::read(path)?;
        // The parser's full message would quote the line, which may hold a token.
        let access: Self = toml::from_str(&text).map_err(|error| {
            let line = error
                .span()
                .map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            malformed(path, format!("line {line}: {}", error.message()))
        })?;
        if access.addresses.is_empty() {
            return Err(malformed(path, "addresses is empty".to_owned()));
        }
        for (role, token) in [
            (Role::Worker, &access.worker_token),
            (Role::Client, &access.client_token),
        ] {
            if token.as_ref().is_some_and(|token| token.role() != role) {
                let reason = format!("{role}_token is not a valid {role} token");
                return Err(malformed(path, reason));
            }
        }
        if access.worker_token.is_none() && access.client_token.is_none() {
            let reason = "it has neither worker_token nor client_token".to_owned();
            return Err(malformed(path, reason));
        }
        access.certificate(path)?;
        Ok(access)
    }

    /// The certificate in the file, which was read from `path`.
    pub(crate) fn certificate(&self, path: &Path) -> Result<CertificateDer<'static>, Error> {
        CertificateDer::from_pem_slice(self.certificate.as_bytes())
            .map_err(|_| malformed(path, "certificate is not in PEM form".to_owned()))
    }

    /// The token for `role`, or the other role's token if there is none: the coordinator then
    /// explains the refusal.
    pub(crate) fn token(&self, role: Role) -> &Token {
        let (own, other) = match role {
            Role::Worker => (&self.worker_token, &self.client_token),
            Role::Client => (&self.client_token, &self.worker_token),
        };
        own.as_ref()
            .or(other.as_ref())
            .expect("a file without tokens is refused when it is read")
    }
}

/// The error of the access file at `path`.
pub(crate) fn malformed(path: &Path, reason: String) -> Error {
    Error::Malformed {
        path: path.to_owned(),
        reason,
    }
}

/// The default folder of access files: `pitchline` in `XDG_STATE_HOME` or in `~/.local/state`.
pub fn folder() -> Result<PathBuf, Error> {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let state = set("XDG_STATE_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(PathBuf::from(set("HOME")?).join(".local/state")));
    Ok(state.ok_or(Error::NoFolder)?.join("pitchline"))
}

/// The default access file of the campaign with this name.
pub fn default_file(campaign: &str) -> Result<PathBuf, Error> {
    Ok(folder()?.join(format!("{campaign}.{ENDING}")))
}

/// The access files in the default folder, ordered by name; empty if the folder does not exist.
pub(crate) fn all() -> Result<Vec<PathBuf>, Error> {
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
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    /// The text of a new access file at `path`, whose coordinator no longer runs.
    fn written(path: &Path) -> String {
        let mut issuer = Issuer::new(path, "c").unwrap();
        issuer
            .publish("0.0.0.0:7400".parse().unwrap(), &[])
            .unwrap();
        fs::read_to_string(path).unwrap()
    }

    #[test]
    fn a_damaged_or_exposed_file_is_refused_without_its_secrets() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.access");
        let text = written(&path);
        let access = Access::read(&path).unwrap();
        let last = access.addresses.last().unwrap();
        assert_eq!(last.to_string(), "127.0.0.1:7400");
        let secret = access.worker_token.unwrap();
        for (from, to, part) in [
            ("addresses", "adresses", "adresses"),
            ("127.0.0.1:7400", "here", "\"here\""),
            ("pitchline-worker-", "pitchline-woker-", "not a valid token"),
            ("pitchline-worker-", "pitchline-client-", "worker_token"),
            ("worker_token = \"", "worker_token = ", "line "),
            ("BEGIN CERT", "BEGIN CART", "certificate"),
        ] {
            fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let error = Access::read(&path).unwrap_err();
            let sentence = format!("{error} {error:?}");
            assert!(sentence.contains(part), "no {part:?} in {sentence}");
            assert!(!sentence.contains(&secret.reveal()[20..]), "{sentence}");
        }
        fs::write(&path, &text).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        let error = Access::read(&path).unwrap_err().to_string();
        assert!(error.contains("chmod 600"), "{error}");
    }

    #[test]
    fn a_copy_may_leave_out_one_token() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.access");
        let text = written(&path);
        let without = |ends: &[&str]| -> String {
            text.split_inclusive('\n')
                .filter(|line| !ends.iter().any(|name| line.starts_with(name)))
                .collect()
        };
        fs::write(&path, without(&["client_token"])).unwrap();
        let access = Access::read(&path).unwrap();
        assert_eq!(access.token(Role::Worker).role(), Role::Worker);
        assert_eq!(access.token(Role::Client).role(), Role::Worker);
        fs::write(&path, without(&["client_token", "worker_token"])).unwrap();
        let error = Access::read(&path).unwrap_err().to_string();
        assert!(error.contains("neither worker_token"), "{error}");
    }
}
