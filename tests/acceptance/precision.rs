//! Campaigns that sample to a precision and leave out what their constraints rule out.

use std::collections::BTreeMap;

use acceptance::{Sandbox, assert_code, small_campaign};

use crate::campaign::{digest, export};

/// Large enough a precision asked for that it takes a moment, and can be killed on the way.
fn campaign() -> String {
    small_campaign(100, 200).replace(
        "samples_per_design = 200 ",
        "precision_um = 0.01\nsamples_max = 3000\nskip_violation = 2.0\npercentile = \"chosen\"\n\
         samples_per_design = 200 ",
    )
}

#[test]
fn killed_and_resumed_it_ends_as_if_nothing_had_been() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("precise.toml", &campaign());
    let file = file.to_str().unwrap();
    let whole = ["run", file, "--db", "whole.db", "--workers", "2"];
    assert_code(&sandbox.coordinator(&whole), 0);
    let all = sandbox.status("whole.db").unwrap();
    let all = all["samples"]["done"].as_u64().unwrap();

    let killed = sandbox.start("coordinator", &["run", file, "--db", "killed.db"]);
    // Beyond the first batches of all designs: some have got more than others by then.
    sandbox.wait_for("killed.db", "a good part of the samples", |status| {
        status["samples"]["done"].as_u64() > Some(all / 3)
    });
    killed.kill();
    let resumed = ["run", file, "--db", "killed.db", "--workers", "1"];
    assert_code(&sandbox.coordinator(&resumed), 0);
    assert_eq!(digest(&sandbox, "whole.db"), digest(&sandbox, "killed.db"));
    for table in ["designs", "samples", "responses"] {
        let (whole, resumed) = (
            export(&sandbox, "whole.db", table),
            export(&sandbox, "killed.db", table),
        );
        assert!(whole == resumed, "{table} differ");
    }
    every_design_has_what_it_needs(&sandbox);
}

fn every_design_has_what_it_needs(sandbox: &Sandbox) {
    let designs = export(sandbox, "whole.db", "designs");
    let column = |rows: &[Vec<String>], name: &str| {
        let found = rows[0].iter().position(|field| field == name);
        found.unwrap_or_else(|| panic!("no column {name} in {:?}", rows[0]))
    };
    let mut samples: BTreeMap<String, usize> = BTreeMap::new();
    for row in &export(sandbox, "whole.db", "samples")[1..] {
        *samples.entry(row[0].clone()).or_default() += 1;
    }
    let reason = column(&designs, "reason");
    let ruled_out: Vec<&String> = designs[1..]
        .iter()
        .filter(|row| row[reason].starts_with("ruled-out: "))
        .map(|row| &row[0])
        .collect();
    assert!(!ruled_out.is_empty(), "this limit rules designs out");
    for design in &ruled_out {
        assert_eq!(samples.get(*design), None, "design {design} is ruled out");
    }

    let responses = export(sandbox, "whole.db", "responses");
    let variance = column(&responses, "p90_variance_um2");
    assert_eq!(responses.len() - 1, samples.len());
    let (mut more, mut most) = (0, 0);
    for row in &responses[1..] {
        let count = samples[&row[0]];
        let error = row[variance].parse::<f64>().unwrap().sqrt();
        more += usize::from(count > 200);
        most += usize::from(count == 3000);
        assert!(
            error <= 0.01 * (1.0 + 1e-12) || count == 3000,
            "design {}: {error} µm from {count}",
            row[0]
        );
    }
    assert!(more > 0, "some designs take more than one batch");
    assert!(most < samples.len(), "the precision can be reached");
}
