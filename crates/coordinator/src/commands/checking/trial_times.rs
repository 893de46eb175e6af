//! Trial runs: the times of a campaign's work on this machine, and how many random designs get samples.

use std::collections::BTreeMap;

use anyhow::Context as _;
use ledger::{Generation, StreamId, Unit};
use problem::formulation::{Analysis, Constraint, Problem};
use problem::simulator::State;
use problem::task::{self, Output, Run, Source};
use problem::{Approach, optimise};
use rand::RngExt as _;
use runner::cpu::thread_seconds;
use runner::worker::Trial;
use serde::Serialize;
use stages::calls;
use stages::stage::Stage;
use stats::streams::{Purpose, stream};

/// Times on one processor of this machine, measured with a few designs of the campaign.
#[derive(Clone)]
pub(super) struct TrialTimes {
    /// The share of random designs that get samples: simulable ones that are not ruled out.
    pub(super) sampled: f64,
    /// The most frequent reason why designs get no samples, in the words of the first such design; empty if all get
    /// some.
    pub(super) reason: String,
    /// The feasible designs among the random ones; `None` for an external program, which is called for few designs.
    pub(super) feasible: Option<Feasible>,
    /// Time of a design's criteria and two deterministic analyses, in seconds.
    pub(super) design_seconds: f64,
    /// Time of a sample of ΔSTE, in seconds.
    pub(super) sample_seconds: f64,
    /// Time of one run of every optimised approach, in seconds.
    pub(super) run_seconds: f64,
}

impl TrialTimes {
    /// The times of an external program. A call takes all the processors that the campaign states.
    pub(super) fn of(trial: &Trial, problem: &Problem) -> Self {
        let campaign = problem.campaign();
        let processors = f64::from(campaign.simulator.processors.unwrap_or(1));
        let design_seconds = processors * trial.evaluation_seconds;
        let sample_seconds = processors * trial.sample_seconds;
        let planned = calls::planned(problem);
        let search = planned.iter().find(|calls| calls.stage == Stage::Optimise);
        let of_search = search.map_or(0.0, |calls| {
            calls.evaluations as f64 * design_seconds + calls.samples as f64 * sample_seconds
        });
        Self {
            // The share among a few designs says little.
            sampled: 1.0,
            reason: String::new(),
            feasible: None,
            design_seconds,
            sample_seconds,
            run_seconds: of_search / f64::from(campaign.optimise.starts),
        }
    }
}

/// Number of random designs tried.
pub(super) const DESIGNS: u32 = 40;

/// Measures with [`DESIGNS`] random designs and short runs of the optimisers.
pub(super) fn measure(problem: &Problem) -> anyhow::Result<TrialTimes> {
    let mut seconds = [0.0; 2];
    let mut sampled = 0.0_f64;
    // Number of designs and the whole reason of the first one, by the short name of the reason.
    let mut reasons: BTreeMap<String, (u32, String)> = BTreeMap::new();
    let mut trials = Vec::new();
    let samples = [4, 44];
    for (pass, count) in samples.into_iter().enumerate() {
        sampled = 0.0;
        trials.clear();
        // CPU time, so that other programs on the machine do not count.
        let before = thread_seconds();
        for number in 0..DESIGNS {
            let mut rng = stream(problem.campaign().seed, Purpose::Test, u64::from(number), 1);
            let place: Vec<f64> = (0..problem.dimension()).map(|_| rng.random()).collect();
            let unit = Unit {
                stream: StreamId::design(number),
                generation: Generation::default(),
                samples: 0..count,
            };
            let design = problem.design(&problem.free_point(&place), problem.base());
            let output = task::compute(problem, &unit, &Source::Design(design.clone()))
                .map_err(anyhow::Error::msg)
                .context("a trial run")?;
            let reason = match output {
                Output::Design {
                    ruled_out,
                    responses,
                    ..
                } => {
                    trials.extend(problem.analysis(&design, &responses, State::Baseline));
                    ruled_out
                }
                Output::Refused(reason) => Some(reason),
                _ => None,
            };
            let Some(reason) = reason else {
                sampled += 1.0;
                continue;
            };
            // After the colon, a reason has the numbers of its own design.
            let name = reason.split(':').next().unwrap_or_default().to_owned();
            reasons.entry(name).or_insert((0, reason)).0 += 1;
        }
        seconds[pass] = thread_seconds() - before;
    }
    let drawn = sampled.max(1.0) * f64::from(samples[1] - samples[0]);
    let sample_seconds = ((seconds[1] - seconds[0]) / drawn).max(0.0);
    let without_samples = seconds[0] - sampled * f64::from(samples[0]) * sample_seconds;
    Ok(TrialTimes {
        sampled: sampled / f64::from(DESIGNS),
        reason: reasons
            .into_iter()
            .max_by_key(|(_, (count, _))| *count)
            .map_or_else(String::new, |(_, (_, reason))| reason),
        feasible: Some(feasible(problem, &trials)),
        design_seconds: (without_samples / f64::from(DESIGNS)).max(0.0),
        sample_seconds,
        run_seconds: measure_runs(problem)?,
    })
}

/// Counts the feasible designs among [`DESIGNS`] random ones; `trials` are the analyses of those that can be
/// simulated.
fn feasible(problem: &Problem, trials: &[Analysis]) -> Feasible {
    let mut count = 0;
    // Number of designs that break a constraint and the mildest violation, by the name of the constraint.
    let mut broken: BTreeMap<String, (u32, Constraint)> = BTreeMap::new();
    for analysis in trials {
        count += u32::from(problem.is_feasible(&analysis.criteria));
        let constraints = problem.constraints(&analysis.criteria).into_iter();
        for constraint in constraints.filter(|constraint| !constraint.holds()) {
            let (designs, mildest) = broken
                .entry(constraint.name.to_string())
                .or_insert_with(|| (0, constraint.clone()));
            *designs += 1;
            if constraint.excess < mildest.excess {
                *mildest = constraint;
            }
        }
    }
    let worst = broken.into_values().max_by_key(|(designs, _)| *designs);
    // If the designs break different constraints, a search may still find one that breaks none.
    let by_all = worst.filter(|(designs, _)| *designs as usize == trials.len());
    let warning = by_all.map(|(designs, mildest)| {
        format!(
            "all {designs} random designs that can be simulated break the same constraint, the mildest of them with \
             {mildest}: if the search finds no feasible design, change [constraints], [pair] or [load], or widen \
             [bounds]"
        )
    });
    Feasible {
        count,
        designs: DESIGNS,
        warning,
    }
}

/// Maximum number of evaluations in a trial run.
const EVALUATIONS: u32 = 80;

/// Estimates the time of one run of every optimised approach by a short run of each. A search
/// reaches designs that cost more than random ones, many of which are refused at once. The kriging
/// model does not exist yet; it costs little beside the constraints, which are those with Archard's
/// wear.
fn measure_runs(problem: &Problem) -> anyhow::Result<f64> {
    let mut campaign = problem.campaign().clone();
    let evaluations = campaign.optimise.evaluations;
    campaign.optimise.evaluations = evaluations.min(EVALUATIONS);
    let restart_at = &mut campaign.optimise.restart_at;
    *restart_at = restart_at.map(|at| at.min(EVALUATIONS / 2));
    let short = Problem::new(campaign);
    let mut seconds = 0.0;
    for approach in problem.approaches() {
        let approach = match approach {
            Approach::Nominal | Approach::Baseline | Approach::Direct => approach,
            Approach::Kriging => Approach::Baseline,
            Approach::BestOfDoe | Approach::EnrichedKriging => continue,
        };
        let run = Run {
            approach,
            start: 0,
            base: short.base().clone(),
            models: Vec::new(),
            from: None,
        };
        let before = thread_seconds();
        let result = optimise::trial(&short, &run)
            .map_err(anyhow::Error::msg)
            .context("a trial run of the optimiser")?;
        let each = (thread_seconds() - before) / result.evaluations.max(1) as f64;
        seconds += each * f64::from(evaluations);
    }
    Ok(seconds)
}

/// The number of feasible designs among random ones.
#[derive(Clone, Serialize)]
pub(super) struct Feasible {
    pub(super) count: u32,
    /// Number of designs tried.
    pub(super) designs: u32,
    /// A warning that names the constraint that all simulable designs break, if there is one.
    #[serde(skip)]
    pub(super) warning: Option<String>,
}
