//! The percentile at the top of a report, for responses that are not normal and for responses that are maximised.

use acceptance::{Sandbox, assert_code, changed, errors, printed, python, root};
use serde_json::Value;

/// Runs the case with this distribution and these changes; returns the sandbox and the status.
fn campaign(law: &str, changes: &[(&str, &str)]) -> (Sandbox, Value) {
    let sandbox = Sandbox::new();
    let case = root().join("tests/acceptance/cases/percentiles");
    let shipped = |name| std::fs::read_to_string(case.join(name)).expect("the case is there");
    let file = sandbox.write(
        "campaign.toml",
        &changed(&shipped("campaign.toml"), changes),
    );
    let program = sandbox.write("simulator.py", &shipped("simulator.py"));
    let exec = format!("{} {law}", python(&program));
    let file = file.display().to_string();
    let run = ["run", &file, "--db", "x.db", "--out", "r", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 0);
    let status = sandbox.status("x.db").expect("the store is there");
    (sandbox, status)
}

fn baseline(status: &Value) -> &Value {
    let optima = status["optima"].as_array().expect("a list");
    let mut optima = optima.iter();
    optima
        .find(|one| one["approach"] == "baseline")
        .expect("an optimum")
}

/// Regression test: the percentile of verified designs was m + z s, 8.28 [8.22; 8.34] where 9.605 is true.
#[test]
fn a_verified_percentile_is_right_where_the_response_is_not_normal() {
    // 5 + the quantile: −ln 0.01; exp 2.3263; 1, the middle of the upper mode; Φ⁻¹(0.9/0.94).
    for (law, level, truth) in [
        ("exponential", "0.99", 9.605),
        ("lognormal", "0.99", 15.24),
        ("bimodal", "0.9", 6.0),
        ("rare-jump", "0.9", 6.72),
    ] {
        let changes = [("level = 0.9", &*format!("level = {level}"))];
        let (_sandbox, status) = campaign(law, &changes);
        let percentile = &baseline(&status)["measure"];
        let number = |key: &str| percentile[key].as_f64().expect("a number");
        // The optimum lies within 0.01 of the bottom of the bowl. Seeds are fixed: the intervals cover.
        let (low, high) = (number("low"), number("high"));
        assert!(low <= truth + 0.01 && truth <= high, "{law}: {percentile}");
        assert!(high - low < 0.25 * truth, "{law}: {percentile}");
    }
}

#[test]
fn a_maximised_response_is_shown_in_its_own_sign_and_at_its_own_level() {
    let changes = [
        ("aim = \"minimise\"", "aim = \"maximise\""),
        ("samples = 2000", "samples = 200"),
        (
            "[verify]",
            "[enrichment]\nrounds = 3\nsamples = 400\nsamples_per_point = 10\npoints_per_round = 3\n\
             tolerance = 0.05\n\n[verify]",
        ),
    ];
    let (sandbox, status) = campaign("exponential", &changes);
    // At the corner (1, 1) the bowl is 5.98; the 10th percentile of the noise is 0.105.
    let best = baseline(&status);
    let value = best["measure"]["value"].as_f64().expect("a number");
    assert!((value - 6.085).abs() < 0.1, "{status}");
    assert!(
        best["criterion"].as_f64().expect("a number") > 5.9,
        "{status}"
    );
    assert_eq!(status["measure"], "P10");
    let export = |table: &str| {
        let arguments = ["export", "--db", "x.db", "--table", table, "--out", "-"];
        let table = sandbox.coordinator(&arguments);
        assert_code(&table, 0);
        printed(&table)
    };
    for table in ["optima", "responses", "samples", "rounds"] {
        let csv = export(table);
        assert!(!csv.contains("minus") && !csv.contains("p90"), "{csv}");
        assert!(!csv.contains(",-"), "no negative value: {csv}");
    }
    assert!(export("optima").contains("p10,p10_low,p10_high"));
    let told = sandbox.coordinator(&["status", "--db", "x.db"]);
    assert!(printed(&told).contains("P10 6."), "{}", printed(&told));
    let html = std::fs::read_to_string(sandbox.path("r/report.html")).expect("the report");
    assert!(html.contains("verified P10 of y"));
    assert!(!html.contains("P90") && !html.contains("minus_y"));
    // The approach with the largest percentile is recommended, and comes first.
    let optima = status["optima"].as_array().expect("a list");
    let of = |one: &Value| one["measure"]["value"].as_f64();
    let largest = optima.iter().filter_map(of).fold(f64::MIN, f64::max);
    let leads = optima.iter().filter(|one| one.get("behind").is_none());
    assert_eq!(
        leads.filter_map(of).collect::<Vec<_>>(),
        [largest],
        "{status}"
    );
}

#[test]
fn too_few_samples_for_a_level_are_said_before_anything_runs() {
    let sandbox = Sandbox::new();
    let case = root().join("tests/acceptance/cases/percentiles/campaign.toml");
    let text = std::fs::read_to_string(case).expect("the case is there");
    let text = changed(&text, &[("level = 0.9", "level = 0.999")]);
    let file = sandbox.write("campaign.toml", &text);
    let checked = sandbox.coordinator(&["check", &file.display().to_string()]);
    assert_code(&checked, 0);
    let told = printed(&checked) + &errors(&checked);
    for part in [
        "verify.samples is 2000: a 95 % interval of P99.9 takes at least 3688",
        "sampling.samples_per_design is 10: P99.9 of a design whose samples are not normal takes 1000",
    ] {
        assert!(told.contains(part), "{told}");
    }
}
