//! `coordinator serve` with real workers on loopback, some of which die.

use std::time::{Duration, Instant};

use acceptance::{Sandbox, assert_all_succeed, assert_code, small_campaign};

use crate::place::{DB, Place};

#[test]
fn kills_of_workers_and_coordinator_leave_no_trace_in_the_samples() {
    let sandbox = Sandbox::new();
    let place = Place::long(&sandbox);
    let run = ["run", &place.file, "--db", "undisturbed.db"];
    assert_code(&sandbox.coordinator(&run), 0);
    let undisturbed = sandbox.status("undisturbed.db").unwrap();

    let work = ["--slots", "1"];
    let done = |status: &serde_json::Value| status["samples"]["done"].as_u64().unwrap();

    let coordinator = place.serve(&[]);
    let doomed = place.worker(&work);
    let survivor = place.worker(&work);
    let quarter = done(&undisturbed) / 4;
    sandbox.wait_for(DB, "a quarter of the samples", |status| {
        done(status) > quarter
    });
    doomed.kill();
    let replacement = place.worker(&work);
    let status = sandbox.wait_for(DB, "half of the samples", |status| {
        done(status) > 2 * quarter
    });
    assert!(
        done(&status) < done(&undisturbed),
        "the campaign was too short to be disturbed"
    );
    coordinator.kill();
    let held = sandbox
        .status(DB)
        .expect("a killed coordinator leaves a store behind");
    assert!(
        done(&held) >= done(&status),
        "acknowledged samples are gone"
    );

    // The same command continues. The workers were not told about the restart.
    let coordinator = place.serve(&[]);
    assert_all_succeed([
        ("coordinator", coordinator),
        ("survivor", survivor),
        ("replacement", replacement),
    ]);
    let disturbed = sandbox.status(DB).unwrap();
    assert_eq!(disturbed["finished"], true, "{disturbed}");
    assert_eq!(disturbed["samples_digest"], undisturbed["samples_digest"]);
    assert_eq!(disturbed["samples"], undisturbed["samples"]);
    assert_eq!(disturbed["optima"], undisturbed["optima"]);
}

#[test]
fn an_interrupted_run_continues() {
    let sandbox = Sandbox::new();
    let place = Place::long(&sandbox);
    let run = ["run", &place.file, "--db", DB];
    let running = sandbox.start("coordinator", &run);
    place.wait_for_some_samples();
    running.kill();
    let before = sandbox.status(DB).unwrap();
    assert_eq!(
        before["finished"], false,
        "the run was too short to be interrupted"
    );
    assert_code(&sandbox.coordinator(&run), 0);
    let after = sandbox.status(DB).unwrap();
    assert_eq!(after["finished"], true);
    assert_eq!(after["failures"], 0);
}

#[test]
fn asked_to_end_programs_release_their_leases() {
    let sandbox = Sandbox::new();
    let place = Place::long(&sandbox);
    let coordinator = place.serve(&[]);
    let worker = place.worker(&["--slots", "2"]);
    place.wait_for_some_samples();
    worker.terminate();
    let (status, errors) = worker.finish();
    assert_eq!(status.code(), Some(14), "{errors}");
    // A worker whose time limit ends in the middle of the campaign leaves in the same way.
    assert_code(&place.work(&["--slots", "2", "--max-runtime", "1"]), 14);
    coordinator.terminate();
    let (status, errors) = coordinator.finish();
    assert_eq!(status.code(), Some(14), "{errors}");
    let held = sandbox.status(DB).unwrap();
    assert_eq!(held["finished"], false);
    assert_eq!(held["failures"], 0, "a failure was counted");
}

#[test]
fn a_coordinator_that_keeps_serving_sends_workers_home_until_a_signal_comes() {
    let sandbox = Sandbox::new();
    let place = Place::new(&sandbox, &small_campaign(12, 10));
    let coordinator = place.serve(&["--keep-serving"]);
    // A worker leaves by itself when it is told that the campaign is finished.
    assert_code(&place.work(&[]), 0);
    let status = sandbox.status(DB).unwrap();
    assert_eq!(status["finished"], true, "{status}");
    assert_code(&place.work(&[]), 0);
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(0));
}

#[test]
fn a_coordinator_that_does_not_answer_cannot_keep_a_worker_that_is_asked_to_leave() {
    let sandbox = Sandbox::new();
    let place = Place::long(&sandbox);
    let coordinator = place.serve(&[]);
    let work = ["--slots", "1", "--grace", "2"];
    let worker = place.worker(&work);
    place.wait_for_some_samples();
    coordinator.signal("STOP");
    // By now the worker holds results that it cannot report.
    std::thread::sleep(Duration::from_secs(2));
    let asked = Instant::now();
    worker.terminate();
    let (status, errors) = worker.finish();
    assert_eq!(status.code(), Some(14), "{errors}");
    assert!(
        errors.contains("results that the coordinator did not take are in a file"),
        "{errors}"
    );
    // The limit allows for the grace period, a last attempt and a busy machine; a lost call alone
    // took 20 s.
    assert!(
        asked.elapsed() < Duration::from_secs(15),
        "{:?}",
        asked.elapsed()
    );
    coordinator.signal("CONT");
    assert_code(&place.work(&work), 0);
    let (status, errors) = coordinator.finish();
    assert_eq!(status.code(), Some(0), "{errors}");
}
