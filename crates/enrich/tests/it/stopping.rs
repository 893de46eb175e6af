//! When the enrichment may stop: what `Converged` guarantees, and when the reason is the budget.

use super::{Problem, add, carry_out, enrich, options, sampled, unit};
use enrich::{Criterion, Decision, Infill, Options, Reason, RoundRecord, State, Stop, decide};

/// A round that expected nothing.
const NOTHING_EXPECTED: RoundRecord = RoundRecord {
    expected_improvement: Some(0.0),
    asked: 1,
    failed: 0,
};

/// Shallow waves whose minima, 0.9, lie on a grid, and a valley of 0.5 around (0.8, 0.8).
fn waves() -> Problem {
    Problem {
        bounds: unit(2),
        response: |x| {
            let waves = 0.1 * (12.0 * x[0]).cos() * (12.0 * x[1]).cos();
            let squares = (x[0] - 0.8).powi(2) + (x[1] - 0.8).powi(2);
            1.0 + waves - 0.5 * (-squares / 0.06).exp()
        },
        noise: 0.001,
        violation: |_| Some(0.0),
    }
}

/// The waves with a dense grid in the lower left quarter of the box and nothing elsewhere: the three
/// best basins lie in the quarter and hold no surprises.
fn quarter(problem: &Problem) -> State {
    let mut state = State::default();
    for i in 0..49 {
        let x = vec![f64::from(i / 7) * 0.08, f64::from(i % 7) * 0.08];
        add(problem, &mut state, x, i as usize, 30);
    }
    state
}

fn small_batch(problem: &Problem, batch: usize) -> Options {
    Options {
        batch,
        delta_um: 0.005,
        region_points: 5,
        ..options(problem)
    }
}

#[test]
fn a_small_batch_does_not_converge_before_the_whole_box_is_searched() {
    let problem = waves();
    for batch in 1..=3 {
        let settings = small_batch(&problem, batch);
        let mut state = quarter(&problem);
        state.rounds.push(NOTHING_EXPECTED);
        let decision = decide(&state, &settings, &problem.violation).unwrap();
        assert_eq!(decision.stop, None, "batch {batch}");
        assert!(decision.expected_improvement.unwrap() >= settings.delta_um);
        assert!((1..=batch).contains(&decision.infill.len()));
        // One search per region, three basins with two models each and the box, whatever the batch.
        let searches = decision.constraint_evaluations / settings.search_evaluations as u64;
        assert!(searches <= 7, "batch {batch}: {searches} searches");

        let end = enrich(&problem, &mut state, &settings, 60);
        assert!(
            matches!(end.stop, Some(Stop::Converged { .. })),
            "batch {batch}: {:?}",
            end.stop
        );
        let best = end.recommendation.unwrap();
        let truth = (problem.response)(&best.x);
        assert!(truth < 0.6, "batch {batch}: {truth} at {:?}", best.x);
    }
}

/// The whole box has its turns even while the best basin always has something to gain.
#[test]
fn batches_of_one_point_visit_every_region_in_turn() {
    let problem = waves();
    let settings = Options {
        delta_um: 1e-9,
        ..small_batch(&problem, 1)
    };
    let mut state = quarter(&problem);
    let mut reasons = Vec::new();
    for _ in 0..4 {
        let decision = decide(&state, &settings, &problem.violation).unwrap();
        for infill in &decision.infill {
            reasons.push(match infill {
                Infill::New { reason, .. } => Some(*reason),
                Infill::More { .. } => None,
            });
        }
        carry_out(&problem, &mut state, &decision);
    }
    assert_eq!(reasons.len(), 4);
    assert!(reasons.contains(&Some(Reason::Global)), "{reasons:?}");
    assert!(reasons.contains(&Some(Reason::Local)), "{reasons:?}");
}

/// More samples have no value, and the samples left do not pay for a new design.
#[test]
fn a_budget_too_small_for_a_new_design_is_not_convergence() {
    let problem = waves();
    let mut state = quarter(&problem);
    state.rounds.push(NOTHING_EXPECTED);
    let settings = Options {
        samples_new: 100,
        samples_more: 10,
        samples_left: 50,
        ..small_batch(&problem, 12)
    };
    let decision = decide(&state, &settings, &problem.violation).unwrap();
    assert_eq!(decision.stop, Some(Stop::Budget { samples: 50 }));
    assert!(decision.expected_improvement.unwrap() >= settings.delta_um);
    let ample = Options {
        samples_left: 100,
        ..settings
    };
    let decision = decide(&state, &ample, &problem.violation).unwrap();
    assert_eq!((decision.stop, decision.infill.len()), (None, 1));
}

#[test]
fn there_are_no_more_rounds_than_there_may_be() {
    let problem = Problem {
        response: |x| 1.0 + x[0],
        noise: 0.1,
        ..waves()
    };
    let mut state = sampled(&problem, 30, 30);
    let limited = Options {
        rounds: 1,
        ..options(&problem)
    };
    let first = decide(&state, &limited, &problem.violation).unwrap();
    assert_eq!(first.stop, None);
    state.rounds.push(RoundRecord {
        expected_improvement: first.expected_improvement,
        asked: 0,
        failed: 0,
    });
    let second = decide(&state, &limited, &problem.violation).unwrap();
    assert_eq!(second.stop, Some(Stop::Rounds { rounds: 1 }));
    assert!(second.recommendation.is_some() && second.infill.is_empty());
}

/// The whole feasible set is one design, (0.25, 0.5), which has one sample: it is number 20.
fn sole_design() -> (Problem, State) {
    let problem = Problem {
        bounds: unit(2),
        response: |x| 3.0 + (20.0 * x[0]).sin() * (20.0 * x[1]).sin(),
        noise: 0.05,
        violation: |x| {
            let off = (x[0] - 0.25).abs().max((x[1] - 0.5).abs());
            Some(if off < 1e-9 { 0.0 } else { off })
        },
    };
    let mut state = sampled(&problem, 20, 30);
    add(&problem, &mut state, vec![0.25, 0.5], 500, 1);
    (problem, state)
}

/// The pick can only repeat the sole feasible design, and the samples left pay for a new design, but
/// not for a turn of more samples.
#[test]
fn a_repeated_pick_gets_the_samples_of_a_new_design() {
    let (problem, mut state) = sole_design();
    let with = |delta_um: f64| Options {
        delta_um,
        criterion: Criterion::ExpectedQuantileImprovement,
        // A high quantile falls by more than the interval is wide.
        quantile_z: 5.0,
        samples_new: 10,
        samples_more: 30,
        samples_left: 20,
        ..options(&problem)
    };
    let look: Decision = decide(&state, &with(1e-6), &problem.violation).unwrap();
    let half = look.recommendation.unwrap().half_width();
    let expected = look.expected_improvement.unwrap();
    assert!(half < expected, "{half} {expected}");
    let settings = with(0.5 * (half + expected));
    let decision = decide(&state, &settings, &problem.violation).unwrap();
    assert!(
        matches!(
            decision.infill[..],
            [Infill::More {
                design: 20,
                samples: 10,
                ..
            }]
        ),
        "{:?}",
        decision.infill
    );
    // No round is empty unless it is the last one or the next one may be.
    for _ in 0..4 {
        let decision = decide(&state, &settings, &problem.violation).unwrap();
        let expected = decision.expected_improvement.unwrap_or(0.0);
        let goes_on = !decision.infill.is_empty() || decision.stop.is_some();
        assert!(goes_on || expected < settings.delta_um, "{decision:?}");
        carry_out(&problem, &mut state, &decision);
    }
}

/// More samples at the sole feasible design are valued by the criterion itself: they cannot change
/// which mean is lowest, and only the quantile criterion depends on its quantile.
#[test]
fn every_criterion_values_more_samples_by_itself() {
    let (problem, state) = sole_design();
    let expected = |criterion, quantile_z| {
        let settings = Options {
            criterion,
            quantile_z,
            delta_um: 0.0,
            ..options(&problem)
        };
        let decision = decide(&state, &settings, &problem.violation).unwrap();
        decision.expected_improvement.unwrap()
    };
    assert_eq!(expected(Criterion::KnowledgeGradient, 1.28), 0.0);
    let reinterpolated = Criterion::ReinterpolatedExpectedImprovement;
    assert!(expected(reinterpolated, 1.28) > 0.0);
    assert_eq!(
        expected(reinterpolated, 0.0),
        expected(reinterpolated, 1.28)
    );
    let quantile = Criterion::ExpectedQuantileImprovement;
    assert!(expected(quantile, 0.0) < expected(quantile, 1.28));
}
