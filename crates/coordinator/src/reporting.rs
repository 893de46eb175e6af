//! From the store to the report.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use campaign::formulation::Problem;
use campaign::optimise::RunResult;
use campaign::{Approach, Campaign, Criteria, Variables};
use gear::Member;
use report::{
    ApproachResult, Constraints, DoePoint, GearDrawing, GearOutline, Header, InfeasibleReason,
    KrigingFit, LeaveOneOut, Limits, OptimiserRun, Optimum, Parameter, Percentile,
    PreliminaryDesign, PrintedDesign, PrintedFigures, ReportData, SimilarDesign, StageCost,
    SteCurves, WearProfiles, paper,
};
use stats::streams::{Purpose, stream};
use store::{CampaignRow, CriteriaRow, OptimiserRunRow, OptimumRow, ResponseRow, Store};

use crate::references::{Place, printed};
use crate::snapshot::{P90_MODEL, approach_of, optimum_variables};
use crate::steps;
use crate::steps::{ModelSummary, sampling_calls};

/// Points on each flank of a drawn gear.
const OUTLINE_POINTS: usize = 24;
/// Random wear profiles in Figure 2.
const WEAR_PROFILES: u64 = 10;

/// Writes `report.html` into the folder `out`, which is made if need be; returns its path.
///
/// # Errors
///
/// The store cannot be read or the file cannot be written.
pub async fn write(store: &Store, out: &Path) -> anyhow::Result<PathBuf> {
    let data = gather(store).await?;
    let html = report::render(&data)?;
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot make the folder {}", out.display()))?;
    let path = out.join("report.html");
    // Written beside and renamed, so that a report is never half one.
    let draft = out.join("report.html.part");
    std::fs::write(&draft, html)
        .and_then(|()| std::fs::rename(&draft, &path))
        .with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// Everything a report needs, read once.
struct Sources {
    campaign: CampaignRow,
    problem: Problem,
    criteria: Vec<CriteriaRow>,
    responses: Vec<ResponseRow>,
    optima: Vec<OptimumRow>,
    runs: Vec<OptimiserRunRow>,
    model: Option<ModelSummary>,
    /// Fresh samples by point.
    fresh: BTreeMap<String, Vec<f64>>,
}

/// Gathers the data of a report.
///
/// # Errors
///
/// The store cannot be read, or holds what this version cannot read.
pub async fn gather(store: &Store) -> anyhow::Result<ReportData> {
    let row = store.campaign().await?;
    let campaign = Campaign::parse("the store's campaign file", &row.file_text)?;
    let problem = Problem::new(campaign);
    let mut fresh = BTreeMap::new();
    let names = Approach::ALL
        .iter()
        .map(|approach| approach.name().to_owned())
        .chain(Place::all().map(Place::name));
    for name in names {
        let samples = store.verify_samples(&name).await?;
        fresh.insert(
            name,
            samples.iter().map(|sample| sample.delta_ste_um).collect(),
        );
    }
    let sources = Sources {
        campaign: row,
        criteria: store.criteria().await?,
        responses: store.responses().await?,
        optima: store.optima().await?,
        runs: store.optimiser_runs().await?,
        model: match store.model(P90_MODEL).await? {
            Some(row) => Some(serde_json::from_str(&row.summary_json)?),
            None => None,
        },
        fresh,
        problem,
    };
    let digest = store.samples_digest().await?;
    let times = store.job_times().await?;
    let compare = sources.problem.campaign().report.compare_with_paper;
    Ok(ReportData {
        header: header(&sources, digest, &times),
        compare_with_paper: compare,
        limits: limits(sources.problem.campaign()),
        preliminary: if compare {
            preliminary(&sources)
        } else {
            Vec::new()
        },
        doe: doe(&sources),
        similar: if compare {
            similar(&sources)
        } else {
            Vec::new()
        },
        wear: wear(&sources),
        kriging: kriging(&sources),
        approaches: approaches(&sources)?,
        printed: if compare {
            printed_designs(&sources)
        } else {
            Vec::new()
        },
        notes: notes(&sources, &store.failures().await?),
    })
}

fn header(sources: &Sources, samples_digest: String, times: &[store::JobTimeRow]) -> Header {
    let campaign = sources.problem.campaign();
    let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
    for reason in sources
        .criteria
        .iter()
        .filter_map(|row| row.reason.as_deref())
    {
        let code = reason.split(':').next().unwrap_or(reason);
        *reasons.entry(code).or_default() += 1;
    }
    let mut infeasible: Vec<InfeasibleReason> = reasons
        .into_iter()
        .map(|(reason, count)| InfeasibleReason {
            reason: reason.to_owned(),
            count,
        })
        .collect();
    infeasible.sort_by(|a, b| b.count.cmp(&a.count).then(a.reason.cmp(&b.reason)));

    let mut stages: BTreeMap<_, f64> = BTreeMap::new();
    for time in times {
        if let Some(kind) = campaign::plan::JobKind::of(time.job) {
            *stages.entry(kind).or_default() += time.cpu_seconds;
        }
    }
    let seconds = |kind| stages.get(&kind).copied().unwrap_or(0.0);
    use campaign::plan::JobKind::{Optimise, Sample, Verify};
    let fit = sources
        .model
        .as_ref()
        .map_or(0.0, |model| model.cpu_seconds);
    let sampling = sampling_calls(&sources.criteria, campaign.sampling.samples_per_design);
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
    Header {
        campaign: sources.campaign.name.clone(),
        seed: sources.campaign.seed,
        program_version: sources.campaign.program_version.clone(),
        samples_digest,
        designs: campaign.doe.designs as usize,
        samples_per_design: campaign.sampling.samples_per_design as usize,
        feasible: sources.criteria.iter().filter(|row| row.feasible).count(),
        infeasible,
        simulator_calls: sampling + optimising + verifying,
        stages: vec![
            stage("sample", seconds(Sample)),
            stage("fit", fit),
            stage("optimise", seconds(Optimise)),
            stage("verify", seconds(Verify)),
        ],
        facts: vec![
            ("tooth model".to_owned(), campaign.pair.tooth_model.clone()),
            (
                "wear".to_owned(),
                format!(
                    "{} µm per flank at the deepest point",
                    campaign.wear.max_depth_um
                ),
            ),
        ],
    }
}

fn limits(campaign: &Campaign) -> Limits {
    Limits {
        contact_ratio_min: campaign.constraints.contact_ratio_min,
        specific_slip_max: campaign.constraints.specific_sliding_max,
        von_mises_max_mpa: campaign.material.yield_mpa,
        pressure_max_mpa: campaign.material.hertz_limit_mpa,
    }
}

fn percentile(samples: &[f64]) -> Percentile {
    let nothing = Percentile {
        value_um: f64::NAN,
        low_um: f64::NAN,
        high_um: f64::NAN,
        samples: samples.len(),
    };
    let Ok(estimate) = stats::percentile_p90(samples) else {
        return nothing;
    };
    let (low_um, high_um) = stats::p90_interval(&estimate, 0.95).unwrap_or((f64::NAN, f64::NAN));
    Percentile {
        value_um: estimate.p90,
        low_um,
        high_um,
        samples: samples.len(),
    }
}

fn preliminary(sources: &Sources) -> Vec<PreliminaryDesign> {
    let k = sources.problem.campaign().sampling.samples_per_design as usize;
    paper::PRELIMINARY
        .iter()
        .enumerate()
        .filter_map(|(row, printed)| {
            let samples = sources.fresh.get(&Place::Preliminary(row).name())?;
            let response = steps::response(0, samples).ok()?;
            let variance = stats::p90_variance(response.sd_um.powi(2), k, stats::PAPER_Z90);
            Some(PreliminaryDesign {
                variables: printed.variables,
                samples: samples.len(),
                mean_um: response.mean_um,
                sd_um: response.sd_um,
                p90_um: response.p90_um,
                lilliefors_p: response.lilliefors_p.unwrap_or(f64::NAN),
                p90_variance_um2: variance.unwrap_or(f64::NAN),
            })
        })
        .collect()
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
        .map(|row| DoePoint {
            delta_ste_um: row.delta_ste_um.unwrap_or(f64::NAN),
            delta_ste_archard_um: row.delta_ste_archard_um.unwrap_or(f64::NAN),
            p90_um: percentiles.get(&row.design).copied().unwrap_or(f64::NAN),
        })
        .collect()
}

fn similar(sources: &Sources) -> Vec<SimilarDesign> {
    paper::SIMILAR
        .iter()
        .enumerate()
        .filter_map(|(row, printed)| {
            let place = Place::Similar(row);
            let pair = sources.problem.pair(&place.variables()).ok()?;
            Some(SimilarDesign {
                variables: printed.variables,
                delta_ste_archard_um: pair.archard(sources.problem.wear()).analysis.delta_ste_um,
                p90: percentile(sources.fresh.get(&place.name())?),
            })
        })
        .collect()
}

/// Figure 2 shows Archard's design, or else the first one there is.
fn wear(sources: &Sources) -> Option<WearProfiles> {
    let (name, variables) = [Approach::Archard, Approach::NoWear]
        .iter()
        .find_map(|approach| {
            let row = sources
                .optima
                .iter()
                .find(|row| row.approach == approach.name())?;
            Some((approach.name(), optimum_variables(row)?))
        })?;
    let pair = sources.problem.pair(&variables).ok()?;
    let wear = sources.problem.wear();
    let mut sampler = pair.sampler(wear);
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
    Some(WearProfiles {
        subject: format!("pinion flank of the design of approach “{name}”"),
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
    let parameter = |name: &str, value: f64, unit: &str| Parameter {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
    };
    let mut parameters = vec![
        parameter("µ", model.mu_um, "µm"),
        parameter("σ²", model.sigma2_um2, "µm²"),
        parameter("−log likelihood", model.negative_log_likelihood, ""),
    ];
    let names = ["x_p", "x_r", "ha0_p", "ha0_r", "hf0_p", "hf0_r"];
    parameters.extend(names.iter().zip(&model.ranges).map(|(name, range)| {
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
        .filter_map(|(design, residual)| {
            let observed_um = *observed.get(design)?;
            Some(LeaveOneOut {
                observed_um,
                predicted_um: observed_um - residual,
            })
        })
        .collect();
    vec![KrigingFit {
        title: format!("P90 over {} designs", model.points),
        kernel: model.kernel.clone(),
        parameters,
        q2: model.q2,
        rmse_um: model.rmse_um,
        coverage_90: model.coverage90,
        leave_one_out,
    }]
}

const fn report_approach(approach: Approach) -> report::Approach {
    match approach {
        Approach::NoWear => report::Approach::WithoutWear,
        Approach::Archard => report::Approach::ArchardWear,
        Approach::Kriging => report::Approach::Kriging,
        Approach::BestOfDoe => report::Approach::BestOfDoe,
    }
}

fn approaches(sources: &Sources) -> anyhow::Result<Vec<ApproachResult>> {
    Approach::ALL
        .iter()
        .filter_map(|approach| {
            sources
                .optima
                .iter()
                .find(|row| row.approach == approach.name())
        })
        .map(|row| {
            let approach = approach_of(&row.approach).context("an unknown approach")?;
            let criteria: Option<Criteria> = serde_json::from_str(&row.criteria_json)?;
            let outcome = match (optimum_variables(row), criteria) {
                (Some(variables), Some(criteria)) => {
                    Ok(optimum(sources, row, &variables, &criteria))
                }
                _ => Err(row.note.clone()),
            };
            Ok(ApproachResult {
                approach: report_approach(approach),
                note: if outcome.is_ok() {
                    row.note.clone()
                } else {
                    String::new()
                },
                outcome,
                simulator_calls: row.simulator_calls,
                cpu_seconds: row.cpu_seconds,
                runs: runs(sources, approach)?,
            })
        })
        .collect()
}

fn runs(sources: &Sources, approach: Approach) -> anyhow::Result<Vec<OptimiserRun>> {
    let restart_at = u64::from(sources.problem.campaign().optimise.restart_at);
    sources
        .runs
        .iter()
        .filter(|row| row.approach == approach.name())
        .map(|row| {
            let run: RunResult = serde_json::from_str(&row.result_json)?;
            let mut restarts: Vec<u64> = run.restarts.iter().map(|(at, _)| *at).collect();
            restarts.push(restart_at);
            restarts.sort_unstable();
            Ok(OptimiserRun {
                start: row.start as usize + 1,
                best: run.history,
                restarts,
            })
        })
        .collect()
}

fn optimum(
    sources: &Sources,
    row: &OptimumRow,
    variables: &Variables,
    criteria: &Criteria,
) -> Optimum {
    let samples = sources
        .fresh
        .get(&row.approach)
        .map_or(&[][..], Vec::as_slice);
    let pair = sources.problem.pair(variables).ok();
    Optimum {
        variables: variables.values(),
        criterion_um: row.criterion_um,
        p90: percentile(samples),
        constraints: Constraints {
            contact_ratio: criteria.contact_ratio,
            specific_slip: criteria.specific_sliding,
            von_mises_mpa: criteria.root_stress_mpa,
            pressure_mpa: criteria.hertz_pressure_mpa,
            interference_margin_mm: criteria
                .clearance_mm
                .iter()
                .chain(&criteria.flank_margin_mm)
                .copied()
                .fold(f64::INFINITY, f64::min),
        },
        feasible: row.feasible,
        drawing: pair.as_ref().map(drawing),
        ste: pair.as_ref().map(|pair| ste(sources, pair)),
    }
}

fn drawing(pair: &gear::Pair) -> GearDrawing {
    let geometry = pair.geometry();
    let placements = gear::mesh_placement(pair, 0.0);
    let teeth = geometry.teeth.map(f64::from);
    let outline = |member: Member| {
        let index = member.index();
        let points = gear::gear_outline(pair, member, OUTLINE_POINTS);
        GearOutline {
            outline: points
                .into_iter()
                .map(|point| placements[index].apply(point))
                .collect(),
            centre: placements[index].centre,
            pitch_radius_mm: Some(geometry.centre_distance * teeth[index] / (teeth[0] + teeth[1])),
            base_radius_mm: Some(geometry.r_b[index]),
        }
    };
    GearDrawing {
        pinion: outline(Member::Pinion),
        mate: outline(Member::Gear),
        line_of_action: Some(path_of_contact(geometry)),
    }
}

/// The ends of the path of contact, in the frame of [`gear::mesh_placement`]: pinion axis at the
/// origin, the mate's on the x axis.
fn path_of_contact(geometry: &gear::Geometry) -> [[f64; 2]; 2] {
    let (sin, cos) = geometry.alpha_wt.sin_cos();
    [geometry.s_in, geometry.s_out].map(|s| {
        [
            geometry.r_b[0] * cos + s * sin,
            geometry.r_b[0] * sin - s * cos,
        ]
    })
}

fn ste(sources: &Sources, pair: &gear::Pair) -> SteCurves {
    let unworn = pair.unworn();
    let worn = pair.archard(sources.problem.wear()).analysis;
    // The curve is periodic: its first point again closes the period in the chart.
    let closed = |values: Vec<f64>, end: Option<f64>| -> Vec<f64> {
        let end = end.or_else(|| values.first().copied());
        values.into_iter().chain(end).collect()
    };
    SteCurves {
        phase: closed(unworn.phases, Some(1.0)),
        unworn_um: closed(unworn.ste_um, None),
        worn_um: closed(worn.ste_um, None),
    }
}

fn printed_designs(sources: &Sources) -> Vec<PrintedDesign> {
    (6..=10)
        .map(|figure| PrintedDesign {
            figure,
            outcome: printed_figures(sources, figure),
        })
        .collect()
}

fn printed_figures(sources: &Sources, figure: u8) -> Result<PrintedFigures, String> {
    let pair = sources
        .problem
        .pair(&printed(figure))
        .map_err(|error| error.to_string())?;
    let unworn = pair.unworn();
    let worn = pair.archard(sources.problem.wear()).analysis;
    // Figures 6 and 7 are designs of the problem without wear, the others of problems with it.
    let analysis = if figure <= 7 { &unworn } else { &worn };
    let criteria = sources.problem.criteria(&pair, analysis.hertz_pressure_mpa);
    let samples = match figure {
        6 => &[][..],
        _ => sources
            .fresh
            .get(&Place::Figure(figure).name())
            .map_or(&[][..], Vec::as_slice),
    };
    let p90 = percentile(samples);
    let criterion_um = match figure {
        6 | 7 => unworn.delta_ste_um,
        9 => worn.delta_ste_um,
        // The captions give a kriging prediction and an estimate from 30 samples; the model's
        // figure beside them is its own accurate percentile.
        _ => p90.value_um,
    };
    let notched = pair.root_stress().iter().any(|root| !root.in_range);
    let mut von_mises = report::ModelFigure::from(criteria.root_stress_mpa);
    if notched {
        von_mises.note =
            "The notch factor’s formula is outside its range (1 to 8) here.".to_owned();
    }
    Ok(PrintedFigures {
        contact_ratio: criteria.contact_ratio.into(),
        specific_slip: criteria.specific_sliding.into(),
        von_mises_mpa: von_mises,
        pressure_mpa: criteria.hertz_pressure_mpa.into(),
        criterion_um: criterion_um.into(),
        p90_um: p90.value_um.into(),
    })
}

fn notes(sources: &Sources, failures: &[store::FailureRow]) -> Vec<String> {
    let campaign = sources.problem.campaign();
    let mut notes = campaign.warnings();
    if let Some(model) = &sources.model {
        notes.extend(
            model
                .warnings
                .iter()
                .map(|warning| format!("Kriging: {warning}.")),
        );
    }
    notes.extend(pointed_tips(sources));
    let panics = |name: &str| {
        sources
            .criteria
            .iter()
            .filter(|row| {
                row.reason
                    .as_deref()
                    .is_some_and(|reason| reason.starts_with(name))
            })
            .count()
    };
    for (name, what) in [
        (campaign::task::SIMULATOR_PANIC, "made the simulator panic"),
        (
            campaign::task::NOT_A_NUMBER,
            "gave results that are no numbers",
        ),
    ] {
        let count = panics(name);
        if count > 0 {
            notes.push(format!(
                "{count} designs {what}; they are recorded as infeasible."
            ));
        }
    }
    let mut given_up: Vec<&str> = failures
        .iter()
        .filter(|row| row.kind == store::FailureKind::Quarantine)
        .map(|row| row.job.as_str())
        .collect();
    given_up.dedup();
    if !given_up.is_empty() {
        notes.push(format!("Jobs that were given up: {}.", given_up.join(", ")));
    }
    notes.push(
        "The contact pressure of approach 1 is that of unworn flanks; the designs of the problems \
         with wear are judged by the pressure on flanks with Archard’s wear."
            .to_owned(),
    );
    notes.push(
        "The model leaves out dynamics, friction, misalignment, pitch errors and the elastic \
         coupling of neighbouring slices; its compliance has no gear body."
            .to_owned(),
    );
    notes
}

/// Names optima whose teeth have no tip land left: no constraint of the paper asks for one, and
/// the slenderness of such tips makes their ΔSTE depend on how the beam model ends.
fn pointed_tips(sources: &Sources) -> Vec<String> {
    let mut notes = Vec::new();
    for row in &sources.optima {
        let Some(pair) =
            optimum_variables(row).and_then(|variables| sources.problem.pair(&variables).ok())
        else {
            continue;
        };
        let pointed = pair.geometry().pointed;
        let who = match pointed {
            [false, false] => continue,
            [true, false] => "The pinion of",
            [false, true] => "The mate of",
            [true, true] => "Both gears of",
        };
        notes.push(format!(
            "{who} the optimum “{}” has pointed teeth: the constraints ask for no tip land. Its \
             ΔSTE rests on where the beam model ends a tooth that thins to nothing; shortened to a \
             usual tip land, such a pair loses much of what it gained.",
            row.approach
        ));
    }
    notes
}
