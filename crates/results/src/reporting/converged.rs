//! Whether an optimum is one of the grid: its percentile on the converged grid.

use campaign::Variables;
use campaign::formulation::Problem;
use gear::Pair;
use stats::streams::{Purpose, stream};

/// Samples of both percentiles, from the same wear.
const SAMPLES: u64 = 100;
/// Relative change of ΔSTE at which a grid counts as converged.
const TOLERANCE: f64 = 1e-5;

/// P90 on the converged grid less P90 on the campaign's grid, µm. None if the design cannot be simulated.
pub(super) fn difference_um(problem: &Problem, variables: &Variables) -> Option<f64> {
    let wear = problem.wear();
    let coarse = problem.pair(variables).ok()?;
    let fine = Pair::converged(&problem.pair_input(variables), wear, TOLERANCE).ok()?;
    let p90 = |pair: &Pair| {
        let mut sampler = pair.sampler(wear);
        let seed = problem.campaign().seed;
        let samples: Vec<f64> = (0..SAMPLES)
            .map(|sample| sampler.draw(&mut stream(seed, Purpose::Verify, 0, sample)))
            .collect();
        stats::percentile_p90(&samples)
            .ok()
            .map(|estimate| estimate.p90)
    };
    Some(p90(&fine.pair)? - p90(&coarse)?)
}

#[cfg(test)]
mod tests {
    use campaign::Campaign;

    use super::*;

    /// On a grid twice as fine in both directions something changes, but little.
    #[test]
    fn the_campaigns_grid_is_close_to_the_converged_one() {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let problem = Problem::new(campaign);
        let x = problem.robust_point(&[0.5; 6]);
        let variables = Variables::robust(&x, &problem.printed_frozen());
        let difference = difference_um(&problem, &variables).unwrap().abs();
        assert!(difference > 0.0 && difference < 0.01, "{difference}");
    }
}
