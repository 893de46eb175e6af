//! The studies: read files, call the library, print, choose an exit code.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use campaign::Campaign;
use campaign::formulation::Problem;
use coordinator::guard::Guard;
use coordinator::server::{self, Outcome, Plan};
use coordinator::studies::{corrections, finished, pareto, require_built_in, sensitivity, sweep};
use protocol::exit;
use rustix::time::{ClockId, clock_gettime};
use store::Store;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use super::{Usage, local_workers, print, read, refuse_network_store};
use crate::arguments;
use crate::progress::Progress;

/// `coordinator sweep`: a campaign for each number of teeth, then the table of them all.
pub(super) async fn sweep(arguments: arguments::Sweep) -> anyhow::Result<u8> {
    let campaign = parse(&arguments.campaign)?;
    let workers = local_workers(&campaign, arguments.simulator, arguments.workers)?;
    let out = folder(arguments.out, &campaign, "sweep");
    let file = arguments.campaign.display().to_string();
    let members = sweep::members(&file, &campaign, &arguments.teeth, &out)?;
    std::fs::create_dir_all(&out).map_err(|source| super::FileAccess {
        doing: "make the folder",
        path: out.clone(),
        source,
    })?;
    let shutdown = CancellationToken::new();
    tokio::spawn(worker::console::watch_signals(shutdown.clone(), "stopping"));
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
            listen: SocketAddr::from(([127, 0, 0, 1], 0)),
            guard: Guard::default(),
            out: member.report.clone(),
            workers: workers.clone(),
            lease: server::LEASE,
            metrics: None,
        };
        let progress = Progress::new();
        let observer: server::Observer = Box::new(move |status| progress.show(status));
        match server::run(plan, Some(observer), shutdown.clone()).await? {
            Outcome::Finished { given_up, .. } if given_up.is_empty() => {}
            Outcome::Finished { given_up, .. } => {
                incomplete = true;
                warn!(teeth = member.teeth, jobs = %given_up.join(", "), "some jobs were given up");
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
    let page = sweep::write_tables(&out, &campaign.name, &rows)?;
    finish((page, out))?;
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
    let out = folder(arguments.out, &campaign, "corrections");
    let rows = compute(move || {
        let problem = Problem::new(campaign);
        let frozen = finished::frozen_anew(&problem).map_err(anyhow::Error::msg)?;
        let mut rows: Vec<corrections::Row> = Vec::new();
        for (number, space) in (0..).zip(&spaces) {
            let begun = clock_gettime(ClockId::ProcessCPUTime);
            let row = corrections::run(&problem, &frozen, space, number, rows.first())?;
            let ended = clock_gettime(ClockId::ProcessCPUTime);
            info!(
                corrections = space.name(),
                designs = row.evaluations,
                worn_samples = row.worn_calls,
                cpu_seconds = ended.tv_sec - begun.tv_sec,
                "searched"
            );
            rows.push(row);
        }
        corrections::write_tables(&out, problem.campaign(), &rows).map(|page| (page, out))
    });
    finish(rows.await?)
}

/// `coordinator sensitivity`: what the recommended design owes to wear and tolerances.
pub(super) async fn sensitivity(arguments: arguments::Sensitivity) -> anyhow::Result<u8> {
    let (store, problem) = finished_campaign(&arguments.finished).await?;
    require_built_in(problem.campaign()).map_err(usage)?;
    let optima = finished::optima(&store).await?;
    store.close().await?;
    let optimum = sensitivity::choose(&optima, arguments.approach.as_deref())?.clone();
    let tolerances = sensitivity::Tolerances {
        modules: arguments.tolerance,
        scenario: arguments.scenario,
        rows: arguments.rows as usize,
    };
    let out = folder(arguments.out, problem.campaign(), "sensitivity");
    let page = compute(move || {
        let scenarios = sensitivity::scenarios(&problem, &optimum)?;
        let indices = sensitivity::indices(&problem, &optimum, &tolerances)?;
        let name = &problem.campaign().name;
        sensitivity::write_tables(&out, name, &optimum, &tolerances, &scenarios, &indices)
            .map(|page| (page, out))
    });
    finish(page.await?)
}

/// `coordinator pareto`: P90 against a second objective.
pub(super) async fn pareto(arguments: arguments::Pareto) -> anyhow::Result<u8> {
    let (store, problem) = finished_campaign(&arguments.finished).await?;
    let (against, refine) = (arguments.against, arguments.refine);
    if refine > 0 {
        require_built_in(problem.campaign()).map_err(usage)?;
    }
    let optima = finished::optima(&store).await?;
    let frozen = finished::frozen(&problem, &optima);
    let all = pareto::of_doe(&store, &problem, &frozen, against).await?;
    store.close().await?;
    let out = folder(arguments.out, problem.campaign(), "pareto");
    let page = compute(move || {
        let mut points = pareto::front_of_doe(&problem, &all, against)?;
        points.extend(pareto::of_optima(&optima));
        let refined = pareto::refine(&problem, &frozen, &points, against, refine)?;
        points.extend(refined);
        pareto::mark(&mut points, against);
        pareto::write_tables(&out, &problem, against, &all, &points, refine).map(|page| (page, out))
    });
    finish(page.await?)
}

fn usage(error: impl std::fmt::Display) -> Usage {
    Usage(error.to_string())
}

fn parse(file: &Path) -> anyhow::Result<Campaign> {
    Ok(Campaign::parse(&file.display().to_string(), &read(file)?)?)
}

fn folder(out: Option<PathBuf>, campaign: &Campaign, what: &str) -> PathBuf {
    out.unwrap_or_else(|| PathBuf::from(format!("{}-{what}", campaign.name)))
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

/// Computes off the runtime's threads; an interrupt ends the program meanwhile.
async fn compute<T: Send + 'static>(
    work: impl FnOnce() -> anyhow::Result<T> + Send + 'static,
) -> anyhow::Result<T> {
    tokio::task::spawn_blocking(work).await?
}

fn finish((page, out): (String, PathBuf)) -> anyhow::Result<u8> {
    print(&format!("{page}\nwritten to {}\n", out.display()))?;
    Ok(exit::OK)
}
