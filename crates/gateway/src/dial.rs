//! How a connection to a coordinator is opened: over TCP by default.

use std::fmt;
use std::io;
use std::pin::Pin;
use std::sync::Arc;

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;

/// A bidirectional byte stream.
pub trait Stream: AsyncRead + AsyncWrite + Send + Unpin + 'static {}

impl<S: AsyncRead + AsyncWrite + Send + Unpin + 'static> Stream for S {}

type Dialling = Pin<Box<dyn Future<Output = io::Result<Box<dyn Stream>>> + Send>>;

/// A function that opens a connection to a host and a port.
#[derive(Clone)]
pub struct Dial(Arc<dyn Fn(String, u16) -> Dialling + Send + Sync>);

impl fmt::Debug for Dial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Dial(..)")
    }
}

impl Default for Dial {
    fn default() -> Self {
        Self::new(|host, port| async move {
            let stream = TcpStream::connect((host, port)).await?;
            stream.set_nodelay(true)?;
            Ok(stream)
        })
    }
}

impl Dial {
    /// Makes a [`Dial`] of a function, for example one that dials in a simulated network.
    pub fn new<D, F, S>(dial: D) -> Self
    where
        D: Fn(String, u16) -> F + Send + Sync + 'static,
        F: Future<Output = io::Result<S>> + Send + 'static,
        S: Stream,
    {
        Self(Arc::new(move |host, port| {
            let dialling = dial(host, port);
            Box::pin(async move { Ok(Box::new(dialling.await?) as Box<dyn Stream>) })
        }))
    }

    /// Opens a connection.
    pub(crate) fn open(&self, host: String, port: u16) -> Dialling {
        (self.0)(host, port)
    }
}
