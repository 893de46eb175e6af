//! A whole small campaign with rounds of infill, in this process. Some infill points fail, the
//! coordinator stops in the middle of a round, and the number of workers changes.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use enrich::Recommendation;
use ledger::{Kind, StreamId, Unit};
use problem::Approach;
use results::status;
use runner::coordinator::engine::CampaignEnd;
use stages::fitting::{ModelSummary, latest_model};
use store::{InfillRow, ModelRow, OptimumRow, RoundRow, Store};

use crate::running::Coordinator;

/// Number of designs in the DoE, and the budget of samples.
const DESIGNS: u32 = 70;
const BUDGET: u32 = 1000;

fn campaign_file() -> String {
    let shipped = include_str!("../../../../campaigns/enriched.toml");
    let mut text = shipped.to_owned();
    for (from, to) in [
        ("designs = 600 ", &*format!("designs = {DESIGNS} ")),
        ("samples_per_design = 36 ", "samples_per_design = 10 "),
        ("evaluations = 12000 ", "evaluations = 60 "),
        ("restart_at = 6000 ", "restart_at = 30 "),
        ("starts = 3", "starts = 1"),
        ("half_width = 0.005 ", "samples = 20 "),
        ("samples = 18000 ", &*format!("samples = {BUDGET} ")),
        ("points_per_round = 24 ", "points_per_round = 5 "),
        ("samples_per_point = 36 ", "samples_per_point = 12 "),
        ("tolerance = 0.003 ", "tolerance = 0.01 "),
        ("compare_with_paper = true", "compare_with_paper = false"),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    text
}

fn is_infill(stream: StreamId) -> bool {
    stream.kind == Kind::Point && stages::infill::is_infill(stream.index)
}

/// Whether an infill point fails, by its name.
type Fails = fn(&str) -> bool;

/// Runs the campaign on the store until it ends, or until `stop_at` infill samples are stored.
async fn run(
    path: &Path,
    workers: usize,
    fails: Fails,
    stop_at: Option<u64>,
) -> Option<CampaignEnd> {
    let coordinator = Coordinator::start(path, campaign_file()).await;
    let store = &coordinator.store;
    let enough = async {
        let Some(stop_at) = stop_at else {
            return std::future::pending().await;
        };
        loop {
            let tallies = store.sample_tallies().await.unwrap();
            let infill = tallies.iter().filter(|(stream, _)| is_infill(**stream));
            if infill.map(|(_, tally)| tally.samples).sum::<u64>() >= stop_at {
                return;
            }
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    };
    let fails = |point: Option<&str>, _: &Unit| point.is_some_and(fails);
    let ended = coordinator.run(workers, &fails, enough).await;
    store.close().await.unwrap();
    ended
}

/// The results of a campaign without measured times.
#[derive(Debug, PartialEq)]
struct StoreContent {
    digest: String,
    rounds: Vec<RoundRow>,
    infill: Vec<InfillRow>,
    optimum: OptimumRow,
    /// The model of the DoE and all infill points, as JSON; `None` if it could not be fitted.
    model: Option<String>,
}

async fn found(path: &Path) -> StoreContent {
    let store = Store::open_read_only(path).await.unwrap();
    let status = status::read(&store).await.unwrap();
    assert!(status.finished, "{status:?}");
    let optima = store.optima().await.unwrap();
    let point = StreamId::point(Approach::EnrichedKriging.number());
    let optimum = optima.into_iter().find(|row| row.stream == point);
    let rounds = store.rounds().await.unwrap().into_iter();
    let model = store.model(ModelRow::ENRICHED).await.unwrap();
    StoreContent {
        digest: store.samples_digest().await.unwrap(),
        rounds: rounds
            .map(|row| RoundRow {
                cpu_seconds: 0.0,
                ..row
            })
            .collect(),
        infill: store.infill().await.unwrap(),
        optimum: OptimumRow {
            cpu_seconds: 0.0,
            ..optimum.expect("the fifth approach has its row")
        },
        model: model.map(|row| row.json),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn rounds_end_within_the_budget_and_resume_as_if_nothing_had_been() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, broken) = (folder.path().join("w.db"), folder.path().join("b.db"));
    let ended = run(&whole, 1, |_| false, None).await.unwrap();
    assert_eq!(ended.quarantined, Vec::<String>::new());
    let expected = found(&whole).await;

    let infill = &expected.infill;
    assert!(expected.rounds.len() >= 3, "{:?}", expected.rounds);
    assert!(infill.iter().all(|row| !row.failed));
    let store = Store::open_read_only(&whole).await.unwrap();
    let tallies = store.sample_tallies().await.unwrap();
    for row in infill {
        let tally = &tallies[&StreamId::point(row.number)];
        assert_eq!(tally.samples, row.samples, "{row:?}");
        // New designs are sought where every constraint holds.
        assert!(row.violation <= 0.0 || row.reason == "more", "{row:?}");
    }
    let sampled = store.progress().await.unwrap().samples;
    let asked: u64 = infill.iter().map(|row| row.samples).sum();
    assert!(sampled + asked <= u64::from(BUDGET), "{sampled} + {asked}");
    let last = expected.rounds.last().unwrap();
    assert!(last.stop_json.is_some() && last.recommendation_json.is_some());
    assert!(expected.optimum.feasible, "{:?}", expected.optimum);
    let verification = stages::names::verification(Approach::EnrichedKriging);
    assert_eq!(tallies[&verification].samples, 20, "it is verified");
    // The DoE's calls, the infill samples and the searches.
    let searches: u64 = expected.rounds.iter().map(|row| row.simulator_calls).sum();
    assert!(searches > 0 && expected.optimum.simulator_calls > sampled + asked + searches);

    // The model for predictions includes the infill points. Its prediction at the recommended design is near those of
    // the enrichment's own models.
    assert!(expected.model.is_some());
    let summary = latest_model(&store).await.unwrap().unwrap().summary_json;
    let summary: ModelSummary = serde_json::from_str(&summary).unwrap();
    let of_doe = u64::from(DESIGNS);
    let numbers = summary.residuals.iter().map(|(number, _)| *number);
    let known: BTreeSet<u64> = numbers.collect();
    let new = infill.iter().filter(|row| row.reason != "more");
    assert!(new.clone().count() > 3);
    assert!(
        new.clone()
            .all(|row| known.contains(&(of_doe + row.infill)))
    );
    let model = results::model::stored(&store).await.unwrap();
    let best = last.recommendation_json.as_ref().unwrap();
    let best: Recommendation = serde_json::from_str(best).unwrap();
    let mean = model.surrogate.means(&best.x).unwrap()[0];
    assert!((mean / best.predicted - 1.0).abs() < 0.3, "{mean} {best:?}");

    // Stopped in the middle of several rounds, each time with another number of workers.
    for (round, workers) in [(0, 2), (1, 3), (2, 1)] {
        let before = infill.iter().filter(|row| row.round < round);
        let before: u64 = before.map(|row| row.samples).sum();
        let stopped = run(&broken, workers, |_| false, Some(before + 12)).await;
        assert_eq!(
            stopped, None,
            "round {round} was over before it could be stopped"
        );
    }
    run(&broken, 2, |_| false, None).await.unwrap();
    assert_eq!(found(&broken).await, expected);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn infill_points_that_fail_are_survived_and_kept_away_from() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("f.db");
    let fails = |point: &str| point.starts_with("infill-0001") || point.starts_with("infill-0007");
    let ended = run(&path, 2, fails, None).await.unwrap();
    assert_eq!(ended.quarantined.len(), 2, "{ended:?}");
    assert!(ended.quarantined[0].starts_with("infill-"), "{ended:?}");
    let found = found(&path).await;
    assert!(found.optimum.feasible);
    let failed: Vec<&InfillRow> = found.infill.iter().filter(|row| row.failed).collect();
    let indices: Vec<u64> = failed.iter().map(|row| row.infill).collect();
    assert_eq!(indices, [1, 7]);
    let ranges = [3.0, 3.0, 0.9, 0.9, 0.9, 0.9];
    for row in failed.iter().filter(|row| row.reason != "more") {
        let later = found.infill.iter().filter(|other| other.round > row.round);
        for other in later.filter(|other| other.reason != "more") {
            let apart = (0..6).any(|j| (row.x[j] - other.x[j]).abs() >= 0.01 * ranges[j]);
            assert!(apart, "{other:?} is where {row:?} failed");
        }
    }
    let store = Store::open_read_only(&path).await.unwrap();
    let failures = store.failures().await.unwrap();
    assert_eq!(failures.len(), 6, "three attempts each: {failures:?}");
    assert!(failures.iter().all(|row| is_infill(row.stream)));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_rounds_of_nothing_but_failures_end_it_without_ending_the_campaign() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("n.db");
    let ended = run(&path, 2, |point| point.starts_with("infill-"), None).await;
    assert!(!ended.unwrap().quarantined.is_empty());
    let found = found(&path).await;
    assert_eq!(found.rounds.len(), 3);
    let stop = found.rounds[2].stop_json.as_deref();
    assert!(
        stop.is_some_and(|stop| stop.contains("only-failures")),
        "{stop:?}"
    );
    assert!(found.infill.iter().all(|row| row.failed));
}
