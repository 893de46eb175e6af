//! Crashes and accidents: what is left opens with everything in it, or is refused.

use std::fs;
use std::path::{Path, PathBuf};

use store::{Error, Store};

use crate::{beside, campaign, folder, open, read, sample, samples, store_with};

const BATCHES: u64 = 6;
const ROWS: u64 = 300;

/// What a crash leaves after six acknowledged batches: the file and its log, under another name.
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
    // The beginning of a commit that was never finished, as a power failure leaves it.
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
            matches!(error, Error::Behind { held, acknowledged, .. } if held < acknowledged),
            "{length} of {} bytes: {error}",
            log.len()
        );
        assert!(error.to_string().contains("left.db.lock"), "{error}");
        assert_eq!(read(&left), before);
    }

    // Put back, it goes on with everything.
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
    assert_eq!(store.samples_of(0).await.unwrap().len() as u64, held);
    assert_eq!(
        store.samples_digest().await.unwrap(),
        store.recompute_samples_digest().await.unwrap()
    );
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
    assert!(matches!(error, Error::Behind { .. }), "{error}");

    // Removed by its owner, who wants a new one.
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
    // In the middle: everything after it is unreachable, too, since checksums are chained.
    let middle = log.len() / 2;
    log[middle..middle + 64].fill(0xa5);
    fs::write(beside(&left, "-wal"), log).unwrap();
    let error = Store::create_or_open(&left, &campaign()).await.unwrap_err();
    assert!(matches!(error, Error::Behind { .. }), "{error}");
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
    // The superuser may write to anything, and then there is nothing to refuse.
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

/// What a kill in the middle of a transaction under a rollback journal leaves: part of it is in the file,
/// and the journal knows how to undo it.
#[tokio::test]
async fn a_transaction_under_a_journal_that_was_killed_is_undone() {
    use sqlx::Connection as _;
    use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqliteJournalMode};

    let (_folder, path) = folder();
    let store = store_with(&path, 3).await;
    let whole = (0..500).map(|i| sample(0, i, 1.5));
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
        // Pages go to the file while the transaction is under way.
        .pragma("cache_size", "1")
        .pragma("cache_spill", "1");
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    sqlx::query("BEGIN IMMEDIATE")
        .execute(&mut connection)
        .await
        .unwrap();
    sqlx::query("UPDATE sample SET delta_ste_um = 9.5")
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
        .filter(|w| *w == 9.5_f64.to_be_bytes())
        .count();
    assert!(marks > 100, "{marks} rows were changed in the file already");

    let store = open(&left).await;
    let held = store.samples_of(0).await.unwrap();
    assert_eq!(held.len(), 500);
    assert!(held.iter().all(|(_, value)| *value == 1.5));
    assert_eq!(
        store.samples_digest().await.unwrap(),
        store.recompute_samples_digest().await.unwrap()
    );
}

/// A new store is born with its log: a kill at its first opening finds no journal to leave behind.
#[tokio::test]
async fn a_new_store_never_has_a_rollback_journal() {
    let (_folder, path) = folder();
    store_with(&path, 1).await.close().await.unwrap();
    // Bytes 18 and 19 of the header are 2 under a write-ahead log, 1 under a rollback journal.
    assert_eq!(read(&path)[18..20], [2, 2]);
}

/// A number that changes on the disk leaves its page sound.
#[tokio::test]
async fn a_bit_that_flipped_in_a_sample_is_found_at_the_next_opening() {
    // Some megabytes are compared with their digest in the background.
    for (count, at_once) in [(500_u64, true), (200_000, false)] {
        let (_folder, path) = folder();
        let store = store_with(&path, 3).await;
        let writer = store.writer().unwrap();
        for first in (0..count).step_by(10_000) {
            let part = (first..count.min(first + 10_000)).map(|i| sample(0, i, 1.5));
            writer.submit(samples(part)).await.unwrap();
        }
        drop(writer);
        store.close().await.unwrap();
        let sound = open(&path).await;
        sound.checked().await.unwrap();
        sound.close().await.unwrap();

        let mut bytes = read(&path);
        let number = 1.5_f64.to_be_bytes();
        let place = bytes.windows(8).rposition(|window| window == number);
        bytes[place.unwrap() + 7] ^= 1;
        fs::write(&path, bytes).unwrap();
        let error = match Store::create_or_open(&path, &campaign()).await {
            Ok(store) => {
                assert!(!at_once, "a small store is compared before it is open");
                let error = store.checked().await.unwrap_err();
                store.close().await.unwrap();
                error
            }
            Err(error) => {
                assert!(at_once, "a large one is not: {error}");
                error
            }
        };
        assert!(matches!(error, Error::Damaged { .. }), "{error}");
        assert!(error.to_string().contains("digest"), "{error}");
    }
}
