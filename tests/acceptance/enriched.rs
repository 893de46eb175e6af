//! A campaign with rounds of infill over the network gives the same results whichever workers
//! compute it and crash.

use std::path::PathBuf;

use acceptance::{Sandbox, assert_all_succeed, assert_code, free_address, printed, small_campaign};
use serde_json::Value;

/// Rounds of five points, each long enough for a crash in the middle of it.
fn campaign(sandbox: &Sandbox) -> PathBuf {
    let section = "\n[enrichment]\ncriterion = \"expected-quantile-improvement\"\nsamples = 700000\n\
                   rounds = 3\npoints_per_round = 5\nsamples_per_point = 40000\n\
                   tolerance = 0.001\n";
    sandbox.write("enriched.toml", &(small_campaign(80, 10) + section))
}

fn in_a_round(status: &Value, round: u64) -> bool {
    let enrichment = &status["enrichment"];
    let number = |name: &str| enrichment["samples"][name].as_u64().unwrap_or(0);
    enrichment["round"].as_u64() == Some(round)
        && number("done") > 0
        && number("done") < number("wanted")
}

fn table(sandbox: &Sandbox, db: &str, table: &str) -> Vec<Vec<String>> {
    let out = format!("{db}-{table}.csv");
    let export = ["export", "--db", db, "--table", table, "--out", &out];
    assert_code(&sandbox.coordinator(&export), 0);
    let text = std::fs::read_to_string(sandbox.path(&out)).unwrap();
    let lines = text.lines().skip(1);
    lines
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

#[test]
fn a_coordinator_that_dies_in_the_middle_of_a_round_goes_on_with_it() {
    let sandbox = Sandbox::new();
    let file = campaign(&sandbox);
    let file = file.to_str().unwrap();
    let alone = ["run", file, "--db", "alone.db", "--workers", "1"];
    assert_code(&sandbox.coordinator(&alone), 0);
    let undisturbed = sandbox.status("alone.db").unwrap();
    assert_eq!(undisturbed["finished"], true, "{undisturbed}");

    let address = free_address().to_string();
    let serve = ["serve", file, "--db", "c.db", "--listen", &address];
    let work = ["--connect", &address, "--slots", "1"];
    let workers = [(); 2].map(|()| sandbox.start("worker", &work));
    for round in [1, 2] {
        let coordinator = sandbox.start("coordinator", &serve);
        let what = format!("the middle of round {round}");
        let status = sandbox.wait_for("c.db", &what, |status| in_a_round(status, round));
        coordinator.kill();
        let held = sandbox.status("c.db").unwrap();
        let done = |status: &Value| status["enrichment"]["samples"]["done"].as_u64();
        assert!(
            done(&held) >= done(&status),
            "acknowledged samples are gone"
        );
        assert_eq!(held["enrichment"]["ended"], false, "it crashed too late");
    }
    let coordinator = sandbox.start("coordinator", &serve);
    let [first, second] = workers;
    assert_all_succeed([
        ("coordinator", coordinator),
        ("worker", first),
        ("worker", second),
    ]);
    let disturbed = sandbox.status("c.db").unwrap();
    for key in [
        "samples_digest",
        "samples",
        "optima",
        "enrichment",
        "finished",
    ] {
        assert_eq!(disturbed[key], undisturbed[key], "{key}");
    }
    assert_eq!(disturbed["failures"], 0, "a failure was counted");
    let optima = disturbed["optima"].as_array().unwrap();
    assert_eq!(optima.len(), 5);
    assert_eq!(optima[4]["approach"], "enriched-kriging");

    // The points and percentiles are the same, and the rounds apart from their costs.
    let points = table(&sandbox, "c.db", "infill");
    for round in ["1", "2", "3"] {
        assert!(points.iter().any(|row| row[1] == round), "{points:?}");
    }
    assert_eq!(points, table(&sandbox, "alone.db", "infill"));
    let decided = |db: &str| -> Vec<Vec<String>> {
        let rounds = table(&sandbox, db, "rounds");
        rounds.iter().map(|row| row[..9].to_vec()).collect()
    };
    assert_eq!(decided("c.db"), decided("alone.db"));

    let report = std::fs::read_to_string(sandbox.path("quick-report/report.html")).unwrap();
    assert!(report.contains("Enriched kriging") && report.contains("id=\"enrichment\""));
}

#[test]
fn an_enrichment_can_be_added_to_a_campaign_that_has_finished() {
    let sandbox = Sandbox::new();
    let small = small_campaign(60, 8);
    let plain = sandbox.write("plain.toml", &small);
    let run = |file: &std::path::Path| {
        sandbox.coordinator(&["run", file.to_str().unwrap(), "--db", "c.db"])
    };
    assert_code(&run(&plain), 0);
    let before = sandbox.status("c.db").unwrap();
    assert_eq!(before["optima"].as_array().map(Vec::len), Some(4));
    assert!(before["enrichment"].is_null());

    let section = "\n[enrichment]\ncriterion = \"knowledge-gradient\"\nsamples = 560\nrounds = 2\n\
                   points_per_round = 3\nsamples_per_point = 10\ntolerance = 0.01\n";
    let enriched = sandbox.write("enriched.toml", &(small + section));
    let check = sandbox.coordinator(&["check", enriched.to_str().unwrap()]);
    assert_code(&check, 0);
    let plan = printed(&check);
    let line = plan.lines().find(|line| line.starts_with("enrich"));
    assert!(line.is_some_and(|line| line.contains("2 rounds")), "{plan}");
    assert_code(&run(&enriched), 0);
    let after = sandbox.status("c.db").unwrap();
    assert_eq!(after["finished"], true, "{after}");
    assert_eq!(after["samples_digest"], before["samples_digest"]);
    assert_eq!(after["optima"].as_array().map(Vec::len), Some(5));
    assert_eq!(after["enrichment"]["ended"], true);
    assert_eq!(after["optima"][0], before["optima"][0]);
    // Without the section it would be another campaign.
    assert_code(&run(&plain), 6);
}
