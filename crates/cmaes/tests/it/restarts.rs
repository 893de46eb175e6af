//! Restarts with growing populations.

use super::{cube, options, rng};
use cmaes::{Restarts, Run, RunOptions};

fn rastrigin(x: &[f64]) -> f64 {
    x.iter()
        .map(|v| v * v + 10.0 * (1.0 - (std::f64::consts::TAU * v).cos()))
        .sum()
}

#[test]
fn ipop_doubles_and_bipop_alternates() {
    let populations = |restarts| {
        let mut run = Run::new(
            &[3.3; 6],
            RunOptions {
                search: options(cube(-5.0, 5.0, 6)),
                evaluations: 40_000,
                tolerance: 0.0,
                restarts,
                restart_at: None,
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

/// A small search gets half the evaluations of the last large one, not of all large ones together.
/// Here large searches end on a plateau, and small ones improve until their share is used up.
#[test]
fn a_small_search_of_bipop_has_at_most_half_of_the_last_large_one() {
    let run_options = RunOptions {
        search: options(cube(-5.0, 5.0, 2)),
        evaluations: 20_000,
        tolerance: 0.0,
        restarts: Restarts::Bipop,
        restart_at: None,
    };
    let mut run = Run::new(&[3.3; 2], run_options).unwrap();
    let mut rng = rng(3);
    // Population and evaluations of each search. A search is a large one if its population exceeds
    // all earlier ones.
    let mut searches = vec![(10, 0)];
    let mut largest = 0;
    while run.evaluations() < 19_000 {
        let population = run.ask(&mut rng).len();
        let restarts = run.restarts().len();
        if restarts == searches.len() {
            largest = largest.max(searches[restarts - 1].0);
            searches.push((population, 0));
        }
        searches[restarts].1 += population;
        let is_large = population > largest;
        let value = |i| {
            if is_large {
                0.0
            } else {
                -((run.evaluations() + i) as f64)
            }
        };
        let values: Vec<f64> = (0..population).map(value).collect();
        run.tell(&values, &mut rng).unwrap();
    }
    searches.pop();
    let (mut last_large, mut largest, mut small) = (0, 10, 0);
    for &(population, spent) in &searches[1..] {
        if population > largest {
            (largest, last_large) = (population, spent);
            continue;
        }
        small += 1;
        // The budget of a small search is checked after each generation.
        assert!(
            spent < last_large / 2 + population,
            "{spent} of {last_large} in {searches:?}"
        );
    }
    assert!(small > 4 && largest > 40, "{searches:?}");
}
