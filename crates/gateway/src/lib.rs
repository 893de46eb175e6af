//! The way into a coordinator, from both sides.
//!
//! The coordinator's side:
//!
//! - [`port`] accepts connections and serves the calls; `admission` counts connections, those that
//!   have shown a token and those that have not; [`methods`] says which token each call takes;
//! - [`guard`] is what the port checks: TLS and tokens, from an [access file](access) or from files
//!   that [`keygen`] made.
//!
//! The side of workers and commands:
//!
//! - [`client`] reads the command line's options and finds the access file; [`link`] opens
//!   connections and says what a failed call means; [`Dial`] replaces TCP by another kind of
//!   connection, and `tls` encrypts it.
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
