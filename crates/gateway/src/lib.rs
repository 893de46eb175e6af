//! Access to a coordinator, from both sides.
//!
//! The coordinator's side:
//!
//! - [`port`] accepts connections and serves the calls; `admission` limits the number of
//!   connections with and without a token; [`methods`] lists the token that each call requires;
//! - [`guard`] is the protection of the port, TLS and tokens, from an [access file](access) or from
//!   files made by [`keygen`].
//!
//! The side of workers and commands:
//!
//! - [`client`] reads the command-line options and finds the access file; [`link`] opens
//!   connections and interprets failed calls; [`Dial`] replaces TCP by another kind of connection,
//!   and `tls` encrypts it.
//!
//! Both sides read secrets with [`files`] and compare them with `token`.

#![expect(
    clippy::disallowed_methods,
    reason = "certificates are dated, calls are timed, and access files are found through the environment"
)]

pub mod access;
mod admission;
pub mod client;
mod dial;
mod error;
pub mod files;
pub mod guard;
pub mod keygen;
pub mod link;
pub mod methods;
pub mod port;
mod sparing;
mod tls;
mod token;

pub use dial::{Dial, Stream};
pub use error::Error;
pub use link::Link;
pub use tls::TlsFault;
pub use token::{Role, TOKEN_BYTES, TOKEN_HEADER, Token, TokenError, TokenSet};
