//! What guards the port: the files of TLS and tokens, and when they are enough.

use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use protocol::{Role, TokenSet};
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, ServerConfig, crypto, version};
use tokio_rustls::TlsAcceptor;
use worker::client::CredentialError;
use worker::credentials;

/// The files that guard a port. Command-line options, for `#[command(flatten)]`.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct GuardFiles {
    /// The file with the tokens of workers and clients; nobody but its owner may be able to read it
    #[arg(long, value_name = "FILE", env = "PITCHLINE_TOKEN_FILE")]
    pub token_file: Option<PathBuf>,
    /// The certificate of this coordinator: makes the connection encrypted
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
    /// Let in only workers and clients with a certificate of this authority, besides their token
    #[arg(
        long,
        value_name = "FILE.pem",
        env = "PITCHLINE_CLIENT_CA",
        requires = "tls_cert"
    )]
    pub client_ca: Option<PathBuf>,
}

/// What guards a port. The default is nothing.
#[derive(Clone, Default)]
pub struct Guard {
    pub(crate) tls: Option<TlsAcceptor>,
    pub(crate) tokens: Option<TokenSet>,
}

impl fmt::Debug for Guard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Guard")
            .field("tls", &self.tls.is_some())
            .field("tokens", &self.tokens)
            .finish()
    }
}

/// Why a port cannot be guarded as asked.
#[derive(Debug, thiserror::Error)]
pub enum GuardError {
    /// A file cannot be used.
    #[error(transparent)]
    File(#[from] CredentialError),
    /// Nobody of a role could ever come in.
    #[error(
        "{} has no {role}'s token: a coordinator's token file holds a worker's and a client's, one \
         per line",
        path.display()
    )]
    NoToken {
        /// The token file.
        path: PathBuf,
        /// The role without a token.
        role: Role,
    },
    /// Others could reach the port, and it is not guarded.
    #[error(
        "--listen {address} is reachable by others and needs {missing}: make them with `coordinator \
         keygen DIR` and give {options}; or listen on 127.0.0.1, or accept the risk with --insecure"
    )]
    Open {
        /// The address.
        address: SocketAddr,
        /// What is missing.
        missing: &'static str,
        /// Where to give it.
        options: &'static str,
    },
}

impl Guard {
    /// Reads the files.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, that others can read, or that is not what it should be.
    pub fn load(files: &GuardFiles) -> Result<Self, GuardError> {
        let tokens = match &files.token_file {
            Some(path) => {
                let tokens = TokenSet::new(credentials::read_tokens(path)?);
                for role in [Role::Worker, Role::Client] {
                    if !tokens.has(role) {
                        return Err(GuardError::NoToken {
                            path: path.clone(),
                            role,
                        });
                    }
                }
                Some(tokens)
            }
            None => None,
        };
        let tls = match (&files.tls_cert, &files.tls_key) {
            (Some(certificate), Some(key)) => {
                let config = server_config(certificate, key, files.client_ca.as_deref())?;
                Some(TlsAcceptor::from(Arc::new(config)))
            }
            _ => None,
        };
        Ok(Self { tls, tokens })
    }

    /// Whether this is guard enough for `address`: any is for loopback, others need both parts.
    ///
    /// # Errors
    ///
    /// A sentence that says what to do.
    pub fn suffices_for(&self, address: SocketAddr) -> Result<(), GuardError> {
        let (missing, options) = match (&self.tls, &self.tokens) {
            _ if address.ip().is_loopback() => return Ok(()),
            (Some(_), Some(_)) => return Ok(()),
            (None, None) => ("TLS and tokens", "--tls-cert, --tls-key and --token-file"),
            (None, Some(_)) => ("TLS", "--tls-cert and --tls-key"),
            (Some(_), None) => ("tokens", "--token-file"),
        };
        Err(GuardError::Open {
            address,
            missing,
            options,
        })
    }
}

fn server_config(
    certificate: &Path,
    key: &Path,
    client_ca: Option<&Path>,
) -> Result<ServerConfig, CredentialError> {
    let unusable = |path: &Path, error: &dyn fmt::Display| CredentialError::Pem {
        path: path.to_owned(),
        problem: format!("cannot be used: {error}"),
    };
    let provider = Arc::new(crypto::ring::default_provider());
    let builder = ServerConfig::builder_with_provider(Arc::clone(&provider))
        .with_protocol_versions(&[&version::TLS13])
        .map_err(|error| unusable(certificate, &error))?;
    let builder = match client_ca {
        Some(path) => {
            let mut roots = RootCertStore::empty();
            for authority in credentials::read_certificates(path)? {
                roots
                    .add(authority)
                    .map_err(|error| unusable(path, &error))?;
            }
            let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider)
                .build()
                .map_err(|error| unusable(path, &error))?;
            builder.with_client_cert_verifier(verifier)
        }
        None => builder.with_no_client_auth(),
    };
    let mut config = builder
        .with_single_cert(
            credentials::read_certificates(certificate)?,
            credentials::read_key(key)?,
        )
        .map_err(|error| unusable(certificate, &error))?;
    config.alpn_protocols = vec![b"h2".to_vec()];
    Ok(config)
}

#[cfg(test)]
pub(crate) mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt as _;
    use std::time::SystemTime;

    use super::*;
    use crate::keygen;

    /// Keys in a folder of their own.
    pub(crate) struct Keys(tempfile::TempDir);

    impl Keys {
        pub(crate) fn made(days: u32, when: SystemTime) -> Self {
            let folder = tempfile::tempdir().unwrap();
            keygen::make(&folder.path().join("keys"), &[], days, when).unwrap();
            Self(folder)
        }

        pub(crate) fn new() -> Self {
            Self::made(1, SystemTime::now())
        }

        pub(crate) fn path(&self, name: &str) -> PathBuf {
            self.0.path().join("keys").join(name)
        }

        pub(crate) fn guard(&self, tls: bool, tokens: bool, client_ca: bool) -> Guard {
            let file = |wanted: bool, name: &str| wanted.then(|| self.path(name));
            Guard::load(&GuardFiles {
                token_file: file(tokens, "coordinator.tokens"),
                tls_cert: file(tls, "server.pem"),
                tls_key: file(tls, "server.key"),
                client_ca: file(client_ca, "ca.pem"),
            })
            .unwrap()
        }
    }

    #[test]
    fn a_guard_that_lets_nobody_in_is_refused() {
        let keys = Keys::new();
        let only_workers = GuardFiles {
            token_file: Some(keys.path("worker.token")),
            ..GuardFiles::default()
        };
        let error = Guard::load(&only_workers).unwrap_err().to_string();
        assert!(error.contains("has no client's token"), "{error}");
        let mismatched = GuardFiles {
            tls_cert: Some(keys.path("server.pem")),
            tls_key: Some(keys.path("client.key")),
            ..GuardFiles::default()
        };
        assert!(matches!(
            Guard::load(&mismatched).unwrap_err(),
            GuardError::File(CredentialError::Pem { .. })
        ));
        let tokens = keys.path("coordinator.tokens");
        fs::set_permissions(&tokens, fs::Permissions::from_mode(0o640)).unwrap();
        let exposed = GuardFiles {
            token_file: Some(tokens),
            ..GuardFiles::default()
        };
        let error = Guard::load(&exposed).unwrap_err().to_string();
        assert!(error.contains("chmod 600"), "{error}");
    }

    #[test]
    fn beyond_loopback_it_takes_both() {
        let keys = Keys::new();
        let beyond: SocketAddr = "0.0.0.0:7400".parse().unwrap();
        let loopback: SocketAddr = "[::1]:7400".parse().unwrap();
        for (tls, tokens, missing) in [
            (false, false, Some("TLS and tokens")),
            (true, false, Some("needs tokens")),
            (false, true, Some("needs TLS")),
            (true, true, None),
        ] {
            let guard = keys.guard(tls, tokens, false);
            assert!(guard.suffices_for(loopback).is_ok());
            match (guard.suffices_for(beyond), missing) {
                (Ok(()), None) => {}
                (Err(error), Some(missing)) => {
                    let text = error.to_string();
                    for part in [missing, "0.0.0.0:7400", "keygen", "--insecure"] {
                        assert!(text.contains(part), "no {part:?} in {text}");
                    }
                }
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn a_guard_prints_no_secret() {
        let keys = Keys::new();
        let printed = format!("{:?}", keys.guard(true, true, true));
        for token in credentials::read_tokens(&keys.path("coordinator.tokens")).unwrap() {
            assert!(!printed.contains(token.reveal()), "{printed}");
            assert!(!printed.contains(&token.reveal()[17..]), "{printed}");
        }
    }
}
