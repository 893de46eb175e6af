//! `fit` and `predict` with tables as other programs write them.

use std::path::PathBuf;

use acceptance::{Sandbox, assert_code, errors, printed, root};
use serde_json::Value;

/// A file of `tests/acceptance/cases`.
pub(crate) fn case(name: &str) -> PathBuf {
    root().join("tests/acceptance/cases").join(name)
}

/// Fits a case's file with `arguments`, and returns the summary.
fn fitted(sandbox: &Sandbox, name: &str, arguments: &[&str]) -> Value {
    let file = case(name);
    let all = [&["fit", file.to_str().unwrap(), "--json"], arguments].concat();
    let output = sandbox.coordinator(&all);
    assert_code(&output, 0);
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

fn names(of: &Value) -> Vec<&str> {
    let inputs = of.as_array().unwrap().iter();
    inputs
        .map(|input| input["name"].as_str().unwrap())
        .collect()
}

#[test]
fn tables_of_other_programs_are_read() {
    let sandbox = Sandbox::new();
    for (file, response, inputs, format) in [
        ("comments.csv", "y", &["x"][..], "1 comment line"),
        ("semicolon.csv", "y", &["x"], "semicolons between fields"),
        ("excel_de.csv", "y", &["x"], "decimal commas"),
        (
            "dakota.dat",
            "response_fn_1",
            &["x1", "x2"],
            "blanks between fields",
        ),
    ] {
        let name = format!("csv-dialects/{file}");
        let found = fitted(&sandbox, &name, &["--response", response]);
        assert_eq!(names(&found["inputs"]), inputs, "{found}");
        assert_eq!(found["observations"], 20, "{found}");
        assert!(found["format"].to_string().contains(format), "{found}");
        // All hold sin 5x, without noise.
        assert!(
            found["leave_one_out"]["q2"].as_f64().unwrap() > 0.99,
            "{found}"
        );
    }
    let file = case("csv-dialects/noheader.csv");
    let output = sandbox.coordinator(&["fit", file.to_str().unwrap(), "--response", "y"]);
    assert_code(&output, 3);
    for part in ["noheader.csv, line 1", "has numbers", "header line"] {
        assert!(errors(&output).contains(part), "{}", errors(&output));
    }
}

#[test]
fn columns_that_are_not_used_say_why() {
    let sandbox = Sandbox::new();
    let index = fitted(
        &sandbox,
        "default-exports/pandas-to_csv.csv",
        &["--response", "y"],
    );
    assert_eq!(names(&index["inputs"]), ["x"], "{index}");
    assert_eq!(index["unused"][0]["column"], "column 1", "{index}");
    assert!(
        index["unused"][0]["reason"]
            .as_str()
            .unwrap()
            .contains("no name"),
        "{index}"
    );

    // The column a has exponents such as D-01, and y hardly depends on b.
    let fortran = fitted(
        &sandbox,
        "nonnumeric-dropped/fortran2.csv",
        &["--response", "y"],
    );
    assert_eq!(names(&fortran["inputs"]), ["a", "b"], "{fortran}");
    assert!(
        fortran["leave_one_out"]["q2"].as_f64().unwrap() > 0.99,
        "{fortran}"
    );

    sandbox.write(
        "t.csv",
        "date,c,x,y\n2024-01-01,7,1,2\n2024-01-02,7,2,3\n2024-01-03,7,4,3\n",
    );
    let output = sandbox.coordinator(&["fit", "t.csv", "--response", "y"]);
    assert_code(&output, 0);
    for part in [
        "date: text, such as \"2024-01-01\" in line 2",
        "c: constant, 7 in all rows",
    ] {
        assert!(
            printed(&output).contains(part),
            "no {part:?} in {}",
            printed(&output)
        );
    }
}

#[test]
fn lost_decimal_points_are_warned_of() {
    let sandbox = Sandbox::new();
    let found = fitted(
        &sandbox,
        "input-outlier/lost_point.csv",
        &["--response", "y"],
    );
    let warning = found["warnings"][0].as_str().unwrap();
    assert!(
        warning.starts_with("lines 9 and 33 lie 1e14 times beyond the rest of column \"k\""),
        "{warning}"
    );
}

#[test]
fn rows_without_a_value_are_left_out_only_where_that_is_asked_for() {
    let sandbox = Sandbox::new();
    let mut text = String::from("x,unused,y\n");
    for i in 0..20 {
        let x = f64::from(i) / 10.0;
        let y = match i {
            3 => "NA".to_owned(),
            7 => String::new(),
            _ => (5.0 * x).sin().to_string(),
        };
        text += &format!("{x},,{y}\n");
    }
    sandbox.write("t.csv", &text);
    let fit = ["fit", "t.csv", "--response", "y", "--out", "m.json"];
    let refused = sandbox.coordinator(&fit);
    assert_code(&refused, 3);
    for part in ["line 5", "column \"y\"", "\"NA\"", "--skip-missing"] {
        assert!(errors(&refused).contains(part), "{}", errors(&refused));
    }
    let output = sandbox.coordinator(&[&fit[..], &["--skip-missing"]].concat());
    assert_code(&output, 0);
    for part in [
        "18 at 18 points",
        "2 rows without a value in y: line 5, 9",
        "unused: it has no values",
    ] {
        assert!(
            printed(&output).contains(part),
            "no {part:?} in {}",
            printed(&output)
        );
    }

    sandbox.write("at.csv", "x\n0.5\nnan\n0.7\n");
    let predict = ["predict", "--model", "m.json", "--at", "at.csv"];
    let refused = sandbox.coordinator(&predict);
    assert_code(&refused, 3);
    assert!(errors(&refused).contains("line 3"), "{}", errors(&refused));
    let skipping = [&predict[..], &["--skip-missing"]].concat();
    let output = sandbox.run_with("coordinator", &skipping, &[("PITCHLINE_LOG", "warn")]);
    assert_code(&output, 0);
    assert_eq!(printed(&output).lines().count(), 3, "{}", printed(&output));
    assert!(errors(&output).contains("lines=[3]"), "{}", errors(&output));
    let output = sandbox.coordinator(&[&skipping[..], &["--json"]].concat());
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["skipped"][0]["lines"][0], 3, "{found}");
}

/// Twenty points of white noise, five replicates each: nothing can be predicted. The figures are those of numpy with
/// each point left out by hand, at the parameters of the fit.
#[test]
fn replicates_are_left_out_together() {
    let sandbox = Sandbox::new();
    let found = fitted(
        &sandbox,
        "replicates-loo/repl_noise.csv",
        &["--response", "y"],
    );
    assert_eq!(
        (&found["observations"], &found["points"]),
        (&100.into(), &20.into())
    );
    let number = |key: &str| found["leave_one_out"][key].as_f64().unwrap();
    assert!((number("q2") + 0.21).abs() < 0.02, "{found}");
    assert!((number("rmse") - 1.158).abs() < 0.02, "{found}");
    let file = case("replicates-loo/repl_noise.csv");
    let output = sandbox.coordinator(&["fit", file.to_str().unwrap(), "--response", "y"]);
    assert!(
        printed(&output).contains("100 at 20 points"),
        "{}",
        printed(&output)
    );

    // The same with replicates that are set again, not quite to the same place.
    let text = std::fs::read_to_string(&file).unwrap();
    let mut lines = text.lines().enumerate();
    let mut near = format!("{}\n", lines.next().unwrap().1);
    for (i, line) in lines {
        let (x, y) = line.split_once(',').unwrap();
        let x = x.parse::<f64>().unwrap() + 1e-8 * (i % 5) as f64;
        near += &format!("{x},{y}\n");
    }
    sandbox.write("near.csv", &near);
    let output = sandbox.coordinator(&["fit", "near.csv", "--response", "y", "--json"]);
    assert_code(&output, 0);
    let near: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(near["points"], 20, "{near}");
    // The fitted range is shorter here, so a point is predicted by the mean of all others: 1 − (20/19)².
    let q2 = near["leave_one_out"]["q2"].as_f64().unwrap();
    assert!((q2 + 0.108).abs() < 0.01, "{near}");
}

/// 12 000 rows with unknown noise of standard deviation 0.01: the intervals of new observations have their stated
/// coverage, and a signal ends the fit at once.
#[test]
fn many_rows_with_unknown_noise_are_fitted() {
    let sandbox = Sandbox::new();
    let mut state = 1_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut row = || {
        let (a, b) = (uniform(), uniform());
        // The sum of twelve uniform numbers is nearly normal, with variance 1.
        let scatter = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let y = (5.0 * a).sin() * (3.0 * b).cos() + 0.01 * scatter;
        (a, b, y)
    };
    let mut table = |rows: usize| -> (String, Vec<f64>) {
        let rows: Vec<(f64, f64, f64)> = (0..rows).map(|_| row()).collect();
        let lines = rows.iter().map(|(a, b, y)| format!("{a},{b},{y}\n"));
        (
            "x1,x2,y\n".to_owned() + &lines.collect::<String>(),
            rows.iter().map(|r| r.2).collect(),
        )
    };
    sandbox.write("n12k.csv", &table(12_000).0);
    let (new, values) = table(1000);
    sandbox.write("new.csv", &new);
    let fit = ["fit", "n12k.csv", "--response", "y", "--out", "m.json"];

    // This fit takes a minute.
    sandbox.write("n100k.csv", &table(100_000).0);
    let mut running = sandbox.start_with(
        "coordinator",
        &["fit", "n100k.csv", "--response", "y", "--out", "m.json"],
        &[("PITCHLINE_LOG", "debug")],
    );
    running.wait_for_line("fitting a model to 100000 rows");
    running.signal("INT");
    let (status, _) = running.finish();
    assert_eq!(status.code(), Some(14));
    assert!(!sandbox.path("m.json").exists());

    let output = sandbox.coordinator(&[&fit[..], &["--json"]].concat());
    assert_code(&output, 0);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["is_approximate"], true, "{found}");
    let nugget = found["nugget_variance"].as_f64().unwrap();
    assert!((0.8e-4..1.2e-4).contains(&nugget), "{found}");
    let output =
        sandbox.coordinator(&["predict", "--model", "m.json", "--at", "new.csv", "--json"]);
    assert_code(&output, 0);
    let predicted: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = predicted["rows"].as_array().unwrap().iter();
    let covered = rows.zip(&values).filter(|(row, y)| {
        let end = |i: usize| row["observation_interval"][i].as_f64().unwrap();
        end(0) <= **y && **y <= end(1)
    });
    // 1000 observations of a right model have a coverage of 0.95 with a standard deviation of 0.007.
    let covered = covered.count();
    assert!((925..=975).contains(&covered), "{covered}");
}

/// A fit of thousands of points takes seconds to minutes.
#[test]
fn a_long_fit_says_how_far_it_is() {
    let sandbox = Sandbox::new();
    let rows = (0..3000).map(|i| {
        // A sequence that fills the square evenly, and a noise without pattern.
        let [a, b] = [2.0_f64, 3.0].map(|of| (f64::from(i) * of.sqrt()).fract());
        let noise = 0.1 * (1e4 * (a + 7.0 * b)).sin();
        format!("{a},{b},{}\n", (5.0 * a).sin() + b + noise)
    });
    sandbox.write("t.csv", &format!("a,b,y\n{}", rows.collect::<String>()));
    let fit = ["fit", "t.csv", "--response", "y", "--method"];
    for (method, step) in [
        (
            "exact",
            "searching the parameters points=3000 likelihoods=2",
        ),
        ("vecchia", "leaving out each point in turn points=3000"),
    ] {
        let log = [("PITCHLINE_LOG", "info"), ("NO_COLOR", "1")];
        let output = sandbox.run_with("coordinator", &[&fit[..], &[method]].concat(), &log);
        assert_code(&output, 0);
        assert!(errors(&output).contains(step), "{}", errors(&output));
    }
}
