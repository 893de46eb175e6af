//! Campaigns whose designs an external program simulates: the Python example, and variants of it
//! that fail. Python 3 must be on the path.

use acceptance::{Sandbox, assert_code, errors, free_address, printed, root};
use serde_json::Value;

fn example(name: &str) -> String {
    let path = root().join("campaigns/external").join(name);
    std::fs::read_to_string(path).expect("the example is shipped")
}

/// The example's campaign with `changes`, in the sandbox.
fn campaign(sandbox: &Sandbox, changes: &[(&str, &str)]) -> String {
    let mut text = example("campaign.toml");
    for (from, to) in changes {
        assert!(text.contains(from), "the example has no {from:?}");
        text = text.replacen(from, to, 1);
    }
    path(&sandbox.write("campaign.toml", &text))
}

/// The command that runs the example's program with `changes`, from the sandbox.
fn program(sandbox: &Sandbox, name: &str, changes: &[(&str, &str)]) -> String {
    let mut text = example("simulator.py");
    for (from, to) in changes {
        assert!(text.contains(from), "the example has no {from:?}");
        text = text.replacen(from, to, 1);
    }
    format!("exec python3 -B {}", path(&sandbox.write(name, &text)))
}

fn path(path: &std::path::Path) -> String {
    path.to_str().expect("a path in UTF-8").to_owned()
}

fn finished(sandbox: &Sandbox, db: &str) -> Value {
    let status = sandbox.status(db).expect("the store is there");
    assert_eq!(status["finished"], true, "{status}");
    status
}

/// Python processes whose command line holds `mark`.
fn processes(mark: &str) -> usize {
    std::fs::read_dir("/proc")
        .expect("processes can be listed")
        .filter_map(|entry| std::fs::read(entry.ok()?.path().join("cmdline")).ok())
        .map(|line| String::from_utf8_lossy(&line).into_owned())
        .filter(|line| {
            let program = line.split('\0').next().unwrap_or("");
            program.ends_with("python3") && line.contains(mark)
        })
        .count()
}

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
        assert!(optimum["criterion_um"].is_number(), "{optimum}");
    }
    let other = finished(&sandbox, "2.db");
    assert_eq!(other["samples_digest"], status["samples_digest"]);
    assert_eq!(other["optima"], status["optima"]);
    let html = std::fs::read_to_string(sandbox.path("1-report/report.html")).unwrap();
    assert!(html.contains("An external program simulated the designs"));
    assert!(html.contains("Table 5") && html.contains("<svg"));

    let check = sandbox.coordinator(&["check", &file]);
    assert_code(&check, 0);
    assert!(
        printed(&check).contains("no estimate"),
        "{}",
        printed(&check)
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
        &[("samples_per_design = 25", "samples_per_design = 400")],
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

    // The doomed worker's program has a name of its own, so that it can be looked for.
    let doomed_exec = program(&sandbox, "doomed.py", &[]);
    let mark = path(&sandbox.path("doomed.py"));
    let address = free_address().to_string();
    let url = format!("http://{address}");
    let serve = ["serve", &file, "--db", "cluster.db", "--listen", &address];
    let coordinator = sandbox.start("coordinator", &serve);
    let doomed = sandbox.start(
        "worker",
        &["--connect", &url, "--slots", "2", "--exec", &doomed_exec],
    );
    sandbox.wait_for("cluster.db", "some samples", |status| done(status) > 1000);
    assert!(processes(&mark) > 0);
    doomed.kill();
    let since = std::time::Instant::now();
    while processes(&mark) > 0 {
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
        &["--connect", &url, "--slots", "2", "--exec", &exec],
    );
    for (name, process) in [("coordinator", coordinator), ("worker", worker)] {
        let (status, errors) = process.finish();
        assert_eq!(status.code(), Some(0), "{name}: {errors}");
    }
    let disturbed = finished(&sandbox, "cluster.db");
    assert_eq!(disturbed["samples_digest"], undisturbed["samples_digest"]);
    assert_eq!(disturbed["optima"], undisturbed["optima"]);
}

#[test]
fn workers_with_another_simulator_are_refused_for_good() {
    let sandbox = Sandbox::new();
    let file = campaign(&sandbox, &[("designs = 60", "designs = 20")]);
    let exec = program(&sandbox, "simulator.py", &[]);
    let run = ["run", &file, "--db", "store.db", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 0);

    // The store remembers whose numbers it holds.
    let address = free_address().to_string();
    let url = format!("http://{address}");
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
        let connect = ["--connect", &url, "--slots", "1"];
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

    // A campaign of the built-in model has no use for a program.
    let quick = path(&sandbox.campaign("quick.toml", &[]));
    let address = free_address().to_string();
    let url = format!("http://{address}");
    let serve = ["serve", &quick, "--db", "quick.db", "--listen", &address];
    let coordinator = sandbox.start("coordinator", &serve);
    let unwanted = sandbox.run("worker", &["--connect", &url, "--exec", &exec]);
    assert_code(&unwanted, 12);
    assert!(
        errors(&unwanted).contains("without --exec"),
        "{}",
        errors(&unwanted)
    );
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(14));
}

#[test]
fn a_program_that_fails_on_one_design_spoils_no_other() {
    let sandbox = Sandbox::new();
    let file = campaign(
        &sandbox,
        &[
            ("designs = 60", "designs = 20"),
            ("probe_designs = 3", "probe_designs = 0"),
        ],
    );
    // 20 strata of the range from −0.3 to 1: one design has an x_p above 0.935.
    let exec = program(
        &sandbox,
        "failing.py",
        &[
            (
                "        shift = [design",
                "        self.spoilt = design[\"x_p\"] > 0.935\n        shift = [design",
            ),
            (
                "        generator = random",
                "        if self.spoilt:\n            sys.stderr.write('the mesher gave up\\n')\n            \
                 sys.exit(7)\n        generator = random",
            ),
        ],
    );
    let run = ["run", &file, "--db", "store.db", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 13);
    let status = finished(&sandbox, "store.db");
    let table = ["export", "--db", "store.db", "--table", "failures"];
    let table = [&table[..], &["--out", "failures.csv"]].concat();
    assert_code(&sandbox.coordinator(&table), 0);
    let failures = std::fs::read_to_string(sandbox.path("failures.csv")).unwrap();
    for part in [
        "exit status: 7",
        "the mesher gave up",
        "sample 0",
        "quarantine",
    ] {
        assert!(failures.contains(part), "no {part:?} in {failures}");
    }
    assert_eq!(status["designs"]["done"], 19, "{status}");
    let feasible = status["designs"]["feasible"].as_u64().unwrap();
    assert_eq!(status["samples"]["done"], 25 * feasible);
}
