//! An extended campaign loses its responses and keeps the rest; outdated results are removed.

use std::collections::BTreeMap;

use ledger::StreamId;
use store::{
    Batch, CampaignRow, DerivedResult, Error, MissingWork, ModelRow, OptimiserRunRow, OptimumRow,
    ResponseRow, SampleBlock, Store,
};

use crate::{
    POINT, campaign, design, feasible, folder, put_fit, put_optimum, read, sample, store_with,
};

const RUN: StreamId = StreamId::run(3, 0);
const OTHER_RUN: StreamId = StreamId::run(1, 0);
const OPTIMUM: StreamId = StreamId::point(3);
const OTHER_OPTIMUM: StreamId = StreamId::point(1);
const REFERENCE: StreamId = StreamId::point(17);

fn larger() -> CampaignRow {
    CampaignRow {
        name: "larger".into(),
        file_text: "name = \"larger\"\n".into(),
        digest: "01ff".into(),
        program_version: "9.9.9".into(),
        ..campaign()
    }
}

/// Stores two designs with three samples each, and a row in every derived table.
async fn finished(store: &Store) {
    let rows = (0..2).flat_map(|d| (0..3).map(move |s| sample(d, s, 1.5)));
    let points = [POINT, REFERENCE].map(|stream| SampleBlock {
        stream,
        first_sample: 0,
        samples: vec![0.5; 5].into(),
    });
    let batch = Batch {
        criteria: vec![feasible(0), feasible(1)],
        samples: rows.chain(points).collect(),
        runs: [OTHER_RUN, RUN]
            .map(|stream| OptimiserRunRow {
                stream,
                result_json: "{}".into(),
                simulator_calls: 1,
                cpu_seconds: 1.0,
            })
            .into(),
        ..Batch::default()
    };
    store.writer().unwrap().submit(batch).await.unwrap();
    let response = ResponseRow {
        design: 0,
        number: 0,
        mean: 1.5,
        standard_deviation: 0.0,
        measure: 1.5,
        measure_variance: 0.0,
        lilliefors_p: None,
    };
    let model = ModelRow {
        name: ModelRow::DOE.into(),
        number: 0,
        json: "{}".into(),
        summary_json: "{}".into(),
    };
    put_fit(store, &[response], &model).await;
    for approach in [OTHER_OPTIMUM, OPTIMUM] {
        let optimum = OptimumRow {
            stream: approach,
            reason: None,
            x: Some(vec![0.5]),
            criterion: Some(1.0),
            criteria: Some(Vec::new()),
            feasible: true,
            simulator_calls: 1,
            cpu_seconds: 1.0,
            note: String::new(),
        };
        put_optimum(store, &optimum).await;
    }
}

#[tokio::test]
async fn an_extension_keeps_everything_but_the_responses() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    finished(&store).await;
    store.pin_model_digest("abc").await.unwrap();
    let digest = store.samples_digest().await.unwrap();
    store.close().await.unwrap();
    let before = read(&path);

    let refused = Store::create_or_open_with(&path, &larger(), |_| {
        Err(vec!["seed: 1 there, 2 here".to_owned()])
    })
    .await;
    let refused = refused.expect_err("another campaign");
    assert!(matches!(refused, Error::OtherCampaign { .. }));
    assert!(
        refused
            .to_string()
            .contains("they differ in seed: 1 there, 2 here: choose")
    );
    let store = Store::create_or_open_with(&path, &larger(), |held| {
        assert_eq!(held.digest, campaign().digest);
        Ok(())
    })
    .await
    .unwrap();
    assert_eq!(store.campaign().await.unwrap().digest, campaign().digest);
    assert_eq!(read(&path), before, "opening is not extending");

    store.extend(&larger()).await.unwrap();
    let expected = CampaignRow {
        program_version: campaign().program_version,
        model_digest: Some("abc".into()),
        ..larger()
    };
    assert_eq!(store.campaign().await.unwrap(), expected);
    assert_eq!(store.responses().await.unwrap(), []);
    assert!(!store.derivations().await.unwrap().contains_key("responses"));
    assert_eq!(store.models().await.unwrap().len(), 1);
    assert_eq!(store.progress().await.unwrap().point_samples, 10);
    assert_eq!(store.samples_digest().await.unwrap(), digest);
    assert_eq!(store.criteria().await.unwrap().len(), 2);

    // One more design and two more samples per design: only those are missing.
    let designs: Vec<_> = (0..3).map(design).collect();
    assert_eq!(store.put_designs(&designs).await.unwrap().new_rows, 1);
    let missing = |number, criteria, from| MissingWork {
        design: design(number),
        criteria,
        samples: std::iter::once(from..5).collect(),
    };
    assert_eq!(
        store.missing_work(5, &BTreeMap::new()).await.unwrap(),
        [
            missing(0, false, 3),
            missing(1, false, 3),
            missing(2, true, 0)
        ]
    );

    store.close().await.unwrap();
    let again = Store::create_or_open(&path, &campaign()).await;
    assert!(matches!(again, Err(Error::OtherCampaign { .. })));
    Store::create_or_open(&path, &larger()).await.unwrap();
}

#[tokio::test]
async fn another_seed_is_no_extension() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    finished(&store).await;
    let other = CampaignRow {
        seed: 7,
        ..larger()
    };
    let error = store.extend(&other).await.unwrap_err();
    assert!(
        matches!(
            error,
            Error::OtherSeed {
                stored: u64::MAX,
                offered: 7
            }
        ),
        "{error}"
    );
    assert_eq!(store.campaign().await.unwrap(), campaign());
    assert_eq!(store.models().await.unwrap().len(), 1, "nothing is cleared");
}

/// The derivations of outdated results are removed with them, and the evaluations of a run with the run.
#[tokio::test]
async fn results_are_removed_one_by_one() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    finished(&store).await;
    let digest = store.samples_digest().await.unwrap();
    let outdated = [
        DerivedResult::Model,
        DerivedResult::Run(RUN),
        DerivedResult::Optimum(OTHER_OPTIMUM),
    ];
    store.remove(&outdated).await.unwrap();
    assert_eq!(store.models().await.unwrap(), []);
    let runs = store.optimiser_runs().await.unwrap();
    let optima = store.optima().await.unwrap();
    assert_eq!((runs.len(), runs[0].stream), (1, OTHER_RUN));
    assert_eq!((optima.len(), optima[0].stream), (1, OPTIMUM));
    let derivations = store.derivations().await.unwrap();
    let left: Vec<&String> = derivations.keys().collect();
    assert_eq!(left, ["optimum point-3", "responses"]);
    assert_eq!(store.samples_digest().await.unwrap(), digest);
    assert_eq!(store.responses().await.unwrap().len(), 1);

    let samples = [DerivedResult::Samples, DerivedResult::Verification(POINT)];
    store.remove(&samples).await.unwrap();
    assert_eq!(store.samples_digest().await.unwrap(), "0".repeat(64));
    let progress = store.progress().await.unwrap();
    assert_eq!((progress.samples, progress.criteria_done), (0, 0));
    assert_eq!(progress.point_samples, 5, "those of the reference stay");
    store.close().await.unwrap();
    Store::open_read_only(&path).await.unwrap();
}
