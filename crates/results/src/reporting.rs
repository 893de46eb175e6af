//! From the store to the report.

mod enrichment;
mod facts;
mod head;
mod model;
mod notes;
mod optima;
mod printed;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use campaign::Approach;
use gear::WearProfile;
use stages::cost::{infill_calls, sampling_calls};
use stats::streams::{Purpose, stream};
use store::Store;

pub use self::enrichment::rounds;
pub use self::optima::run;
use crate::costs::StageCost;
use crate::report::{
    DoePoint, Enrichment, GearData, Header, ReportData, WearProfiles, approach_name, render,
};
use crate::snapshot::Snapshot;
use crate::status::{self, Status};

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
    let data = ReportData {
        made: made.to_vec(),
        ..gather(store).await?
    };
    let rendered = render(&data)?;
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

/// Gathers the data of a campaign's report.
///
/// # Errors
///
/// The store cannot be read, or holds what this version cannot read.
pub async fn gather(store: &Store) -> anyhow::Result<ReportData> {
    let snapshot = Snapshot::read(store).await?;
    let status = status::read(store).await?;
    let enrichment = enrichment::enrichment(store, &snapshot).await?;
    gathered(snapshot, &status, enrichment)
}

fn gathered(
    snapshot: Snapshot,
    status: &Status,
    enrichment: Option<Enrichment>,
) -> anyhow::Result<ReportData> {
    let problem = &snapshot.problem;
    let mut inputs = head::inputs(problem);
    inputs.extend(duration(&snapshot.costs));
    let best = snapshot.optima.recommended();
    let best = best.and_then(|best| best.optimum.feasible());
    let compare_with_paper = problem.campaign().compares_with_paper();
    let of_paper = compare_with_paper.then_some(&snapshot);
    let gears = match problem.gears() {
        Some(_) => Some(GearData {
            compare_with_paper,
            preliminary: of_paper.map_or_else(Vec::new, printed::preliminary),
            doe: doe(&snapshot),
            similar: of_paper.map_or_else(Vec::new, printed::similar),
            wear: wear(&snapshot),
            illustrations: optima::illustrations(&snapshot),
            runs: optima::runs(&snapshot)?,
            enrichment,
            printed: of_paper.map_or_else(Vec::new, printed::printed_designs),
        }),
        None => None,
    };
    Ok(ReportData {
        header: header(&snapshot),
        missing: head::missing(status),
        inputs,
        made: Vec::new(),
        left_out: head::left_out(problem),
        kriging: model::kriging(&snapshot, best.map(|found| &found.design))?,
        notes: notes::notes(&snapshot),
        gears,
        optima: snapshot.optima,
        problem: snapshot.problem,
    })
}

/// What the whole campaign took, for the head of the report.
fn duration(stages: &[StageCost]) -> Option<(String, String)> {
    let sum = |of: fn(&StageCost) -> f64| {
        let known = stages.iter().map(of).filter(|seconds| seconds.is_finite());
        known.sum::<f64>()
    };
    let (wall, cpu) = (sum(|s| s.wall_seconds), sum(|s| s.cpu_seconds));
    let text = format!("{wall:.1} s, CPU time {cpu:.1} s; by stage below");
    (wall > 0.0).then(|| ("Wall time".to_owned(), text))
}

fn header(snapshot: &Snapshot) -> Header {
    let campaign = snapshot.problem.campaign();
    let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
    let refused = snapshot.criteria.iter().filter(|row| !row.simulable);
    for reason in refused.filter_map(|row| row.reason.as_deref()) {
        let code = reason.split(':').next().unwrap_or(reason);
        *reasons.entry(code).or_default() += 1;
    }
    let reasons = reasons.into_iter();
    let mut refused: Vec<(String, usize)> = reasons
        .map(|(reason, count)| (reason.to_owned(), count))
        .collect();
    refused.sort_by(|(a, m), (b, n)| n.cmp(m).then(a.cmp(b)));

    let sampling = sampling_calls(&snapshot.criteria, snapshot.samples);
    // An approach that rests on the DoE counts its calls as its own; here they count once.
    let optimising: u64 = snapshot.runs.iter().map(|run| run.simulator_calls).sum();
    let verified = snapshot.optima.iter().map(|verified| verified.samples());
    let printed = snapshot.printed.values().map(Vec::as_slice);
    let verifying: usize = verified.chain(printed).map(<[f64]>::len).sum();
    let enriching = infill_calls(&snapshot.problem, &snapshot.rounds, &snapshot.infill);
    Header {
        campaign: snapshot.campaign.name.clone(),
        campaign_digest: campaign.lineage(),
        seed: snapshot.campaign.seed,
        program_version: snapshot.campaign.program_version.clone(),
        samples_digest: snapshot.samples_digest.clone(),
        designs: campaign.doe.designs as usize,
        samples_per_design: campaign.sampling.samples_per_design as usize,
        percentile: campaign.sampling.percentile_name(),
        simulable: snapshot.criteria.iter().filter(|row| row.simulable).count(),
        refused,
        simulator_calls: sampling + optimising + enriching + verifying as u64,
        stages: snapshot.costs.clone(),
        facts: facts::facts(snapshot),
    }
}

fn doe(snapshot: &Snapshot) -> Vec<DoePoint> {
    let percentiles: BTreeMap<u64, f64> = snapshot
        .responses
        .iter()
        .map(|row| (row.design, row.percentile))
        .collect();
    snapshot
        .criteria
        .iter()
        .filter(|row| row.simulable)
        .map(|row| {
            let responses = row.responses.as_deref().unwrap_or_default();
            let named = |name| snapshot.problem.response(responses, name);
            DoePoint {
                delta_ste_um: named("delta_ste_um").unwrap_or(f64::NAN),
                delta_ste_archard_um: named("delta_ste_archard_um").unwrap_or(f64::NAN),
                p90_um: percentiles.get(&row.design).copied().unwrap_or(f64::NAN),
            }
        })
        .collect()
}

/// Figure 2 shows Archard's design, or else the first one there is.
fn wear(snapshot: &Snapshot) -> Option<WearProfiles> {
    // The profiles are the built-in model's.
    if snapshot.problem.campaign().is_external() {
        return None;
    }
    let (name, design) = [Approach::Baseline, Approach::Nominal]
        .iter()
        .find_map(|approach| {
            let optimum = &snapshot.optima.of(*approach)?.optimum;
            let found = optimum.found.as_ref().ok()?;
            Some((approach_name(&snapshot.problem, *approach), &found.design))
        })?;
    let gears = snapshot.problem.gears()?;
    let pair = gears.pair(design).ok()?;
    let wear = gears.wear();
    let mut sampler = gears.sampler(&pair);
    let seed = snapshot.campaign.seed;
    let profiles: Vec<WearProfile> = (0..WEAR_PROFILES)
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
