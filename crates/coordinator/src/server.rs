//! A whole campaign: store, server, engine, report.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use campaign::formulation::Problem;
use campaign::{Campaign, probe};
use store::{CampaignRow, Store};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::board::{Board, Course};
use crate::engine::{Ended, Engine, SAMPLED_APPROACHES};
use crate::guard::Guard;
use crate::listening;
use crate::service::{Recorder as _, Service, StoreRecorder};
use crate::status::Status;
use crate::{local, metrics, reporting};

/// How long a worker may be silent before others get what it holds, unless somebody says otherwise.
pub const LEASE: Duration = Duration::from_secs(30);
/// How long after a restart nothing is leased, so that workers can say what they hold: as long as it
/// takes those that a short absence has not made patient.
const GRACE: Duration = Duration::from_millis(500);
/// How long workers get to hear that the campaign is finished.
const FAREWELL: Duration = Duration::from_secs(3);

/// How often an observer sees the status.
const OBSERVING_PERIOD: Duration = Duration::from_millis(500);

/// Who computes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Workers {
    /// Workers in the coordinator's process.
    Local {
        /// How many.
        count: usize,
        /// The external simulator that they run, for a campaign that asks for one.
        exec: Option<worker::Exec>,
    },
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
    /// What guards that address.
    pub guard: Guard,
    /// Where the report goes.
    pub out: PathBuf,
    /// Who computes.
    pub workers: Workers,
    /// How long a worker may be silent before others get what it holds.
    pub lease: Duration,
    /// Where metrics are served, if anywhere.
    pub metrics: Option<SocketAddr>,
}

/// Sees how far a campaign is, twice a second.
pub type Observer = Box<dyn Fn(&Status) + Send>;

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
    #[error(transparent)]
    Other(#[from] anyhow::Error),
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// All stages are done and the report is written.
    Finished {
        /// What was given up.
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
pub async fn run(
    plan: Plan,
    observer: Option<Observer>,
    shutdown: CancellationToken,
) -> Result<Outcome, Error> {
    for warning in plan.campaign.warnings() {
        warn!("{warning}");
    }
    let problem = Arc::new(Problem::new(plan.campaign.clone()));
    // An external simulator is asked by workers alone: the first of them decides.
    let model_digest = (!plan.campaign.is_external()).then(|| probe::model_digest(&problem));
    let row = CampaignRow {
        name: plan.campaign.name.clone(),
        file_text: plan.file_text.clone(),
        digest: plan.campaign.digest(),
        seed: plan.campaign.seed,
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        model_digest: None,
    };
    // The ports first: a taken one must not leave a store behind.
    let listener = listen(plan.listen).await?;
    let metrics = match plan.metrics {
        Some(address) => Some(listen(address).await?),
        None => None,
    };
    let address = listener.local_addr().map_err(|source| Error::Listen {
        address: plan.listen,
        source,
    })?;
    let store = Store::create_or_open_with(&plan.db, &row, |held| {
        Campaign::parse("the store's campaign file", &held.file_text)
            .is_ok_and(|held| plan.campaign.extends(&held))
    })
    .await?;
    if store.campaign().await?.digest != row.digest {
        // Refused before the store takes it: it would be stuck with designs that cannot be made.
        crate::steps::check_growth(&problem, &store.designs().await?)?;
        info!("the campaign has grown: what the store holds is kept, the rest is added");
        store.extend(&row, &SAMPLED_APPROACHES).await?;
    }
    let result = run_open(
        &plan,
        &problem,
        model_digest,
        &store,
        Ports {
            listener,
            address,
            metrics,
        },
        observer,
        &shutdown,
    )
    .await;
    let closed = store.close().await;
    let outcome = result?;
    closed?;
    Ok(outcome)
}

async fn listen(address: SocketAddr) -> Result<TcpListener, Error> {
    TcpListener::bind(address)
        .await
        .map_err(|source| Error::Listen { address, source })
}

/// What is listened on.
struct Ports {
    listener: TcpListener,
    address: SocketAddr,
    metrics: Option<TcpListener>,
}

async fn run_open(
    plan: &Plan,
    problem: &Arc<Problem>,
    model_digest: Option<String>,
    store: &Store,
    ports: Ports,
    observer: Option<Observer>,
    shutdown: &CancellationToken,
) -> Result<Outcome, Error> {
    let Ports {
        listener,
        address,
        metrics,
    } = ports;
    if let Some(digest) = &model_digest {
        store.pin_model_digest(digest).await?;
    }
    let writer = store.writer()?;
    let options = ledger::Options {
        lease: plan.lease,
        long_samples: plan.campaign.is_external(),
        ..ledger::Options::default()
    };
    let board = Arc::new(Board::new(options, rand::random()));
    board.remember(store.job_histories().await?);
    // Workers that nobody can have started before need not be waited for.
    let is_remote = matches!(plan.workers, Workers::Remote { .. });
    if is_remote && store.progress().await?.designs > 0 {
        board.hold_back(GRACE);
    }
    let recorder = StoreRecorder::new(store)?;
    let service = Service {
        board: Arc::clone(&board),
        recorder: recorder.clone(),
        campaign_json: plan.campaign.to_json(),
        model_digest: model_digest.clone(),
    };
    let hang_up = CancellationToken::new();
    let server = tokio::spawn(listening::serve(
        service,
        listener,
        plan.guard.clone(),
        hang_up.clone(),
    ));
    info!(%address, store = %plan.db.display(), campaign = %plan.campaign.name, "serving");

    if let Some(listener) = metrics {
        let (board, recorder) = (Arc::clone(&board), recorder.clone());
        tokio::spawn(metrics::serve(listener, board, recorder, hang_up.clone()));
    }
    if let Some(observer) = observer {
        let (board, stop) = (Arc::clone(&board), hang_up.clone());
        tokio::spawn(stop.run_until_cancelled_owned(observe(observer, board, recorder.clone())));
    }

    let stop_workers = CancellationToken::new();
    let mut local_workers = match &plan.workers {
        Workers::Local { count, exec } => {
            local::spawn_workers(address, *count, exec.as_ref(), &stop_workers)
        }
        Workers::Remote { .. } => tokio::task::JoinSet::new(),
    };
    let engine = Engine::new(
        Arc::clone(problem),
        model_digest.as_deref(),
        store.clone(),
        writer,
        board,
    );
    let outcome = loop {
        let ended = tokio::select! {
            ended = engine.run(shutdown) => ended.map_err(Error::from),
            failed = engine.watch_leases() => Err(Error::from(
                failed.err().unwrap_or_else(|| anyhow::anyhow!("the lease watch ended")),
            )),
            failed = first_failure(&mut local_workers), if !local_workers.is_empty() => {
                Err(Error::from(failed))
            }
            broken = recorder.broken() => Err(Error::Store(broken)),
            damaged = damage(store) => Err(Error::Store(damaged)),
        };
        let given_up = match ended {
            Ok(Some(Ended { given_up })) => given_up,
            Ok(None) => {
                if engine.board.is_drained() {
                    // Nobody will lease anything any more. After a signal a coordinator may be
                    // back in a moment, and workers wait for it.
                    engine.board.set_course(Course::Leave);
                    farewell(&engine.board).await;
                }
                break Ok(Outcome::Interrupted);
            }
            Err(error) => break Err(error),
        };
        // Nothing is called finished of which the check of a large file is still to tell.
        if let Err(damaged) = store.checked().await {
            break Err(Error::Store(damaged));
        }
        let report = reporting::write(store, &plan.out)
            .await
            .map_err(Error::from)?;
        info!(report = %report.display(), "report written");
        engine.board.set_course(Course::Finished);
        farewell(&engine.board).await;
        if plan.workers == (Workers::Remote { keep_serving: true }) {
            info!("finished; serving on until a signal comes");
            tokio::select! {
                () = shutdown.cancelled() => {}
                () = engine.board.reopened() => continue,
                () = engine.board.drained() => {}
            }
        }
        break Ok(Outcome::Finished { given_up, report });
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

/// Ends with what a check of the store's file finds; never when it is sound.
async fn damage(store: &Store) -> store::Error {
    match store.checked().await {
        Ok(()) => std::future::pending().await,
        Err(error) => error,
    }
}

async fn observe(observer: Observer, board: Arc<Board>, recorder: StoreRecorder) {
    let mut period = tokio::time::interval(OBSERVING_PERIOD);
    loop {
        period.tick().await;
        if let Ok(status) = recorder.status().await {
            observer(&status.with(board.live()));
        }
    }
}

/// Waits until the workers know that they are to leave.
async fn farewell(board: &Board) {
    let deadline = tokio::time::Instant::now() + FAREWELL;
    while !board.all_dismissed() && tokio::time::Instant::now() < deadline {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
