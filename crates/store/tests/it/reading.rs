//! Rows are read as they were stored.

use std::collections::BTreeMap;

use ledger::StreamId;
use store::{
    Batch, Error, FailureGroup, FailureKind, FailureRow, JobTimeRow, MissingWork, ModelRow,
    OptimiserRunRow, OptimumRow, Progress, ResponseRow, Store,
};

use crate::{
    POINT, at, campaign, design, feasible, folder, infeasible, of, open, put_fit, put_optimum,
    receipt, sample, samples, samples_of, store_with, values_of,
};

#[tokio::test]
async fn every_table_gives_back_what_was_put() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    let batch = Batch {
        criteria: vec![feasible(0), infeasible(1)],
        samples: vec![
            sample(0, 1, 2.5),
            sample(0, 0, 1.5),
            at(POINT, 1, 0.75),
            at(POINT, 0, 0.25),
            at(StreamId::point(1 << 27), 0, 0.5),
        ],
        runs: vec![
            OptimiserRunRow {
                stream: StreamId::run(2, 1),
                result_json: "{\"x\":[1]}".into(),
                simulator_calls: 12_000,
                cpu_seconds: 3.5,
            },
            OptimiserRunRow {
                stream: StreamId::run(2, 0),
                result_json: "{}".into(),
                simulator_calls: 0,
                cpu_seconds: 0.0,
            },
        ],
        times: vec![JobTimeRow {
            stream: StreamId::run(2, 1),
            part: u64::MAX >> 1,
            cpu_seconds: 0.25,
        }],
        failures: vec![
            FailureRow {
                stream: of(1),
                sample: None,
                shared: false,
                lease: u32::MAX,
                worker: "w1".into(),
                serial: Some(u64::MAX),
                kind: FailureKind::Quarantine,
                error: "panicked".into(),
                at_unix_ms: Some(1_700_000_000_000),
            },
            FailureRow {
                stream: StreamId::run(u32::MAX >> 8, u32::MAX),
                sample: None,
                shared: true,
                lease: 1,
                worker: "w2".into(),
                serial: None,
                kind: FailureKind::Crash,
                error: String::new(),
                at_unix_ms: None,
            },
        ],
        evaluations: vec![],
        derivations: vec![],
        only_for: None,
        origin: None,
    };
    let responses = [
        ResponseRow {
            design: 0,
            number: 0,
            mean: 2.0,
            standard_deviation: 0.7,
            measure: 2.9,
            measure_variance: 0.01,
            lilliefors_p: Some(0.4),
        },
        ResponseRow {
            design: 1,
            number: 0,
            mean: 1.0,
            standard_deviation: 0.0,
            measure: 1.0,
            measure_variance: 0.0,
            lilliefors_p: None,
        },
    ];
    let model = ModelRow {
        name: ModelRow::DOE.into(),
        number: 0,
        json: "{}".into(),
        summary_json: "[]".into(),
    };
    let optimum = OptimumRow {
        stream: StreamId::point(2),
        reason: None,
        x: Some(vec![0.5, -0.25]),
        criterion: Some(0.8),
        criteria: Some(vec![1.5]),
        feasible: true,
        simulator_calls: 12_000,
        cpu_seconds: 9.25,
        note: "at a bound".into(),
    };
    // Times are not counted.
    let rows = batch.len() as u64 - 1;
    let stored = store.writer().unwrap().submit(batch.clone()).await.unwrap();
    assert_eq!(stored, receipt(rows, 0));
    put_fit(&store, &responses, &model).await;
    put_optimum(&store, &optimum).await;
    store.pin_model_digest("abc").await.unwrap();
    store.close().await.unwrap();

    let store = Store::open_read_only(&path).await.unwrap();
    let mut held = campaign();
    held.model_digest = Some("abc".into());
    assert_eq!(store.campaign().await.unwrap(), held);
    assert_eq!(store.designs().await.unwrap(), [design(0), design(1)]);
    assert_eq!(store.criteria().await.unwrap(), batch.criteria);
    assert_eq!(
        samples_of(&store, of(0)).await.unwrap(),
        [(0, 1.5), (1, 2.5)]
    );
    assert_eq!(samples_of(&store, of(1)).await.unwrap(), []);
    assert_eq!(store.responses().await.unwrap(), responses);
    assert_eq!(
        store.model(ModelRow::DOE).await.unwrap(),
        Some(model.clone())
    );
    assert_eq!(store.model("p50").await.unwrap(), None);
    assert_eq!(store.models().await.unwrap(), [model]);
    let runs = store.optimiser_runs().await.unwrap();
    assert_eq!(runs, [batch.runs[1].clone(), batch.runs[0].clone()]);
    assert_eq!(store.optima().await.unwrap(), [optimum]);
    assert_eq!(
        samples_of(&store, POINT).await.unwrap(),
        [(0, 0.25), (1, 0.75)]
    );
    assert_eq!(values_of(&store, POINT).await.unwrap(), [0.25, 0.75]);
    assert_eq!(store.job_times().await.unwrap(), batch.times);
    assert_eq!(
        store.failures().await.unwrap(),
        batch.failures,
        "in the order of reporting"
    );
    let progress = Progress {
        designs: 2,
        criteria_done: 2,
        simulable: 1,
        ruled_out: 0,
        samples: 2,
        responses: 2,
        models: 1,
        optimiser_runs: 2,
        optima: 1,
        point_samples: 3,
        evaluations: 0,
        evaluation_values: 0,
        failures: 2,
    };
    assert_eq!(store.progress().await.unwrap(), progress);
}

#[tokio::test]
async fn stages_run_again_replace_their_results() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    for value in [1.0, 2.0] {
        let response = ResponseRow {
            design: 0,
            number: 0,
            mean: value,
            standard_deviation: value,
            measure: value,
            measure_variance: value,
            lilliefors_p: None,
        };
        let model = ModelRow {
            name: "m".into(),
            number: 0,
            json: value.to_string(),
            summary_json: "{}".into(),
        };
        put_fit(&store, &[response], &model).await;
        assert_eq!(store.responses().await.unwrap(), [response]);
        assert_eq!(store.models().await.unwrap(), [model]);
    }
}

#[tokio::test]
async fn doubles_keep_every_bit_but_the_sign_of_zero() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let values = [
        0.1 + 0.2,
        1.0,
        -3.0,
        9_007_199_254_740_993.0,
        f64::MAX,
        f64::MIN_POSITIVE,
        5e-324,
        -0.0,
        1.0 + f64::EPSILON,
    ];
    let rows = values.iter().zip(0..).map(|(&v, i)| sample(0, i, v));
    let writer = store.writer().unwrap();
    writer.submit(samples(rows.clone())).await.unwrap();
    let held = samples_of(&store, of(0)).await.unwrap();
    for (&value, (index, held)) in values.iter().zip(held) {
        assert_eq!(
            held.to_bits(),
            (value + 0.0).to_bits(),
            "value {index}: {value:e}"
        );
    }
    let again = writer.submit(samples(rows)).await.unwrap();
    assert_eq!(
        again.duplicate_rows,
        values.len() as u64,
        "-0.0 is a duplicate of 0.0"
    );
}

#[tokio::test]
async fn missing_work_is_what_a_restart_has_to_do() {
    let (_folder, path) = folder();
    let store = store_with(&path, 6).await;
    let criteria = vec![
        feasible(0),
        infeasible(1),
        feasible(2),
        feasible(3),
        feasible(5),
    ];
    let rows = [
        // Design 0 has all samples and one more, 2 has gaps, 3 has a few, 4 has no criteria, 5 has
        // nothing.
        vec![
            sample(0, 0, 1.0),
            sample(0, 1, 1.0),
            sample(0, 2, 1.0),
            sample(0, 3, 1.0),
        ],
        vec![
            sample(0, 4, 1.0),
            sample(0, 9, 1.0),
            sample(2, 1, 1.0),
            sample(2, 3, 1.0),
        ],
        vec![sample(3, 0, 1.0), sample(3, 7, 1.0), sample(4, 4, 1.0)],
    ]
    .concat();
    let batch = Batch {
        criteria,
        samples: rows,
        ..Batch::default()
    };
    store.writer().unwrap().submit(batch).await.unwrap();

    let missing = |number, criteria, samples: &[(u64, u64)]| MissingWork {
        design: design(number),
        criteria,
        samples: samples.iter().map(|&(from, to)| from..to).collect(),
    };
    let expected = [
        missing(2, false, &[(0, 1), (2, 3), (4, 5)]),
        missing(3, false, &[(1, 5)]),
        missing(4, true, &[(0, 4)]),
        missing(5, false, &[(0, 5)]),
    ];
    assert_eq!(
        store.missing_work(5, &BTreeMap::new()).await.unwrap(),
        expected
    );
    assert_eq!(
        store.missing_work(0, &BTreeMap::new()).await.unwrap(),
        [missing(4, true, &[])]
    );
    let counts = store.sampled_counts().await.unwrap();
    assert_eq!(counts, [(0, 6), (1, 0), (2, 2), (3, 2), (4, 1), (5, 0)]);
}

#[tokio::test]
async fn failures_are_grouped_by_kind_and_cause() {
    let (_folder, path) = folder();
    let store = open(&path).await;
    let failure = |design: u64, worker: &str, kind, error: &str| FailureRow {
        stream: of(design),
        sample: None,
        shared: false,
        lease: 1,
        worker: worker.into(),
        serial: None,
        kind,
        error: error.into(),
        at_unix_ms: None,
    };
    let failures = vec![
        failure(1, "w1", FailureKind::Quarantine, "panicked at 17:3"),
        failure(
            1,
            "w2",
            FailureKind::Failure,
            "tip radius 1.25 mm\nat mesh 3",
        ),
        failure(2, "w1", FailureKind::Failure, "tip radius 17 mm\nat mesh 4"),
        failure(3, "w9", FailureKind::Failure, "panicked at 1:25"),
        failure(3, "w3", FailureKind::Failure, "tip radius 1.25 mm"),
        failure(4, "w4", FailureKind::Crash, ""),
    ];
    let batch = Batch {
        failures,
        ..Batch::default()
    };
    store.writer().unwrap().submit(batch).await.unwrap();
    let group = |kind, cause: &str, count, last: (&str, u64, &str)| FailureGroup {
        kind,
        cause: cause.into(),
        count,
        last_error: last.0.into(),
        last_stream: of(last.1),
        last_worker: last.2.into(),
    };
    assert_eq!(
        store.failure_groups().await.unwrap(),
        [
            group(FailureKind::Crash, "", 1, ("", 4, "w4")),
            group(
                FailureKind::Failure,
                "panicked at #:#",
                1,
                ("panicked at 1:25", 3, "w9")
            ),
            group(
                FailureKind::Failure,
                "tip radius # mm",
                3,
                ("tip radius 1.25 mm", 3, "w3")
            ),
            group(
                FailureKind::Quarantine,
                "panicked at #:#",
                1,
                ("panicked at 17:3", 1, "w1")
            ),
        ]
    );
}

#[tokio::test]
async fn a_visit_ends_with_the_visitors_error() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    store
        .writer()
        .unwrap()
        .submit(samples((0..10_000).map(|i| sample(0, i, 1.0))))
        .await
        .unwrap();
    let mut visited = 0;
    let result = store
        .visit_samples(|block| {
            visited += 1;
            if block.first_sample == 4096 {
                Err(Error::Closed)
            } else {
                Ok(())
            }
        })
        .await;
    assert!(matches!(result, Err(Error::Closed)));
    assert_eq!(visited, 2);
}

#[tokio::test]
async fn a_reader_sees_whole_batches_while_another_process_writes() {
    const BATCH: u64 = 50;
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let reader = Store::open_read_only(&path).await.unwrap();
    assert!(matches!(reader.writer(), Err(Error::ReadOnly)));
    assert!(matches!(
        reader.put_designs(&[]).await,
        Err(Error::ReadOnly)
    ));

    let writer = store.writer().unwrap();
    let writing = tokio::spawn(async move {
        for batch in 0..40 {
            let rows = (0..BATCH).map(|i| sample(0, batch * BATCH + i, 1.0));
            writer.submit(samples(rows)).await.unwrap();
        }
    });
    let mut seen = 0;
    while !writing.is_finished() {
        let now = reader.progress().await.unwrap().samples;
        assert!(now >= seen && now % BATCH == 0, "{seen} then {now}");
        seen = now;
        tokio::task::yield_now().await;
    }
    writing.await.unwrap();
    assert_eq!(reader.progress().await.unwrap().samples, 40 * BATCH);
}

#[tokio::test]
async fn a_snapshot_sees_one_moment() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    let snapshot = store.snapshot().await.unwrap();
    assert_eq!(snapshot.designs().await.unwrap().len(), 2);
    let batch = Batch {
        criteria: vec![feasible(0)],
        samples: vec![sample(0, 0, 1.5)],
        ..Batch::default()
    };
    store.writer().unwrap().submit(batch).await.unwrap();
    assert_eq!(store.sampled_counts().await.unwrap(), [(0, 1), (1, 0)]);
    assert_eq!(snapshot.sampled_counts().await.unwrap(), [(0, 0), (1, 0)]);
    assert_eq!(snapshot.criteria().await.unwrap(), []);
    let mut visited = 0;
    let visit = snapshot.visit_samples(|_| {
        visited += 1;
        Ok::<(), store::Error>(())
    });
    visit.await.unwrap();
    assert_eq!(visited, 0);
    assert!(matches!(
        snapshot.put_designs(&[design(2)]).await,
        Err(store::Error::ReadOnly)
    ));
    drop(snapshot);
    store.close().await.unwrap();
}
