//! The work that is leased to workers: what goes out, what comes back, and the pure function
//! between them.
//!
//! Tasks and their results travel as JSON inside the protocol's opaque payloads. Floating-point
//! numbers survive the way bit for bit: they are written with the shortest digits that read back
//! as the same number. Variants are named by the key around them rather than by a tag inside, because
//! a reader that has to look for the tag first must keep everything else meanwhile, which for long
//! lists of samples costs as much as a third of computing them.

use std::panic::{AssertUnwindSafe, catch_unwind};

use serde::{Deserialize, Serialize};
use stats::streams::{Purpose, stream};

use crate::formulation::{Approach, Criteria, Frozen, Problem, ROBUST_VARIABLES, Variables};
use crate::optimise::{self, RunResult};
use crate::simulator::{NoAnswer, Prepared, Simulator};

/// A piece of work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
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
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
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
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
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
        /// Why it gets no samples, although it can be simulated: its constraints rule it out, as in
        /// `ruled-out: …`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ruled_out: Option<String>,
    },
    /// It cannot be simulated, or the simulator failed on it.
    Refused {
        /// The reason's short name and a sentence, as in `contact-gap: …`.
        reason: String,
    },
}

/// The name under which a panic of the simulator is recorded against a design.
pub const SIMULATOR_PANIC: &str = "simulator-panic";
/// The name under which a design is recorded that its constraints rule out.
pub const RULED_OUT: &str = "ruled-out";
/// The name under which a result that is no number is recorded against a design.
pub const NOT_A_NUMBER: &str = "not-a-number";

/// Asked before every sample whether to go on; the argument gives what is finished by then, as a
/// result that could be handed in.
pub type KeepGoing<'a> = dyn Fn(&dyn Fn() -> TaskResult) -> bool + 'a;

impl TaskResult {
    /// Whether there is nothing in it, as in that of a task that was stopped before its first sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Sample { designs } => designs.is_empty(),
            Self::Optimise { .. } => false,
            Self::Verify { samples_um, .. } => samples_um.is_empty(),
        }
    }
}

/// Does a task.
///
/// # Errors
///
/// A sentence for the task's failure record: the simulator failed, or refused a design that must
/// be simulated, or the kriging model cannot be read. A design of the DoE that cannot be simulated
/// is a result, not an error.
pub fn execute(simulator: &dyn Simulator, task: &Task) -> Result<TaskResult, String> {
    execute_until(simulator, task, &|_| true)
}

/// Does a task for as long as `keep_going` says, which is asked before every sample.
///
/// What is finished by then is a valid partial result. A sampling task then gives the designs that
/// were done, in their order, the last one possibly with fewer samples than asked for (but never
/// none); a verifying task gives fewer samples; either may give nothing at all. An optimiser's run
/// has no useful part and goes on to its end.
///
/// # Errors
///
/// As [`execute`].
pub fn execute_until(
    simulator: &dyn Simulator,
    task: &Task,
    keep_going: &KeepGoing<'_>,
) -> Result<TaskResult, String> {
    match task {
        Task::Sample { frozen, designs } => {
            let mut done = Vec::with_capacity(designs.len());
            for request in designs {
                let with = |outcome: Option<DesignOutcome>| {
                    let design = request.design;
                    let last = outcome.map(|outcome| DesignResult { design, outcome });
                    TaskResult::Sample {
                        designs: done.iter().cloned().chain(last).collect(),
                    }
                };
                let keep_going =
                    |so_far: &dyn Fn() -> Option<DesignOutcome>| keep_going(&|| with(so_far()));
                let outcome = guarded(|| simulate(simulator, frozen, request, &keep_going))?;
                let Some(outcome) = outcome else { break };
                done.push(DesignResult {
                    design: request.design,
                    outcome,
                });
            }
            Ok(TaskResult::Sample { designs: done })
        }
        Task::Optimise {
            approach,
            start,
            frozen,
            model,
        } => {
            let run = optimise::run(simulator, *approach, *start, frozen, model.as_deref())?;
            Ok(TaskResult::Optimise { run: Box::new(run) })
        }
        Task::Verify {
            point,
            number,
            variables,
            samples,
        } => {
            let mut design = simulator
                .prepare(variables)
                .map_err(|error| format!("{point}: {error}"))?;
            let names = Names {
                seed: simulator.problem().campaign().seed,
                purpose: Purpose::Verify,
                design: *number,
                // As many fresh samples as the file says, which judge all ways alike.
                coefficients: stats::Sampling::Independent,
            };
            let finite = |samples_um: &[f64]| {
                let finite = samples_um.iter().position(|sample| !sample.is_finite());
                samples_um[..finite.unwrap_or(samples_um.len())].to_vec()
            };
            let verified = |samples_um: &[f64]| TaskResult::Verify {
                point: point.clone(),
                first: samples.first,
                samples_um: finite(samples_um),
            };
            let keep_going = |drawn: &[f64]| keep_going(&|| verified(drawn));
            let samples_um = draw(design.as_mut(), names, *samples, &keep_going)
                .map_err(|(sample, error)| format!("{point}, sample {sample}: {error}"))?;
            if let Some(index) = samples_um.iter().position(|sample| !sample.is_finite()) {
                let sample = samples.first as usize + index;
                return Err(format!("{point}, sample {sample}: ΔSTE is not a number"));
            }
            Ok(verified(&samples_um))
        }
    }
}

/// [`KeepGoing`] of one design, which may have nothing to hand in yet.
type KeepGoingWith<'a> = dyn Fn(&dyn Fn() -> Option<DesignOutcome>) -> bool + 'a;

/// A design's outcome, or none when it was stopped before the first sample.
type Simulated = Result<Option<DesignOutcome>, String>;

/// Runs `simulate` and turns a panic into a refusal that carries its message.
fn guarded(simulate: impl FnOnce() -> Simulated) -> Simulated {
    catch_unwind(AssertUnwindSafe(simulate)).unwrap_or_else(|panic| {
        let message = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied())
            .unwrap_or("no message");
        Ok(Some(DesignOutcome::Refused {
            reason: format!("{SIMULATOR_PANIC}: {message}"),
        }))
    })
}

fn simulate(
    simulator: &dyn Simulator,
    frozen: &Frozen,
    request: &SampleRequest,
    keep_going: &KeepGoingWith<'_>,
) -> Simulated {
    if !keep_going(&|| None) {
        return Ok(None);
    }
    let number = request.design;
    let variables = Variables::robust(&request.x, frozen);
    let analysed = simulator.prepare(&variables).and_then(|mut design| {
        let unworn = design.unworn()?;
        let worn = design.archard()?;
        Ok((design, unworn, worn))
    });
    let (mut design, unworn, worn) = match analysed {
        Ok(analysed) => analysed,
        Err(NoAnswer::Refused(reason)) => return Ok(Some(DesignOutcome::Refused { reason })),
        Err(NoAnswer::Failed(error)) => return Err(format!("design {number}: {error}")),
    };
    let criteria = design.criteria(unworn.hertz_pressure_mpa);
    let ruled_out = ruled_out(
        simulator.problem(),
        &design.criteria(worn.hertz_pressure_mpa),
    );
    let gets_samples = ruled_out.is_none() && request.samples.count > 0;
    let simulated = |samples_um: &[f64]| DesignOutcome::Simulated {
        criteria,
        hertz_pressure_worn_mpa: worn.hertz_pressure_mpa,
        delta_ste_um: unworn.delta_ste_um,
        delta_ste_archard_um: worn.delta_ste_um,
        first: request.samples.first,
        samples_um: samples_um.to_vec(),
        ruled_out: ruled_out.clone(),
    };
    // Criteria alone are no answer to a request for samples.
    let outcome = |samples_um: &[f64]| {
        (!gets_samples || !samples_um.is_empty()).then(|| if_finite(simulated(samples_um)))
    };
    if !gets_samples {
        return Ok(outcome(&[]));
    }
    let names = Names {
        seed: simulator.problem().campaign().seed,
        purpose: Purpose::Wear,
        design: u64::from(number),
        coefficients: simulator.problem().campaign().sampling.coefficients(),
    };
    let keep_going = |drawn: &[f64]| keep_going(&|| outcome(drawn));
    let samples_um = draw(design.as_mut(), names, request.samples, &keep_going)
        .map_err(|(sample, error)| format!("design {number}, sample {sample}: {error}"))?;
    Ok(outcome(&samples_um))
}

/// The outcome itself, or a refusal if one of its numbers is none.
fn if_finite(outcome: DesignOutcome) -> DesignOutcome {
    let DesignOutcome::Simulated {
        criteria,
        hertz_pressure_worn_mpa,
        delta_ste_um,
        delta_ste_archard_um,
        samples_um,
        ..
    } = &outcome
    else {
        return outcome;
    };
    let numbers = [
        criteria.contact_ratio,
        criteria.specific_sliding,
        criteria.hertz_pressure_mpa,
        criteria.root_stress_mpa,
        *hertz_pressure_worn_mpa,
        *delta_ste_um,
        *delta_ste_archard_um,
    ];
    let is_finite = numbers
        .iter()
        .chain(samples_um)
        .chain(&criteria.clearance_mm)
        .chain(&criteria.flank_margin_mm)
        .all(|number| number.is_finite());
    if is_finite {
        return outcome;
    }
    DesignOutcome::Refused {
        reason: format!("{NOT_A_NUMBER}: the simulator gave a result that is no number"),
    }
}

/// Why a design with these criteria (with the contact pressure of worn flanks) gets no samples.
fn ruled_out(problem: &Problem, criteria: &Criteria) -> Option<String> {
    let limit = problem.campaign().sampling.skip_violation()?;
    let violation = problem.violation(criteria);
    // On the edge itself the violation is zero, but the inequalities are strict. A violation that is
    // no number is reported as such, not as a broken constraint.
    let is_out = violation > limit || violation == 0.0 && !problem.is_feasible(criteria);
    if !is_out {
        return None;
    }
    let broken: Vec<String> = problem
        .constraints(criteria)
        .iter()
        .filter(|constraint| !constraint.holds())
        .map(ToString::to_string)
        .collect();
    Some(format!("{RULED_OUT}: {}", broken.join(", ")))
}

/// What the random streams of one design's samples are named by, besides the sample, and how the
/// coefficients of their wear come from them.
#[derive(Debug, Clone, Copy)]
struct Names {
    seed: u64,
    purpose: Purpose,
    design: u64,
    coefficients: stats::Sampling,
}

impl Names {
    /// ΔSTE of one sample, µm: the same whichever samples are drawn beside it.
    fn draw(self, design: &mut dyn Prepared, index: u32) -> Result<f64, String> {
        let sample = u64::from(index);
        match self.coefficients {
            stats::Sampling::Independent => {
                let mut rng = stream(self.seed, self.purpose, self.design, sample);
                design.sample(&mut rng)
            }
            even => {
                let modes = design.modes();
                let coefficients = stats::normal_coefficients(
                    even,
                    self.seed,
                    self.purpose,
                    self.design,
                    sample,
                    modes,
                );
                design.sample_at(&coefficients.map_err(|error| error.to_string())?)
            }
        }
    }
}

/// Samples of ΔSTE in µm, each from its own random stream; the error names the sample.
fn draw(
    design: &mut dyn Prepared,
    names: Names,
    samples: SampleRange,
    keep_going: &dyn Fn(&[f64]) -> bool,
) -> Result<Vec<f64>, (u32, String)> {
    let mut drawn = Vec::with_capacity(samples.count as usize);
    for index in samples.first..samples.first.saturating_add(samples.count) {
        if !keep_going(&drawn) {
            break;
        }
        drawn.push(names.draw(design, index).map_err(|error| (index, error))?);
    }
    Ok(drawn)
}

#[cfg(test)]
mod tests;
