//! A few calls of an external program, to learn what they cost.

use std::time::{Duration, Instant};

use problem::formulation::Problem;
use problem::simulator::{NoAnswer, Simulator, State};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};
use tokio::sync::watch;

use super::{Ability, Backend, Exec};
use crate::worker::Error;

/// Number of random designs tried.
const DESIGNS: u64 = 4;

/// Time after which a failed design ends the trial: the user waits, and the next one may take as long.
const LONG: Duration = Duration::from_secs(5);

/// The cost of a few calls of a program.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trial {
    /// Designs tried.
    pub designs: u64,
    /// The reasons of those that the program refused.
    pub refused: Vec<String>,
    /// The errors of those whose evaluation or sampling failed.
    pub failed: Vec<String>,
    /// Number of samples tried.
    pub samples: usize,
    /// Number of those that the program marked as failed by NaN.
    pub failed_samples: usize,
    /// Whether the two samples of each design were equal, although they have different random numbers.
    pub ignores_random_numbers: bool,
    /// Median time of an evaluation, in seconds.
    pub evaluation_seconds: f64,
    /// Median time of a sample, in seconds; NaN if no design was sampled.
    pub sample_seconds: f64,
}

/// Evaluates and samples a few random designs. Each is sampled twice, as a program may prepare a design first. As in a
/// campaign, the next design is tried if one fails, unless that takes long.
///
/// # Errors
///
/// The program failed for every design that it did not refuse, or cannot be run.
pub fn trial(problem: &Problem, exec: &Exec) -> Result<Trial, Error> {
    let (ability, _) = watch::channel(Ability::default());
    let backend = Backend::choose(problem, Some(exec), ability)?;
    let (tried, _) = backend.with(problem, |simulator| try_designs(problem, simulator));
    backend.stop();
    tried.map_err(|why| match why {
        NoAnswer::Machine(reason) => Error::Machine { reason },
        NoAnswer::Failed(reason) | NoAnswer::Refused(reason) => Error::Program { reason },
    })
}

fn try_designs(problem: &Problem, simulator: &dyn Simulator) -> Result<Trial, NoAnswer> {
    let (mut trial, mut evaluations, mut samples) = (Trial::default(), Vec::new(), Vec::new());
    let (mut pairs, mut equal_pairs) = (0, 0);
    for number in 0..DESIGNS {
        trial.designs += 1;
        let since = Instant::now();
        let mut rng = stream(problem.campaign().seed, Purpose::Test, number, 1);
        let unit: Vec<f64> = (0..problem.dimension()).map(|_| rng.random()).collect();
        let design = problem.design(&problem.free_point(&unit), problem.base());
        let mut try_design = || -> Result<(), NoAnswer> {
            let mut prepared = simulator.prepare(&design)?;
            // The first call waits for the program to start.
            let since = Instant::now();
            let evaluated = prepared.analyse(State::Baseline);
            if let Ok(_) | Err(NoAnswer::Refused(_)) = evaluated {
                evaluations.push(since.elapsed().as_secs_f64());
            }
            let checked = problem.check_analysis(&evaluated?);
            checked.map_err(NoAnswer::Failed)?;
            let mut last = None;
            for _ in 0..2 {
                let since = Instant::now();
                let sample = problem.sample_of(prepared.sample(&mut rng)?);
                samples.push(since.elapsed().as_secs_f64());
                let checked = problem.check_sample(&sample);
                checked
                    .map_err(|(name, why)| NoAnswer::Failed(format!("{name} of a sample {why}")))?;
                if problem.is_failed_sample(&sample) {
                    trial.failed_samples += 1;
                    continue;
                }
                if let Some(last) = last.replace(sample.clone()) {
                    pairs += 1;
                    equal_pairs += usize::from(last == sample);
                }
            }
            Ok(())
        };
        match try_design() {
            Ok(()) => {}
            Err(NoAnswer::Refused(reason)) => trial.refused.push(reason),
            Err(NoAnswer::Failed(reason)) => {
                trial.failed.push(reason);
                if since.elapsed() > LONG {
                    break;
                }
            }
            Err(machine @ NoAnswer::Machine(_)) => return Err(machine),
        }
    }
    let answered = trial.designs as usize - trial.failed.len();
    if !trial.failed.is_empty() && answered == trial.refused.len() {
        // The first design may have failed for a reason of its own.
        let mut reasons = trial.failed;
        reasons.dedup_by(|next, one| next.lines().next() == one.lines().next());
        reasons.truncate(2);
        return Err(NoAnswer::Failed(reasons.join("\nand for another design: ")));
    }
    Ok(Trial {
        samples: samples.len(),
        ignores_random_numbers: pairs > 0 && pairs == equal_pairs,
        evaluation_seconds: median(evaluations),
        sample_seconds: median(samples),
        ..trial
    })
}

/// The median; NaN without numbers.
fn median(mut seconds: Vec<f64>) -> f64 {
    seconds.sort_by(f64::total_cmp);
    seconds.get(seconds.len() / 2).copied().unwrap_or(f64::NAN)
}
