//! Crashes and accidents: the remaining store opens with all its rows, or is refused.

use std::fs;
use std::path::{Path, PathBuf};

use ledger::StreamId;
use store::{
    Batch, DerivedResult, Error, FailureKind, FailureRow, ModelRow, OptimiserRunRow, OptimumRow,
    ResponseRow, SampleBlock, Store,
};

use crate::rounds::{new_round, round};
use crate::{
    POINT, at, beside, campaign, execute, feasible, folder, from, infeasible, of, open, optimum_of,
    read, sample, samples, samples_of, store_with,
};

const BATCHES: u64 = 6;
const ROWS: u64 = 300;

/// The store that a crash leaves after six acknowledged batches: a copy of the file and its log.
async fn crashed(path: &Path) -> PathBuf {
    let store = store_with(path, 1).await;
    for batch in 0..BATCHES {
        let rows = (0..ROWS).map(|i| sample(0, batch * ROWS + i, 1.5));
        store.writer().unwrap().submit(samples(rows)).await.unwrap();
    }
    let left = path.with_file_name("left.db");
    for suffix in ["", "-wal", ".lock"] {
        fs::copy(beside(path, suffix), beside(&left, suffix)).unwrap();
    }
    left
}

#[tokio::test]
async fn a_log_with_a_torn_end_is_resumed() {
    let (_folder, path) = folder();
    let left = crashed(&path).await;
    // The beginning of an unfinished commit, as a power failure leaves it.
    let mut log = read(&beside(&left, "-wal"));
    log.extend_from_within(32..5000);
    fs::write(beside(&left, "-wal"), log).unwrap();
    let store = open(&left).await;
    assert_eq!(store.progress().await.unwrap().samples, BATCHES * ROWS);
}

#[tokio::test]
async fn a_log_that_was_cut_is_refused() {
    let (_folder, path) = folder();
    let left = crashed(&path).await;
    let log = read(&beside(&left, "-wal"));
    for length in [log.len() - 1, log.len() / 2, 100, 0] {
        fs::write(beside(&left, "-wal"), &log[..length]).unwrap();
        let before = read(&left);
        let error = Store::create_or_open(&left, &campaign())
            .await
            .expect_err("refused");
        assert!(
            matches!(error, Error::MissingCommits { stored, acknowledged, .. } if stored < acknowledged),
            "{length} of {} bytes: {error}",
            log.len()
        );
        assert!(error.to_string().contains("left.db.lock"), "{error}");
        assert_eq!(read(&left), before);
    }

    // With the log restored, the store continues with all rows.
    fs::write(beside(&left, "-wal"), &log).unwrap();
    let store = open(&left).await;
    assert_eq!(store.progress().await.unwrap().samples, BATCHES * ROWS);
}

#[tokio::test]
async fn a_cut_log_can_be_accepted_and_loses_whole_batches_only() {
    let (_folder, path) = folder();
    let left = crashed(&path).await;
    let log = read(&beside(&left, "-wal"));
    fs::write(beside(&left, "-wal"), &log[..log.len() * 2 / 3]).unwrap();
    fs::remove_file(beside(&left, ".lock")).unwrap();
    let store = open(&left).await;
    let held = store.progress().await.unwrap().samples;
    assert!(held < BATCHES * ROWS, "nothing was cut");
    assert_eq!(held % ROWS, 0, "part of a batch");
    assert_eq!(samples_of(&store, of(0)).await.unwrap().len() as u64, held);
    store.visit_samples(|_| Ok::<(), Error>(())).await.unwrap();
    let all = samples((0..BATCHES * ROWS).map(|i| sample(0, i, 1.5)));
    let receipt = store.writer().unwrap().submit(all).await.unwrap();
    assert_eq!(receipt.duplicate_rows, held);
}

#[tokio::test]
async fn an_older_copy_is_refused_in_the_place_of_a_newer_store() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    store.close().await.unwrap();
    let copy = read(&path);
    let store = open(&path).await;
    let rows = samples([sample(0, 0, 1.0)]);
    store.writer().unwrap().submit(rows).await.unwrap();
    store.close().await.unwrap();
    fs::write(&path, copy).unwrap();
    let error = Store::create_or_open(&path, &campaign()).await.unwrap_err();
    assert!(matches!(error, Error::MissingCommits { .. }), "{error}");

    // The owner removed the file to start a new store.
    fs::remove_file(&path).unwrap();
    let store = open(&path).await;
    assert_eq!(store.designs().await.unwrap(), []);
    store.close().await.unwrap();
    open(&path).await;
}

#[tokio::test]
async fn a_damaged_log_page_is_refused() {
    let (_folder, path) = folder();
    let left = crashed(&path).await;
    let mut log = read(&beside(&left, "-wal"));
    // In the middle of the log: all later frames become unreadable, too, because the checksums are
    // chained.
    let middle = log.len() / 2;
    log[middle..middle + 64].fill(0xa5);
    fs::write(beside(&left, "-wal"), log).unwrap();
    let error = Store::create_or_open(&left, &campaign()).await.unwrap_err();
    assert!(matches!(error, Error::MissingCommits { .. }), "{error}");
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn a_folder_that_takes_no_files_is_named() {
    let path = Path::new("/proc/self/campaign.db");
    let error = Store::create_or_open(path, &campaign()).await.unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert!(error.to_string().contains("campaign.db"), "{error}");
}

#[cfg(unix)]
#[tokio::test]
async fn a_store_that_may_not_be_written_is_refused_and_can_be_read() {
    use std::os::unix::fs::PermissionsExt as _;

    let (folder, path) = folder();
    store_with(&path, 3).await.close().await.unwrap();
    let mode = |path: &Path, mode| {
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    };
    mode(&path, 0o444);
    // The superuser may write to any file, and then nothing is refused.
    let may_write_anyway = fs::File::options().append(true).open(&path).is_ok();
    let opened = Store::create_or_open(&path, &campaign()).await;
    assert_eq!(opened.is_ok(), may_write_anyway);
    drop(opened);
    let reader = Store::open_read_only(&path).await.unwrap();
    assert_eq!(reader.designs().await.unwrap().len(), 3);
    reader.close().await.unwrap();

    mode(&path, 0o644);
    mode(folder.path(), 0o555);
    let new = folder.path().join("new.db");
    let created = Store::create_or_open(&new, &campaign()).await;
    assert_eq!(created.is_ok(), may_write_anyway);
    mode(folder.path(), 0o755);
}

/// A kill during a transaction under a rollback journal: part of the changes are in the file, and
/// the journal can undo them.
#[tokio::test]
async fn a_transaction_under_a_journal_that_was_killed_is_undone() {
    use sqlx::Connection as _;
    use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqliteJournalMode};

    let (_folder, path) = folder();
    let store = store_with(&path, 3).await;
    // Samples with gaps, so that each has a row of its own.
    let whole = (0..500).map(|i| sample(0, 2 * i, 1.5));
    store
        .writer()
        .unwrap()
        .submit(samples(whole))
        .await
        .unwrap();
    store.close().await.unwrap();
    let options = SqliteConnectOptions::new()
        .filename(&path)
        .journal_mode(SqliteJournalMode::Delete)
        // Small enough that pages are written to the file during the transaction.
        .pragma("cache_size", "1")
        .pragma("cache_spill", "1");
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    sqlx::query("BEGIN IMMEDIATE")
        .execute(&mut connection)
        .await
        .unwrap();
    // 9.5, little-endian.
    sqlx::query("UPDATE sample_block SET samples = x'0000000000002340'")
        .execute(&mut connection)
        .await
        .unwrap();
    let left = path.with_file_name("left.db");
    for suffix in ["", "-journal", ".lock"] {
        fs::copy(beside(&path, suffix), beside(&left, suffix)).unwrap();
    }
    assert!(
        read(&beside(&left, "-journal")).len() > 512,
        "the journal is hot"
    );
    let marks = read(&left)
        .windows(8)
        .filter(|w| *w == 9.5_f64.to_le_bytes())
        .count();
    assert!(marks > 100, "{marks} rows were changed in the file already");

    let store = open(&left).await;
    let held = samples_of(&store, of(0)).await.unwrap();
    assert_eq!(held.len(), 500);
    assert!(held.iter().all(|(_, value)| *value == 1.5));
    store.visit_samples(|_| Ok::<(), Error>(())).await.unwrap();
}

/// A new store is created with its log, so a kill at its first opening leaves no journal behind.
#[tokio::test]
async fn a_new_store_never_has_a_rollback_journal() {
    let (_folder, path) = folder();
    store_with(&path, 1).await.close().await.unwrap();
    // Bytes 18 and 19 of the header are 2 under a write-ahead log, 1 under a rollback journal.
    assert_eq!(read(&path)[18..20], [2, 2]);
}

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
    store
        .put_responses(&[response], &from(&DerivedResult::Responses))
        .await
        .unwrap();
    let model = ModelRow {
        name: ModelRow::DOE.into(),
        number: 0,
        json: "{\"theta\":[1.5,0.25]}".into(),
        summary_json: "{}".into(),
    };
    store
        .put_models(std::slice::from_ref(&model), &from(&DerivedResult::Model))
        .await
        .unwrap();
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
    store
        .put_optimum(&optimum, &optimum_of(&optimum))
        .await
        .unwrap();
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
    store
        .put_optimum(&optimum, &optimum_of(&optimum))
        .await
        .unwrap();
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

#[tokio::test]
async fn the_digest_of_verification_samples_is_that_of_any_order() {
    let (_first, one) = folder();
    let (_second, other) = folder();
    let rows: Vec<SampleBlock> = [POINT, StreamId::point(1 << 27)]
        .into_iter()
        .flat_map(|point| (0..50).map(move |i| at(point, i, 1.0 + i as f64)))
        .collect();
    let mut digests = Vec::new();
    for (path, step) in [(one, 7), (other, 31)] {
        let store = store_with(&path, 1).await;
        let none = store.samples_digest().await.unwrap();
        assert_eq!(store.point_samples_digest().await.unwrap(), none);
        let mut rows = rows.clone();
        if step == 31 {
            rows.reverse();
        }
        for part in rows.chunks(step) {
            // Twice: the repetition changes nothing.
            for _ in 0..2 {
                let batch = samples(part.to_vec());
                store.writer().unwrap().submit(batch).await.unwrap();
            }
        }
        let digest = store.point_samples_digest().await.unwrap();
        assert_eq!(
            store.samples_digest().await.unwrap(),
            none,
            "those of the DoE"
        );
        digests.push(digest);
    }
    assert_eq!(digests[0], digests[1]);
    assert_ne!(digests[0], "0".repeat(64));
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
