//! Connections to a coordinator, for workers and for commands.
//!
//! A [`Link`] dials when it is first used and again whenever the connection is lost. A program
//! makes calls through [`Link::client`], and [`Link::error`] (or [`Link::refusal`], for programs
//! that try again) interprets a failed call:
//!
//! ```no_run
//! # async fn status(reach: gateway::client::Reach) -> Result<String, gateway::Error> {
//! let link = reach.link(gateway::Role::Client)?;
//! let answer = link.client().status(protocol::v1::StatusRequest {}).await;
//! Ok(answer.map_err(|status| link.error(&status))?.into_inner().status_json)
//! # }
//! ```

mod connector;

use std::net::IpAddr;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use protocol::v1::campaign_client::CampaignClient;
use protocol::{MAX_MESSAGE_BYTES, Refusal};
use rustls::pki_types::ServerName;
use tonic::codegen::http::Uri;
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Request, Status};

use crate::access;
use crate::dial::Dial;
use crate::error::Error;
use crate::files::{self, Credentials};
use crate::tls::{Encrypt, Faults};
use crate::token::{Role, TOKEN_HEADER, Token};

use connector::{Connector, Entrance, Followed, Shared};

/// A gRPC client that adds the token to every call.
pub type Client = CampaignClient<InterceptedService<Channel, Bearer>>;

/// An interceptor that adds the token, if there is one, to every call.
#[derive(Clone)]
pub struct Bearer(Arc<Shared>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(value) = &self.0.entrance().token {
            request.metadata_mut().insert(TOKEN_HEADER, value.clone());
        }
        Ok(request)
    }
}

/// A connection to a coordinator that is opened on demand.
#[derive(Clone)]
pub struct Link {
    client: Client,
    shared: Arc<Shared>,
}

impl std::fmt::Debug for Link {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Link").field(&self.url()).finish()
    }
}

/// Makes a link from the access file at `path`, which is read again for every new connection.
/// `connect` replaces the addresses in the file.
///
/// Nothing is sent yet. Must be called within a Tokio runtime.
///
/// # Errors
///
/// The file cannot be used, or `connect` is not an address.
pub(crate) fn follow(
    path: &Path,
    connect: Option<&str>,
    credentials: &Credentials,
    role: Role,
) -> Result<Link, Error> {
    let instead = match connect {
        Some(url) if url.starts_with("http://") => {
            return Err(Error::NeedlessAuthority {
                url: url.to_owned(),
            });
        }
        Some(url) => Some(access::host_and_port(url).ok_or_else(|| address(url))?),
        None => None,
    };
    let followed = Followed {
        path: path.to_owned(),
        instead,
        credentials: credentials.clone(),
        role,
    };
    let faults = Faults::default();
    let entrance = followed.read(&faults)?;
    let uri = Uri::from_static("https://pitchline");
    Ok(Link::new(
        uri,
        Dial::default(),
        entrance,
        Some(followed),
        faults,
    ))
}

/// Makes a link to the coordinator at `url` with these credentials.
///
/// Nothing is sent yet. Must be called within a Tokio runtime.
///
/// # Errors
///
/// The address is invalid or does not match the credentials, or one of their files cannot be used.
pub fn connect(
    dial: Dial,
    url: &str,
    credentials: &Credentials,
    role: Role,
) -> Result<Link, Error> {
    let uri: Uri = url.parse().map_err(|_| address(url))?;
    let host = uri.host().ok_or_else(|| address(url))?;
    let host = host
        .trim_start_matches('[')
        .trim_end_matches(']')
        .to_owned();
    let faults = Faults::default();
    let (encrypt, usual_port) = match (uri.scheme_str(), &credentials.tls_ca) {
        (Some("https"), Some(ca)) => {
            let name = ServerName::try_from(host.clone()).map_err(|_| address(url))?;
            let authority = (files::read_certificates(ca)?, ca.as_path());
            let encrypt = Encrypt::new(name, authority, credentials, faults.clone())?;
            (Some(encrypt), 443)
        }
        (Some("https"), None) => {
            return Err(Error::NoAuthority {
                url: url.to_owned(),
            });
        }
        (Some("http"), Some(_)) => {
            return Err(Error::NeedlessAuthority {
                url: url.to_owned(),
            });
        }
        (Some("http"), None) => (None, 80),
        _ => return Err(address(url)),
    };
    let token = match &credentials.token_file {
        Some(path) if encrypt.is_none() && !is_loopback(&host) => {
            return Err(Error::TokenInClear {
                url: url.to_owned(),
                path: path.clone(),
            });
        }
        Some(path) => Some(choose(&files::read_tokens(path)?, role).header()),
        None => None,
    };
    let entrance = Entrance {
        hosts: vec![(host, uri.port_u16().unwrap_or(usual_port))],
        encrypt,
        certificate: None,
        token,
    };
    Ok(Link::new(uri, dial, entrance, None, faults))
}

fn address(url: &str) -> Error {
    Error::Address {
        url: url.to_owned(),
    }
}

/// The token for this role, or another one if there is none: the coordinator then explains the
/// refusal.
fn choose(tokens: &[Token], role: Role) -> &Token {
    tokens
        .iter()
        .find(|token| token.role() == role)
        .unwrap_or(&tokens[0])
}

fn is_loopback(host: &str) -> bool {
    host == "localhost" || host.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

impl Link {
    fn new(
        uri: Uri,
        dial: Dial,
        entrance: Entrance,
        followed: Option<Followed>,
        faults: Faults,
    ) -> Self {
        let shared = Arc::new(Shared {
            dial,
            entrance: Mutex::new(Arc::new(entrance)),
            followed,
            faults,
            unknown_at: Mutex::new(None),
        });
        // The connector chooses the address to dial; this one only names the channel.
        let channel = Endpoint::from(uri.clone())
            .origin(uri)
            .http2_keep_alive_interval(Duration::from_secs(10))
            // Results may occupy the connection for longer than a ping usually takes.
            .keep_alive_timeout(Duration::from_secs(30))
            .connect_with_connector_lazy(Connector(Arc::clone(&shared)));
        let client = CampaignClient::with_interceptor(channel, Bearer(Arc::clone(&shared)))
            .max_decoding_message_size(MAX_MESSAGE_BYTES)
            .max_encoding_message_size(MAX_MESSAGE_BYTES);
        Self { client, shared }
    }

    /// The coordinator's address, or the first of several.
    #[must_use]
    pub fn url(&self) -> String {
        let entrance = self.shared.entrance();
        let (host, port) = &entrance.hosts[0];
        let scheme = if entrance.encrypt.is_some() {
            "https"
        } else {
            "http"
        };
        if host.contains(':') {
            format!("{scheme}://[{host}]:{port}")
        } else {
            format!("{scheme}://{host}:{port}")
        }
    }

    /// A client for making calls. Clones share the connection.
    #[must_use]
    pub fn client(&self) -> Client {
        self.client.clone()
    }

    /// The error of a failed call if it is final, that is if no further attempt can succeed: the
    /// coordinator refused the call, or one side does not trust the other.
    ///
    /// A restarted coordinator may have written new secrets to its access file since the call
    /// began. An unknown token or certificate is therefore final only if a second attempt with the
    /// same file fails in the same way.
    #[must_use]
    pub fn refusal(&self, status: &Status) -> Option<Error> {
        let error = self.refusal_of_this_call(status)?;
        if self.shared.followed.is_none() || !error.is_about_secrets() {
            return Some(error);
        }
        let entrance = self.shared.entrance();
        let mut unknown_at = self
            .shared
            .unknown_at
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let before = unknown_at.replace(Arc::clone(&entrance));
        let is_same = before.is_some_and(|before| before.has_the_secrets_of(&entrance));
        is_same.then_some(error)
    }

    fn refusal_of_this_call(&self, status: &Status) -> Option<Error> {
        let url = self.url();
        if let Some(refusal) = Refusal::of(status) {
            return Some(Error::Refused {
                url,
                refusal,
                message: status.message().to_owned(),
            });
        }
        let fault = self.shared.faults.take()?;
        Some(Error::Tls { url, fault })
    }

    /// The error of a failed call, for a program that does not try again.
    #[must_use]
    pub fn error(&self, status: &Status) -> Error {
        self.refusal_of_this_call(status).unwrap_or_else(|| {
            let url = self.url();
            let reason = cause(status);
            match status.code() {
                Code::Unavailable | Code::Cancelled | Code::DeadlineExceeded | Code::Unknown => {
                    Error::Unreachable { url, reason }
                }
                _ => Error::Failed { url, reason },
            }
        })
    }
}

/// The innermost cause of a failed call: the part that a user can act on.
#[must_use]
pub fn cause(status: &Status) -> String {
    let mut innermost: &dyn std::error::Error = status;
    let mut message = status.message().to_owned();
    while let Some(source) = innermost.source() {
        innermost = source;
        message = innermost.to_string();
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::token::TOKEN_BYTES;

    fn refused(url: &str, credentials: &Credentials) -> String {
        connect(Dial::default(), url, credentials, Role::Worker)
            .unwrap_err()
            .to_string()
    }

    #[tokio::test]
    async fn a_token_goes_over_open_connections_to_this_machine_only() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        std::fs::write(&path, Token::new(Role::Worker, [1; TOKEN_BYTES]).reveal()).unwrap();
        let private = <std::fs::Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o600);
        std::fs::set_permissions(&path, private).unwrap();
        let credentials = Credentials {
            token_file: Some(path),
            ..Credentials::default()
        };
        for url in [
            "http://192.0.2.1:7400",
            "http://head:7400",
            "http://[2001:db8::1]:7400",
            // Names that only resemble those of this machine.
            "http://localhost.example.org:7400",
            "http://127.0.0.1.example.org:7400",
        ] {
            let sentence = refused(url, &credentials);
            assert!(
                sentence.contains("in clear") && sentence.contains(url),
                "{sentence}"
            );
            assert!(connect(Dial::default(), url, &Credentials::default(), Role::Worker).is_ok());
        }
        for url in [
            "http://127.0.0.1:7400",
            "http://[::1]:7400",
            "http://localhost:7400",
        ] {
            let link = connect(Dial::default(), url, &credentials, Role::Worker).unwrap();
            assert!(!format!("{link:?}").contains("0101"), "{link:?}");
        }
    }

    #[tokio::test]
    async fn an_encrypted_connection_needs_its_authority_and_an_open_one_none() {
        let sentence = refused("https://head:7400", &Credentials::default());
        assert!(sentence.contains("--tls-ca"), "{sentence}");
        let credentials = Credentials {
            tls_ca: Some("ca.pem".into()),
            ..Credentials::default()
        };
        let sentence = refused("http://127.0.0.1:7400", &credentials);
        assert!(sentence.contains("https://"), "{sentence}");
        let sentence = refused("https://head:7400", &credentials);
        assert!(sentence.contains("cannot read ca.pem"), "{sentence}");
    }

    #[test]
    fn a_program_takes_the_token_of_its_role_or_else_any() {
        let [worker, client] =
            [Role::Worker, Role::Client].map(|role| Token::new(role, [1; TOKEN_BYTES]));
        let both = [client.clone(), worker];
        assert_eq!(choose(&both, Role::Worker).role(), Role::Worker);
        assert_eq!(choose(&both, Role::Client).role(), Role::Client);
        assert_eq!(choose(&[client], Role::Worker).role(), Role::Client);
    }
}
