//! The commands that change nothing: `simulate`, `check`, `init`, `status`.

use acceptance::{FIGURE_7, Sandbox, assert_code, errors, printed, small_campaign};
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
    assert_eq!(unworn["schema_version"], 3);
    assert_eq!(unworn["simulable"], true);
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
        "/tip_land_mm/1",
        "/constraints/0/value",
        "/constraints/0/limit",
        "/root_stress_mpa/1",
        "/iso_6336/root_safety/1",
        "/iso_6336/flank_safety/1",
        "/pair_stiffness_n_per_mm_um",
        "/ste_um/phase/0",
        "/ste_um/value/0",
    ] {
        assert!(number(&unworn, path).is_finite());
    }
    // The safeties are the material's limits divided by the nominal stresses.
    for (safety, stress, limit) in [
        (
            "/iso_6336/root_safety/0",
            "/iso_6336/root_stress_mpa/0",
            860.0,
        ),
        (
            "/iso_6336/flank_safety/0",
            "/iso_6336/flank_stress_mpa/0",
            1550.0,
        ),
    ] {
        let product = number(&unworn, safety) * number(&unworn, stress);
        assert!((product / limit - 1.0).abs() < 1e-12);
    }
    // With the module that resulted from the centre distance, the centre distance results from it.
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
    let mut sorted: Vec<f64> = samples.iter().map(|s| s.as_f64().unwrap()).collect();
    sorted.sort_by(f64::total_cmp);
    // Rank (40 + 1/3) · 0.9 + 1/3 = 36.6333, from 1 on.
    let expected = sorted[35] + (0.9 * 40.0 + 0.3 + 1.0 / 3.0 - 36.0) * (sorted[36] - sorted[35]);
    assert!((number(&a, "/p90_um") - expected).abs() < 1e-12);
    let high = number(&a, "/p90_interval_um/1");
    assert!(sorted[38] < high && high < sorted[39], "{high}");
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
    let output = sandbox.coordinator(&["simulate", "--pair", "pair.toml", "--json"]);
    assert_code(&output, 15);
    let refused: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!(refused["simulable"], false);
    assert_eq!(refused["feasible"], false);
    let reason = refused["reason"].as_str().unwrap();
    assert!(reason.starts_with("no-involute-solution: "));
    assert_eq!(refused.get("delta_ste_um"), None);

    let output = sandbox.coordinator(&["simulate", "--pair", "pair.toml", "--out", "none"]);
    assert_code(&output, 15);
    let sentence = format!("the pair cannot be simulated: {reason}\n");
    assert_eq!(printed(&output), sentence);
    assert!(!sandbox.path("none").exists());
}

/// A pair whose tips penetrate the mate's root is simulable, but not feasible.
#[test]
fn simulate_names_every_broken_constraint() {
    let sandbox = Sandbox::new();
    let pressed = FIGURE_7
        .replace(
            "tool_dedendum = [1.00, 1.09]",
            "tool_dedendum = [1.60, 1.09]",
        )
        .replace("contact_limit_mpa = 1550.0", "contact_limit_mpa = 500.0");
    sandbox.write("pair.toml", &pressed);
    let output = sandbox.coordinator(&["simulate", "--pair", "pair.toml"]);
    assert_code(&output, 0);
    let text = printed(&output);
    let (_, verdict) = text.split_once("\ninfeasible: ").expect("a verdict");
    for part in [
        "contact pressure = ",
        " MPa beyond its limit of 500 MPa",
        "pinion tip clearance = -",
    ] {
        assert!(verdict.contains(part), "no {part:?} in\n{verdict}");
    }
    let object = simulate(&sandbox, &[]);
    assert_eq!(object["feasible"], false);
    let broken = object["constraints"].as_array().unwrap().iter();
    let broken = broken.filter(|row| row["holds"] == false).count();
    assert_eq!(verdict.lines().skip(1).count(), broken);
}

#[test]
fn simulate_warns_of_a_doubtful_unit_and_writes_a_page_into_an_empty_folder_only() {
    let sandbox = Sandbox::new();
    let doubtful = FIGURE_7.replace(
        "youngs_modulus_gpa = 200.0",
        "youngs_modulus_gpa = 206000.0",
    );
    sandbox.write("pair.toml", &doubtful);
    let page = [
        "simulate",
        "--pair",
        "pair.toml",
        "--wear",
        "archard",
        "--out",
        "page",
    ];
    let output = sandbox.run_with("coordinator", &page, &[("PITCHLINE_LOG", "warn")]);
    assert_code(&output, 0);
    let said = errors(&output);
    assert!(said.contains("206000 GPa: did you mean 206?"), "{said}");
    for file in [
        "pair.html",
        "section.svg",
        "ste.svg",
        "ste.csv",
        "pressure.svg",
        "pressure.csv",
        "torque.svg",
        "torque.csv",
        "wear.svg",
        "wear.csv",
    ] {
        assert!(sandbox.path("page").join(file).exists(), "{file}");
    }
    let output = sandbox.coordinator(&page);
    assert_code(&output, 4);
    assert!(
        errors(&output).contains("it is not empty"),
        "{}",
        errors(&output)
    );
}

#[test]
fn an_exported_optimum_simulates_to_the_figure_of_its_campaign() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("tiny.toml", &small_campaign(12, 10));
    let file = file.to_str().unwrap();
    assert_code(&sandbox.coordinator(&["run", file, "--db", "tiny.db"]), 0);
    let table = [
        "export",
        "--db",
        "tiny.db",
        "--table",
        "optima",
        "--out",
        "optima.csv",
    ];
    assert_code(&sandbox.coordinator(&table), 0);
    let optima = std::fs::read_to_string(sandbox.path("optima.csv")).unwrap();
    let fields = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let header = fields(optima.lines().next().unwrap());
    let column = header
        .iter()
        .position(|name| name == "criterion_um")
        .unwrap();
    for (approach, wear) in [("no-wear", "none"), ("archard", "archard")] {
        let row = optima.lines().map(fields).find(|row| row[0] == approach);
        let criterion: f64 = row.unwrap()[column].parse().unwrap();
        let pair = format!("{approach}.toml");
        let export = [
            "export",
            "--db",
            "tiny.db",
            "--pair",
            &pair,
            "--approach",
            approach,
        ];
        assert_code(&sandbox.coordinator(&export), 0);
        assert_code(&sandbox.coordinator(&export), 4);
        let output = sandbox.coordinator(&["simulate", "--pair", &pair, "--wear", wear, "--json"]);
        assert_code(&output, 0);
        let object: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
        let simulated = number(&object, "/delta_ste_um");
        assert!(
            (simulated / criterion - 1.0).abs() < 1e-9,
            "{simulated} against {criterion}"
        );
    }
    // Without a name it is the approach that the report recommends.
    let best = sandbox.coordinator(&["export", "--db", "tiny.db", "--pair", "best.toml"]);
    assert_code(&best, 0);
    let summary = printed(&sandbox.coordinator(&["status", "--db", "tiny.db"]));
    let verified = |line: &str| {
        let (of, p90) = line.strip_prefix("optimum")?.split_once("P90 ")?;
        let p90: f64 = p90.split_whitespace().next()?.parse().ok()?;
        Some((p90, of.split_whitespace().next()?.to_owned()))
    };
    let best = summary.lines().filter_map(verified);
    let best = best.min_by(|a, b| a.0.total_cmp(&b.0));
    let (_, best) = best.unwrap_or_else(|| panic!("no optimum in\n{summary}"));
    let named = [
        "export",
        "--db",
        "tiny.db",
        "--pair",
        "named.toml",
        "--approach",
        &best,
    ];
    assert_code(&sandbox.coordinator(&named), 0);
    let [by_default, by_name] =
        ["best.toml", "named.toml"].map(|file| std::fs::read(sandbox.path(file)).unwrap());
    assert_eq!(by_default, by_name);
    let none = [
        "export",
        "--db",
        "tiny.db",
        "--pair",
        "x.toml",
        "--approach",
        "best-of-doe",
    ];
    let output = sandbox.coordinator(&none);
    assert_code(&output, 1);
    assert!(errors(&output).contains("approach best-of-doe found no design"));
    assert!(!sandbox.path("x.toml").exists());
}

#[test]
fn init_writes_a_file_that_check_accepts() {
    let sandbox = Sandbox::new();
    assert_code(&sandbox.coordinator(&["init", "new.toml"]), 0);
    let text = std::fs::read_to_string(sandbox.path("new.toml")).unwrap();
    assert!(text.contains("name = \"new\""), "{text}");
    let output = sandbox.coordinator(&["check", "new.toml"]);
    assert_code(&output, 0);
    let plan = printed(&output);
    for part in [
        "150 designs",
        "at most 4500 samples",
        "core-seconds",
        "23 and 47 teeth",
        "of 40 random designs are feasible",
    ] {
        assert!(plan.contains(part), "no {part:?} in\n{plan}");
    }
    // A limit that every design breaks is named with the nearest value.
    sandbox.write(
        "new.toml",
        &text.replace("contact_ratio_min = 1.25", "contact_ratio_min = 5.0"),
    );
    let output = sandbox.coordinator(&["check", "new.toml"]);
    assert_code(&output, 0);
    let plan = printed(&output);
    assert!(
        plan.contains("\n0 of 40 random designs are feasible"),
        "{plan}"
    );
    let warning = "all 40 random designs that can be simulated break the same constraint, the mildest of them with \
                   contact ratio = 2.";
    assert!(plan.contains(warning), "{plan}");
}

#[test]
fn a_new_users_pair_is_designed_in_four_commands() {
    let sandbox = Sandbox::new();
    for command in [
        &["init", "my.toml"][..],
        &["run", "my.toml", "--db", "my.db", "--out", "report"],
        &[
            "export",
            "--db",
            "my.db",
            "--pair",
            "best.toml",
            "--approach",
            "archard",
        ],
        &["simulate", "--pair", "best.toml"],
    ] {
        assert_code(&sandbox.coordinator(command), 0);
    }
    let best = std::fs::read_to_string(sandbox.path("best.toml")).unwrap();
    sandbox.write(
        "bare.toml",
        &best.replacen("tip_relief_um = [", "tip_relief_um = [0.0, 0.0] # [", 1),
    );
    let simulate = |pair: &str| {
        let samples = ["--wear", "random", "--samples", "500", "--json"];
        let output = sandbox.coordinator(&[&["simulate", "--pair", pair], &samples[..]].concat());
        assert_code(&output, 0);
        let simulation: serde_json::Value = serde_json::from_str(&printed(&output)).unwrap();
        assert_eq!(simulation["feasible"], true, "{simulation}");
        let centre_distance = simulation["centre_distance_mm"].as_f64().unwrap();
        assert!(
            (centre_distance - 109.293).abs() < 1e-9,
            "{centre_distance}"
        );
        assert_eq!(simulation["normal_module_mm"], 3.0);
        simulation["p90_um"].as_f64().unwrap()
    };
    let [relieved, bare] = ["best.toml", "bare.toml"].map(simulate);
    assert!(relieved < 0.9 * bare, "{relieved} against {bare}");
    let report = std::fs::read_to_string(sandbox.path("report/report.html")).unwrap();
    assert!(report.contains("– further limits") && report.contains("pinion tip land = "));
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

#[test]
fn a_campaign_beyond_one_coordinator_is_said_so() {
    let sandbox = Sandbox::new();
    for (samples, is_beyond) in [(100, false), (1_000_000, true)] {
        sandbox.write("large.toml", &small_campaign(2000, samples));
        let check = sandbox.coordinator(&["check", "large.toml"]);
        assert_code(&check, 0);
        let text = printed(&check);
        let said = text.contains("one coordinator with its store holds about 1e9");
        assert_eq!(said, is_beyond, "{text}");
    }
}

#[test]
fn a_cluster_is_simulated() {
    let sandbox = Sandbox::new();
    let arguments = [
        "simulate-cluster",
        "--workers",
        "5,50",
        "--sample-seconds",
        "1",
    ];
    let more = [
        "--failure-hours",
        "0.05",
        "--wave-share",
        "0.3",
        "--wave-every",
        "20",
        "--seconds",
        "60",
    ];
    let output =
        sandbox.coordinator(&[&arguments[..], &more, &["--out", "out", "--json"]].concat());
    assert_code(&output, 0);
    let found: Value = serde_json::from_str(&printed(&output)).expect("one JSON object");
    let of = |index: usize, key: &str| found["scenarios"][index][key].as_f64().expect("a number");
    assert!(of(1, "samples") > 3.0 * of(0, "samples"), "{found}");
    assert!(
        of(1, "lost_samples") > 0.0 && of(1, "quarantined") == 0.0,
        "{found}"
    );
    let table = std::fs::read_to_string(sandbox.path("out/cluster.csv")).unwrap();
    assert_eq!(table.lines().count(), 3, "{table}");
    assert!(sandbox.path("out/cluster.svg").exists());
    let bad = sandbox.coordinator(&["simulate-cluster", "--sample-seconds", "-1"]);
    assert_code(&bad, 2);
}
