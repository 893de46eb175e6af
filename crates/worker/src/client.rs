//! Connections to a coordinator, for workers and for commands that look or steer.
//!
//! [`connect`] checks address, files and options, and gives a [`Link`], which dials when it is first
//! used and again whenever the connection is lost. A program calls through [`Link::client`] and asks
//! [`Link::error`] (or [`Link::refusal`], if it wants to try again) what a failed call means:
//!
//! ```no_run
//! # async fn status() -> Result<String, worker::Error> {
//! use worker::client::{Credentials, connect};
//!
//! let credentials = Credentials {
//!     token_file: Some("client.token".into()),
//!     ..Credentials::default()
//! };
//! let link = connect("http://127.0.0.1:7400", &credentials, protocol::Role::Client)?;
//! let answer = link.client().status(protocol::v2::StatusRequest {}).await;
//! Ok(answer.map_err(|status| link.error(&status))?.into_inner().status_json)
//! # }
//! ```

use std::io;
use std::net::IpAddr;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use hyper_util::rt::TokioIo;
use protocol::v2::campaign_client::CampaignClient;
use protocol::{MAX_MESSAGE_BYTES, Refusal, Role, TOKEN_HEADER, Token};
use rustls::pki_types::ServerName;
use tonic::codegen::http::Uri;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Request, Status};

use crate::connection::Error;
use crate::credentials;
pub use crate::credentials::{CredentialError, Credentials};
pub use crate::dial::{Dial, Stream};
pub use crate::tls::TlsFault;
use crate::tls::{Encrypt, Faults};

/// How long opening a connection may take.
const DIAL_TIMEOUT: Duration = Duration::from_secs(5);
/// How long encrypting it may take: a thousand workers may have come at once.
const ENCRYPT_TIMEOUT: Duration = Duration::from_secs(10);

/// Calls to a coordinator, each with the token.
pub type Client = CampaignClient<InterceptedService<Channel, Bearer>>;

/// Adds the token, if there is one, to every call.
#[derive(Debug, Clone)]
pub struct Bearer(Option<MetadataValue<Ascii>>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(value) = &self.0 {
            request.metadata_mut().insert(TOKEN_HEADER, value.clone());
        }
        Ok(request)
    }
}

/// A connection to a coordinator that is opened when it must be.
#[derive(Debug, Clone)]
pub struct Link {
    url: String,
    client: Client,
    faults: Faults,
}

/// A link to the coordinator at `url`, over TCP.
///
/// Nothing is sent yet. Must be called within a Tokio runtime.
///
/// # Errors
///
/// The address is none, does not go together with the credentials, or one of their files cannot be
/// used.
pub fn connect(url: &str, credentials: &Credentials, role: Role) -> Result<Link, Error> {
    connect_by(Dial::default(), url, credentials, role)
}

/// As [`connect`], over connections of another kind.
///
/// # Errors
///
/// See [`connect`].
pub fn connect_by(
    dial: Dial,
    url: &str,
    credentials: &Credentials,
    role: Role,
) -> Result<Link, Error> {
    let address = || Error::Address {
        url: url.to_owned(),
    };
    let uri: Uri = url.parse().map_err(|_| address())?;
    let host = uri.host().ok_or_else(address)?;
    let host = host
        .trim_start_matches('[')
        .trim_end_matches(']')
        .to_owned();
    let faults = Faults::default();
    let (encrypt, usual_port) = match (uri.scheme_str(), &credentials.tls_ca) {
        (Some("https"), Some(ca)) => {
            let name = ServerName::try_from(host.clone()).map_err(|_| address())?;
            let encrypt = Encrypt::new(name, ca, credentials, faults.clone())?;
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
        _ => return Err(address()),
    };
    let token = match &credentials.token_file {
        Some(path) if encrypt.is_none() && !is_loopback(&host) => {
            return Err(Error::TokenInClear {
                url: url.to_owned(),
                path: path.clone(),
            });
        }
        Some(path) => Some(choose(&credentials::read_tokens(path)?, role).header()),
        None => None,
    };
    let port = uri.port_u16().unwrap_or(usual_port);
    // What is dialled is the connector's affair; this address serves as the name of it.
    let channel = Endpoint::from(uri.clone())
        .origin(uri)
        .http2_keep_alive_interval(Duration::from_secs(10))
        // A line may be busy with results for longer than a ping usually takes.
        .keep_alive_timeout(Duration::from_secs(30))
        .connect_with_connector_lazy(Connector {
            dial,
            host,
            port,
            encrypt,
        });
    let client = CampaignClient::with_interceptor(channel, Bearer(token))
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    Ok(Link {
        url: url.to_owned(),
        client,
        faults,
    })
}

/// The token for this role; if there is none, another one, so that the coordinator can say what is
/// wrong with it.
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
    /// The coordinator's address.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Something to call with. Clones share the connection.
    #[must_use]
    pub fn client(&self) -> Client {
        self.client.clone()
    }

    /// What a failed call means if it is final, so that no other attempt will fare better: the
    /// coordinator refused it, or one of the two does not trust the other.
    #[must_use]
    pub fn refusal(&self, status: &Status) -> Option<Error> {
        let url = self.url.clone();
        if let Some(refusal) = Refusal::of(status) {
            return Some(Error::Refused {
                url,
                refusal,
                message: status.message().to_owned(),
            });
        }
        let fault = self.faults.take()?;
        Some(Error::Tls { url, fault })
    }

    /// What a failed call means for a program that does not try again.
    #[must_use]
    pub fn error(&self, status: &Status) -> Error {
        self.refusal(status).unwrap_or_else(|| {
            let url = self.url.clone();
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

/// The innermost cause of a failed call, which is what a user can act on.
pub(crate) fn cause(status: &Status) -> String {
    let mut innermost: &dyn std::error::Error = status;
    let mut message = status.message().to_owned();
    while let Some(source) = innermost.source() {
        innermost = source;
        message = innermost.to_string();
    }
    message
}

/// Opens connections for the channel.
#[derive(Debug, Clone)]
struct Connector {
    dial: Dial,
    host: String,
    port: u16,
    encrypt: Option<Encrypt>,
}

impl tower::Service<Uri> for Connector {
    type Response = TokioIo<Box<dyn Stream>>;
    type Error = io::Error;
    type Future = Pin<Box<dyn Future<Output = io::Result<Self::Response>> + Send>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, _: Uri) -> Self::Future {
        let Self {
            dial,
            host,
            port,
            encrypt,
        } = self.clone();
        Box::pin(async move {
            let late = |_| io::Error::new(io::ErrorKind::TimedOut, "no answer in time");
            let stream = tokio::time::timeout(DIAL_TIMEOUT, dial.open(host, port))
                .await
                .map_err(late)??;
            let stream = match encrypt {
                Some(encrypt) => tokio::time::timeout(ENCRYPT_TIMEOUT, encrypt.wrap(stream))
                    .await
                    .map_err(late)??,
                None => stream,
            };
            Ok(TokioIo::new(stream))
        })
    }
}

#[cfg(test)]
mod tests {
    use protocol::TOKEN_BYTES;

    use super::*;

    fn refused(url: &str, credentials: &Credentials) -> String {
        connect(url, credentials, Role::Worker)
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
            // Names that only look like this machine.
            "http://localhost.example.org:7400",
            "http://127.0.0.1.example.org:7400",
        ] {
            let sentence = refused(url, &credentials);
            assert!(
                sentence.contains("in clear") && sentence.contains(url),
                "{sentence}"
            );
            assert!(connect(url, &Credentials::default(), Role::Worker).is_ok());
        }
        for url in [
            "http://127.0.0.1:7400",
            "http://[::1]:7400",
            "http://localhost:7400",
        ] {
            let link = connect(url, &credentials, Role::Worker).unwrap();
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
