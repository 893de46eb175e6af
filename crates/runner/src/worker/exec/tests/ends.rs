//! How programs end: by the end of their input, then by SIGTERM, then by SIGKILL.

use std::path::PathBuf;
use std::time::Duration;

use super::*;

/// A file that a program writes when it ends in order.
struct Note(PathBuf);

impl Note {
    fn new() -> Self {
        Self(std::env::temp_dir().join(mark()))
    }

    /// The shell command that writes the file after a moment.
    fn write(&self) -> String {
        format!("sleep 0.2; : > {}", self.0.display())
    }

    fn is_there(&self) -> bool {
        self.0.exists()
    }
}

impl Drop for Note {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

#[test]
fn an_idle_program_ends_with_its_input_in_its_own_time() {
    let note = Note::new();
    let orderly = format!("{PREAMBLE}\n{LOOP}\n{}", note.write());
    let backend = backend_of(orderly, Duration::from_secs(60));
    run(&backend, THREE).unwrap();
    assert!(!note.is_there());
    backend.stop();
    assert!(note.is_there(), "killed before its input had ended");
}

#[test]
fn a_program_with_a_request_gets_sigterm_before_sigkill() {
    let note = Note::new();
    let orderly = format!(
        "{PREAMBLE}\ntrap '{}; exit' TERM\non_sample() {{ sleep 600 & wait; }}\n{LOOP}",
        note.write()
    );
    let error = run(&backend_of(orderly, Duration::from_millis(200)), THREE).unwrap_err();
    assert!(error.contains("gave no answer"), "{error}");
    assert!(note.is_there(), "killed without SIGTERM");
}

#[test]
fn a_program_that_ignores_sigterm_is_killed() {
    let mark = mark();
    let stubborn = format!(
        "trap '' TERM\n{PREAMBLE}\non_sample() {{ sh -c 'while :; do sleep 1; done; : {mark}'; }}\n{LOOP}"
    );
    let error = run(&backend_of(stubborn, Duration::from_millis(200)), THREE).unwrap_err();
    assert!(error.contains("gave no answer"), "{error}");
    // A killed process ends in its own time.
    eventually("the program's end", || processes(&mark) == 0);
}

#[test]
fn what_a_program_leaves_behind_gets_sigterm_too() {
    let note = Note::new();
    let mark = mark();
    // The program ends with its input, and its child does not.
    let child = format!(
        "trap \"{}; exit\" TERM; while :; do sleep 0.1; done; : {mark}",
        note.write()
    );
    let parent = format!("sh -c '{child}' >/dev/null 2>&1 </dev/null &\n{PREAMBLE}\n{LOOP}");
    let backend = backend_of(parent, Duration::from_secs(60));
    run(&backend, THREE).unwrap();
    assert_ne!(processes(&mark), 0);
    backend.stop();
    eventually("the child's end", || processes(&mark) == 0);
    assert!(note.is_there(), "killed without SIGTERM");
}
