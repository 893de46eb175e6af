//! The port: who gets through to the services, and under which conditions.
//!
//! A connection reaches the gRPC server only when it has shown what it is: on an encrypted port by a
//! TLS handshake, on any port by the opening bytes of HTTP/2, all within ten seconds. Until then it
//! holds one of a limited number of places, apart from those of the connections that are through, so
//! that callers who open a connection and say nothing, or talk rubbish, wait for each other and for
//! nobody else. A connection that brings no valid token within half a minute is closed again.

use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use protocol::v2::campaign_server::{Campaign, CampaignServer};
use protocol::{DESCRIPTORS, MAX_MESSAGE_BYTES};
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::task::JoinSet;
use tokio::time::Sleep;
use tokio_rustls::TlsAcceptor;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::service::Routes;
use tonic::transport::Server;
use tonic::transport::server::Connected;
use tracing::warn;
use worker::client::Stream;

use crate::access::AccessLayer;
use crate::guard::Guard;

/// How long a caller may take to show what it is.
const GREETING: Duration = Duration::from_secs(10);
/// How long a caller may go on without a valid token.
const PROBATION: Duration = Duration::from_secs(30);
/// How many callers may be showing what they are at once: a thousand workers that come together pass
/// in a second or two.
const GREETINGS: usize = 1024;
/// How many connections there may be at once. A worker has one.
const CONNECTIONS: usize = 4096;
/// How many calls a connection may have open at once. A worker has four, but a load generator may
/// speak for a thousand workers.
const CALLS: u32 = 2048;
/// What the headers of one call may add up to, in bytes.
const HEADERS: u32 = 16 * 1024;

/// The opening bytes of HTTP/2 (RFC 9113, section 3.4).
const PREFACE: &[u8; 24] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
/// The first byte of a TLS handshake (RFC 8446, section 5.1).
const TLS_HANDSHAKE: u8 = 0x16;

/// Serves the campaign, health and reflection on `listener` until `hang_up`.
///
/// # Errors
///
/// The server cannot go on.
pub async fn serve<C: Campaign>(
    campaign: C,
    listener: TcpListener,
    guard: Guard,
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
    serve_services(services, listener, guard, hang_up).await
}

async fn serve_services(
    services: Routes,
    listener: TcpListener,
    guard: Guard,
    hang_up: CancellationToken,
) -> anyhow::Result<()> {
    allow_many_files();
    let (through, connections) = mpsc::channel(64);
    let server = Server::builder()
        .http2_keepalive_interval(Some(Duration::from_secs(10)))
        .http2_keepalive_timeout(Some(Duration::from_secs(10)))
        .http2_max_header_list_size(Some(HEADERS))
        .max_concurrent_streams(Some(CALLS))
        .layer(AccessLayer::new(guard.tokens))
        .add_routes(services)
        .serve_with_incoming_shutdown(ReceiverStream::new(connections), hang_up.cancelled_owned());
    tokio::select! {
        served = server => served.context("the server"),
        never = keep_door(listener, guard.tls, through) => match never {},
    }
}

/// Each connection is an open file, and the usual limit of 1024 is too few for a thousand workers.
fn allow_many_files() {
    use rustix::process::{Resource, getrlimit, setrlimit};
    let mut limit = getrlimit(Resource::Nofile);
    let wanted = 2 * CONNECTIONS as u64;
    let possible = limit.maximum.map_or(wanted, |maximum| maximum.min(wanted));
    if limit.current.is_some_and(|current| current < possible) {
        limit.current = Some(possible);
        // Without it the port serves fewer workers, and says so when it must turn one away.
        let _ = setrlimit(Resource::Nofile, limit);
    }
}

/// Accepts connections and passes on those that show what they are.
async fn keep_door(
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
    through: mpsc::Sender<io::Result<Connection>>,
) -> Infallible {
    let greetings = Arc::new(Semaphore::new(GREETINGS));
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    let failures = Arc::new(Sparing::default());
    // Dropped, and with them all that are half open, when this task is.
    let mut opening = JoinSet::new();
    loop {
        while opening.try_join_next().is_some() {}
        let greeting = Arc::clone(&greetings)
            .acquire_owned()
            .await
            .expect("nobody closes this semaphore");
        let (stream, address) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(error) => {
                if let Some(more) = failures.may_speak() {
                    warn!(%error, more, "cannot accept a connection");
                }
                // Out of files, most likely: some must be closed before it can go on.
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        let (tls, through) = (tls.clone(), through.clone());
        let (places, failures) = (Arc::clone(&places), Arc::clone(&failures));
        opening.spawn(async move {
            let opened = match tokio::time::timeout(GREETING, greet(stream, tls)).await {
                Ok(opened) => opened,
                Err(_) => Err(io::Error::new(io::ErrorKind::TimedOut, "says nothing")),
            };
            drop(greeting);
            let reason = match opened {
                Ok((stream, wants_encryption)) => match places.try_acquire_owned() {
                    Ok(place) => {
                        let peer = Peer {
                            address,
                            wants_encryption,
                            welcome: Arc::new(AtomicBool::new(false)),
                        };
                        // Nobody takes it when the server is about to end.
                        let _ = through.send(Ok(Connection::new(stream, peer, place))).await;
                        return;
                    }
                    Err(_) => "there are too many connections".to_owned(),
                },
                Err(error) => error.to_string(),
            };
            if let Some(more) = failures.may_speak() {
                warn!(peer = %address, %reason, more, "dropped a connection");
            }
        });
    }
}

/// Finds out what a caller speaks. Returns the connection just behind the opening bytes of HTTP/2,
/// and whether it is an open one where it ought to be encrypted: such a caller gets through to be
/// told so in its own language, and no further.
async fn greet(stream: TcpStream, tls: Option<TlsAcceptor>) -> io::Result<(Box<dyn Stream>, bool)> {
    stream.set_nodelay(true)?;
    let mut first = [0];
    if stream.peek(&mut first).await? == 0 {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    match tls {
        Some(acceptor) if first[0] == TLS_HANDSHAKE => {
            match acceptor.accept(stream).into_fallible().await {
                Ok(stream) => Ok((expect_preface(Box::new(stream)).await?, false)),
                Err((error, stream)) => {
                    linger(stream).await;
                    Err(error)
                }
            }
        }
        None if first[0] == TLS_HANDSHAKE => {
            turn_away(
                stream,
                "this port is not encrypted: use http://, not https://",
            )
            .await
        }
        tls => Ok((expect_preface(Box::new(stream)).await?, tls.is_some())),
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
            return turn_away(stream, why).await;
        }
    }
    Ok(stream)
}

/// Says in HTTP/1.1, which people's tools understand, why nothing comes of it.
async fn turn_away<T>(mut stream: impl Stream, why: &'static str) -> io::Result<T> {
    let answer = format!(
        "HTTP/1.1 400 Bad Request\r\nContent-Type: text/plain\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n{why}\n",
        why.len() + 1
    );
    stream.write_all(answer.as_bytes()).await?;
    linger(stream).await;
    Err(io::Error::new(io::ErrorKind::InvalidData, why))
}

/// Closes a connection so that what was said last arrives: closing with unread bytes would reset it.
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
    // Whether it arrives is the caller's concern now.
    let _ = tokio::time::timeout(Duration::from_secs(1), closing).await;
}

/// What the services know about the other end of a connection.
#[derive(Debug, Clone)]
pub struct Peer {
    /// Its address.
    pub address: SocketAddr,
    /// Whether the connection is open, and must not be.
    pub wants_encryption: bool,
    welcome: Arc<AtomicBool>,
}

impl Peer {
    /// Lets the connection live for as long as it wants.
    pub fn welcome(&self) {
        self.welcome.store(true, Ordering::Relaxed);
    }
}

/// A connection that got through.
struct Connection {
    stream: Box<dyn Stream>,
    /// How many of the opening bytes the HTTP/2 server has not been given yet.
    preface: &'static [u8],
    peer: Peer,
    probation: Option<Pin<Box<Sleep>>>,
    /// One of [`CONNECTIONS`], given back when this is dropped.
    _place: OwnedSemaphorePermit,
}

impl Connection {
    fn new(stream: Box<dyn Stream>, peer: Peer, place: OwnedSemaphorePermit) -> Self {
        Self {
            stream,
            preface: PREFACE,
            peer,
            probation: Some(Box::pin(tokio::time::sleep(PROBATION))),
            _place: place,
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
        if self.peer.welcome.load(Ordering::Relaxed) {
            self.probation = None;
        }
        if let Some(probation) = &mut self.probation
            && probation.as_mut().poll(cx).is_ready()
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

/// Keeps strangers from filling the log: one line a second, which counts what it leaves out.
#[derive(Debug, Default)]
pub struct Sparing {
    last: Mutex<Option<Instant>>,
    held_back: AtomicU64,
}

impl Sparing {
    /// Whether to say something now, and if so, how many times nothing was said since the last time.
    pub fn may_speak(&self) -> Option<u64> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_some_and(|last| last.elapsed() < Duration::from_secs(1)) {
            self.held_back.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        *last = Some(Instant::now());
        Some(self.held_back.swap(0, Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests;
