//! The port: the checks that a connection passes before it reaches the services.
//!
//! A connection from outside reaches the gRPC server after a TLS handshake and the opening bytes of
//! HTTP/2. Its first byte must arrive within two seconds, and these steps must end within ten.
//! Until its first call with a valid token it is a newcomer and can lose its place to others (see
//! `admission`). Connections within the process, such as those of the workers of `coordinator run`,
//! skip these checks.

use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use crate::protocol::v1::campaign_server::{Campaign, CampaignServer};
use crate::protocol::{DESCRIPTORS, MAX_MESSAGE_BYTES};
use anyhow::Context as _;
use results::{descriptors, live};
use tokio::io::{
    AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, DuplexStream, ReadBuf,
};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio_rustls::TlsAcceptor;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::service::Routes;
use tonic::transport::Server;
use tonic::transport::server::Connected;
use tracing::warn;

use crate::gateway::admission::{ADMITTED, NEWCOMERS, Peer, Places, Probation};
use crate::gateway::dial::{Dial, Stream};
use crate::gateway::guard::Guard;
use crate::gateway::log_limit::LogLimit;
use crate::gateway::methods::PermissionLayer;
use crate::gateway::token::TokenSet;

/// Time limit for the first byte of a connection.
const FIRST_BYTE: Duration = Duration::from_secs(2);
/// Time limit for the TLS handshake and the opening bytes of HTTP/2.
const HANDSHAKE_LIMIT: Duration = Duration::from_secs(10);
/// Maximum number of open calls on a connection. A worker has four, but a load generator may act
/// for a thousand workers.
const CALLS: u32 = 2048;
/// Maximum total size of the headers of one call, in bytes.
const HEADERS: u32 = 16 * 1024;
/// Number of file descriptors left to the live page and to files.
const RESERVE: u64 = descriptors::RESERVE + live::http::CONNECTIONS as u64;
/// Time to wait for a file descriptor when there is none for a connection.
const NO_DESCRIPTOR: Duration = Duration::from_millis(5);
/// Size of the buffer of a connection within the process, in each direction, in bytes.
const LOCAL_BUFFER: usize = 256 * 1024;

/// The opening bytes of HTTP/2 (RFC 9113, section 3.4).
const PREFACE: &[u8; 24] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
/// The first byte of a TLS handshake (RFC 8446, section 5.1).
const TLS_HANDSHAKE: u8 = 0x16;

/// The sources of a coordinator's connections.
#[derive(Debug)]
pub struct Listeners {
    /// The listening port and its protection; `None` for a coordinator that computes alone.
    pub port: Option<(TcpListener, Guard)>,
    /// Connections within the process.
    pub local: LocalListener,
}

/// The receiving end of connections made by a [`Dial`] within the process.
#[derive(Debug)]
pub struct LocalListener(mpsc::Receiver<DuplexStream>);

/// Makes a connected pair for connections within the process: a dial and its listener.
#[must_use]
pub fn local() -> (Dial, LocalListener) {
    let (outside, inside) = mpsc::channel(64);
    let dial = Dial::new(move || {
        let outside = outside.clone();
        async move {
            let (near, far) = tokio::io::duplex(LOCAL_BUFFER);
            let gone = |_| io::Error::from(io::ErrorKind::ConnectionRefused);
            outside.send(far).await.map_err(gone)?;
            Ok(near)
        }
    });
    (dial, LocalListener(inside))
}

/// Serves the campaign, health and reflection services on the `listeners` until `hang_up`.
pub async fn serve<C: Campaign>(
    campaign: C,
    listeners: Listeners,
    hang_up: CancellationToken,
) -> anyhow::Result<()> {
    let (health_reporter, health) = tonic_health::server::health_reporter();
    health_reporter.set_serving::<CampaignServer<C>>().await;
    let reflection = tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(DESCRIPTORS)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
        .build_v1()
        .context("the reflection service")?;
    let campaign = CampaignServer::new(campaign)
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    let services = Routes::new(health)
        .add_service(reflection)
        .add_service(campaign);
    serve_services(services, listeners, hang_up).await
}

async fn serve_services(
    services: Routes,
    listeners: Listeners,
    hang_up: CancellationToken,
) -> anyhow::Result<()> {
    let (through, connections) = mpsc::channel(64);
    let (port, tokens) = match listeners.port {
        Some((listener, guard)) => (Some((listener, guard.tls)), guard.tokens),
        None => (None, TokenSet::default()),
    };
    let server = Server::builder()
        .http2_keepalive_interval(Some(Duration::from_secs(10)))
        .http2_keepalive_timeout(Some(Duration::from_secs(10)))
        .http2_max_header_list_size(Some(HEADERS))
        .max_concurrent_streams(Some(CALLS))
        .layer(PermissionLayer::new(tokens))
        .add_routes(services)
        .serve_with_incoming_shutdown(ReceiverStream::new(connections), hang_up.cancelled_owned());
    let accept_port = async {
        match port {
            Some((listener, tls)) => accept_port(listener, tls, through.clone()).await,
            None => std::future::pending().await,
        }
    };
    tokio::select! {
        served = server => served.context("the server"),
        never = accept_port => match never {},
        never = accept_local(listeners.local, through.clone()) => match never {},
    }
}

/// Raises the limit on open files above the number of connections of a port and of a live page. A program does this
/// once, when it starts.
pub fn allow_many_files() {
    let connections = NEWCOMERS + ADMITTED + live::http::CONNECTIONS;
    descriptors::allow(connections as u64 + 1024);
}

/// Passes connections from within the process to the server.
async fn accept_local(
    mut listener: LocalListener,
    through: mpsc::Sender<io::Result<Connection>>,
) -> Infallible {
    while let Some(stream) = listener.0.recv().await {
        // Sending fails only when the server is about to end.
        let _ = through.send(Ok(Connection::local(stream))).await;
    }
    std::future::pending().await
}

/// Accepts connections and passes those that complete the opening to the server.
async fn accept_port(
    listener: TcpListener,
    tls: TlsAcceptor,
    through: mpsc::Sender<io::Result<Connection>>,
) -> Infallible {
    let places = Places::new(NEWCOMERS, ADMITTED);
    let failures = Arc::new(LogLimit::default());
    // Connections that are being opened are dropped together with this task.
    let mut opening = JoinSet::new();
    loop {
        while opening.try_join_next().is_some() {}
        let (stream, address) = match listener.accept().await {
            // A port for both protocols sees IPv4 addresses as parts of IPv6 ones.
            Ok((stream, address)) => {
                let ip = address.ip().to_canonical();
                (stream, SocketAddr::new(ip, address.port()))
            }
            Err(error) => {
                if let Some(more) = failures.permit() {
                    warn!(%error, more, "cannot accept a connection");
                }
                // Most likely there are no file descriptors left: closing the oldest newcomer frees
                // one.
                places.close_oldest();
                tokio::time::sleep(NO_DESCRIPTOR).await;
                continue;
            }
        };
        if descriptors::is_of_reserve(&stream, RESERVE) {
            let has_room = places.close_oldest();
            // Closing takes a moment.
            tokio::time::sleep(NO_DESCRIPTOR).await;
            if !has_room {
                if let Some(more) = failures.permit() {
                    warn!(peer = %address, more, "too few open files are allowed for another connection");
                }
                continue;
            }
        }
        let newcomer = places.arrive();
        let (tls, through, failures) = (tls.clone(), through.clone(), Arc::clone(&failures));
        opening.spawn(async move {
            let opened = tokio::select! {
                () = newcomer.lost() => Err(io::Error::other("closed: too many connections without a token")),
                opened = tokio::time::timeout(HANDSHAKE_LIMIT, open(stream, tls)) => {
                    opened.unwrap_or_else(|_| Err(too_slow()))
                }
            };
            match opened {
                Ok(stream) => {
                    let probation = newcomer.probation();
                    let peer = Peer::new(address, newcomer);
                    // Sending fails only when the server is about to end.
                    let _ = through
                        .send(Ok(Connection::new(stream, peer, probation)))
                        .await;
                }
                Err(reason) => {
                    if let Some(more) = failures.permit() {
                        warn!(peer = %address, %reason, more, "dropped a connection");
                    }
                }
            }
        });
    }
}

fn too_slow() -> io::Error {
    io::Error::new(io::ErrorKind::TimedOut, "says nothing")
}

/// Completes the TLS handshake and reads the opening bytes of HTTP/2.
async fn open(stream: TcpStream, tls: TlsAcceptor) -> io::Result<Box<dyn Stream>> {
    stream.set_nodelay(true)?;
    let mut first = [0];
    let begun = tokio::time::timeout(FIRST_BYTE, stream.peek(&mut first)).await;
    if begun.map_err(|_| too_slow())?? == 0 {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    if first[0] != TLS_HANDSHAKE {
        return refuse(stream, "this port speaks gRPC over TLS 1.3").await;
    }
    match tls.accept(stream).into_fallible().await {
        Ok(stream) => expect_preface(Box::new(stream)).await,
        Err((error, stream)) => {
            linger(stream).await;
            Err(error)
        }
    }
}

/// Reads the opening bytes of HTTP/2.
async fn expect_preface(mut stream: Box<dyn Stream>) -> io::Result<Box<dyn Stream>> {
    let mut read = [0; PREFACE.len()];
    let mut length = 0;
    while length < read.len() {
        match stream.read(&mut read[length..]).await? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            more => length += more,
        }
        if !PREFACE.starts_with(&read[..length]) {
            let why = "this port speaks gRPC over HTTP/2";
            return refuse(stream, why).await;
        }
    }
    Ok(stream)
}

/// Refuses a caller with an explanation in HTTP/1.1, which common tools understand.
async fn refuse<T>(mut stream: impl Stream, why: &'static str) -> io::Result<T> {
    let answer = format!(
        "HTTP/1.1 400 Bad Request\r\nContent-Type: text/plain\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n{why}\n",
        why.len() + 1
    );
    stream.write_all(answer.as_bytes()).await?;
    linger(stream).await;
    Err(io::Error::new(io::ErrorKind::InvalidData, why))
}

/// Closes a connection after reading the rest of its input: closing with unread bytes would reset
/// it, and the last answer could be lost.
async fn linger(mut stream: impl Stream) {
    let closing = async {
        stream.shutdown().await?;
        let mut rest = [0; 1024];
        let mut total = 0;
        while total < 64 * 1024 {
            match stream.read(&mut rest).await? {
                0 => break,
                more => total += more,
            }
        }
        io::Result::Ok(())
    };
    // A caller that has not read the answer by now may lose it.
    let _ = tokio::time::timeout(Duration::from_secs(1), closing).await;
}

/// A connection that completed the opening.
struct Connection {
    stream: Box<dyn Stream>,
    /// The opening bytes that have yet to be passed to the HTTP/2 server.
    preface: &'static [u8],
    peer: Peer,
    /// The time limit for showing a token, until the connection is admitted.
    probation: Option<Probation>,
}

impl Connection {
    fn new(stream: Box<dyn Stream>, peer: Peer, probation: Probation) -> Self {
        Self {
            stream,
            preface: PREFACE,
            peer,
            probation: Some(probation),
        }
    }

    fn local(stream: DuplexStream) -> Self {
        Self {
            stream: Box::new(stream),
            preface: &[],
            peer: Peer::local(),
            probation: None,
        }
    }
}

impl Connected for Connection {
    type ConnectInfo = Peer;

    fn connect_info(&self) -> Peer {
        self.peer.clone()
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if !self.preface.is_empty() {
            let (now, later) = self
                .preface
                .split_at(self.preface.len().min(buffer.remaining()));
            buffer.put_slice(now);
            self.preface = later;
            return Poll::Ready(Ok(()));
        }
        if self.probation.is_some() && self.peer.is_admitted() {
            self.probation = None;
        }
        if let Some(probation) = &mut self.probation
            && Pin::new(probation).poll(cx).is_ready()
        {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        Pin::new(&mut self.stream).poll_read(cx, buffer)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(cx, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests;
