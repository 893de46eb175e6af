//! The work of a worker: its input, its output, and the pure function between them.

use std::fmt;

use stats::Samples;
use stats::streams::Purpose;

use crate::formulation::Design;
use crate::optimise::{Answer, RunResult};
use crate::simulator::NoAnswer;

pub use crate::optimise::Run;

mod compute;
mod inputs;
mod stream_name;

pub use compute::{
    FAILED, KeepGoing, NOT_A_NUMBER, RULED_OUT, SIMULATOR_PANIC, compute, compute_until, failed,
    random_values, samples_not_asked,
};
pub use inputs::Inputs;
pub use stream_name::{infill_mark, stream_name};

/// The data that a worker needs to compute a stream.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// A design of the DoE whose criteria and samples are wanted.
    Design(Design),
    /// A design of the DoE whose criteria are known, and whose samples are wanted.
    Analysed {
        /// The design.
        design: Design,
        /// Its responses without random effects, as in [`Output::Design`].
        responses: Vec<f64>,
    },
    /// A point whose samples are wanted.
    Point(Design),
    /// A run of an optimiser on the built-in simulator.
    Run(Run),
    /// Candidates of a run on an external simulator, or an infill point whose constraints only such
    /// a simulator can evaluate.
    Candidates(Vec<Candidate>),
}

/// A design that an optimiser run wants evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The index of the evaluation within the run, from 0, which is the sample index of the run's
    /// stream.
    pub evaluation: u32,
    /// The design.
    pub design: Design,
    /// Whether it may be the best design so far, as far as is known without the simulator.
    pub may_improve: bool,
}

/// The evaluation of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// The design.
    pub design: Design,
    /// The simulator's answer. The error is the reason why the design is not simulable.
    pub answer: Result<Answer, String>,
}

impl Source {
    /// The approximate size of its message, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match self {
            Self::Design(design) | Self::Point(design) => size_of_val(design.values()),
            Self::Analysed { design, responses } => {
                size_of_val(design.values()) + size_of_val(&**responses)
            }
            Self::Run(run) => run.models.iter().map(|model| model.len()).sum(),
            Self::Candidates(candidates) => {
                let bytes = |one: &Candidate| size_of_val(one.design.values());
                candidates.iter().map(bytes).sum()
            }
        }
    }
}

/// The first number of an infill point, above the numbers of all other points.
pub const FIRST_INFILL: u64 = 1 << 27;

/// The random streams of verification samples: all verified designs have the same, so that two of them
/// differ by their variables and not by chance.
pub const VERIFICATION: (Purpose, u64) = (Purpose::Verify, 0);

/// The output of a unit.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// The output of a simulable design.
    Design {
        /// The responses without random effects, in the order of
        /// [`Problem::responses`](crate::formulation::Problem::responses).
        responses: Vec<f64>,
        /// Why the design gets no samples although it is simulable: its constraints rule it out,
        /// such as `ruled-out: …`.
        ruled_out: Option<String>,
        /// The responses with random effects, from the unit's first sample on.
        samples: Samples,
    },
    /// A design that is not simulable: the reason's short name and a sentence, such as
    /// `contact-gap: …`.
    Refused(String),
    /// The responses of a point with random effects, from the unit's first sample on.
    Samples(Samples),
    /// The result of a run on the built-in simulator.
    Run(Box<RunResult>),
    /// The evaluations of a run's candidates, from the unit's first one on.
    Evaluations(Vec<Evaluation>),
}

/// A failure that ends a unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// The sample or evaluation that failed; `None` for a failure of the unit as a whole, such as of
    /// the analyses of its design.
    pub sample: Option<u32>,
    /// A sentence for the record of failures, which names the stream; the cause and the remedy if
    /// the machine is at fault.
    pub error: String,
    /// Whether the machine that computes is at fault, so that the failure says nothing about the
    /// unit.
    pub by_machine: bool,
}

impl Failure {
    /// The failure of a request at `place`, which names the stream.
    fn at(place: impl fmt::Display, sample: Option<u32>, why: NoAnswer) -> Self {
        let (error, by_machine) = match why {
            NoAnswer::Machine(error) => (error, true),
            NoAnswer::Refused(error) | NoAnswer::Failed(error) => {
                (format!("{place}: {error}"), false)
            }
        };
        Self {
            sample,
            error,
            by_machine,
        }
    }
}

/// The outcome of a unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outcome {
    /// The finished output, from the unit's first sample on; `None` if nothing was finished.
    pub output: Option<Output>,
    /// The failure that ended the unit after `output`; `None` if the unit was finished or stopped.
    pub failure: Option<Failure>,
}

impl From<Failure> for Outcome {
    fn from(failure: Failure) -> Self {
        Self {
            output: None,
            failure: Some(failure),
        }
    }
}

#[cfg(test)]
mod tests;
