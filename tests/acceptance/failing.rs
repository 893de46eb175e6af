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
    let criterion = &optimum["criterion_um"];
    criterion
        .as_f64()
        .unwrap_or_else(|| panic!("nothing was found: {optimum}"))
}

#[test]
fn candidates_that_fail_rank_last_and_the_searches_go_on() {
    let case = Case::new("failing-candidate", &[], "");
    let run = case.run("1", &[]);
    let code = run.status.code();
    assert!(code == Some(0) || code == Some(13), "{}", errors(&run));
    let status = case.status();
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

#[test]
fn an_outage_of_the_licence_server_costs_nothing_but_time() {
    let case = Case::new("licence-outage", &[], "");
    case.sandbox.write("since", "");
    let run = case.run("2", &[("OUT", "8")]);
    assert_code(&run, 0);
    let status = case.status();
    assert_eq!(status["designs"]["done"], 10, "{status}");
    assert_eq!(status["samples"]["done"], 250, "{status}");
    assert!(status["failures"].as_u64() > Some(0), "{status}");
    let failures = case.export("failures");
    assert!(!failures.contains("quarantine"), "{failures}");
}
