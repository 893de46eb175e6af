//! States of unfinished optimiser runs.

use store::{Batch, Error, OptimiserRunRow, RunStateRow, Store};

use crate::{folder, open};

const RUN: &str = "run no-wear 1";

pub(crate) fn state(generation: u64, evaluations: u64) -> RunStateRow {
    RunStateRow {
        stream: RUN.to_owned(),
        generation,
        build: "0123".to_owned(),
        evaluations,
        cpu_seconds: 1.5,
        state: evaluations.to_le_bytes().to_vec(),
    }
}

pub(crate) async fn put(store: &Store, row: RunStateRow) -> (u64, bool) {
    let batch = Batch {
        only_for: Some((row.stream.clone(), row.generation)),
        states: vec![row],
        ..Batch::default()
    };
    let receipt = store.writer().unwrap().submit(batch).await.unwrap();
    (receipt.new_rows, receipt.is_stale)
}

async fn want(store: &Store, generation: u64) {
    let wanted = [(RUN.to_owned(), generation)];
    store.put_generations(&wanted).await.unwrap();
}

#[tokio::test]
async fn the_latest_state_of_the_wanted_generation_is_held_until_the_run_is_stored() {
    let (_folder, path) = folder();
    let store = open(&path).await;
    let held = async || store.run_state(RUN).await.unwrap();
    assert_eq!(put(&store, state(u64::MAX, 10)).await, (0, true), "unasked");
    want(&store, u64::MAX).await;
    assert_eq!(put(&store, state(u64::MAX, 20)).await, (1, false));
    // Of two workers that compute it, one is behind.
    assert_eq!(put(&store, state(u64::MAX, 10)).await, (0, false));
    assert_eq!(held().await, Some(state(u64::MAX, 20)));
    assert_eq!(put(&store, state(u64::MAX, 30)).await, (1, false));
    let rebuilt = RunStateRow {
        build: "4567".to_owned(),
        ..state(u64::MAX, 10)
    };
    assert_eq!(put(&store, rebuilt.clone()).await, (1, false));
    assert_eq!(held().await, Some(rebuilt), "another build begins anew");
    assert_eq!(store.run_state("run no-wear 11").await.unwrap(), None);

    want(&store, 2).await;
    assert_eq!(held().await, None, "other inputs");
    assert_eq!(put(&store, state(2, 10)).await, (1, false));
    let run = |start| OptimiserRunRow {
        approach: "no-wear".to_owned(),
        start,
        result_json: "{}".to_owned(),
        simulator_calls: 1,
        cpu_seconds: 1.0,
    };
    let finish = async |start| {
        let batch = Batch {
            runs: vec![run(start)],
            ..Batch::default()
        };
        store.writer().unwrap().submit(batch).await.unwrap();
    };
    finish(0).await;
    finish(11).await;
    assert!(held().await.is_some(), "other runs");
    finish(1).await;
    assert_eq!(held().await, None, "it is finished");
    assert_eq!(put(&store, state(2, 20)).await, (0, false), "too late");

    store.clear_derived(&["no-wear"]).await.unwrap();
    want(&store, 3).await;
    assert_eq!(put(&store, state(3, 10)).await, (1, false));
    store.clear_derived(&["kriging"]).await.unwrap();
    assert!(held().await.is_some());
    store.clear_derived(&["no-wear"]).await.unwrap();
    assert_eq!(held().await, None);
}

#[tokio::test]
async fn a_state_that_is_too_large_is_refused() {
    let (_folder, path) = folder();
    let store = open(&path).await;
    let submit = async |row| {
        let batch = Batch {
            states: vec![row],
            ..Batch::default()
        };
        store.writer().unwrap().submit(batch).await
    };
    let of = |bytes| RunStateRow {
        state: vec![1; bytes],
        ..state(1, 10)
    };
    submit(of(1 << 20)).await.unwrap();
    for bytes in [0, (1 << 20) + 1] {
        let row = RunStateRow {
            evaluations: 20,
            ..of(bytes)
        };
        let error = submit(row).await.unwrap_err();
        assert!(
            error.is_refusal() && matches!(error, Error::Constraint { .. }),
            "{error}"
        );
    }
    let evaluations = u64::MAX;
    let error = submit(state(1, evaluations)).await.unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }), "{error}");
    let error = submit(RunStateRow {
        cpu_seconds: f64::NAN,
        ..state(1, 20)
    });
    let error = error.await.unwrap_err();
    assert!(matches!(error, Error::NotFinite { .. }), "{error}");
    assert_eq!(store.run_state(RUN).await.unwrap(), Some(of(1 << 20)));
}
