//! The status of a campaign whose coordinator runs.

use std::time::Duration;

use campaign::Campaign;
use ledger::{Counts, WorkerId, WorkerStatus};
use results::live::Running;
use results::status::{Optimum, Progress, Status, read};
use store::{CampaignRow, Store};

async fn status() -> Status {
    let folder = tempfile::tempdir().unwrap();
    let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
    let row = CampaignRow {
        name: campaign.name.clone(),
        file_text: Campaign::PAPER.to_owned(),
        digest: campaign.digest(),
        seed: campaign.seed,
        program_version: "0".to_owned(),
        model_digest: None,
    };
    let path = folder.path().join("s.db");
    let store = Store::create_or_open(&path, &row).await.unwrap();
    let status = read(&store).await.unwrap();
    store.close().await.unwrap();
    status
}

/// A coordinator with one worker of four slots that was heard of `silent` seconds ago.
fn running(silent: u64) -> Running {
    let now = Duration::from_secs(1000);
    Running {
        workers: vec![WorkerStatus {
            worker: WorkerId::from("w"),
            host: "here".to_owned(),
            slots: 4,
            leased: 1,
            delivered: 2,
            failed: 3,
            crashed: 4,
            suspended_until: Some(now + Duration::from_secs(1)),
            last_seen: now - Duration::from_secs(silent),
        }],
        now,
        counts: Counts::default(),
        samples_per_second: 50.0,
        run_seconds: Some(6.0),
        is_draining: false,
    }
}

#[tokio::test]
async fn time_to_go_is_that_of_the_stage() {
    let mut status = status().await;
    let live = |status: &Status, running| status.clone().with(running).live.unwrap();
    let of_stage = |status: &Status| live(status, running(1)).eta_seconds;

    // Three approaches with as many starts as the paper's file says.
    status.stage = "optimise".to_owned();
    status.optimiser_runs.done = status.optimiser_runs.wanted - 2;
    assert_eq!(of_stage(&status), Some(2.0 * 6.0 / 4.0));
    let silent = live(&status, running(60));
    assert_eq!(silent.eta_seconds, None, "its only worker is gone");

    status.stage = "verify".to_owned();
    let optimum = |done| Optimum {
        approach: "kriging".to_owned(),
        criterion_um: Some(1.5),
        verified: Progress { done, wanted: 1000 },
    };
    status.optima = vec![optimum(400), optimum(1000)];
    assert_eq!(of_stage(&status), Some(600.0 / 50.0));

    status.stage = "fit".to_owned();
    assert_eq!(of_stage(&status), None, "nobody knows");
    let idle = Running {
        samples_per_second: 0.0,
        ..running(1)
    };
    status.stage = "verify".to_owned();
    assert_eq!(live(&status, idle).eta_seconds, None);
}

#[tokio::test]
async fn a_worker_is_shown_with_all_that_went_wrong_on_it() {
    let status = status().await.with(running(1));
    let live = status.live.unwrap();
    let worker = &live.workers[0];
    assert_eq!((worker.leased, worker.completed, worker.failed), (1, 2, 7));
    assert!(worker.set_aside && worker.silent_seconds == 1.0);
}
