//! Opening a link's connections: the coordinator's addresses and the current contents of its access
//! file.

use std::io;
use std::path::PathBuf;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use hyper_util::rt::TokioIo;
use rustls::pki_types::{CertificateDer, ServerName};
use tonic::codegen::http::Uri;
use tonic::metadata::{Ascii, MetadataValue};

use crate::access::{Access, SERVER_NAME};
use crate::client;
use crate::dial::{Dial, Stream};
use crate::error::Error;
use crate::files::Credentials;
use crate::tls::{Encrypt, Faults};
use crate::token::Role;

/// Time limit for opening a connection.
const DIAL_TIMEOUT: Duration = Duration::from_secs(5);
/// Time limit for the TLS handshake, which is slow when thousands of workers connect at once.
const ENCRYPT_TIMEOUT: Duration = Duration::from_secs(20);

/// The coordinator's addresses, the means to authenticate it, and the token that it requires.
pub(super) struct Entrance {
    pub(super) hosts: Vec<(String, u16)>,
    pub(super) encrypt: Option<Encrypt>,
    /// The certificate of the access file, if there is one.
    pub(super) certificate: Option<CertificateDer<'static>>,
    pub(super) token: Option<MetadataValue<Ascii>>,
}

impl Entrance {
    pub(super) fn has_the_secrets_of(&self, other: &Self) -> bool {
        self.certificate == other.certificate && self.token == other.token
    }
}

/// A source of entrances that follows an access file.
pub(super) struct Followed {
    pub(super) path: PathBuf,
    /// An address that replaces those in the file.
    pub(super) instead: Option<(String, u16)>,
    pub(super) credentials: Credentials,
    pub(super) role: Role,
}

impl Followed {
    pub(super) fn read(&self, faults: &Faults) -> Result<Entrance, Error> {
        let access: Access = client::read(&self.path)?;
        let name = ServerName::try_from(SERVER_NAME).expect("a name of letters");
        let certificate = access.certificate(&self.path)?;
        let authority = (vec![certificate.clone()], self.path.as_path());
        Ok(Entrance {
            certificate: Some(certificate),
            encrypt: Some(Encrypt::new(
                name,
                authority,
                &self.credentials,
                faults.clone(),
            )?),
            token: access.token(self.role).map(|token| token.header()),
            hosts: match &self.instead {
                Some(host) => vec![host.clone()],
                None => access.hosts().flatten().collect(),
            },
        })
    }
}

/// The state that a link's clones share.
pub(super) struct Shared {
    pub(super) dial: Dial,
    pub(super) entrance: Mutex<Arc<Entrance>>,
    pub(super) followed: Option<Followed>,
    pub(super) faults: Faults,
    /// The entrance at which the two sides last did not accept each other's secrets.
    pub(super) unknown_at: Mutex<Option<Arc<Entrance>>>,
}

/// Opens connections for the channel.
#[derive(Clone)]
pub(super) struct Connector(pub(super) Arc<Shared>);

impl tower::Service<Uri> for Connector {
    type Response = TokioIo<Box<dyn Stream>>;
    type Error = io::Error;
    type Future = Pin<Box<dyn Future<Output = io::Result<Self::Response>> + Send>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, _: Uri) -> Self::Future {
        let shared = Arc::clone(&self.0);
        Box::pin(async move {
            shared.follow().await;
            Ok(TokioIo::new(shared.open().await?))
        })
    }
}

impl Shared {
    pub(super) fn entrance(&self) -> Arc<Entrance> {
        Arc::clone(&self.lock())
    }

    fn lock(&self) -> MutexGuard<'_, Arc<Entrance>> {
        self.entrance.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads the access file again. If it cannot be used, for example after the campaign's end, the
    /// entrance is kept.
    async fn follow(self: &Arc<Self>) {
        if self.followed.is_none() {
            return;
        }
        let shared = Arc::clone(self);
        // Reading a file on a network file system may block.
        let read = tokio::task::spawn_blocking(move || {
            let followed = shared.followed.as_ref()?;
            followed.read(&shared.faults).ok()
        });
        if let Ok(Some(entrance)) = read.await {
            *self.lock() = Arc::new(entrance);
        }
    }

    /// Opens a connection to the first address that answers, or returns the first failure.
    async fn open(&self) -> io::Result<Box<dyn Stream>> {
        let entrance = self.entrance();
        let mut first = None;
        for (host, port) in &entrance.hosts {
            match self.open_one(&entrance, host, *port).await {
                Ok(stream) => return Ok(stream),
                Err(error) => {
                    let fault = self.faults.take();
                    first.get_or_insert((error, fault));
                }
            }
        }
        let (error, fault) = first.expect("an entrance has an address");
        self.faults.set(fault);
        Err(error)
    }

    async fn open_one(
        &self,
        entrance: &Entrance,
        host: &str,
        port: u16,
    ) -> io::Result<Box<dyn Stream>> {
        let late = |_| io::Error::new(io::ErrorKind::TimedOut, "no answer in time");
        let dialling = self.dial.open(host.to_owned(), port);
        let stream = tokio::time::timeout(DIAL_TIMEOUT, dialling)
            .await
            .map_err(late)??;
        match &entrance.encrypt {
            Some(encrypt) => tokio::time::timeout(ENCRYPT_TIMEOUT, encrypt.wrap(stream))
                .await
                .map_err(late)?,
            None => Ok(stream),
        }
    }
}
