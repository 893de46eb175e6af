//! Evaluations of optimiser runs on an external simulator.

use ledger::StreamId;
use store::{Batch, DerivedResult, Error, EvaluationRow, Store};

use crate::{execute, folder, open};

const RUN: StreamId = StreamId::run(1, 1);
const OTHER: StreamId = StreamId::run(1, 11);

pub(crate) fn evaluation(number: u64) -> EvaluationRow {
    EvaluationRow {
        stream: RUN,
        evaluation: number,
        x: vec![0.5, number as f64],
        refused: None,
        value: Some(1.25),
        criteria: Some(vec![1.5, -2.0]),
        worn_criteria: None,
        samples: Some(vec![1.0, 2.0]),
    }
}

pub(crate) async fn put(
    store: &Store,
    generation: u64,
    rows: Vec<EvaluationRow>,
) -> Result<(u64, u64, bool), Error> {
    let batch = Batch {
        only_for: Some((RUN, generation)),
        evaluations: rows,
        ..Batch::default()
    };
    let receipt = store.writer().unwrap().submit(batch).await?;
    Ok((receipt.new_rows, receipt.duplicate_rows, receipt.is_stale))
}

pub(crate) async fn want(store: &Store, generation: u64) {
    let wanted = [(RUN, generation)];
    store.put_generations(&wanted).await.unwrap();
}

#[tokio::test]
async fn evaluations_of_one_generation_stay_when_the_next_is_wanted() {
    let (_folder, path) = folder();
    let store = open(&path).await;
    let first = || vec![evaluation(0), evaluation(1)];
    assert_eq!(
        put(&store, 1, first()).await.unwrap(),
        (0, 0, true),
        "unasked"
    );
    want(&store, 1).await;
    assert_eq!(put(&store, 1, first()).await.unwrap(), (2, 0, false));
    assert_eq!(put(&store, 1, first()).await.unwrap(), (0, 2, false));
    want(&store, 2).await;
    assert_eq!(
        put(&store, 1, vec![evaluation(9)]).await.unwrap(),
        (0, 0, true)
    );
    let refused = EvaluationRow {
        refused: Some("involute: no".to_owned()),
        value: None,
        criteria: None,
        samples: None,
        ..evaluation(2)
    };
    let bare = EvaluationRow {
        criteria: Some(Vec::new()),
        ..evaluation(3)
    };
    let second = vec![refused, bare];
    assert_eq!(put(&store, 2, second.clone()).await.unwrap(), (2, 0, false));
    assert_eq!(store.evaluations(RUN, 2).await.unwrap(), second);
    assert_eq!(store.evaluations(RUN, 0).await.unwrap()[..2], first());
    assert_eq!(store.evaluations(OTHER, 0).await.unwrap(), []);

    let other = EvaluationRow {
        value: Some(1.5),
        ..evaluation(1)
    };
    let error = put(&store, 2, vec![other]).await.unwrap_err();
    assert!(error.is_refusal(), "{error}");
    assert!(
        error.to_string().contains("evaluation 1 of run-1-1"),
        "{error}"
    );
    let error = put(
        &store,
        2,
        vec![EvaluationRow {
            samples: Some(vec![f64::NAN]),
            ..evaluation(4)
        }],
    );
    let error = error.await.unwrap_err();
    assert!(matches!(error, Error::NotFinite { .. }), "{error}");

    store.clear_evaluations(OTHER).await.unwrap();
    assert_eq!(store.evaluations(RUN, 0).await.unwrap().len(), 4);
    store.clear_evaluations(RUN).await.unwrap();
    assert_eq!(store.evaluations(RUN, 0).await.unwrap(), []);
    want(&store, 3).await;
    put(&store, 3, first()).await.unwrap();
    store.remove(&[DerivedResult::Run(OTHER)]).await.unwrap();
    assert_eq!(store.evaluations(RUN, 0).await.unwrap(), first());
    store.remove(&[DerivedResult::Run(RUN)]).await.unwrap();
    assert_eq!(store.evaluations(RUN, 0).await.unwrap(), []);
}

#[tokio::test]
async fn an_evaluation_that_changed_on_the_disk_is_refused_by_its_name() {
    let (_folder, path) = folder();
    let store = open(&path).await;
    want(&store, 1).await;
    put(&store, 1, vec![evaluation(0)]).await.unwrap();
    store.close().await.unwrap();
    execute(&path, "UPDATE evaluation SET value = 1.26").await;
    let error = Store::open_read_only(&path).await.unwrap_err();
    let said = error.to_string();
    assert!(
        said.contains("evaluation") && said.contains("run-1-1"),
        "{said}"
    );
}
