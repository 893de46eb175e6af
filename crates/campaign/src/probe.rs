//! Detection of builds of the simulator that do not give the same numbers to the last bit.
//!
//! Two builds may differ in a mathematical library, a compiler or a processor's instructions, and
//! then their samples differ in the last digits. A campaign's results would depend on which worker
//! computed which sample. Therefore every worker answers a fixed set of questions at the start, and
//! only workers with the coordinator's answers are admitted.

use rand::RngExt as _;
use sha2::{Digest, Sha256};
use stats::streams::{Purpose, stream};

use crate::formulation::Problem;
use crate::simulator::{NoAnswer, Simulator, State};

/// Number of designs to simulate, of which about two in three are simulable.
pub const DESIGNS: u32 = 12;

/// SHA-256, as hex, of the bits of a fixed set of simulations of `problem` by the built-in model.
///
/// # Panics
///
/// Never: the built-in model refuses designs, but does not fail.
#[must_use]
pub fn model_digest(problem: &Problem) -> String {
    digest_of(problem, DESIGNS).expect("the built-in model refuses but never fails")
}

/// SHA-256, as hex, of the bits of the answers of `simulator` about the first `designs` of a fixed
/// set of designs, and of the version that it reports.
///
/// # Errors
///
/// A sentence: the simulator failed.
pub fn digest_of(simulator: &dyn Simulator, designs: u32) -> Result<String, String> {
    let mut hash = Sha256::new();
    if let Some(version) = simulator.version() {
        hash.update(version.as_bytes());
    }
    let problem = simulator.problem();
    for design in 0..u64::from(designs) {
        let mut rng = stream(0, Purpose::Test, design, 0);
        let unit: Vec<f64> = (0..problem.dimension()).map(|_| rng.random()).collect();
        let asked = problem.design(&problem.free_point(&unit), problem.base());
        let mut absorb = |value: f64| hash.update(value.to_bits().to_le_bytes());
        let mut answer = || -> Result<(), NoAnswer> {
            let mut design = simulator.prepare(&asked)?;
            for state in [State::Nominal, State::Baseline] {
                let analysis = design.analyse(state)?;
                absorb(analysis.value_um);
                analysis
                    .criteria
                    .values()
                    .iter()
                    .copied()
                    .for_each(&mut absorb);
            }
            for _ in 0..2 {
                absorb(design.sample(&mut rng).map_err(NoAnswer::Failed)?);
            }
            Ok(())
        };
        match answer() {
            Ok(()) => {}
            Err(NoAnswer::Refused(_)) => absorb(0.0),
            Err(NoAnswer::Failed(error)) => {
                return Err(format!("question {design} of the model digest: {error}"));
            }
        }
    }
    Ok(hash
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect())
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
        assert_ne!(digest_of(&paper, 2), digest_of(&paper, 3));
        assert_ne!(digest_of(&paper, 2), digest_of(&other, 2));
    }
}
