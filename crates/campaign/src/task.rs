//! The work that is leased to workers: what goes out, what comes back, and the pure function
//! between them.
//!
//! Tasks and their results travel as JSON inside the protocol's opaque payloads. Floating-point
//! numbers survive the way bit for bit: they are written with the shortest digits that read back
//! as the same number.

use std::panic::{AssertUnwindSafe, catch_unwind};

use serde::{Deserialize, Serialize};
use stats::streams::{Purpose, stream};

use crate::formulation::{Approach, Criteria, Frozen, Problem, ROBUST_VARIABLES, Variables};
use crate::optimise::{self, RunResult};

/// A piece of work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "task", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Task {
    /// Criteria and samples of designs of the DoE.
    Sample {
        /// The variables that all designs share.
        frozen: Frozen,
        /// The designs.
        designs: Vec<SampleRequest>,
    },
    /// One run of an optimiser.
    Optimise {
        /// Which problem.
        approach: Approach,
        /// Which of its starts, from 0.
        start: u32,
        /// The variables that a problem with wear leaves alone; ignored by the one without.
        frozen: Frozen,
        /// The kriging model as JSON, for [`Approach::Kriging`].
        model: Option<String>,
    },
    /// Fresh samples of one design.
    Verify {
        /// The name of the point, for the store.
        point: String,
        /// The number of the point, for its random streams.
        number: u64,
        /// The design.
        variables: Variables,
        /// The first sample and how many.
        samples: SampleRange,
    },
}

/// A run of sample indices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleRange {
    /// The first index.
    pub first: u32,
    /// How many.
    pub count: u32,
}

/// One design of a sampling task.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleRequest {
    /// Its index in the DoE.
    pub design: u32,
    /// The six robust variables.
    pub x: [f64; ROBUST_VARIABLES],
    /// Which samples are wanted.
    pub samples: SampleRange,
}

/// What a task gives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "task", rename_all = "kebab-case", deny_unknown_fields)]
pub enum TaskResult {
    /// Of [`Task::Sample`], in the order of its designs.
    Sample {
        /// The designs.
        designs: Vec<DesignResult>,
    },
    /// Of [`Task::Optimise`].
    Optimise {
        /// The run.
        run: Box<RunResult>,
    },
    /// Of [`Task::Verify`].
    Verify {
        /// The name of the point.
        point: String,
        /// The index of the first sample.
        first: u32,
        /// ΔSTE, µm.
        samples_um: Vec<f64>,
    },
}

/// One design's result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignResult {
    /// Its index in the DoE.
    pub design: u32,
    /// What the simulator made of it.
    pub outcome: DesignOutcome,
}

/// What the simulator made of a design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "kebab-case", deny_unknown_fields)]
pub enum DesignOutcome {
    /// It can be simulated.
    Simulated {
        /// Its criteria, with the contact pressure of the unworn pair.
        criteria: Criteria,
        /// The contact pressure with Archard's wear, MPa.
        hertz_pressure_worn_mpa: f64,
        /// ΔSTE without wear, µm.
        delta_ste_um: f64,
        /// ΔSTE with Archard's wear, µm.
        delta_ste_archard_um: f64,
        /// The index of the first sample.
        first: u32,
        /// ΔSTE with random wear, µm.
        samples_um: Vec<f64>,
    },
    /// It cannot be simulated, or the simulator failed on it.
    Refused {
        /// The reason's short name and a sentence, as in `contact-gap: …`.
        reason: String,
    },
}

/// The name under which a panic of the simulator is recorded against a design.
pub const SIMULATOR_PANIC: &str = "simulator-panic";
/// The name under which a result that is no number is recorded against a design.
pub const NOT_A_NUMBER: &str = "not-a-number";

/// Does a task.
///
/// # Errors
///
/// A sentence for the task's failure record: the simulator refused a design that must be simulated,
/// or the kriging model cannot be read. A failure on a design of the DoE is a result, not an error.
pub fn execute(problem: &Problem, task: &Task) -> Result<TaskResult, String> {
    match task {
        Task::Sample { frozen, designs } => {
            let designs = designs
                .iter()
                .map(|request| sample(problem, frozen, request))
                .collect();
            Ok(TaskResult::Sample { designs })
        }
        Task::Optimise {
            approach,
            start,
            frozen,
            model,
        } => {
            let run = optimise::run(problem, *approach, *start, frozen, model.as_deref())?;
            Ok(TaskResult::Optimise { run: Box::new(run) })
        }
        Task::Verify {
            point,
            number,
            variables,
            samples,
        } => {
            let pair = problem.pair(variables).map_err(|error| error.to_string())?;
            let samples_um = draw(problem, &pair, Purpose::Verify, *number, *samples);
            if let Some(index) = samples_um.iter().position(|sample| !sample.is_finite()) {
                return Err(format!("sample {index} of {point} is not a number"));
            }
            Ok(TaskResult::Verify {
                point: point.clone(),
                first: samples.first,
                samples_um,
            })
        }
    }
}

fn sample(problem: &Problem, frozen: &Frozen, request: &SampleRequest) -> DesignResult {
    let outcome = guarded(|| simulate(problem, frozen, request));
    DesignResult {
        design: request.design,
        outcome,
    }
}

/// Runs `simulate` and turns a panic into a refusal that carries its message.
fn guarded(simulate: impl FnOnce() -> DesignOutcome) -> DesignOutcome {
    catch_unwind(AssertUnwindSafe(simulate)).unwrap_or_else(|panic| {
        let message = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied())
            .unwrap_or("no message");
        DesignOutcome::Refused {
            reason: format!("{SIMULATOR_PANIC}: {message}"),
        }
    })
}

fn simulate(problem: &Problem, frozen: &Frozen, request: &SampleRequest) -> DesignOutcome {
    let variables = Variables::robust(&request.x, frozen);
    let pair = match problem.pair(&variables) {
        Ok(pair) => pair,
        Err(gear::Error::Infeasible(infeasible)) => {
            let reason = format!("{}: {infeasible}", infeasible.code());
            return DesignOutcome::Refused { reason };
        }
        Err(error) => {
            return DesignOutcome::Refused {
                reason: format!("invalid-input: {error}"),
            };
        }
    };
    let unworn = pair.unworn();
    let worn = pair.archard(problem.wear());
    let criteria = problem.criteria(&pair, unworn.hertz_pressure_mpa);
    let design = u64::from(request.design);
    let samples_um = draw(problem, &pair, Purpose::Wear, design, request.samples);
    let mut numbers = vec![
        criteria.contact_ratio,
        criteria.specific_sliding,
        criteria.hertz_pressure_mpa,
        criteria.root_stress_mpa,
        worn.analysis.hertz_pressure_mpa,
        unworn.delta_ste_um,
        worn.analysis.delta_ste_um,
    ];
    numbers.extend(&samples_um);
    numbers.extend(
        criteria
            .clearance_mm
            .iter()
            .chain(&criteria.flank_margin_mm),
    );
    if !numbers.iter().all(|number| number.is_finite()) {
        let reason = format!("{NOT_A_NUMBER}: the simulator gave a result that is no number");
        return DesignOutcome::Refused { reason };
    }
    DesignOutcome::Simulated {
        criteria,
        hertz_pressure_worn_mpa: worn.analysis.hertz_pressure_mpa,
        delta_ste_um: unworn.delta_ste_um,
        delta_ste_archard_um: worn.analysis.delta_ste_um,
        first: request.samples.first,
        samples_um,
    }
}

/// Samples of ΔSTE in µm, each from its own random stream.
pub fn draw(
    problem: &Problem,
    pair: &gear::Pair,
    purpose: Purpose,
    design: u64,
    samples: SampleRange,
) -> Vec<f64> {
    let seed = problem.campaign().seed;
    let mut sampler = pair.sampler(problem.wear());
    (samples.first..samples.first + samples.count)
        .map(|index| sampler.draw(&mut stream(seed, purpose, design, u64::from(index))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Campaign;

    fn problem() -> Problem {
        Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap())
    }

    fn request(count: u32) -> Task {
        Task::Sample {
            frozen: problem().printed_frozen(),
            designs: vec![
                SampleRequest {
                    design: 3,
                    x: [0.25, 1.37, 1.37, 0.85, 1.31, 0.80],
                    samples: SampleRange { first: 0, count },
                },
                // x_p + x_r = −2 leaves the involute equation without a solution.
                SampleRequest {
                    design: 4,
                    x: [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0],
                    samples: SampleRange { first: 0, count },
                },
            ],
        }
    }

    #[test]
    fn a_panic_is_recorded_against_its_design() {
        let outcome = guarded(|| panic!("no such tooth"));
        assert_eq!(
            outcome,
            DesignOutcome::Refused {
                reason: "simulator-panic: no such tooth".to_owned()
            }
        );
    }

    #[test]
    fn tasks_and_results_survive_json_bit_for_bit() {
        let problem = problem();
        let task = request(6);
        let json = serde_json::to_string(&task).unwrap();
        assert_eq!(serde_json::from_str::<Task>(&json).unwrap(), task);
        let result = execute(&problem, &task).unwrap();
        let json = serde_json::to_string(&result).unwrap();
        assert_eq!(serde_json::from_str::<TaskResult>(&json).unwrap(), result);
        let TaskResult::Sample { designs } = result else {
            panic!("a sampling result")
        };
        assert!(matches!(&designs[0].outcome,
            DesignOutcome::Simulated { samples_um, .. } if samples_um.len() == 6));
        assert!(matches!(&designs[1].outcome,
            DesignOutcome::Refused { reason } if reason.starts_with("no-involute-solution: ")));
    }

    #[test]
    fn a_sample_does_not_depend_on_who_draws_its_neighbours() {
        let problem = problem();
        let frozen = problem.printed_frozen();
        let variables = Variables::robust(&[0.25, 1.37, 1.37, 0.85, 1.31, 0.80], &frozen);
        let pair = problem.pair(&variables).unwrap();
        let all = draw(
            &problem,
            &pair,
            Purpose::Wear,
            3,
            SampleRange { first: 0, count: 8 },
        );
        let tail = draw(
            &problem,
            &pair,
            Purpose::Wear,
            3,
            SampleRange { first: 5, count: 3 },
        );
        assert_eq!(all[5..], tail);
    }
}
