//! An extended campaign loses the results derived from the smaller sampling and keeps its samples.

use std::collections::BTreeMap;

use store::{
    Batch, CampaignRow, Error, MissingWork, ModelRow, OptimiserRunRow, OptimumRow, ResponseRow,
    Store, VerifyRow,
};

use crate::{campaign, design, feasible, folder, read, sample, store_with};

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
    let of = |approach: &str| approach.to_owned();
    let batch = Batch {
        criteria: vec![feasible(0), feasible(1)],
        samples: rows.collect(),
        verify: ["kriging", "paper"]
            .into_iter()
            .flat_map(|approach| {
                (0..5).map(move |sample| VerifyRow {
                    approach: approach.into(),
                    sample,
                    delta_ste_um: 0.5,
                })
            })
            .collect(),
        runs: ["deterministic", "kriging"]
            .map(|approach| OptimiserRunRow {
                approach: of(approach),
                start: 0,
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
        mean_um: 1.5,
        sd_um: 0.0,
        p90_um: 1.5,
        p90_variance_um2: 0.0,
        lilliefors_p: None,
    };
    store.put_responses(&[response], 0).await.unwrap();
    let model = ModelRow {
        name: "p90".into(),
        json: "{}".into(),
        summary_json: "{}".into(),
    };
    store.put_model(&model).await.unwrap();
    for approach in ["deterministic", "kriging"] {
        let optimum = OptimumRow {
            approach: of(approach),
            x_json: "{}".into(),
            criterion_um: 1.0,
            feasible: true,
            criteria_json: "{}".into(),
            simulator_calls: 1,
            cpu_seconds: 1.0,
            note: String::new(),
        };
        store.put_optimum(&optimum).await.unwrap();
    }
}

async fn approaches(store: &Store) -> [Vec<String>; 3] {
    let runs = store.optimiser_runs().await.unwrap();
    let optima = store.optima().await.unwrap();
    let verified = store.verify_counts().await.unwrap();
    [
        runs.into_iter().map(|run| run.approach).collect(),
        optima.into_iter().map(|optimum| optimum.approach).collect(),
        verified.into_iter().map(|(approach, _)| approach).collect(),
    ]
}

#[tokio::test]
async fn an_extension_keeps_samples_and_clears_what_was_derived() {
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

    store.extend(&larger(), &["kriging"]).await.unwrap();
    let expected = CampaignRow {
        program_version: campaign().program_version,
        model_digest: Some("abc".into()),
        ..larger()
    };
    assert_eq!(store.campaign().await.unwrap(), expected);
    assert_eq!(store.responses().await.unwrap(), []);
    assert_eq!(store.models().await.unwrap(), []);
    assert_eq!(
        approaches(&store).await,
        [vec!["deterministic"], vec!["deterministic"], vec!["paper"]]
    );
    assert_eq!(store.progress().await.unwrap().verify_samples, 5);
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

    // The same approach with another result: the old one was removed.
    let verify = VerifyRow {
        approach: "kriging".into(),
        sample: 0,
        delta_ste_um: 0.75,
    };
    let batch = Batch {
        verify: vec![verify],
        ..Batch::default()
    };
    store.writer().unwrap().submit(batch).await.unwrap();
    assert_eq!(
        store.verify_counts().await.unwrap(),
        [("kriging".to_owned(), 1), ("paper".to_owned(), 5)]
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
    let error = store.extend(&other, &["kriging"]).await.unwrap_err();
    assert!(
        matches!(
            error,
            Error::OtherSeed {
                held: u64::MAX,
                offered: 7
            }
        ),
        "{error}"
    );
    assert_eq!(store.campaign().await.unwrap(), campaign());
    assert_eq!(store.models().await.unwrap().len(), 1, "nothing is cleared");
}

#[tokio::test]
async fn derived_results_can_be_cleared_alone() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    finished(&store).await;
    let digest = store.samples_digest().await.unwrap();
    store
        .clear_derived(&["kriging", "deterministic", "paper"])
        .await
        .unwrap();
    assert_eq!(
        approaches(&store).await,
        [const { Vec::<String>::new() }; 3]
    );
    assert_eq!(store.responses().await.unwrap(), []);
    assert_eq!(store.models().await.unwrap(), []);
    assert_eq!(store.campaign().await.unwrap(), campaign());
    assert_eq!(store.samples_digest().await.unwrap(), digest);
    assert_eq!(store.progress().await.unwrap().samples, 6);
}
