//! Rounds of infill points: written once, all or nothing, and removed one by one.

use ledger::StreamId;
use store::{
    Derivation, DerivedResult, Error, InfillRow, ModelRow, NewRound, RoundRow, SampleBlock, Store,
    UnsampledPoint,
};

use crate::{POINT, folder, from, open, samples, store_with};

fn point(infill: u64, round: u64) -> InfillRow {
    InfillRow {
        infill,
        round,
        name: format!("infill-{infill:04}"),
        number: (1 << 27) + 7 * infill,
        reason: "local".into(),
        x: vec![infill as f64, -0.1, 1.1, 1.2, 1.0 / 3.0, 1.4],
        violation: 0.0,
        samples: 30,
        failed: false,
    }
}

fn unsampled(infill: u64) -> UnsampledPoint {
    UnsampledPoint {
        infill,
        violation: 0.25 * infill as f64,
    }
}

/// A round of three points.
pub(crate) fn new_round(round: u64, failed: &[u64]) -> NewRound {
    NewRound {
        row: RoundRow {
            round,
            expected_improvement: (round > 0).then_some(0.25),
            recommendation_json: (round > 0).then(|| format!("{{\"design\":{round}}}")),
            stop_json: None,
            notes_json: "[]".into(),
            simulator_calls: 800 + round,
            cpu_seconds: 0.5,
        },
        infill: (3 * round..3 * round + 3)
            .map(|i| point(i, round))
            .collect(),
        failed: failed.iter().map(|&infill| unsampled(infill)).collect(),
        model: (round > 0).then(|| ModelRow {
            name: ModelRow::ENRICHED.to_owned(),
            number: 0,
            json: "{}".into(),
            summary_json: "{}".into(),
        }),
    }
}

/// The derivation of a round.
pub(crate) fn round(round: u64) -> Derivation {
    from(&DerivedResult::Round(round))
}

async fn sampled(store: &Store, points: &[StreamId]) {
    let blocks = points.iter().map(|stream| SampleBlock {
        stream: *stream,
        first_sample: 0,
        samples: vec![0.5; 4].into(),
    });
    store
        .writer()
        .unwrap()
        .submit(samples(blocks))
        .await
        .unwrap();
}

#[tokio::test]
async fn a_round_is_held_with_its_points_and_marks_those_that_failed() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    assert_eq!(store.rounds().await.unwrap(), []);
    let (first, second) = (new_round(0, &[]), new_round(1, &[1]));
    store.put_round(&first, &round(0)).await.unwrap();
    assert_eq!(store.infill().await.unwrap(), first.infill);
    store.put_round(&second, &round(1)).await.unwrap();
    let models = store.models().await.unwrap();
    assert_eq!(models, second.model.into_iter().collect::<Vec<_>>());
    store.close().await.unwrap();

    let store = Store::open_read_only(&path).await.unwrap();
    assert_eq!(
        store.rounds().await.unwrap(),
        [first.row.clone(), second.row.clone()]
    );
    let mut points: Vec<InfillRow> = first.infill.into_iter().chain(second.infill).collect();
    (points[1].failed, points[1].violation) = (true, 0.25);
    assert!(points[1].is_ruled_out() && !points[1].has_failed());
    assert_eq!(store.infill().await.unwrap(), points);
}

#[tokio::test]
async fn a_round_is_decided_once_and_never_stored_in_part() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    store
        .put_round(&new_round(0, &[]), &round(0))
        .await
        .unwrap();
    let again = store
        .put_round(&new_round(0, &[]), &round(0))
        .await
        .unwrap_err();
    assert!(matches!(again, Error::Constraint { .. }), "{again}");
    // The last point of this round is stored already.
    let mut mixed = new_round(1, &[0]);
    mixed.infill[2] = InfillRow {
        round: 1,
        ..point(0, 0)
    };
    let mixed = store.put_round(&mixed, &round(1)).await.unwrap_err();
    assert!(matches!(mixed, Error::Constraint { .. }), "{mixed}");
    let mut endless = new_round(1, &[0]);
    endless.infill[0].violation = f64::INFINITY;
    let endless = store.put_round(&endless, &round(1)).await.unwrap_err();
    assert!(matches!(endless, Error::NotFinite { .. }), "{endless}");
    assert_eq!(store.rounds().await.unwrap().len(), 1);
    assert_eq!(store.infill().await.unwrap(), new_round(0, &[]).infill);
    // The writer continues after the refusals.
    store
        .put_round(&new_round(1, &[]), &round(1))
        .await
        .unwrap();
}

/// A round goes with its points and their samples, and the points that it found to have failed are open again.
#[tokio::test]
async fn a_round_that_is_removed_leaves_the_one_before_as_it_was_sampled() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    let first = new_round(0, &[]);
    store.put_round(&first, &round(0)).await.unwrap();
    store
        .put_round(&new_round(1, &[1]), &round(1))
        .await
        .unwrap();
    let [kept, gone] = [0, 4].map(|infill| StreamId::point(point(infill, 0).number));
    sampled(&store, &[kept, gone, POINT]).await;
    let generations = [kept, gone].map(|stream| (stream, 7));
    store.put_generations(&generations).await.unwrap();
    store.remove(&[DerivedResult::Round(1)]).await.unwrap();
    assert_eq!(store.rounds().await.unwrap(), [first.row]);
    assert_eq!(store.models().await.unwrap(), []);
    let points = store.infill().await.unwrap();
    assert!(points.len() == 3 && points.iter().all(|point| !point.failed));
    let tallies = store.sample_tallies().await.unwrap();
    let counts = tallies
        .iter()
        .map(|(stream, tally)| (*stream, tally.samples));
    assert_eq!(counts.collect::<Vec<_>>(), [(POINT, 4), (kept, 4)]);
    let held = store.generations().await.unwrap();
    assert_eq!(held.keys().collect::<Vec<_>>(), [&kept]);
    let derivations = store.derivations().await.unwrap();
    assert_eq!(derivations.keys().collect::<Vec<_>>(), ["round 0"]);
    assert_eq!(derivations["round 0"], round(0));

    // It is decided again, with other points.
    store
        .put_round(&new_round(1, &[]), &round(1))
        .await
        .unwrap();
    store
        .remove(&[DerivedResult::Round(1), DerivedResult::Round(0)])
        .await
        .unwrap();
    assert_eq!(store.infill().await.unwrap(), []);
    store.close().await.unwrap();
    let store = open(&path).await;
    assert_eq!(store.progress().await.unwrap().point_samples, 4);
}
