//! The coordinator's side of an access file: its secrets and its lock.

use std::fs::{self, DirBuilder, File, OpenOptions, TryLockError};
use std::io::{self, Write as _};
use std::net::SocketAddr;
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use rcgen::{ExtendedKeyUsagePurpose, KeyPair};
use rustls::pki_types::PrivateKeyDer;
use rustls::pki_types::pem::PemObject as _;

use super::{Access, AccessError, SERVER_NAME};
use crate::files::{self, CredentialError};
use crate::guard::{Guard, server_config};
use crate::keygen::{self, KeygenError};
use crate::token::{Role, TokenSet};

/// Validity of a certificate in days: longer than any campaign runs.
const DAYS: u32 = 3650;

/// An access file locked by its running coordinator.
#[derive(Debug)]
pub struct Held {
    path: PathBuf,
    access: Access,
    key: String,
    /// Whether the secrets are new and not yet in any file.
    is_unwritten: bool,
    /// Locked while this lives.
    _lock: File,
}

impl Held {
    /// Locks the access file at `path` for a coordinator of `campaign`. The certificate and tokens
    /// are those of an earlier coordinator of the same campaign, or new ones. The access file is
    /// not written yet.
    ///
    /// # Errors
    ///
    /// Another coordinator uses the file, it is not an access file, or the folder is not writable.
    pub fn take(path: &Path, campaign: &str) -> Result<Self, AccessError> {
        if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
            DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(parent)
                .map_err(|source| write_error(parent, source))?;
        }
        let key_path = key_file(path);
        let lock = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(&key_path)
            .map_err(|source| write_error(&key_path, source))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(AccessError::InUse {
                    path: path.to_owned(),
                });
            }
            Err(TryLockError::Error(source)) => return Err(write_error(&key_path, source)),
        }
        let key = files::read(&key_path, true)?;
        let earlier = match Access::read(path) {
            Ok(access) => Some(access),
            Err(AccessError::File(CredentialError::Unreadable { reason, .. }))
                if reason.kind() == io::ErrorKind::NotFound =>
            {
                None
            }
            Err(error) => return Err(error),
        };
        let is_unwritten = earlier.is_none();
        let (access, key) = match earlier {
            Some(access) => {
                let refused = |reason: String| AccessError::Malformed {
                    path: path.to_owned(),
                    reason,
                };
                if access.campaign != campaign {
                    return Err(refused(format!(
                        "it belongs to campaign {:?}: give campaign {campaign:?} a file of its own \
                         with --access FILE",
                        access.campaign
                    )));
                }
                if key.is_empty() || access.worker_token.is_none() || access.client_token.is_none()
                {
                    return Err(refused(
                        "it is a copy, without the coordinator's key or a token: remove it, or \
                         give another one with --access FILE"
                            .to_owned(),
                    ));
                }
                (access, key)
            }
            None => new_secrets(campaign)?,
        };
        Ok(Self {
            path: path.to_owned(),
            access,
            key,
            is_unwritten,
            _lock: lock,
        })
    }

    /// The port on which an earlier coordinator listened, if there was one.
    #[must_use]
    pub fn last_port(&self) -> Option<u16> {
        self.access.hosts().flatten().next().map(|(_, port)| port)
    }

    /// The guard of a port with this certificate and these tokens.
    ///
    /// # Errors
    ///
    /// The certificate or the key cannot be used.
    pub fn guard(&self) -> Result<Guard, AccessError> {
        let key_path = key_file(&self.path);
        let key = PrivateKeyDer::from_pem_slice(self.key.as_bytes()).map_err(|_| {
            AccessError::Malformed {
                path: key_path.clone(),
                reason: "it holds no private key in PEM form".to_owned(),
            }
        })?;
        let certificate = self.access.certificate(&self.path)?;
        let tls = server_config((vec![certificate], key), &self.path, None)?;
        let tokens = [Role::Worker, Role::Client].map(|role| {
            self.access
                .token(role)
                .expect("the tokens were checked when the file was read")
        });
        Ok(Guard::new(tls, TokenSet::new(tokens.to_vec())))
    }

    /// Writes the file for a coordinator that listens at `address` and can also be reached under
    /// `hosts`. Returns the path of the file.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn publish(&mut self, address: SocketAddr, hosts: &[String]) -> Result<&Path, AccessError> {
        self.access.addresses = addresses(address, hosts);
        let failed = |source| write_error(&self.path, source);
        let text =
            toml::to_string(&self.access).map_err(|error| failed(io::Error::other(error)))?;
        let text = format!(
            "# How workers and commands reach this coordinator. Keep it secret: copy it only to \
             machines of your own.\n{text}"
        );
        write_secret(&key_file(&self.path), &self.key, false)?;
        write_secret(&self.path, &text, true)?;
        self.is_unwritten = false;
        Ok(&self.path)
    }

    /// Removes the files of a coordinator that will not be restarted.
    pub fn remove(mut self) {
        // A file that cannot be removed names an address without a coordinator, which clients
        // report.
        let _ = fs::remove_file(&self.path);
        self.is_unwritten = true;
    }
}

impl Drop for Held {
    /// Removes the key file if it was made only for its lock.
    fn drop(&mut self) {
        if self.is_unwritten {
            let _ = fs::remove_file(key_file(&self.path));
        }
    }
}

/// New tokens and a new certificate with its key.
fn new_secrets(campaign: &str) -> Result<(Access, String), AccessError> {
    let names = [SERVER_NAME.to_owned()];
    let mut params = keygen::certificate("Pitchline coordinator", &names, DAYS, SystemTime::now())?;
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
    let key = KeyPair::generate().map_err(KeygenError::from)?;
    let certificate = params.self_signed(&key).map_err(KeygenError::from)?;
    let access = Access {
        campaign: campaign.to_owned(),
        addresses: Vec::new(),
        worker_token: Some(keygen::token(Role::Worker)?.reveal().to_owned()),
        client_token: Some(keygen::token(Role::Client)?.reveal().to_owned()),
        certificate: certificate.pem(),
    };
    Ok((access, key.serialize_pem()))
}

/// The addresses of a coordinator that listens at `address`: first the hosts given by the user;
/// then its own address or, if it listens on all interfaces, this machine's name and the loopback
/// address.
fn addresses(address: SocketAddr, hosts: &[String]) -> Vec<String> {
    let port = address.port();
    let own = if address.ip().is_unspecified() {
        vec![keygen::host_name(), "127.0.0.1".to_owned()]
    } else {
        vec![address.ip().to_string()]
    };
    let mut addresses = Vec::new();
    for host in hosts.iter().chain(&own) {
        let address = if host.contains(':') {
            format!("[{host}]:{port}")
        } else {
            format!("{host}:{port}")
        };
        if !addresses.contains(&address) {
            addresses.push(address);
        }
    }
    addresses
}

fn key_file(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".key");
    PathBuf::from(name)
}

fn write_error(path: &Path, source: io::Error) -> AccessError {
    AccessError::Write {
        path: path.to_owned(),
        source,
    }
}

/// Writes a file that only its owner can read. With `at_once` the file is replaced, so that a
/// reader finds the old text or the new one; otherwise it is rewritten in place and keeps its lock.
fn write_secret(path: &Path, text: &str, at_once: bool) -> Result<(), AccessError> {
    let draft = path.with_extension("part");
    let target = if at_once { &draft } else { path };
    OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .mode(0o600)
        .open(target)
        .and_then(|mut file| {
            file.write_all(text.as_bytes())?;
            file.sync_all()
        })
        .and_then(|()| {
            if at_once {
                fs::rename(&draft, path)
            } else {
                Ok(())
            }
        })
        .map_err(|source| write_error(path, source))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    fn address(text: &str) -> SocketAddr {
        text.parse().unwrap()
    }

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().permissions().mode() & 0o777
    }

    #[test]
    fn a_restarted_coordinator_keeps_its_secrets_and_a_new_campaign_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/quick.access");
        let mut held = Held::take(&path, "quick").unwrap();
        assert!(!path.exists(), "nothing is written before the port is open");
        held.publish(address("127.0.0.1:7400"), &[]).unwrap();
        assert_eq!((mode(&path), mode(&key_file(&path))), (0o600, 0o600));
        let first = Access::read(&path).unwrap();
        assert_eq!(first.addresses, ["127.0.0.1:7400"]);
        held.guard().unwrap();
        drop(held);

        let mut held = Held::take(&path, "quick").unwrap();
        assert_eq!(held.last_port(), Some(7400));
        held.publish(address("127.0.0.1:7500"), &["head".to_owned()])
            .unwrap();
        let second = Access::read(&path).unwrap();
        assert_eq!(second.addresses, ["head:7500", "127.0.0.1:7500"]);
        assert_eq!(second.certificate, first.certificate);
        assert_eq!(second.worker_token, first.worker_token);
        held.remove();
        assert!(!path.exists() && !key_file(&path).exists());

        let mut held = Held::take(&path, "quick").unwrap();
        held.publish(address("127.0.0.1:7400"), &[]).unwrap();
        assert_ne!(Access::read(&path).unwrap().certificate, first.certificate);
    }

    #[test]
    fn two_coordinators_do_not_share_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.access");
        let mut held = Held::take(&path, "c").unwrap();
        held.publish(address("127.0.0.1:1"), &[]).unwrap();
        let error = Held::take(&path, "c").unwrap_err();
        assert!(matches!(error, AccessError::InUse { .. }), "{error}");
        drop(held);
        let error = Held::take(&path, "other").unwrap_err().to_string();
        assert!(error.contains("campaign \"c\""), "{error}");
        // A copy from another machine has no key.
        fs::remove_file(key_file(&path)).unwrap();
        let before = fs::read(&path).unwrap();
        let error = Held::take(&path, "c").unwrap_err().to_string();
        assert!(error.contains("a copy"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), before);
    }
}
