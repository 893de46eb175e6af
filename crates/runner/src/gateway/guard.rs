//! The protection of a port.

use std::fmt;

use tokio_rustls::TlsAcceptor;

use crate::gateway::token::TokenSet;

/// The TLS and the tokens that protect a port.
#[derive(Clone)]
pub struct Guard {
    pub(crate) tls: TlsAcceptor,
    pub(crate) tokens: TokenSet,
}

impl fmt::Debug for Guard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Guard")
            .field("tokens", &self.tokens)
            .finish_non_exhaustive()
    }
}
