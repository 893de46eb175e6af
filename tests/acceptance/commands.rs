//! The commands that only look: `simulate`, `check`, `init`, `status`.

use acceptance::{FIGURE_7, Sandbox, assert_code, printed};
use serde_json::Value;

fn simulate(sandbox: &Sandbox, more: &[&str]) -> Value {
    let arguments = [&["simulate", "--pair", "pair.toml", "--json"], more].concat();
    let output = sandbox.coordinator(&arguments);
    assert_code(&output, 0);
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

fn number(object: &Value, path: &str) -> f64 {
    object
        .pointer(path)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("no number at {path} in {object}"))
}

#[test]
fn simulate_prints_figure_7() {
    let sandbox = Sandbox::new();
    sandbox.write("pair.toml", FIGURE_7);
    let unworn = simulate(&sandbox, &[]);
    assert_eq!(unworn["schema_version"], 1);
    assert_eq!(unworn["feasible"], true);
    assert_eq!(unworn["reason"], Value::Null);
    // The paper prints r_c = 1.66, g_s = 1.47, ΔSTE = 0.38 and F = 938 (the model: within 20 %).
    assert_eq!(
        (number(&unworn, "/contact_ratio/total") * 100.0).round(),
        166.0
    );
    assert_eq!(
        (number(&unworn, "/specific_sliding/max") * 100.0).round(),
        147.0
    );
    assert!(number(&unworn, "/delta_ste_um") < 0.6);
    assert!((number(&unworn, "/hertz_pressure_mpa") / 938.0 - 1.0).abs() < 0.2);
    for path in [
        "/normal_module_mm",
        "/centre_distance_mm",
        "/transverse_pressure_angle_deg",
        "/working_pressure_angle_deg",
        "/reference_diameter_mm/1",
        "/base_diameter_mm/1",
        "/tip_diameter_mm/1",
        "/root_diameter_mm/1",
        "/contact_ratio/transverse",
        "/contact_ratio/overlap",
        "/specific_sliding/pinion_root",
        "/specific_sliding/pinion_tip",
        "/specific_sliding/gear_root",
        "/specific_sliding/gear_tip",
        "/clearance_mm/1",
        "/root_stress_mpa/1",
        "/iso_6336/root_safety/1",
        "/iso_6336/flank_safety/1",
        "/pair_stiffness_n_per_mm_um",
        "/ste_um/phase/0",
        "/ste_um/value/0",
    ] {
        assert!(number(&unworn, path).is_finite());
    }
    // The safeties are the material's limits over the nominal stresses.
    for (safety, stress, limit) in [
        (
            "/iso_6336/root_safety/0",
            "/iso_6336/root_stress_mpa/0",
            980.0,
        ),
        (
            "/iso_6336/flank_safety/0",
            "/iso_6336/contact_stress_mpa/0",
            1550.0,
        ),
    ] {
        let product = number(&unworn, safety) * number(&unworn, stress);
        assert!((product / limit - 1.0).abs() < 1e-12);
    }
    // With the module that followed from the centre distance, the centre distance follows from it.
    let module = number(&unworn, "/normal_module_mm");
    let swapped = FIGURE_7.replace(
        "centre_distance_mm = 110.0",
        &format!("normal_module_mm = {module}"),
    );
    sandbox.write("pair.toml", &swapped);
    let again = simulate(&sandbox, &[]);
    assert!((number(&again, "/centre_distance_mm") - 110.0).abs() < 1e-9);
    assert!(
        (number(&again, "/delta_ste_um") / number(&unworn, "/delta_ste_um") - 1.0).abs() < 1e-9
    );
}

#[test]
fn simulate_with_random_wear_follows_its_seed() {
    let sandbox = Sandbox::new();
    sandbox.write("pair.toml", FIGURE_7);
    let random = ["--wear", "random", "--seed", "7", "--samples", "40"];
    let a = simulate(&sandbox, &random);
    assert_eq!(a, simulate(&sandbox, &random));
    let samples = a["samples_um"].as_array().unwrap();
    assert_eq!(samples.len(), 40);
    let expected = number(&a, "/mean_um") + 1.28 * number(&a, "/sd_um");
    assert!((number(&a, "/p90_um") - expected).abs() < 1e-12);
    let b = simulate(
        &sandbox,
        &["--wear", "random", "--seed", "8", "--samples", "40"],
    );
    assert_ne!(a["samples_um"], b["samples_um"]);
    let archard = simulate(&sandbox, &["--wear", "archard"]);
    assert!(
        number(&archard, "/delta_ste_um") > 1.0,
        "worn flanks raise ΔSTE here"
    );
    assert_eq!(archard.get("samples_um"), None);
}

#[test]
fn simulate_says_why_a_pair_cannot_be() {
    let sandbox = Sandbox::new();
    let impossible = FIGURE_7.replace(
        "profile_shift = [0.49, 0.49]",
        "profile_shift = [-1.0, -1.0]",
    );
    sandbox.write("pair.toml", &impossible);
    let refused = simulate(&sandbox, &[]);
    assert_eq!(refused["feasible"], false);
    assert!(
        refused["reason"]
            .as_str()
            .unwrap()
            .starts_with("no-involute-solution: ")
    );
    assert_eq!(refused.get("delta_ste_um"), None);
}

#[test]
fn init_writes_a_file_that_check_accepts() {
    let sandbox = Sandbox::new();
    assert_code(&sandbox.coordinator(&["init", "new.toml"]), 0);
    let output = sandbox.coordinator(&["check", "new.toml"]);
    assert_code(&output, 0);
    let plan = printed(&output);
    for part in [
        "3000 designs",
        "at most 90000 samples",
        "core-seconds",
        "20 and 22 teeth",
    ] {
        assert!(plan.contains(part), "no {part:?} in\n{plan}");
    }
}

#[test]
fn an_interrupted_campaign_can_be_looked_at() {
    let sandbox = Sandbox::new();
    let file = sandbox.campaign("quick.toml", &[]);
    let address = acceptance::free_address().to_string();
    let serve = [
        "serve",
        file.to_str().unwrap(),
        "--db",
        "idle.db",
        "--listen",
        &address,
    ];
    let running = sandbox.start("coordinator", &serve);
    let status = sandbox.wait_for("idle.db", "the DoE", |status| status["stage"] == "sample");
    assert_eq!(status["designs"]["made"], 150);
    assert_eq!(status["samples"]["done"], 0);
    assert_code(
        &sandbox.coordinator(&["report", "--db", "idle.db", "--out", "early"]),
        0,
    );
    let html = std::fs::read_to_string(sandbox.path("early/report.html")).unwrap();
    assert!(html.contains("</html>"));
    running.kill();
}
