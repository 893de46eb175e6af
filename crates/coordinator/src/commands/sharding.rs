//! `plan` and `merge`: a campaign stage by stage, without a network between the nodes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use ledger::WorkerId;
use problem::accuracy::CampaignFile;
use problem::formulation::Problem;
use problem::{Campaign, probe};
use results::table::VersionedObject;
use results::{report, status};
use runner::coordinator::board::{self, Board, Room};
use runner::coordinator::engine::Engine;
use runner::coordinator::recorder::StoreRecorder;
use runner::coordinator::server;
use runner::coordinator::service::Service;
use runner::exit::{self, HasExitCode, ProgramError};
use runner::protocol::v1::campaign_server::Campaign as _;
use runner::protocol::v1::{
    HeldLease, Lease, LeaseId, LeaseResult, RegisterRequest, ReportRequest,
};
use runner::shards::{Header, Kinship, Part, Shard};
use serde::Serialize;
use stages::stage::Stage;
use store::Store;
use tokio_util::sync::CancellationToken;
use tonic::Request;

use super::output::print_either;
use super::output_folder::OutputFolder;
use super::{
    FileAccess, campaign_or_paper, code_of_finished, out_folder, refuse_network_store,
    require_own_report,
};
use crate::arguments;

/// Maximum number of leases in a request.
const LEASES: usize = 10_000;

/// The reason why parts cannot be merged.
#[derive(Debug, thiserror::Error)]
enum MergeError {
    #[error("part {} belongs to another campaign than store {}, or to a version of it with other samples",
        part.display(), store.display())]
    Foreign { part: PathBuf, store: PathBuf },
    #[error("{}: {reason}. Parts that were given before it are stored", part.display())]
    Refused {
        part: PathBuf,
        /// Whether the part would be refused again.
        is_final: bool,
        reason: String,
    },
    #[error("{} and {} are both parts of shard {shard}; give only one",
        first.display(), second.display())]
    Doubled {
        shard: u32,
        first: PathBuf,
        second: PathBuf,
    },
}

impl HasExitCode for MergeError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Foreign { .. } => exit::OTHER_CAMPAIGN,
            Self::Doubled { .. } => exit::USAGE,
            Self::Refused { is_final: true, .. } => exit::REFUSED,
            Self::Refused { .. } => exit::FAILURE,
        }
    }
}

#[derive(Serialize)]
struct PlanResult {
    stage: String,
    shards: Vec<PathBuf>,
    /// Number of jobs, each a run or a range of samples.
    units: usize,
    report: Option<PathBuf>,
}

/// Runs the local steps and writes the remaining jobs as shards, or the report if nothing remains.
pub(super) async fn plan(arguments: arguments::Plan) -> Result<u8, ProgramError> {
    let CampaignFile { campaign, text, .. } = campaign_or_paper(Some(&arguments.campaign))?;
    refuse_network_store(&arguments.db, arguments.allow_network_store)?;
    let report = out_folder(arguments.report, &campaign);
    require_own_report(&report, &campaign, &arguments.db).await?;
    OutputFolder(&arguments.out).require_new()?;
    let problem = Arc::new(Problem::new(campaign));
    let store = server::open_store(&problem, &text, &arguments.db).await?;
    let planned = plan_store(&problem, &store, arguments.shards, &arguments.out, &report).await;
    let code = match &planned {
        Ok(PlanResult {
            report: Some(_), ..
        }) => code_of_finished(&problem, &store).await,
        _ => Ok(exit::OK),
    };
    store.close().await?;
    let planned = planned?;
    let exec = match problem.campaign().is_external() {
        true => " --exec 'CMD'",
        false => "",
    };
    print_either(
        arguments.json,
        &VersionedObject::new(&planned),
        || match &planned.report {
            Some(report) => format!(
                "nothing is left to compute\nreport          {}\n",
                report.display()
            ),
            None => format!(
                "stage           {}\nshards          {} with {} jobs, in {}\n\
             next            `worker --shard {}/N.json --out {}/N.part{exec}` for each N, then\n\
             \x20               `coordinator merge --db {} {}/*.part`\n",
                planned.stage,
                planned.shards.len(),
                planned.units,
                arguments.out.display(),
                arguments.out.display(),
                arguments.out.display(),
                arguments.db.display(),
                arguments.out.display(),
            ),
        },
    )?;
    code
}

async fn plan_store(
    problem: &Arc<Problem>,
    store: &Store,
    count: u32,
    out: &Path,
    report: &Path,
) -> Result<PlanResult, ProgramError> {
    let (engine, model_digest) = engine(problem, store).await?;
    if engine
        .run_to_jobs(&CancellationToken::new())
        .await?
        .is_some()
    {
        let labels = runner::coordinator::provenance::labels();
        let report = report::write(store, report, &labels).await?;
        return Ok(PlanResult {
            stage: Stage::Done.to_string(),
            shards: Vec::new(),
            units: 0,
            report: Some(report),
        });
    }
    let leases = leases(&engine.board).await;
    let campaign = problem.campaign();
    let (json, digest) = (campaign.to_json(), campaign.digest());
    let shards = Shard::deal(leases, count, (&json, &digest), model_digest.as_deref());
    std::fs::create_dir_all(out).map_err(|source| FileAccess::new("write to", out, source))?;
    let units = shards.iter().map(|shard| shard.units().count()).sum();
    let written: Result<Vec<PathBuf>, _> = shards.iter().map(|shard| shard.write(out)).collect();
    Ok(PlanResult {
        stage: status::read(store).await?.stage_name(),
        shards: written?,
        units,
        report: None,
    })
}

/// Creates an engine without workers. Returns it with the digest of the built-in simulator.
async fn engine(
    problem: &Arc<Problem>,
    store: &Store,
) -> Result<(Engine, Option<String>), ProgramError> {
    let is_external = problem.campaign().is_external();
    let model_digest = (!is_external).then(|| probe::model_digest(problem));
    if let Some(digest) = &model_digest {
        store.pin_model_digest(digest).await?;
    }
    let options = board::options(problem);
    let board = Arc::new(Board::new(options, rand::random()));
    // Suspects cannot be computed alone here: the coordinator does not know which parts of a shard run at the same
    // time.
    let mut histories = store.stream_histories().await?;
    histories
        .values_mut()
        .for_each(|history| history.crashes.clear());
    board.remember(histories);
    let engine = Engine::new(
        Arc::clone(problem),
        model_digest.as_deref(),
        store.clone(),
        board,
    );
    Ok((engine, model_digest))
}

/// Leases all jobs on the board.
async fn leases(board: &Board) -> Vec<Lease> {
    let planner = WorkerId::from("plan");
    board.register(&planner, "plan", LEASES as u32, &[]);
    let room = Room {
        leases: LEASES,
        seconds: f64::INFINITY,
    };
    let mut leases = Vec::new();
    loop {
        let grants = board.lease(&planner, room, Duration::ZERO).await;
        if grants.is_empty() {
            return leases;
        }
        leases.extend(grants.iter().map(runner::protocol::lease));
    }
}

#[derive(Serialize)]
struct MergeResult {
    parts: usize,
    /// Shards of the parts' plans for which no part was given.
    missing_shards: Vec<u32>,
    /// Parts with missing results, for example of a worker that was stopped.
    unfinished_parts: Vec<PathBuf>,
    samples: u64,
    stage: String,
}

/// Stores the results in parts.
pub(super) async fn merge(arguments: arguments::Merge) -> Result<u8, ProgramError> {
    refuse_network_store(&arguments.db, arguments.allow_network_store)?;
    // All parts are read before any is stored.
    let parts: Result<Vec<Part>, _> = arguments
        .parts
        .iter()
        .map(|path| Part::read(path))
        .collect();
    let parts = parts?;
    let held = Store::open_read_only(&arguments.db).await?;
    let row = held.campaign().await?;
    held.close().await?;
    let campaign = Campaign::stored(&row.file_text)?;
    let missing_shards = fitting(&parts, &campaign, &arguments.db)?;
    let problem = Arc::new(Problem::new(campaign));
    let store = server::open_store(&problem, &row.file_text, &arguments.db).await?;
    let stored = store_parts(&problem, &store, &parts).await;
    let status = status::read(&store).await;
    store.close().await?;
    stored?;
    let status = status?;
    let unfinished = parts.iter().filter(|part| !part.missing().is_empty());
    let merged = MergeResult {
        parts: parts.len(),
        missing_shards,
        unfinished_parts: unfinished.map(|part| part.path.clone()).collect(),
        samples: status.samples.done,
        stage: status.stage_name(),
    };
    let is_planned = parts.iter().any(|part| !part.header.is_undelivered());
    print_either(arguments.json, &VersionedObject::new(&merged), || {
        describe(&merged, is_planned)
    })?;
    let is_whole = merged.missing_shards.is_empty() && merged.unfinished_parts.is_empty();
    Ok(if is_whole { exit::OK } else { exit::INCOMPLETE })
}

fn describe(merged: &MergeResult, is_planned: bool) -> String {
    let mut text = format!(
        "merged          {} parts; the store has {} samples, stage {}\n",
        merged.parts, merged.samples, merged.stage
    );
    if !merged.missing_shards.is_empty() {
        let numbers: Vec<String> = merged.missing_shards.iter().map(u32::to_string).collect();
        text += &format!("missing         no part of shard {}\n", numbers.join(", "));
    }
    for part in &merged.unfinished_parts {
        text += &format!(
            "unfinished      {}: the same `worker` command continues it\n",
            part.display()
        );
    }
    text + match is_planned {
        true => "next            `coordinator plan` with a new folder, for the remaining jobs\n",
        false => "next            the coordinator again, for the remaining jobs\n",
    }
}

/// Refuses parts of another campaign and two parts of the same shard. Returns the shards without a
/// part.
fn fitting(parts: &[Part], campaign: &Campaign, db: &Path) -> Result<Vec<u32>, MergeError> {
    let mut seen: BTreeMap<(&str, u32), &Path> = BTreeMap::new();
    for Part { path, header, .. } in parts {
        if header.kinship(campaign) == Kinship::Foreign {
            return Err(MergeError::Foreign {
                part: path.clone(),
                store: db.to_owned(),
            });
        }
        if let Some(first) = seen.insert((&header.plan, header.shard), path) {
            return Err(MergeError::Doubled {
                shard: header.shard,
                first: first.to_owned(),
                second: path.clone(),
            });
        }
    }
    let missing = |header: &Header| {
        let own: Vec<u32> = (1..=header.shards)
            .filter(|shard| !seen.contains_key(&(header.plan.as_str(), *shard)))
            .collect();
        own
    };
    let mut all: Vec<u32> = parts
        .iter()
        .flat_map(|part| missing(&part.header))
        .collect();
    all.sort_unstable();
    all.dedup();
    Ok(all)
}

/// Reports the parts to a service, as the workers would that computed the results.
async fn store_parts(
    problem: &Arc<Problem>,
    store: &Store,
    parts: &[Part],
) -> Result<(), ProgramError> {
    let (engine, model_digest) = engine(problem, store).await?;
    let shutdown = CancellationToken::new();
    if engine.run_to_jobs(&shutdown).await?.is_some() {
        return Ok(());
    }
    let service = Service {
        board: Arc::clone(&engine.board),
        recorder: StoreRecorder::new(store)?,
        problem: Arc::clone(problem),
        model_digest,
    };
    let mut numbers = 1..;
    for part in parts {
        // Failures may be due to limits that the campaign had then.
        let has_failures = part.header.kinship(problem.campaign()) == Kinship::Same;
        for (process, results) in part.by_process() {
            let id = numbers.next().map(|number| LeaseId { epoch: 1, number });
            let held = HeldLease {
                id,
                units: part.units_with(&results),
            };
            let introduction = RegisterRequest {
                worker_id: process.worker_id.clone(),
                host: process.host.clone(),
                program_version: runner::identity::BUILD.to_owned(),
                model_digest: part.header.model_digest.clone(),
                slots: 1,
                held: vec![held],
                died: Vec::new(),
            };
            let refused = |status: tonic::Status| MergeError::Refused {
                part: part.path.clone(),
                is_final: status.code() == tonic::Code::FailedPrecondition,
                reason: status.message().to_owned(),
            };
            let registered = service.register(Request::new(introduction)).await;
            registered.map_err(refused)?;
            // All results of a process are reported as those of one lease.
            let mut whole = LeaseResult {
                id,
                results,
                ..LeaseResult::default()
            };
            whole
                .results
                .retain(|result| has_failures || result.error.is_none());
            let report = ReportRequest {
                worker_id: process.worker_id.clone(),
                results: vec![whole],
            };
            let reported = service.report(Request::new(report)).await;
            reported.map_err(refused)?;
        }
    }
    Ok(())
}
