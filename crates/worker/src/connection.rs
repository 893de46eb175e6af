//! Calls to the coordinator, and what their failures mean.

use std::time::Duration;

use protocol::v1::campaign_client::CampaignClient;
use protocol::v1::{RegisterRequest, RegisterResponse};
use protocol::{MAX_MESSAGE_BYTES, Refusal};
use tonic::Status;
use tonic::transport::{Channel, Endpoint};

/// Why a worker ended without having been told to.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The address is no URL of a coordinator.
    #[error("{url:?} is no address of a coordinator: give one such as http://127.0.0.1:7400")]
    Address {
        /// What was given.
        url: String,
    },
    /// No coordinator ever answered.
    #[error(
        "no coordinator answers at {url} ({reason}): is `coordinator serve` running, and does it \
         listen on that address?"
    )]
    Unreachable {
        /// The address.
        url: String,
        /// What the last attempt met.
        reason: String,
    },
    /// The coordinator answered before, but has been away for too long.
    #[error("the coordinator at {url} has been away for {seconds} s; giving up")]
    Away {
        /// The address.
        url: String,
        /// For how long.
        seconds: u64,
    },
    /// The coordinator refused this worker for good.
    #[error("the coordinator at {url} refused this worker: {message}")]
    Refused {
        /// The address.
        url: String,
        /// The kind of refusal.
        refusal: Refusal,
        /// The coordinator's sentence.
        message: String,
    },
    /// The coordinator speaks the protocol but says things that make no sense.
    #[error("the coordinator at {url} answered with nonsense: {reason}")]
    Nonsense {
        /// The address.
        url: String,
        /// What was wrong.
        reason: String,
    },
    /// The compute threads cannot be started.
    #[error("cannot start {slots} compute threads: {reason}")]
    Threads {
        /// How many were asked for.
        slots: usize,
        /// What the system said.
        reason: String,
    },
}

/// A lazily connected client: a call connects when it must.
#[derive(Debug, Clone)]
pub(crate) struct Connection {
    pub(crate) url: String,
    pub(crate) client: CampaignClient<Channel>,
}

impl Connection {
    pub(crate) fn new(url: &str) -> Result<Self, Error> {
        let address = || Error::Address {
            url: url.to_owned(),
        };
        let endpoint = Endpoint::from_shared(url.to_owned()).map_err(|_| address())?;
        if endpoint.uri().scheme_str() != Some("http") || endpoint.uri().authority().is_none() {
            return Err(address());
        }
        let channel = endpoint
            .connect_timeout(Duration::from_secs(3))
            .http2_keep_alive_interval(Duration::from_secs(10))
            .keep_alive_timeout(Duration::from_secs(10))
            .tcp_nodelay(true)
            .connect_lazy();
        let client = CampaignClient::new(channel)
            .max_decoding_message_size(MAX_MESSAGE_BYTES)
            .max_encoding_message_size(MAX_MESSAGE_BYTES);
        Ok(Self {
            url: url.to_owned(),
            client,
        })
    }

    /// Registers once. `Ok(Err(_))` is a failure that may pass.
    pub(crate) async fn register(
        &self,
        request: RegisterRequest,
    ) -> Result<Result<RegisterResponse, Status>, Error> {
        match self.client.clone().register(request).await {
            Ok(response) => Ok(Ok(response.into_inner())),
            Err(status) => match Refusal::of(&status) {
                Some(refusal) => Err(Error::Refused {
                    url: self.url.clone(),
                    refusal,
                    message: status.message().to_owned(),
                }),
                None => Ok(Err(status)),
            },
        }
    }
}

/// The innermost cause of a failed call, which is what a user can act on.
pub(crate) fn cause(status: &Status) -> String {
    let mut innermost: &dyn std::error::Error = status;
    let mut message = status.message().to_owned();
    while let Some(source) = innermost.source() {
        innermost = source;
        message = innermost.to_string();
    }
    message
}
