//! Connections to a coordinator, for workers and for commands.
//!
//! A [`Link`] dials when it is first used and again whenever the connection is lost. A program
//! makes calls through [`Link::client`], and [`Link::error`] (or [`Link::refusal`], for programs
//! that try again) interprets a failed call:
//!
//! ```no_run
//! # async fn status(connect: runner::gateway::client::ConnectArguments) -> Result<String, runner::gateway::Error> {
//! let link = connect.link(runner::gateway::Role::Client)?;
//! let answer = link.client().status(runner::protocol::v1::StatusRequest {}).await;
//! Ok(answer.map_err(|status| link.error(&status))?.into_inner().status_json)
//! # }
//! ```

mod route;

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use crate::protocol::v1::campaign_client::CampaignClient;
use crate::protocol::{MAX_MESSAGE_BYTES, Refusal};
use tonic::codegen::http::Uri;
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Request, Status};

use crate::gateway::address::Address;
use crate::gateway::dial::Dial;
use crate::gateway::error::Error;
use crate::gateway::tls::TlsFault;
use crate::gateway::token::{Role, TOKEN_HEADER};

use route::{AccessRoute, Connector, Route};

/// The channel of a link, which adds the token to every call.
pub type LinkChannel = InterceptedService<Channel, Bearer>;

/// A client of the campaign service.
pub type Client = CampaignClient<LinkChannel>;

/// An interceptor that adds the token, if there is one, to every call.
#[derive(Clone)]
pub struct Bearer(Arc<Route>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(token) = self.0.token() {
            request.metadata_mut().insert(TOKEN_HEADER, token);
        }
        Ok(request)
    }
}

/// A connection to a coordinator that is opened on demand.
#[derive(Clone)]
pub struct Link {
    channel: LinkChannel,
    route: Arc<Route>,
}

impl std::fmt::Debug for Link {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Link").field(&self.address()).finish()
    }
}

impl Link {
    /// Makes a link to the coordinator of the access file at `path`, which is read again for every
    /// new connection. `connect` replaces the addresses in the file.
    ///
    /// Nothing is sent yet. Must be called within a Tokio runtime.
    pub(crate) fn new(path: PathBuf, connect: Option<Address>, role: Role) -> Result<Self, Error> {
        let route = AccessRoute::new(path, connect, role)?;
        Ok(Self::along(Route::Access(route)))
    }

    /// Makes a link over connections of `dial`, without TLS and token: the other end admits this
    /// process. Must be called within a Tokio runtime.
    #[must_use]
    pub fn local(dial: Dial) -> Self {
        Self::along(Route::Local(dial))
    }

    fn along(route: Route) -> Self {
        let route = Arc::new(route);
        // The connector chooses the address to dial; this one only names the channel.
        let channel = Endpoint::from(Uri::from_static("https://pitchline"))
            .http2_keep_alive_interval(Duration::from_secs(10))
            // Results may occupy the connection for longer than a ping usually takes.
            .keep_alive_timeout(Duration::from_secs(30))
            .connect_with_connector_lazy(Connector(Arc::clone(&route)));
        let channel = InterceptedService::new(channel, Bearer(Arc::clone(&route)));
        Self { channel, route }
    }

    /// The coordinator's address, the first of several; "this process" for a local link.
    #[must_use]
    pub fn address(&self) -> String {
        self.route.address()
    }

    /// Whether the last attempt to connect found neither an access file nor a program that listens, as after the
    /// end of a campaign.
    #[must_use]
    pub fn is_abandoned(&self) -> bool {
        self.route.is_abandoned()
    }

    /// The channel, for clients of other services than the campaign's.
    #[must_use]
    pub fn channel(&self) -> LinkChannel {
        self.channel.clone()
    }

    /// A client for making calls. Clones share the connection.
    #[must_use]
    pub fn client(&self) -> Client {
        CampaignClient::new(self.channel())
            .max_decoding_message_size(MAX_MESSAGE_BYTES)
            .max_encoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The error of a failed call if it is final, that is if no further attempt can succeed: the
    /// coordinator refused the call, or one side does not trust the other.
    ///
    /// A restarted coordinator may have written new secrets to its access file since the call
    /// began. An unknown token or certificate is therefore final only if a second attempt with the
    /// same secrets fails in the same way.
    #[must_use]
    pub fn refusal(&self, status: &Status) -> Option<Error> {
        let error = self.refusal_of_this_call(status)?;
        let is_final = !error.is_about_secrets() || self.route.is_refused_again();
        is_final.then_some(error)
    }

    fn refusal_of_this_call(&self, status: &Status) -> Option<Error> {
        if let Some(refusal) = Refusal::of(status) {
            return Some(Error::Refused {
                address: self.address(),
                refusal,
                message: status.message().to_owned(),
            });
        }
        let fault = causes(status)
            .filter_map(|cause| cause.downcast_ref::<io::Error>())
            .find_map(TlsFault::of)?;
        Some(Error::Tls {
            address: self.address(),
            fault,
        })
    }

    /// The error of a failed call, for a program that does not try again.
    #[must_use]
    pub fn error(&self, status: &Status) -> Error {
        self.refusal_of_this_call(status).unwrap_or_else(|| {
            let address = self.address();
            let reason = cause(status);
            match status.code() {
                Code::Unavailable | Code::Cancelled | Code::DeadlineExceeded | Code::Unknown => {
                    Error::Unreachable { address, reason }
                }
                _ => Error::Failed { address, reason },
            }
        })
    }
}

/// The causes of a failed call, from the outermost.
fn causes(status: &Status) -> impl Iterator<Item = &(dyn std::error::Error + 'static)> {
    std::iter::successors(std::error::Error::source(status), |cause| cause.source())
}

/// The innermost cause of a failed call: the part that a user can act on.
#[must_use]
pub fn cause(status: &Status) -> String {
    causes(status)
        .last()
        .map_or_else(|| status.message().to_owned(), ToString::to_string)
}
