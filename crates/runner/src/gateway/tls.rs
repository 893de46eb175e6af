//! TLS between a coordinator and its callers, and the interpretation of its failures.
//!
//! Only TLS 1.3 is used, since both ends belong to this project. A caller trusts the one certificate
//! in its access file.

use std::io;
use std::sync::Arc;

use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::{
    AlertDescription, CertificateError, ClientConfig, RootCertStore, ServerConfig, crypto, version,
};
use tokio_rustls::{TlsAcceptor, TlsConnector};

/// The host name in every coordinator's certificate. A caller trusts only the certificate in its
/// file, so the name need not be the machine's, and the file is valid wherever it is copied.
pub(crate) const SERVER_NAME: &str = "pitchline";

/// [`SERVER_NAME`] as rustls wants it.
pub(crate) fn server_name() -> ServerName<'static> {
    ServerName::try_from(SERVER_NAME).expect("a name of letters")
}

/// A permanent failure of TLS. Each text continues a sentence that begins with the coordinator's
/// address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TlsFault {
    #[error(
        "shows a certificate that is not in the access file: take the access file of this coordinator"
    )]
    Untrusted,
    #[error(
        "shows a certificate that has expired: stop it, remove its access file, start it again, and \
         take the new file"
    )]
    Expired,
    #[error("shows a certificate that is not valid yet: is the clock of this machine right?")]
    NotYetValid,
    #[error("shows a certificate that cannot be used ({0})")]
    Unusable(String),
    #[error(
        "does not speak TLS: this is the live page or another program; the access file has the port \
         for workers and commands"
    )]
    NoTls,
    #[error("speaks another kind of TLS ({0}): this program speaks TLS 1.3 with HTTP/2")]
    Incompatible(String),
}

impl TlsFault {
    /// The permanent fault that a connection's error means, if it is one.
    pub(crate) fn of(error: &io::Error) -> Option<Self> {
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
                other => Self::Unusable(other.to_string()),
            },
            rustls::Error::AlertReceived(
                alert @ (Alert::HandshakeFailure
                | Alert::ProtocolVersion
                | Alert::NoApplicationProtocol),
            ) => Self::Incompatible(format!("{alert:?}")),
            rustls::Error::InvalidMessage(_) => Self::NoTls,
            rustls::Error::PeerIncompatible(reason) => Self::Incompatible(format!("{reason:?}")),
            rustls::Error::NoApplicationProtocol => Self::Incompatible("without HTTP/2".to_owned()),
            _ => return None,
        })
    }
}

const HTTP_2: &[u8] = b"h2";

/// The caller's side, which trusts only this certificate.
pub(crate) fn connector(
    certificate: CertificateDer<'static>,
) -> Result<TlsConnector, rustls::Error> {
    let mut trusted = RootCertStore::empty();
    trusted.add(certificate)?;
    let provider = Arc::new(crypto::ring::default_provider());
    let mut config = ClientConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&version::TLS13])?
        .with_root_certificates(trusted)
        .with_no_client_auth();
    config.alpn_protocols = vec![HTTP_2.to_vec()];
    Ok(TlsConnector::from(Arc::new(config)))
}

/// The coordinator's side.
pub(crate) fn acceptor(
    certificate: CertificateDer<'static>,
    key: PrivateKeyDer<'static>,
) -> Result<TlsAcceptor, rustls::Error> {
    let provider = Arc::new(crypto::ring::default_provider());
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&version::TLS13])?
        .with_no_client_auth()
        .with_single_cert(vec![certificate], key)?;
    config.alpn_protocols = vec![HTTP_2.to_vec()];
    Ok(TlsAcceptor::from(Arc::new(config)))
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime};

    use rustls::pki_types::pem::PemObject as _;

    use super::*;
    use crate::gateway::access::secrets;

    /// A certificate that is valid from `now` on, and its key.
    fn pair(now: SystemTime) -> (CertificateDer<'static>, PrivateKeyDer<'static>) {
        let (certificate, key) = secrets::certificate(now).unwrap();
        (
            CertificateDer::from_pem_slice(certificate.as_bytes()).unwrap(),
            PrivateKeyDer::from_pem_slice(key.as_bytes()).unwrap(),
        )
    }

    /// The fault of a caller that trusts one certificate and is shown another.
    async fn fault(
        trusted: CertificateDer<'static>,
        shown: (CertificateDer<'static>, PrivateKeyDer<'static>),
    ) -> Option<TlsFault> {
        let (near, far) = tokio::io::duplex(64 * 1024);
        let acceptor = acceptor(shown.0, shown.1).unwrap();
        let accepting = tokio::spawn(async move { acceptor.accept(far).await.map(drop) });
        let connecting = connector(trusted).unwrap().connect(server_name(), near);
        let connected = connecting.await;
        // The coordinator's side ends in the same way.
        let _ = accepting.await.unwrap();
        connected.err().map(|error| TlsFault::of(&error).unwrap())
    }

    #[tokio::test]
    async fn certificates_that_do_not_fit_are_told_apart() {
        let now = SystemTime::now();
        let day = Duration::from_secs(24 * 3600);
        let (own, other) = (pair(now), pair(now));
        assert_eq!(fault(own.0.clone(), own).await, None);
        assert_eq!(fault(other.0, pair(now)).await, Some(TlsFault::Untrusted));
        let old = pair(now - 3651 * day);
        assert_eq!(fault(old.0.clone(), old).await, Some(TlsFault::Expired));
        let early = pair(now + day);
        assert_eq!(
            fault(early.0.clone(), early).await,
            Some(TlsFault::NotYetValid)
        );
        // A clock that is behind by some minutes does no harm.
        let early = pair(now + day / 48);
        assert_eq!(fault(early.0.clone(), early).await, None);
    }
}
