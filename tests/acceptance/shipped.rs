//! A test of shipped programs: they have no fail points. It needs their folder:
//!
//! ```text
//! cargo build --release -p coordinator -p worker
//! PITCHLINE_PROGRAMS=$PWD/target/release cargo test --workspace --test acceptance shipped
//! ```

use acceptance::{Sandbox, assert_code, errors, small_campaign};

/// A fail point at which a coordinator that has it ends before it stores anything.
const DEADLY: [(&str, &str); 1] = [("FAILPOINTS", "store::before_commit=return")];

#[test]
fn shipped_programs_have_no_fail_points_and_survive_a_kill() {
    if acceptance::named_programs().is_none() {
        acceptance::skipped("PITCHLINE_PROGRAMS names no folder of shipped programs");
        return;
    }
    let sandbox = Sandbox::new();
    let file = sandbox.write("long.toml", &small_campaign(40, 20_000));
    let file = file.to_str().unwrap();
    let start = |db: &str| sandbox.start_with("coordinator", &["run", file, "--db", db], &DEADLY);
    let (ended, said) = start("whole.db").finish();
    assert_eq!(ended.code(), Some(0), "{said}");
    let whole = sandbox.status("whole.db").unwrap();
    assert_eq!(whole["finished"], true, "{whole}");

    let running = start("killed.db");
    sandbox.wait_for("killed.db", "some samples", |status| {
        status["samples"]["done"].as_u64() > Some(10_000)
    });
    running.kill();
    let held = sandbox.status("killed.db").unwrap();
    assert_eq!(held["finished"], false, "it was killed too late: {held}");
    let (ended, said) = start("killed.db").finish();
    assert_eq!(ended.code(), Some(0), "{said}");
    let again = sandbox.status("killed.db").unwrap();
    for key in ["samples_digest", "samples", "optima", "failures"] {
        assert_eq!(again[key], whole[key], "{key}");
    }
    let table = ["export", "--db", "killed.db", "--table", "failures"];
    let exported = sandbox.coordinator(&[&table[..], &["--out", "f.csv"]].concat());
    assert_code(&exported, 0);
    let failures = std::fs::read_to_string(sandbox.path("f.csv")).unwrap();
    assert_eq!(
        failures.lines().count(),
        1,
        "{failures} {}",
        errors(&exported)
    );
}
