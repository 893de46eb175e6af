//! The interface between the stages and a simulator, which is the built-in gear model or an
//! external program.
//!
//! A design is prepared once. Then its criteria, its two deterministic analyses and its samples are
//! requested one by one, because each may take microseconds or hours.

use stats::streams::StreamRng;

use crate::formulation::gears::{CaseSampler, Gears, LoadedCases};
use crate::formulation::{Design, Problem};

pub use crate::formulation::{Analysis, State};

/// The reasons why a simulator gives no number.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoAnswer {
    /// The design is not simulable, which is a result: a short name and a sentence, such as
    /// `contact-gap: …`.
    #[error("{0}")]
    Refused(String),
    /// The simulator itself failed. Another attempt may succeed.
    #[error("{0}")]
    Failed(String),
    /// The worker's machine cannot run the simulator, whatever the design: the cause and the remedy.
    #[error("{0}")]
    Machine(String),
}

/// A simulator of the designs of one campaign.
pub trait Simulator {
    /// The campaign's problem.
    fn problem(&self) -> &Problem;

    /// The version of the program, if it reports one. It is part of the model digest.
    fn version(&self) -> Option<String> {
        None
    }

    /// Prepares a design.
    ///
    /// # Errors
    ///
    /// The design is not simulable, or the simulator failed.
    fn prepare<'a>(&'a self, design: &Design) -> Result<Box<dyn PreparedDesign + 'a>, NoAnswer>;
}

/// A prepared design.
pub trait PreparedDesign {
    /// Analyses the design without random effects.
    ///
    /// # Errors
    ///
    /// The design is not simulable, or the simulator failed.
    fn analyse(&mut self, state: State) -> Result<Analysis, NoAnswer>;

    /// Draws a sample using only `rng`: a value for each of the [sampled responses](Problem::sampled), for a gear pair
    /// ΔSTE in µm. NaN or infinite if the simulator has no number for it.
    ///
    /// # Errors
    ///
    /// The simulator or its machine failed. Another attempt may succeed.
    fn sample(&mut self, rng: &mut StreamRng) -> Result<Vec<f64>, NoAnswer>;

    /// The number of standard normal coefficients that the random effects are made of: those of a gear pair's flanks,
    /// or the scores of the campaign's random inputs. 0 if the simulator's random effects are not known.
    fn modes(&mut self) -> usize {
        0
    }

    /// The sample with these coefficients, whose number is [`modes`](Self::modes).
    ///
    /// # Errors
    ///
    /// The simulator does not accept coefficients.
    fn sample_at(&mut self, _coefficients: &[f64]) -> Result<Vec<f64>, NoAnswer> {
        Err(NoAnswer::Failed(
            "this simulator draws its random effects itself: sampling.coefficients must be \"independent\""
                .to_owned(),
        ))
    }
}

/// The built-in gear model, which refuses but never fails.
impl Simulator for Problem {
    fn problem(&self) -> &Problem {
        self
    }

    fn prepare<'a>(&'a self, design: &Design) -> Result<Box<dyn PreparedDesign + 'a>, NoAnswer> {
        let Some(gears) = self.gears() else {
            return Err(NoAnswer::Failed(
                "the built-in model simulates gears: start the worker with --exec 'CMD'".to_owned(),
            ));
        };
        let cases = gears.loaded(design).map_err(|error| {
            NoAnswer::Refused(match error {
                gear::Error::Infeasible(infeasible) => {
                    format!("{}: {infeasible}", infeasible.code())
                }
                error => format!("invalid-input: {error}"),
            })
        })?;
        Ok(Box::new(BuiltInDesign {
            gears,
            cases,
            sampler: None,
        }))
    }
}

struct BuiltInDesign<'a> {
    gears: &'a Gears,
    cases: LoadedCases,
    /// Created for the first sample, which an optimiser never draws.
    sampler: Option<CaseSampler>,
}

impl PreparedDesign for BuiltInDesign<'_> {
    fn analyse(&mut self, state: State) -> Result<Analysis, NoAnswer> {
        Ok(self.gears.analyse(&self.cases, state))
    }

    fn sample(&mut self, rng: &mut StreamRng) -> Result<Vec<f64>, NoAnswer> {
        Ok(self.sampler().draw(rng))
    }

    fn modes(&mut self) -> usize {
        self.sampler().modes()
    }

    fn sample_at(&mut self, coefficients: &[f64]) -> Result<Vec<f64>, NoAnswer> {
        Ok(self.sampler().at(coefficients))
    }
}

impl BuiltInDesign<'_> {
    fn sampler(&mut self) -> &mut CaseSampler {
        self.sampler.get_or_insert_with(|| self.cases.sampler())
    }
}
