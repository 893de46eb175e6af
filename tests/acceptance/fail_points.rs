//! Crashes of a coordinator at critical points, including the store's fail points.

use std::os::unix::process::ExitStatusExt as _;

use acceptance::{SIGABRT, Sandbox, assert_all_succeed, assert_code, free_address, small_campaign};

#[test]
fn a_coordinator_that_dies_around_a_commit_loses_and_repeats_nothing() {
    let sandbox = Sandbox::new();
    // Enough samples for the store's log to be copied to its file more than once.
    let file = sandbox.write("campaign.toml", &small_campaign(200, 2500));
    let file = file.to_str().unwrap();
    assert_code(
        &sandbox.coordinator(&["run", file, "--db", "undisturbed.db"]),
        0,
    );
    let undisturbed = sandbox.status("undisturbed.db").unwrap();

    let address = free_address().to_string();
    let serve = ["serve", file, "--db", "c.db", "--listen", &address];
    let worker = sandbox.start("worker", &["--connect", &address, "--slots", "2"]);
    let mut done = 0;
    // The first commits hold no samples.
    for point in [
        "before_commit:3",
        "after_commit:2",
        "checkpoint:0:300",
        "after_commit:1",
    ] {
        let (status, errors) = sandbox.start_dying(point, &serve).finish();
        assert_eq!(status.signal(), Some(SIGABRT), "{point}: {status} {errors}");
        let held = sandbox.status("c.db").unwrap();
        let now = held["samples"]["done"].as_u64().unwrap();
        assert!(now >= done, "{point}: from {done} samples back to {now}");
        assert_eq!(held["finished"], false, "{point}: nothing was left to do");
        done = now;
    }
    assert!(done > 0, "every crash came before the first sample");

    let coordinator = sandbox.start("coordinator", &serve);
    assert_all_succeed([("coordinator", coordinator), ("worker", worker)]);
    let disturbed = sandbox.status("c.db").unwrap();
    assert_eq!(disturbed["finished"], true, "{disturbed}");
    assert_eq!(disturbed["samples_digest"], undisturbed["samples_digest"]);
    assert_eq!(disturbed["samples"], undisturbed["samples"]);
    assert_eq!(disturbed["optima"], undisturbed["optima"]);
    assert_eq!(disturbed["failures"], 0, "a failure was counted");
}
