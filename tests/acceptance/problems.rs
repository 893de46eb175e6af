//! Campaigns with a problem stated in the file and simulated by a program, checked against known
//! optima.

use acceptance::{Sandbox, assert_code, changed, errors, printed, python, root};

fn shipped(name: &str) -> String {
    let path = root().join("campaigns/ishigami").join(name);
    std::fs::read_to_string(path).expect("the example is shipped")
}

/// The example with `changes` in the sandbox: its file, and the command of its program.
fn ishigami(sandbox: &Sandbox, changes: &[(&str, &str)]) -> (String, String) {
    let file = sandbox.write(
        "campaign.toml",
        &changed(&shipped("campaign.toml"), changes),
    );
    let program = sandbox.write("simulator.py", &shipped("simulator.py"));
    (file.display().to_string(), python(&program))
}

/// A change of the example: a fourth of the evaluations.
const SHORT: (&str, &str) = ("[doe]\n", "[optimise]\nevaluations = 1000\n\n[doe]\n");

/// The verified percentile of an approach, in `column`.
fn percentile(sandbox: &Sandbox, approach: &str, column: &str) -> f64 {
    let table = ["export", "--db", "i.db", "--table", "optima", "--out", "-"];
    let table = sandbox.coordinator(&table);
    assert_code(&table, 0);
    let table = printed(&table);
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    let place = header.iter().position(|name| *name == column);
    let row = lines.find(|row| row[0] == approach);
    let row = row.unwrap_or_else(|| panic!("no {approach} in {table}"));
    row[place.expect("a column")].parse().expect("a number")
}

/// The verified 90th percentile of an approach.
fn verified(sandbox: &Sandbox, approach: &str) -> f64 {
    percentile(sandbox, approach, "p90")
}

/// The minimum, −1 − 0.1 π⁴, plus the 90th percentile of the noise.
const LEAST: f64 = -10.740_909 + 0.640_776;

#[test]
fn ishigamis_percentile_is_least_where_its_formula_says() {
    let sandbox = Sandbox::new();
    let (file, exec) = ishigami(&sandbox, &[]);
    assert_code(&sandbox.coordinator(&["check", &file]), 0);
    let run = [
        "run", &file, "--db", "i.db", "--out", "report", "--exec", &exec,
    ];
    assert_code(&sandbox.coordinator(&run), 0);
    let status = sandbox.status("i.db").expect("the store is there");
    assert_eq!(status["finished"], true, "{status}");
    assert_eq!(status["designs"]["simulable"], 150, "{status}");
    let optima = status["optima"].as_array().expect("a list");
    assert_eq!(optima.len(), 3, "baseline, kriging, best of the DoE");
    // The standard error with 500 samples is 0.04.
    let baseline = verified(&sandbox, "baseline");
    assert!((baseline - LEAST).abs() < 0.2, "{baseline}");
    let kriging = verified(&sandbox, "kriging");
    assert!(kriging < LEAST + 1.0, "{kriging}");
    let html = std::fs::read_to_string(sandbox.path("report/report.html")).unwrap();
    for part in ["baseline", "x3 = ", "P90 of y"] {
        assert!(html.contains(part), "no {part} in the report");
    }
    for gears in ["ΔSTE", "teeth", "gear", "Archard"] {
        assert!(!html.contains(gears), "{gears} in a report without gears");
    }
    let table = ["export", "--db", "i.db", "--table", "designs", "--out", "-"];
    let designs = sandbox.coordinator(&table);
    assert_code(&designs, 0);
    assert!(printed(&designs).contains("x1,x2,x3"));
    // Commands that apply only to gears are refused with the reason.
    let pair = [
        "export",
        "--db",
        "i.db",
        "--pair",
        "best.toml",
        "--approach",
        "kriging",
    ];
    let refused = sandbox.coordinator(&pair);
    assert_eq!(refused.status.code(), Some(1), "{}", errors(&refused));
    for study in ["pareto", "sensitivity"] {
        let refused = sandbox.coordinator(&[study, &file, "--db", "i.db"]);
        assert_code(&refused, 2);
        let said = errors(&refused);
        assert!(
            said.contains("this command is for campaigns of gears"),
            "{said}"
        );
    }
}

#[test]
fn a_direct_search_finds_ishigamis_least_percentile() {
    let sandbox = Sandbox::new();
    let optimise =
        "[doe]\ndesigns = 20\n\n[optimise]\nevaluations = 600\nstarts = 1\ndirect = true\n";
    let doe = ("[doe]\ndesigns = 150\n", optimise);
    let (file, exec) = ishigami(&sandbox, &[doe]);
    let run = ["run", &file, "--db", "i.db", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 0);
    let direct = verified(&sandbox, "direct");
    assert!((direct - LEAST).abs() < 0.2, "{direct}");
    // The program computes 30 samples of every design, and the response without noise.
    let status = sandbox.status("i.db").expect("the store is there");
    let optima = status["optima"].as_array().expect("a list");
    let names: Vec<_> = optima.iter().map(|o| o["approach"].as_str()).collect();
    assert!(names.contains(&Some("direct")), "{names:?}");
    let table = "export --db i.db --table evaluations --out -";
    let table: Vec<&str> = table.split(' ').collect();
    let table = sandbox.coordinator(&table);
    assert_code(&table, 0);
    let table = printed(&table);
    let of_direct = table.lines().filter(|line| line.starts_with("direct,0,"));
    assert_eq!(of_direct.count(), 600);
    let header = "approach,start,evaluation,x1,x2,x3,simulable,reason,y,samples,p90";
    assert!(table.starts_with(header), "{table:.200}");
}

#[test]
fn a_percentile_of_another_level_is_another_optimum_under_its_own_name() {
    let sandbox = Sandbox::new();
    let level = ("level = 0.9 ", "level = 0.99 ");
    let (file, exec) = ishigami(&sandbox, &[level, SHORT]);
    let run = [
        "run", &file, "--db", "i.db", "--out", "report", "--exec", &exec,
    ];
    assert_code(&sandbox.coordinator(&run), 0);
    // The noise has a standard deviation of 0.5, and z(0.99) is 2.3263.
    let least = -10.740_909 + 0.5 * 2.326_348;
    let baseline = percentile(&sandbox, "baseline", "p99");
    assert!((baseline - least).abs() < 0.3, "{baseline}");
    let html = std::fs::read_to_string(sandbox.path("report/report.html")).unwrap();
    assert!(html.contains("verified P99 of y"));
    assert!(!html.contains("P90"), "the report speaks of another level");
    for table in ["responses", "loo", "infill", "rounds"] {
        let rows = sandbox.coordinator(&["export", "--db", "i.db", "--table", table, "--out", "-"]);
        assert_code(&rows, 0);
        let rows = printed(&rows);
        let header = rows.lines().next().expect("a header");
        assert!(
            !header.contains("p90") && !header.contains("_um"),
            "{header}"
        );
    }
    // Another measure of the same samples, and no run of the optimiser whose inputs are as before.
    let held = sandbox.status("i.db").expect("the store is there");
    let text = std::fs::read_to_string(&file).unwrap();
    let text = changed(
        &text,
        &[("\"percentile\"", "\"superquantile\""), ("0.99", "0.9")],
    );
    std::fs::write(&file, text).unwrap();
    assert_code(&sandbox.coordinator(&run), 0);
    let status = sandbox.status("i.db").expect("the store is there");
    assert_eq!(status["samples"], held["samples"]);
    assert_eq!(status["measure"], "CVaR90");
    // φ(1.2816)/0.1 is 1.7550.
    let least = -10.740_909 + 0.5 * 1.754_983;
    let baseline = percentile(&sandbox, "baseline", "cvar90");
    assert!((baseline - least).abs() < 0.3, "{baseline}");
}

#[test]
fn names_that_the_program_does_not_know_are_refused_at_once() {
    let sandbox = Sandbox::new();
    let (file, exec) = ishigami(&sandbox, &[("name = \"x3\"", "name = \"x4\"")]);
    let run = ["run", &file, "--db", "i.db", "--exec", &exec];
    let refused = sandbox.coordinator(&run);
    assert_ne!(refused.status.code(), Some(0));
    let said = errors(&refused);
    assert!(said.contains("does not know \"x4\""), "{said}");
}

#[test]
fn an_enrichment_finds_the_optimum_of_the_percentile() {
    let sandbox = Sandbox::new();
    let section = "\n[enrichment]\ncriterion = \"expected-quantile-improvement\"\nsamples = 4000\n\
                   rounds = 100\npoints_per_round = 4\nsamples_per_point = 30\ntolerance = 0.05\n";
    let (file, exec) = ishigami(
        &sandbox,
        &[
            ("designs = 150", "designs = 60"),
            SHORT,
            ("[sampling]", &format!("{section}\n[sampling]")),
        ],
    );
    let run = ["run", &file, "--db", "i.db", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 0);
    let p90 = verified(&sandbox, "enriched-kriging");
    assert!((p90 - LEAST).abs() < 0.3, "{p90}");
}

/// Copies files of an example to the sandbox.
fn copy(sandbox: &Sandbox, folder: &str, names: &[&str]) {
    for name in names {
        let from = root().join("campaigns").join(folder).join(name);
        std::fs::copy(from, sandbox.path(name)).expect("the example is shipped");
    }
}

/// Runs a campaign in the sandbox whose program reads `template` and writes `result`.
fn through_files(
    sandbox: &Sandbox,
    campaign: &str,
    exec: &str,
    (template, result): (&str, &str),
) -> std::process::Output {
    let exec = ["--exec", exec, "--template", template, "--result", result];
    let rest = ["--db", "i.db", "--out", "report"];
    sandbox.coordinator(&[&["run", campaign], &exec[..], &rest].concat())
}

/// The command of the beam in the sandbox.
const BEAM: &str = "exec \"$OLDPWD\"/beam";

/// A sandbox with the compiled example of the cantilever beam and one of its campaigns.
fn beam(campaign: &str) -> Sandbox {
    let sandbox = Sandbox::new();
    copy(&sandbox, "cantilever", &[campaign, "beam.in"]);
    let compiled = std::process::Command::new("cc")
        .args(["-O2", "-o"])
        .args([
            sandbox.path("beam"),
            root().join("campaigns/cantilever/beam.c"),
        ])
        .arg("-lm")
        .status();
    assert!(compiled.expect("a C compiler").success());
    sandbox
}

#[test]
fn a_beam_is_designed_by_a_c_program_through_files() {
    let sandbox = beam("campaign.toml");
    sandbox.write(
        "wrong.in",
        "width {width}\nthickness {thicknes}\nseed {seed}\n",
    );
    let run = |template| through_files(&sandbox, "campaign.toml", BEAM, (template, "beam.out"));
    let said = errors(&run("wrong.in"));
    assert!(said.contains("wrong.in has no {thickness}"), "{said}");
    assert_code(&run("beam.in"), 0);
    // Over 400 000 draws the minimum of the 90th percentile is 1.778 in, at a width of 2.675 in and
    // an area of 9.5 in². Its standard error with 400 samples is 0.014 in.
    let p90 = verified(&sandbox, "kriging");
    assert!((p90 - 1.778).abs() < 0.06, "{p90}");
    let html = std::fs::read_to_string(sandbox.path("report/report.html")).unwrap();
    for part in ["displacement", "area = 9.", "in²"] {
        assert!(html.contains(part), "no {part} in the report");
    }
}

/// The column names of a table.
fn columns(sandbox: &Sandbox, table: &str) -> Vec<String> {
    let table = ["export", "--db", "i.db", "--table", table, "--out", "-"];
    let table = printed(&sandbox.coordinator(&table));
    let header = table.lines().next().expect("a header");
    header.split(',').map(str::to_owned).collect()
}

#[test]
fn an_enrichment_keeps_constraints_that_only_the_program_knows() {
    let sandbox = beam("campaign.toml");
    let text = std::fs::read_to_string(sandbox.path("campaign.toml")).expect("it is there");
    let text = text.replace("evaluations = 300", "evaluations = 20")
        + "\n[enrichment]\ncriterion = \"expected-quantile-improvement\"\nsamples = 3000\n\
           rounds = 6\npoints_per_round = 6\nsamples_per_point = 60\ntolerance = 0.002\n";
    let file = sandbox.write("enriched.toml", &text);
    let file = file.to_str().expect("UTF-8");
    let run = through_files(&sandbox, file, BEAM, ("beam.in", "beam.out"));
    assert_code(&run, 0);
    let of = |column: &str| percentile(&sandbox, "enriched-kriging", column);
    // The minimum is 1.778 in, where the whole area is used. With 60 samples per point its error is
    // 0.03 in.
    let (p90, area) = (of("p90"), of("area"));
    assert!((p90 - 1.778).abs() < 0.09, "{p90}");
    assert!((9.3..9.5).contains(&area), "{area}");
    // Every new point was evaluated once. Points that violate the limit have no samples.
    let export = |table| {
        let table = ["export", "--db", "i.db", "--table", table, "--out", "-"];
        let output = sandbox.coordinator(&table);
        assert_code(&output, 0);
        printed(&output)
    };
    let (infill, evaluations) = (export("infill"), export("evaluations"));
    let new = infill.lines().skip(1).filter(|row| !row.contains(",more,"));
    let evaluated = evaluations
        .lines()
        .filter(|row| row.starts_with("enriched-kriging,,"));
    assert_eq!(evaluated.count(), new.count(), "{infill}\n{evaluations}");
    // A name that is already a column's would make a table ambiguous.
    for table in ["designs", "optima", "infill", "evaluations"] {
        for column in columns(&sandbox, table) {
            if ["width", "thickness", "displacement", "area"].contains(&&*column) {
                continue;
            }
            let text = text.replace("name = \"area\"", &format!("name = \"{column}\""));
            let error = problem::Campaign::parse("c.toml", &text).expect_err(&column);
            assert!(error.to_string().contains("another name"), "{error}");
        }
    }
}

#[test]
fn the_beams_published_optimum_of_reliability_is_found() {
    let sandbox = beam("reliability.toml");
    let run = through_files(&sandbox, "reliability.toml", BEAM, ("beam.in", "beam.out"));
    assert_code(&run, 0);
    let of = |column: &str| percentile(&sandbox, "kriging", column);
    // The published area is 9.5202 in². Each limit is kept with a probability of 95 % by the models of 2000 samples,
    // which costs some area.
    let area = of("expected");
    assert!((9.50..9.75).contains(&area), "{area}");
    // Both fail in 0.135 % at the published optimum.
    for (constraint, most) in [("yield", 0.00135), ("deflection", 0.00135)] {
        let value = of(constraint);
        assert!(value <= most, "{constraint}: {value}");
        let confidence = of(&format!("{constraint}_confidence"));
        assert!(
            (0.5..=1.0).contains(&confidence),
            "{constraint}: {confidence}"
        );
    }
}

#[test]
fn the_columns_published_optimum_is_found_with_a_limited_probability_of_failure() {
    let sandbox = Sandbox::new();
    copy(&sandbox, "column", &["campaign.toml", "column.py"]);
    // The campaign names its program.
    let run = ["run", "campaign.toml", "--db", "i.db", "--out", "report"];
    let said = sandbox.coordinator(&run);
    assert_code(&said, 0);
    let statement = "P(lack_of_strength > 0) ≤ 0.00621";
    assert!(String::from_utf8_lossy(&said.stdout).contains(statement));
    let html = std::fs::read_to_string(sandbox.path("report/report.html")).unwrap();
    for part in ["failure: P(lack_of_strength", "holds, confidence"] {
        assert!(html.contains(part), "no {part} in the report");
    }
    let of = |column: &str| percentile(&sandbox, "kriging", column);
    // The published optimum: b = 8.668, h = 25.0, b h = 216.7. The area at which the models are sure is larger.
    let area = of("b") * of("h");
    assert!((area - of("expected")).abs() < 1e-3 * area);
    assert!((216.7..1.04 * 216.7).contains(&area), "{area}");
    assert!(of("failure") < 0.00621 && of("failure_high") < 0.00621);
    assert!(of("failure_confidence") > 0.99);
}

/// Runs a shipped campaign that names its program, and returns its status.
fn run_shipped(sandbox: &Sandbox, folder: &str, program: &str) -> serde_json::Value {
    copy(sandbox, folder, &["campaign.toml", program]);
    let run = ["run", "campaign.toml", "--db", "i.db", "--out", "report"];
    assert_code(&sandbox.coordinator(&run), 0);
    sandbox.status("i.db").expect("the store is there")
}

/// The least percentile by long searches on 100 000 cases is 0.710.
#[test]
fn a_welded_beam_is_kept_away_from_four_limits() {
    let sandbox = Sandbox::new();
    run_shipped(&sandbox, "welded-beam", "welded_beam.py");
    let p90 = verified(&sandbox, "enriched-kriging");
    assert!((0.70..0.80).contains(&p90), "{p90}");
    assert!(percentile(&sandbox, "enriched-kriging", "cost") <= 3.0);
}

/// Eleven limits that each hold in 99.865 % of all cases, and a whole number of teeth. The published optimum is 3038.6
/// cm³.
#[test]
fn the_smallest_speed_reducer_has_whole_teeth_and_keeps_eleven_limits() {
    let sandbox = Sandbox::new();
    let status = run_shipped(&sandbox, "speed-reducer", "speed_reducer.py");
    let of = |column: &str| percentile(&sandbox, "enriched-kriging", column);
    assert_eq!(of("teeth"), 17.0);
    let volume = of("expected");
    assert!((3030.0..1.03 * 3038.6).contains(&volume), "{volume}");
    let limits = status["optima"][0]["limits"].as_array().expect("a list");
    assert_eq!(limits.len(), 11);
    assert!(
        limits.iter().all(|limit| limit["holds"] == true),
        "{limits:?}"
    );
}

/// Ten constraints that each hold in 90 % of all cases, two materials, and the optimum by other means: 24.36 kg.
#[test]
fn the_lightest_car_that_survives_a_side_impact() {
    let sandbox = Sandbox::new();
    let status = run_shipped(&sandbox, "side-impact", "side_impact.py");
    let of = |column: &str| percentile(&sandbox, "enriched-kriging", column);
    let weight = of("expected");
    assert!((24.3..1.04 * 24.36).contains(&weight), "{weight}");
    assert_eq!(
        [of("x8"), of("x9")].map(|x| x == 0.192 || x == 0.345),
        [true; 2]
    );
    for optimum in status["optima"].as_array().expect("a list") {
        let limits = optimum["limits"].as_array().expect("a list");
        assert_eq!(limits.len(), 10, "{optimum}");
        for limit in limits {
            assert_eq!(limit["holds"], true, "{limit}");
            let confidence = limit["confidence"].as_f64().expect("enough samples");
            assert!((0.5..1.0).contains(&confidence), "{limit}");
        }
    }
}
