//! The first write wins.

use ledger::StreamId;
use store::{
    Batch, DerivedResult, Error, FailureKind, FailureRow, JobTimeRow, OptimiserRunRow, Receipt,
    Store,
};

use crate::{
    POINT, at, design, feasible, folder, of, open, receipt, sample, samples, samples_of,
    store_with, values_of,
};

#[tokio::test]
async fn the_same_rows_again_are_duplicates() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    let batch = Batch {
        criteria: vec![feasible(1)],
        samples: (0..2500)
            .map(|i| sample(1, i, i as f64))
            .chain([at(POINT, 0, 1.0)])
            .collect(),
        runs: vec![run(0, "{}")],
        times: vec![JobTimeRow {
            stream: of(1),
            part: 3,
            cpu_seconds: 0.25,
        }],
        failures: Vec::new(),
        evaluations: vec![],
        derivations: vec![],
        only_for: None,
        origin: None,
    };
    let writer = store.writer().unwrap();
    writer.submit(batch.clone()).await.unwrap();
    // Times are not counted.
    let rows = batch.len() as u64 - 1;
    let again = writer.submit(batch).await.unwrap();
    assert_eq!(again, receipt(0, rows));

    let mixed = samples((2400..2600).map(|i| sample(1, i, i as f64)));
    let stored = writer.submit(mixed).await.unwrap();
    assert_eq!(stored, receipt(100, 100));
    let twice = samples([sample(0, 0, 1.0), sample(0, 0, 1.0)]);
    let stored = writer.submit(twice).await.unwrap();
    assert_eq!(stored, receipt(1, 1));
    let stored = store.put_designs(&[design(1), design(2)]).await.unwrap();
    assert_eq!(stored, receipt(1, 1));
    assert_eq!(
        writer.submit(Batch::default()).await.unwrap(),
        Receipt::default()
    );
}

#[tokio::test]
async fn another_value_for_a_sample_is_refused_with_its_whole_batch() {
    let (_folder, path) = folder();
    let store = store_with(&path, 4).await;
    let writer = store.writer().unwrap();
    writer.submit(samples([sample(3, 17, 1.5)])).await.unwrap();

    // The smallest possible difference.
    let other = f64::from_bits(1.5_f64.to_bits() + 1);
    let bad = samples([sample(0, 0, 1.0), sample(3, 17, other), sample(0, 1, 1.0)]);
    // Queued together, so that they share a transaction.
    let (before, refused, after) = tokio::join!(
        writer.submit(samples([sample(1, 0, 1.0)])),
        writer.submit(bad),
        writer.submit(samples([sample(2, 0, 1.0)])),
    );
    assert_eq!(before.unwrap().new_rows, 1);
    assert_eq!(after.unwrap().new_rows, 1);
    let error = refused.unwrap_err();
    assert!(error.is_refusal());
    let Error::Conflict {
        row,
        stored,
        offered,
        ..
    } = error
    else {
        panic!("another error: {error}")
    };
    assert_eq!(row, "sample 17 of design-3");
    assert_eq!([stored, offered], ["1.5", "1.5000000000000002"]);
    assert_eq!(
        samples_of(&store, of(3)).await.unwrap(),
        [(17, 1.5)],
        "never overwritten"
    );
    assert_eq!(
        samples_of(&store, of(0)).await.unwrap(),
        [],
        "all or nothing"
    );
    assert_eq!(store.progress().await.unwrap().samples, 3);

    let contradicts_itself = samples([sample(0, 0, 1.0), sample(0, 0, 2.0)]);
    let error = writer.submit(contradicts_itself).await.unwrap_err();
    assert!(
        matches!(
            &error,
            Error::Conflict { row, .. } if row == "sample 0 of design-0"
        ),
        "{error}"
    );
    assert_eq!(store.progress().await.unwrap().samples, 3);
}

#[tokio::test]
async fn another_value_for_anything_computed_is_refused() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let writer = store.writer().unwrap();
    let verify = |value| samples([at(POINT, 4, value)]);
    let runs = |row| Batch {
        runs: vec![row],
        ..Batch::default()
    };
    let criteria = |row| Batch {
        criteria: vec![row],
        ..Batch::default()
    };
    writer.submit(verify(1.0)).await.unwrap();
    writer.submit(runs(run(2, "{}"))).await.unwrap();
    writer.submit(criteria(feasible(0))).await.unwrap();
    store.pin_model_digest("abc").await.unwrap();
    store.pin_model_digest("abc").await.unwrap();

    let names = |error: Error, words: &[&str]| {
        assert!(matches!(error, Error::Conflict { .. }), "{error}");
        let said = error.to_string();
        let missing = words.iter().find(|word| !said.contains(**word));
        assert_eq!(missing, None, "{said}");
    };
    let error = writer.submit(verify(2.0)).await.unwrap_err();
    names(error, &["sample 4 of point-3", "as 1.0", "as 2.0"]);
    let error = writer.submit(runs(run(2, "[]"))).await.unwrap_err();
    names(error, &["run-1-2", "\"{}\"", "\"[]\""]);
    let slower = OptimiserRunRow {
        cpu_seconds: 99.0,
        ..run(2, "{}")
    };
    assert_eq!(writer.submit(runs(slower)).await.unwrap().duplicate_rows, 1);
    let mut other = feasible(0);
    other.responses = None;
    let error = writer.submit(criteria(other)).await.unwrap_err();
    names(error, &["design 0 of table criteria", "1100.0", "None"]);
    let mut other = design(0);
    other.x[5] = 1.5;
    let error = store.put_designs(&[design(1), other]).await.unwrap_err();
    names(error, &["design 0 of table design", "1.4", "1.5"]);
    assert_eq!(store.designs().await.unwrap(), [design(0)], "all or none");
    let error = store.pin_model_digest("abd").await.unwrap_err();
    assert!(
        matches!(error, Error::ModelDigestConflict { .. }),
        "{error}"
    );
}

/// An infinite sample stands for a failed one.
#[tokio::test]
async fn failed_samples_are_stored_and_read_back() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let writer = store.writer().unwrap();
    let batch = samples([
        sample(0, 0, 1.0),
        sample(0, 1, f64::INFINITY),
        at(POINT, 0, f64::NEG_INFINITY),
    ]);
    writer.submit(batch).await.unwrap();
    let tallies = store.sample_tallies().await.unwrap();
    assert_eq!([of(0), POINT].map(|stream| tallies[&stream].failed), [1, 1]);
    let held = samples_of(&store, of(0)).await.unwrap();
    assert_eq!(held, [(0, 1.0), (1, f64::INFINITY)]);
    assert_eq!(values_of(&store, POINT).await.unwrap(), [f64::NEG_INFINITY]);
    drop(writer);
    store.close().await.unwrap();
    // The digests are compared when the store is opened.
    let store = Store::open_read_only(&path).await.unwrap();
    assert_eq!(samples_of(&store, of(0)).await.unwrap(), held);
}

#[tokio::test]
async fn what_cannot_be_stored_is_refused() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let writer = store.writer().unwrap();
    for value in [f64::NAN, -f64::NAN] {
        let error = writer
            .submit(samples([sample(0, 5, value)]))
            .await
            .unwrap_err();
        assert!(matches!(error, Error::NotFinite { .. }), "{error}");
        assert!(
            error.to_string().contains("sample 5 of design-0"),
            "{error}"
        );
    }
    let error = writer
        .submit(samples([sample(1, 0, 1.0)]))
        .await
        .unwrap_err();
    assert!(
        matches!(error, Error::UnknownDesign { design: 1 }),
        "{error}"
    );
    let error = writer
        .submit(samples([sample(0, u64::MAX, 1.0)]))
        .await
        .unwrap_err();
    assert!(
        matches!(
            error,
            Error::TooLarge {
                value: u64::MAX,
                ..
            }
        ),
        "{error}"
    );
    let mut criteria = feasible(0);
    criteria.responses = Some(vec![1.0, f64::NAN]);
    let batch = Batch {
        criteria: vec![criteria],
        ..Batch::default()
    };
    let error = writer.submit(batch).await.unwrap_err();
    assert!(matches!(error, Error::NotFinite { .. }), "{error}");

    assert_eq!(
        writer
            .submit(samples([sample(0, 0, 1.0)]))
            .await
            .unwrap()
            .new_rows,
        1
    );
    assert_eq!(store.progress().await.unwrap().samples, 1);
}

fn run(start: u32, result_json: &str) -> OptimiserRunRow {
    OptimiserRunRow {
        stream: StreamId::run(1, start),
        result_json: result_json.into(),
        simulator_calls: 10,
        cpu_seconds: 1.0,
    }
}

#[tokio::test]
async fn a_failure_is_stored_once_for_each_number_of_its_worker() {
    let (_folder, path) = folder();
    let store = open(&path).await;
    let failure = |worker: &str, serial| FailureRow {
        stream: of(0),
        sample: None,
        shared: false,
        lease: 1,
        worker: worker.into(),
        serial,
        kind: FailureKind::Failure,
        error: "no".into(),
        at_unix_ms: None,
    };
    let batch = Batch {
        failures: vec![
            failure("a", Some(1)),
            failure("a", Some(1)),
            failure("a", Some(2)),
            failure("b", Some(1)),
            failure("a", None),
            failure("a", None),
        ],
        ..Batch::default()
    };
    let writer = store.writer().unwrap();
    let receipt = writer.submit(batch.clone()).await.unwrap();
    assert_eq!((receipt.new_rows, receipt.duplicate_rows), (5, 1));
    let receipt = writer.submit(batch).await.unwrap();
    assert_eq!((receipt.new_rows, receipt.duplicate_rows), (2, 4));
    assert_eq!(store.failures().await.unwrap().len(), 7);
    assert_eq!(store.failure_groups().await.unwrap()[0].count, 7);
    assert!(store.knows_failure("b", 1).await.unwrap());
    assert!(!store.knows_failure("b", 2).await.unwrap());
}

/// Late samples of a replaced optimum must not be counted for the new one.
#[tokio::test]
async fn a_batch_is_stored_for_the_generation_that_is_wanted_only() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let writer = store.writer().unwrap();
    let batch = |sample, generation| Batch {
        only_for: Some((POINT, generation)),
        ..samples([at(POINT, sample, generation as f64)])
    };
    let submit = async |sample, generation| {
        let receipt = writer.submit(batch(sample, generation)).await.unwrap();
        (receipt.new_rows, receipt.is_stale)
    };
    let put = async |generation| {
        store.put_generations(&[(POINT, generation)]).await.unwrap();
    };
    let held = async || {
        let values = values_of(&store, POINT).await.unwrap();
        let tallies = store.sample_tallies().await.unwrap();
        let count = tallies.get(&POINT).map_or(0, |tally| tally.samples);
        assert_eq!(count, values.len() as u64);
        values
    };
    assert_eq!(submit(0, 1).await, (0, true), "nobody has asked for any");
    put(1).await;
    assert_eq!(submit(0, 1).await, (1, false));
    put(1).await;
    assert_eq!(submit(1, 1).await, (1, false));
    // Other batches of the same group are not affected.
    let both = tokio::join!(writer.submit(batch(2, 9)), writer.submit(batch(2, 1)));
    assert!(both.0.unwrap().is_stale && !both.1.unwrap().is_stale);
    assert_eq!(held().await, [1.0; 3]);
    // A new generation removes the samples of the old one.
    put(2).await;
    assert_eq!(held().await, [0.0; 0]);
    assert_eq!(submit(0, 1).await, (0, true));
    assert_eq!(submit(0, 2).await, (1, false));
    let removed = DerivedResult::Verification(POINT);
    store.remove(&[removed]).await.unwrap();
    assert_eq!(submit(1, 2).await, (0, true), "it was cleared");
    assert_eq!(held().await, [0.0; 0]);
}
