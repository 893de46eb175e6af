//! Trial calls of programs that fail for some designs.

use super::*;

fn tried(changes: &str) -> Result<Trial, Error> {
    let exec = Exec {
        interface: Interface::Lines(format!("{PREAMBLE}\n{changes}\n{LOOP}")),
        timeout: Duration::from_secs(60),
        environment: Vec::new(),
    };
    trial(&problem(), &exec)
}

/// A program that does this in place of its second evaluation.
fn second(fault: &str) -> String {
    let usual =
        r#"answer "$geometry,\"delta_ste_archard_um\":0.75,\"hertz_pressure_worn_mpa\":1300""#;
    format!("on_archard() {{ n=$((n + 1)); if [ $n = 2 ]; then {fault}; else {usual}; fi; }}")
}

#[test]
fn a_failed_design_does_not_end_the_trial_of_the_others() {
    let trial = tried(&second("answer '\"error\":\"no licence\"'")).unwrap();
    assert_eq!(
        (trial.designs, trial.failed.len(), trial.samples),
        (4, 1, 6)
    );
    assert!(trial.failed[0].contains("no licence"), "{trial:?}");
    assert!(trial.refused.is_empty() && trial.sample_seconds > 0.0);

    let refused = tried(&second("answer '\"refused\":\"no-mesh: too thin\"'")).unwrap();
    assert_eq!(
        (refused.designs, refused.refused.len(), refused.samples),
        (4, 1, 6)
    );
}

#[test]
fn a_trial_without_any_answer_is_an_error_and_a_slow_failure_ends_it() {
    let failing = "on_sample() { answer '\"error\":\"no licence\"'; }";
    let error = tried(failing).unwrap_err().to_string();
    assert!(error.contains("no licence"), "{error}");

    let slow = second("sleep 5.1; answer '\"error\":\"no licence\"'");
    let trial = tried(&slow).unwrap();
    assert_eq!(
        (trial.designs, trial.failed.len(), trial.samples),
        (2, 1, 2)
    );
}

#[test]
fn failed_samples_are_counted() {
    let nan = "on_sample() { answer '\"delta_ste_um\":NaN'; }";
    let trial = tried(nan).unwrap();
    assert_eq!((trial.samples, trial.failed_samples), (8, 8));
}
