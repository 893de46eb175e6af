//! A whole campaign: store, server, engine, report.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context as _;
use campaign::formulation::Problem;
use campaign::{Campaign, probe};
use protocol::v1::campaign_server::CampaignServer;
use protocol::{DESCRIPTORS, MAX_MESSAGE_BYTES};
use store::{CampaignRow, Store};
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use tokio_util::sync::CancellationToken;
use tonic::transport::Server;
use tracing::{info, warn};

use crate::board::Board;
use crate::engine::{Ended, Engine};
use crate::service::Service;
use crate::{local, reporting};

/// How long a worker may be silent before its jobs go to others.
const LEASE: Duration = Duration::from_secs(5);
/// How long workers get to hear that the campaign is finished.
const FAREWELL: Duration = Duration::from_secs(3);

/// Who computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Workers {
    /// This many workers in the coordinator's process.
    Local(usize),
    /// Workers that connect from outside.
    Remote {
        /// Whether to stay up when the campaign is finished.
        keep_serving: bool,
    },
}

/// What to run.
#[derive(Debug)]
pub struct Plan {
    /// The campaign.
    pub campaign: Campaign,
    /// Its file's text.
    pub file_text: String,
    /// The store's file.
    pub db: PathBuf,
    /// The address to listen on.
    pub listen: SocketAddr,
    /// Where the report goes.
    pub out: PathBuf,
    /// Who computes.
    pub workers: Workers,
}

/// Why a campaign could not be run.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The store refused.
    #[error(transparent)]
    Store(#[from] store::Error),
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: choose another --listen address, or stop what uses it")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the system said.
        source: std::io::Error,
    },
    /// Anything else.
    #[error("{0:#}")]
    Other(#[from] anyhow::Error),
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// All stages are done and the report is written.
    Finished {
        /// Jobs that were given up.
        given_up: Vec<String>,
        /// The report.
        report: PathBuf,
    },
    /// A signal came first.
    Interrupted,
}

/// Runs a campaign to its end, or until `shutdown`.
///
/// # Errors
///
/// The store, the address or a stage.
pub async fn run(plan: Plan, shutdown: CancellationToken) -> Result<Outcome, Error> {
    for warning in plan.campaign.warnings() {
        warn!("{warning}");
    }
    let problem = Arc::new(Problem::new(plan.campaign.clone()));
    let model_digest = probe::model_digest(&problem);
    let row = CampaignRow {
        name: plan.campaign.name.clone(),
        file_text: plan.file_text.clone(),
        digest: plan.campaign.digest(),
        seed: plan.campaign.seed,
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        model_digest: None,
    };
    // The port first: a taken one must not leave a store behind.
    let listener = TcpListener::bind(plan.listen)
        .await
        .map_err(|source| Error::Listen {
            address: plan.listen,
            source,
        })?;
    let address = listener.local_addr().map_err(|source| Error::Listen {
        address: plan.listen,
        source,
    })?;
    let store = Store::create_or_open(&plan.db, &row).await?;
    let result = run_open(
        &plan,
        &problem,
        model_digest,
        &store,
        listener,
        address,
        &shutdown,
    )
    .await;
    store.close().await?;
    result
}

async fn run_open(
    plan: &Plan,
    problem: &Arc<Problem>,
    model_digest: String,
    store: &Store,
    listener: TcpListener,
    address: SocketAddr,
    shutdown: &CancellationToken,
) -> Result<Outcome, Error> {
    store.pin_model_digest(&model_digest).await?;
    let writer = store.writer()?;
    let options = scheduler::Options {
        lease: LEASE,
        ..scheduler::Options::default()
    };
    let board = Arc::new(Board::new(options, rand::random()));
    let service = Service {
        board: Arc::clone(&board),
        writer: writer.clone(),
        store: store.clone(),
        campaign_json: plan.campaign.to_json(),
        model_digest,
        lease: LEASE,
    };
    let hang_up = CancellationToken::new();
    let server = tokio::spawn(serve(service, listener, hang_up.clone()));
    info!(%address, store = %plan.db.display(), campaign = %plan.campaign.name, "serving");

    let stop_workers = CancellationToken::new();
    let mut local_workers = match plan.workers {
        Workers::Local(count) => local::spawn_workers(address, count, &stop_workers),
        Workers::Remote { .. } => tokio::task::JoinSet::new(),
    };
    let engine = Engine {
        problem: Arc::clone(problem),
        store: store.clone(),
        writer,
        board,
    };
    let ended = tokio::select! {
        ended = engine.run(shutdown) => ended.map_err(Error::from),
        failed = engine.watch_leases() => Err(Error::from(
            failed.err().unwrap_or_else(|| anyhow::anyhow!("the lease watch ended")),
        )),
        failed = first_failure(&mut local_workers), if !local_workers.is_empty() => {
            Err(Error::from(failed))
        }
    };
    let outcome = match ended {
        Ok(Some(Ended { given_up })) => {
            let report = reporting::write(store, &plan.out)
                .await
                .map_err(Error::from)?;
            info!(report = %report.display(), "report written");
            engine.board.finish();
            farewell(&engine.board).await;
            if plan.workers == (Workers::Remote { keep_serving: true }) {
                info!("finished; serving on until a signal comes");
                shutdown.cancelled().await;
            }
            Ok(Outcome::Finished { given_up, report })
        }
        Ok(None) => Ok(Outcome::Interrupted),
        Err(error) => Err(error),
    };
    stop_workers.cancel();
    let finish_workers = async { while local_workers.join_next().await.is_some() {} };
    if tokio::time::timeout(Duration::from_secs(15), finish_workers)
        .await
        .is_err()
    {
        warn!("workers of this process did not end in time");
    }
    hang_up.cancel();
    // Connections that linger are cut: their workers know how to cope.
    let _ = tokio::time::timeout(Duration::from_secs(2), server).await;
    outcome
}

/// The first failure of a local worker; never when they all end well.
async fn first_failure(
    workers: &mut tokio::task::JoinSet<Result<worker::Summary, worker::Error>>,
) -> anyhow::Error {
    while let Some(ended) = workers.join_next().await {
        match ended {
            Ok(Ok(_)) => {}
            Ok(Err(error)) => {
                return anyhow::Error::from(error).context("a worker of this process");
            }
            Err(panic) => return anyhow::Error::from(panic).context("a worker of this process"),
        }
    }
    std::future::pending().await
}

/// Waits until the workers know that the campaign is finished, so that they leave by themselves.
async fn farewell(board: &Board) {
    let deadline = tokio::time::Instant::now() + FAREWELL;
    while !board.all_told(LEASE) && tokio::time::Instant::now() < deadline {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

async fn serve(
    service: Service,
    listener: TcpListener,
    hang_up: CancellationToken,
) -> anyhow::Result<()> {
    let (health_reporter, health) = tonic_health::server::health_reporter();
    health_reporter
        .set_serving::<CampaignServer<Service>>()
        .await;
    let reflection = tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(DESCRIPTORS)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
        .build_v1()
        .context("the reflection service")?;
    let campaign = CampaignServer::new(service)
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    Server::builder()
        .tcp_nodelay(true)
        .http2_keepalive_interval(Some(Duration::from_secs(10)))
        .add_service(health)
        .add_service(reflection)
        .add_service(campaign)
        .serve_with_incoming_shutdown(TcpListenerStream::new(listener), hang_up.cancelled_owned())
        .await
        .context("the server")
}
