//! Whole runs: the budget, the restarts, and what is reported.

use super::{cube, planned, rng};
use cmaes::{Cause, Error, Evaluation, Outcome, Restarts, RunOptions, Stop, minimise_run};

fn sphere(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum()
}

/// A run on the sphere in [−5, 5]⁶ from (3, …, 3), with the number of calls.
fn sphere_run(evaluations: usize, restart_at: usize, seed: u64) -> (Outcome, usize) {
    let mut calls = 0;
    let mut objective = |x: &[f64]| {
        calls += 1;
        sphere(x)
    };
    let run = planned(cube(-5.0, 5.0, 6), evaluations, restart_at);
    let outcome = minimise_run(&[3.0; 6], run, &mut rng(seed), &mut objective).unwrap();
    (outcome, calls)
}

#[test]
fn the_whole_budget_is_used_and_the_planned_restart_comes() {
    let (outcome, calls) = sphere_run(12_000, 6000, 1);
    assert_eq!((outcome.evaluations, calls), (12_000, 12_000));
    assert!(outcome.value < 1e-12 && outcome.violation == 0.0);
    let planned: Vec<usize> = outcome
        .restarts
        .iter()
        .filter(|restart| restart.cause == Cause::Planned)
        .map(|restart| restart.evaluations)
        .collect();
    assert_eq!(planned, [6000]);
    // The sphere is solved in some 1300 evaluations, so the run also restarts by itself.
    let stopped = |restart: &cmaes::Restart| {
        matches!(restart.cause, Cause::Stopped(Stop::ValueTolerance { .. }))
    };
    assert!(
        outcome
            .restarts
            .iter()
            .filter(|restart| stopped(restart))
            .count()
            > 3
    );
}

/// The sphere with the minimum 1, a plateau, and failures everywhere.
#[test]
fn a_run_with_a_tolerance_ends_after_a_restart_that_gains_nothing() {
    let ended = |objective: &dyn Fn(&[f64]) -> f64, tolerance, restarts| {
        let run = RunOptions {
            tolerance,
            restarts,
            restart_at: None,
            ..planned(cube(-5.0, 5.0, 6), 12_000, 6000)
        };
        let mut objective = |x: &[f64]| objective(x);
        minimise_run(&[3.0; 6], run, &mut rng(1), &mut objective)
    };
    let raised = |x: &[f64]| 1.0 + sphere(x);
    let outcome = ended(&raised, 1e-6, Restarts::FromBest).unwrap();
    assert_eq!(outcome.restarts.len(), 1);
    assert!(outcome.evaluations < 4000, "{}", outcome.evaluations);
    assert!(outcome.value - 1.0 < 1e-6, "{}", outcome.value);
    // The tolerance is relative: a minimum of 0 is followed until rounding ends the search.
    let outcome = ended(&sphere, 1e-6, Restarts::FromBest).unwrap();
    assert!(outcome.value < 1e-12, "{}", outcome.value);
    for (tolerance, restarts) in [(0.0, Restarts::FromBest), (1e-6, Restarts::Ipop)] {
        let outcome = ended(&raised, tolerance, restarts).unwrap();
        assert_eq!(outcome.evaluations, 12_000, "{restarts:?}");
    }
    let outcome = ended(&|_| 7.0, 1e-6, Restarts::FromBest).unwrap();
    assert_eq!(outcome.evaluations, 12_000, "a plateau is no optimum");
    let failed = ended(&|_| f64::NAN, 1e-6, Restarts::FromBest);
    assert_eq!(
        failed,
        Err(Error::NothingUsable {
            evaluations: 12_000
        })
    );
}

#[test]
fn the_history_improves_up_to_the_outcome() {
    let (outcome, _) = sphere_run(12_000, 6000, 1);
    for pair in outcome.history.windows(2) {
        assert!(pair[0].0 < pair[1].0 && pair[1].1.is_better_than(&pair[0].1));
    }
    let (_, last) = outcome.history.last().unwrap();
    assert_eq!(
        (last.value, last.violation),
        (outcome.value, outcome.violation)
    );
    assert_eq!(sphere(&outcome.x).to_bits(), outcome.value.to_bits());
    for restart in &outcome.restarts {
        let before = outcome
            .history
            .iter()
            .rfind(|(at, _)| *at <= restart.evaluations);
        assert_eq!(restart.best, before.map(|(_, best)| *best));
    }
}

#[test]
fn a_run_is_reproducible_to_the_bit() {
    let run = |seed| sphere_run(3000, 1500, seed);
    assert_eq!(run(7), run(7));
    assert_ne!(run(7).0.x, run(8).0.x);
}

/// A budget that is no multiple of the population, down to a single evaluation.
#[test]
fn odd_budgets_are_kept() {
    for evaluations in [1, 9, 10, 11, 1234] {
        for restart_at in [0, 5, 600, 5000] {
            let (outcome, calls) = sphere_run(evaluations, restart_at, 1);
            assert_eq!((outcome.evaluations, calls), (evaluations, evaluations));
            let planned = outcome
                .restarts
                .iter()
                .filter(|r| r.cause == Cause::Planned)
                .count();
            // Restarting at 5 happens after the first whole generation, if the budget has one.
            let expected = (1..evaluations).contains(&restart_at.next_multiple_of(10));
            assert_eq!(
                planned,
                usize::from(expected),
                "{evaluations} with {restart_at}"
            );
        }
    }
}

/// Feasible near one corner only; the better values are all infeasible.
#[test]
fn a_run_ends_on_a_feasible_design() {
    let bounds = cube(0.0, 1.0, 11);
    let mut objective = |x: &[f64]| Evaluation {
        value: x.iter().sum::<f64>(),
        violation: x.iter().map(|v| (0.9 - v).max(0.0)).sum(),
    };
    let run = planned(bounds, 12_000, 6000);
    let outcome = minimise_run(&[0.1; 11], run, &mut rng(1), &mut objective).unwrap();
    assert_eq!(outcome.violation, 0.0);
    assert!((outcome.value - 9.9).abs() < 1e-3, "{}", outcome.value);
}
