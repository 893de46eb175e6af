//! Does another build of the simulator give the same numbers to the last bit?
//!
//! Two builds may differ in a mathematical library, a compiler or a processor's instructions, and
//! then their samples differ in a last digit. A campaign's table would depend on who computed what.
//! So every worker answers the same questions at the start, and only workers that answer like the
//! coordinator are let in.

use rand::RngExt as _;
use sha2::{Digest, Sha256};
use stats::streams::{Purpose, stream};

use crate::formulation::{Problem, ROBUST_VARIABLES, Variables};

/// How many designs are simulated; about two in three can be.
const DESIGNS: u64 = 12;

/// SHA-256, as hex, of the bits of a fixed set of simulations of `problem`.
#[must_use]
pub fn model_digest(problem: &Problem) -> String {
    let mut hash = Sha256::new();
    let mut absorb = |value: f64| hash.update(value.to_bits().to_le_bytes());
    let frozen = problem.printed_frozen();
    for design in 0..DESIGNS {
        let mut rng = stream(0, Purpose::Test, design, 0);
        let unit: [f64; ROBUST_VARIABLES] = std::array::from_fn(|_| rng.random());
        let variables = Variables::robust(&problem.robust_point(&unit), &frozen);
        let Ok(pair) = problem.pair(&variables) else {
            absorb(0.0);
            continue;
        };
        let unworn = pair.unworn();
        absorb(unworn.delta_ste_um);
        let criteria = problem.criteria(&pair, unworn.hertz_pressure_mpa);
        absorb(criteria.hertz_pressure_mpa);
        absorb(criteria.root_stress_mpa);
        absorb(criteria.specific_sliding);
        absorb(pair.archard(problem.wear()).analysis.delta_ste_um);
        let mut sampler = pair.sampler(problem.wear());
        for _ in 0..2 {
            absorb(sampler.draw(&mut rng));
        }
    }
    hash.finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}
