//! Simulators that fail: failing candidates, outages, answers that are no numbers. The folder
//! `cases` has their campaigns and programs.

use std::process::Output;

use acceptance::{Sandbox, assert_code, changed, errors, printed, python, root};
use serde_json::Value;

/// A case in a sandbox.
struct Case {
    sandbox: Sandbox,
    file: String,
    exec: String,
}

impl Case {
    /// The case with `changes` of its campaign, and `arguments` of its program.
    fn new(name: &str, changes: &[(&str, &str)], arguments: &str) -> Self {
        let sandbox = Sandbox::new();
        let read = |file: &str| {
            let path = root().join("tests/acceptance/cases").join(name).join(file);
            std::fs::read_to_string(path).expect("the case is there")
        };
        let file = sandbox.write("campaign.toml", &changed(&read("campaign.toml"), changes));
        let exec = python(&sandbox.write("simulator.py", &read("simulator.py")));
        Self {
            file: file.display().to_string(),
            exec: format!("{exec} {arguments}"),
            sandbox,
        }
    }

    fn run(&self, workers: &str, variables: &[(&str, &str)]) -> Output {
        let run = ["run", &self.file, "--db", "c.db", "--out", "report"];
        let workers = ["--workers", workers, "--exec", &self.exec];
        self.sandbox
            .run_with("coordinator", &[&run[..], &workers].concat(), variables)
    }

    fn status(&self) -> Value {
        self.sandbox.status("c.db").expect("the store is there")
    }

    fn export(&self, table: &str) -> String {
        let table = ["export", "--db", "c.db", "--table", table, "--out", "-"];
        let exported = self.sandbox.coordinator(&table);
        assert_code(&exported, 0);
        printed(&exported)
    }
}

/// The criterion of an approach's optimum.
fn criterion(status: &Value, approach: &str) -> f64 {
    let optima = status["optima"].as_array().expect("a list");
    let optimum = optima.iter().find(|row| row["approach"] == approach);
    let optimum = optimum.unwrap_or_else(|| panic!("no {approach} in {status}"));
    let criterion = &optimum["criterion"];
    criterion
        .as_f64()
        .unwrap_or_else(|| panic!("nothing was found: {optimum}"))
}

#[test]
fn candidates_that_fail_rank_last_and_the_searches_go_on() {
    let case = Case::new("failing-candidate", &[], "");
    let run = case.run("1", &[]);
    assert_code(&run, 0);
    let status = case.status();
    assert_eq!(status["designs"]["done"], 20, "{status}");
    assert_eq!(status["designs"]["simulable"], 18, "{status}");
    assert_eq!(status["optimiser_runs"]["done"], 3, "{status}");
    for approach in ["baseline", "kriging", "direct"] {
        let found = criterion(&status, approach);
        assert!(found < 0.12, "{approach}: {found}");
    }
    // Each run has made all of its evaluations, of which some have a reason and no value.
    let evaluations = case.export("evaluations");
    let failed = evaluations
        .lines()
        .filter(|row| row.contains("failed: the simulator ended (exit status: 3)"));
    assert!(failed.count() >= 3, "{evaluations}");
}

/// Half of the box has no numbers, and neither have 4 % of the samples elsewhere.
#[test]
fn answers_without_a_number_are_results() {
    for answer in ["nan", "inf", "null", "refused"] {
        let case = Case::new("not-a-number", &[], &format!("{answer} 0.04"));
        assert_code(&case.run("2", &[]), 0);
        let status = case.status();
        assert_eq!(status["designs"]["done"], 8, "{answer}: {status}");
        assert_eq!(status["designs"]["simulable"], 4, "{answer}: {status}");
        assert_eq!(status["samples"]["done"], 32, "{answer}: {status}");
        assert_eq!(status["failures"], 0, "{answer}: {status}");
        assert!(criterion(&status, "baseline") < 0.01, "{answer}: {status}");
    }
}

#[test]
fn failed_samples_count_as_the_policy_says() {
    let of = |policy: &str, answer: &str| {
        let changes = [
            ("[sampling]\n", format!("[sampling]\nfailed = {policy:?}\n")),
            (
                "samples_per_design = 8",
                "samples_per_design = 40".to_owned(),
            ),
        ];
        let changes = changes.each_ref().map(|(from, to)| (*from, to.as_str()));
        let case = Case::new("not-a-number", &changes, answer);
        let run = case.run("2", &[]);
        // Where designs are refused there may be none to recommend.
        assert_eq!(case.status()["finished"], true, "{}", errors(&run));
        let responses = case.export("responses");
        let header: Vec<&str> = responses
            .lines()
            .next()
            .unwrap_or_default()
            .split(',')
            .collect();
        let place = header
            .iter()
            .position(|name| *name == "p90")
            .expect("a column");
        let p90 = |row: &str| row.split(',').nth(place).map(str::to_owned);
        let p90: Vec<String> = responses.lines().skip(1).filter_map(p90).collect();
        p90.iter()
            .map(|p90| p90.parse().expect("a number"))
            .collect::<Vec<f64>>()
    };
    let whole = of("worst", "nan");
    assert!(
        whole.len() == 4 && whole.iter().all(|p90| p90.is_finite()),
        "{whole:?}"
    );
    // The same samples fail whether they are answered with NaN or fail for good.
    let worst = of("worst", "nan 0.04");
    assert_eq!(of("worst", "error 0.04"), worst);
    let left_out = of("left-out", "nan 0.04");
    let refused = of("refuses-design", "nan 0.04");
    assert!(refused.iter().any(|p90| p90.is_infinite()), "{refused:?}");
    let mut differ = 0;
    for i in 0..4 {
        let has_failed = refused[i].is_infinite();
        assert!(worst[i] >= left_out[i], "{worst:?} {left_out:?}");
        if has_failed {
            differ += u32::from(worst[i] > left_out[i]);
        } else {
            assert_eq!(worst[i], left_out[i]);
        }
    }
    assert!(differ > 0);
}

/// Samples that failed in every attempt, and count as failed, are computed again by a repaired program, and so are all
/// results that depend on them.
#[test]
fn failures_that_are_results_are_computed_again_when_that_is_asked_for() {
    let changes = [
        ("starts = 1", "starts = 1\ndirect = true"),
        ("evaluations = 200", "evaluations = 60"),
    ];
    let mut case = Case::new("not-a-number", &changes, "repaired");
    let tables = |case: &Case| {
        let digests = ["samples_digest", "point_samples_digest"];
        let digests = digests.map(|digest| case.status()[digest].to_string());
        let tables = ["designs", "responses", "evaluations"].map(|table| case.export(table));
        let optima = case.status()["optima"].clone();
        (digests, tables, optima)
    };
    assert_code(&case.run("2", &[]), 0);
    let undisturbed = tables(&case);
    assert!(case.status()["warnings"].is_null(), "{}", case.status());

    case = Case::new("not-a-number", &changes, "error 0.1");
    // The percentiles of designs with failed samples are infinite, and none is recommended.
    assert_code(&case.run("2", &[]), 16);
    let warnings = case.status()["warnings"].to_string();
    for doubt in [
        "designs failed in every attempt",
        "samples of the DoE failed. They count as worse than all others.",
        "verification and infill samples failed",
        "evaluations in the searches failed",
    ] {
        assert!(warnings.contains(doubt), "{doubt}: {warnings}");
    }
    case.exec = case.exec.replace("error 0.1", "repaired");
    // The same command keeps its results.
    let kept = tables(&case);
    assert_code(&case.run("2", &[]), 16);
    assert_eq!(tables(&case), kept);
    let again = [
        "run",
        &case.file,
        "--db",
        "c.db",
        "--out",
        "report",
        "--retry-failed",
    ];
    let again = [&again[..], &["--workers", "2", "--exec", &case.exec]].concat();
    assert_code(&case.sandbox.coordinator(&again), 0);
    assert_eq!(tables(&case), undisturbed);
}

/// A direct search counts failed samples as the DoE does: a candidate does not fail for a few of them.
#[test]
fn a_direct_search_counts_failed_samples() {
    let changes = [
        ("samples_per_design = 8", "samples_per_design = 100"),
        ("starts = 1", "starts = 1\ndirect = true"),
        ("evaluations = 200", "evaluations = 60"),
    ];
    let found = ["nan 0.03", "error 0.03"].map(|answer| {
        let case = Case::new("not-a-number", &changes, answer);
        assert_code(&case.run("2", &[]), 0);
        criterion(&case.status(), "direct")
    });
    assert_eq!(found[0], found[1]);
    assert!(found[0] < 0.3, "{found:?}");
}

#[test]
fn an_outage_of_the_licence_server_costs_nothing_but_time() {
    let case = Case::new("licence-outage", &[], "");
    let run = case.run("2", &[("OUT", "8")]);
    assert_code(&run, 0);
    let status = case.status();
    assert_eq!(status["designs"]["done"], 10, "{status}");
    assert_eq!(status["samples"]["done"], 250, "{status}");
    assert!(status["failures"].as_u64() > Some(0), "{status}");
    let failures = case.export("failures");
    assert!(!failures.contains("quarantine"), "{failures}");
}
