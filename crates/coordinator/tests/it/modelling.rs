//! `fit`, `predict` and `export`: models of a user's own table, and results for programs.

use std::path::PathBuf;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// A folder in which the program runs.
struct Sandbox(TempDir);

impl Sandbox {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    fn coordinator(&self, arguments: &[&str]) -> Output {
        self.coordinator_logging("off", arguments)
    }

    fn coordinator_logging(&self, level: &str, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_coordinator"))
            .args(arguments)
            .current_dir(self.0.path())
            .env("XDG_STATE_HOME", self.0.path())
            .env("PITCHLINE_LOG", level)
            .output()
            .expect("the program starts")
    }
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn printed(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn assert_code(output: &Output, code: i32) {
    assert_eq!(output.status.code(), Some(code), "{}", errors(output));
}

/// The paper's campaign with `designs` designs and short searches.
fn small_campaign(designs: u32) -> String {
    let mut text = problem::Campaign::PAPER.to_owned();
    for (from, to) in [
        ("designs = 3000", format!("designs = {designs}")),
        ("evaluations = 12000", "evaluations = 100".to_owned()),
        ("restart_at = 6000", "restart_at = 50".to_owned()),
        ("starts = 3", "starts = 1".to_owned()),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, &to, 1);
    }
    text
}

/// The function of the table below.
fn truth(a: f64, b: f64) -> f64 {
    5.0 + (3.0 * a).sin() + 2.0 * a * b - b * b
}

/// A table of the function above at 120 points, with scatter of standard deviation 0.05.
fn table() -> String {
    let mut text = String::from("run,a_mm,b,variance,y_um\n");
    let mut state = 1_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    for i in 0..120_u32 {
        let a = (f64::from(i) * 0.754_877_666_2).fract() * 4.0 - 2.0;
        let b = (f64::from(i) * 0.569_840_291_0).fract();
        // The sum of twelve uniform numbers is nearly normal, with variance 1.
        let scatter = 0.05 * (0..12).map(|_| uniform()).sum::<f64>();
        let y = truth(a, b) + scatter;
        text += &format!("r{i},{a},{b},0.0025,{y}\n");
    }
    text
}

fn json(output: &Output) -> Value {
    assert_code(output, 0);
    let value: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!(value["schema_version"], 1);
    value
}

#[test]
fn a_table_of_the_users_own_is_fitted_and_predicted_back() {
    let sandbox = Sandbox::new();
    sandbox.write("data.csv", &table());
    let fit = ["fit", "data.csv", "--response", "y_um"];
    let page = sandbox.coordinator(&fit);
    assert_code(&page, 0);
    for part in [
        "inputs",
        "a_mm",
        "estimated, since no variances are known",
        "not used",
        "run",
    ] {
        assert!(
            printed(&page).contains(part),
            "no {part:?} in\n{}",
            printed(&page)
        );
    }

    let known = [
        "--variance",
        "variance",
        "--inputs",
        "a_mm,b",
        "--out",
        "m.json",
    ];
    let found = json(&sandbox.coordinator(&[&fit[..], &known, &["--json"]].concat()));
    assert_eq!(found["nugget_is_estimated"], false);
    assert_eq!(found["inputs"][0]["unit"], "mm");
    assert!(
        found["leave_one_out"]["q2"].as_f64().unwrap() > 0.98,
        "{found}"
    );
    let coverage = found["leave_one_out"]["coverage95"].as_f64().unwrap();
    assert!((0.88..=1.0).contains(&coverage), "{found}");
    let line = found["leave_one_out"]["largest"]["line"].as_u64().unwrap();
    assert!((2..=121).contains(&line), "{found}");

    // Columns in another order, one that is not an input, and a point outside the table's range.
    let mut points = String::from("b,note,a_mm\n");
    let at: Vec<(f64, f64)> = (0..40)
        .map(f64::from)
        .map(|i| (i / 11.0 - 1.8, i / 41.0))
        .collect();
    for (a, b) in &at {
        points += &format!("{b},n,{a}\n");
    }
    sandbox.write("at.csv", &(points + "0.5,n,9\n"));
    let predict = ["predict", "--model", "m.json", "--at", "at.csv"];
    let found =
        json(&sandbox.coordinator(&[&predict[..], &["--level", "0.975", "--json"]].concat()));
    let rows = found["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 41);
    let mut within = 0;
    for (row, (a, b)) in rows.iter().zip(&at) {
        let number = |name: &str| row[name].as_f64().unwrap();
        let (mean, truth) = (number("mean"), truth(*a, *b));
        assert!((mean - truth).abs() < 0.15, "{row}: {truth}");
        let half = number("quantile") - mean;
        assert!(
            (half / number("standard_error") - 1.96).abs() < 0.01,
            "{row}"
        );
        within += usize::from((mean - truth).abs() <= half);
        assert_eq!(row["extrapolates"], false);
    }
    // 38 of 40 are expected to be covered; neighbouring points miss together.
    assert!(within >= 32, "{within}");
    assert_eq!(rows[40]["extrapolates"], true);

    let output = sandbox.coordinator(&[&predict[..], &["--out", "p.csv"]].concat());
    assert_code(&output, 0);
    let text = std::fs::read_to_string(sandbox.path("p.csv")).unwrap();
    let header = "a_mm,b,mean,standard_error,quantile,mean_low,mean_high,observation_low,observation_high,\
                  extrapolates";
    assert_eq!(
        (text.lines().next(), text.lines().count()),
        (Some(header), 42)
    );
    assert!(text.ends_with(",1\n"), "{text}");
    assert_eq!(
        printed(&sandbox.coordinator(&predict)),
        text,
        "standard output by default"
    );
}

#[test]
fn bad_tables_and_models_are_refused_by_file_line_and_column() {
    let sandbox = Sandbox::new();
    let good = table();
    sandbox.write("data.csv", &good);
    let line_of =
        |text: &str, from: &str| 1 + text[..text.find(from).unwrap()].matches('\n').count();
    let bad = good.replace("r41,", "r41,x");
    sandbox.write("bad.csv", &bad);
    let place = format!("bad.csv, line {}, column \"a_mm\"", line_of(&bad, "r41,"));
    sandbox.write("kept.json", "kept");
    sandbox.write("at.csv", "a_mm,B\n1,2\n");
    let refused = |arguments: &[&str], code: i32, parts: &[&str]| {
        let output = sandbox.coordinator(arguments);
        assert_code(&output, code);
        for part in parts {
            assert!(
                errors(&output).contains(part),
                "no {part:?} in {}",
                errors(&output)
            );
        }
    };
    let fit = |file: &'static str| ["fit", file, "--response", "y_um"];
    refused(&fit("bad.csv"), 3, &[&place, "is not a finite number"]);
    refused(&fit("none.csv"), 4, &["none.csv"]);
    refused(
        &["fit", "data.csv", "--response", "z"],
        3,
        &["no column \"z\"", "a_mm, b"],
    );
    refused(
        &[&fit("data.csv")[..], &["--inputs", "run"]].concat(),
        3,
        &["line 2, column \"run\": \"r0\""],
    );
    refused(
        &[&fit("data.csv")[..], &["--trend", "cubic"]].concat(),
        2,
        &["`linear`"],
    );
    refused(
        &[&fit("data.csv")[..], &["--out", "kept.json"]].concat(),
        4,
        &["kept.json", "it exists"],
    );
    let predict = |model: &'static str| ["predict", "--model", model, "--at", "at.csv"];
    refused(&predict("kept.json"), 3, &["kept.json", "not a model file"]);
    refused(&["predict", "--at", "at.csv"], 2, &["--model", "--db"]);
    let out = [&fit("data.csv")[..], &["--out", "m.json"]].concat();
    assert_code(&sandbox.coordinator(&out), 0);
    // A variance that is the same in all rows is not an input.
    refused(
        &predict("m.json"),
        3,
        &["no column b, but", "are a_mm, b;", "other columns are B"],
    );
    assert_eq!(std::fs::read(sandbox.path("kept.json")).unwrap(), b"kept");
}

#[test]
fn a_campaigns_results_are_for_programs_and_overwrite_nothing() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("small.toml", &small_campaign(60));
    let file = file.to_str().unwrap();
    let plan = json(&sandbox.coordinator(&["check", file, "--json"]));
    assert_eq!(plan["stages"][0]["stage"], "doe");
    let run = ["run", file, "--db", "c.db", "--out", "report"];
    assert_code(&sandbox.coordinator(&run), 0);

    let export = |table: &str, more: &[&str]| {
        let arguments = ["export", "--db", "c.db", "--table", table, "--out"];
        sandbox.coordinator(&[&arguments[..], more].concat())
    };
    for table in [
        "designs",
        "samples",
        "responses",
        "loo",
        "optima",
        "rounds",
        "infill",
        "failures",
        "blocks",
    ] {
        let text = printed(&export(table, &["-"]));
        let rows = json(&export(table, &["-", "--format", "json"]));
        assert_eq!(rows["table"], table);
        assert_eq!(
            rows["rows"].as_array().unwrap().len(),
            text.lines().count() - 1
        );
        let columns: Vec<&str> = rows["columns"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(Value::as_str)
            .collect();
        assert_eq!(text.lines().next().unwrap(), columns.join(","));
        #[cfg(feature = "parquet")]
        {
            let file = format!("{table}.parquet");
            assert_code(&export(table, &[&file, "--format", "parquet"]), 0);
            let printed = export(table, &["-", "--format", "parquet"]);
            assert_eq!(printed.stdout, std::fs::read(sandbox.path(&file)).unwrap());
            let rows = parquet_rows(&sandbox.path(&file), &columns);
            assert_eq!(rows, text.lines().count() - 1, "{table}");
        }
    }
    let model = json(&export("model", &["-"]));
    assert_eq!(model["inputs"][0]["name"], "x_p");
    assert_code(&export("model", &["m.json"]), 0);
    assert_code(&export("model", &["m.json"]), 4);

    // The designs themselves are points of the model.
    assert_code(&export("designs", &["designs.csv"]), 0);
    let of = |source: [&str; 2]| {
        let at = ["predict", source[0], source[1], "--at", "designs.csv"];
        let output = sandbox.coordinator(&at);
        assert_code(&output, 0);
        printed(&output)
    };
    let predicted = of(["--db", "c.db"]);
    assert_eq!(predicted.lines().count(), 61);
    assert_eq!(predicted, of(["--model", "m.json"]));

    let pareto = ["pareto", file, "--db", "c.db", "--out", "front", "--json"];
    let front = json(&sandbox.coordinator(&pareto));
    assert!(front["tables"]["pareto"][0]["p90_um"].is_f64(), "{front}");
    let written = std::fs::read(sandbox.path("front/pareto.csv")).unwrap();
    let again = sandbox.coordinator(&pareto);
    assert_code(&again, 4);
    assert!(
        errors(&again).contains("front: it is not empty"),
        "{}",
        errors(&again)
    );
    assert_eq!(
        std::fs::read(sandbox.path("front/pareto.csv")).unwrap(),
        written
    );

    // The same campaign replaces its report; another campaign does not.
    assert_code(&sandbox.coordinator(&run), 0);
    let report = std::fs::read(sandbox.path("report/report.html")).unwrap();
    let text = small_campaign(60);
    let changed = text.replacen("seed = 2009", "seed = 2010", 1);
    assert_ne!(changed, text);
    let other = sandbox.write("other.toml", &changed);
    let other = other.to_str().unwrap();
    for command in [
        &["run", other, "--db", "d.db", "--out", "report"][..],
        &[
            "serve",
            other,
            "--db",
            "d.db",
            "--out",
            "report",
            "--listen",
            "127.0.0.1:0",
        ],
        &["run", other, "--db", "d.db", "--out", "small.toml"],
    ] {
        let output = sandbox.coordinator(command);
        assert_code(&output, 4);
        assert!(errors(&output).contains("--out"), "{}", errors(&output));
        assert!(
            !sandbox.path("d.db").exists(),
            "a refused campaign left a store"
        );
    }
    assert_eq!(
        std::fs::read(sandbox.path("report/report.html")).unwrap(),
        report
    );
}

#[test]
fn a_log_level_that_there_is_not_is_refused() {
    let sandbox = Sandbox::new();
    let output = sandbox.coordinator_logging("nonsense", &["init", "new.toml"]);
    assert_code(&output, 2);
    let said = errors(&output);
    assert!(
        said.contains("\"nonsense\"") && said.contains("debug or trace"),
        "{said}"
    );
    assert!(!sandbox.path("new.toml").exists());
}

/// Returns the number of rows of a Parquet file and checks that its columns are `columns`.
#[cfg(feature = "parquet")]
fn parquet_rows(path: &std::path::Path, columns: &[&str]) -> usize {
    use parquet::file::reader::{FileReader as _, SerializedFileReader};

    let file = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    let schema = file.metadata().file_metadata().schema_descr();
    let names: Vec<&str> = schema
        .columns()
        .iter()
        .map(|column| column.name())
        .collect();
    assert_eq!(names, columns);
    file.get_row_iter(None).unwrap().map(Result::unwrap).count()
}
