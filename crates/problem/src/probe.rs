//! Detection of builds of the simulator that do not give the same numbers to the last bit.
//!
//! Two builds may differ in a mathematical library, a compiler or a processor's instructions, and
//! then their samples differ in the last digits. A campaign's results would depend on which worker
//! computed which sample. Therefore every worker answers a fixed set of questions at the start, and
//! only workers with the coordinator's answers are admitted.

use rand::RngExt as _;
use sha2::{Digest, Sha256};
use stats::streams::{Purpose, StreamRng, stream};

use crate::file::SimulatorSection;
use crate::formulation::Problem;
use crate::simulator::{NoAnswer, Simulator, State};

/// Number of designs to simulate, of which about two in three are simulable.
pub const DESIGNS: u32 = SimulatorSection::MAX_PROBE_DESIGNS;

/// SHA-256, as hex, of the bits of a fixed set of simulations of `problem` by the built-in model.
///
/// # Panics
///
/// Never: the built-in model refuses designs, but does not fail.
#[must_use]
pub fn model_digest(problem: &Problem) -> String {
    let answers = (0..u64::from(DESIGNS)).map(|design| ask(problem, design));
    let answers = answers.collect::<Result<Vec<_>, _>>();
    let answers = answers.and_then(|answers| conclude(problem, &answers));
    answers
        .expect("the built-in model refuses but never fails")
        .digest
}

/// The result of a probe.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answers {
    /// SHA-256, as hex, of the bits of the answers, and of the version that the simulator reports.
    pub digest: String,
    /// Number of designs sampled with two different seeds.
    pub sampled: u32,
    /// Number of these designs whose two samples are equal.
    pub equal: u32,
}

impl Answers {
    /// Whether no sample depended on its seed.
    #[must_use]
    pub const fn ignores_seeds(&self) -> bool {
        self.sampled > 0 && self.equal == self.sampled
    }
}

/// Why a probe has no result. The text is a sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ProbeError {
    /// The simulator failed on every design. Another attempt may succeed.
    Fails(String),
    /// The simulator gave two values for one seed.
    Contradicts(String),
    /// The machine cannot run the simulator.
    Machine(String),
}

/// The answers about one design of the probe.
#[derive(Debug, Clone, Default)]
pub struct DesignAnswers {
    /// The numbers, in the order in which they enter the digest.
    numbers: Vec<f64>,
    /// Two samples with different seeds, if the first one is a number.
    samples: Option<[Vec<f64>; 2]>,
    /// Why the simulator failed.
    failure: Option<String>,
}

/// The point of a design of the probe in the unit cube, and the stream of its samples.
fn begin(problem: &Problem, design: u64) -> (Vec<f64>, StreamRng) {
    let mut rng = stream(0, Purpose::Test, design, 0);
    let unit = (0..problem.dimension()).map(|_| rng.random()).collect();
    (unit, rng)
}

/// Asks `simulator` about one design of the probe.
///
/// A design on which the simulator fails, or gives no number, is an answer like a refusal.
///
/// # Errors
///
/// The machine cannot run the simulator.
pub fn ask(simulator: &dyn Simulator, design: u64) -> Result<DesignAnswers, ProbeError> {
    let problem = simulator.problem();
    let (unit, mut rng) = begin(problem, design);
    let asked = problem.design(&problem.free_point(&unit), problem.base());
    let mut answers = DesignAnswers::default();
    let mut answer = || -> Result<(), NoAnswer> {
        let mut prepared = simulator.prepare(&asked)?;
        for state in [State::Nominal, State::Baseline] {
            let analysis = prepared.analyse(state)?;
            answers.numbers.push(analysis.value);
            answers.numbers.extend(analysis.criteria.values());
        }
        let first = prepared.sample(&mut rng)?;
        let second = prepared.sample(&mut rng)?;
        answers.numbers.extend(first.iter().chain(&second));
        // A failed sample does not show whether the seed matters.
        if first.iter().all(|value| value.is_finite()) {
            answers.samples = Some([first, second]);
        }
        Ok(())
    };
    match answer() {
        Ok(()) => {}
        Err(NoAnswer::Refused(_)) => answers.numbers.push(0.0),
        Err(NoAnswer::Failed(why)) => {
            answers.numbers.push(1.0);
            answers.failure = Some(format!("question {design} of the model digest: {why}"));
        }
        Err(NoAnswer::Machine(why)) => return Err(ProbeError::Machine(why)),
    }
    Ok(answers)
}

/// The result of a probe, from the answers about its first designs. `simulator` draws the first of all samples once
/// more, to compare both values.
///
/// # Errors
///
/// The simulator failed on every design, gave two values for one seed, or cannot be run.
pub fn conclude(
    simulator: &dyn Simulator,
    answers: &[DesignAnswers],
) -> Result<Answers, ProbeError> {
    let failures: Vec<&String> = answers
        .iter()
        .filter_map(|one| one.failure.as_ref())
        .collect();
    if let Some(last) = failures.last()
        && failures.len() == answers.len()
    {
        return Err(ProbeError::Fails((*last).clone()));
    }
    let sampled = (0..).zip(answers);
    let mut sampled = sampled.filter_map(|(design, one)| Some((design, one.samples.as_ref()?)));
    let equal = |samples: &[Vec<f64>; 2]| samples[0] == samples[1];
    let (mut number, mut equals) = (0, 0);
    if let Some((design, samples)) = sampled.next() {
        repeat(simulator, design, &samples[0])?;
        (number, equals) = (1, u32::from(equal(samples)));
    }
    for (_, samples) in sampled {
        number += 1;
        equals += u32::from(equal(samples));
    }
    let mut hash = Sha256::new();
    if let Some(version) = simulator.version() {
        hash.update(version.as_bytes());
    }
    for number in answers.iter().flat_map(|one| &one.numbers) {
        hash.update(number.to_bits().to_le_bytes());
    }
    Ok(Answers {
        digest: hex::encode(hash.finalize()),
        sampled: number,
        equal: equals,
    })
}

/// Draws the first sample of a design again, which must be the same.
fn repeat(simulator: &dyn Simulator, design: u64, first: &[f64]) -> Result<(), ProbeError> {
    let problem = simulator.problem();
    let (unit, mut rng) = begin(problem, design);
    let asked = problem.design(&problem.free_point(&unit), problem.base());
    let prepared = simulator.prepare(&asked);
    let again = match prepared.and_then(|mut prepared| prepared.sample(&mut rng)) {
        Ok(again) => again,
        // There is no second value to compare.
        Err(NoAnswer::Refused(_) | NoAnswer::Failed(_)) => return Ok(()),
        Err(NoAnswer::Machine(why)) => return Err(ProbeError::Machine(why)),
    };
    let bits = |values: &[f64]| values.iter().map(|one| one.to_bits()).collect::<Vec<_>>();
    if bits(&again) == bits(first) {
        return Ok(());
    }
    let [first, again] = [first, &again].map(listed);
    Err(ProbeError::Contradicts(format!(
        "one sample, asked for twice with the same seed, was {first} and then {again}: the answers must depend on the \
         request alone (simulator.probe_designs = 0 leaves the check out)"
    )))
}

/// The values of a sample in messages.
fn listed(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(f64::to_string).collect();
    values.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Campaign;

    #[test]
    fn the_digest_depends_on_the_problem_and_on_how_much_is_asked() {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let paper = Problem::new(campaign.clone());
        campaign.gears_mut().unwrap().load.pinion_torque_nm += 1.0;
        let other = Problem::new(campaign);
        assert_eq!(model_digest(&paper), model_digest(&paper));
        assert_ne!(model_digest(&paper), model_digest(&other));
        let answers_of = |problem: &Problem, designs| {
            let answers = (0..designs).map(|design| ask(problem, design).unwrap());
            conclude(problem, &answers.collect::<Vec<_>>()).unwrap()
        };
        let digest = |problem, designs| answers_of(problem, designs).digest;
        assert_ne!(digest(&paper, 2), digest(&paper, 3));
        assert_ne!(digest(&paper, 2), digest(&other, 2));
        let answers = answers_of(&paper, u64::from(DESIGNS));
        assert!(answers.sampled > 1 && answers.equal == 0, "{answers:?}");
    }
}
