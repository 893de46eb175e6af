//! A whole campaign: store, server, engine, report.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use problem::file::Budget;
use problem::formulation::Problem;
use problem::{Campaign, probe};
use results::report;
use results::status::Status;
use store::{CampaignRow, Store};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::coordinator::board::{self, Board, Course};
use crate::coordinator::budget::{self, ExceededBudget};
use crate::coordinator::engine::{CampaignEnd, Engine};
use crate::coordinator::leases;
use crate::coordinator::local::LocalWorkers;
use crate::coordinator::recorder::{Recorder as _, StoreRecorder};
use crate::coordinator::service::Service;
use crate::coordinator::serving::{OpenPort, Port, RunningServer, farewell, listen};
use crate::exit::ProgramError;

/// Default duration of a lease.
pub const LEASE: Duration = Duration::from_secs(30);
/// Time after a restart without leasing, so that workers can report the leases that they hold. It
/// is long enough for workers whose reconnection interval has not grown yet.
const GRACE: Duration = Duration::from_millis(500);

/// Time for open pages to fetch the last numbers when a coordinator ends.
const PAGE_ENDS: Duration = Duration::from_secs(5);

/// Interval at which an observer receives the status.
const OBSERVING_PERIOD: Duration = Duration::from_millis(500);

/// The settings of a run.
#[derive(Debug)]
pub struct Plan {
    pub campaign: Campaign,
    /// The text of the campaign file.
    pub file_text: String,
    /// The store's file.
    pub db: PathBuf,
    /// The folder of the report.
    pub out: PathBuf,
    /// Refuses the folder of the report, before the report is written, if another campaign has put its own
    /// there since this one began.
    pub check_out: fn(&Self) -> Result<(), ProgramError>,
    /// The workers of this process; may be empty.
    pub workers: LocalWorkers,
    /// The port for other processes, if any.
    pub port: Option<Port>,
    /// Whether to keep serving when the campaign is finished.
    pub keep_serving: bool,
    /// Whether results that stand for failures are computed again.
    pub retry_failed: bool,
    pub lease: Duration,
    /// The address of the live page, if any.
    pub http: Option<SocketAddr>,
}

/// Receives the status of a campaign twice a second.
pub type Observer = Box<dyn Fn(&Status) + Send>;

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// All stages are done and the report is written.
    Finished {
        /// The names of the quarantined streams.
        quarantined: Vec<String>,
        report: PathBuf,
    },
    /// A signal or a drain came first.
    Interrupted,
}

/// Runs a campaign to its end, or until `shutdown`.
pub async fn run(
    plan: Plan,
    observer: Option<Observer>,
    shutdown: CancellationToken,
) -> Result<Outcome, ProgramError> {
    for warning in plan.campaign.warnings() {
        warn!("{warning}");
    }
    let problem = Arc::new(Problem::new(plan.campaign.clone()));
    // Only workers ask an external simulator: the first stored result sets the digest.
    let model_digest = (!plan.campaign.is_external()).then(|| probe::model_digest(&problem));
    // The ports first: a run whose port is in use must not leave a store behind.
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

/// Opens or creates the store of a campaign. The store of a campaign that this one
/// [extends](Campaign::extends) is extended.
pub async fn open_store(
    problem: &Problem,
    file_text: &str,
    db: &Path,
) -> Result<Store, ProgramError> {
    let campaign = problem.campaign();
    let row = CampaignRow {
        name: campaign.name.clone(),
        file_text: file_text.to_owned(),
        digest: campaign.digest(),
        seed: campaign.seed,
        program_version: crate::identity::BUILD.to_owned(),
        model_digest: None,
    };
    let store = Store::create_or_open_with(db, &row, |held| {
        // A campaign in another version's format has no keys to compare.
        let held = Campaign::stored(&held.file_text).map_err(|_| Vec::new())?;
        if campaign.extends(&held) {
            return Ok(());
        }
        Err(campaign.changes_from(&held))
    })
    .await?;
    if store.campaign().await?.digest != row.digest {
        // Refused before the store takes the campaign: the DoE could then never be completed.
        stages::designs::check_growth(problem, &store.designs().await?)?;
        info!("the campaign has grown: stored results are kept, missing ones are computed");
        store.extend(&row).await?;
    }
    Ok(store)
}

/// The bound ports.
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
) -> Result<Outcome, ProgramError> {
    if let Some(digest) = &model_digest {
        store.pin_model_digest(digest).await?;
    }
    let mut histories = store.stream_histories().await?;
    if plan.retry_failed {
        let results = store.remove_failures(problem::task::FAILED).await?;
        info!(results, "computing failed results again");
        histories
            .values_mut()
            .for_each(|history| history.failures = 0);
    }
    let options = ledger::Options {
        lease: plan.lease,
        ..board::options(problem)
    };
    let board = Arc::new(Board::new(options, rand::random()));
    board.remember(histories);
    // Without a port or designs, no worker can hold a lease from before.
    if plan.port.is_some() && store.progress().await?.designs > 0 {
        board.delay_leases(GRACE);
    }
    let recorder = StoreRecorder::new(store)?;
    let service = Service {
        board: Arc::clone(&board),
        recorder: recorder.clone(),
        problem: Arc::clone(problem),
        model_digest: model_digest.clone(),
    };
    let mut serving = RunningServer::start(service, ports.opened, &plan.workers, &plan.db)?;
    let hang_up = serving.hang_up();
    info!(store = %plan.db.display(), campaign = %plan.campaign.name, "serving");
    crate::console::service::ready();
    let page = match ports.http {
        Some(listener) => {
            let address = listener.local_addr()?;
            info!(url = %format!("http://{address}"), "live page");
            let board = Arc::clone(&board);
            let site =
                results::live::Site::new(store.clone(), Some(Box::new(move || board.live())));
            let page = results::live::serve(listener, site, hang_up.clone());
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

    let over_budget = Arc::new(OnceLock::new());
    if problem.campaign().budget != Budget::default() {
        let (problem, store, board) = (Arc::clone(problem), store.clone(), Arc::clone(&board));
        let (over_budget, stop) = (Arc::clone(&over_budget), hang_up.clone());
        tokio::spawn(stop.run_until_cancelled_owned(async move {
            match budget::used_up(&problem, &store, &board).await {
                Ok(sentence) => {
                    let _ = over_budget.set(sentence);
                    board.drain(true);
                }
                Err(error) => warn!(%error, "the budget is no longer watched"),
            }
        }));
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
            ended = engine.run(shutdown) => ended.map_err(ProgramError::from),
            Err(failed) = leases::watch(&engine.board, &recorder) => Err(failed.into()),
            failed = serving.failed() => Err(failed.into()),
            broken = recorder.broken() => Err(broken.into()),
            damaged = store.damaged() => Err(damaged.into()),
        };
        let quarantined = match ended {
            Ok(Some(CampaignEnd { quarantined })) => quarantined,
            Ok(None) => {
                if engine.board.is_drained() {
                    // After a drain, workers leave: nothing will be leased. After a signal they
                    // stay, because the coordinator may be restarted.
                    engine.board.set_course(Course::Leave);
                    farewell(&engine.board).await;
                }
                break match over_budget.get() {
                    Some(sentence) => Err(ExceededBudget(String::clone(sentence)).into()),
                    None => Ok(Outcome::Interrupted),
                };
            }
            Err(error) => break Err(error),
        };
        // A campaign is not finished before the check of its store file has ended.
        if let Err(damaged) = store.checked().await {
            break Err(damaged.into());
        }
        if let Err(taken) = (plan.check_out)(plan) {
            break Err(taken);
        }
        let labels = crate::coordinator::provenance::labels();
        let report = match report::write(store, &plan.out, &labels).await {
            Ok(report) => report,
            Err(error) => break Err(error.into()),
        };
        info!(report = %report.display(), "report written");
        if !engine.board.finish(retries) {
            continue;
        }
        farewell(&engine.board).await;
        if plan.keep_serving {
            info!("finished; still serving: stop with Ctrl-C or `coordinator drain`");
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
        // A browser that stops reading must not keep the coordinator from ending.
        let _ = tokio::time::timeout(PAGE_ENDS, page).await;
    }
    outcome
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
