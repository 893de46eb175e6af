//! Whole runs: the budget, the restarts, and what is reported.

use super::{cube, rng};
use cmaes::{Cause, Error, Evaluation, Outcome, Schedule, Stop, minimise};

fn sphere(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum()
}

/// A run on the sphere in [−5, 5]⁶ from (3, …, 3), with the number of calls.
fn sphere_run(schedule: &Schedule, seed: u64) -> (Outcome, usize) {
    let mut calls = 0;
    let mut objective = |x: &[f64]| {
        calls += 1;
        sphere(x)
    };
    let bounds = cube(-5.0, 5.0, 6);
    let outcome = minimise(&[3.0; 6], &bounds, schedule, &mut rng(seed), &mut objective).unwrap();
    (outcome, calls)
}

#[test]
fn the_default_is_the_papers() {
    let expected = Schedule {
        evaluations: 12_000,
        restart_at: 6000,
        step: 0.3,
        population: 10,
        parents: 5,
    };
    assert_eq!(Schedule::default(), expected);
}

#[test]
fn the_whole_budget_is_used_and_the_planned_restart_comes() {
    let (outcome, calls) = sphere_run(&Schedule::default(), 1);
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

#[test]
fn the_history_improves_up_to_the_outcome() {
    let (outcome, _) = sphere_run(&Schedule::default(), 1);
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
    let schedule = Schedule {
        evaluations: 3000,
        restart_at: 1500,
        ..Schedule::default()
    };
    assert_eq!(sphere_run(&schedule, 7), sphere_run(&schedule, 7));
    assert_ne!(sphere_run(&schedule, 7).0.x, sphere_run(&schedule, 8).0.x);
}

/// A budget that is no multiple of the population, down to a single evaluation.
#[test]
fn odd_budgets_are_kept() {
    for evaluations in [1, 9, 10, 11, 1234] {
        for restart_at in [0, 5, 600, 5000] {
            let schedule = Schedule {
                evaluations,
                restart_at,
                ..Schedule::default()
            };
            let (outcome, calls) = sphere_run(&schedule, 1);
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

#[test]
fn failures_everywhere_are_an_error() {
    let schedule = Schedule {
        evaluations: 1000,
        ..Schedule::default()
    };
    let bounds = cube(0.0, 1.0, 3);
    let result = minimise(
        &[0.5; 3],
        &bounds,
        &schedule,
        &mut rng(1),
        &mut |_: &[f64]| f64::NAN,
    );
    assert_eq!(result, Err(Error::NothingUsable { evaluations: 1000 }));
    let schedule = Schedule {
        evaluations: 0,
        ..Schedule::default()
    };
    let result = minimise(
        &[0.5; 3],
        &bounds,
        &schedule,
        &mut rng(1),
        &mut |_: &[f64]| 1.0,
    );
    assert_eq!(result, Err(Error::NoBudget));
}

/// The start lies where nothing can be evaluated; restarts from random points find the rest.
#[test]
fn a_run_gets_out_of_a_region_of_failures() {
    let bounds = cube(0.0, 1.0, 2);
    let mut island = |x: &[f64]| {
        let distance = (x[0] - 0.95).hypot(x[1] - 0.95);
        if distance < 0.04 { distance } else { f64::NAN }
    };
    let start = [0.0; 2];
    let outcome = minimise(
        &start,
        &bounds,
        &Schedule::default(),
        &mut rng(1),
        &mut island,
    )
    .unwrap();
    assert!(outcome.value < 1e-6, "{}", outcome.value);
    let first = outcome.restarts[0];
    assert!(matches!(first.cause, Cause::Stopped(Stop::AllFailed { .. })) && first.best.is_none());
}

/// Feasible near one corner only; the better values are all infeasible.
#[test]
fn a_run_ends_on_a_feasible_design() {
    let bounds = cube(0.0, 1.0, 11);
    let mut objective = |x: &[f64]| Evaluation {
        value: x.iter().sum::<f64>(),
        violation: x.iter().map(|v| (0.9 - v).max(0.0)).sum(),
    };
    let outcome = minimise(
        &[0.1; 11],
        &bounds,
        &Schedule::default(),
        &mut rng(1),
        &mut objective,
    )
    .unwrap();
    assert_eq!(outcome.violation, 0.0);
    assert!((outcome.value - 9.9).abs() < 1e-3, "{}", outcome.value);
}
