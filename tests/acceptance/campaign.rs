//! `coordinator run`: a campaign from an empty folder to its report.

use acceptance::{Sandbox, assert_code, printed};

pub(crate) fn digest(sandbox: &Sandbox, db: &str) -> String {
    let status = sandbox.status(db).expect("the store is there");
    assert_eq!(status["finished"], true, "{status}");
    status["samples_digest"]
        .as_str()
        .expect("a digest")
        .to_owned()
}

pub(crate) fn export(sandbox: &Sandbox, db: &str, table: &str) -> Vec<Vec<String>> {
    let out = format!("{table}-{db}.csv");
    // Export does not overwrite files.
    let _ = std::fs::remove_file(sandbox.path(&out));
    assert_code(
        &sandbox.coordinator(&["export", "--db", db, "--table", table, "--out", &out]),
        0,
    );
    let text = std::fs::read_to_string(sandbox.path(&out)).unwrap();
    // Numeric columns have no quoted fields. Reasons may be quoted, and are one column each.
    let mut rows = Vec::new();
    for line in text.lines() {
        let mut fields = vec![String::new()];
        let mut quoted = false;
        for c in line.chars() {
            match c {
                '"' => quoted = !quoted,
                ',' if !quoted => fields.push(String::new()),
                c => fields.last_mut().unwrap().push(c),
            }
        }
        rows.push(fields);
    }
    rows
}

#[test]
fn the_number_of_workers_changes_nothing_in_the_results() {
    let sandbox = Sandbox::new();
    let file = sandbox.campaign("quick.toml", &[]);
    let file = file.to_str().unwrap();
    for (workers, db) in [("1", "one.db"), ("3", "three.db")] {
        let out = format!("{workers}-report");
        let output =
            sandbox.coordinator(&["run", file, "--db", db, "--workers", workers, "--out", &out]);
        assert_code(&output, 0);
        assert!(
            printed(&output).contains("report.html"),
            "{}",
            printed(&output)
        );
    }
    assert_eq!(digest(&sandbox, "one.db"), digest(&sandbox, "three.db"));
    for table in ["designs", "samples", "responses"] {
        assert_eq!(
            export(&sandbox, "one.db", table),
            export(&sandbox, "three.db", table)
        );
    }

    // The optima agree, too, except for the measured CPU time in the last column.
    let strip = |rows: Vec<Vec<String>>| -> Vec<Vec<String>> {
        rows.into_iter()
            .map(|row| row[..row.len() - 1].to_vec())
            .collect()
    };
    let optima = strip(export(&sandbox, "one.db", "optima"));
    assert_eq!(optima, strip(export(&sandbox, "three.db", "optima")));
    tables_are_complete(&export(&sandbox, "three.db", "designs"));
    optima_are_feasible(&optima);
    report_is_self_contained(&sandbox);

    // A finished campaign that is started again has no work and changes nothing.
    let before = digest(&sandbox, "one.db");
    assert_code(&sandbox.coordinator(&["run", file, "--db", "one.db"]), 0);
    assert_eq!(digest(&sandbox, "one.db"), before);
}

fn tables_are_complete(designs: &[Vec<String>]) {
    assert_eq!(
        designs[0].join(","),
        "design,x_p,x_r,ha0_p,ha0_r,hf0_p,hf0_r,simulable,feasible,samples,reason,contact_ratio,\
         specific_sliding,hertz_pressure_mpa,hertz_pressure_worn_mpa,root_stress_mpa,clearance_p_mm,clearance_r_mm,\
         flank_margin_p_mm,flank_margin_r_mm,delta_ste_um,delta_ste_archard_um"
    );
    assert_eq!(designs.len(), 151);
    let count = |column: usize| designs[1..].iter().filter(|row| row[column] == "1").count();
    let (simulable, feasible) = (count(7), count(8));
    assert!((90..150).contains(&simulable), "{simulable} are simulable");
    assert!(
        (1..simulable).contains(&feasible),
        "{feasible} are feasible"
    );
    for row in &designs[1..] {
        let numbers = row[11..]
            .iter()
            .filter(|field| field.parse::<f64>().is_ok())
            .count();
        // A refused design has a reason, and no numbers and no samples.
        assert_eq!(numbers, if row[7] == "1" { 11 } else { 0 }, "{row:?}");
        assert_eq!(row[9] == "0", row[7] == "0", "{row:?}");
        assert_eq!(row[10].is_empty(), row[7] == "1", "{row:?}");
    }
}

fn optima_are_feasible(optima: &[Vec<String>]) {
    let column = |name: &str| optima[0].iter().position(|field| field == name).unwrap();
    assert_eq!(optima.len(), 5, "four approaches");
    for row in &optima[1..] {
        let value = |name: &str| row[column(name)].parse::<f64>().unwrap();
        assert_eq!(row[column("feasible")], "1", "{row:?}");
        assert!(value("contact_ratio") > 1.25, "{row:?}");
        assert!(value("specific_sliding") < 2.0, "{row:?}");
        assert!(value("root_stress_mpa") < 980.0, "{row:?}");
        assert!(value("hertz_pressure_mpa") < 1550.0, "{row:?}");
        let (low, p90, high) = (value("p90_low_um"), value("p90_um"), value("p90_high_um"));
        assert!(low < p90 && p90 < high, "{row:?}");
        let difference = value("p90_grid_difference_um");
        assert!(
            difference != 0.0 && difference.abs() < 0.02 * p90,
            "{row:?}"
        );
    }
}

fn report_is_self_contained(sandbox: &Sandbox) {
    let html = std::fs::read_to_string(sandbox.path("1-report/report.html")).unwrap();
    for part in [
        "Table 1", "Table 2", "Table 3", "Table 4", "Table 5", "Figure 2", "Figure 4", "Figure 5",
        "<svg",
    ] {
        assert!(html.contains(part), "the report has no {part}");
    }
    assert!(
        !html.contains("<script") && !html.contains("src="),
        "the report loads something"
    );
}
