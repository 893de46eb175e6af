//! Origins of rows, and the removal of what a worker delivered.

use ledger::StreamId;
use store::{
    Batch, Discard, Error, FailureKind, FailureRow, OriginRow, RemovedRows, SampleBlock, Store,
};

use crate::{POINT, at, feasible, folder, infeasible, of, open, sample, samples, store_with};

fn from(worker: &str, host: &str, batch: Batch) -> Batch {
    let origin = OriginRow {
        worker: worker.into(),
        host: host.into(),
        build: "1".into(),
    };
    Batch {
        origin: Some(origin),
        ..batch
    }
}

fn part(first: u64) -> Batch {
    samples((first..first + 10).map(|i| sample(0, i, 1.0 + i as f64)))
}

/// The stream, the first sample, the number of samples and the worker of each block.
async fn blocks(store: &Store) -> Vec<(StreamId, u64, usize, Option<String>)> {
    let mut blocks = Vec::new();
    let visit = |block: &SampleBlock, origin: Option<&OriginRow>| {
        let worker = origin.map(|origin| origin.worker.clone());
        blocks.push((
            block.stream,
            block.first_sample,
            block.samples.len(),
            worker,
        ));
        Ok::<(), Error>(())
    };
    store.visit_blocks(visit).await.unwrap();
    blocks
}

#[tokio::test]
async fn what_a_host_delivered_is_removed_and_can_be_stored_again() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    let writer = store.writer().unwrap();
    let broken = Batch {
        criteria: vec![infeasible(1)],
        ..part(10)
    };
    let first = Batch {
        criteria: vec![feasible(0)],
        ..part(0)
    };
    // At once, so that neighbouring samples could share a block.
    let (one, two, three, four) = tokio::join!(
        writer.submit(from("a", "good", first)),
        writer.submit(from("b", "bad", broken.clone())),
        writer.submit(from("a", "good", part(20))),
        writer.submit(from("c", "bad", samples([at(POINT, 0, 2.0)]))),
    );
    for receipt in [one, two, three, four] {
        receipt.unwrap();
    }
    let named = |worker: &str| Some(worker.to_owned());
    assert_eq!(
        blocks(&store).await,
        [
            (of(0), 0, 10, named("a")),
            (of(0), 10, 10, named("b")),
            (of(0), 20, 10, named("a")),
            (POINT, 0, 1, named("c")),
        ]
    );
    let whole = store.samples_digest().await.unwrap();

    let bad = Discard::Worker("bad".into());
    let removed = RemovedRows {
        samples: 11,
        criteria: 1,
        ..RemovedRows::default()
    };
    assert_eq!(store.discard(&bad, true).await.unwrap(), removed);
    assert_eq!(blocks(&store).await.len(), 4, "they were only counted");
    assert_eq!(store.discard(&bad, false).await.unwrap(), removed);
    let left = [(of(0), 0, 10, named("a")), (of(0), 20, 10, named("a"))];
    assert_eq!(blocks(&store).await, left);
    assert_eq!(store.criteria().await.unwrap(), [feasible(0)]);
    assert_ne!(store.samples_digest().await.unwrap(), whole);
    store.close().await.unwrap();

    // The tallies fit.
    let store = open(&path).await;
    let writer = store.writer().unwrap();
    let again = writer.submit(from("d", "good", broken)).await.unwrap();
    assert_eq!(again.new_rows, 11);
    assert_eq!(store.samples_digest().await.unwrap(), whole);
    let removed = store.discard(&Discard::Design(0), false).await.unwrap();
    assert_eq!((removed.samples, removed.criteria), (30, 1));
    assert_eq!(blocks(&store).await, []);
    let unknown = Discard::Worker("unknown".into());
    let none = store.discard(&unknown, false).await.unwrap();
    assert_eq!(none, RemovedRows::default());
    store.close().await.unwrap();
    open(&path).await;
}

#[tokio::test]
async fn the_failures_of_a_discarded_design_are_removed_and_the_others_counted() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    let failure = |design: u64, serial: u64| FailureRow {
        stream: of(design),
        sample: None,
        shared: false,
        lease: 1,
        worker: "w".into(),
        serial: Some(serial),
        kind: FailureKind::Failure,
        error: format!("no contact at {serial} mm"),
        at_unix_ms: None,
    };
    let failures = vec![failure(0, 1), failure(1, 2), failure(0, 3), failure(1, 4)];
    let batch = Batch {
        failures: failures.clone(),
        ..part(0)
    };
    store.writer().unwrap().submit(batch).await.unwrap();
    store.discard(&Discard::Design(0), true).await.unwrap();
    assert_eq!(store.failures().await.unwrap(), failures, "only counted");
    store.discard(&Discard::Design(0), false).await.unwrap();
    let kept = [failures[1].clone(), failures[3].clone()];
    assert_eq!(store.failures().await.unwrap(), kept);
    let groups = store.failure_groups().await.unwrap();
    assert_eq!((groups.len(), groups[0].count), (1, 2));
    assert_eq!(groups[0].last_error, "no contact at 4 mm");
}
