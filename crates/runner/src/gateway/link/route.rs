//! The routes of a link's connections, and the access file that one of them follows.

use std::io;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use hyper_util::rt::TokioIo;
use rustls::pki_types::CertificateDer;
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tonic::codegen::http::Uri;
use tonic::metadata::{Ascii, MetadataValue};

use crate::gateway::access::{Access, malformed};
use crate::gateway::address::Address;
use crate::gateway::dial::{Dial, Stream};
use crate::gateway::error::Error;
use crate::gateway::tls;
use crate::gateway::token::Role;

/// Time limit for opening a connection.
const DIAL_TIMEOUT: Duration = Duration::from_secs(5);
/// Time limit for the TLS handshake, which is slow when thousands of workers connect at once.
const TLS_TIMEOUT: Duration = Duration::from_secs(20);

/// The route of a link's connections to the coordinator.
pub(super) enum Route {
    /// TCP and TLS, with addresses and secrets from an access file.
    Access(AccessRoute),
    /// Connections to the same process or a simulated one, without TLS and token.
    Local(Dial),
}

impl Route {
    /// The first address.
    pub(super) fn address(&self) -> String {
        match self {
            Self::Access(route) => route.target().addresses[0].to_string(),
            Self::Local(_) => "this process".to_owned(),
        }
    }

    /// The token that calls carry.
    pub(super) fn token(&self) -> Option<MetadataValue<Ascii>> {
        match self {
            Self::Access(route) => Some(route.target().token.clone()),
            Self::Local(_) => None,
        }
    }

    /// Whether there is neither an access file nor a program that listens.
    pub(super) fn is_abandoned(&self) -> bool {
        match self {
            Self::Access(route) => route.is_abandoned.load(Ordering::Relaxed),
            Self::Local(_) => false,
        }
    }

    /// Records that one side did not accept the other's secrets. Returns whether that happened before with the same
    /// secrets.
    pub(super) fn is_refused_again(&self) -> bool {
        let Self::Access(route) = self else {
            return true;
        };
        let target = route.target();
        let before = lock(&route.refused).replace(Arc::clone(&target));
        before.is_some_and(|before| before.has_the_secrets_of(&target))
    }
}

/// The contents of an access file, as a link needs them.
struct Target {
    addresses: Vec<Address>,
    certificate: CertificateDer<'static>,
    tls: TlsConnector,
    token: MetadataValue<Ascii>,
}

impl Target {
    fn has_the_secrets_of(&self, other: &Self) -> bool {
        self.certificate == other.certificate && self.token == other.token
    }
}

/// A route that follows an access file.
pub(super) struct AccessRoute {
    path: PathBuf,
    /// The address that replaces those in the file.
    connect: Option<Address>,
    role: Role,
    target: Mutex<Arc<Target>>,
    /// The last target at which one side did not accept the other's secrets.
    refused: Mutex<Option<Arc<Target>>>,
    /// Whether the last attempt found no file, and an address at which nothing listens.
    is_abandoned: AtomicBool,
}

impl AccessRoute {
    pub(super) fn new(path: PathBuf, connect: Option<Address>, role: Role) -> Result<Self, Error> {
        let target = read(&path, connect.as_ref(), role)?;
        Ok(Self {
            path,
            connect,
            role,
            target: Mutex::new(Arc::new(target)),
            refused: Mutex::default(),
            is_abandoned: AtomicBool::new(false),
        })
    }

    fn target(&self) -> Arc<Target> {
        Arc::clone(&lock(&self.target))
    }

    /// Reads the access file again. If it cannot be used, for example after the campaign's end, the
    /// target stays. Returns whether there is a file.
    async fn follow(&self) -> bool {
        let (path, connect, role) = (self.path.clone(), self.connect.clone(), self.role);
        // Reading a file on a network file system may block.
        let reading = move || read(&path, connect.as_ref(), role);
        match tokio::task::spawn_blocking(reading).await {
            Ok(Ok(target)) => *lock(&self.target) = Arc::new(target),
            Ok(Err(Error::NoAccess { .. })) => return false,
            _ => {}
        }
        true
    }

    /// Reads the access file again and opens a connection to the first address that answers, or returns the first
    /// failure.
    async fn open(&self) -> io::Result<Box<dyn Stream>> {
        let has_file = self.follow().await;
        let target = self.target();
        let mut first = None;
        let mut is_refused = false;
        for address in &target.addresses {
            match open(address, &target.tls).await {
                Ok(stream) => {
                    self.is_abandoned.store(false, Ordering::Relaxed);
                    return Ok(stream);
                }
                Err(error) => {
                    is_refused |= error.kind() == io::ErrorKind::ConnectionRefused;
                    first = first.or(Some(error));
                }
            }
        }
        let is_abandoned = is_refused && !has_file;
        self.is_abandoned.store(is_abandoned, Ordering::Relaxed);
        Err(first.expect("a target has an address"))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reads the target of a link from the access file at `path`.
fn read(path: &Path, connect: Option<&Address>, role: Role) -> Result<Target, Error> {
    let access = Access::read(path)?;
    let certificate = access.certificate(path)?;
    let tls = tls::connector(certificate.clone())
        .map_err(|error| malformed(path, format!("certificate cannot be used: {error}")))?;
    Ok(Target {
        token: access.token(role).header(),
        certificate,
        tls,
        addresses: match connect {
            Some(address) => vec![address.clone()],
            None => access.addresses,
        },
    })
}

async fn open(address: &Address, tls: &TlsConnector) -> io::Result<Box<dyn Stream>> {
    let late = |_| io::Error::new(io::ErrorKind::TimedOut, "no answer in time");
    let connecting = TcpStream::connect((address.host.as_str(), address.port));
    let stream = tokio::time::timeout(DIAL_TIMEOUT, connecting)
        .await
        .map_err(late)??;
    stream.set_nodelay(true)?;
    let encrypting = tls.connect(tls::server_name(), stream);
    let stream = tokio::time::timeout(TLS_TIMEOUT, encrypting)
        .await
        .map_err(late)??;
    Ok(Box::new(stream))
}

/// Opens connections for the channel.
#[derive(Clone)]
pub(super) struct Connector(pub(super) Arc<Route>);

impl tower::Service<Uri> for Connector {
    type Response = TokioIo<Box<dyn Stream>>;
    type Error = io::Error;
    type Future = Pin<Box<dyn Future<Output = io::Result<Self::Response>> + Send>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, _: Uri) -> Self::Future {
        let route = Arc::clone(&self.0);
        Box::pin(async move {
            let stream = match &*route {
                Route::Access(route) => route.open().await?,
                Route::Local(dial) => dial.open().await?,
            };
            Ok(TokioIo::new(stream))
        })
    }
}
