//! How workers leave: on request, together with their simulators, or after the campaign.

use std::time::{Duration, Instant};

use acceptance::{Sandbox, assert_code, errors};

use crate::example::{campaign, processes, program};
use crate::place::{DB, Place};

/// The example's campaign and program. Each sample takes 0.3 s.
fn slow_example(sandbox: &Sandbox) -> (String, String) {
    example_with(sandbox, "__import__(\"time\").sleep(0.3)")
}

/// The example's campaign and program with a Python statement before each sample.
fn example_with(sandbox: &Sandbox, statement: &str) -> (String, String) {
    let from = "        generator = random";
    let slow = format!("        {statement}\n{from}");
    (
        campaign(sandbox, &[("probe_designs = 3", "probe_designs = 0")]),
        program(sandbox, "slow.py", &[(from, &slow)]),
    )
}

/// systemd ends all processes of a service at once, Slurm all of a step, and Slurm preempts with
/// two signals in a row. None of this counts as a failure.
#[test]
fn ending_a_worker_together_with_its_simulators_costs_nothing() {
    let sandbox = Sandbox::new();
    let (file, exec) = slow_example(&sandbox);
    let place = Place::of_file(&sandbox, &file);
    let coordinator = place.serve(&[]);
    let mark = sandbox.path("slow.py").display().to_string();
    for _ in 0..3 {
        let worker = place.worker(&["--slots", "2", "--exec", &exec, "--grace", "5"]);
        let since = Instant::now();
        while processes(&mark).len() < 2 {
            assert!(since.elapsed().as_secs() < 60, "no program runs");
            std::thread::sleep(Duration::from_millis(20));
        }
        std::thread::sleep(Duration::from_secs(2));
        // The programs are killed before their worker, as the order of a process table may have it.
        let found = processes(&mark);
        let status = std::process::Command::new("kill").args(&found).status();
        assert!(status.unwrap().success(), "{found:?}");
        worker.terminate();
        worker.terminate();
        std::thread::sleep(Duration::from_millis(200));
        // The worker may have no work left by now.
        let (status, errors) = worker.finish();
        assert_eq!(status.code(), Some(14), "{errors}");
    }
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(14));
    let status = sandbox.status(DB).unwrap();
    assert_eq!(status["failures"], 0, "{status}");
}

/// Slurm's SIGTERM goes to all processes of a job. A simulator that ignores it completes its sample.
#[test]
fn a_simulator_that_ignores_sigterm_completes_its_sample() {
    let sandbox = Sandbox::new();
    let flag = sandbox.path("sampling").display().to_string();
    let statement = format!("open({flag:?}, \"w\").close(); __import__(\"time\").sleep(3)");
    let (file, exec) = example_with(&sandbox, &statement);
    let place = Place::of_file(&sandbox, &file);
    let coordinator = place.serve(&[]);
    let exec = format!("trap '' TERM; {exec}");
    let worker = place.worker(&["--slots", "1", "--exec", &exec, "--grace", "20"]);
    let since = Instant::now();
    while !sandbox.path("sampling").exists() {
        assert!(since.elapsed().as_secs() < 60, "no sample begins");
        std::thread::sleep(Duration::from_millis(20));
    }
    let done = |when: &str| {
        let status = sandbox.status(DB).expect("a store");
        assert_eq!(status["failures"], 0, "{when}: {status}");
        status["samples"]["done"].as_u64().expect("a number")
    };
    let before = done("before");
    let found = processes(&sandbox.path("slow.py").display().to_string());
    let killed = std::process::Command::new("kill").args(&found).status();
    assert!(!found.is_empty() && killed.unwrap().success(), "{found:?}");
    worker.terminate();
    let (status, errors) = worker.finish();
    assert_eq!(status.code(), Some(14), "{errors}");
    assert!(done("after") > before, "{errors}");
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(14));
}

#[test]
fn a_second_sigterm_changes_nothing_within_the_grace() {
    let sandbox = Sandbox::new();
    let (file, exec) = slow_example(&sandbox);
    let place = Place::of_file(&sandbox, &file);
    let coordinator = place.serve(&[]);
    let worker = place.worker(&["--slots", "2", "--exec", &exec]);
    sandbox.wait_for(DB, "some samples", |status| {
        status["samples"]["done"].as_u64() > Some(3)
    });
    worker.terminate();
    std::thread::sleep(Duration::from_millis(20));
    worker.terminate();
    let (status, errors) = worker.finish();
    assert_eq!(status.code(), Some(14), "{errors}");
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(14));
    let status = sandbox.status(DB).unwrap();
    assert_eq!(status["failures"], 0, "{status}");
}

/// A worker that waits for a coordinator that will not return would occupy a slot of the cluster.
#[test]
fn after_a_drain_workers_leave_and_say_so() {
    let sandbox = Sandbox::new();
    let place = Place::long(&sandbox);
    let coordinator = place.serve(&[]);
    let worker = place.worker(&["--slots", "2"]);
    place.wait_for_some_samples();
    place.ask(&["drain"]);
    let since = Instant::now();
    let (status, said) = worker.finish();
    assert_eq!(status.code(), Some(14), "{said}");
    assert!(
        said.contains("the coordinator ends before the campaign does"),
        "{said}"
    );
    assert!(
        since.elapsed() < Duration::from_secs(60),
        "{:?}",
        since.elapsed()
    );
    assert_eq!(coordinator.finish().0.code(), Some(14));
}

/// A worker waits for an absent coordinator for a limited time, and reports it.
#[test]
fn a_worker_whose_coordinator_is_gone_says_so_and_leaves() {
    let sandbox = Sandbox::new();
    let place = Place::long(&sandbox);
    let coordinator = place.serve(&[]);
    let worker = place.worker(&["--give-up-after", "12"]);
    place.wait_for_some_samples();
    coordinator.kill();
    let (status, said) = worker.finish();
    assert_eq!(status.code(), Some(11), "{said}");
    assert!(said.contains("the coordinator does not answer"), "{said}");
}

/// A worker that comes too late, or too early, holds a node of a cluster meanwhile.
#[test]
fn a_worker_that_waits_for_its_first_coordinator_says_so_and_leaves() {
    let sandbox = Sandbox::new();
    let place = Place::long(&sandbox);
    // A batch script has its own options; those of its user come after them, and take precedence.
    let patience = ["--connect-timeout", "600", "--connect-timeout", "12"];
    let none = [&["--access", "none.access"], &patience[..]].concat();
    let early = sandbox.start("worker", &none);
    let coordinator = place.serve(&[]);
    // The store is there before the access file.
    let since = Instant::now();
    while !sandbox.path("pitchline/quick.access").exists() {
        assert!(since.elapsed().as_secs() < 60, "no access file");
        std::thread::sleep(Duration::from_millis(20));
    }
    coordinator.kill();
    let late = place.worker(&patience);
    for (worker, expected) in [
        (early, "waiting for a coordinator's access file"),
        (late, "the coordinator does not answer"),
    ] {
        let (status, said) = worker.finish();
        assert_eq!(status.code(), Some(11), "{said}");
        assert!(said.contains(expected), "{said}");
    }
}

/// A finished coordinator with `--keep-serving` ends when it is drained, as its message says.
#[test]
fn a_finished_coordinator_that_keeps_serving_can_be_drained() {
    let sandbox = Sandbox::new();
    let place = Place::new(&sandbox, &acceptance::small_campaign(12, 10));
    let coordinator = place.serve(&["--keep-serving"]);
    assert_code(&place.work(&[]), 0);
    sandbox.wait_for(DB, "the end", |status| status["finished"] == true);
    place.ask(&["drain"]);
    let (status, said) = coordinator.finish();
    assert_eq!(status.code(), Some(0), "{said}");
    let none = place.work(&["--connect-timeout", "1"]);
    assert_code(&none, 11);
    assert!(
        errors(&none).contains("no coordinator's access file"),
        "{}",
        errors(&none)
    );
}

/// A worker that slept through the end of its campaign does not wait for the coordinator.
#[test]
fn a_worker_that_was_paused_until_the_end_leaves_soon() {
    let sandbox = Sandbox::new();
    let place = Place::long(&sandbox);
    let coordinator = place.serve(&["--workers", "1"]);
    let worker = place.worker(&["--slots", "1"]);
    place.wait_for_some_samples();
    worker.signal("STOP");
    let (status, log) = coordinator.finish();
    assert_eq!(status.code(), Some(0), "{log}");
    worker.signal("CONT");
    let (status, log) = worker.finish();
    assert_eq!(status.code(), Some(11), "{log}");
    assert!(log.contains("access file is gone"), "{log}");
}
