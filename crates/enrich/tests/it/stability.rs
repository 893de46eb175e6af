//! Unusual input: each kind has a defined and reported behaviour.

use super::{Problem, carry_out, enrich, options, sampled, unit};
use enrich::{Error, Infill, Note, Options, Reason, RoundRecord, Stop, decide};

fn flat(value: f64) -> Problem {
    Problem {
        bounds: unit(3),
        response: if value > 0.0 { |_| 100.0 } else { |_| f64::NAN },
        noise: 0.0,
        violation: |_| Some(0.0),
    }
}

fn is_space_filling(infill: &Infill) -> bool {
    matches!(
        infill,
        Infill::New {
            reason: Reason::SpaceFilling,
            ..
        }
    )
}

#[test]
fn a_plateau_of_100s_is_reported_and_space_is_filled() {
    let problem = flat(100.0);
    let state = sampled(&problem, 20, 30);
    let decision = decide(&state, &options(&problem), &problem.violation).unwrap();
    assert!(decision.notes.contains(&Note::Plateau));
    assert_eq!(decision.infill.len(), 6);
    assert!(decision.infill.iter().all(is_space_filling));
    assert_eq!(decision.recommendation, None);
    assert_eq!(decision.expected_improvement, None);
}

#[test]
fn responses_that_are_no_numbers_are_failures() {
    let problem = flat(-1.0);
    let state = sampled(&problem, 20, 30);
    let decision = decide(&state, &options(&problem), &problem.violation).unwrap();
    assert!(decision.notes.contains(&Note::NotNumbers { entries: 20 }));
    assert!(
        decision
            .notes
            .iter()
            .any(|n| matches!(n, Note::NoModel { .. }))
    );
    assert!(decision.infill.iter().all(is_space_filling));
    // NaN among usable responses excludes only its own designs.
    let sound = Problem {
        response: |x| 1.0 + x[0],
        noise: 0.1,
        ..problem
    };
    let mut state = sampled(&sound, 30, 30);
    state.sampled[3].response = f64::NAN;
    let bad = state.sampled[3].x.clone();
    let decision = decide(&state, &options(&sound), &sound.violation).unwrap();
    assert!(decision.recommendation.is_some());
    for infill in &decision.infill {
        if let Infill::New { x, .. } = infill {
            let far = x.iter().zip(&bad).any(|(a, b)| (a - b).abs() >= 0.01);
            assert!(far, "{x:?} is next to a failure");
        }
    }
}

#[test]
fn two_rounds_of_only_failures_end_the_enrichment() {
    let problem = Problem {
        response: |x| 1.0 + x[0],
        noise: 0.1,
        ..flat(100.0)
    };
    let mut state = sampled(&problem, 30, 30);
    let failed = RoundRecord {
        expected_improvement: Some(0.5),
        asked: 6,
        failed: 6,
    };
    for rounds in 1..=2 {
        let asked = decide(&state, &options(&problem), &problem.violation).unwrap();
        for infill in asked.infill {
            if let Infill::New { x, .. } = infill {
                state.failed.push(x);
            }
        }
        state.rounds.push(failed);
        let decision = decide(&state, &options(&problem), &problem.violation).unwrap();
        assert!(decision.notes.contains(&Note::RoundFailed));
        assert_eq!(
            decision.stop,
            (rounds == 2).then_some(Stop::OnlyFailures),
            "after {rounds}"
        );
        // A design sampled earlier is still recommended.
        assert!(decision.recommendation.is_some());
        assert_eq!(decision.infill.is_empty(), rounds == 2);
    }
}

#[test]
fn there_are_no_more_rounds_than_there_may_be() {
    let problem = Problem {
        response: |x| 1.0 + x[0],
        noise: 0.1,
        ..flat(100.0)
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

#[test]
fn entries_at_one_place_are_merged() {
    let problem = Problem {
        response: |x| 1.0 + x[0] + x[1],
        noise: 0.1,
        ..flat(100.0)
    };
    let mut state = sampled(&problem, 30, 30);
    let copies: Vec<_> = state.sampled[..5].to_vec();
    state.sampled.extend(copies);
    let decision = decide(&state, &options(&problem), &problem.violation).unwrap();
    assert!(decision.notes.contains(&Note::Merged { entries: 5 }));
    assert!(decision.recommendation.is_some_and(|best| best.design < 30));
}

/// The whole feasible set is one design, which is sampled already: infill can only repeat it.
#[test]
fn an_infill_point_on_an_existing_design_becomes_more_samples_there() {
    let problem = Problem {
        bounds: unit(2),
        response: |x| 1.0 + x[0] + x[1],
        noise: 0.3,
        violation: |x| {
            let off = (x[0] - 0.25).abs().max((x[1] - 0.5).abs());
            Some(if off < 1e-9 { 0.0 } else { off })
        },
    };
    let mut state = sampled(&problem, 20, 30);
    super::add(&problem, &mut state, vec![0.25, 0.5], 500, 4);
    let settings = Options {
        delta_um: 0.001,
        ..options(&problem)
    };
    for _ in 0..2 {
        let decision = decide(&state, &settings, &problem.violation).unwrap();
        assert!(!decision.infill.is_empty());
        for infill in &decision.infill {
            assert!(
                matches!(infill, Infill::More { design: 20, .. }),
                "{infill:?}"
            );
        }
        carry_out(&problem, &mut state, &decision);
    }
    assert_eq!(state.sampled.len(), 21);
}

/// Noise of 100 times the range of the response: the model is reported to have found no structure,
/// and the truth lies within twice its interval.
#[test]
fn noise_larger_than_the_signal_is_reported() {
    let problem = Problem {
        response: |x| 10.0 + 0.01 * x[0],
        noise: 5.0,
        ..flat(100.0)
    };
    let mut state = sampled(&problem, 40, 30);
    let decision = decide(&state, &options(&problem), &problem.violation).unwrap();
    assert!(decision.notes.contains(&Note::NoStructure));
    let end = enrich(&problem, &mut state, &options(&problem), 2);
    let best = end.recommendation.unwrap();
    let truth = (problem.response)(&best.x);
    assert!(
        (best.predicted - truth).abs() < 2.0 * best.half_width(),
        "{best:?}"
    );
}

#[test]
fn a_box_without_a_feasible_design_is_said() {
    let problem = Problem {
        response: |x| 1.0 + x[0],
        noise: 0.1,
        violation: |x| Some(1.0 + x[1]),
        ..flat(100.0)
    };
    let state = sampled(&problem, 30, 30);
    let decision = decide(&state, &options(&problem), &problem.violation).unwrap();
    assert_eq!(decision.stop, Some(Stop::NothingFeasible));
    assert_eq!(decision.recommendation, None);
}

#[test]
fn unusable_rows_and_settings_are_errors() {
    let problem = flat(100.0);
    let mut state = sampled(&problem, 5, 30);
    state.sampled[2].x.pop();
    let error = decide(&state, &options(&problem), &problem.violation).unwrap_err();
    assert!(matches!(
        error,
        Error::Design {
            index: 2,
            expected: 3
        }
    ));
    let mut state = sampled(&problem, 5, 30);
    state.sampled[1].variance = -1.0;
    let error = decide(&state, &options(&problem), &problem.violation).unwrap_err();
    assert!(matches!(error, Error::Variance { index: 1, .. }));
    let state = sampled(&problem, 5, 30);
    for settings in [
        Options {
            batch: 0,
            ..options(&problem)
        },
        Options {
            delta_um: f64::NAN,
            ..options(&problem)
        },
    ] {
        let error = decide(&state, &settings, &problem.violation).unwrap_err();
        assert!(matches!(error, Error::Setting { .. }), "{error}");
    }
}
