//! Campaigns that sample to a precision and skip designs that their constraints rule out.

use std::collections::{BTreeMap, BTreeSet};

use acceptance::{Sandbox, assert_code, small_campaign};

use crate::campaign::{digest, export};

/// A precision that takes long enough for the campaign to be killed in between.
fn campaign() -> String {
    small_campaign(100, 200).replace(
        "samples_per_design = 200 ",
        "precision = 0.01\nsamples_max = 3000\nskip_violation = 2.0\nestimator = \"chosen\"\n\
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
    // After the first batches of all designs, some designs have more samples than others.
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

/// Groups of samples may be split between jobs: a sample does not depend on the others drawn with
/// it.
#[test]
fn even_coefficients_give_the_same_table_however_the_work_is_cut() {
    let sandbox = Sandbox::new();
    let mut digests = Vec::new();
    for (name, more) in [
        ("antithetic", "coefficients = \"antithetic\"\n"),
        ("quasi", "coefficients = \"quasi-random\"\ngroup = 4\n"),
    ] {
        let text = small_campaign(60, 32).replace("[sampling]\n", &format!("[sampling]\n{more}"));
        let file = sandbox.write(&format!("{name}.toml"), &text);
        let file = file.to_str().unwrap();
        let [one, two] = ["1", "2"].map(|workers| {
            let db = format!("{name}-{workers}.db");
            let run = [
                "run",
                file,
                "--db",
                &db,
                "--workers",
                workers,
                "--out",
                &format!("{db}-report"),
            ];
            assert_code(&sandbox.coordinator(&run), 0);
            let status = sandbox.status(&db).unwrap();
            assert_eq!(status["finished"], true, "{status}");
            let responses = export(&sandbox, &db, "responses");
            let simulable = status["designs"]["simulable"].as_u64().unwrap();
            assert_eq!(responses.len() as u64, simulable + 1);
            (digest(&sandbox, &db), responses)
        });
        assert!(one == two, "{name}: the tables differ");
        digests.push(one.0);
        // Requesting more samples keeps the existing ones.
        let more = text.replace("samples_per_design = 32 ", "samples_per_design = 48 ");
        assert_ne!(more, text);
        let larger = sandbox.write("larger.toml", &more);
        let db = format!("{name}-1.db");
        let before = export(&sandbox, &db, "samples");
        let out = format!("{db}-report");
        let larger = larger.to_str().unwrap();
        let run = ["run", larger, "--db", &db, "--out", &out];
        assert_code(&sandbox.coordinator(&run), 0);
        let after: BTreeSet<Vec<String>> = export(&sandbox, &db, "samples").into_iter().collect();
        assert!(before.iter().all(|row| after.contains(row)), "{name}");
    }
    assert_ne!(digests[0], digests[1]);
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
