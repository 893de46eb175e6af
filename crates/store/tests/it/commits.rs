//! Acknowledged rows are on disk, batches share commits, and there is one coordinator at a time.

use std::fs;
use std::path::Path;

use store::{Batch, Error, FailureKind, FailureRow, JobTimeRow, Receipt, Store};

use crate::{
    beside, campaign, feasible, folder, of, open, sample, samples, samples_of, store_with,
};

#[tokio::test]
async fn what_is_acknowledged_is_on_disk() {
    let (folder, path) = folder();
    let store = store_with(&path, 1).await;
    store
        .writer()
        .unwrap()
        .submit(samples([sample(0, 0, 1.5)]))
        .await
        .unwrap();

    let reader = Store::open_read_only(&path).await.unwrap();
    assert_eq!(samples_of(&reader, of(0)).await.unwrap(), [(0, 1.5)]);

    // The file and its log as a SIGKILL at this moment would leave them.
    let survivor = folder.path().join("survivor.db");
    fs::copy(&path, &survivor).unwrap();
    fs::copy(beside(&path, "-wal"), beside(&survivor, "-wal")).unwrap();
    let survivor = open(&survivor).await;
    assert_eq!(samples_of(&survivor, of(0)).await.unwrap(), [(0, 1.5)]);
    survivor
        .writer()
        .unwrap()
        .submit(samples([sample(0, 1, 2.5)]))
        .await
        .unwrap();
}

#[tokio::test]
async fn batches_that_wait_share_a_commit() {
    const BATCHES: u64 = 200;
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let before = commits(&path);
    let waiting: Vec<_> = (0..BATCHES)
        .map(|i| {
            let writer = store.writer().unwrap();
            tokio::spawn(async move { writer.submit(samples([sample(0, i, 1.0)])).await })
        })
        .collect();
    for one in waiting {
        assert_eq!(one.await.unwrap().unwrap().new_rows, 1);
    }
    let spent = commits(&path) - before;
    assert!(
        spent <= BATCHES as usize / 10,
        "{spent} commits for {BATCHES} batches"
    );

    let alone = commits(&path);
    store
        .writer()
        .unwrap()
        .submit(samples([sample(0, BATCHES, 1.0)]))
        .await
        .unwrap();
    assert_eq!(
        commits(&path),
        alone + 1,
        "a lone batch does not wait for company"
    );
}

/// The number of transactions in the log: frames with a non-zero commit size in bytes 4 to 8 of
/// their header, <https://www.sqlite.org/fileformat2.html> 4.1.
fn commits(path: &Path) -> usize {
    let log = fs::read(beside(path, "-wal")).unwrap();
    let page = u32::from_be_bytes(log[8..12].try_into().unwrap()) as usize;
    log[32..]
        .chunks_exact(24 + page)
        .filter(|frame| frame[4..8] != [0; 4])
        .count()
}

#[tokio::test]
async fn batches_that_share_a_commit_have_receipts_of_their_own() {
    let (_folder, path) = folder();
    let store = store_with(&path, 3).await;
    let failure = |job: u64| FailureRow {
        stream: of(job),
        sample: None,
        shared: false,
        lease: 1,
        worker: "w".into(),
        serial: None,
        kind: FailureKind::Failure,
        error: "no".into(),
        at_unix_ms: None,
    };
    // Every batch has one sample of its own, one shared with its neighbour, and rows common to all.
    // Every tenth contradicts a stored row.
    let batch = |i: u64| Batch {
        criteria: vec![feasible(0)],
        times: vec![JobTimeRow {
            stream: of(0),
            part: i / 2,
            cpu_seconds: i as f64,
        }],
        failures: vec![failure(i)],
        ..samples([
            sample(0, i, 1.0),
            sample(1, i / 2, 1.0),
            sample(2, 0, if i % 10 == 9 { 2.0 } else { 1.0 }),
        ])
    };
    const BATCHES: u64 = 100;
    let waiting: Vec<_> = (0..BATCHES)
        .map(|i| {
            let (writer, batch) = (store.writer().unwrap(), batch(i));
            tokio::spawn(async move { writer.submit(batch).await })
        })
        .collect();
    let mut total = Receipt::default();
    for (i, one) in waiting.into_iter().enumerate() {
        match one.await.unwrap() {
            Ok(receipt) => {
                assert_eq!(receipt.new_rows + receipt.duplicate_rows, 5, "batch {i}");
                // Its own sample and its failure are new, whichever batch stored the others.
                assert!(receipt.new_rows >= 2, "batch {i}: {receipt:?}");
                total.new_rows += receipt.new_rows;
                total.duplicate_rows += receipt.duplicate_rows;
            }
            Err(error) => {
                assert!(
                    matches!(&error, Error::Conflict { row, .. } if row == "sample 0 of design-2"),
                    "{error}"
                );
                assert_eq!(i % 10, 9, "batch {i} is not to blame");
            }
        }
    }
    // 90 batches with a sample and a failure each; a sample for each of 50 pairs, none of which is
    // refused entirely; and the criteria and the sample common to all. Times are not counted.
    assert_eq!(total.new_rows, 2 * 90 + 50 + 2);
    assert_eq!(total.duplicate_rows, 5 * 90 - total.new_rows);
    let progress = store.progress().await.unwrap();
    assert_eq!((progress.samples, progress.failures), (90 + 50 + 1, 90));
    assert_eq!(store.failures().await.unwrap().len(), 90);
    assert_eq!(store.job_times().await.unwrap().len(), 50);
    store.visit_samples(|_| Ok::<(), Error>(())).await.unwrap();
}

#[tokio::test]
async fn a_caller_that_goes_away_stops_nothing() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    for i in 0..50 {
        let writer = store.writer().unwrap();
        let caller = tokio::spawn(async move {
            writer
                .submit(samples((0..500).map(|j| sample(0, i * 500 + j, 1.0))))
                .await
        });
        tokio::task::yield_now().await;
        caller.abort();
    }
    store.close().await.unwrap();
    let store = open(&path).await;
    let held = store.progress().await.unwrap().samples;
    assert!(
        held > 0,
        "at least one was queued before its caller went away"
    );
    assert_eq!(held % 500, 0, "whole batches only");
}

#[tokio::test]
async fn a_second_coordinator_is_locked_out_until_the_first_is_gone() {
    let (folder, path) = folder();
    let store = store_with(&path, 1).await;
    let again = Store::create_or_open(&path, &campaign()).await;
    assert!(matches!(again, Err(Error::Locked { .. })));
    #[cfg(unix)]
    {
        let link = folder.path().join("link.db");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        let again = Store::create_or_open(&link, &campaign()).await;
        assert!(
            matches!(again, Err(Error::Locked { .. })),
            "by another name too"
        );
    }
    assert_eq!(
        store.designs().await.unwrap().len(),
        1,
        "the first goes on undisturbed"
    );

    let writer = store.writer().unwrap();
    store.close().await.unwrap();
    assert!(
        !beside(&path, "-wal").exists(),
        "the log is moved into the file"
    );
    store.close().await.unwrap();
    let late = writer.submit(samples([sample(0, 0, 1.0)])).await;
    assert!(matches!(late, Err(Error::Closed)));
    assert!(matches!(store.designs().await, Err(Error::Closed)));
    let store = open(&path).await;
    assert_eq!(store.designs().await.unwrap().len(), 1);
    drop(folder);
}

#[tokio::test]
async fn dropping_the_store_commits_and_gives_the_lock_back() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let writer = store.writer().unwrap();
    drop(store);
    let held = Store::create_or_open(&path, &campaign()).await;
    assert!(
        matches!(held, Err(Error::Locked { .. })),
        "its writer is still about"
    );
    writer.submit(samples([sample(0, 0, 1.0)])).await.unwrap();
    drop(writer);
    // The task ends by itself a moment later.
    let store = loop {
        match Store::create_or_open(&path, &campaign()).await {
            Err(Error::Locked { .. }) => {
                tokio::time::sleep(std::time::Duration::from_millis(5)).await;
            }
            other => break other.unwrap(),
        }
    };
    assert_eq!(samples_of(&store, of(0)).await.unwrap(), [(0, 1.0)]);
}
