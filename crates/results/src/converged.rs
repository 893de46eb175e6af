//! The error of the campaign's grid: an optimum's measure on the converged grid.

use gear::Pair;
use problem::Design;
use problem::formulation::Problem;
use problem::task::VERIFICATION;
use stats::streams::stream;

/// Samples of both measures, from the same random numbers.
const SAMPLES: u64 = 100;
/// Relative change of ΔSTE at which a grid counts as converged.
const TOLERANCE: f64 = 1e-5;

/// The measure on the converged grid less that on the campaign's grid, µm. `None` if the built-in model cannot
/// simulate the design, and for an external simulator.
pub(crate) fn difference_um(problem: &Problem, design: &Design) -> Option<f64> {
    let built_in = !problem.campaign().is_external();
    let gears = problem.gears().filter(|_| built_in)?;
    let coarse = gears.pair(design).ok()?;
    let fine = Pair::converged(&gears.pair_input(design), gears.wear(), TOLERANCE).ok()?;
    let p90 = |pair: &Pair| {
        let mut sampler = gears.sampler(pair);
        let (seed, (purpose, number)) = (problem.campaign().seed, VERIFICATION);
        let samples: Vec<f64> = (0..SAMPLES)
            .map(|sample| sampler.draw(&mut stream(seed, purpose, number, sample)))
            .collect();
        let sampling = &problem.campaign().sampling;
        sampling
            .verified(&samples)
            .ok()
            .map(|verified| verified.value)
    };
    Some(p90(&fine.pair)? - p90(&coarse)?)
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    #[test]
    fn the_campaigns_grid_is_close_to_the_converged_one() {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let problem = Problem::new(campaign);
        let x = problem.free_point(&[0.5; 6]);
        let design = problem.design(&x, problem.base());
        let difference = difference_um(&problem, &design).unwrap().abs();
        assert!(difference > 0.0 && difference < 0.01, "{difference}");
    }
}
