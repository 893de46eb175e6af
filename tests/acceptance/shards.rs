//! `plan`, `worker --shard` and `merge`: a campaign without a network between its nodes.

use std::collections::BTreeSet;

use acceptance::{Sandbox, assert_code, errors, printed, small_campaign};
use serde_json::Value;

use crate::campaign::{digest, export};

/// Plans the present stage into a folder of this name. Returns the names of its parts, none if nothing is left.
fn plan(sandbox: &Sandbox, folder: &str, shards: &str) -> Vec<String> {
    let output = sandbox.coordinator(&[
        "plan",
        "small.toml",
        "--db",
        "sharded.db",
        "--shards",
        shards,
        "--out",
        folder,
        "--report",
        "sharded-report",
        "--json",
    ]);
    assert_code(&output, 0);
    let planned: Value = serde_json::from_str(&printed(&output)).expect("one JSON object");
    let shards = planned["shards"].as_array().expect("shards");
    let names = shards
        .iter()
        .map(|shard| shard.as_str().expect("a path").to_owned());
    names.collect()
}

fn compute(sandbox: &Sandbox, shard: &str) -> String {
    let part = shard.replace(".json", ".part");
    let arguments = ["--shard", shard, "--out", &part, "--slots", "1"];
    assert_code(&sandbox.run("worker", &arguments), 0);
    part
}

fn merge(sandbox: &Sandbox, parts: &[String]) -> std::process::Output {
    let parts = parts.iter().map(String::as_str);
    let arguments: Vec<&str> = ["merge", "--db", "sharded.db"]
        .into_iter()
        .chain(parts)
        .collect();
    sandbox.coordinator(&arguments)
}

#[test]
fn shards_give_the_results_of_a_connected_campaign() {
    let sandbox = Sandbox::new();
    sandbox.write("small.toml", &small_campaign(60, 12));
    let run = [
        "run",
        "small.toml",
        "--db",
        "local.db",
        "--out",
        "local-report",
    ];
    assert_code(&sandbox.coordinator(&run), 0);
    // The campaign was smaller when the first samples were computed, and had grown before they were merged.
    sandbox.write("small.toml", &small_campaign(60, 5));
    let early: Vec<String> = plan(&sandbox, "early", "2")
        .iter()
        .map(|shard| compute(&sandbox, shard))
        .collect();
    sandbox.write("small.toml", &small_campaign(60, 12));
    plan(&sandbox, "late", "2");
    assert_code(&merge(&sandbox, &early), 0);
    let blocks = export(&sandbox, "sharded.db", "blocks");
    assert!(blocks.len() > 1, "the samples are stored");
    // Each block names the process that computed it, not the file that brought it.
    let column = |name: &str| {
        let place = blocks[0].iter().position(|column| column == name);
        let place = place.expect("a column");
        let cells = blocks[1..].iter().map(|row| row[place].as_str());
        cells.collect::<BTreeSet<&str>>()
    };
    let is_id = |worker: &&str| worker.len() == 32;
    let workers = column("worker");
    assert!(
        workers.len() == 2 && workers.iter().all(is_id),
        "{workers:?}"
    );
    assert_eq!(column("host").len(), 2, "{blocks:?}");
    let mut stages = 0;
    loop {
        let shards = plan(&sandbox, &format!("stage{stages}"), "3");
        if shards.is_empty() {
            break;
        }
        let parts: Vec<String> = shards
            .iter()
            .map(|shard| compute(&sandbox, shard))
            .collect();
        assert_code(&merge(&sandbox, &parts), 0);
        // Merging the same parts again changes nothing.
        assert_code(&merge(&sandbox, &parts), 0);
        stages += 1;
        assert!(stages < 10, "no end in sight");
    }
    assert!(stages >= 2, "samples and searches are stages of their own");
    assert_eq!(digest(&sandbox, "local.db"), digest(&sandbox, "sharded.db"));
    for table in ["designs", "samples", "responses"] {
        let of = |db| export(&sandbox, db, table);
        assert_eq!(of("local.db"), of("sharded.db"), "{table}");
    }
    assert!(sandbox.path("sharded-report/report.html").exists());
}

#[test]
fn parts_that_do_not_fit_are_named_and_nothing_of_them_is_stored() {
    let sandbox = Sandbox::new();
    sandbox.write("small.toml", &small_campaign(30, 8));
    let shards = plan(&sandbox, "stage", "3");
    assert_eq!(shards.len(), 3);
    let parts: Vec<String> = shards
        .iter()
        .map(|shard| compute(&sandbox, shard))
        .collect();
    let samples = || sandbox.status("sharded.db").expect("a store")["samples"]["done"].clone();

    let twice = [&parts[..1], &parts[..1]].concat();
    let output = merge(&sandbox, &twice);
    assert_code(&output, 2);
    assert!(
        errors(&output).contains("both parts of shard 1"),
        "{}",
        errors(&output)
    );

    // Damage in the middle of a part, and a file that is not a part.
    let whole = std::fs::read(sandbox.path(&parts[1])).unwrap();
    let header = whole.iter().position(|byte| *byte == b'\n').unwrap();
    let mut damaged = whole.clone();
    damaged[header + 40] ^= 1;
    std::fs::write(sandbox.path("damaged.part"), &damaged).unwrap();
    let with = |part: &str| merge(&sandbox, &[parts[0].clone(), part.to_owned()]);
    let output = with("damaged.part");
    assert_code(&output, 3);
    assert!(
        errors(&output).contains("damaged.part is damaged at byte"),
        "{}",
        errors(&output)
    );
    let output = with("small.toml");
    assert_code(&output, 3);
    assert!(
        errors(&output).contains("is not a part"),
        "{}",
        errors(&output)
    );

    // A part of another campaign.
    sandbox.write(
        "other.toml",
        &small_campaign(30, 8).replacen("seed = ", "seed = 1", 1),
    );
    let other = [
        "plan",
        "other.toml",
        "--db",
        "other.db",
        "--shards",
        "1",
        "--out",
        "other",
    ];
    assert_code(&sandbox.coordinator(&other), 0);
    let foreign = compute(&sandbox, "other/1.json");
    let output = with(&foreign);
    assert_code(&output, 6);
    assert!(
        errors(&output).contains("belongs to another campaign"),
        "{}",
        errors(&output)
    );
    assert_eq!(samples(), 0, "a refused merge stores nothing");

    // A missing part is named, and the others are stored.
    let output = merge(&sandbox, &parts[..2]);
    assert_code(&output, 13);
    assert!(
        printed(&output).contains("no part of shard 3"),
        "{}",
        printed(&output)
    );
    assert_ne!(samples(), 0);

    // A worker that was stopped in the middle: its part is continued.
    std::fs::write(sandbox.path(&parts[1]), &whole[..whole.len() - 5]).unwrap();
    let output = merge(&sandbox, &parts);
    assert_code(&output, 13);
    assert!(
        printed(&output).contains("unfinished"),
        "{}",
        printed(&output)
    );
    compute(&sandbox, &shards[1]);
    assert_code(&merge(&sandbox, &parts), 0);

    // The part of another shard is not written over.
    let output = sandbox.run("worker", &["--shard", &shards[0], "--out", &parts[1]]);
    assert_code(&output, 4);
    assert!(
        errors(&output).contains("another shard"),
        "{}",
        errors(&output)
    );
    let output = sandbox.run("worker", &["--shard", "small.toml", "--out", "x.part"]);
    assert_code(&output, 3);
}
