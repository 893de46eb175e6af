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
    let output = sandbox.coordinator(&[&predict[..], &["--skip-missing"]].concat());
    assert_code(&output, 0);
    assert_eq!(printed(&output).lines().count(), 3, "{}", printed(&output));
    assert!(errors(&output).contains('3'), "{}", errors(&output));
}
