//! What workers compute: what it takes, what comes out, and the pure function between them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use ledger::{Generation, History, Kind, StreamId, Unit, Wanted};
use sha2::{Digest as _, Sha256};
use stats::streams::{Purpose, stream};

use crate::Campaign;
use crate::formulation::{Approach, Criteria, Design, Problem};
use crate::optimise::{self, Answer, RunResult};
use crate::simulator::{NoAnswer, Prepared, Simulator, State};
use crate::variant::Variant;

/// What a worker needs to compute a stream.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// A design of the DoE, of which criteria and samples are wanted.
    Design(Design),
    /// A point, of which samples are wanted.
    Point(Design),
    /// A variant of a design, of which criteria and samples are wanted.
    Variant(Box<Variant>),
    /// A run of an optimiser on the built-in simulator.
    Run(Run),
    /// Candidates of a run on an external simulator, or an infill point whose constraints only such a
    /// simulator knows.
    Candidates(Vec<Candidate>),
}

/// A design that a run of an optimiser asks about.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Which evaluation of the run it is, from 0: the sample of the run's stream.
    pub evaluation: u32,
    /// The design.
    pub design: Design,
    /// Whether it may be the best design so far, by what is known without the simulator.
    pub may_improve: bool,
}

/// What came of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluated {
    /// The design.
    pub design: Design,
    /// What the simulator says of it; the error is why it cannot be simulated.
    pub answer: Result<Answer, String>,
}

impl Source {
    /// How many bytes it takes on the way to a worker, about.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match self {
            Self::Design(design) | Self::Point(design) => size_of_val(design.values()),
            Self::Variant(variant) => size_of::<Variant>() + size_of_val(variant.design.values()),
            Self::Run(run) => run.model.as_deref().map_or(0, str::len),
            Self::Candidates(candidates) => {
                let bytes = |one: &Candidate| size_of_val(one.design.values());
                candidates.iter().map(bytes).sum()
            }
        }
    }
}

/// One run of an optimiser.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Which problem.
    pub approach: Approach,
    /// Which of its starts, from 0.
    pub start: u32,
    /// The values of the variables that the DoE leaves alone; ignored where all are moved.
    pub base: Design,
    /// The kriging model as JSON, for [`Approach::Kriging`].
    pub model: Option<Arc<str>>,
}

impl Run {
    /// The stream of its result.
    #[must_use]
    pub const fn stream(&self) -> StreamId {
        StreamId::run(self.approach.number() as u32, self.start)
    }
}

/// The digest of what all values of a campaign depend on, whatever its size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inputs([u8; 32]);

impl Inputs {
    /// Those of a campaign whose simulator answers to this digest; without one, as before an external
    /// program was asked, a store takes the samples of one simulator only.
    #[must_use]
    pub fn new(campaign: &Campaign, model_digest: Option<&str>) -> Self {
        let mut hash = Sha256::new();
        hash.update(campaign.values_digest());
        hash.update(model_digest.unwrap_or_default());
        Self(hash.finalize().into())
    }

    /// The generation of a stream: the digest of everything that its values depend on.
    #[must_use]
    pub fn generation(&self, stream: StreamId, source: &Source) -> Generation {
        let mut hash = Sha256::new();
        hash.update(self.0);
        hash.update(stream.to_string());
        let mut number = |number: f64| hash.update(number.to_bits().to_le_bytes());
        match source {
            Source::Design(design) | Source::Point(design) => {
                design.values().iter().copied().for_each(number);
            }
            Source::Variant(variant) => variant.numbers().for_each(number),
            Source::Run(run) => {
                run.base.values().iter().copied().for_each(&mut number);
                hash.update(run.model.as_deref().unwrap_or_default());
            }
            Source::Candidates(candidates) => {
                for candidate in candidates {
                    number(f64::from(candidate.evaluation));
                    number(f64::from(u8::from(candidate.may_improve)));
                    candidate
                        .design
                        .values()
                        .iter()
                        .copied()
                        .for_each(&mut number);
                }
            }
        }
        let digest = hash.finalize();
        let first = digest.first_chunk().expect("SHA-256 has 32 bytes");
        Generation(u64::from_le_bytes(*first))
    }

    /// A stream that is to have this many samples and has none yet, as a ledger wants it.
    #[must_use]
    pub fn wanted(&self, stream: StreamId, source: Source, samples: u32) -> Wanted<Arc<Source>> {
        Wanted {
            stream,
            generation: self.generation(stream, &source),
            source: Arc::new(source),
            samples,
            missing: std::iter::once(0..samples).collect(),
            history: History::default(),
        }
    }
}

/// What comes of a unit.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Of a design that can be simulated.
    Design {
        /// What it is without random effects, in the order of [`Problem::responses`].
        responses: Vec<f64>,
        /// Why it gets no samples, although it can be simulated: its constraints rule it out, as in
        /// `ruled-out: …`.
        ruled_out: Option<String>,
        /// The response with random effects, from the unit's first sample on.
        samples_um: Vec<f64>,
    },
    /// Of a design that cannot be simulated: the reason's short name and a sentence, as in
    /// `contact-gap: …`.
    Refused(String),
    /// Of a point: the response with random effects, from the unit's first sample on.
    Samples(Vec<f64>),
    /// Of a run on the built-in simulator.
    Run(Box<RunResult>),
    /// Of candidates of a run, from the unit's first one on.
    Evaluations(Vec<Evaluated>),
}

/// The name under which a panic of the simulator is recorded against a design.
pub const SIMULATOR_PANIC: &str = "simulator-panic";
/// The name under which a design is recorded that its constraints rule out.
pub const RULED_OUT: &str = "ruled-out";
/// The name under which a result that is no number is recorded against a design.
pub const NOT_A_NUMBER: &str = "not-a-number";

/// Asked before every sample and candidate, and before every generation of a run, whether to go on; the
/// argument gives what is finished by then, as an output that could be reported.
pub type KeepGoing<'a> = dyn Fn(&dyn Fn() -> Option<Output>) -> bool + 'a;

/// Computes a unit.
///
/// # Errors
///
/// A sentence for the failure's record: the simulator failed, or refused a point, or the kriging model
/// cannot be read. A design of the DoE that cannot be simulated is an output, not an error.
pub fn compute(simulator: &dyn Simulator, unit: &Unit, source: &Source) -> Result<Output, String> {
    let output = compute_until(simulator, unit, source, &|_| true)?;
    output.ok_or_else(|| "nothing was asked for".to_owned())
}

/// Computes a unit for as long as `keep_going` says, which is asked before every sample. What is
/// finished by then is given, from the first sample on; nothing before the first is.
///
/// Whether a design is refused does not depend on how its samples are cut: it is decided by its
/// analyses, which are the same for every unit. A sample for which the simulator panics or gives no
/// possible number is a failure, which names it.
///
/// # Errors
///
/// As [`compute`].
pub fn compute_until(
    simulator: &dyn Simulator,
    unit: &Unit,
    source: &Source,
    keep_going: &KeepGoing<'_>,
) -> Result<Option<Output>, String> {
    let stream = unit.stream;
    match source {
        Source::Design(wanted) => {
            let campaign = simulator.problem().campaign();
            let sampling = Sampling {
                names: Names {
                    seed: campaign.seed,
                    purpose: Purpose::Wear,
                    design: stream.index,
                    coefficients: campaign.sampling.coefficients(),
                },
                skip_violation: campaign.sampling.skip_violation(),
            };
            let prepare = || simulator.prepare(wanted);
            design(simulator.problem(), &prepare, unit, sampling, keep_going)
        }
        Source::Variant(variant) => {
            let (purpose, number) = variant.stream;
            let sampling = Sampling {
                names: Names {
                    seed: simulator.problem().campaign().seed,
                    purpose,
                    design: number,
                    coefficients: stats::Sampling::Independent,
                },
                skip_violation: variant.feasible_only.then_some(0.0),
            };
            let prepare = || simulator.prepare_variant(variant);
            design(simulator.problem(), &prepare, unit, sampling, keep_going)
        }
        Source::Point(wanted) => {
            let prepared = guarded(|| simulator.prepare(wanted));
            let mut design = match prepared {
                Ok(Ok(design)) => design,
                Ok(Err(error)) => return Err(format!("{stream}: {error}")),
                Err(panic) => return Err(format!("{stream}: {SIMULATOR_PANIC}: {panic}")),
            };
            let names = Names {
                seed: simulator.problem().campaign().seed,
                purpose: Purpose::Verify,
                design: stream.index,
                // As many verification samples as the file says, which judge all ways alike.
                coefficients: stats::Sampling::Independent,
            };
            let output = |samples_um: &[f64]| {
                (!samples_um.is_empty()).then(|| Output::Samples(samples_um.to_vec()))
            };
            let keep_going = |drawn: &[f64]| keep_going(&|| output(drawn));
            let problem = simulator.problem();
            let samples_um = draw(problem, design.as_mut(), names, unit, &keep_going)?;
            Ok(output(&samples_um))
        }
        Source::Run(run) => {
            let result = optimise::run_while(simulator, run, &|| keep_going(&|| None))?;
            Ok(result.map(|result| Output::Run(Box::new(result))))
        }
        Source::Candidates(candidates) => evaluate(simulator, unit, candidates, keep_going),
    }
}

/// Asks about the candidates that a unit covers, of a run or of an infill point; the error names the
/// evaluation.
fn evaluate(
    simulator: &dyn Simulator,
    unit: &Unit,
    candidates: &[Candidate],
    keep_going: &KeepGoing<'_>,
) -> Result<Option<Output>, String> {
    let approach = match unit.stream.kind {
        // Of an infill point, whose constraints are asked for before its samples.
        Kind::Point => Some(Approach::EnrichedKriging),
        _ => Approach::numbered(unit.stream.run_parts().0.into()),
    };
    let approach = approach.ok_or_else(|| format!("{}: no such approach", unit.stream))?;
    let mut evaluated = Vec::with_capacity(unit.samples.len());
    let output = |evaluated: &[Evaluated]| {
        (!evaluated.is_empty()).then(|| Output::Evaluations(evaluated.to_vec()))
    };
    for evaluation in unit.samples.clone() {
        if !keep_going(&|| output(&evaluated)) {
            break;
        }
        let failed = |error: String| format!("{}, evaluation {evaluation}: {error}", unit.stream);
        let mut wanted = candidates.iter();
        let candidate = wanted.find(|one| one.evaluation == evaluation);
        let Candidate {
            design,
            may_improve,
            ..
        } = candidate.ok_or_else(|| failed("the lease has no such candidate".to_owned()))?;
        let answer = || optimise::answer(simulator, approach, design, *may_improve);
        let answer = match guarded(answer) {
            Ok(Ok(answer)) => Ok(answer),
            Ok(Err(NoAnswer::Refused(reason))) => Err(reason),
            Ok(Err(NoAnswer::Failed(error))) => return Err(failed(error)),
            Err(panic) => return Err(failed(format!("{SIMULATOR_PANIC}: {panic}"))),
        };
        evaluated.push(Evaluated {
            design: design.clone(),
            answer,
        });
    }
    Ok(output(&evaluated))
}

/// What `work` gives, or the message of its panic.
fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let message = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied());
        message.unwrap_or("no message").to_owned()
    })
}

/// How the samples of a design are drawn.
#[derive(Debug, Clone, Copy)]
struct Sampling {
    names: Names,
    /// The violation of the constraints above which a design gets no samples.
    skip_violation: Option<f64>,
}

/// Analyses a design and samples it.
fn design<'a>(
    problem: &Problem,
    prepare: &dyn Fn() -> Result<Box<dyn Prepared + 'a>, NoAnswer>,
    unit: &Unit,
    sampling: Sampling,
    keep_going: &KeepGoing<'_>,
) -> Result<Option<Output>, String> {
    if !keep_going(&|| None) {
        return Ok(None);
    }
    let analysed = guarded(|| analyse(problem, prepare()?, sampling.skip_violation));
    let (mut design, responses, ruled_out) = match analysed {
        Ok(Ok(analysed)) => analysed,
        Ok(Err(NoAnswer::Refused(reason))) => return Ok(Some(Output::Refused(reason))),
        Ok(Err(NoAnswer::Failed(error))) => return Err(format!("{}: {error}", unit.stream)),
        Err(panic) => {
            let reason = format!("{SIMULATOR_PANIC}: {panic}");
            return Ok(Some(Output::Refused(reason)));
        }
    };
    let gets_samples = ruled_out.is_none() && !unit.samples.is_empty();
    // Criteria alone are no answer to a request for samples.
    let output = |samples_um: &[f64]| {
        (!gets_samples || !samples_um.is_empty()).then(|| Output::Design {
            responses: responses.clone(),
            ruled_out: ruled_out.clone(),
            samples_um: samples_um.to_vec(),
        })
    };
    if !gets_samples {
        return Ok(output(&[]));
    }
    let keep_going = |drawn: &[f64]| keep_going(&|| output(drawn));
    let samples_um = draw(problem, design.as_mut(), sampling.names, unit, &keep_going)?;
    Ok(output(&samples_um))
}

type Analysed<'a> = (Box<dyn Prepared + 'a>, Vec<f64>, Option<String>);

/// A design, ready to be sampled, with what its analyses say, and why it gets no samples.
fn analyse<'a>(
    problem: &Problem,
    mut design: Box<dyn Prepared + 'a>,
    skip_violation: Option<f64>,
) -> Result<Analysed<'a>, NoAnswer> {
    let nominal = design.analyse(State::Nominal)?;
    let baseline = design.analyse(State::Baseline)?;
    let responses = problem.responses_of(&nominal, &baseline);
    if !responses.iter().all(|response| response.is_finite()) {
        return Err(NoAnswer::Refused(format!(
            "{NOT_A_NUMBER}: the simulator gave a result that is no number"
        )));
    }
    problem
        .check_responses(&responses)
        .map_err(NoAnswer::Failed)?;
    let ruled_out = skip_violation.and_then(|limit| ruled_out(problem, &baseline.criteria, limit));
    Ok((design, responses, ruled_out))
}

/// Why a design with these criteria in its baseline state gets no samples.
fn ruled_out(problem: &Problem, criteria: &Criteria, limit: f64) -> Option<String> {
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
    /// The response of one sample: the same whichever samples are drawn beside it.
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

/// Samples of the response, each from its own random stream; the error names the sample.
fn draw(
    problem: &Problem,
    design: &mut dyn Prepared,
    names: Names,
    unit: &Unit,
    keep_going: &dyn Fn(&[f64]) -> bool,
) -> Result<Vec<f64>, String> {
    let mut drawn = Vec::with_capacity(unit.samples.len());
    for index in unit.samples.clone() {
        if !keep_going(&drawn) {
            break;
        }
        let failed = |error: String| format!("{}, sample {index}: {error}", unit.stream);
        let sample = guarded(|| names.draw(design, index))
            .map_err(|panic| failed(format!("{SIMULATOR_PANIC}: {panic}")))?
            .map_err(failed)?;
        let name = &problem.sampled().name;
        let checked = problem.check_sample(sample);
        checked.map_err(|why| failed(format!("{name} {why}")))?;
        drawn.push(sample);
    }
    Ok(drawn)
}

#[cfg(test)]
mod tests;
