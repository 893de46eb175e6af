//! The studies: read files, call the library, print, choose an exit code.

use std::path::{Path, PathBuf};
use std::time::Instant;

use campaign::Campaign;
use campaign::formulation::Problem;
use coordinator::server::{self, Outcome, Plan};
use coordinator::study;
use protocol::exit;
use store::Store;
use studies::refusal::{require_built_in, require_gears};
use studies::simulations::Simulations;
use studies::table::Written;
use studies::{corrections, finished, pareto, sensitivity, sweep};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use super::output::refuse_taken;
use super::{Usage, local_workers, print_either, processors, read, refuse_network_store};
use crate::arguments;
use crate::progress::Progress;

/// `coordinator sweep`: a campaign for each number of teeth, then the table of them all.
pub(super) async fn sweep(arguments: arguments::Sweep) -> anyhow::Result<u8> {
    let campaign = parse(&arguments.campaign)?;
    let count = arguments.workers.unwrap_or_else(processors);
    let workers = local_workers(&campaign, &arguments.simulator, count)?;
    let out = folder(arguments.out, &campaign, "sweep");
    let file = arguments.campaign.display().to_string();
    let members = sweep::members(&file, &campaign, &arguments.teeth, &out)?;
    std::fs::create_dir_all(&out).map_err(|source| super::FileAccess {
        doing: "make the folder",
        path: out.clone(),
        source,
    })?;
    let shutdown = CancellationToken::new();
    tokio::spawn(console::watch_signals(shutdown.clone(), "stopping"));
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
    let mut rows = Vec::new();
    for member in &members {
        rows.extend(sweep::rows(member).await?);
    }
    let found = sweep::write_tables(&out, &campaign, &rows)?;
    finish((found, out), arguments.json)?;
    Ok(if incomplete {
        exit::INCOMPLETE
    } else {
        exit::OK
    })
}

/// `coordinator corrections`: the robust optimum with and without profile corrections.
pub(super) async fn corrections(arguments: arguments::Corrections) -> anyhow::Result<u8> {
    let campaign = parse(&arguments.campaign)?;
    let spaces = corrections::spaces(&campaign).map_err(usage)?;
    let json = arguments.json;
    let out = new_folder(arguments.out, &campaign, "corrections")?;
    let plan = plan(&campaign, arguments.workers, "corrections")?;
    let rows = move |simulations: &dyn Simulations| {
        let problem = Problem::new(campaign);
        let base = finished::base_anew(simulations, &problem)?;
        let mut rows: Vec<corrections::Row> = Vec::new();
        for (number, space) in (0..).zip(&spaces) {
            let begun = Instant::now();
            let row = corrections::run(simulations, &problem, &base, space, number, rows.first())?;
            info!(
                corrections = space.name(),
                designs = row.evaluations,
                worn_samples = row.worn_calls,
                seconds = begun.elapsed().as_secs(),
                "searched"
            );
            rows.push(row);
        }
        corrections::write_tables(&out, problem.campaign(), &rows).map(|found| (found, out))
    };
    conduct(plan, json, rows).await
}

/// `coordinator sensitivity`: the effect of wear parameters and tolerances on the recommended
/// design.
pub(super) async fn sensitivity(arguments: arguments::Sensitivity) -> anyhow::Result<u8> {
    let (store, problem) = finished_campaign(&arguments.finished).await?;
    require_built_in(problem.campaign()).map_err(usage)?;
    let optima = finished::optima(&store, &problem).await?;
    store.close().await?;
    let optimum = sensitivity::choose(
        &problem.campaign().sampling,
        &optima,
        arguments.approach.as_deref(),
    )?
    .clone();
    let tolerances = sensitivity::Tolerances {
        modules: arguments.tolerance,
        scenario: arguments.scenario,
        rows: arguments.rows as usize,
    };
    let json = arguments.json;
    let out = new_folder(arguments.out, problem.campaign(), "sensitivity")?;
    let plan = plan(problem.campaign(), arguments.workers, "sensitivity")?;
    let page = move |simulations: &dyn Simulations| {
        let scenarios = sensitivity::scenarios(simulations, &problem, &optimum)?;
        let indices = sensitivity::indices(simulations, &problem, &optimum, &tolerances)?;
        let campaign = problem.campaign();
        sensitivity::write_tables(&out, campaign, &optimum, &tolerances, &scenarios, &indices)
            .map(|found| (found, out))
    };
    conduct(plan, json, page).await
}

/// `coordinator pareto`: P90 against a second objective.
pub(super) async fn pareto(arguments: arguments::Pareto) -> anyhow::Result<u8> {
    let (store, problem) = finished_campaign(&arguments.finished).await?;
    let (against, refine) = (arguments.against, arguments.refine);
    // The front of the DoE can be shown without its external simulator.
    let workers = arguments.workers;
    let has_workers =
        !problem.campaign().is_external() || workers.admit || workers.simulator.exec().is_some();
    let optima = finished::optima(&store, &problem).await?;
    let base = finished::base(&problem, &optima);
    let all = pareto::of_doe(&store, &problem, &base, against).await?;
    store.close().await?;
    let json = arguments.json;
    let out = new_folder(arguments.out, problem.campaign(), "pareto")?;
    let campaign = problem.campaign().clone();
    let page = move |simulations: Option<&dyn Simulations>| {
        let mut points = pareto::front_of_doe(simulations, &problem, &all, against)?;
        points.extend(pareto::of_optima(&problem.campaign().sampling, &optima));
        if let Some(simulations) = simulations {
            let refined = pareto::refine(simulations, &problem, &base, &points, against, refine)?;
            points.extend(refined);
        }
        pareto::mark(&mut points, against);
        pareto::write_tables(&out, &problem, against, &all, &points, refine)
            .map(|found| (found, out))
    };
    if !has_workers && refine == 0 {
        return finish(page(None)?, json);
    }
    let plan = plan(&campaign, workers, "pareto")?;
    conduct(plan, json, move |simulations| page(Some(simulations))).await
}

/// The plan of a study of a campaign.
fn plan(
    campaign: &Campaign,
    arguments: arguments::StudyWorkers,
    what: &str,
) -> anyhow::Result<study::Plan> {
    let name = format!("{}-{what}", campaign.name);
    let port = if arguments.admit {
        Some(super::port(arguments.port, &name)?)
    } else {
        refuse_port(&arguments.port)?;
        None
    };
    let default = if arguments.admit { 0 } else { processors() };
    let count = arguments.workers.unwrap_or(default);
    Ok(study::Plan {
        workers: local_workers(campaign, &arguments.simulator, count)?,
        campaign: campaign.clone(),
        name,
        port,
        lease: server::LEASE,
    })
}

/// Refuses options of a port without `--admit`. Values from the environment are allowed: they
/// belong to another coordinator.
fn refuse_port(port: &arguments::PortArguments) -> Result<(), Usage> {
    let is_given = |file: &Option<PathBuf>, variable| {
        file.as_deref().map(Path::as_os_str) != std::env::var_os(variable).as_deref()
    };
    if port.listen.is_some()
        || !port.hosts.is_empty()
        || port.insecure
        || is_given(&port.access, "PITCHLINE_ACCESS")
        || is_given(&port.guard.tls_cert, "PITCHLINE_TLS_CERT")
    {
        return Err(usage(
            "a study has a port only with --admit: add it, or leave out the port's options",
        ));
    }
    Ok(())
}

/// Runs a study to its end, prints its page, and says where its tables are.
async fn conduct(
    plan: study::Plan,
    json: bool,
    work: impl FnOnce(&dyn Simulations) -> anyhow::Result<(Written, PathBuf)> + Send + 'static,
) -> anyhow::Result<u8> {
    let shutdown = CancellationToken::new();
    tokio::spawn(console::watch_signals(shutdown.clone(), "stopping"));
    match study::run(plan, work, shutdown).await? {
        Some(found) => finish(found, json),
        None => {
            info!("stopped; nothing of the study is kept");
            Ok(exit::INTERRUPTED)
        }
    }
}

fn usage(error: impl std::fmt::Display) -> Usage {
    Usage(error.to_string())
}

/// Reads a campaign and refuses one that is not of gears.
fn parse(file: &Path) -> anyhow::Result<Campaign> {
    let campaign = Campaign::parse(&file.display().to_string(), &read(file)?)?;
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
    refuse_taken(&out)?;
    Ok(out)
}

async fn finished_campaign(
    arguments: &arguments::FinishedCampaign,
) -> anyhow::Result<(Store, Problem)> {
    let campaign = parse(&arguments.campaign)?;
    let db = arguments
        .db
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{}.db", campaign.name)));
    let store = Store::open_read_only(&db).await?;
    let problem = finished::problem(&store, &campaign).await?;
    Ok((store, problem))
}

fn finish((found, out): (Written, PathBuf), json: bool) -> anyhow::Result<u8> {
    print_either(json, &found.to_json(&out)?, || {
        format!("{}\nwritten to {}\n", found.page, out.display())
    })?;
    Ok(exit::OK)
}
