//! The client's side of TLS, and the interpretation of its failures.
//!
//! Only TLS 1.3 is used, since both ends belong to this project. A coordinator refuses a client's
//! certificate only after the handshake is complete for the client, so that the failure appears
//! while reading. [`Watched`] therefore records the error that ended a connection.

use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};

use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{AlertDescription, CertificateError, ClientConfig, RootCertStore, crypto, version};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_rustls::TlsConnector;

use crate::dial::Stream;
use crate::files::{self, CredentialError, Credentials};

/// A permanent failure of TLS. Each text continues a sentence that begins with the coordinator's
/// address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TlsFault {
    /// The coordinator's certificate is neither that of the access file nor signed by the
    /// authority.
    #[error(
        "shows a certificate that this program has no reason to trust: take the access file, or the \
         ca.pem for --tls-ca, that belongs to this coordinator"
    )]
    Untrusted,
    /// The coordinator's certificate has expired.
    #[error("shows a certificate that has expired: make new ones with `coordinator keygen`")]
    Expired,
    /// The coordinator's certificate is not valid yet.
    #[error("shows a certificate that is not valid yet: is the clock of this machine right?")]
    NotYetValid,
    /// The coordinator's certificate is for other names.
    #[error(
        "shows a certificate that is not for this name: connect to a name that it is for, or make a \
         new one with `coordinator keygen --host NAME`"
    )]
    OtherName,
    /// Another flaw of the coordinator's certificate.
    #[error("shows a certificate that cannot be used ({0})")]
    Unusable(String),
    /// The coordinator requires a certificate.
    #[error("asks for a certificate: give --tls-cert and --tls-key")]
    WantsCertificate,
    /// The coordinator does not accept this program's certificate.
    #[error(
        "does not accept the certificate in --tls-cert ({0}): is it from its --client-ca, and not \
         expired?"
    )]
    RefusesCertificate(String),
    /// The peer speaks another protocol.
    #[error("does not speak TLS: is it meant to be http://?")]
    NoTls,
    /// The two TLS implementations share no version or parameters.
    #[error("speaks another kind of TLS ({0}): this program speaks TLS 1.3 with HTTP/2")]
    Incompatible(String),
}

impl TlsFault {
    /// The permanent fault that a connection's error means, if it is one.
    fn of(error: &io::Error) -> Option<Self> {
        use AlertDescription as Alert;
        let error = error.get_ref()?.downcast_ref::<rustls::Error>()?;
        Some(match error {
            rustls::Error::InvalidCertificate(error) => match error {
                CertificateError::UnknownIssuer | CertificateError::BadSignature => Self::Untrusted,
                CertificateError::Expired | CertificateError::ExpiredContext { .. } => {
                    Self::Expired
                }
                CertificateError::NotValidYet | CertificateError::NotValidYetContext { .. } => {
                    Self::NotYetValid
                }
                CertificateError::NotValidForName
                | CertificateError::NotValidForNameContext { .. } => Self::OtherName,
                other => Self::Unusable(other.to_string()),
            },
            rustls::Error::AlertReceived(alert) => match alert {
                Alert::CertificateRequired => Self::WantsCertificate,
                Alert::BadCertificate
                | Alert::UnsupportedCertificate
                | Alert::CertificateRevoked
                | Alert::CertificateExpired
                | Alert::CertificateUnknown
                | Alert::UnknownCA
                | Alert::AccessDenied
                | Alert::DecryptError => Self::RefusesCertificate(format!("{alert:?}")),
                Alert::HandshakeFailure | Alert::ProtocolVersion | Alert::NoApplicationProtocol => {
                    Self::Incompatible(format!("{alert:?}"))
                }
                _ => return None,
            },
            rustls::Error::InvalidMessage(_) => Self::NoTls,
            rustls::Error::PeerIncompatible(reason) => Self::Incompatible(format!("{reason:?}")),
            rustls::Error::NoApplicationProtocol => Self::Incompatible("without HTTP/2".to_owned()),
            _ => return None,
        })
    }
}

/// The last fault of a client's connections, until it is taken.
#[derive(Debug, Clone, Default)]
pub(crate) struct Faults(Arc<Mutex<Option<TlsFault>>>);

impl Faults {
    fn note(&self, error: &io::Error) {
        if let Some(fault) = TlsFault::of(error) {
            *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(fault);
        }
    }

    pub(crate) fn set(&self, fault: Option<TlsFault>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = fault;
    }

    pub(crate) fn take(&self) -> Option<TlsFault> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// The TLS configuration for connections to one host.
#[derive(Clone)]
pub(crate) struct Encrypt {
    connector: TlsConnector,
    name: ServerName<'static>,
    faults: Faults,
}

impl std::fmt::Debug for Encrypt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Encrypt").field(&self.name).finish()
    }
}

impl Encrypt {
    /// Trusts only certificates of `authority`, which were read from its path, for a host with this
    /// `name`.
    pub(crate) fn new(
        name: ServerName<'static>,
        (authority, ca): (Vec<CertificateDer<'static>>, &std::path::Path),
        credentials: &Credentials,
        faults: Faults,
    ) -> Result<Self, CredentialError> {
        let unusable = |path: &std::path::Path| {
            let path = path.to_owned();
            move |error: rustls::Error| CredentialError::Pem {
                path,
                problem: format!("cannot be used: {error}"),
            }
        };
        let mut roots = RootCertStore::empty();
        for certificate in authority {
            roots.add(certificate).map_err(unusable(ca))?;
        }
        let provider = Arc::new(crypto::ring::default_provider());
        let builder = ClientConfig::builder_with_provider(provider)
            .with_protocol_versions(&[&version::TLS13])
            .map_err(unusable(ca))?
            .with_root_certificates(roots);
        let mut config = match (&credentials.tls_cert, &credentials.tls_key) {
            (Some(certificate), Some(key)) => builder
                .with_client_auth_cert(
                    files::read_certificates(certificate)?,
                    files::read_key(key)?,
                )
                .map_err(unusable(certificate))?,
            _ => builder.with_no_client_auth(),
        };
        config.alpn_protocols = vec![b"h2".to_vec()];
        Ok(Self {
            connector: TlsConnector::from(Arc::new(config)),
            name,
            faults,
        })
    }

    /// Encrypts a connection.
    pub(crate) async fn wrap(&self, stream: Box<dyn Stream>) -> io::Result<Box<dyn Stream>> {
        let connecting = self.connector.connect(self.name.clone(), stream);
        let inner = connecting
            .await
            .inspect_err(|error| self.faults.note(error))?;
        // A fault of an earlier connection no longer applies.
        self.faults.take();
        Ok(Box::new(Watched {
            inner,
            faults: self.faults.clone(),
        }))
    }
}

/// A connection that records the error that ended it.
struct Watched<S> {
    inner: S,
    faults: Faults,
}

impl<S: AsyncRead + Unpin> AsyncRead for Watched<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let read = Pin::new(&mut self.inner).poll_read(cx, buffer);
        if let Poll::Ready(Err(error)) = &read {
            self.faults.note(error);
        }
        read
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Watched<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.inner).poll_write(cx, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_shutdown(cx)
    }
}
