//! Optima that are known.

use super::{Problem, add, enrich, options, sampled, unit};
use enrich::{Criterion, Infill, Options, Stop, decide};

/// A bowl with the minimum 1 at (0.3, 0.3, 0.3), which the constraint x₀ ≥ 0.5 excludes. The optimum, 1 + 4 · 0.2² =
/// 1.16, lies on the boundary of the constraint.
fn bowl() -> Problem {
    Problem {
        bounds: unit(3),
        response: |x| 1.0 + 4.0 * x.iter().map(|v| (v - 0.3).powi(2)).sum::<f64>(),
        noise: 0.1,
        violation: |x| Some(0.5 - x[0]),
    }
}

#[test]
fn every_criterion_finds_the_optimum_on_the_boundary_within_its_interval() {
    let problem = bowl();
    for criterion in Criterion::ALL {
        let settings = Options {
            criterion,
            ..options(&problem)
        };
        let mut state = sampled(&problem, 30, 30);
        let end = enrich(&problem, &mut state, &settings, 8);
        let best = end.recommendation.unwrap();
        let truth = (problem.response)(&best.x);
        assert!(best.x[0] >= 0.5, "{criterion:?}");
        assert!(
            truth < 1.16 + 0.03,
            "{criterion:?}: {truth} at {:?}",
            best.x
        );
        // Three times the half-width: with three criteria, one in seven would miss 95 %.
        assert!(
            (best.predicted - truth).abs() < 3.0 * best.half_width(),
            "{criterion:?}: {best:?} but {truth}"
        );
    }
}

#[test]
fn an_optimum_in_a_corner_is_recommended() {
    let problem = Problem {
        bounds: unit(3),
        response: |x| 2.0 - x.iter().sum::<f64>() / 3.0,
        noise: 0.05,
        violation: |_| Some(0.0),
    };
    let mut state = sampled(&problem, 25, 30);
    let end = enrich(&problem, &mut state, &options(&problem), 6);
    let best = end.recommendation.unwrap();
    assert!(best.x.iter().all(|v| *v > 0.97), "{best:?}");
}

/// A feasible ball of 0.1 % of the box around (0.8, 0.2, 0.6), which contains no point of the DoE.
#[test]
fn a_feasible_region_of_a_thousandth_of_the_box_is_found() {
    let problem = Problem {
        bounds: unit(3),
        response: |x| 1.0 + x.iter().sum::<f64>(),
        noise: 0.05,
        violation: |x| {
            let centre = [0.8, 0.2, 0.6];
            let squares = x.iter().zip(centre).map(|(v, c)| (v - c).powi(2));
            // 4π/3 r³ = 10⁻³
            Some(squares.sum::<f64>().sqrt() - 0.062)
        },
    };
    let mut state = sampled(&problem, 30, 30);
    assert!(state.sampled.iter().all(|s| s.violation > 0.0));
    let first = decide(&state, &options(&problem), &problem.violation).unwrap();
    assert!(first.notes.contains(&enrich::Note::NoFeasibleDesign));
    let end = enrich(&problem, &mut state, &options(&problem), 6);
    let best = end.recommendation.unwrap();
    let row = &state.sampled[best.design];
    assert!(row.violation <= 0.0);
    // The lowest response in the ball is 2.6 − √3 · 0.062.
    let truth = (problem.response)(&best.x);
    assert!(truth < 2.6 - 3.0_f64.sqrt() * 0.062 + 0.03, "{truth}");
}

#[test]
fn the_enrichment_stops_when_less_than_delta_is_to_be_gained() {
    let problem = bowl();
    let settings = Options {
        delta_um: 0.03,
        ..options(&problem)
    };
    let mut state = sampled(&problem, 40, 30);
    let end = enrich(&problem, &mut state, &settings, 30);
    let Some(Stop::Converged {
        expected_improvement,
        half_width,
    }) = end.stop
    else {
        panic!("{:?} after {} rounds", end.stop, end.round);
    };
    assert!(expected_improvement < 0.03 && half_width < 0.03);
    assert!(end.infill.is_empty());
}

#[test]
fn no_more_samples_are_asked_for_than_are_left() {
    let problem = bowl();
    for left in [0, 29, 30, 100] {
        let settings = Options {
            samples_left: left,
            delta_um: 0.0,
            ..options(&problem)
        };
        let decision = decide(&sampled(&problem, 30, 30), &settings, &problem.violation).unwrap();
        let asked: u32 = decision
            .infill
            .iter()
            .map(|infill| match infill {
                Infill::New { samples, .. } | Infill::More { samples, .. } => *samples,
            })
            .sum();
        assert!(asked <= left);
        let is_spent = matches!(decision.stop, Some(Stop::Budget { samples }) if samples == left);
        assert_eq!(is_spent, left < 30);
    }
}

/// A round is a function of its arguments: repeating it, or reading its state back from JSON, gives
/// the same bits.
#[test]
fn a_round_that_is_repeated_decides_the_same() {
    let problem = bowl();
    let mut state = sampled(&problem, 30, 30);
    let first = decide(&state, &options(&problem), &problem.violation).unwrap();
    let json = serde_json::to_string(&state).unwrap();
    let read = serde_json::from_str(&json).unwrap();
    let again = decide(&read, &options(&problem), &problem.violation).unwrap();
    assert_eq!(first, again);
    let read: enrich::Decision =
        serde_json::from_str(&serde_json::to_string(&first).unwrap()).unwrap();
    assert_eq!(first, read);
    let other = Options {
        seed: 1,
        ..options(&problem)
    };
    assert_ne!(first, decide(&state, &other, &problem.violation).unwrap());
    add(&problem, &mut state, vec![0.6, 0.3, 0.3], 99, 30);
    assert_ne!(
        first,
        decide(&state, &options(&problem), &problem.violation).unwrap()
    );
}

/// A design that looks best by luck, with few samples, gets more of them.
#[test]
fn a_promising_design_of_few_samples_is_sampled_again() {
    let problem = Problem {
        noise: 0.6,
        ..bowl()
    };
    let mut state = sampled(&problem, 40, 30);
    add(&problem, &mut state, vec![0.5, 0.3, 0.3], 1000, 4);
    let promising = state.sampled.len() - 1;
    let mut again = false;
    for _ in 0..4 {
        let decision = decide(&state, &options(&problem), &problem.violation).unwrap();
        again |= decision
            .infill
            .iter()
            .any(|i| matches!(i, Infill::More { design, .. } if *design >= promising));
        super::carry_out(&problem, &mut state, &decision);
    }
    assert!(again);
}

/// The response is smooth and its baseline has a kink, so the difference between them has the kink
/// upside down. A model of the difference alone is held at the foot of the baseline's valley, where
/// the sum of the variables is 2.4 and the response 1.09; the optimum is 1, where the sum is 4.2.
#[test]
fn a_baseline_with_a_kink_does_not_hold_the_search() {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let problem = Problem {
        bounds: unit(6),
        response: |x| {
            let mean = x.iter().sum::<f64>() / 6.0;
            let apart: f64 = x.iter().map(|v| (v - mean).powi(2)).sum();
            1.0 + (mean - 0.7).powi(2) + apart
        },
        noise: 0.2,
        violation: |_| Some(0.0),
    };
    let baseline = |x: &[f64]| (problem.response)(x) - 0.8 + 4.0 * (mean(x) - 0.4).abs();
    let known = |x: &[f64]| {
        Some(enrich::ExactCriteria {
            baseline: baseline(x),
            ..enrich::ExactCriteria::from(0.0)
        })
    };
    let mut state = sampled(&problem, 60, 30);
    let best = loop {
        for row in &mut state.sampled {
            row.baseline = baseline(&row.x);
        }
        let decision = decide(&state, &options(&problem), &known).unwrap();
        if decision.stop.is_some() || state.rounds.len() >= 12 {
            break decision.recommendation.unwrap();
        }
        super::carry_out(&problem, &mut state, &decision);
    };
    let truth = (problem.response)(&best.x);
    assert!(truth < 1.02, "{truth} at {:?}", best.x);
}

/// The response falls towards x = 1, and a constraint that is known from samples forbids x > 0.6: its probability of
/// holding decides where new designs lie, with and without a design that keeps it.
#[test]
fn new_designs_lie_where_a_constraint_probably_holds() {
    let problem = Problem {
        bounds: unit(1),
        response: |x| 2.0 - x[0],
        noise: 0.01,
        violation: |x| Some((x[0] - 0.6).max(0.0)),
    };
    let holds = |x: f64| 1.0 / (1.0 + (60.0 * (x - 0.6)).exp());
    let known = |x: &[f64]| {
        Some(enrich::ExactCriteria {
            holds: holds(x[0]),
            ..enrich::ExactCriteria::from(0.0)
        })
    };
    for only_infeasible in [false, true] {
        let mut state = sampled(&problem, 12, 30);
        if only_infeasible {
            state.sampled.retain(|row| row.violation > 0.0);
        }
        let decision = decide(&state, &options(&problem), &known).unwrap();
        let new = decision.infill.iter().filter_map(|infill| match infill {
            enrich::Infill::New { x, .. } => Some(x[0]),
            enrich::Infill::More { .. } => None,
        });
        let new: Vec<f64> = new.collect();
        assert!(!new.is_empty(), "{decision:?}");
        assert!(new.iter().all(|x| holds(*x) > 0.02), "{new:?}");
        assert_eq!(decision.recommendation.is_none(), only_infeasible);
    }
}

/// The limits hold in one corner only, and their probability is tiny elsewhere, while the response falls towards the
/// other corner: the search in the whole box follows the probability.
#[test]
fn before_anything_is_feasible_a_tiny_probability_leads_the_way() {
    let problem = Problem {
        bounds: unit(4),
        response: |x| 1.0 + x.iter().sum::<f64>(),
        noise: 0.01,
        violation: |_| Some(1.0),
    };
    let known = |x: &[f64]| {
        let away: f64 = x.iter().map(|x| (x - 0.8).powi(2)).sum();
        Some(enrich::ExactCriteria {
            holds: (-400.0 * away).exp(),
            ..enrich::ExactCriteria::from(0.0)
        })
    };
    let state = sampled(&problem, 30, 30);
    let decision = decide(&state, &options(&problem), &known).unwrap();
    let found = decision.infill.iter().any(|infill| match infill {
        enrich::Infill::New { x, .. } => x.iter().all(|x| (x - 0.8).abs() < 0.1),
        enrich::Infill::More { .. } => false,
    });
    assert!(found, "{decision:?}");
}
