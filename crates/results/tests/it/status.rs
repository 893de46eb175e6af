//! The status of a campaign whose coordinator runs.

use std::time::Duration;

use ledger::{Counts, Kind, StreamId, WorkerId, WorkerStatus};
use results::running::{CoordinatorState, Pace, Paces, RunSeconds};
use results::status::{OptimumStatus, Progress, Status, read};
use stages::stage::Stage;

async fn status() -> Status {
    let (_folder, store) = super::new_store().await;
    let status = read(&store).await.unwrap();
    store.close().await.unwrap();
    status
}

/// 50 samples of designs, 25 of points and 2 evaluations a second.
fn paces(factor: Option<f64>) -> Paces {
    let kinds = [(Kind::Design, 50.0), (Kind::Point, 25.0), (Kind::Run, 2.0)];
    Paces(
        kinds
            .map(|(kind, rate)| (kind, Pace::of(rate, factor)))
            .into(),
    )
}

fn running(silent: u64) -> CoordinatorState {
    let now = Duration::from_secs(1000);
    CoordinatorState {
        workers: vec![(
            WorkerStatus {
                worker: WorkerId::from("w"),
                host: "here".to_owned(),
                slots: 4,
                leased: 1,
                delivered: 2,
                failed: 3,
                crashed: 4,
                suspended_until: Some(now + Duration::from_secs(1)),
                last_seen: now - Duration::from_secs(silent),
            },
            49.0,
        )],
        now,
        counts: Counts::default(),
        paces: paces(Some(1.1)),
        run_seconds: Some(RunSeconds {
            mean: 6.0,
            shortest: 5.0,
            longest: 7.0,
        }),
        searches: Vec::new(),
        is_draining: false,
    }
}

#[tokio::test]
async fn time_to_go_is_that_of_the_stage() {
    let mut status = status().await;
    let live = |status: &Status, running| status.clone().with(running).live.unwrap();
    let of_stage = |status: &Status| live(status, running(1)).eta_seconds;

    // Three approaches with as many starts as the paper's file says.
    status.stage = Stage::Optimise;
    status.optimiser_runs.done = status.optimiser_runs.wanted - 6;
    let runs = live(&status, running(1));
    assert_eq!(runs.eta_seconds, Some(6.0 * 6.0 / 4.0));
    // Four of the six may be about to end; or all four slots have two each before them.
    assert_eq!(runs.eta_low_seconds, Some(2.0 * 5.0 / 4.0));
    assert_eq!(runs.eta_high_seconds, Some(2.0 * 7.0));
    let silent = live(&status, running(60));
    assert_eq!(silent.eta_seconds, None, "its only worker is gone");

    // Two searches on an external simulator.
    let search = |start, evaluations| stages::searching::Progress {
        stream: StreamId::run(3, start),
        evaluations,
        budget: 300,
        history: Vec::new(),
    };
    let searching = CoordinatorState {
        searches: vec![search(0, 100), search(1, 60)],
        ..running(1)
    };
    let searched = status.clone().with(searching);
    let stage = searched
        .stages
        .iter()
        .find(|stage| stage.name == Stage::Optimise);
    let stage = stage.unwrap();
    assert_eq!((stage.done, stage.wanted), (160, 600));
    assert!(stage.of.starts_with("evaluations"), "{stage:?}");
    assert_eq!(searched.live.unwrap().eta_seconds, Some(440.0 / 2.0));

    status.stage = Stage::Verify;
    let optimum = |done| OptimumStatus {
        limits: Vec::new(),
        approach: "kriging".to_owned(),
        criterion: Some(1.5),
        measure: None,
        behind: None,
        none: None,
        note: String::new(),
        verified: Progress { done, wanted: 1000 },
    };
    status.optima = vec![optimum(400), optimum(1000)];
    assert_eq!(of_stage(&status), Some(600.0 / 25.0));
    let fresh = live(&status, running(1));
    let (low, high) = (
        fresh.eta_low_seconds.unwrap(),
        fresh.eta_high_seconds.unwrap(),
    );
    assert!((low - 24.0 / 1.1).abs() < 1e-9 && (high - 24.0 * 1.1).abs() < 1e-9);
    assert_eq!(fresh.time_to_go().unwrap(), "24 s (22 s to 26 s)");
    let vague = CoordinatorState {
        paces: paces(None),
        ..running(1)
    };
    assert_eq!(
        live(&status, vague).eta_seconds,
        None,
        "too little is known"
    );

    status.stage = Stage::Fit;
    assert_eq!(of_stage(&status), None, "nobody knows");
    let idle = CoordinatorState {
        paces: Paces::default(),
        ..running(1)
    };
    status.stage = Stage::Verify;
    assert_eq!(live(&status, idle).eta_seconds, None);
}

#[tokio::test]
async fn few_designs_make_the_number_of_samples_left_uncertain() {
    let mut status = status().await;
    status.stage = Stage::Sample;
    status.designs.wanted = 3000;
    (status.designs.done, status.designs.simulable) = (10, 8);
    (status.samples.per_design, status.samples.done) = (30, 240);
    let (left, error) = status.missing();
    // 80 % of 2990 designs; the share of 10 has a standard error of √(0.8 · 0.2/10).
    assert!((left - 30.0 * 0.8 * 2990.0).abs() < 1e-6, "{left}");
    assert!(
        (error - 30.0 * 2990.0 * 0.016_f64.sqrt()).abs() < 1e-6,
        "{error}"
    );
    let live = status.with(running(1)).live.unwrap();
    let factor = live.eta_high_seconds.unwrap() / live.eta_seconds.unwrap();
    // ln² = ln² 1.1 + (1.96 · 0.158)².
    let expected = 1.1_f64
        .ln()
        .hypot(1.959_963_984_540_054 * error / left)
        .exp();
    assert!((factor - expected).abs() < 1e-9, "{factor}");
}

#[tokio::test]
async fn every_stage_says_how_far_it_is() {
    let status = status().await;
    let stages: Vec<_> = status
        .stages
        .iter()
        .map(|stage| (stage.name, &*stage.state, (stage.done, stage.wanted)))
        .collect();
    let expected = [
        (Stage::Doe, "current", (0, 3000)),
        (Stage::Sample, "ahead", (0, 90_000)),
        (Stage::Fit, "ahead", (0, 1)),
        (Stage::Optimise, "ahead", (0, status.optimiser_runs.wanted)),
        (Stage::Verify, "ahead", (0, 4 * 4000)),
    ];
    assert_eq!(stages, expected);
}

#[tokio::test]
async fn a_worker_is_shown_with_all_that_went_wrong_on_it() {
    let status = status().await.with(running(1));
    let live = status.live.unwrap();
    let worker = &live.workers[0];
    assert_eq!((worker.leased, worker.completed, worker.failed), (1, 2, 7));
    assert!(worker.is_suspended && worker.silent_seconds == 1.0);
    assert_eq!(worker.samples_per_second, 49.0);
}
