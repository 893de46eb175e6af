//! Campaigns with an external simulator: the Python example, and its workers. Python 3 must be on the path.

use acceptance::{Sandbox, assert_all_succeed, assert_code, errors, free_address, printed, python};
use serde_json::Value;

use crate::example::{
    before_samples, campaign, changed_program, finished, path, processes, program, twenty_designs,
};
use crate::place::{DB, Place};

/// A design whose samples take several leases is evaluated once. Each slot that would otherwise be idle may evaluate it
/// once more.
#[test]
fn a_slow_design_is_evaluated_once() {
    let sandbox = Sandbox::new();
    let file = path(&sandbox.write("slow.toml", SLOW));
    let log = path(&sandbox.path("requests"));
    let exec = python(&sandbox.write("slow.py", SLOW_PROGRAM));
    let exec = format!("LOG={log:?} {exec}");
    let run = ["run", &file, "--db", DB, "--workers", "2", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 0);
    let requests = std::fs::read_to_string(log).unwrap();
    let count = |kind: &str| requests.lines().filter(|line| *line == kind).count();
    let samples = count("sample");
    assert!((40..=42).contains(&samples), "{samples} samples");
    let evaluations = count("evaluate");
    assert!((6..=8).contains(&evaluations), "{evaluations} evaluations");
}

/// Six designs of six samples each, and nothing else.
const SLOW: &str = r#"
kind = "external"
format = 1
name = "slow"
seed = 1
approaches = ["best-of-doe"]

[[variables]]
name = "x"
low = 0.0
high = 1.0

[[constraints]]
name = "load"
max = 2.0

[[responses]]
name = "depth"
unit = "mm"

[doe]
designs = 6

[sampling]
samples_per_design = 6

[simulator]
probe_designs = 0

[optimise]
population = 6
parents = 3
step = 0.3
evaluations = 6
restarts = "ipop"
starts = 1

[verify]
samples = 4
"#;

/// A program whose leases are of one or two samples, and which writes down what it is asked for.
const SLOW_PROGRAM: &str = r#"
import json, os, random, sys, time

for line in sys.stdin:
    request = json.loads(line)
    kind = request["request"]
    if kind == "describe":
        answer = {"protocol": 2, "version": "slow 1"}
    else:
        time.sleep(0.25)
        with open(os.environ["LOG"], "a") as log:
            log.write(kind + "\n")
        x = request["design"]["x"]
        if kind == "evaluate":
            answer = {"load": x}
        else:
            answer = {"depth": x + random.Random(str(request["seed"])).random()}
    print(json.dumps({**answer, "id": request["id"]}), flush=True)
"#;

#[test]
fn the_example_runs_from_the_doe_to_the_report() {
    let sandbox = Sandbox::new();
    let file = campaign(&sandbox, &[]);
    let exec = program(&sandbox, "simulator.py", &[]);
    for workers in ["1", "2"] {
        let (db, out) = (format!("{workers}.db"), format!("{workers}-report"));
        let run = [
            "run",
            &file,
            "--db",
            &db,
            "--workers",
            workers,
            "--out",
            &out,
            "--exec",
            &exec,
        ];
        assert_code(&sandbox.coordinator(&run), 0);
    }
    let status = finished(&sandbox, "1.db");
    assert_eq!(status["failures"], 0);
    assert_eq!(status["optima"].as_array().map(Vec::len), Some(4));
    for optimum in status["optima"].as_array().unwrap() {
        assert!(optimum["criterion"].is_number(), "{optimum}");
    }
    let other = finished(&sandbox, "2.db");
    assert_eq!(other["samples_digest"], status["samples_digest"]);
    assert_eq!(other["optima"], status["optima"]);
    let html = std::fs::read_to_string(sandbox.path("1-report/report.html")).unwrap();
    assert!(html.contains("An external program simulated the designs"));
    assert!(html.contains("Approaches compared") && html.contains("<svg"));

    let check = sandbox.coordinator(&["check", &file]);
    assert_code(&check, 0);
    assert!(
        printed(&check).contains("a few trial calls estimate the time"),
        "{}",
        printed(&check)
    );
    let check = sandbox.coordinator(&["check", &file, "--exec", &exec]);
    assert_code(&check, 0);
    let said = printed(&check);
    assert!(said.contains("The program is called at most "), "{said}");
    assert!(said.contains("That is about "), "{said}");
    assert!(!said.contains("are equal"), "{said}");
    let failing = before_samples("design[\"x_p\"] > 0.5", "raise ValueError(\"no licence\")");
    let failing = changed_program(&sandbox, "failing.py", &failing);
    let check = sandbox.coordinator(&["check", &file, "--exec", &failing]);
    assert_code(&check, 0);
    let said = printed(&check);
    assert!(
        said.contains(" of 4 random designs, which a campaign would try"),
        "{said}"
    );
    let seedless = [(
        "sum(word << (32 * place) for place, word in enumerate(seed))",
        "1",
    )];
    let seedless = program(&sandbox, "seedless.py", &seedless);
    let check = sandbox.coordinator(&["check", &file, "--exec", &seedless]);
    assert_code(&check, 0);
    let said = printed(&check);
    assert!(
        said.contains("two samples of each design are equal"),
        "{said}"
    );
    let without = sandbox.coordinator(&["run", &file, "--db", "none.db"]);
    assert_code(&without, 2);
    assert!(
        errors(&without).contains("--exec 'CMD'"),
        "{}",
        errors(&without)
    );
    let quick = path(&sandbox.campaign("quick.toml", &[]));
    let unwanted = sandbox.coordinator(&["run", &quick, "--db", "none.db", "--exec", &exec]);
    assert_code(&unwanted, 2);
    assert!(!sandbox.path("none.db").exists());
}

#[test]
fn a_killed_worker_takes_its_programs_along_and_loses_nothing() {
    let sandbox = Sandbox::new();
    let file = campaign(
        &sandbox,
        &[("samples_per_design = 25", "samples_per_design = 800")],
    );
    let exec = program(&sandbox, "simulator.py", &[]);
    let alone = [
        "run",
        &file,
        "--db",
        "alone.db",
        "--workers",
        "2",
        "--exec",
        &exec,
    ];
    assert_code(&sandbox.coordinator(&alone), 0);
    let undisturbed = finished(&sandbox, "alone.db");
    let done = |status: &Value| status["samples"]["done"].as_u64().unwrap();

    // The doomed worker's program has its own name, so that its processes can be found.
    let doomed_exec = program(&sandbox, "doomed.py", &[]);
    let mark = path(&sandbox.path("doomed.py"));
    let address = free_address().to_string();
    let serve = ["serve", &file, "--db", "cluster.db", "--listen", &address];
    let coordinator = sandbox.start("coordinator", &serve);
    let doomed = sandbox.start(
        "worker",
        &[
            "--connect",
            &address,
            "--slots",
            "2",
            "--exec",
            &doomed_exec,
        ],
    );
    sandbox.wait_for("cluster.db", "some samples", |status| done(status) > 1000);
    assert!(!processes(&mark).is_empty());
    doomed.kill();
    let since = std::time::Instant::now();
    while !processes(&mark).is_empty() {
        assert!(
            since.elapsed().as_secs() < 60,
            "a killed worker's programs live on"
        );
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let held = sandbox.status("cluster.db").unwrap();
    assert!(
        done(&held) < done(&undisturbed),
        "the campaign was too short to be disturbed"
    );

    let worker = sandbox.start(
        "worker",
        &["--connect", &address, "--slots", "2", "--exec", &exec],
    );
    assert_all_succeed([("coordinator", coordinator), ("worker", worker)]);
    let disturbed = finished(&sandbox, "cluster.db");
    assert_eq!(disturbed["samples_digest"], undisturbed["samples_digest"]);
    assert_eq!(disturbed["optima"], undisturbed["optima"]);
}

/// Waits until the coordinator reports at least `wanted` leased jobs.
fn wait_for_leases(place: &Place<'_>, wanted: u64) {
    let since = std::time::Instant::now();
    loop {
        let status = place.ask(&["status", "--json"]);
        let status: Value = serde_json::from_str(&status).unwrap();
        if status["live"]["jobs_leased"].as_u64() >= Some(wanted) {
            return;
        }
        assert!(since.elapsed().as_secs() < 60, "{status}");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
}

#[test]
fn a_worker_that_leaves_during_a_sample_longer_than_its_lease_hands_it_in() {
    let sandbox = Sandbox::new();
    let file = twenty_designs(&sandbox);
    // A lease lasts 5 s.
    let slow = before_samples("True", "__import__('time').sleep(8)");
    let exec = changed_program(&sandbox, "slow.py", &slow);
    let place = Place::of_file(&sandbox, &file);
    let coordinator = place.serve(&[]);
    sandbox.wait_for(DB, "the DoE", |status| status["stage"] == "sample");
    let worker = place.worker(&["--slots", "1", "--exec", &exec]);
    let sampled = |status: &Value| status["samples"]["done"] == 1;
    sandbox.wait_for(DB, "a sample", sampled);
    // The evaluations of optimiser runs in between take milliseconds, so the next sample has begun
    // by then.
    std::thread::sleep(std::time::Duration::from_secs(2));
    wait_for_leases(&place, 1);

    // There is a job for only one worker, so a second one finds none and leaves.
    assert!(place.ask(&["drain"]).contains("draining"));
    assert_code(&place.work(&["--exec", &exec, "--idle-exit", "1"]), 14);

    worker.terminate();
    let (ended, errors) = worker.finish();
    assert_eq!(ended.code(), Some(14), "{errors}");
    // The coordinator was drained and ends after the last report.
    let (ended, errors) = coordinator.finish();
    assert_eq!(ended.code(), Some(14), "{errors}");
    let status = sandbox.status(DB).unwrap();
    let fresh = status["optima"].as_array().unwrap().iter();
    let fresh: u64 = fresh
        .map(|optimum| optimum["verified"]["done"].as_u64().unwrap())
        .sum();
    assert_eq!(
        fresh + status["samples"]["done"].as_u64().unwrap(),
        2,
        "one sample a job: {status}"
    );
    assert_eq!(status["failures"], 0, "a failure was counted: {status}");
}

/// The worker process is paused three times for longer than a lease, in the middle of a sample that
/// takes even longer. No crash counts, and the sample is stored.
#[test]
fn a_long_sample_outlives_three_pauses_of_its_worker() {
    let sandbox = Sandbox::new();
    let file = twenty_designs(&sandbox);
    // Only the first sample is long.
    let log = path(&sandbox.path("begun"));
    let condition = format!("not os.path.exists({log:?})");
    let action = format!(
        "open({log:?}, 'w').close(); __import__('time').sleep(20); open({log:?}, 'a').write('x')"
    );
    let exec = changed_program(&sandbox, "long.py", &before_samples(&condition, &action));
    let place = Place::of_file(&sandbox, &file);
    let coordinator = place.serve_for("2");
    let worker = place.worker(&["--slots", "1", "--exec", &exec]);
    let since = std::time::Instant::now();
    while !sandbox.path("begun").exists() {
        assert!(since.elapsed().as_secs() < 60, "no sample begins");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    for _ in 0..3 {
        worker.signal("STOP");
        std::thread::sleep(std::time::Duration::from_secs(3));
        worker.signal("CONT");
        std::thread::sleep(std::time::Duration::from_secs(1));
    }
    assert_all_succeed([("coordinator", coordinator), ("worker", worker)]);
    let status = finished(&sandbox, DB);
    assert_eq!(status["designs"]["done"], 20, "{status}");
    let told = std::fs::read_to_string(sandbox.path("begun")).unwrap();
    assert_eq!(told, "x", "the long sample was computed once, to its end");
}

#[test]
fn workers_with_another_simulator_are_refused_for_good() {
    let sandbox = Sandbox::new();
    let file = campaign(&sandbox, &[("designs = 60", "designs = 20")]);
    let exec = program(&sandbox, "simulator.py", &[]);
    let run = ["run", &file, "--db", "store.db", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 0);

    // The store records the simulator whose numbers it holds.
    let address = free_address().to_string();
    let serve = [
        "serve",
        &file,
        "--db",
        "store.db",
        "--listen",
        &address,
        "--keep-serving",
    ];
    let coordinator = sandbox.start("coordinator", &serve);
    let work = |exec: &[&str]| {
        let connect = ["--connect", &address, "--slots", "1"];
        sandbox.run("worker", &[&connect, exec].concat())
    };
    let changed = program(
        &sandbox,
        "changed.py",
        &[(
            "generator.gauss(0.0, 1.0)",
            "generator.gauss(0.0, 1.000001)",
        )],
    );
    let other = work(&["--exec", &changed]);
    assert_code(&other, 12);
    assert!(
        errors(&other).contains("other numbers"),
        "{}",
        errors(&other)
    );
    let none = work(&[]);
    assert_code(&none, 12);
    assert!(errors(&none).contains("--exec 'CMD'"), "{}", errors(&none));
    let useless = work(&["--exec", "echo hello"]);
    assert_code(&useless, 1);
    assert!(errors(&useless).contains("hello"), "{}", errors(&useless));
    assert_code(&work(&["--exec", &exec]), 0);
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(0));

    // A campaign with the built-in model does not use a program.
    let quick = path(&sandbox.campaign("quick.toml", &[]));
    let address = free_address().to_string();
    let serve = ["serve", &quick, "--db", "quick.db", "--listen", &address];
    let coordinator = sandbox.start("coordinator", &serve);
    let unwanted = sandbox.run("worker", &["--connect", &address, "--exec", &exec]);
    assert_code(&unwanted, 12);
    assert!(
        errors(&unwanted).contains("without --exec"),
        "{}",
        errors(&unwanted)
    );
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(14));
}
