//! The port, the service and the workers of this process, while a campaign runs.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

use crate::gateway::Guard;
use crate::gateway::access::Issuer;
use crate::gateway::port::{self, Listeners};
use tokio::net::TcpListener;
use tokio::task::{JoinHandle, JoinSet};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::coordinator::board::Board;
use crate::coordinator::local::LocalWorkers;
use crate::coordinator::recorder::Recorder;
use crate::coordinator::service::Service;

/// Maximum time to wait until the workers know that they are to leave.
const FAREWELL: Duration = Duration::from_secs(3);

/// A port for workers and clients.
#[derive(Debug)]
pub struct Port {
    /// The address to listen on. Without one: all interfaces, at the port of the last run if it is
    /// free.
    pub listen: Option<SocketAddr>,
    /// The access file, which the coordinator writes.
    pub access: PathBuf,
    /// Names and addresses of this machine to write into the access file, besides those found.
    pub hosts: Vec<String>,
}

/// An error that ends a campaign.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The store refused.
    #[error(transparent)]
    Store(#[from] store::Error),
    /// The access file cannot be used.
    #[error(transparent)]
    Access(#[from] crate::gateway::Error),
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: choose another {option} address, or stop what uses it")]
    Listen {
        /// The option that gives the address.
        option: &'static str,
        /// The address.
        address: SocketAddr,
        /// The system's error.
        source: std::io::Error,
    },
    /// Any other error.
    #[error(transparent)]
    Other(#[from] anyhow::Error),
}

/// Listens on the address that an option gives.
///
/// # Errors
///
/// [`Error::Listen`].
pub async fn listen(option: &'static str, address: SocketAddr) -> Result<TcpListener, Error> {
    TcpListener::bind(address)
        .await
        .map_err(|source| Error::Listen {
            option,
            address,
            source,
        })
}

/// A bound port, and its access file, which is locked but not yet written.
pub(crate) struct OpenPort {
    /// The names of this machine for the access file.
    hosts: Vec<String>,
    listener: TcpListener,
    address: SocketAddr,
    guard: Guard,
    issuer: Issuer,
}

impl OpenPort {
    /// Binds the port of the campaign `name`.
    pub(crate) async fn new(port: &Port, name: &str) -> Result<Self, Error> {
        let issuer = Issuer::new(&port.access, name)?;
        let guard = issuer.guard()?;
        let everywhere = |port| SocketAddr::from((Ipv4Addr::UNSPECIFIED, port));
        let listener = match (port.listen, issuer.last_port()) {
            (Some(address), _) => listen("--listen", address).await?,
            // Workers that wait for this coordinator try the last port first.
            (None, Some(last)) => match listen("--listen", everywhere(last)).await {
                Ok(listener) => listener,
                Err(_) => listen("--listen", everywhere(0)).await?,
            },
            (None, None) => listen("--listen", everywhere(0)).await?,
        };
        let address = listener.local_addr().map_err(|source| Error::Listen {
            option: "--listen",
            address: everywhere(0),
            source,
        })?;
        Ok(Self {
            hosts: port.hosts.clone(),
            listener,
            address,
            guard,
            issuer,
        })
    }
}

/// The server and the workers of this process.
pub(crate) struct Serving {
    hang_up: CancellationToken,
    server: JoinHandle<anyhow::Result<()>>,
    issuer: Option<Issuer>,
    stop_workers: CancellationToken,
    workers: JoinSet<Result<crate::worker::Summary, crate::worker::Error>>,
}

impl Serving {
    /// Serves the port, if there is one, and starts the workers of this process.
    ///
    /// # Errors
    ///
    /// The access file cannot be written.
    pub(crate) fn start<R: Recorder>(
        service: Service<R>,
        opened: Option<OpenPort>,
        workers: &LocalWorkers,
    ) -> Result<Self, Error> {
        let hang_up = CancellationToken::new();
        let (dial, local) = port::local();
        let mut issuer = None;
        let port = match opened {
            Some(opened) => {
                let issuer = issuer.insert(opened.issuer);
                let file = issuer.publish(opened.address, &opened.hosts)?;
                info!(access = %file.display(), "workers and commands need this file, or a copy");
                info!(address = %opened.address, "listening");
                Some((opened.listener, opened.guard))
            }
            None => None,
        };
        let listeners = Listeners { port, local };
        let server = tokio::spawn(port::serve(service, listeners, hang_up.clone()));
        let stop_workers = CancellationToken::new();
        let workers = workers.start(&dial, &stop_workers);
        Ok(Self {
            hang_up,
            server,
            issuer,
            stop_workers,
            workers,
        })
    }

    /// A token that is cancelled when the server is to end.
    pub(crate) const fn hang_up(&self) -> &CancellationToken {
        &self.hang_up
    }

    /// Waits for the first failure of a worker of this process; never returns if there is none.
    pub(crate) async fn failed(&mut self) -> anyhow::Error {
        while let Some(ended) = self.workers.join_next().await {
            match ended {
                Ok(Ok(_)) => {}
                Ok(Err(error)) => {
                    return anyhow::Error::from(error).context("a worker of this process");
                }
                Err(panic) => {
                    return anyhow::Error::from(panic).context("a worker of this process");
                }
            }
        }
        std::future::pending().await
    }

    /// Ends the workers of this process and the port. The access file is removed when the work is
    /// finished.
    pub(crate) async fn end(mut self, is_finished: bool) {
        self.stop_workers.cancel();
        let finish_workers = async { while self.workers.join_next().await.is_some() {} };
        if tokio::time::timeout(Duration::from_secs(15), finish_workers)
            .await
            .is_err()
        {
            warn!("workers of this process did not end in time");
        }
        self.hang_up.cancel();
        // Connections still open are cut: their workers reconnect.
        let _ = tokio::time::timeout(Duration::from_secs(2), self.server).await;
        if let (true, Some(issuer)) = (is_finished, self.issuer) {
            issuer.remove();
        }
    }
}

/// Waits until the workers know that they are to leave, at most for [`FAREWELL`].
pub(crate) async fn farewell(board: &Board) {
    let deadline = tokio::time::Instant::now() + FAREWELL;
    while !board.all_dismissed() && tokio::time::Instant::now() < deadline {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
