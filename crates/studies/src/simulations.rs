//! The interface between a study and the workers.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::ScopedJoinHandle;

use anyhow::Context as _;
use campaign::formulation::Problem;
use campaign::optimise::RunResult;
use campaign::simulator::State;
use campaign::task::{Output, Run, Source, compute};
use campaign::{GearCriteria, Variant};
use ledger::{Generation, StreamId, Unit};

/// Samples of a variant that a study asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The variant.
    pub variant: Variant,
    /// The indices of its samples.
    pub samples: Range<u32>,
}

/// The simulator's answer for a variant.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// The variant cannot be simulated, for this reason.
    Refused(String),
    /// The variant was simulated.
    Simulated {
        /// Criteria of the variant, with the contact pressure under Archard's wear.
        criteria: GearCriteria,
        /// ΔSTE of the samples asked for, µm; empty for a variant that breaks a constraint, if only
        /// feasible variants are to be sampled.
        samples: Vec<f64>,
    },
}

/// The workers of a study. Calls block until all answers are in; several threads may call at once.
pub trait Simulations: Sync {
    /// Simulates variants; the answers are in their order.
    ///
    /// # Errors
    ///
    /// The simulator failed repeatedly, or the study was stopped.
    fn simulate(&self, requests: &[Request]) -> anyhow::Result<Vec<Answer>>;

    /// Runs optimisers; the results are in the order of the runs.
    ///
    /// # Errors
    ///
    /// As [`simulate`](Self::simulate).
    fn optimise(&self, runs: Vec<Run>) -> anyhow::Result<Vec<RunResult>>;
}

impl Answer {
    /// The samples of a variant, µm, which `name` names in the error.
    ///
    /// # Errors
    ///
    /// The variant cannot be simulated.
    pub fn samples_of(self, name: &str) -> anyhow::Result<Vec<f64>> {
        match self {
            Self::Simulated { samples, .. } => Ok(samples),
            Self::Refused(why) => anyhow::bail!("{name} cannot be simulated: {why}"),
        }
    }
}

/// The most threads that wait for workers at once.
const THREADS: u32 = 16;

/// The results of `work` for each number, in their order. Several threads call `work` at once,
/// because it waits for workers most of the time.
///
/// # Errors
///
/// The first error of `work`, in the order of the numbers.
pub(crate) fn at_once<T: Send>(
    numbers: Range<u32>,
    work: impl Fn(u32) -> anyhow::Result<T> + Sync,
) -> anyhow::Result<Vec<T>> {
    let next = AtomicU32::new(numbers.start);
    let take = || {
        let mut done = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= numbers.end {
                return done;
            }
            done.push((number, work(number)));
        }
    };
    let mut done: Vec<(u32, anyhow::Result<T>)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS.min(numbers.len() as u32))
            .map(|_| scope.spawn(take))
            .collect();
        let join = |thread: ScopedJoinHandle<'_, _>| match thread.join() {
            Ok(done) => done,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        threads.into_iter().flat_map(join).collect()
    });
    done.sort_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Simulations in the calling thread, for tests and examples.
pub struct InProcess<'a>(pub &'a Problem);

impl Simulations for InProcess<'_> {
    fn simulate(&self, requests: &[Request]) -> anyhow::Result<Vec<Answer>> {
        let answer = |request: &Request| {
            let unit = Unit {
                stream: StreamId::design(0),
                generation: Generation(0),
                samples: request.samples.clone(),
            };
            let source = Source::Variant(Box::new(request.variant.clone()));
            match compute(self.0, &unit, &source).map_err(anyhow::Error::msg)? {
                Output::Refused(why) => Ok(Answer::Refused(why)),
                Output::Design {
                    responses, samples, ..
                } => {
                    let design = &request.variant.design;
                    let analysis = self.0.analysis(design, &responses, State::Baseline);
                    let mut criteria = analysis.context("no responses of a pair")?.criteria.gears();
                    if let Some(module) = request.variant.normal_module_mm {
                        criteria.normal_module_mm = module;
                    }
                    Ok(Answer::Simulated { criteria, samples })
                }
                other => anyhow::bail!("a variant cannot give {other:?}"),
            }
        };
        requests.iter().map(answer).collect()
    }

    fn optimise(&self, runs: Vec<Run>) -> anyhow::Result<Vec<RunResult>> {
        let run = |run: &Run| campaign::optimise::run(self.0, run).map_err(anyhow::Error::msg);
        runs.iter().map(run).collect()
    }
}
