//! Rows that changed outside the program are found by their seals. Rows that the program changes are not damage.

use std::fs;
use std::path::Path;

use ledger::StreamId;
use store::{
    Batch, Error, FailureKind, FailureRow, ModelRow, OptimiserRunRow, OptimumRow, ResponseRow,
    Store,
};

use crate::rounds::{new_round, round};
use crate::{
    POINT, at, campaign, execute, feasible, folder, infeasible, of, open, put_fit, put_optimum,
    read, sample, samples, samples_of, store_with,
};

/// A number that changes on the disk leaves its page valid.
#[tokio::test]
async fn a_bit_that_flipped_in_a_sample_is_found_at_the_next_opening() {
    let (_folder, path) = folder();
    let store = store_with(&path, 3).await;
    let part = (0..500).map(|i| sample(0, i, 1.5));
    let writer = store.writer().unwrap();
    writer.submit(samples(part)).await.unwrap();
    drop(writer);
    store.close().await.unwrap();
    let sound = open(&path).await;
    sound.checked().await.unwrap();
    sound.close().await.unwrap();

    let mut bytes = read(&path);
    let number = 1.5_f64.to_le_bytes();
    let place = bytes.windows(8).rposition(|window| window == number);
    bytes[place.unwrap()] ^= 1;
    fs::write(&path, bytes).unwrap();
    let error = Store::create_or_open(&path, &campaign())
        .await
        .expect_err("checked before it is open");
    assert!(matches!(error, Error::DamagedRows { .. }), "{error}");
    let said = error.to_string();
    assert!(
        said.contains("table sample_block, row first_sample"),
        "{said}"
    );
    assert!(said.contains("of design-0"), "{said}");
}

/// Creates a store with a row in every sealed table, and samples of both kinds.
pub(crate) async fn with_every_row(path: &Path) {
    let store = store_with(path, 2).await;
    let batch = Batch {
        criteria: vec![feasible(0), infeasible(1)],
        runs: vec![OptimiserRunRow {
            stream: StreamId::run(3, 3),
            result_json: "{\"best\":[1.5,2.5]}".into(),
            simulator_calls: 7,
            cpu_seconds: 0.5,
        }],
        failures: vec![FailureRow {
            stream: of(0),
            sample: None,
            shared: false,
            lease: 4,
            worker: "w".into(),
            serial: Some(1),
            kind: FailureKind::Failure,
            error: "no contact at 12.5 mm".into(),
            at_unix_ms: Some(1),
        }],
        ..samples(
            (0..40)
                .chain(50..60)
                .map(|i| sample(1, i, 1.5))
                .chain((0..40).map(|i| at(POINT, i, 1.0 + i as f64))),
        )
    };
    store.writer().unwrap().submit(batch).await.unwrap();
    let response = ResponseRow {
        design: 1,
        number: 0,
        mean: 1.5,
        standard_deviation: 0.1,
        measure: 1.75,
        measure_variance: 0.01,
        lilliefors_p: None,
    };
    let model = ModelRow {
        name: ModelRow::DOE.into(),
        number: 0,
        json: "{\"theta\":[1.5,0.25]}".into(),
        summary_json: "{}".into(),
    };
    put_fit(&store, &[response], &model).await;
    let optimum = OptimumRow {
        stream: StreamId::point(3),
        reason: None,
        x: Some(vec![0.5, -0.25]),
        criterion: Some(0.75),
        criteria: Some(vec![1.5]),
        feasible: true,
        simulator_calls: 1200,
        cpu_seconds: 9.25,
        note: "at the upper bound of x_p".into(),
    };
    put_optimum(&store, &optimum).await;
    store
        .put_round(&new_round(0, &[]), &round(0))
        .await
        .unwrap();
    store
        .put_round(&new_round(1, &[2]), &round(1))
        .await
        .unwrap();
    store.pin_model_digest("abc").await.unwrap();
    store.close().await.unwrap();
}

/// Checks that readers and writers refuse the store, naming file, table and row.
async fn is_refused(path: &Path, table: &str, row: &str) {
    let reading = Store::open_read_only(path).await.expect_err(table);
    let writing = Store::create_or_open(path, &campaign())
        .await
        .expect_err(table);
    for error in [reading, writing] {
        let said = error.to_string();
        assert!(matches!(error, Error::DamagedRows { .. }), "{said}");
        let place = format!("table {table}, row {row}");
        assert!(said.contains(&place), "no {place:?} in: {said}");
        assert!(said.contains("campaign.db"), "{said}");
        assert!(said.contains("restore a copy"), "{said}");
    }
}

#[tokio::test]
async fn an_edited_row_of_any_table_is_named() {
    let (folder, path) = folder();
    with_every_row(&path).await;
    let whole = read(&path);
    let edits = [
        ("campaign", "one 1", "UPDATE campaign SET seed = seed + 1"),
        (
            "design",
            "design 1",
            "UPDATE design SET x = zeroblob(48) WHERE design = 1",
        ),
        (
            "criteria",
            "design 0",
            "UPDATE criteria SET responses = zeroblob(88) WHERE design = 0",
        ),
        (
            "criteria",
            "design 1",
            "UPDATE criteria SET simulable = 1, reason = NULL",
        ),
        (
            "optimiser_run",
            "run-3-3",
            "UPDATE optimiser_run SET result_json = '{\"best\":[1.5,2.6]}'",
        ),
        (
            "response",
            "design 1",
            "UPDATE response SET measure = 1.7500000000000002",
        ),
        (
            "model",
            "name \"doe\"",
            "UPDATE model SET json = replace(json, '1.5', '1.6')",
        ),
        ("optimum", "point-3", "UPDATE optimum SET criterion = 0.7"),
        (
            "optimum",
            "point-3",
            "UPDATE optimum SET x = x'000000000000e03f'",
        ),
        (
            "optimum",
            "point-4",
            "INSERT INTO optimum SELECT stream + 1, reason, x, criterion, criteria, feasible,
                simulator_calls, cpu_seconds, note, seal FROM optimum",
        ),
        (
            "enrichment_round",
            "round 1",
            "UPDATE enrichment_round SET stop_json = '{}' WHERE round = 1",
        ),
        (
            "infill",
            "infill 2",
            "UPDATE infill SET failed = 0 WHERE infill = 2",
        ),
        (
            "failure",
            "failure 1",
            "UPDATE failure SET kind = 'quarantine'",
        ),
        (
            "failure_tally",
            "kind failure, cause \"no contact at # mm\"",
            "UPDATE failure_tally SET failures = 2",
        ),
        // Sample 57 becomes 1.25.
        (
            "sample_block",
            "first_sample 50 of design-1",
            "UPDATE sample_block SET samples = CAST(substr(samples, 1, 56)
                || x'000000000000f43f' || substr(samples, 65) AS BLOB)
                WHERE first_sample = 50",
        ),
        // Sample 50 becomes NaN.
        (
            "sample_block",
            "first_sample 50 of design-1",
            "UPDATE sample_block SET samples = CAST(x'000000000000f87f'
                || substr(samples, 9) AS BLOB) WHERE first_sample = 50",
        ),
        (
            "sample_block",
            "first_sample 0 of design-1",
            "UPDATE sample_block SET samples = substr(samples, 9) WHERE first_sample = 0",
        ),
        (
            "sample_block",
            "first_sample 60 of design-1",
            "UPDATE sample_block SET first_sample = 60 WHERE first_sample = 50",
        ),
        (
            "sample_block",
            "first_sample 50 of design-0",
            "UPDATE sample_block SET stream = 0 WHERE first_sample = 50",
        ),
        (
            "sample_block",
            "first_sample 10 of design-1",
            "INSERT INTO sample_block SELECT stream, 10, responses, samples, seal, origin FROM sample_block
                WHERE first_sample = 50",
        ),
        (
            "sample_block",
            "first_sample 0 of design-1",
            "UPDATE sample_block SET seal = seal + 1",
        ),
        (
            "sample_block",
            "one of design-1",
            "DELETE FROM sample_block WHERE first_sample = 50",
        ),
        (
            "sample_block",
            "one of design-1",
            "DELETE FROM sample_block",
        ),
        (
            "sample_block",
            "one of point-3",
            "DELETE FROM sample_block WHERE stream > 1",
        ),
        (
            "sample_tally",
            "design-1",
            "UPDATE sample_tally SET samples = samples - 1 WHERE stream = 1",
        ),
        (
            "sample_tally",
            "design-1",
            "UPDATE sample_tally SET digest = zeroblob(32)",
        ),
        (
            "sample_block",
            "one of point-3",
            "DELETE FROM sample_tally WHERE stream > 1",
        ),
    ];
    for (table, row, edit) in edits {
        execute(&path, edit).await;
        is_refused(&path, table, row).await;
        fs::write(&path, &whole).unwrap();
    }
    // The unchanged file opens.
    open(&path).await.close().await.unwrap();
    drop(folder);
}

/// The length is not a multiple of a sample's, which the schema itself forbids.
#[tokio::test]
async fn a_range_that_was_cut_within_a_number_is_named() {
    let (_folder, path) = folder();
    with_every_row(&path).await;
    execute(
        &path,
        "PRAGMA ignore_check_constraints = ON;
         UPDATE sample_block SET samples = substr(samples, 1, length(samples) - 3)
         WHERE first_sample = 50",
    )
    .await;
    is_damaged_or_refused(&path).await;
}

/// Either check may fail: SQLite finds a broken constraint before the seals are compared.
async fn is_damaged_or_refused(path: &Path) {
    let reading = Store::open_read_only(path).await.expect_err("reading");
    let writing = Store::create_or_open(path, &campaign())
        .await
        .expect_err("writing");
    for error in [reading, writing] {
        let said = error.to_string();
        assert!(
            said.contains("sample_block") && said.contains("campaign.db"),
            "{said}"
        );
    }
}

/// JSON with a flipped bit may still be valid, or be refused by a parser that knows no file name.
#[tokio::test]
async fn a_bit_that_flipped_in_text_is_found() {
    let (_folder, path) = folder();
    with_every_row(&path).await;
    let whole = read(&path);
    for (text, table, row) in [
        ("{\"theta\":[1.5,0.25]}", "model", "name \"doe\""),
        ("{\"best\":[1.5,2.5]}", "optimiser_run", "run-3-3"),
        ("at the upper bound of x_p", "optimum", "point-3"),
        ("# a campaign", "campaign", "one 1"),
    ] {
        let at = whole
            .windows(text.len())
            .rposition(|window| window == text.as_bytes())
            .unwrap();
        // One flipped bit, for example a comma that becomes a hyphen.
        for byte in [at + text.len() / 2, at + text.len() - 2] {
            let mut bytes = whole.clone();
            bytes[byte] ^= 1;
            fs::write(&path, bytes).unwrap();
            is_refused(&path, table, row).await;
        }
    }
}

/// Rows that the program itself replaces, marks or removes are not damage.
#[tokio::test]
async fn rows_that_the_program_changes_stay_sound() {
    let (_folder, path) = folder();
    with_every_row(&path).await;
    let store = open(&path).await;
    let mut optimum = store.optima().await.unwrap().remove(0);
    optimum.criterion = Some(-0.0);
    put_optimum(&store, &optimum).await;
    let larger = store::CampaignRow {
        digest: "larger".into(),
        ..campaign()
    };
    store.put_generations(&[(POINT, 1)]).await.unwrap();
    store.put_generations(&[(POINT, 2)]).await.unwrap();
    assert_eq!(samples_of(&store, POINT).await.unwrap(), []);
    store.extend(&larger).await.unwrap();
    store.close().await.unwrap();
    let store = Store::create_or_open(&path, &larger).await.unwrap();
    store.checked().await.unwrap();
    assert_eq!(
        store.campaign().await.unwrap().model_digest.as_deref(),
        Some("abc")
    );
    assert_eq!(store.point_samples_digest().await.unwrap(), "0".repeat(64));
}

/// A large store is opened for reading without a check, and `is_checked` is false.
#[tokio::test]
async fn a_reader_of_a_large_store_checks_it_when_asked() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let writer = store.writer().unwrap();
    for first in (0..600_000).step_by(20_000) {
        let part = (first..first + 20_000).map(|i| sample(0, i, 1.5));
        writer.submit(samples(part)).await.unwrap();
    }
    drop(writer);
    store.close().await.unwrap();
    let reader = Store::open_read_only(&path).await.unwrap();
    assert!(!reader.is_checked());
    reader.checked().await.unwrap();
    assert!(reader.is_checked());
    reader.close().await.unwrap();

    execute(
        &path,
        "UPDATE sample_block
         SET samples = CAST(x'0000000000000440' || substr(samples, 9) AS BLOB)
         WHERE first_sample = 4096",
    )
    .await;
    let reader = Store::open_read_only(&path).await.unwrap();
    let error = reader.checked().await.unwrap_err();
    assert!(
        matches!(
            error,
            Error::DamagedRows {
                table: "sample_block",
                ..
            }
        ),
        "{error}"
    );
    assert!(!reader.is_checked());
    // Reading all samples finds the damage, too.
    let error = reader
        .visit_samples(|_| Ok::<(), Error>(()))
        .await
        .unwrap_err();
    assert!(
        matches!(
            error,
            Error::DamagedRows {
                table: "sample_block",
                ..
            }
        ),
        "{error}"
    );
}
