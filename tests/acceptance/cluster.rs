//! `coordinator serve` with real workers on loopback, some of which die.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use acceptance::{Sandbox, assert_code, free_address, small_campaign};

/// A campaign that samples for some seconds on two cores.
fn long(sandbox: &Sandbox) -> PathBuf {
    sandbox.write("long.toml", &small_campaign(300, 4000))
}

#[test]
fn kills_of_workers_and_coordinator_leave_no_trace_in_the_samples() {
    let sandbox = Sandbox::new();
    let file = long(&sandbox);
    let file = file.to_str().unwrap();
    assert_code(
        &sandbox.coordinator(&["run", file, "--db", "undisturbed.db"]),
        0,
    );
    let undisturbed = sandbox.status("undisturbed.db").unwrap();

    let address = free_address().to_string();
    let url = format!("http://{address}");
    let serve = ["serve", file, "--db", "cluster.db", "--listen", &address];
    let work = ["--connect", &url, "--slots", "1"];
    let done = |status: &serde_json::Value| status["samples"]["done"].as_u64().unwrap();

    let coordinator = sandbox.start("coordinator", &serve);
    let doomed = sandbox.start("worker", &work);
    let survivor = sandbox.start("worker", &work);
    let quarter = done(&undisturbed) / 4;
    sandbox.wait_for("cluster.db", "a quarter of the samples", |status| {
        done(status) > quarter
    });
    doomed.kill();
    let replacement = sandbox.start("worker", &work);
    let status = sandbox.wait_for("cluster.db", "half of the samples", |status| {
        done(status) > 2 * quarter
    });
    assert!(
        done(&status) < done(&undisturbed),
        "the campaign was too short to be disturbed"
    );
    coordinator.kill();
    let held = sandbox
        .status("cluster.db")
        .expect("a killed coordinator leaves a store behind");
    assert!(
        done(&held) >= done(&status),
        "acknowledged samples are gone"
    );

    // The same command continues; the workers have not been told anything.
    let coordinator = sandbox.start("coordinator", &serve);
    for (name, process) in [
        ("coordinator", coordinator),
        ("survivor", survivor),
        ("replacement", replacement),
    ] {
        let (status, errors) = process.finish();
        assert_eq!(status.code(), Some(0), "{name}: {errors}");
    }
    let disturbed = sandbox.status("cluster.db").unwrap();
    assert_eq!(disturbed["finished"], true, "{disturbed}");
    assert_eq!(disturbed["samples_digest"], undisturbed["samples_digest"]);
    assert_eq!(disturbed["samples"], undisturbed["samples"]);
    assert_eq!(disturbed["optima"], undisturbed["optima"]);
}

#[test]
fn an_interrupted_run_continues() {
    let sandbox = Sandbox::new();
    let file = long(&sandbox);
    let file = file.to_str().unwrap();
    let run = ["run", file, "--db", "run.db"];
    let running = sandbox.start("coordinator", &run);
    let some = |status: &serde_json::Value| status["samples"]["done"].as_u64() > Some(10_000);
    sandbox.wait_for("run.db", "some samples", some);
    running.kill();
    let before = sandbox.status("run.db").unwrap();
    assert_eq!(
        before["finished"], false,
        "the run was too short to be interrupted"
    );
    assert_code(&sandbox.coordinator(&run), 0);
    let after = sandbox.status("run.db").unwrap();
    assert_eq!(after["finished"], true);
    assert_eq!(after["failures"], 0);
}

#[test]
fn asked_to_end_programs_give_back_what_they_hold() {
    let sandbox = Sandbox::new();
    let file = long(&sandbox);
    let file = file.to_str().unwrap();
    let address = free_address().to_string();
    let url = format!("http://{address}");
    let serve = ["serve", file, "--db", "c.db", "--listen", &address];
    let coordinator = sandbox.start("coordinator", &serve);
    let worker = sandbox.start("worker", &["--connect", &url, "--slots", "2"]);
    let some = |status: &serde_json::Value| status["samples"]["done"].as_u64() > Some(10_000);
    sandbox.wait_for("c.db", "some samples", some);
    worker.terminate();
    let (status, errors) = worker.finish();
    assert_eq!(status.code(), Some(0), "{errors}");
    // Its time is up in the middle of the campaign; it leaves in the same good order.
    let output = sandbox.run(
        "worker",
        &["--connect", &url, "--slots", "2", "--max-runtime", "1"],
    );
    assert_code(&output, 0);
    coordinator.terminate();
    let (status, errors) = coordinator.finish();
    assert_eq!(status.code(), Some(14), "{errors}");
    let held = sandbox.status("c.db").unwrap();
    assert_eq!(held["finished"], false);
    assert_eq!(held["failures"], 0, "nobody is to blame");
}

#[test]
fn a_coordinator_that_keeps_serving_sends_workers_home_until_a_signal_comes() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("tiny.toml", &small_campaign(12, 10));
    let address = free_address().to_string();
    let url = format!("http://{address}");
    let file = file.to_str().unwrap();
    let serve = [
        "serve",
        file,
        "--db",
        "t.db",
        "--listen",
        &address,
        "--keep-serving",
    ];
    let coordinator = sandbox.start("coordinator", &serve);
    // Told that the campaign is finished, a worker leaves by itself.
    assert_code(&sandbox.run("worker", &["--connect", &url]), 0);
    let status = sandbox.status("t.db").unwrap();
    assert_eq!(status["finished"], true, "{status}");
    assert_code(&sandbox.run("worker", &["--connect", &url]), 0);
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(0));
}

#[test]
fn a_coordinator_that_does_not_answer_cannot_keep_a_worker_that_is_asked_to_leave() {
    let sandbox = Sandbox::new();
    let file = long(&sandbox);
    let file = file.to_str().unwrap();
    let address = free_address().to_string();
    let url = format!("http://{address}");
    let serve = ["serve", file, "--db", "c.db", "--listen", &address];
    let coordinator = sandbox.start("coordinator", &serve);
    let work = ["--connect", &url, "--slots", "1", "--grace", "2"];
    let worker = sandbox.start("worker", &work);
    let some = |status: &serde_json::Value| status["samples"]["done"].as_u64() > Some(10_000);
    sandbox.wait_for("c.db", "some samples", some);
    coordinator.signal("STOP");
    // By now it holds results that it cannot hand in.
    std::thread::sleep(Duration::from_secs(2));
    let asked = Instant::now();
    worker.terminate();
    let (status, errors) = worker.finish();
    assert_eq!(status.code(), Some(0), "{errors}");
    assert!(
        errors.contains("results that nobody acknowledged"),
        "{errors}"
    );
    // Seconds of grace, of a last attempt, and of a busy machine; a lost call alone took 20.
    assert!(
        asked.elapsed() < Duration::from_secs(15),
        "{:?}",
        asked.elapsed()
    );
    coordinator.signal("CONT");
    assert_code(&sandbox.run("worker", &work), 0);
    let (status, errors) = coordinator.finish();
    assert_eq!(status.code(), Some(0), "{errors}");
}
