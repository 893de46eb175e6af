//! A few calls of an external program, to learn what they cost.

use std::time::Instant;

use problem::formulation::Problem;
use problem::simulator::{NoAnswer, Simulator, State};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};
use tokio::sync::watch;

use super::{Ability, Backend, Exec};
use crate::worker::Error;

/// Number of random designs tried.
const DESIGNS: u64 = 4;

/// The cost of a few calls of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Designs tried.
    pub designs: u64,
    /// The reasons of those that the program refused.
    pub refused: Vec<String>,
    /// Median time of an evaluation, in seconds.
    pub evaluation_seconds: f64,
    /// Median time of a sample, in seconds; NaN if every design was refused.
    pub sample_seconds: f64,
}

/// Evaluates and samples a few random designs. Each is sampled twice, as a program may prepare a design first.
///
/// # Errors
///
/// The program failed, gave numbers that cannot be samples, or cannot be run.
pub fn trial(problem: &Problem, exec: &Exec) -> Result<Trial, Error> {
    let (ability, _) = watch::channel(Ability::default());
    let backend = Backend::choose(problem, Some(exec), ability)?;
    let (tried, _) = backend.with(problem, |simulator| try_calls(problem, simulator));
    backend.stop();
    tried.map_err(|why| match why {
        NoAnswer::Machine(reason) => Error::Machine { reason },
        NoAnswer::Failed(reason) | NoAnswer::Refused(reason) => Error::Program { reason },
    })
}

fn try_calls(problem: &Problem, simulator: &dyn Simulator) -> Result<Trial, NoAnswer> {
    let (mut refused, mut evaluations, mut samples) = (Vec::new(), Vec::new(), Vec::new());
    for number in 0..DESIGNS {
        let mut rng = stream(problem.campaign().seed, Purpose::Test, number, 1);
        let unit: Vec<f64> = (0..problem.dimension()).map(|_| rng.random()).collect();
        let design = problem.design(&problem.free_point(&unit), problem.base());
        let mut prepared = simulator.prepare(&design)?;
        // The first call waits for the program to start.
        let since = Instant::now();
        let evaluated = prepared.analyse(State::Baseline);
        let seconds = since.elapsed().as_secs_f64();
        match evaluated {
            Ok(_) => evaluations.push(seconds),
            Err(NoAnswer::Refused(reason)) => {
                refused.push(reason);
                evaluations.push(seconds);
                continue;
            }
            Err(why) => return Err(why),
        }
        for _ in 0..2 {
            let since = Instant::now();
            let sample = problem.sample_of(prepared.sample(&mut rng)?);
            samples.push(since.elapsed().as_secs_f64());
            let checked = problem.check_sample(&sample);
            checked.map_err(|(name, why)| NoAnswer::Failed(format!("{name} of a sample {why}")))?;
        }
    }
    Ok(Trial {
        designs: DESIGNS,
        refused,
        evaluation_seconds: median(evaluations),
        sample_seconds: median(samples),
    })
}

/// The median; NaN without numbers.
fn median(mut seconds: Vec<f64>) -> f64 {
    seconds.sort_by(f64::total_cmp);
    seconds.get(seconds.len() / 2).copied().unwrap_or(f64::NAN)
}
