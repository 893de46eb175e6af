//! `check`: the plan of a campaign, with its time on this machine.

use anyhow::Context as _;
use problem::Campaign;
use problem::accuracy::CampaignFile;
use problem::formulation::Problem;
use results::number::duration;
use results::table::VersionedObject;
use runner::exit::{self, ProgramError};
use runner::worker::{Trial, trial};
use serde::Serialize;
use stages::calls::{self, Calls};
use stages::references;
use stages::stage::Stage;

use super::{campaign_file, folder_of, print_either};
use crate::arguments;

mod trial_times;

use trial_times::{DESIGNS, Feasible, TrialTimes, measure};

/// The plan of a campaign.
#[derive(Serialize)]
struct Plan {
    file: String,
    campaign: String,
    seed: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    teeth: Option<[u32; 2]>,
    /// The random quantities besides the wear, and those left out, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    manufacture: Option<String>,
    /// The choice made by `[accuracy] tolerance_um`, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    accuracy: Option<String>,
    /// The stages in order.
    stages: Vec<StagePlan>,
    /// The sum of the stages' estimates, if there are any.
    core_seconds: Option<f64>,
    /// The reason why no design would get samples, if none of the tried ones would.
    #[serde(skip_serializing_if = "Option::is_none")]
    nothing_to_sample: Option<String>,
    /// The feasible ones among the tried random designs, if the built-in model simulates.
    #[serde(skip_serializing_if = "Option::is_none")]
    feasible: Option<Feasible>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct StagePlan {
    stage: Stage,
    /// The work of the stage, in words.
    work: String,
    /// Calls of an external program, at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    evaluations: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    samples: Option<u64>,
    /// Time on one processor of this machine, in seconds; `None` for an external program without a command to try.
    core_seconds: Option<f64>,
}

/// `coordinator check`: validates a campaign file and says what it would do.
pub(super) fn check(arguments: &arguments::Check) -> Result<u8, ProgramError> {
    let file = arguments.campaign.display().to_string();
    let CampaignFile {
        campaign, choice, ..
    } = campaign_file(&arguments.campaign)?;
    let problem = Problem::new(campaign.clone());
    let n = u64::from(campaign.doe.designs);
    let k = u64::from(campaign.sampling.samples_per_design);
    let evaluations = u64::from(campaign.optimise.evaluations);
    let points = references::points(&problem).len() as u64 + problem.approaches().count() as u64;
    let verify = u64::from(campaign.verify.first());
    let exec = arguments
        .simulator
        .exec_or(&campaign.simulator, folder_of(Some(&arguments.campaign)));
    let trial = match (campaign.is_external(), &exec) {
        (true, Some(exec)) => Some(trial(&problem, exec)?),
        _ => None,
    };
    let measured = match &trial {
        Some(trial) => Some(TrialTimes::of(trial, &problem)),
        None if campaign.is_external() => None,
        None => {
            // A doubt about the file may be the cause.
            let doubts = campaign.warnings().join("; ");
            let measured = measure(&problem);
            Some(match doubts.is_empty() {
                true => measured?,
                false => measured.with_context(|| doubts)?,
            })
        }
    };
    let TrialTimes {
        sampled,
        design_seconds,
        sample_seconds,
        run_seconds,
        ..
    } = measured.clone().unwrap_or(TrialTimes {
        sampled: 1.0,
        reason: String::new(),
        feasible: None,
        design_seconds: f64::NAN,
        sample_seconds: f64::NAN,
        run_seconds: f64::NAN,
    });

    let sampled = n as f64 * sampled;
    let known = calls::known(&problem, (0..n).map(|design| (design, k)));
    let drawn = (sampled * k as f64 - known as f64).max(0.0);
    let sampling = n as f64 * design_seconds + drawn * sample_seconds;
    let runs = problem.optimiser_runs();
    let optimising = f64::from(campaign.optimise.starts) * run_seconds;
    let verifying = (points * verify) as f64 * sample_seconds;
    // Measured with the paper's campaign: 6 s of search for its DoE, whose budget grows with the
    // number of variables and with the number of points plus 320 (`doe::maximin`), and 10 s of a
    // fit whose time is cubic in the points.
    let making = match campaign.doe.method {
        doe::Method::Maximin if problem.dimension() > 1 => {
            6.0 * (n as f64 + 320.0) / 3320.0 * problem.dimension() as f64 / 6.0
        }
        _ => 0.0,
    };
    let fitting = 10.0 * (sampled / 3000.0).powi(3);
    let mut rows = vec![
        (
            Stage::Doe,
            format!("{n} points, {}", campaign.doe.method),
            making,
        ),
        (
            Stage::Sample,
            match campaign.sampling.precision {
                None if known > 0 => format!(
                    "{n} designs, at most {} samples, {known} of them known",
                    n * k
                ),
                None => format!("{n} designs, at most {} samples", n * k),
                Some(precision) => format!(
                    "{n} designs, from {k} to {} samples, for {}",
                    campaign.sampling.samples_max(),
                    format!("{precision} {}", problem.measured().unit).trim_end()
                ),
            },
            sampling,
        ),
        (
            Stage::Fit,
            if measured.is_some() {
                format!("about {sampled:.0} designs that get samples")
            } else {
                format!("at most {n} designs")
            },
            fitting,
        ),
        (
            Stage::Optimise,
            match problem.modelled() {
                [] => format!("{runs} runs, {} analyses", runs * evaluations),
                _ => format!("{runs} runs, at most {} evaluations", runs * evaluations),
            },
            optimising,
        ),
        (
            Stage::Verify,
            match campaign.verify.half_width {
                None => format!("{points} designs, {} samples", points * verify),
                Some(half_width) => format!(
                    "{points} designs, from {verify} samples each, for a 95 % interval of ±{} %",
                    100.0 * half_width
                ),
            },
            verifying,
        ),
    ];
    if let Some(section) = &campaign.enrichment {
        let left = (f64::from(section.samples) - sampled * k as f64).max(0.0);
        let points = left / f64::from(section.samples_per_point);
        let what = format!(
            "at most {} rounds of {} points, {} samples with the DoE's",
            section.rounds, section.points_per_round, section.samples
        );
        // The time to choose a point, models included, measured with the shipped campaign.
        let seconds = left * sample_seconds + 0.05 * points;
        rows.insert(4, (Stage::Enrich, what, seconds));
    }
    let planned = match campaign.is_external() {
        true => calls::planned(&problem),
        false => Vec::new(),
    };
    let stage = |(stage, work, seconds): (Stage, String, f64)| {
        let calls = planned.iter().find(|calls| calls.stage == stage);
        StagePlan {
            stage,
            work,
            evaluations: calls.map(|calls| calls.evaluations),
            samples: calls.map(|calls| calls.samples),
            core_seconds: measured.is_some().then_some(seconds),
        }
    };
    let stages: Vec<StagePlan> = rows.into_iter().map(stage).collect();
    let feasible = measured
        .as_ref()
        .filter(|measured| measured.sampled > 0.0)
        .and_then(|measured| measured.feasible.clone());
    let of_trial = trial.map_or_else(Vec::new, |trial| trial_warnings(&trial));
    let beyond = beyond_one_store((n * k + points * verify) as f64);
    let plan = Plan {
        file,
        campaign: campaign.name.clone(),
        seed: campaign.seed,
        teeth: campaign.gears().map(|sections| sections.pair.teeth()),
        manufacture: campaign
            .gears()
            .and_then(|sections| sections.manufacture)
            .map(|manufacture| manufacture.describe()),
        accuracy: choice.map(|choice| choice.to_string()),
        core_seconds: stages.iter().map(|stage| stage.core_seconds).sum(),
        stages,
        nothing_to_sample: measured
            .filter(|measured| measured.sampled == 0.0)
            .map(|measured| measured.reason),
        warnings: campaign
            .warnings()
            .into_iter()
            .chain(beyond)
            .chain(over_budget(&campaign, &planned))
            .chain(of_trial)
            .chain(feasible.as_ref().and_then(|tried| tried.warning.clone()))
            .collect(),
        feasible,
    };
    print_either(arguments.json, &VersionedObject::new(&plan), || {
        describe(&plan)
    })?;
    Ok(match plan.nothing_to_sample {
        None => exit::OK,
        Some(_) => exit::NOT_SIMULABLE,
    })
}

/// A warning about a plan that needs more calls than its budget, with the keys that change them.
fn over_budget(campaign: &Campaign, planned: &[Calls]) -> Option<String> {
    let budget = campaign.budget.calls?;
    let all: u64 = planned.iter().map(Calls::count).sum();
    let most = planned.iter().max_by_key(|calls| calls.count())?;
    let key = match most.stage {
        Stage::Optimise => "optimise.evaluations or the number of approaches",
        Stage::Enrich => "enrichment.samples",
        Stage::Verify => "verify.samples",
        _ => "doe.designs or sampling.samples_per_design",
    };
    (all > budget).then(|| {
        format!(
            "budget.calls is {budget}, and the plan has up to {all} calls of the program: the campaign may end without \
             its optima. The stage {} needs most of them ({}); reduce {key}",
            most.stage,
            most.count()
        )
    })
}

/// Warnings about designs of the trial that the program refused or failed, and about failed samples.
fn trial_warnings(trial: &Trial) -> Vec<String> {
    let designs = trial.designs;
    let refused = trial.refused.first().map(|first| {
        format!(
            "the program refused {} of {designs} random designs, the first because of {first}",
            trial.refused.len()
        )
    });
    let failed = trial.failed.first().map(|first| {
        format!(
            "the program failed for {} of {designs} random designs, which a campaign would try simulator.attempts times \
             each; the first error: {}",
            trial.failed.len(),
            first.lines().next().unwrap_or_default()
        )
    });
    let samples = (trial.failed_samples > 0).then(|| {
        format!(
            "{} of {} samples have a value that is not a finite number and count as failed",
            trial.failed_samples, trial.samples
        )
    });
    let equal = trial.ignores_random_numbers.then(|| {
        "two samples of each design are equal: unless nothing is random, the program ignores its seed or its random inputs"
            .to_owned()
    });
    let warnings = [refused, failed, samples, equal];
    warnings.into_iter().flatten().collect()
}

/// Samples that one store holds well: a store of 10⁸ opens in seconds (`load -- large`), and the time grows in
/// proportion.
const STORED: f64 = 1e9;

/// A warning about a campaign with more samples than one coordinator and its store hold well, with the remedies.
fn beyond_one_store(samples: f64) -> Option<String> {
    (samples > STORED).then(|| {
        format!(
            "the campaign has up to {samples:.1e} samples, and one coordinator with its store holds about \
             {STORED:.0e}: use sampling.control = \"linearised\" or sampling.precision, which need fewer samples, or \
             split the bounds among several campaigns"
        )
    })
}

/// Describes the plan in words.
fn describe(plan: &Plan) -> String {
    let verdict = match &plan.nothing_to_sample {
        None => "is valid".to_owned(),
        Some(_) => "has no design to sample".to_owned(),
    };
    let mut text = format!(
        "{} {verdict}: campaign {}, seed {}{}\n\n",
        plan.file,
        plan.campaign,
        plan.seed,
        plan.teeth
            .map_or_else(String::new, |[pinion, mate]| format!(
                ", {pinion} and {mate} teeth"
            ))
    );
    if let Some(reason) = &plan.nothing_to_sample {
        text += &format!(
            "No random design of {DESIGNS} gets samples, most often because of {reason}. Change what this \
             names in [pair], [constraints] or [bounds].\n\n"
        );
    }
    for StagePlan {
        stage,
        work,
        core_seconds,
        ..
    } in &plan.stages
    {
        text += &match core_seconds {
            Some(seconds) => format!("{stage:<10}{work:<55}{seconds:>8.1} core-seconds\n"),
            None => format!("{stage:<10}{work}\n"),
        };
    }
    text += &match plan.core_seconds {
        Some(total) => format!("{:<65}{total:>8.1} core-seconds (estimated)\n", "all"),
        None => {
            "\nWith --exec, or [simulator] command in the file, a few trial calls estimate the time of the program.\n"
                .to_owned()
        }
    };
    let sum = |of: fn(&StagePlan) -> Option<u64>| plan.stages.iter().filter_map(of).sum::<u64>();
    let (evaluations, samples) = (sum(|one| one.evaluations), sum(|one| one.samples));
    if evaluations + samples > 0 {
        text += &format!(
            "\nThe program is called at most {} times: {evaluations} evaluations and {samples} samples.\n",
            evaluations + samples
        );
    }
    if let (true, Some(seconds)) = (samples > 0, plan.core_seconds) {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        text += &format!(
            "That is about {} on the {processors} processors of this machine.\n",
            duration(seconds / processors as f64)
        );
    }
    for note in [&plan.accuracy, &plan.manufacture].into_iter().flatten() {
        text += &format!("\n{note}\n");
    }
    if let Some(Feasible { count, designs, .. }) = &plan.feasible {
        text += &format!("\n{count} of {designs} random designs are feasible.\n");
    }
    for warning in &plan.warnings {
        text += &format!("\nwarning: {warning}\n");
    }
    text
}
