//! Files that are not a sound store of this campaign are refused and left unchanged.

use std::fs;
use std::path::Path;

use store::{CampaignRow, Error, Store};

use crate::{beside, campaign, execute, folder, open, read, sample, samples, store_with};

/// Opens the file in both ways, and checks that both fail and neither changes it.
async fn refused(path: &Path) -> (Error, Error) {
    let before = read(path);
    let writing = Store::create_or_open(path, &campaign())
        .await
        .expect_err("refused");
    let reading = Store::open_read_only(path).await.expect_err("refused");
    assert_eq!(read(path), before, "the refused file was changed");
    (writing, reading)
}

#[tokio::test]
async fn a_text_file_is_refused() {
    let (_folder, path) = folder();
    for text in [
        "name = \"paper\"\n",
        "SQLite format 3",
        "SQLite format 4\0 and so on",
    ] {
        fs::write(&path, text).unwrap();
        let (writing, reading) = refused(&path).await;
        assert!(matches!(writing, Error::NotADatabase { .. }), "{writing}");
        assert!(matches!(reading, Error::NotADatabase { .. }), "{reading}");
        assert!(
            !beside(&path, ".lock").exists(),
            "nothing is left beside a stranger's file"
        );
    }
}

#[tokio::test]
async fn an_empty_file_is_not_taken_for_a_new_store() {
    let (_folder, path) = folder();
    fs::write(&path, "").unwrap();
    let (writing, reading) = refused(&path).await;
    assert!(matches!(writing, Error::Damaged { .. }), "{writing}");
    assert!(matches!(reading, Error::Damaged { .. }), "{reading}");
}

#[tokio::test]
async fn a_log_without_its_file_is_not_replayed_into_a_new_store() {
    let (_folder, path) = folder();
    fs::write(beside(&path, "-wal"), "what is left").unwrap();
    let error = Store::create_or_open(&path, &campaign()).await.unwrap_err();
    assert!(matches!(error, Error::Damaged { .. }), "{error}");
    assert!(!path.exists());

    fs::write(beside(&path, "-wal"), "").unwrap();
    open(&path).await;
}

#[tokio::test]
async fn another_programs_database_is_refused() {
    let (_folder, path) = folder();
    execute(&path, "CREATE TABLE sample (design, sample)").await;
    let (writing, reading) = refused(&path).await;
    assert!(
        matches!(
            writing,
            Error::NotAStore {
                application_id: 0,
                ..
            }
        ),
        "{writing}"
    );
    assert!(
        matches!(
            reading,
            Error::NotAStore {
                application_id: 0,
                ..
            }
        ),
        "{reading}"
    );
}

#[tokio::test]
async fn no_file_is_not_a_store_to_read() {
    let (_folder, path) = folder();
    let error = Store::open_read_only(&path).await.unwrap_err();
    assert!(matches!(error, Error::NoStore { .. }), "{error}");
    assert!(!path.exists());
}

#[tokio::test]
async fn a_missing_folder_is_named() {
    let (folder, _) = folder();
    let path = folder.path().join("nowhere").join("campaign.db");
    let error = Store::create_or_open(&path, &campaign()).await.unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert!(error.to_string().contains("nowhere"), "{error}");
}

#[tokio::test]
async fn a_truncated_store_is_refused() {
    let (_folder, path) = folder();
    filled(&path).await;
    let whole = read(&path);
    // After one page, in the middle of a page, and just short of the end.
    for length in [4096, whole.len() / 2 + 100, whole.len() - 4096] {
        fs::write(&path, &whole[..length]).unwrap();
        let before = read(&path);
        let error = Store::create_or_open(&path, &campaign())
            .await
            .expect_err("refused");
        assert!(
            matches!(error, Error::Damaged { .. }),
            "{length} bytes: {error}"
        );
        assert_eq!(read(&path), before);
    }
    fs::write(&path, &whole).unwrap();
    assert_eq!(open(&path).await.progress().await.unwrap().samples, 5000);
}

#[tokio::test]
async fn an_overwritten_store_is_refused() {
    let (_folder, path) = folder();
    filled(&path).await;
    let whole = read(&path);
    let pages = whole.len() / 4096;
    for page in [1, pages / 2, pages - 1] {
        let mut broken = whole.clone();
        broken[page * 4096..(page + 1) * 4096].fill(0xa5);
        fs::write(&path, &broken).unwrap();
        let before = read(&path);
        let error = Store::create_or_open(&path, &campaign())
            .await
            .expect_err("refused");
        assert!(
            matches!(error, Error::Damaged { .. }),
            "page {page} of {pages}: {error}"
        );
        assert_eq!(read(&path), before);
    }
}

#[tokio::test]
async fn another_campaign_is_refused_with_both_names() {
    let (_folder, path) = folder();
    open(&path).await.close().await.unwrap();
    let before = read(&path);
    let other = CampaignRow {
        name: "quick".into(),
        digest: "beef".into(),
        ..campaign()
    };
    let error = Store::create_or_open(&path, &other).await.unwrap_err();
    assert!(matches!(error, Error::OtherCampaign { .. }), "{error}");
    for part in ["paper", "00ff", "quick", "beef", "campaign.db"] {
        assert!(
            error.to_string().contains(part),
            "{part} is missing from: {error}"
        );
    }
    assert_eq!(read(&path), before);

    // The text may change, for example a comment, as long as the content is the same.
    let same = CampaignRow {
        file_text: "name = \"paper\"".into(),
        ..campaign()
    };
    let store = Store::create_or_open(&path, &same).await.unwrap();
    assert_eq!(
        store.campaign().await.unwrap(),
        campaign(),
        "the first text is kept"
    );
}

#[tokio::test]
async fn other_schemas_are_refused() {
    for change in [
        "INSERT INTO _sqlx_migrations VALUES (9999, 'the future', 0, TRUE, x'00', 0)",
        "UPDATE _sqlx_migrations SET checksum = x'00'",
        "DELETE FROM _sqlx_migrations",
    ] {
        let (_folder, path) = folder();
        open(&path).await.close().await.unwrap();
        execute(&path, change).await;
        let (writing, reading) = refused(&path).await;
        for error in [writing, reading] {
            assert!(matches!(error, Error::OtherSchema { .. }), "{error}");
        }
    }
}

#[tokio::test]
async fn a_store_without_one_of_its_tables_or_rows_is_damaged() {
    for change in [
        "DROP TABLE _sqlx_migrations",
        "ALTER TABLE _sqlx_migrations DROP COLUMN checksum",
        "DROP TABLE sample_tally",
        "DELETE FROM campaign",
        "DELETE FROM commit_tally",
    ] {
        let (_folder, path) = folder();
        open(&path).await.close().await.unwrap();
        execute(&path, change).await;
        let error = Store::create_or_open(&path, &campaign()).await;
        let error = error.expect_err(change);
        assert!(
            matches!(error, Error::Damaged { .. } | Error::DamagedRows { .. }),
            "{change}: {error}"
        );
    }
}

#[tokio::test]
async fn a_creation_that_was_killed_is_begun_anew() {
    let (_folder, path) = folder();
    fs::write(beside(&path, ".creating"), "half a store").unwrap();
    fs::write(beside(&path, ".creating-journal"), "half a journal").unwrap();
    let store = open(&path).await;
    assert_eq!(store.campaign().await.unwrap(), campaign());
    assert!(!beside(&path, ".creating").exists());
    assert!(!beside(&path, ".creating-journal").exists());
}

/// Creates a closed store of some dozens of pages.
async fn filled(path: &Path) {
    let store = store_with(path, 10).await;
    let rows = (0..10).flat_map(|d| (0..500).map(move |s| sample(d, s, 1.0 / (s + 1) as f64)));
    store.writer().unwrap().submit(samples(rows)).await.unwrap();
    store.close().await.unwrap();
}
