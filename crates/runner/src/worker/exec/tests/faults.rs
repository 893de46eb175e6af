//! Faults of programs and of machines, and programs that end without a fault.

use std::cell::RefCell;

use super::*;
use crate::worker::exec::fault::{Fault, PAUSES, patiently};

#[test]
fn a_passing_shortage_is_survived_and_a_lasting_one_is_a_fault() {
    let ability = watch::Sender::<Ability>::default();
    let paused = RefCell::new(Vec::new());
    let pause = |time| {
        assert_eq!(ability.borrow().waiting, 1);
        paused.borrow_mut().push(time);
        true
    };
    let left = Cell::new(2);
    let passing = || match left.get() {
        0 => Ok(7),
        some => {
            left.set(some - 1);
            Err(Fault::Machine("no memory".to_owned()))
        }
    };
    assert_eq!(patiently(&ability, &PAUSES, pause, passing), Ok(7));
    assert_eq!(paused.take(), PAUSES[..2]);
    assert_eq!(
        (ability.borrow().waiting, &ability.borrow().fault),
        (0, &None)
    );

    let full = || Err::<(), _>(Fault::Machine("the disk\nis full".to_owned()));
    assert_eq!(patiently(&ability, &PAUSES, pause, full), full());
    assert_eq!(paused.take(), PAUSES);
    let fault = ability.borrow().fault.clone();
    assert_eq!(fault.as_deref(), Some("the disk⏎is full"));
    // The worker leaves: other requests do not wait.
    assert_eq!(patiently(&ability, &PAUSES, pause, full), full());
    assert!(paused.take().is_empty());
}

#[test]
fn a_failure_of_the_program_is_not_tried_again_here() {
    let ability = watch::Sender::<Ability>::default();
    let asked = Cell::new(0);
    let failing = || {
        asked.set(asked.get() + 1);
        Err::<(), _>(Fault::Program("no licence".to_owned()))
    };
    let pause = |_| panic!("a pause");
    assert_eq!(patiently(&ability, &PAUSES, pause, failing), failing());
    assert_eq!(asked.get(), 2, "one of them by this test");
    assert_eq!(ability.borrow().fault, None);
}

/// The limit of two minutes would be noticed as "no answer".
#[test]
fn a_descendant_that_holds_the_output_does_not_hide_the_end_of_the_program() {
    let mark = mark();
    let holder = format!("sh -c 'sleep 600; : {mark}' &");
    let program = |changes: &str| {
        backend_of(
            format!("{PREAMBLE}\n{changes}\n{LOOP}"),
            Duration::from_secs(120),
        )
    };
    let dying = program(&format!(
        "on_sample() {{ {holder} echo 'out of licences' >&2; exit 3; }}"
    ));
    let error = run(&dying, THREE).unwrap_err();
    for part in [
        "the simulator ended (exit status: 3) before it had answered",
        "out of licences",
    ] {
        assert!(error.contains(part), "no {part:?} in: {error}");
    }
    // What it wrote before its end is read.
    let answering = program(&format!(
        "on_sample() {{ {holder} answer '\"delta_ste_um\":1'; exit 0; }}"
    ));
    assert_eq!(values(&run(&answering, THREE).unwrap()), [1.0; 3]);
    drop((dying, answering));
    eventually("the descendants' end", || processes(&mark) == 0);
}

#[test]
fn a_program_that_leaves_between_two_requests_is_started_again() {
    // It is still there when the next request is written, and never reads it.
    let leaving = "on_sample() { answer '\"delta_ste_um\":1'; sleep 0.3; exit 0; }";
    assert_eq!(values(&run(&backend(leaving), THREE).unwrap()), [1.0; 3]);
    // A program that leaves whenever it is asked does not answer.
    let error = run(&backend("on_sample() { exit 0; }"), THREE).unwrap_err();
    assert!(
        error.contains("a program must answer one request after the other"),
        "{error}"
    );
    // One that ends with an error is not asked again.
    let log = std::env::temp_dir().join(mark());
    let failing = format!("on_sample() {{ echo x >> '{}'; exit 4; }}", log.display());
    let error = run(&backend(&failing), THREE).unwrap_err();
    assert!(error.contains("exit status: 4"), "{error}");
    assert_eq!(std::fs::read_to_string(&log).unwrap(), "x\n");
    std::fs::remove_file(log).unwrap();
}

#[test]
fn control_characters_of_a_program_become_visible() {
    let dying = r"on_sample() { printf 'bad \033[2J\a\n' >&2; exit 3; }";
    let error = run(&backend(dying), THREE).unwrap_err();
    assert!(error.ends_with("bad ␛[2J␇"), "{error}");
    let refusing = r#"on_unworn() { answer '"refused":"no-mesh: a\nb\u001b[31m"'; }"#;
    let refused = Output::Refused("no-mesh: a⏎b␛[31m".to_owned());
    assert_eq!(run(&backend(refusing), THREE), Ok(refused));
    let failing = r#"on_sample() { answer '"error":"no\nlicence\u001b[31m"'; }"#;
    let error = run(&backend(failing), THREE).unwrap_err();
    assert!(
        error.ends_with("the simulator says: no\nlicence␛[31m"),
        "{error}"
    );
}
