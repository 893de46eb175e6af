//! Input that a round rejects.

use super::{Problem, options, sampled, unit};
use enrich::{Error, Options, decide};

#[test]
fn unusable_rows_and_settings_are_errors() {
    let problem = Problem {
        bounds: unit(3),
        response: |x| 1.0 + x[0],
        noise: 0.1,
        violation: |_| Some(0.0),
    };
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
