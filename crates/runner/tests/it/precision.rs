//! A small campaign that samples to a precision, in this process.

use std::collections::BTreeMap;
use std::future::pending;
use std::time::Duration;

use ledger::{StreamId, Unit};
use runner::coordinator::engine::CampaignEnd;
use store::{Derivation, OptimumRow, ResponseRow, Store};

use crate::running::Coordinator;

/// Number of samples that every design gets first.
const FIRST: u64 = 10;

fn campaign_file() -> String {
    let shipped = include_str!("../../../../campaigns/quick.toml");
    let mut text = shipped.to_owned();
    for (from, to) in [
        ("designs = 150 ", "designs = 40 "),
        (
            "samples_per_design = 10 ",
            &*format!(
                "samples_per_design = {FIRST}\nprecision = 0.05\nsamples_max = 60\n\
                 skip_violation = 2.0 "
            ),
        ),
        ("evaluations = 1200 ", "evaluations = 60 "),
        ("restart_at = 600 ", "restart_at = 30 "),
        ("starts = 3", "starts = 1"),
        ("samples = 100 ", "samples = 20 "),
        ("compare_with_paper = true", "compare_with_paper = false"),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    text
}

/// The results of a campaign without measured times.
#[derive(Debug, PartialEq)]
struct StoreContent {
    samples: String,
    verification_samples: String,
    responses: Vec<ResponseRow>,
    /// The models by name, as JSON.
    models: BTreeMap<String, String>,
    optima: Vec<OptimumRow>,
}

async fn found(store: &Store) -> StoreContent {
    let models = store.models().await.unwrap().into_iter();
    let optima = store.optima().await.unwrap().into_iter();
    StoreContent {
        samples: store.samples_digest().await.unwrap(),
        verification_samples: store.point_samples_digest().await.unwrap(),
        responses: store.responses().await.unwrap(),
        models: models.map(|row| (row.name, row.json)).collect(),
        optima: optima
            .map(|row| OptimumRow {
                cpu_seconds: 0.0,
                ..row
            })
            .collect(),
    }
}

/// Waits until a design has this many samples.
async fn stored(store: &Store, design: u64, samples: u64) {
    while !store
        .sampled_counts()
        .await
        .unwrap()
        .contains(&(design, samples))
    {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
}

async fn run(coordinator: &Coordinator, fails: impl Fn(&Unit) -> bool + Sync) -> CampaignEnd {
    let fails = |_: Option<&str>, unit: &Unit| fails(unit);
    let ended = coordinator.run(2, &fails, pending()).await;
    ended.expect("a campaign that nobody stops ends")
}

/// How a campaign continues after a design was quarantined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Continuation {
    /// In the same coordinator, by `retry`. The samples are stored before the engine reads the
    /// state.
    ByRetry,
    /// In another coordinator, which does not know of the quarantine.
    ByRestart,
    /// By `retry`, and in another coordinator: the first one ended when the samples were stored,
    /// before its engine read the state.
    AfterCrash,
}

/// A design is quarantined while it gets additional samples, so its response rests on fewer, and the
/// model on that response. Both are replaced when the design has all its samples after all.
async fn ends_as_if_undisturbed(resumed: Continuation) {
    let folder = tempfile::tempdir().unwrap();
    let undisturbed = Coordinator::start(&folder.path().join("u.db"), campaign_file()).await;
    let nothing = Vec::<String>::new();
    assert_eq!(run(&undisturbed, |_| false).await.quarantined, nothing);
    let expected = found(&undisturbed.store).await;
    assert_eq!(expected.models.len(), 1);

    let counts = undisturbed.store.sampled_counts().await.unwrap();
    let most = counts.into_iter().max_by_key(|(_, samples)| *samples);
    let (design, samples) = most.unwrap();
    assert!(samples > FIRST, "no design gets additional samples");
    let stream = StreamId::design(u32::try_from(design).unwrap());
    let is_last = |unit: &Unit| unit.stream == stream && u64::from(unit.samples.end) == samples;

    let path = folder.path().join("d.db");
    let mut coordinator = Coordinator::start(&path, campaign_file()).await;
    let ended = run(&coordinator, is_last).await;
    assert_eq!(ended.quarantined, [stream.to_string()]);
    let before = found(&coordinator.store).await;
    assert_eq!(before.responses.len(), expected.responses.len());
    assert_ne!(before.responses, expected.responses);
    assert_ne!(before.models, expected.models);
    assert_ne!(before.optima, expected.optima);

    match resumed {
        Continuation::ByRetry | Continuation::AfterCrash => {
            assert_eq!(coordinator.board.retry(), [stream]);
            tokio::select! {
                () = coordinator.work(1, &|_, _| false) => {}
                () = stored(&coordinator.store, design, samples) => {}
            }
        }
        Continuation::ByRestart => {}
    }
    if resumed != Continuation::ByRetry {
        coordinator.store.close().await.unwrap();
        coordinator = Coordinator::start(&path, campaign_file()).await;
    }
    assert_eq!(run(&coordinator, |_| false).await.quarantined, nothing);
    assert_eq!(found(&coordinator.store).await, expected);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_response_from_too_few_samples_is_replaced_after_a_retry() {
    ends_as_if_undisturbed(Continuation::ByRetry).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_response_from_too_few_samples_is_replaced_after_a_restart() {
    ends_as_if_undisturbed(Continuation::ByRestart).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_response_from_too_few_samples_is_replaced_after_the_crash_of_a_coordinator() {
    ends_as_if_undisturbed(Continuation::AfterCrash).await;
}

/// Results that this coordinator's workers computed, and that turn out to be of other inputs, are computed again: its
/// board has settled their streams and must not take them for stored.
#[tokio::test]
async fn what_is_removed_is_computed_again_by_the_same_coordinator() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.db");
    let coordinator = Coordinator::start(&path, campaign_file()).await;
    run(&coordinator, |_| false).await;
    let store = &coordinator.store;
    let expected = found(store).await;

    let derivations = store.derivations().await.unwrap().into_values();
    let runs = derivations.filter(|held| held.name.starts_with("run-"));
    let runs: Vec<Derivation> = runs.collect();
    assert!(!runs.is_empty());
    for held in &runs {
        let inputs = "others".to_owned();
        let other = Derivation {
            inputs,
            ..held.clone()
        };
        store.put_derivation(&other).await.unwrap();
    }
    run(&coordinator, |_| false).await;
    assert_eq!(found(store).await, expected);
    let again = store.derivations().await.unwrap();
    assert!(runs.iter().all(|held| again[&held.name] == *held));
}
