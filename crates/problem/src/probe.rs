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
    let answers = answers_of(problem, DESIGNS);
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

/// The answers of `simulator` about the first `designs` of a fixed set of designs. The first sample
/// of all is drawn twice.
///
/// A design on which the simulator fails, or gives no number, is an answer like a refusal.
///
/// # Errors
///
/// The simulator failed on every design, gave two values for one seed, or cannot be run.
pub fn answers_of(simulator: &dyn Simulator, designs: u32) -> Result<Answers, ProbeError> {
    let mut hash = Sha256::new();
    let (mut sampled, mut equal) = (0, 0);
    if let Some(version) = simulator.version() {
        hash.update(version.as_bytes());
    }
    let problem = simulator.problem();
    let (mut failed, mut error) = (0, String::new());
    let mut fault = None;
    for design in 0..u64::from(designs) {
        // The stream gives the point of the design, and then its samples.
        let begin = || {
            let mut rng = stream(0, Purpose::Test, design, 0);
            let unit: Vec<f64> = (0..problem.dimension()).map(|_| rng.random()).collect();
            (unit, rng)
        };
        let (unit, mut rng) = begin();
        let asked = problem.design(&problem.free_point(&unit), problem.base());
        let mut absorb = |value: f64| hash.update(value.to_bits().to_le_bytes());
        let mut answer = || -> Result<(), NoAnswer> {
            let mut design = simulator.prepare(&asked)?;
            for state in [State::Nominal, State::Baseline] {
                let analysis = design.analyse(state)?;
                absorb(analysis.value);
                analysis
                    .criteria
                    .values()
                    .iter()
                    .copied()
                    .for_each(&mut absorb);
            }
            let mut sample = |rng: &mut StreamRng| design.sample(rng);
            let [first, second] = [sample(&mut rng)?, sample(&mut rng)?];
            first.iter().chain(&second).copied().for_each(&mut absorb);
            if sampled == 0 {
                let again = sample(&mut begin().1)?;
                let bits =
                    |values: &[f64]| values.iter().map(|one| one.to_bits()).collect::<Vec<_>>();
                if bits(&again) != bits(&first) {
                    let [first, again] = [&first, &again].map(|values| listed(values));
                    fault = Some(format!(
                        "one sample, asked for twice with the same seed, was {first} and then \
                         {again}: the answers must depend on the request alone \
                         (simulator.probe_designs = 0 leaves the check out)"
                    ));
                }
            }
            // A failed sample does not show whether the seed matters.
            let is_given = first.iter().all(|value| value.is_finite());
            sampled += u32::from(is_given);
            equal += u32::from(is_given && first == second);
            Ok(())
        };
        match answer() {
            Ok(()) => {}
            Err(NoAnswer::Refused(_)) => absorb(0.0),
            Err(NoAnswer::Failed(why)) => {
                failed += 1;
                absorb(1.0);
                error = format!("question {design} of the model digest: {why}");
            }
            Err(NoAnswer::Machine(why)) => return Err(ProbeError::Machine(why)),
        }
    }
    if let Some(fault) = fault {
        return Err(ProbeError::Contradicts(fault));
    }
    if failed == designs && failed > 0 {
        return Err(ProbeError::Fails(error));
    }
    Ok(Answers {
        digest: hex::encode(hash.finalize()),
        sampled,
        equal,
    })
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
        let digest = |problem, designs| answers_of(problem, designs).unwrap().digest;
        assert_ne!(digest(&paper, 2), digest(&paper, 3));
        assert_ne!(digest(&paper, 2), digest(&other, 2));
        let answers = answers_of(&paper, DESIGNS).unwrap();
        assert!(answers.sampled > 1 && answers.equal == 0, "{answers:?}");
    }
}
