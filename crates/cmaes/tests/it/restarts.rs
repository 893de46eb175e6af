//! Restarts with growing populations.

use super::{cube, options, rng};
use cmaes::{Restarts, RunOptions, minimise_run};

fn rastrigin(x: &[f64]) -> f64 {
    x.iter()
        .map(|v| v * v + 10.0 * (1.0 - (std::f64::consts::TAU * v).cos()))
        .sum()
}

fn best(restarts: Restarts, seed: u64) -> f64 {
    let run = RunOptions {
        search: options(cube(-5.0, 5.0, 6)),
        evaluations: 60_000,
        restarts,
    };
    let outcome = minimise_run(&[3.3; 6], run, &mut rng(seed), &mut |x: &[f64]| {
        rastrigin(x)
    })
    .unwrap();
    assert_eq!(outcome.evaluations, 60_000);
    outcome.value
}

/// Rastrigin's function in 6 variables has 11⁶ minima in the box, and the global one stands out only
/// to a search that looks far: λ of some hundreds finds it, λ = 10 does not.
#[test]
fn growing_populations_find_the_global_minimum_where_restarts_from_the_best_do_not() {
    for restarts in [Restarts::Ipop, Restarts::Bipop] {
        let found = (0..5).filter(|&seed| best(restarts, seed) < 1e-9).count();
        assert!(found >= 4, "{restarts:?} found it with {found} of 5 seeds");
    }
    let stuck = Restarts::FromBest { planned: 0 };
    assert!((0..5).any(|seed| best(stuck, seed) > 0.5));
}

#[test]
fn ipop_doubles_and_bipop_alternates() {
    let populations = |restarts| {
        let mut run = cmaes::Run::new(
            &[3.3; 6],
            RunOptions {
                search: options(cube(-5.0, 5.0, 6)),
                evaluations: 40_000,
                restarts,
            },
        )
        .unwrap();
        let mut rng = rng(3);
        let mut seen = Vec::new();
        while !run.is_finished() {
            let candidates = run.ask(&mut rng);
            let full = candidates.len();
            let values: Vec<f64> = candidates.iter().map(|x| rastrigin(x)).collect();
            run.tell(&values, &mut rng).unwrap();
            if seen.last() != Some(&full) && !run.is_finished() {
                seen.push(full);
            }
        }
        seen
    };
    let doubled = populations(Restarts::Ipop);
    assert!(
        doubled.len() >= 4 && doubled.starts_with(&[10, 20, 40, 80]),
        "{doubled:?}"
    );
    let alternating = populations(Restarts::Bipop);
    assert!(
        alternating.windows(2).any(|pair| pair[1] < pair[0]),
        "{alternating:?}"
    );
}
