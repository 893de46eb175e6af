//! The process ends at a fail point. Afterwards its acknowledged rows are stored exactly once.
//!
//! A child process ends: this test program, told to run only the ignored test below.

use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::{Command, Output};

use store::{Batch, Error, FailPoint, Store};

use crate::{folder, of, open, sample, samples, samples_of, store_with};

const BATCHES: u64 = 8;
const ROWS: u64 = 2000;
const SIGABRT: i32 = 6;

fn batch(index: u64) -> Batch {
    samples((0..ROWS).map(|i| sample(0, index * ROWS + i, i as f64)))
}

/// Run by the other tests, see [`run_child`].
#[expect(clippy::print_stderr, reason = "how the child tells its parent")]
#[expect(clippy::disallowed_methods, reason = "how the parent tells its child")]
#[tokio::test]
#[ignore = "the other tests run it: cargo test --workspace --test it fail_points"]
async fn child() {
    let point = std::env::var("FAIL_POINT").expect("set by the parent");
    point.parse::<FailPoint>().unwrap().set();
    let path = std::env::var_os("STORE_UNDER_TEST").expect("set by the parent");
    let store = open(Path::new(&path)).await;
    let writer = store.writer().unwrap();
    for index in 0..BATCHES {
        writer.submit(batch(index)).await.unwrap();
        eprintln!("acknowledged");
    }
    store.close().await.unwrap();
    eprintln!("closed");
}

/// Runs the child. Returns the number of acknowledged batches, and whether the child was killed.
fn run_child(path: &Path, fail_point: &str) -> (u64, bool) {
    let Output { status, stderr, .. } = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "fail_points::child", "--ignored", "--nocapture"])
        .env("STORE_UNDER_TEST", path)
        .env("FAIL_POINT", fail_point)
        .output()
        .unwrap();
    let stderr = String::from_utf8(stderr).unwrap();
    let killed = status.signal() == Some(SIGABRT);
    assert!(
        killed || stderr.contains("closed"),
        "{fail_point}: {stderr}"
    );
    let acknowledged = stderr.matches("acknowledged").count();
    (acknowledged as u64, killed)
}

/// The number of stored batches, after checking that all are whole and nothing else is stored.
async fn held_batches(store: &Store) -> u64 {
    let held = store.progress().await.unwrap().samples;
    assert_eq!(held % ROWS, 0, "part of a batch");
    let rows = samples_of(store, of(0)).await.unwrap();
    let expected: Vec<(u64, f64)> = (0..held).map(|i| (i, (i % ROWS) as f64)).collect();
    assert_eq!(rows, expected);
    store.visit_samples(|_| Ok::<(), Error>(())).await.unwrap();
    held / ROWS
}

/// The store's digest after an uninterrupted run.
async fn undisturbed() -> String {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    for index in 0..BATCHES {
        store.writer().unwrap().submit(batch(index)).await.unwrap();
    }
    store.samples_digest().await.unwrap()
}

/// Submits all batches again: missing rows are stored, the others are duplicates.
async fn finish(path: &Path, held: u64) {
    let store = open(path).await;
    assert_eq!(held_batches(&store).await, held);
    let mut new_rows = 0;
    for index in 0..BATCHES {
        let receipt = store.writer().unwrap().submit(batch(index)).await.unwrap();
        new_rows += receipt.new_rows;
    }
    assert_eq!(new_rows, (BATCHES - held) * ROWS);
    assert_eq!(store.samples_digest().await.unwrap(), undisturbed().await);
}

#[tokio::test]
async fn killed_before_a_commit() {
    let (_folder, path) = folder();
    store_with(&path, 1).await.close().await.unwrap();
    let child = run_child(&path, "before_commit:3");
    assert_eq!(child, (3, true));
    finish(&path, 3).await;
}

#[tokio::test]
async fn killed_between_commit_and_acknowledgement() {
    let (_folder, path) = folder();
    store_with(&path, 1).await.close().await.unwrap();
    let child = run_child(&path, "after_commit:3");
    assert_eq!(child, (3, true));
    finish(&path, 4).await;
}

#[tokio::test]
async fn killed_during_a_checkpoint() {
    let mut crashes = 0;
    for microseconds in [0, 100, 400, 1500] {
        let (_folder, path) = folder();
        store_with(&path, 1).await.close().await.unwrap();
        let point = format!("checkpoint:0:{microseconds}");
        let (acknowledged, killed) = run_child(&path, &point);
        // With a long delay the child may end before it is killed.
        crashes += u32::from(killed);
        assert_eq!(acknowledged, BATCHES);
        finish(&path, BATCHES).await;
    }
    assert!(crashes > 0, "no child was killed in time");
}

#[tokio::test]
async fn killed_while_the_store_is_made() {
    let (_folder, path) = folder();
    assert_eq!(run_child(&path, "creation"), (0, true));
    assert!(!path.exists());
    open(&path).await.close().await.unwrap();
    Store::open_read_only(&path).await.unwrap();
}
