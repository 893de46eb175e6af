//! The computation of a unit: the same output wherever, and however often, it runs.

use std::panic::{AssertUnwindSafe, catch_unwind};

use ledger::{Kind, StreamId, Unit};
use stats::Samples;
use stats::streams::{Purpose, stream};

use super::{
    Candidate, Evaluation, FIRST_INFILL, Failure, Outcome, Output, Source, VERIFICATION,
    stream_name,
};
use crate::formulation::{Approach, Design, Problem};
use crate::optimise;
use crate::simulator::{NoAnswer, PreparedDesign, Simulator, State};

/// The short name of the reason for a candidate or a design whose evaluation failed.
pub const FAILED: &str = "failed";

/// The reason for a candidate or a design whose evaluation failed with this error.
#[must_use]
pub fn failed(stream: StreamId, evaluation: u32, error: &str) -> String {
    let line = error.lines().next().unwrap_or_default();
    let after = |place: String| line.strip_prefix(&*place)?.strip_prefix(": ");
    let cause = after(of_evaluation(stream, evaluation)).or_else(|| after(stream_name(stream)));
    format!("{FAILED}: {}", cause.unwrap_or(line))
}

/// The place that an evaluation's error names.
fn of_evaluation(stream: StreamId, evaluation: u32) -> String {
    format!("{}, evaluation {evaluation}", stream_name(stream))
}

/// The short name of the reason for a design on which the simulator panicked.
pub const SIMULATOR_PANIC: &str = "simulator-panic";
/// The short name of the reason for a design that its constraints rule out.
pub const RULED_OUT: &str = "ruled-out";
/// The short name of the reason for a design with a result that is not a number.
pub const NOT_A_NUMBER: &str = "not-a-number";

/// Decides whether to continue; called before every sample and candidate, and before every
/// generation of a run. The argument returns what is finished by then, as an output that could be
/// reported.
pub type KeepGoing<'a> = dyn Fn(&dyn Fn() -> Option<Output>) -> bool + 'a;

/// Computes a unit.
///
/// # Errors
///
/// A sentence for the record of failures: the simulator failed, or refused a point, or the kriging
/// model cannot be read. A design of the DoE that is not simulable is an output, not an error.
pub fn compute(simulator: &dyn Simulator, unit: &Unit, source: &Source) -> Result<Output, String> {
    let computed = compute_until(simulator, unit, source, &|_| true);
    if let Some(failure) = computed.failure {
        return Err(failure.error);
    }
    let output = computed.output;
    output.ok_or_else(|| "nothing was asked for".to_owned())
}

/// Computes a unit until `keep_going`, which is called before every sample, returns false, or until
/// something fails.
///
/// Whether a design is refused does not depend on how its samples are cut: the analyses decide, and
/// they are the same for every unit. A sample for which the simulator panics or gives an
/// implausible number is a failure that names the sample.
pub fn compute_until(
    simulator: &dyn Simulator,
    unit: &Unit,
    source: &Source,
    keep_going: &KeepGoing<'_>,
) -> Outcome {
    let stream = unit.stream;
    let whole = |why: NoAnswer| Outcome::from(Failure::at(stream_name(stream), None, why));
    match source {
        Source::Design(wanted) => design(simulator, wanted, None, unit, keep_going),
        Source::Analysed {
            design: wanted,
            responses,
        } => design(simulator, wanted, Some(responses), unit, keep_going),
        Source::Point(wanted) => {
            let prepared = guarded(|| simulator.prepare(wanted));
            let mut design = match prepared {
                Ok(Ok(design)) => design,
                Ok(Err(why)) => return whole(why),
                Err(panic) => return whole(panicked(&panic)),
            };
            let names = Names::of(simulator.problem(), stream);
            let output =
                |samples: &Samples| (!samples.is_empty()).then(|| Output::Samples(samples.clone()));
            let keep_going = |drawn: &Samples| keep_going(&|| output(drawn));
            let problem = simulator.problem();
            let (samples, failure) = draw(problem, design.as_mut(), names, unit, &keep_going);
            Outcome {
                output: output(&samples),
                failure,
            }
        }
        Source::Run(run) => match optimise::run_while(simulator, run, &|| keep_going(&|| None)) {
            Ok(result) => Outcome {
                output: result.map(|result| Output::Run(Box::new(result))),
                failure: None,
            },
            // A run's error names its call.
            Err(NoAnswer::Failed(error)) => Outcome::from(Failure {
                sample: None,
                error,
                by_machine: false,
            }),
            Err(why) => whole(why),
        },
        Source::Candidates(candidates) => evaluate(simulator, unit, candidates, keep_going),
    }
}

/// Evaluates the candidates that a unit covers, for a run or an infill point.
fn evaluate(
    simulator: &dyn Simulator,
    unit: &Unit,
    candidates: &[Candidate],
    keep_going: &KeepGoing<'_>,
) -> Outcome {
    let approach = match unit.stream.kind {
        // An infill point, whose constraints are evaluated before it is sampled.
        Kind::Point => Some(Approach::EnrichedKriging),
        _ => Approach::numbered(unit.stream.run_parts().0.into()),
    };
    let Some(approach) = approach else {
        let why = NoAnswer::Failed("no such approach".to_owned());
        return Failure::at(stream_name(unit.stream), None, why).into();
    };
    let mut evaluated = Vec::with_capacity(unit.samples.len());
    let output = |evaluated: &[Evaluation]| {
        (!evaluated.is_empty()).then(|| Output::Evaluations(evaluated.to_vec()))
    };
    for evaluation in unit.samples.clone() {
        if !keep_going(&|| output(&evaluated)) {
            break;
        }
        let mut wanted = candidates.iter();
        let candidate = wanted.find(|one| one.evaluation == evaluation);
        let answered = match candidate {
            Some(candidate) => evaluate_one(simulator, approach, candidate),
            None => Err(NoAnswer::Failed(
                "the lease has no such candidate".to_owned(),
            )),
        };
        match answered {
            Ok(one) => evaluated.push(one),
            Err(why) => {
                let place = of_evaluation(unit.stream, evaluation);
                return Outcome {
                    output: output(&evaluated),
                    failure: Some(Failure::at(place, Some(evaluation), why)),
                };
            }
        }
    }
    Outcome {
        output: output(&evaluated),
        failure: None,
    }
}

fn evaluate_one(
    simulator: &dyn Simulator,
    approach: Approach,
    candidate: &Candidate,
) -> Result<Evaluation, NoAnswer> {
    let design = &candidate.design;
    let answer = || optimise::answer(simulator, approach, design, candidate.may_improve);
    let answer = match guarded(answer) {
        Ok(Ok(answer)) => Ok(answer),
        Ok(Err(NoAnswer::Refused(reason))) => Err(reason),
        Ok(Err(why)) => return Err(why),
        Err(panic) => return Err(panicked(&panic)),
    };
    Ok(Evaluation {
        design: design.clone(),
        answer,
    })
}

/// The failure of a simulator that panicked with a message.
fn panicked(message: &str) -> NoAnswer {
    NoAnswer::Failed(format!("{SIMULATOR_PANIC}: {message}"))
}

/// The result of `work`, or the message of its panic.
fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let message = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied());
        message.unwrap_or("no message").to_owned()
    })
}

/// Analyses a design, unless its responses are known, and samples it.
fn design(
    simulator: &dyn Simulator,
    wanted: &Design,
    known: Option<&[f64]>,
    unit: &Unit,
    keep_going: &KeepGoing<'_>,
) -> Outcome {
    let problem = simulator.problem();
    let campaign = problem.campaign();
    if !keep_going(&|| None) {
        return Outcome::default();
    }
    let done = |output: Option<Output>| Outcome {
        output,
        failure: None,
    };
    let analysed = guarded(|| {
        let mut prepared = simulator.prepare(wanted)?;
        let known = known.or_else(|| problem.own_responses(unit.stream.index));
        let responses = match known {
            Some(known) => known.to_vec(),
            None => analyse(problem, prepared.as_mut())?,
        };
        Ok(Analyses {
            ruled_out: ruled_out(problem, wanted, &responses),
            design: prepared,
            responses,
        })
    });
    let Analyses {
        mut design,
        responses,
        ruled_out,
    } = match analysed {
        Ok(Ok(analyses)) => analyses,
        Ok(Err(NoAnswer::Refused(reason))) => return done(Some(Output::Refused(reason))),
        Ok(Err(why)) => return Failure::at(stream_name(unit.stream), None, why).into(),
        Err(panic) => {
            let reason = format!("{SIMULATOR_PANIC}: {panic}");
            return done(Some(Output::Refused(reason)));
        }
    };
    let gets_samples = ruled_out.is_none() && !unit.samples.is_empty();
    // If samples were requested, criteria alone are not an output.
    let output = |samples: &Samples| {
        (!gets_samples || !samples.is_empty()).then(|| Output::Design {
            responses: responses.clone(),
            ruled_out: ruled_out.clone(),
            samples: samples.clone(),
        })
    };
    let none = Samples::none(problem.sampled().len());
    if !gets_samples {
        return done(output(&none));
    }
    let keep_going = |drawn: &Samples| keep_going(&|| output(drawn));
    let names = Names::of(problem, unit.stream);
    let (samples, failure) = draw(problem, design.as_mut(), names, unit, &keep_going);
    // The criteria of a design whose samples fail are stored without them, if the failure is a result.
    let is_result = campaign.sampling.tolerates_failures();
    let has_criteria = failure.is_some() && is_result && !responses.is_empty();
    let alone = || Output::Design {
        responses: responses.clone(),
        ruled_out: None,
        samples: none.clone(),
    };
    Outcome {
        output: output(&samples).or_else(|| has_criteria.then(alone)),
        failure,
    }
}

/// A design with the responses of its analyses.
struct Analyses<'a> {
    design: Box<dyn PreparedDesign + 'a>,
    responses: Vec<f64>,
    /// The reason if the design gets no samples.
    ruled_out: Option<String>,
}

/// The responses of a design, which is analysed in both states.
fn analyse(problem: &Problem, design: &mut dyn PreparedDesign) -> Result<Vec<f64>, NoAnswer> {
    let nominal = design.analyse(State::Nominal)?;
    let baseline = design.analyse(State::Baseline)?;
    let responses = problem.responses_of(&nominal, &baseline);
    if !responses.iter().all(|response| response.is_finite()) {
        return Err(NoAnswer::Refused(format!(
            "{NOT_A_NUMBER}: the simulator gave a result that is not a number"
        )));
    }
    problem
        .check_responses(&responses)
        .map_err(NoAnswer::Failed)?;
    Ok(responses)
}

/// The reason why a design with these responses gets no samples.
fn ruled_out(problem: &Problem, design: &Design, responses: &[f64]) -> Option<String> {
    let limit = problem.campaign().sampling.skip_violation()?;
    let baseline = problem.analysis(design, responses, State::Baseline)?;
    let criteria = &baseline.criteria;
    let violation = problem.violation(criteria);
    // On a limit the violation is zero, but the constraint may be broken. A violation that is
    // NaN is reported as such and not as a violated constraint.
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

/// The number of a design's first samples that the program is not asked for: the number of samples in the campaign
/// file, or [`u32::MAX`] if the responses in the campaign file rule the design out.
#[must_use]
pub fn samples_not_asked(problem: &Problem, design: u64) -> u32 {
    let is_out = problem.own_responses(design).is_some_and(|responses| {
        let x = &problem.campaign().doe.points[design as usize];
        ruled_out(problem, &problem.design(x, problem.base()), responses).is_some()
    });
    match is_out {
        true => u32::MAX,
        false => problem.own_samples(design).len() as u32,
    }
}

/// The name of the random streams of a design's samples without the sample's index, and the scheme by
/// which the wear coefficients of the samples are drawn.
#[derive(Debug, Clone, Copy)]
struct Names {
    seed: u64,
    purpose: Purpose,
    design: u64,
    coefficients: stats::Sampling,
}

impl Names {
    /// The names for a design, or for a point's verification or infill samples.
    fn of(problem: &Problem, stream: StreamId) -> Self {
        let campaign = problem.campaign();
        let (verification, number) = VERIFICATION;
        let (purpose, design, coefficients) = match (stream.kind, stream.index) {
            (Kind::Point, infill @ FIRST_INFILL..) => {
                (verification, infill, stats::Sampling::Independent)
            }
            // Independent samples, so that all approaches are verified alike.
            (Kind::Point, _) => (verification, number, stats::Sampling::Independent),
            (_, design) => (Purpose::Wear, design, campaign.sampling.coefficients()),
        };
        Self {
            seed: campaign.seed,
            purpose,
            design,
            coefficients,
        }
    }

    /// The standard normal coefficients of one sample.
    fn scores(self, sample: u64, count: usize) -> Result<Vec<f64>, stats::Error> {
        let Self {
            seed,
            purpose,
            design,
            coefficients,
        } = self;
        stats::normal_coefficients(coefficients, seed, purpose, design, sample, count)
    }

    /// One sample, which does not depend on the other samples drawn.
    fn draw(self, design: &mut dyn PreparedDesign, index: u32) -> Result<Vec<f64>, NoAnswer> {
        let sample = u64::from(index);
        match self.coefficients {
            stats::Sampling::Independent => {
                let mut rng = stream(self.seed, self.purpose, self.design, sample);
                design.sample(&mut rng)
            }
            _ => {
                let scores = self.scores(sample, design.modes());
                let scores = scores.map_err(|error| NoAnswer::Failed(error.to_string()))?;
                design.sample_at(&scores)
            }
        }
    }
}

/// The values of the random inputs of a stored sample of `design`; `None` for a campaign that states none.
#[must_use]
pub fn random_values(
    problem: &Problem,
    stream: StreamId,
    design: &Design,
    sample: u64,
) -> Option<Vec<f64>> {
    let inputs = problem.random()?;
    let names = Names::of(problem, stream);
    let scores = names.scores(sample, inputs.quantities().len()).ok()?;
    inputs.values(design, &scores).ok()
}

/// Samples of the responses, each from its own random stream, until one fails.
fn draw(
    problem: &Problem,
    design: &mut dyn PreparedDesign,
    names: Names,
    unit: &Unit,
    keep_going: &dyn Fn(&Samples) -> bool,
) -> (Samples, Option<Failure>) {
    let mut drawn = Samples::none(problem.sampled().len());
    let mut sample = |index: u32| -> Result<Vec<f64>, NoAnswer> {
        let sample = guarded(|| names.draw(design, index)).map_err(|panic| panicked(&panic))??;
        let sample = problem.sample_of(sample);
        let checked = problem.check_sample(&sample);
        checked.map_err(|(name, why)| NoAnswer::Failed(format!("{name} {why}")))?;
        Ok(sample)
    };
    for index in unit.samples.clone() {
        if !keep_going(&drawn) {
            break;
        }
        let own = match unit.stream.kind {
            Kind::Design => problem.own_samples(unit.stream.index).get(index as usize),
            _ => None,
        };
        let sample = own.map_or_else(|| sample(index), |own| Ok(own.clone()));
        match sample {
            Ok(sample) => drawn.push(&sample),
            Err(why) => {
                let place = format!("{}, sample {index}", stream_name(unit.stream));
                return (drawn, Some(Failure::at(place, Some(index), why)));
            }
        }
    }
    (drawn, None)
}
