//! The protection of a port: TLS and tokens.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, ServerConfig, crypto, version};
use tokio_rustls::TlsAcceptor;

use crate::files::{self, CredentialError};
use crate::token::{Role, TokenSet};

/// The user's own files that protect a port, in place of an access file: all of the first three, or
/// none. Command-line options, for `#[command(flatten)]`.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct GuardFiles {
    /// The file with the tokens of workers and clients; nobody but its owner may be able to read it
    #[arg(
        long,
        value_name = "FILE",
        env = "PITCHLINE_TOKEN_FILE",
        requires = "tls_cert"
    )]
    pub token_file: Option<PathBuf>,
    /// The certificate of this coordinator
    #[arg(
        long,
        value_name = "FILE.pem",
        env = "PITCHLINE_TLS_CERT",
        requires_all = ["tls_key", "token_file"]
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

/// The TLS configuration and tokens that protect a port.
#[derive(Clone)]
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

/// The errors of setting up a port's protection.
#[derive(Debug, thiserror::Error)]
pub enum GuardError {
    /// A file cannot be used.
    #[error(transparent)]
    File(#[from] CredentialError),
    /// No token grants this role.
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
}

impl Guard {
    /// Loads the protection from these files; `None` if none is given.
    ///
    /// # Errors
    ///
    /// A file cannot be read, can be read by others, or has the wrong contents.
    pub fn load(given: &GuardFiles) -> Result<Option<Self>, GuardError> {
        let (Some(certificate), Some(key), Some(tokens)) =
            (&given.tls_cert, &given.tls_key, &given.token_file)
        else {
            return Ok(None);
        };
        let accepted = TokenSet::new(files::read_tokens(tokens)?);
        for role in [Role::Worker, Role::Client] {
            if !accepted.has(role) {
                return Err(GuardError::NoToken {
                    path: tokens.clone(),
                    role,
                });
            }
        }
        let own = (
            files::read_certificates(certificate)?,
            files::read_key(key)?,
        );
        let tls = server_config(own, certificate, given.client_ca.as_deref())?;
        Ok(Some(Self::new(tls, accepted)))
    }

    /// Admits callers that use TLS with a server of this configuration and have one of these
    /// `tokens`.
    #[must_use]
    pub fn new(tls: ServerConfig, tokens: TokenSet) -> Self {
        Self {
            tls: Some(TlsAcceptor::from(Arc::new(tls))),
            tokens: Some(tokens),
        }
    }

    /// Admits everybody, unencrypted.
    #[must_use]
    pub const fn open() -> Self {
        Self {
            tls: None,
            tokens: None,
        }
    }
}

/// The TLS configuration of a coordinator with this key and this certificate, which was read from
/// `certificate`. If `client_ca` is given, clients must show a certificate signed by it.
pub(crate) fn server_config(
    own: (Vec<CertificateDer<'static>>, PrivateKeyDer<'static>),
    certificate: &Path,
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
            for authority in files::read_certificates(path)? {
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
        .with_single_cert(own.0, own.1)
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

    /// Generated keys in a temporary folder.
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

        pub(crate) fn guard(&self, client_ca: bool) -> Guard {
            let files = GuardFiles {
                token_file: Some(self.path("coordinator.tokens")),
                tls_cert: Some(self.path("server.pem")),
                tls_key: Some(self.path("server.key")),
                client_ca: client_ca.then(|| self.path("ca.pem")),
            };
            Guard::load(&files).unwrap().unwrap()
        }
    }

    #[test]
    fn a_guard_that_lets_nobody_in_is_refused() {
        let keys = Keys::new();
        let with = |token: &str, key: &str| GuardFiles {
            token_file: Some(keys.path(token)),
            tls_cert: Some(keys.path("server.pem")),
            tls_key: Some(keys.path(key)),
            client_ca: None,
        };
        let error = Guard::load(&with("worker.token", "server.key"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("has no client's token"), "{error}");
        assert!(matches!(
            Guard::load(&with("coordinator.tokens", "client.key")).unwrap_err(),
            GuardError::File(CredentialError::Pem { .. })
        ));
        let tokens = keys.path("coordinator.tokens");
        fs::set_permissions(&tokens, fs::Permissions::from_mode(0o640)).unwrap();
        let error = Guard::load(&with("coordinator.tokens", "server.key"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("chmod 600"), "{error}");
        assert!(Guard::load(&GuardFiles::default()).unwrap().is_none());
    }

    #[test]
    fn a_guard_prints_no_secret() {
        let keys = Keys::new();
        let printed = format!("{:?}", keys.guard(true));
        for token in files::read_tokens(&keys.path("coordinator.tokens")).unwrap() {
            assert!(!printed.contains(token.reveal()), "{printed}");
            assert!(!printed.contains(&token.reveal()[17..]), "{printed}");
        }
    }
}
