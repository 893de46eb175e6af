//! An external program that answers absurd numbers now and then.

use acceptance::{Sandbox, assert_code, changed, printed, python};
use serde_json::Value;

use crate::campaign::export;
use crate::other_output::run;

/// A parabola of two variables.
const CAMPAIGN: &str = "kind = \"external\"\nformat = 1\nname = \"absurd\"\nseed = 1\n\n\
    [[variables]]\nname = \"a\"\nlow = 0.0\nhigh = 1.0\n\n\
    [[variables]]\nname = \"b\"\nlow = 0.0\nhigh = 1.0\n\n\
    [[responses]]\nname = \"y\"\nunit = \"mm\"\n\n\
    [doe]\ndesigns = 25\n\n[sampling]\nsamples_per_design = 10\n\n\
    [optimise]\nevaluations = 100\nstarts = 1\n\n[verify]\nsamples = 200\n\n\
    [simulator]\nprobe_designs = 0\n";

/// The program. Until there is a file `mended`, it answers 1e160 once where a is large, and 1e50 once where a is
/// small.
const PROGRAM: &str = r#"
import json, os, random, sys

def once(name):
    try:
        os.close(os.open(name, os.O_CREAT | os.O_EXCL))
        return not os.path.exists("mended")
    except FileExistsError:
        return False

for line in sys.stdin:
    r = json.loads(line)
    if r["request"] == "describe":
        a = {"protocol": 2, "version": "1"}
    else:
        d = r["design"]
        seed = sum(w << (32 * i) for i, w in enumerate(r.get("seed", [0])))
        y = (d["a"] - 0.3) ** 2 + (d["b"] - 0.6) ** 2 + 0.1 * random.Random(seed).gauss(0, 1)
        if r["request"] == "sample":
            if d["a"] > 0.8 and once("large"):
                y = 1e160
            if d["a"] < 0.2 and once("small"):
                y = 1e50
        a = {name: y for name in r.get("responses", ["y"])}
    print(json.dumps({**a, "id": r["id"]}), flush=True)
"#;

struct Case {
    sandbox: Sandbox,
    file: String,
    exec: String,
}

impl Case {
    fn new(changes: &[(&str, &str)]) -> Self {
        let sandbox = Sandbox::new();
        let file = sandbox.write("c.toml", &changed(CAMPAIGN, changes));
        let program = sandbox.write("program.py", PROGRAM);
        Self {
            file: file.display().to_string(),
            exec: python(&program),
            sandbox,
        }
    }

    /// Runs the campaign to exit code 0 and returns the log.
    fn run(&self, db: &str) -> String {
        self.run_to(0, db)
    }

    /// Runs the campaign to this exit code and returns the log.
    fn run_to(&self, code: i32, db: &str) -> String {
        let words = ["run", &self.file, "--db", db, "--out", "report"];
        let workers = ["--workers", "2", "--exec", &self.exec];
        let (ended, said) = run(&self.sandbox, &[&words[..], &workers].concat());
        assert_eq!(ended, Some(code), "{said}");
        said
    }

    fn mend(&self) {
        self.sandbox.write("mended", "");
    }

    fn status(&self, db: &str) -> Value {
        self.sandbox.status(db).expect("the store is there")
    }

    /// The results that are equal in two equal campaigns.
    fn results(&self, db: &str) -> (Vec<Value>, String) {
        let status = self.status(db);
        let keys = [
            "samples_digest",
            "point_samples_digest",
            "optima",
            "warnings",
        ];
        let words = ["export", "--db", db, "--table", "responses", "--out", "-"];
        let responses = self.sandbox.coordinator(&words);
        assert_code(&responses, 0);
        let values = keys.map(|key| status[key].clone());
        (values.to_vec(), printed(&responses))
    }
}

/// The percentile of the optimum on the model: the estimate and its interval.
fn percentile(status: &Value) -> [f64; 3] {
    let optima = status["optima"].as_array().expect("a list");
    let kriging = optima.iter().find(|one| one["approach"] == "kriging");
    let percentile = &kriging.expect("a row")["measure"];
    ["low", "value", "high"].map(|key| percentile[key].as_f64().expect("a number"))
}

/// 1e160 is refused and computed again. 1e50 is stored, and its design has no response.
#[test]
fn an_absurd_sample_ends_no_campaign_and_moves_no_optimum() {
    let case = Case::new(&[]);
    let said = case.run("c.db");
    assert!(
        said.contains("have no variance in double precision"),
        "{said}"
    );
    assert!(said.contains("WARN Designs that the model"), "{said}");
    let status = case.status("c.db");
    let warnings = status["warnings"].to_string();
    for part in [
        "(y of sample ",
        " is 1e50 mm)",
        "coordinator discard --db FILE --design N --yes",
    ] {
        assert!(warnings.contains(part), "{part}: {warnings}");
    }
    let report = std::fs::read_to_string(case.sandbox.path("report/report.html")).unwrap();
    assert!(report.contains("because of an absurd sample"));
    let (_, responses) = case.results("c.db");
    assert_eq!(responses.lines().count(), 25, "a header and 24 designs");

    case.mend();
    case.run("undisturbed.db");
    let undisturbed = case.status("undisturbed.db");
    assert!(undisturbed["warnings"].is_null(), "{undisturbed}");
    let ([low, _, high], [_, found, _]) = (percentile(&undisturbed), percentile(&status));
    assert!((low..=high).contains(&found), "{found} in {low} to {high}");
}

/// With limits both numbers are failures, which the next attempt mends.
#[test]
fn samples_beyond_the_limits_are_computed_again() {
    let case = Case::new(&[(
        "unit = \"mm\"\n",
        "unit = \"mm\"\nmin = -10.0\nmax = 10.0\n",
    )]);
    let said = case.run("c.db");
    let sentence = "y is 1e50 mm, above the largest plausible value 10.0 mm (max of the response)";
    assert!(said.contains(sentence), "{said}");
    assert_eq!(case.status("c.db")["failures"], 2);
    case.mend();
    case.run("undisturbed.db");
    assert_eq!(case.results("c.db"), case.results("undisturbed.db"));
}

/// Limits can be given afterwards, too. The sample beyond them is stored and leaves its design without a response.
#[test]
fn a_store_keeps_its_samples_under_other_limits() {
    let case = Case::new(&[]);
    case.run("c.db");
    let limited = changed(
        CAMPAIGN,
        &[("unit = \"mm\"\n", "unit = \"mm\"\nmax = 10.0\n")],
    );
    case.sandbox.write("c.toml", &limited);
    let before = case.results("c.db");
    case.run("c.db");
    assert_eq!(case.results("c.db"), before);
}

/// A limit on samples is added after the end, made impossible, and removed again. No sample is computed for it.
#[test]
fn a_limit_on_samples_can_come_and_go_after_the_end() {
    let case = Case::new(&[]);
    case.mend();
    case.run("c.db");
    let before = case.results("c.db");
    for (max, code, feasible) in [("5.0", 0, "1"), ("-5.0", 16, "0")] {
        let limit = format!(
            "\n[[constraints]]\nname = \"cap\"\nresponse = \"y\"\nmeasure = \"percentile\"\nlevel = 0.95\nmax = {max}\n"
        );
        case.sandbox
            .write("c.toml", &(CAMPAIGN.to_owned() + &limit));
        case.run_to(code, "c.db");
        let optima = export(&case.sandbox, "c.db", "optima");
        let column = optima[0].iter().position(|name| name == "feasible");
        let column = column.expect("a column");
        assert!(optima.len() > 1);
        assert!(
            optima[1..].iter().all(|row| row[column] == feasible),
            "{optima:?}"
        );
        assert_eq!(case.status("c.db")["samples_digest"], before.0[0]);
    }
    case.sandbox.write("c.toml", CAMPAIGN);
    case.run("c.db");
    assert_eq!(case.results("c.db"), before);
}

/// After the program is mended and the samples are discarded, the campaign is as if nothing had been.
#[test]
fn a_discarded_design_is_computed_by_the_mended_program() {
    let case = Case::new(&[]);
    case.run("c.db");
    let warnings = case.status("c.db")["warnings"].to_string();
    let (_, after) = warnings.split_once(": design ").expect("a design");
    let design = after.split(' ').next().expect("a number");
    case.mend();
    let discard = ["discard", "--db", "c.db", "--design", design, "--yes"];
    assert_code(&case.sandbox.coordinator(&discard), 0);
    case.run("c.db");
    case.run("undisturbed.db");
    assert_eq!(case.results("c.db"), case.results("undisturbed.db"));
}
