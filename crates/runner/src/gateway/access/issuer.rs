//! The coordinator's side of an access file: its secrets and its lock.

use std::fmt;
use std::fs::{self, DirBuilder, File, TryLockError};
use std::io;
use std::net::{Ipv6Addr, SocketAddr};
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use rustls::pki_types::PrivateKeyDer;
use rustls::pki_types::pem::PemObject as _;

use super::{Access, malformed, secrets};
use crate::gateway::address::{self, Address};
use crate::gateway::error::Error;
use crate::gateway::guard::Guard;
use crate::gateway::secret_file;
use crate::gateway::tls;
use crate::gateway::token::{Role, TokenSet};

/// The certificate, tokens and lock of a running coordinator, which issues an access file.
pub struct Issuer {
    path: PathBuf,
    access: Access,
    key: String,
    /// Whether the secrets are new and not yet in any file.
    is_unwritten: bool,
    /// Locked while this lives.
    _lock: File,
}

impl fmt::Debug for Issuer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Issuer").field(&self.path).finish()
    }
}

impl Issuer {
    /// Locks the access file at `path` for a coordinator of `campaign`. The certificate and tokens
    /// are those of an earlier coordinator of the same campaign, or new ones. The access file is
    /// not written yet.
    pub fn new(path: &Path, campaign: &str) -> Result<Self, Error> {
        if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
            DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(parent)
                .map_err(|reason| secret_file::write_error(parent, reason))?;
        }
        let key_path = key_file(path);
        let lock = secret_file::open(&key_path)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::InUse {
                    path: path.to_owned(),
                });
            }
            Err(TryLockError::Error(reason)) => {
                return Err(secret_file::write_error(&key_path, reason));
            }
        }
        // The file must be the owner's alone before a key is written to it, even if it is empty.
        let key = secret_file::read(&key_path)?;
        let (access, key, is_unwritten) = match Access::read(path) {
            Ok(access) => {
                check_earlier(&access, &key, campaign).map_err(|why| malformed(path, why))?;
                (access, key, false)
            }
            Err(Error::NoAccess { .. }) => {
                let (certificate, key) = secrets::certificate(SystemTime::now())?;
                let access = Access {
                    campaign: campaign.to_owned(),
                    addresses: Vec::new(),
                    worker_token: Some(secrets::token(Role::Worker)?),
                    client_token: Some(secrets::token(Role::Client)?),
                    certificate,
                };
                (access, key, true)
            }
            Err(error) => return Err(error),
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
        self.access.addresses.first().map(|address| address.port)
    }

    /// The guard of a port with this certificate and these tokens.
    pub fn guard(&self) -> Result<Guard, Error> {
        let key_path = key_file(&self.path);
        let key = PrivateKeyDer::from_pem_slice(self.key.as_bytes())
            .map_err(|_| malformed(&key_path, "it holds no private key in PEM form".to_owned()))?;
        let certificate = self.access.certificate(&self.path)?;
        let tls = tls::acceptor(certificate, key)
            .map_err(|error| malformed(&self.path, format!("certificate and key: {error}")))?;
        let tokens = [Role::Worker, Role::Client].map(|role| self.access.token(role).clone());
        Ok(Guard {
            tls,
            tokens: TokenSet::new(tokens.to_vec()),
        })
    }

    /// Writes the file for a coordinator that listens at `address` and can also be reached under
    /// `hosts`. Returns the path of the file.
    pub fn publish(&mut self, address: SocketAddr, hosts: &[String]) -> Result<&Path, Error> {
        self.access.addresses = addresses(address, hosts);
        let text = toml::to_string(&self.access)
            .map_err(|error| secret_file::write_error(&self.path, io::Error::other(error)))?;
        let text = format!(
            "# How workers and commands reach this coordinator. Keep it secret: copy it only to \
             machines of your own.\n{text}"
        );
        secret_file::write(&key_file(&self.path), &self.key)?;
        secret_file::replace(&self.path, &text)?;
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

impl Drop for Issuer {
    /// Removes the key file if it was made only for its lock.
    fn drop(&mut self) {
        if self.is_unwritten {
            let _ = fs::remove_file(key_file(&self.path));
        }
    }
}

/// Checks that a coordinator of `campaign` may continue with the access file of an earlier one and its
/// `key`; returns the reason if not.
fn check_earlier(access: &Access, key: &str, campaign: &str) -> Result<(), String> {
    if access.campaign != campaign {
        return Err(format!(
            "it belongs to campaign {:?}: give campaign {campaign:?} a file of its own with \
             --access FILE",
            access.campaign
        ));
    }
    if key.is_empty() || access.worker_token.is_none() || access.client_token.is_none() {
        return Err(
            "it is a copy, without the coordinator's key or a token: remove it, or give another one \
             with --access FILE"
                .to_owned(),
        );
    }
    Ok(())
}

/// The addresses of a coordinator that listens at `address`: first the hosts given by the user;
/// then its own address or, if it listens on all interfaces, this machine's name, the loopback
/// address and, for machines without IPv4, its IPv6 addresses.
fn addresses(address: SocketAddr, hosts: &[String]) -> Vec<Address> {
    let port = address.port();
    let own = if address.ip().is_unspecified() {
        let name = rustix::system::uname();
        let name = name.nodename().to_str().ok();
        let name = name.and_then(|name| address::host(name).ok());
        let interfaces = if address.is_ipv6() {
            fs::read_to_string("/proc/net/if_inet6").unwrap_or_default()
        } else {
            String::new()
        };
        let ipv6 = lasting_ipv6(&interfaces);
        let own = name.into_iter().chain(["127.0.0.1".to_owned()]);
        own.chain(ipv6.map(|address| address.to_string())).collect()
    } else {
        vec![address.ip().to_string()]
    };
    let mut addresses = Vec::new();
    for host in hosts.iter().cloned().chain(own) {
        let address = Address { host, port };
        if !addresses.contains(&address) {
            addresses.push(address);
        }
    }
    addresses
}

/// The addresses that other machines may reach among those of Linux's `/proc/net/if_inet6`: global and unique local
/// ones, without those that end soon.
fn lasting_ipv6(interfaces: &str) -> impl Iterator<Item = Ipv6Addr> {
    /// `RT_SCOPE_UNIVERSE` of rtnetlink(7).
    const GLOBAL: u32 = 0;
    /// `IFA_F_TEMPORARY`, `IFA_F_DADFAILED`, `IFA_F_DEPRECATED` and `IFA_F_TENTATIVE` of rtnetlink(7).
    const PASSING: u32 = 0x01 | 0x08 | 0x20 | 0x40;
    interfaces.lines().filter_map(|line| {
        // Address, number of the interface, length of the prefix, scope, flags and name, without 0x.
        let mut words = line.split_ascii_whitespace();
        let address = u128::from_str_radix(words.next()?, 16).ok()?;
        let mut number = |skipped| u32::from_str_radix(words.nth(skipped)?, 16).ok();
        let (scope, flags) = (number(2)?, number(0)?);
        (scope == GLOBAL && flags & PASSING == 0).then(|| Ipv6Addr::from(address))
    })
}

fn key_file(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".key");
    PathBuf::from(name)
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

    fn texts(access: &Access) -> Vec<String> {
        access.addresses.iter().map(Address::to_string).collect()
    }

    #[test]
    fn a_restarted_coordinator_keeps_its_secrets_and_a_new_campaign_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/quick.access");
        let mut issuer = Issuer::new(&path, "quick").unwrap();
        assert!(!path.exists(), "nothing is written before the port is open");
        issuer.publish(address("127.0.0.1:7400"), &[]).unwrap();
        assert_eq!((mode(&path), mode(&key_file(&path))), (0o600, 0o600));
        let first = Access::read(&path).unwrap();
        assert_eq!(texts(&first), ["127.0.0.1:7400"]);
        issuer.guard().unwrap();
        drop(issuer);

        let mut issuer = Issuer::new(&path, "quick").unwrap();
        assert_eq!(issuer.last_port(), Some(7400));
        issuer
            .publish(address("127.0.0.1:7500"), &["head".to_owned()])
            .unwrap();
        let second = Access::read(&path).unwrap();
        assert_eq!(texts(&second), ["head:7500", "127.0.0.1:7500"]);
        assert_eq!(second.certificate, first.certificate);
        assert_eq!(second.worker_token, first.worker_token);
        issuer.remove();
        assert!(!path.exists() && !key_file(&path).exists());

        let mut issuer = Issuer::new(&path, "quick").unwrap();
        issuer.publish(address("127.0.0.1:7400"), &[]).unwrap();
        let third = Access::read(&path).unwrap();
        assert_ne!(third.certificate, first.certificate);
        assert_ne!(third.worker_token, first.worker_token);
        assert_ne!(third.client_token, first.client_token);
    }

    #[test]
    fn addresses_that_last_are_named() {
        let interfaces = "\
            fd000000000000000000000000000002 04 40 00 82     eth0\n\
            20010db8000000000000000000000007 04 40 00 80     eth0\n\
            20010db800000000aaaaaaaaaaaaaaaa 04 40 00 01     eth0\n\
            20010db8000000000000000000000008 04 40 00 40     eth0\n\
            fe8000000000000000fc00fffe000001 04 40 20 80     eth0\n\
            00000000000000000000000000000001 01 80 10 80       lo\n\
            rubbish\n";
        let named: Vec<String> = lasting_ipv6(interfaces)
            .map(|address| address.to_string())
            .collect();
        assert_eq!(named, ["fd00::2", "2001:db8::7"]);
        let everywhere = addresses(address("[::]:7400"), &["2001:db8::7".to_owned()]);
        assert_eq!(everywhere[0].to_string(), "[2001:db8::7]:7400");
        assert!(everywhere.iter().any(|one| one.host == "127.0.0.1"));
        let ipv4 = addresses(address("0.0.0.0:7400"), &[]);
        assert!(ipv4.iter().all(|one| !one.host.contains(':')));
    }

    #[test]
    fn two_coordinators_do_not_share_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.access");
        let mut issuer = Issuer::new(&path, "c").unwrap();
        issuer.publish(address("127.0.0.1:1"), &[]).unwrap();
        let error = Issuer::new(&path, "c").unwrap_err();
        assert!(matches!(error, Error::InUse { .. }), "{error}");
        drop(issuer);
        let error = Issuer::new(&path, "other").unwrap_err().to_string();
        assert!(error.contains("campaign \"c\""), "{error}");
        // A copy from another machine has no key.
        fs::remove_file(key_file(&path)).unwrap();
        let before = fs::read(&path).unwrap();
        let error = Issuer::new(&path, "c").unwrap_err().to_string();
        assert!(error.contains("a copy"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), before);
    }

    #[test]
    fn an_issuer_prints_no_secret() {
        let folder = tempfile::tempdir().unwrap();
        let issuer = Issuer::new(&folder.path().join("c.access"), "c").unwrap();
        let printed = format!("{issuer:?} {:?}", issuer.guard().unwrap());
        let key = issuer.key.lines().nth(1).unwrap();
        let tokens = [Role::Worker, Role::Client].map(|role| issuer.access.token(role));
        for secret in tokens
            .map(|token| &token.reveal()[17..])
            .into_iter()
            .chain([key])
        {
            assert!(!printed.contains(secret), "{printed}");
        }
    }
}
