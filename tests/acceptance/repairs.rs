//! Campaigns in which everything fails, part of it fails, or nothing can be found: their messages, and their repair by
//! the same command.

use acceptance::{Sandbox, assert_code, changed, printed, python, small_campaign};
use serde_json::Value;

/// A parabola of two variables with a constraint, in a few seconds.
const CAMPAIGN: &str = "kind = \"external\"\nformat = 1\nname = \"outage\"\nseed = 1\n\n\
    [[variables]]\nname = \"a\"\nlow = 0.0\nhigh = 1.0\n\n\
    [[variables]]\nname = \"b\"\nlow = 0.0\nhigh = 1.0\n\n\
    [[constraints]]\nname = \"g\"\nmax = 9.0\n\n[[responses]]\nname = \"y\"\nbaseline = true\n\n\
    [doe]\ndesigns = 12\n\n[sampling]\nsamples_per_design = 10\n\n\
    [optimise]\nevaluations = 40\nstarts = 1\n\n[verify]\nsamples = 30\n\n\
    [enrichment]\ncriterion = \"expected-quantile-improvement\"\nsamples = 220\nrounds = 2\n\
    points_per_round = 2\nsamples_per_point = 20\ntolerance = 0.001\n\n\
    [simulator]\nprobe_designs = 0\nretry_s = 1.0\n";

/// The program: it fails for every request that the expression of `FAILS` holds for.
const PROGRAM: &str = "import json, os, random, sys\n\
    for line in sys.stdin:\n    \
        r = json.loads(line)\n    \
        d = r.get('design', {})\n    \
        if r['request'] == 'describe':\n        a = {'protocol': 2, 'version': '1'}\n    \
        elif FAILS:\n        a = {'error': 'no licence'}\n    \
        else:\n        \
            seed = sum(w << (32 * i) for i, w in enumerate(r.get('seed', [0])))\n        \
            y = SLOPE * ((d['a'] - 0.3) ** 2 + (d['b'] - 0.6) ** 2)\n        \
            noise = 0.1 * random.Random(seed).gauss(0, 1)\n        \
            a = {n: y if n == 'y' else 5 + d['a'] for n in r['responses']} \
                if r['request'] == 'evaluate' else {'y': y + noise}\n    \
        print(json.dumps({**a, 'id': r['id']}), flush=True)\n";

struct Case {
    sandbox: Sandbox,
    file: String,
    exec: String,
}

impl Case {
    /// A campaign whose program fails where `fails` holds.
    fn new(fails: &str, slope: &str, changes: &[(&str, &str)]) -> Self {
        let sandbox = Sandbox::new();
        let file = sandbox.write("c.toml", &changed(CAMPAIGN, changes));
        let program = PROGRAM.replace("FAILS", fails).replace("SLOPE", slope);
        let program = sandbox.write("program.py", &program);
        Self {
            file: file.display().to_string(),
            exec: python(&program),
            sandbox,
        }
    }

    /// Runs the campaign and returns what it printed.
    fn run(&self, db: &str, code: i32) -> String {
        let (file, exec) = (&self.file, &self.exec);
        let words = [
            "run",
            file,
            "--db",
            db,
            "--out",
            "report",
            "--exec",
            exec,
            "--workers",
            "2",
        ];
        let output = self.sandbox.coordinator(&words);
        assert_code(&output, code);
        printed(&output)
    }

    fn status(&self, db: &str) -> Value {
        self.sandbox.status(db).expect("the store is there")
    }

    /// Every table whose rows are results, without processor times.
    fn tables(&self, db: &str) -> Vec<String> {
        let tables = [
            "designs",
            "samples",
            "responses",
            "rounds",
            "infill",
            "optima",
        ];
        let export = |table: &&str| {
            let words = ["export", "--db", db, "--table", table, "--out", "-"];
            let output = self.sandbox.coordinator(&words);
            assert_code(&output, 0);
            let table = printed(&output);
            let header = table.lines().next().expect("a header");
            let is_kept: Vec<bool> = header.split(',').map(|c| !c.contains("cpu")).collect();
            let lines = table.lines().map(|line| {
                let fields = line.split(',').zip(&is_kept);
                let fields: Vec<&str> = fields.filter(|(_, k)| **k).map(|(f, _)| f).collect();
                fields.join(",") + "\n"
            });
            lines.collect::<String>()
        };
        tables.iter().map(export).collect()
    }

    /// Compares a repaired campaign with one that is undisturbed from the start.
    fn assert_repaired(&self, db: &str) {
        self.run(db, 0);
        self.run("undisturbed.db", 0);
        assert_eq!(self.tables(db), self.tables("undisturbed.db"));
        let [repaired, undisturbed] = [db, "undisturbed.db"].map(|db| self.status(db));
        let keys = [
            "finished",
            "samples",
            "samples_digest",
            "point_samples_digest",
            "optima",
            "warnings",
        ];
        for key in keys {
            assert_eq!(repaired[key], undisturbed[key], "{key}");
        }
    }
}

/// An outage quarantines everything. The same command again computes everything and finds the optimum.
#[test]
fn a_campaign_that_was_all_quarantined_is_computed_by_the_same_command() {
    let case = Case::new("not os.path.exists('licence')", "1", &[]);
    let said = case.run("c.db", 13);
    assert!(said.contains("kriging          no model ("), "{said}");
    assert!(
        said.contains("best-of-doe      nothing computed\n"),
        "{said}"
    );
    assert_eq!(case.status("c.db")["samples"]["done"], 0);
    case.sandbox.write("licence", "");
    case.assert_repaired("c.db");
}

/// A campaign without a quarantined design ends with a model, rounds and optima. After the retry, all of these are
/// computed again.
#[test]
fn what_was_learned_without_a_quarantined_design_is_learned_again() {
    let fails = "r['request'] == 'sample' and d['a'] > 0.8 and not os.path.exists('licence')";
    // By default a sample that fails for good is a result.
    let policy = "samples_per_design = 10\nfailed = \"quarantines-design\"";
    let case = Case::new(fails, "1", &[("samples_per_design = 10", policy)]);
    case.run("c.db", 13);
    let status = case.status("c.db");
    assert_eq!(status["enrichment"]["ended"], true, "{status}");
    let warning = status["warnings"][0].as_str().expect("a warning");
    assert!(warning.contains("ended without samples of"), "{warning}");
    // Results that fail again are still missing.
    case.run("c.db", 13);
    case.sandbox.write("licence", "");
    case.assert_repaired("c.db");
}

#[test]
fn a_campaign_without_a_feasible_design_has_an_exit_code_of_its_own() {
    let case = Case::new("False", "1", &[("max = 9.0", "max = 1.0")]);
    let said = case.run("c.db", 16);
    assert!(
        said.contains("kriging          no feasible design\n"),
        "{said}"
    );
    let status = case.status("c.db");
    for optimum in status["optima"].as_array().expect("a list") {
        assert_eq!(optimum["none"], "none-feasible", "{optimum}");
    }
}

/// Regression test: an approach whose model could not be fitted had "no feasible design, 0 of 0 verification samples".
#[test]
fn an_approach_without_a_model_says_why() {
    let case = Case::new("False", "0", &[]);
    let said = case.run("c.db", 0);
    let line = said.lines().find(|line| line.contains("kriging   "));
    let line = line.expect("a line for kriging");
    assert!(
        line.contains("no model (") && line.contains("no dependence on"),
        "{line}"
    );
    assert!(!line.contains("verification samples"), "{line}");
    let status = case.status("c.db");
    let optima = status["optima"].as_array().expect("a list");
    let kriging = optima.iter().find(|one| one["approach"] == "kriging");
    assert_eq!(kriging.expect("a row")["none"], "no-model", "{status}");
    let html = std::fs::read_to_string(case.sandbox.path("report/report.html")).unwrap();
    assert!(
        html.contains("There is no kriging model: "),
        "no reason in the report"
    );
}

/// Discarded results are computed again and equal the earlier ones.
#[test]
fn discarded_results_are_computed_again() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &small_campaign(12, 10));
    let file = file.to_str().unwrap();
    let run = ["run", file, "--db", "c.db", "--out", "out"];
    assert_code(&sandbox.coordinator(&run), 0);
    let before = sandbox.status("c.db").expect("the store is there");
    let table = ["export", "--db", "c.db", "--table", "blocks", "--out", "-"];
    let blocks = sandbox.coordinator(&table);
    assert_code(&blocks, 0);
    let blocks = printed(&blocks);
    let of_design = blocks.lines().find(|line| line.starts_with("design-"));
    let cells: Vec<&str> = of_design.expect("a sampled design").split(',').collect();
    let (design, host) = (cells[0].trim_start_matches("design-"), cells[4]);
    assert!(!host.is_empty(), "{blocks}");

    let counted = |what: [&str; 2], yes: bool| -> Value {
        let arguments = ["discard", "--db", "c.db", "--json", what[0], what[1]];
        let arguments = arguments.into_iter().chain(yes.then_some("--yes"));
        let output = sandbox.coordinator(&arguments.collect::<Vec<_>>());
        assert_code(&output, 0);
        serde_json::from_str(&printed(&output)).expect("one JSON object")
    };
    let (machine, _) = host.rsplit_once(':').expect("MACHINE:PROCESS");
    for what in [
        ["--design", design],
        ["--worker", host],
        ["--worker", machine],
    ] {
        let would = counted(what, false);
        assert!(would["samples"].as_u64() >= Some(10), "{would}");
        assert_eq!(
            sandbox.status("c.db").unwrap()["samples"],
            before["samples"]
        );
        let removed = counted(what, true);
        for key in ["samples", "criteria", "evaluations", "runs"] {
            assert_eq!(removed[key], would[key], "{key}");
        }
        let left = sandbox.status("c.db").unwrap();
        assert!(left["samples"]["done"].as_u64() < before["samples"]["done"].as_u64());
        assert_eq!(left["finished"], false);
        assert_code(&sandbox.coordinator(&run), 0);
        let after = sandbox.status("c.db").unwrap();
        for key in [
            "samples_digest",
            "point_samples_digest",
            "samples",
            "optima",
            "finished",
        ] {
            assert_eq!(after[key], before[key], "{what:?}: {key}");
        }
    }
    let nothing = counted(["--worker", "unknown"], true);
    assert_eq!(nothing["samples"], 0);
    assert_eq!(sandbox.status("c.db").unwrap()["finished"], true);
}
