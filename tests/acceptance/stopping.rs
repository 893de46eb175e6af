//! Signals: SIGTERM during the steps that the coordinator computes itself, and SIGHUP.

use std::time::{Duration, Instant};

use acceptance::{Sandbox, binary, changed, small_campaign};

use crate::campaign::{digest, export};

/// Far less than the total time of the steps, even on a busy machine.
const PROMPTLY: Duration = Duration::from_secs(8);

/// A campaign large enough for the design of experiments, the kriging model and the decision of a
/// round to take some tenths of a second each.
fn campaign() -> String {
    let section = "\n[enrichment]\ncriterion = \"expected-quantile-improvement\"\n\
                   samples = 20000\nrounds = 1\npoints_per_round = 4\nsamples_per_point = 10\n\
                   tolerance = 0.001\n";
    changed(&small_campaign(1200, 4), &[("\"random\"", "\"maximin\"")]) + section
}

#[test]
fn a_signal_ends_the_coordinator_in_the_middle_of_a_step() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("steps.toml", &campaign());
    let file = file.to_str().unwrap();
    let start = |db: &str| {
        let run = ["run", file, "--db", db];
        sandbox.start_with("coordinator", &run, &[("PITCHLINE_LOG", "info")])
    };
    // The log lines at the beginning and at the end of each step.
    let steps = [
        ("making the design of experiments", "INFO sampling"),
        ("fitting the kriging model", "kriging model fitted"),
        ("kriging model fitted", "infill decided"),
    ];
    for (begins, ends) in steps {
        let mut running = start("stopped.db");
        running.wait_for_line(begins);
        std::thread::sleep(Duration::from_millis(50));
        let since = Instant::now();
        running.terminate();
        let (ended, said) = running.finish();
        let took = since.elapsed();
        assert_eq!(ended.code(), Some(14), "{begins}: {said}");
        assert!(took < PROMPTLY, "{begins}: {took:?}: {said}");
        assert!(
            !said.contains(ends),
            "{begins}: the step came to its end: {said}"
        );
    }
    for db in ["stopped.db", "whole.db"] {
        let (ended, said) = start(db).finish();
        assert_eq!(ended.code(), Some(0), "{db}: {said}");
    }
    assert_eq!(digest(&sandbox, "stopped.db"), digest(&sandbox, "whole.db"));
    for table in ["designs", "responses", "infill"] {
        let [stopped, whole] = ["stopped.db", "whole.db"].map(|db| export(&sandbox, db, table));
        assert!(stopped == whole, "{table} differ");
    }
}

#[test]
fn a_closed_terminal_stops_a_campaign_unless_it_runs_under_nohup() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &small_campaign(10_000, 4000));
    let file = file.to_str().unwrap();
    let samples = |least: u64| {
        let status = sandbox.wait_for("c.db", "samples", |status| {
            status["samples"]["done"].as_u64() > Some(least)
        });
        status["samples"]["done"].as_u64().unwrap()
    };
    let run = ["run", file, "--db", "c.db", "--workers", "1"];
    let program = binary("coordinator");
    let program = program.to_str().unwrap();
    // The tests themselves may run under nohup.
    let heeding = [&["--default-signal=HUP", program], &run[..]].concat();
    let running = sandbox.start_with("/usr/bin/env", &heeding, &[("PITCHLINE_LOG", "info")]);
    let before = samples(0);
    running.signal("HUP");
    let (ended, said) = running.finish();
    assert_eq!(ended.code(), Some(14), "{said}");
    assert!(said.contains("start the same command again"), "{said}");

    // nohup(1) starts a program with the signal ignored.
    let ignoring = ["-c", "trap '' HUP; exec \"$@\"", "sh", program];
    let shell = [&ignoring[..], &run].concat();
    let running = sandbox.start("/bin/sh", &shell);
    let before = samples(before);
    running.signal("HUP");
    samples(before + 20_000);
    running.terminate();
    assert_eq!(running.finish().0.code(), Some(14));
}
