//! Access to a coordinator, from both sides.
//!
//! The coordinator's side:
//!
//! - [`port`] accepts connections and serves the calls; `admission` limits the number of
//!   connections with and without a token; `methods` lists the token that each call requires;
//! - [`access::Issuer`] makes the coordinator's certificate and tokens and writes them to its
//!   access file; [`Guard`] checks callers against them.
//!
//! The side of workers and commands:
//!
//! - [`client`] has the command-line options and finds the access file, [`access`] reads it;
//! - [`link`] opens connections and interprets failed calls; [`Dial`] replaces TCP by connections
//!   within the process.
//!
//! Both sides use the TLS of `tls`, the tokens of `token` and the addresses of [`address`].

#![expect(
    clippy::disallowed_methods,
    reason = "certificates are dated, calls are timed, and access files are found through the environment"
)]

pub mod access;
pub mod address;
mod admission;
pub mod client;
mod dial;
mod error;
mod guard;
pub mod link;
mod log_limit;
mod methods;
pub mod port;
mod secret_file;
mod tls;
mod token;

pub use address::Address;
pub(crate) use admission::Peer;
pub use dial::{Dial, Stream};
pub use error::Error;
pub use guard::Guard;
pub use link::Link;
pub use tls::TlsFault;
pub use token::Role;
