//! The probe of an external program: the questions that every worker asks before it registers.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use problem::formulation::Problem;
use problem::probe::{self, Answers, DesignAnswers, ProbeError};
use problem::simulator::NoAnswer;
use tracing::warn;

use super::Programs;
use super::repeated::Repeated;
use crate::outside;
use crate::worker::error::Error;

/// Pause before a program that fails on every question of the model digest is asked again.
const PAUSE: Duration = Duration::from_secs(2);

impl Programs {
    /// Returns the digest of the answers to the probe questions, which `slots` programs answer at the same time.
    pub(super) fn model_digest(&self, problem: &Problem, slots: usize) -> Result<String, Error> {
        let failed = |reason: String| Error::Program {
            reason: outside::clean(&reason),
        };
        let session = self.session(problem);
        session
            .patiently(|| session.start())
            .map_err(|fault| match NoAnswer::from(fault) {
                NoAnswer::Machine(reason) => Error::Machine { reason },
                NoAnswer::Failed(reason) | NoAnswer::Refused(reason) => failed(reason),
            })?;
        // One of the questions takes its program.
        drop(session);
        let simulator = &problem.campaign().simulator;
        let since = Instant::now();
        let mut failures = Repeated::default();
        let answers = loop {
            match self.answers(problem, simulator.probe_designs().into(), slots) {
                Ok(answers) => break answers,
                // Tried again, as in an outage.
                Err(ProbeError::Fails(reason))
                    if since.elapsed() < simulator.retry_for()
                        && !self.stop.load(Ordering::Relaxed) =>
                {
                    match failures.count(&reason) {
                        1 => {
                            let reason = outside::line(&reason);
                            warn!(
                                reason,
                                "the simulator fails on every question; asking again"
                            );
                        }
                        attempts if attempts.is_power_of_two() => warn!(
                            attempts,
                            "the simulator still fails for the same reason; asking again"
                        ),
                        _ => {}
                    }
                    std::thread::sleep(PAUSE);
                }
                Err(ProbeError::Fails(reason) | ProbeError::Contradicts(reason)) => {
                    return Err(failed(reason));
                }
                Err(ProbeError::Machine(reason)) => return Err(Error::Machine { reason }),
            }
        };
        if answers.ignores_seeds() {
            let (source, key) = match problem.random() {
                Some(_) => ("random inputs", "random"),
                None => ("seed", "seed"),
            };
            warn!(
                designs = answers.equal,
                "the simulator seems to ignore its {source}: two samples of each design are equal. Everything random must \
                 follow from \"{key}\""
            );
        }
        Ok(answers.digest)
    }

    /// Asks about the first `designs` of the probe. Each of at most `slots` threads asks a program of its own.
    fn answers(
        &self,
        problem: &Problem,
        designs: u64,
        slots: usize,
    ) -> Result<Answers, ProbeError> {
        let next = AtomicU64::new(0);
        let asked: Mutex<BTreeMap<u64, Result<DesignAnswers, ProbeError>>> = Mutex::default();
        std::thread::scope(|scope| {
            for _ in 0..designs.min(slots as u64) {
                scope.spawn(|| {
                    let session = self.session(problem);
                    loop {
                        let design = next.fetch_add(1, Ordering::Relaxed);
                        if design >= designs {
                            break;
                        }
                        let answers = probe::ask(&session, design);
                        let mut asked = asked.lock().unwrap_or_else(PoisonError::into_inner);
                        asked.insert(design, answers);
                    }
                });
            }
        });
        let asked = asked.into_inner().unwrap_or_else(PoisonError::into_inner);
        let answers: Result<Vec<_>, _> = asked.into_values().collect();
        probe::conclude(&self.session(problem), &answers?)
    }
}
