//! From the store to the report.

mod enrichment;
mod facts;
mod model;
mod notes;
mod optima;
mod printed;
mod problem;
mod sources;
mod summary;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use campaign::{Approach, Campaign};
use report::{DoePoint, Header, Limits, Refusals, ReportData, StageCost, Summary, WearProfiles};
use stages::cost::{infill_calls, sampling_calls};
use stages::optima::optimum_design;
use stats::streams::{Purpose, stream};
use store::Store;

pub use self::enrichment::rounds;
pub use self::optima::{contact, drawing, run, ste};
use self::sources::Sources;
use crate::costs::Times;

/// Random wear profiles in Figure 2.
const WEAR_PROFILES: u64 = 10;

/// The file's name in the report's folder.
pub const FILE: &str = "report.html";

/// The folder of the charts in the report's folder.
pub const CHARTS: &str = "charts";

/// Writes [`FILE`] into the folder `out`, which is made if need be, and its charts into [`CHARTS`]; returns
/// the page's path. `made` says where and when, as (label, value).
///
/// # Errors
///
/// The store cannot be read or a file cannot be written.
pub async fn write(
    store: &Store,
    out: &Path,
    made: &[(String, String)],
) -> anyhow::Result<PathBuf> {
    let sources = Sources::read(store).await?;
    let status = crate::status::read(store).await?;
    let mut summary = summary::summary(&sources, &status, made)?;
    summary.inputs.extend(took(&costs(store, &sources).await?));
    let rendered = if sources.problem.gears().is_some() {
        report::render(&gathered(store, &sources, summary).await?)?
    } else {
        report::render_problem(&problem::gather(store, &sources, summary).await?)?
    };
    let charts = out.join(CHARTS);
    std::fs::create_dir_all(&charts)
        .with_context(|| format!("cannot make the folder {}", charts.display()))?;
    for chart in &rendered.charts {
        // Names of variables may hold what names of files may not.
        let plain = |c: char| {
            if c.is_alphanumeric() || "-_".contains(c) {
                c
            } else {
                '-'
            }
        };
        let name: String = chart.name.chars().map(plain).collect();
        replace(&charts.join(format!("{name}.svg")), &chart.svg)?;
        if let Some(csv) = &chart.csv {
            replace(&charts.join(format!("{name}.csv")), csv)?;
        }
    }
    let path = out.join(FILE);
    replace(&path, &rendered.html)?;
    Ok(path)
}

/// Writes a file beside and renames it, so that it is never half one.
fn replace(path: &Path, text: &str) -> anyhow::Result<()> {
    let draft = path.with_added_extension("part");
    std::fs::write(&draft, text)
        .and_then(|()| std::fs::rename(&draft, path))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Gathers the data of a gear campaign's report.
///
/// # Errors
///
/// The store cannot be read, or holds what this version cannot read.
pub async fn gather(store: &Store) -> anyhow::Result<ReportData> {
    let sources = Sources::read(store).await?;
    let status = crate::status::read(store).await?;
    let summary = summary::summary(&sources, &status, &[])?;
    gathered(store, &sources, summary).await
}

async fn gathered(
    store: &Store,
    sources: &Sources,
    summary: Summary,
) -> anyhow::Result<ReportData> {
    let digest = store.samples_digest().await?;
    let stages = costs(store, sources).await?;
    let compare = sources.problem.campaign().compares_with_paper();
    let best = summary::best(sources);
    Ok(ReportData {
        header: header(sources, digest, stages),
        summary,
        compare_with_paper: compare,
        limits: limits(sources.problem.campaign()),
        preliminary: if compare {
            printed::preliminary(sources)
        } else {
            Vec::new()
        },
        doe: doe(sources),
        similar: if compare {
            printed::similar(sources)
        } else {
            Vec::new()
        },
        wear: wear(sources),
        kriging: model::kriging(sources, best.as_ref())?,
        approaches: optima::approaches(sources)?,
        enrichment: enrichment::enrichment(store, sources).await?,
        printed: if compare {
            printed::printed_designs(sources)
        } else {
            Vec::new()
        },
        notes: notes::notes(sources, &store.failures().await?),
    })
}

/// What the whole campaign took, for the head of the report.
fn took(stages: &[StageCost]) -> Option<(String, String)> {
    let sum = |of: fn(&StageCost) -> f64| {
        let known = stages.iter().map(of).filter(|seconds| seconds.is_finite());
        known.sum::<f64>()
    };
    let (wall, cpu) = (sum(|s| s.wall_seconds), sum(|s| s.cpu_seconds));
    let text = format!("{wall:.1} s, CPU time {cpu:.1} s; by stage below");
    (wall > 0.0).then(|| ("Wall time".to_owned(), text))
}

/// What the stages cost.
async fn costs(store: &Store, sources: &Sources) -> anyhow::Result<Vec<StageCost>> {
    let deciding = || sources.rounds.iter().map(|round| round.cpu_seconds).sum();
    let numbers = || sources.infill.iter().map(|row| row.number).collect();
    let enriches = sources.problem.campaign().enrichment.is_some();
    let times = Times {
        jobs: store.job_times().await?,
        stages: store.stage_times().await?,
        fit: sources
            .model
            .as_ref()
            .map_or(0.0, |model| model.cpu_seconds),
        enrichment: enriches.then(|| (deciding(), numbers())),
    };
    Ok(times.stages())
}

fn header(sources: &Sources, samples_digest: String, stages: Vec<StageCost>) -> Header {
    let campaign = sources.problem.campaign();
    let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
    for reason in sources
        .criteria
        .iter()
        .filter(|row| !row.simulable)
        .filter_map(|row| row.reason.as_deref())
    {
        let code = reason.split(':').next().unwrap_or(reason);
        *reasons.entry(code).or_default() += 1;
    }
    let mut refused: Vec<Refusals> = reasons
        .into_iter()
        .map(|(reason, count)| Refusals {
            reason: reason.to_owned(),
            count,
        })
        .collect();
    refused.sort_by(|a, b| b.count.cmp(&a.count).then(a.reason.cmp(&b.reason)));

    let sampling = sampling_calls(&sources.criteria, sources.samples);
    // An approach that rests on the DoE counts its calls as its own; here they count once.
    let optimising: u64 = sources.runs.iter().map(|run| run.simulator_calls).sum();
    let verifying: u64 = sources
        .verified
        .values()
        .map(|samples| samples.len() as u64)
        .sum();
    let enriching = infill_calls(&sources.problem, &sources.rounds, &sources.infill);
    Header {
        campaign: sources.campaign.name.clone(),
        campaign_digest: campaign.lineage(),
        seed: sources.campaign.seed,
        program_version: sources.campaign.program_version.clone(),
        samples_digest,
        designs: campaign.doe.designs as usize,
        samples_per_design: campaign.sampling.samples_per_design as usize,
        percentile: campaign.sampling.percentile_name(),
        simulable: sources.criteria.iter().filter(|row| row.simulable).count(),
        refused,
        simulator_calls: sampling + optimising + enriching + verifying,
        stages,
        facts: facts::facts(sources),
    }
}

/// What the report calls a variable: by its symbol for gears, by its name for other problems.
fn called(sources: &Sources, name: &str) -> String {
    match sources.problem.gears() {
        Some(_) => report::symbol(name),
        None => name.to_owned(),
    }
}

fn limits(campaign: &Campaign) -> Limits {
    campaign.gears().map_or_else(Limits::default, |sections| {
        let (limits, material) = (&sections.constraints, &sections.material);
        Limits {
            contact_ratio_min: limits.contact_ratio_min,
            specific_slip_max: limits.specific_sliding_max,
            von_mises_max_mpa: limits.root_stress_max(material),
            pressure_max_mpa: limits.hertz_pressure_max(material),
        }
    })
}

fn doe(sources: &Sources) -> Vec<DoePoint> {
    let percentiles: BTreeMap<u64, f64> = sources
        .responses
        .iter()
        .map(|row| (row.design, row.percentile))
        .collect();
    sources
        .criteria
        .iter()
        .filter(|row| row.simulable)
        .map(|row| {
            let responses = row.responses.as_deref().unwrap_or_default();
            let named = |name| sources.problem.response(responses, name);
            DoePoint {
                delta_ste_um: named("delta_ste_um").unwrap_or(f64::NAN),
                delta_ste_archard_um: named("delta_ste_archard_um").unwrap_or(f64::NAN),
                p90_um: percentiles.get(&row.design).copied().unwrap_or(f64::NAN),
            }
        })
        .collect()
}

/// Figure 2 shows Archard's design, or else the first one there is.
fn wear(sources: &Sources) -> Option<WearProfiles> {
    // The profiles are the built-in model's.
    if sources.problem.campaign().is_external() {
        return None;
    }
    let (name, variables) =
        [Approach::Baseline, Approach::Nominal]
            .iter()
            .find_map(|approach| {
                let row = sources
                    .optima
                    .iter()
                    .find(|row| row.approach == approach.name())?;
                let name = optima::report_approach(*approach).label();
                Some((name, optimum_design(&sources.problem, row)?))
            })?;
    let gears = sources.problem.gears()?;
    let pair = gears.pair(&variables).ok()?;
    let wear = gears.wear();
    let mut sampler = gears.sampler(&pair);
    let seed = sources.campaign.seed;
    let profiles: Vec<gear::WearProfile> = (0..WEAR_PROFILES)
        .map(|index| sampler.draw_profile(&mut stream(seed, Purpose::Test, 2, index)))
        .collect();
    let micrometres = |depths: &[f64]| depths.iter().map(|depth| depth * 1e3).collect::<Vec<_>>();
    let worn = pair.archard(wear);
    // Pinion flank: its roll angle grows with s, so both lists run the same way.
    let roll = profiles.first()?.roll[0].clone();
    let archard_um = if worn.depth.len() == roll.len() {
        micrometres(&worn.depth)
    } else {
        return None;
    };
    let slopes = match gears.flank_class() {
        Some(_) => ", without its slope deviations",
        None => "",
    };
    Some(WearProfiles {
        subject: format!("Pinion flank of the optimum of the approach “{name}”{slopes}."),
        roll_angle_rad: roll,
        archard_um,
        random_um: profiles
            .iter()
            .map(|profile| micrometres(&profile.depth[0]))
            .collect(),
    })
}
