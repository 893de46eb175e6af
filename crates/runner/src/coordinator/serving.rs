//! The port, the service and the workers of this process, while a campaign runs.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::exit::{self, HasExitCode, ProgramError};
use crate::gateway::Guard;
use crate::gateway::access::Issuer;
use crate::gateway::port::{self, Listeners};
use tokio::net::{TcpListener, TcpSocket};
use tokio::task::{JoinHandle, JoinSet};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::coordinator::board::Board;
use crate::coordinator::local::LocalWorkers;
use crate::coordinator::recorder::Recorder;
use crate::coordinator::service::Service;

/// Maximum time to wait until the workers know that they are to leave.
const FAREWELL: Duration = Duration::from_secs(3);

/// Time since its last call within which a client counts as watching: a call waits for up to ten seconds.
const WATCHING: Duration = Duration::from_secs(15);

/// Time for a client that watches to ask again. It does so a second after each answer.
const LAST_LOOK: Duration = Duration::from_millis(1500);

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

/// An address that cannot be listened on.
#[derive(Debug, thiserror::Error)]
#[error("cannot listen on {address}: choose another {option} address, or stop what uses it")]
pub struct ListenError {
    option: &'static str,
    address: SocketAddr,
    source: std::io::Error,
}

impl HasExitCode for ListenError {
    fn exit_code(&self) -> u8 {
        exit::CANNOT_LISTEN
    }
}

/// Listens on the address that an option gives.
pub async fn listen(option: &'static str, address: SocketAddr) -> Result<TcpListener, ListenError> {
    TcpListener::bind(address)
        .await
        .map_err(|source| ListenError {
            option,
            address,
            source,
        })
}

/// Maximum number of connections that wait to be accepted, the same as that of [`TcpListener::bind`].
const BACKLOG: u32 = 1024;

/// Listens on all interfaces, over IPv6 and IPv4 if the machine has both.
async fn listen_everywhere(port: u16) -> Result<TcpListener, ListenError> {
    match listen_dual(port) {
        Ok(listener) => Ok(listener),
        Err(_) => listen("--listen", (Ipv4Addr::UNSPECIFIED, port).into()).await,
    }
}

/// Listens on all interfaces over IPv6, and over IPv4 whatever the system's default is.
fn listen_dual(port: u16) -> std::io::Result<TcpListener> {
    let socket = TcpSocket::new_v6()?;
    socket.set_reuseaddr(true)?;
    rustix::net::sockopt::set_ipv6_v6only(&socket, false)?;
    socket.bind((Ipv6Addr::UNSPECIFIED, port).into())?;
    socket.listen(BACKLOG)
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
    pub(crate) async fn new(port: &Port, name: &str) -> Result<Self, ProgramError> {
        let issuer = Issuer::new(&port.access, name)?;
        let guard = issuer.guard()?;
        let listener = match (port.listen, issuer.last_port()) {
            (Some(address), _) => listen("--listen", address).await?,
            // Workers that wait for this coordinator try the last port first.
            (None, Some(last)) => match listen_everywhere(last).await {
                Ok(listener) => listener,
                Err(_) => listen_everywhere(0).await?,
            },
            (None, None) => listen_everywhere(0).await?,
        };
        let address = listener.local_addr().map_err(|source| ListenError {
            option: "--listen",
            address: port
                .listen
                .unwrap_or_else(|| (Ipv6Addr::UNSPECIFIED, 0).into()),
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
pub(crate) struct RunningServer {
    hang_up: CancellationToken,
    server: JoinHandle<anyhow::Result<()>>,
    issuer: Option<Issuer>,
    stop_workers: CancellationToken,
    workers: JoinSet<Result<crate::worker::Summary, crate::worker::Error>>,
}

impl RunningServer {
    /// Serves the port, if there is one, and starts the workers of this process.
    pub(crate) fn start<R: Recorder>(
        service: Service<R>,
        opened: Option<OpenPort>,
        workers: &LocalWorkers,
        db: &Path,
    ) -> Result<Self, crate::gateway::Error> {
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
        let workers = workers.start(&dial, &stop_workers, Some(notes(db)));
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

    /// Waits for the first failure of the server or of a worker of this process; never returns if there is none.
    pub(crate) async fn failed(&mut self) -> anyhow::Error {
        tokio::select! {
            ended = &mut self.server => match ended {
                Ok(Err(error)) => error.context("the port"),
                Ok(Ok(())) => anyhow::anyhow!("the port was closed"),
                Err(panic) => anyhow::Error::from(panic).context("the port"),
            },
            error = failed_worker(&mut self.workers) => error,
        }
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
        if !self.server.is_finished() {
            let _ = tokio::time::timeout(Duration::from_secs(2), self.server).await;
        }
        if let (true, Some(issuer)) = (is_finished, self.issuer) {
            issuer.remove();
        }
    }
}

/// Waits for the first failure of a worker of this process; never returns if there is none.
async fn failed_worker(
    workers: &mut JoinSet<Result<crate::worker::Summary, crate::worker::Error>>,
) -> anyhow::Error {
    while let Some(ended) = workers.join_next().await {
        let error = match ended {
            Ok(Ok(_)) => continue,
            Ok(Err(error)) => anyhow::Error::from(error),
            Err(panic) => anyhow::Error::from(panic),
        };
        return error.context("a worker of this process");
    }
    std::future::pending().await
}

/// The place of notes beside a store: see [`Options::journal`](crate::worker::Options::journal).
fn notes(db: &Path) -> (PathBuf, String) {
    let folder = db.parent().filter(|folder| !folder.as_os_str().is_empty());
    let name = db.file_name().unwrap_or_default().to_string_lossy();
    (
        folder.unwrap_or(Path::new(".")).to_owned(),
        format!("{name}-"),
    )
}

/// Waits until the workers know that they are to leave, and the clients that watch have had time to ask once more, at
/// most for [`FAREWELL`].
pub(crate) async fn farewell(board: &Board) {
    let now = tokio::time::Instant::now();
    let is_watched = board.is_watched(WATCHING);
    let (told, deadline) = (now + LAST_LOOK, now + FAREWELL);
    while !board.all_dismissed() || is_watched && tokio::time::Instant::now() < told {
        if tokio::time::Instant::now() >= deadline {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[cfg(test)]
mod tests {
    use tokio::net::TcpStream;

    use super::*;

    #[tokio::test]
    async fn a_port_on_all_interfaces_is_reached_over_both_protocols() {
        let listener = listen_everywhere(0).await.unwrap();
        let port = listener.local_addr().unwrap().port();
        TcpStream::connect((Ipv4Addr::LOCALHOST, port))
            .await
            .unwrap();
        let has_ipv6 = std::net::TcpListener::bind((Ipv6Addr::LOCALHOST, 0)).is_ok();
        let reached = TcpStream::connect((Ipv6Addr::LOCALHOST, port)).await;
        assert_eq!(reached.is_ok(), has_ipv6);
        // The port is taken for both.
        assert!(listen_everywhere(port).await.is_err());
    }
}
