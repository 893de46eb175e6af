//! The studies: read files, call the library, print, choose an exit code.

use std::path::{Path, PathBuf};

use problem::Campaign;
use problem::accuracy::CampaignFile;
use problem::formulation::Problem;
use results::optima::Optima;
use results::table::VersionedObject;
use runner::coordinator::server::{self, Outcome, Plan};
use runner::exit::{self, ProgramError};
use store::Store;
use studies::refusal::{require_built_in, require_gears};
use studies::table::Document;
use studies::{finished, pareto, sensitivity, sizing, sweep};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use super::modelling::interruptible;
use super::output_folder::OutputFolder;
use super::{
    Usage, campaign_file, local_workers, print_either, refuse_network_store, workers_or_default,
};
use crate::arguments;
use crate::progress::Progress;

/// `coordinator sweep`: a campaign for each number of teeth, then the table of them all.
pub(super) async fn sweep(arguments: arguments::Sweep) -> Result<u8, ProgramError> {
    let campaign = parse(&arguments.campaign)?;
    let count = workers_or_default(arguments.workers, &campaign);
    let workers = local_workers(
        &campaign,
        Some(&arguments.campaign),
        &arguments.simulator,
        count,
    )?;
    let out = folder(arguments.out, &campaign, "sweep");
    let file = arguments.campaign.display().to_string();
    let members = sweep::members(&file, &campaign, &arguments.teeth, &out)?;
    let earlier = sweep::earlier(&file, &campaign, &arguments.teeth, &out).await;
    let mut all = earlier.map_err(usage)?;
    std::fs::create_dir_all(&out)
        .map_err(|source| super::FileAccess::new("make the folder", &out, source))?;
    let shutdown = CancellationToken::new();
    tokio::spawn(runner::console::watch_signals(shutdown.clone(), "stopping"));
    let mut incomplete = false;
    for member in &members {
        refuse_network_store(&member.db, arguments.allow_network_store)?;
        if sweep::is_finished(member).await? {
            info!(teeth = member.teeth, "finished before");
            continue;
        }
        info!(teeth = member.teeth, "begins");
        let plan = Plan {
            campaign: member.campaign.clone(),
            file_text: member.file_text.clone(),
            db: member.db.clone(),
            out: member.report.clone(),
            check_out: super::check_out,
            workers: workers.clone(),
            port: None,
            keep_serving: false,
            retry_failed: false,
            lease: server::LEASE,
            http: None,
        };
        let progress = Progress::new();
        let observer: server::Observer = Box::new(move |status| progress.show(status));
        match server::run(plan, Some(observer), shutdown.clone()).await? {
            Outcome::Finished { quarantined, .. } if quarantined.is_empty() => {}
            Outcome::Finished { quarantined, .. } => {
                incomplete = true;
                warn!(teeth = member.teeth, jobs = %quarantined.join(", "), "some jobs were quarantined");
            }
            Outcome::Interrupted => {
                info!("stopped; start the same command again to continue");
                return Ok(exit::INTERRUPTED);
            }
        }
    }
    all.extend(members);
    all.sort_by_key(|member| member.teeth);
    let mut rows = Vec::new();
    for member in &all {
        rows.extend(sweep::outcomes(member).await?);
    }
    let document = sweep::write_tables(&out, &campaign, &rows)?;
    finish(&document, &out, arguments.json)?;
    Ok(if incomplete {
        exit::INCOMPLETE
    } else {
        exit::OK
    })
}

/// `coordinator sizing`: other teeth and dimensions, each at its own optimum, ranked.
pub(super) async fn sizing(arguments: arguments::Sizing) -> Result<u8, ProgramError> {
    let campaign = parse(&arguments.campaign)?;
    require_built_in(&campaign).map_err(usage)?;
    let file = arguments.campaign.display().to_string();
    let sizes = arguments.range.sizes(&file, &campaign).map_err(usage)?;
    let out = new_folder(arguments.out, &campaign, "sizing")?;
    let doing = format!("searching {} sizes of {}", sizes.len(), campaign.name);
    let top = usize::from(arguments.top);
    let Some(found) = interruptible(doing, move || sizing::run(sizes, top)).await? else {
        return Ok(exit::INTERRUPTED);
    };
    let document = sizing::write_tables(&out, &campaign, &found?)?;
    finish(&document, &out, arguments.json)
}

/// `coordinator sensitivity`: the effect of wear parameters and tolerances on the recommended
/// design.
pub(super) async fn sensitivity(arguments: arguments::Sensitivity) -> Result<u8, ProgramError> {
    let (store, problem) = finished_campaign(&arguments.finished).await?;
    let campaign = problem.campaign().clone();
    require_built_in(&campaign).map_err(usage)?;
    let optimum = finished::optimum(&store, &problem, arguments.approach).await?;
    store.close().await?;
    let (tolerances, rows) = (arguments.tolerances, arguments.rows as usize);
    let out = new_folder(arguments.out, &campaign, "sensitivity")?;
    let studied = optimum.clone();
    let simulate = move || -> anyhow::Result<_> {
        let scenarios = sensitivity::scenarios(&problem, &studied)?;
        let indices = sensitivity::indices(&problem, &studied, &tolerances, rows)?;
        Ok((scenarios, indices))
    };
    let doing = format!("simulating deviations from a design of {}", campaign.name);
    let Some(simulated) = interruptible(doing, simulate).await? else {
        return Ok(exit::INTERRUPTED);
    };
    let (scenarios, indices) = simulated?;
    let document =
        sensitivity::write_tables(&out, &campaign, &optimum, &scenarios, &indices, rows)?;
    finish(&document, &out, arguments.json)
}

/// `coordinator pareto`: P90 against a second objective.
pub(super) async fn pareto(arguments: arguments::Pareto) -> Result<u8, ProgramError> {
    let (store, problem) = finished_campaign(&arguments.finished).await?;
    let (against, refine) = (arguments.against, arguments.refine);
    if against.limit(&problem).is_infinite() {
        let why = "--against root-stress takes a campaign that limits it: [constraints] root_stress_max_mpa";
        return Err(usage(why.to_owned()).into());
    }
    if refine > 0 {
        require_built_in(problem.campaign())
            .map_err(|error| usage(format!("{error}, or leave out --refine")))?;
    }
    let optima = Optima::read(&store, &problem).await?;
    let base = finished::base(&problem, &optima);
    let all = pareto::of_doe(&store, &problem, &base, against).await?;
    store.close().await?;
    let out = new_folder(arguments.out, problem.campaign(), "pareto")?;
    let doing = format!("simulating designs of {}", problem.campaign().name);
    let simulate = move || -> anyhow::Result<_> {
        let mut points = pareto::front_of_doe(&problem, &all, against)?;
        points.extend(pareto::of_optima(&optima));
        let refined = pareto::refine(&problem, &base, &points, against, refine)?;
        points.extend(refined);
        pareto::mark(&mut points, against);
        Ok((problem, all, points))
    };
    let Some(simulated) = interruptible(doing, simulate).await? else {
        return Ok(exit::INTERRUPTED);
    };
    let (problem, all, points) = simulated?;
    let document = pareto::write_tables(&out, &problem, against, &all, &points, refine)?;
    finish(&document, &out, arguments.json)
}

pub(super) fn usage(error: impl std::fmt::Display) -> Usage {
    Usage(error.to_string())
}

/// Reads a campaign and refuses one that is not of gears.
fn parse(file: &Path) -> Result<Campaign, ProgramError> {
    let CampaignFile { campaign, .. } = campaign_file(file)?;
    require_gears(&campaign).map_err(usage)?;
    Ok(campaign)
}

fn folder(out: Option<PathBuf>, campaign: &Campaign, what: &str) -> PathBuf {
    out.unwrap_or_else(|| PathBuf::from(format!("{}-{what}", campaign.name)))
}

/// The folder of a study that cannot be continued, which must be new or empty.
fn new_folder(
    out: Option<PathBuf>,
    campaign: &Campaign,
    what: &str,
) -> Result<PathBuf, super::FileAccess> {
    let out = folder(out, campaign, what);
    OutputFolder(&out).require_new()?;
    Ok(out)
}

async fn finished_campaign(
    arguments: &arguments::FinishedCampaign,
) -> Result<(Store, Problem), ProgramError> {
    let campaign = parse(&arguments.campaign)?;
    let db = arguments
        .db
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{}.db", campaign.name)));
    let store = Store::open_read_only(&db).await?;
    let problem = finished::problem(&store, &campaign).await?;
    Ok((store, problem))
}

fn finish(document: &Document, out: &Path, json: bool) -> Result<u8, ProgramError> {
    print_either(json, &VersionedObject::new(document.to_json(out)), || {
        format!("{}\nwritten to {}\n", document.page, out.display())
    })?;
    Ok(exit::OK)
}
