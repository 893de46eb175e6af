//! From the store to the report.

mod choice;
mod enrichment;
mod facts;
mod notes;
mod optima;
mod printed;
mod problem;
mod sources;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use campaign::{Approach, Campaign};
use report::{
    DoePoint, Header, KrigingFit, LeaveOneOut, Limits, Parameter, Refusals, ReportData, StageCost,
    WearProfiles,
};
use stages::cost::{infill_seconds, sampling_calls};
use stages::names;
use stages::optima::optimum_design;
use stats::streams::{Purpose, stream};
use store::Store;

pub use self::enrichment::rounds;
pub use self::optima::{drawing, run, ste};
use self::sources::Sources;

/// Random wear profiles in Figure 2.
const WEAR_PROFILES: u64 = 10;

/// The file's name in the report's folder.
pub const FILE: &str = "report.html";

/// Writes [`FILE`] into the folder `out`, which is made if need be; returns its path.
///
/// # Errors
///
/// The store cannot be read or the file cannot be written.
pub async fn write(store: &Store, out: &Path) -> anyhow::Result<PathBuf> {
    let sources = Sources::read(store).await?;
    let html = if sources.problem.gears().is_some() {
        report::render(&gather(store).await?)?
    } else {
        report::render_problem(&problem::gather(store, &sources).await?)?
    };
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot make the folder {}", out.display()))?;
    let path = out.join(FILE);
    // Written beside and renamed, so that a report is never half one.
    let draft = out.join(format!("{FILE}.part"));
    std::fs::write(&draft, html)
        .and_then(|()| std::fs::rename(&draft, &path))
        .with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// Gathers the data of a gear campaign's report.
///
/// # Errors
///
/// The store cannot be read, or holds what this version cannot read.
pub async fn gather(store: &Store) -> anyhow::Result<ReportData> {
    let sources = Sources::read(store).await?;
    let digest = store.samples_digest().await?;
    let times = store.job_times().await?;
    let compare = sources.problem.campaign().compares_with_paper();
    Ok(ReportData {
        header: header(&sources, digest, &times),
        compare_with_paper: compare,
        limits: limits(sources.problem.campaign()),
        preliminary: if compare {
            printed::preliminary(&sources)
        } else {
            Vec::new()
        },
        doe: doe(&sources),
        similar: if compare {
            printed::similar(&sources)
        } else {
            Vec::new()
        },
        wear: wear(&sources),
        kriging: kriging(&sources),
        approaches: optima::approaches(&sources)?,
        enrichment: enrichment::enrichment(store, &sources).await?,
        printed: if compare {
            printed::printed_designs(&sources)
        } else {
            Vec::new()
        },
        notes: notes::notes(&sources, &store.failures().await?),
    })
}

fn header(sources: &Sources, samples_digest: String, times: &[store::JobTimeRow]) -> Header {
    let campaign = sources.problem.campaign();
    let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
    for reason in sources
        .criteria
        .iter()
        .filter(|row| !row.feasible)
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

    let mut stages: BTreeMap<_, f64> = BTreeMap::new();
    for time in times {
        if let Some((kind, _)) = names::timed(time.job) {
            *stages.entry(kind).or_default() += time.cpu_seconds;
        }
    }
    let seconds = |kind| stages.get(&kind).copied().unwrap_or(0.0);
    use ledger::Kind::{Design, Point, Run};
    let fit = sources
        .model
        .as_ref()
        .map_or(0.0, |model| model.cpu_seconds);
    let sampling = sampling_calls(&sources.criteria, sources.samples);
    // An approach that rests on the DoE counts its calls as its own; here they count once.
    let optimising: u64 = sources.runs.iter().map(|run| run.simulator_calls).sum();
    let verifying: u64 = sources
        .fresh
        .values()
        .map(|samples| samples.len() as u64)
        .sum();
    let stage = |name: &str, cpu_seconds| StageCost {
        stage: name.to_owned(),
        cpu_seconds,
    };
    let numbers = sources.infill.iter().map(|row| row.number).collect();
    let infill = infill_seconds(times, &numbers);
    let deciding: f64 = sources.rounds.iter().map(|round| round.cpu_seconds).sum();
    let searching: u64 = sources
        .rounds
        .iter()
        .map(|round| round.simulator_calls)
        .sum();
    let sampled = sources.infill.iter().filter(|row| !row.failed);
    let enriching = searching + sampled.map(|row| row.samples).sum::<u64>();
    let mut costs = vec![
        stage("sample", seconds(Design)),
        stage("fit", fit),
        stage("optimise", seconds(Run)),
        stage("verify", seconds(Point) - infill),
    ];
    if campaign.enrichment.is_some() {
        costs.insert(3, stage("enrich", infill + deciding));
    }
    Header {
        campaign: sources.campaign.name.clone(),
        campaign_digest: sources.campaign.digest.clone(),
        seed: sources.campaign.seed,
        program_version: sources.campaign.program_version.clone(),
        samples_digest,
        designs: campaign.doe.designs as usize,
        samples_per_design: campaign.sampling.samples_per_design as usize,
        percentile: campaign.sampling.percentile_name(),
        simulable: sources.criteria.iter().filter(|row| row.feasible).count(),
        refused,
        simulator_calls: sampling + optimising + enriching + verifying,
        stages: costs,
        facts: facts::facts(sources),
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
        .map(|row| (row.design, row.p90_um))
        .collect();
    sources
        .criteria
        .iter()
        .filter(|row| row.feasible)
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
                Some((approach.name(), optimum_design(&sources.problem, row)?))
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
        subject: format!("pinion flank of the design of approach “{name}”{slopes}"),
        roll_angle_rad: roll,
        archard_um,
        random_um: profiles
            .iter()
            .map(|profile| micrometres(&profile.depth[0]))
            .collect(),
    })
}

fn kriging(sources: &Sources) -> Vec<KrigingFit> {
    let Some(model) = &sources.model else {
        return Vec::new();
    };
    let percentile = sources.problem.campaign().sampling.percentile_name();
    let parameter = |name: &str, value: f64, unit: &str| Parameter {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
    };
    let unit = &*sources.problem.sampled().unit;
    let squared = match unit {
        "" => String::new(),
        unit => format!("{unit}²"),
    };
    let mut parameters = vec![
        parameter("µ", model.mu_um, unit),
        parameter("σ²", model.sigma2_um2, &squared),
        parameter("−log likelihood", model.negative_log_likelihood, ""),
    ];
    let names = sources.problem.free_names();
    parameters.extend(names.zip(&model.ranges).map(|(name, range)| {
        parameter(&format!("range in {name}"), range.unwrap_or(f64::NAN), "")
    }));
    let observed: BTreeMap<u64, f64> = sources
        .responses
        .iter()
        .map(|row| (row.design, row.p90_um))
        .collect();
    let leave_one_out = model
        .residuals_um
        .iter()
        .enumerate()
        .filter_map(|(i, (design, residual))| {
            let observed_um = *observed.get(design)?;
            Some(LeaveOneOut {
                design: *design,
                standardised: model.standardised.get(i).copied(),
                observed_um,
                predicted_um: observed_um - residual,
            })
        })
        .collect();
    vec![KrigingFit {
        title: format!("{percentile} over {} designs", model.points),
        unit: unit.to_owned(),
        kernel: model.kernel.clone(),
        parameters,
        q2: model.q2,
        rmse_um: model.rmse_um,
        coverage_90: model.coverage90,
        warnings: model.warnings.clone(),
        leave_one_out,
    }]
}
