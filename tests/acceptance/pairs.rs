//! `simulate` with unusual pairs: unusual sizes, infeasible optima, pairs in REXS.

use acceptance::{FIGURE_7, Sandbox, assert_code, errors, printed, small_campaign};
use serde_json::Value;

use crate::user_tables::case;

/// The simulation of a case's pair as JSON.
fn simulated(name: &str) -> Value {
    let sandbox = Sandbox::new();
    let file = case(name);
    let output = sandbox.coordinator(&["simulate", "--pair", file.to_str().unwrap(), "--json"]);
    assert_code(&output, 0);
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

fn value(of: &Value, path: &str) -> f64 {
    of.pointer(path)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("no {path} in {of}"))
}

/// 97 teeth of module 2.5 at 122 mm: the backlash is the pitch less both thicknesses at the working circles.
#[test]
fn a_pair_with_module_and_centre_distance_runs_with_its_backlash() {
    let found = simulated("module-and-centre-distance/dth.toml");
    assert!(
        (value(&found, "/backlash_mm") - 0.195_667).abs() < 1e-5,
        "{found}"
    );
    assert!(
        (value(&found, "/working_pressure_angle_deg") - 20.9463).abs() < 1e-4,
        "{found}"
    );
    assert_eq!(value(&found, "/centre_distance_mm"), 122.0);
    assert_eq!(value(&found, "/normal_module_mm"), 2.5);

    let sandbox = Sandbox::new();
    let text = std::fs::read_to_string(case("module-and-centre-distance/dth.toml")).unwrap();
    sandbox.write("near.toml", &text.replace("= 122.0", "= 121.5"));
    let output = sandbox.coordinator(&["simulate", "--pair", "near.toml"]);
    assert_code(&output, 15);
    for part in ["the teeth jam", "121.5", "without backlash it is 121.7"] {
        let said = printed(&output);
        assert!(said.contains(part), "no {part:?} in {said}");
    }
}

/// The undercut of a rolling rack ends 0.5530 modules up the line of action, 0.44 mm beyond the start of contact.
#[test]
fn undercut_cuts_the_margin_and_the_contact_ratio() {
    let found = simulated("undercut-margin/uc12_30c.toml");
    assert!(
        (value(&found, "/flank_margin_mm/0") + 0.443).abs() < 0.001,
        "{found}"
    );
    assert!(
        (value(&found, "/contact_ratio/total") - 1.218).abs() < 0.0005,
        "{found}"
    );
    assert_eq!(found["feasible"], false, "{found}");
}

#[test]
fn the_least_violating_design_is_exported_as_infeasible() {
    let sandbox = Sandbox::new();
    let text = small_campaign(12, 10);
    let limits = text.find("[constraints]\n").expect("the section") + "[constraints]\n".len();
    let (before, after) = text.split_at(limits);
    let after: Vec<&str> = after
        .lines()
        .filter(|line| !line.starts_with("contact_ratio_min"))
        .collect();
    let text = format!("{before}contact_ratio_min = 5.0\n{}\n", after.join("\n"));
    sandbox.write("tiny.toml", &text);
    let output = sandbox.coordinator(&["run", "tiny.toml", "--db", "tiny.db"]);
    assert_code(&output, 16);
    let export = [
        "export",
        "--db",
        "tiny.db",
        "--approach",
        "archard",
        "--pair",
        "least.toml",
    ];
    let output = sandbox.coordinator(&export);
    assert_code(&output, 1);
    assert!(
        errors(&output).contains("--infeasible"),
        "{}",
        errors(&output)
    );
    let export = [&export[..], &["--infeasible"]].concat();
    let output = sandbox.run_with("coordinator", &export, &[("PITCHLINE_LOG", "warn")]);
    assert_code(&output, 0);
    let said = errors(&output);
    assert!(said.contains("contact ratio"), "{said}");
    let written = std::fs::read_to_string(sandbox.path("least.toml")).unwrap();
    assert!(
        written.starts_with("# INFEASIBLE: approach archard"),
        "{written}"
    );
    let output = sandbox.coordinator(&["simulate", "--pair", "least.toml"]);
    assert_code(&output, 0);
    assert!(
        printed(&output).contains("infeasible: "),
        "{}",
        printed(&output)
    );
}

#[test]
fn a_pair_in_rexs_is_imported_and_simulated_as_it_was() {
    let sandbox = Sandbox::new();
    sandbox.write("pair.toml", FIGURE_7);
    let simulate = |pair: &str| {
        let output =
            sandbox.coordinator(&["simulate", "--pair", pair, "--out", &format!("{pair}-page")]);
        assert_code(&output, 0);
        printed(&output)
    };
    let designed = simulate("pair.toml");
    let output = sandbox.coordinator(&["import", "pair.toml-page/pair.rexs"]);
    assert_code(&output, 0);
    sandbox.write("imported.toml", &printed(&output));
    let sheet = |text: &str| text.split("feasible: ").next().unwrap().to_owned();
    assert_eq!(sheet(&simulate("imported.toml")), sheet(&designed));
    for (command, why) in [
        (
            &["simulate", "--pair", "pair.toml-page/pair.rexs"][..],
            "coordinator import",
        ),
        (&["import", "pair.toml"], "pair.toml is not XML"),
        (
            &["import", "pair.toml-page/pair.rexs", "--torque=-1"],
            "load.pinion_torque_nm",
        ),
    ] {
        let output = sandbox.coordinator(command);
        assert_code(&output, 3);
        assert!(errors(&output).contains(why), "{}", errors(&output));
    }
}
