//! Crashes and copies: what they leave opens with all acknowledged rows, or is refused.

use std::fs;
use std::path::{Path, PathBuf};

use store::{Error, Store};

use crate::{beside, campaign, folder, of, open, read, sample, samples, samples_of, store_with};

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
