//! A whole campaign: store, server, engine, report.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use campaign::formulation::Problem;
use campaign::{Campaign, probe};
use results::reporting;
use results::status::Status;
use stages::derived::DERIVED_APPROACHES;
use store::{CampaignRow, Store};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::board::{Board, Course};
use crate::engine::{Ended, Engine};
use crate::leases;
use crate::local::LocalWorkers;
use crate::recorder::{Recorder as _, StoreRecorder};
use crate::service::Service;
use crate::serving::{Error, OpenPort, Port, Serving, farewell, listen};

/// How long a worker may be silent before others get what it holds, unless somebody says otherwise.
pub const LEASE: Duration = Duration::from_secs(30);
/// How long after a restart nothing is leased, so that workers can say what they hold: as long as it
/// takes those that a short absence has not made patient.
const GRACE: Duration = Duration::from_millis(500);

/// How long open pages may take to fetch the last numbers when a coordinator ends.
const PAGE_ENDS: Duration = Duration::from_secs(2);

/// How often an observer sees the status.
const OBSERVING_PERIOD: Duration = Duration::from_millis(500);

/// What to run.
#[derive(Debug)]
pub struct Plan {
    /// The campaign.
    pub campaign: Campaign,
    /// Its file's text.
    pub file_text: String,
    /// The store's file.
    pub db: PathBuf,
    /// Where the report goes.
    pub out: PathBuf,
    /// Workers of this process; there may be none.
    pub workers: LocalWorkers,
    /// Where others connect, if anywhere.
    pub port: Option<Port>,
    /// Whether to stay up when the campaign is finished.
    pub keep_serving: bool,
    /// How long a worker may be silent before others get what it holds.
    pub lease: Duration,
    /// Where the live page is served, if anywhere.
    pub http: Option<SocketAddr>,
}

/// Sees how far a campaign is, twice a second.
pub type Observer = Box<dyn Fn(&Status) + Send>;

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// All stages are done and the report is written.
    Finished {
        /// What was quarantined.
        quarantined: Vec<String>,
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
    // The ports first: a taken one must not leave a store behind.
    let opened = match &plan.port {
        Some(port) => Some(OpenPort::new(port, &plan.campaign.name).await?),
        None => None,
    };
    let http = match plan.http {
        Some(address) => Some(listen("--http", address).await?),
        None => None,
    };
    let store = open_store(&problem, &plan.file_text, &plan.db).await?;
    let result = run_open(
        &plan,
        &problem,
        model_digest,
        &store,
        Ports { opened, http },
        observer,
        &shutdown,
    )
    .await;
    let closed = store.close().await;
    let outcome = result?;
    closed?;
    Ok(outcome)
}

/// Opens the store of a campaign, or makes it; one that the campaign [extends](Campaign::extends) grows.
///
/// # Errors
///
/// The store is of another campaign, or cannot be used.
pub async fn open_store(problem: &Problem, file_text: &str, db: &Path) -> Result<Store, Error> {
    let campaign = problem.campaign();
    let row = CampaignRow {
        name: campaign.name.clone(),
        file_text: file_text.to_owned(),
        digest: campaign.digest(),
        seed: campaign.seed,
        program_version: identity::BUILD.to_owned(),
        model_digest: None,
    };
    let store = Store::create_or_open_with(db, &row, |held| {
        // A campaign that is not of this version's form has no keys to compare.
        let held = Campaign::parse("the store's campaign file", &held.file_text)
            .map_err(|_| Vec::new())?;
        if campaign.extends(&held) {
            return Ok(());
        }
        Err(campaign.changes_from(&held))
    })
    .await?;
    if store.campaign().await?.digest != row.digest {
        // Refused before the store takes it: it would be stuck with designs that cannot be made.
        stages::designs::check_growth(problem, &store.designs().await?)?;
        info!("the campaign has grown: what the store holds is kept, the rest is added");
        store.extend(&row, &DERIVED_APPROACHES).await?;
    }
    Ok(store)
}

/// What is listened on.
struct Ports {
    opened: Option<OpenPort>,
    http: Option<TcpListener>,
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
    if let Some(digest) = &model_digest {
        store.pin_model_digest(digest).await?;
    }
    let options = ledger::Options {
        lease: plan.lease,
        long_samples: plan.campaign.is_external(),
        ..ledger::Options::default()
    };
    let board = Arc::new(Board::new(options, rand::random()));
    board.remember(store.job_histories().await?);
    // Workers that nobody can have started before need not be waited for.
    if plan.port.is_some() && store.progress().await?.designs > 0 {
        board.hold_back(GRACE);
    }
    let recorder = StoreRecorder::new(store)?;
    let service = Service {
        board: Arc::clone(&board),
        recorder: recorder.clone(),
        problem: Arc::clone(problem),
        model_digest: model_digest.clone(),
    };
    let mut serving = Serving::start(service, ports.opened, &plan.workers)?;
    let hang_up = serving.hang_up();
    info!(store = %plan.db.display(), campaign = %plan.campaign.name, "serving");
    console::service::ready();
    let page = match ports.http {
        Some(listener) => {
            let address = listener.local_addr().map_err(anyhow::Error::from)?;
            info!(url = %format!("http://{address}"), "live page");
            let board = Arc::clone(&board);
            let site = live::Site::new(store.clone(), Some(Box::new(move || board.live())));
            let page = live::serve(listener, site, hang_up.clone());
            Some(tokio::spawn(async move {
                if let Err(error) = page.await {
                    warn!(%error, "the live page has ended");
                }
            }))
        }
        None => None,
    };
    if let Some(observer) = observer {
        let (board, stop) = (Arc::clone(&board), hang_up.clone());
        tokio::spawn(stop.run_until_cancelled_owned(observe(observer, board, recorder.clone())));
    }

    let engine = Engine::new(
        Arc::clone(problem),
        model_digest.as_deref(),
        store.clone(),
        board,
    );
    let outcome = loop {
        let retries = engine.board.retries();
        let ended = tokio::select! {
            ended = engine.run(shutdown) => ended.map_err(Error::from),
            Err(failed) = leases::watch(&engine.board, &recorder) => Err(Error::Store(failed)),
            failed = serving.failed() => Err(Error::from(failed)),
            broken = recorder.broken() => Err(Error::Store(broken)),
            damaged = store.damaged() => Err(Error::Store(damaged)),
        };
        let quarantined = match ended {
            Ok(Some(Ended { quarantined })) => quarantined,
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
        let report = reporting::write(store, &plan.out, &crate::made::made())
            .await
            .map_err(Error::from)?;
        info!(report = %report.display(), "report written");
        if !engine.board.finish(retries) {
            continue;
        }
        farewell(&engine.board).await;
        if plan.keep_serving {
            info!("finished; serving on until a signal comes");
            tokio::select! {
                () = shutdown.cancelled() => {}
                () = engine.board.reopened() => continue,
                () = engine.board.drained() => {}
            }
        }
        break Ok(Outcome::Finished {
            quarantined,
            report,
        });
    };
    serving
        .end(matches!(outcome, Ok(Outcome::Finished { .. })))
        .await;
    if let Some(page) = page {
        // A browser that reads nothing does not keep a coordinator.
        let _ = tokio::time::timeout(PAGE_ENDS, page).await;
    }
    outcome
}

async fn observe(observer: Observer, board: Arc<Board>, recorder: StoreRecorder) {
    let mut period = tokio::time::interval(OBSERVING_PERIOD);
    loop {
        period.tick().await;
        if let Ok(Some(status)) = recorder.status().await {
            observer(&status.with(board.live()));
        }
    }
}
