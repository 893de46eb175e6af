//! Workers whose simulators give different numbers.

use runner::protocol::Refusal;
use runner::protocol::v1::campaign_server::Campaign as _;
use runner::protocol::v1::{
    Directive, HeartbeatRequest, LeaseRequest, LeaseResult, RegisterRequest, ReportRequest,
    UnitResult,
};
use store::FailureKind;
use tonic::Request;

use crate::bench::{SAMPLES, bench};

/// The first of two workers may be wrong as well as the second: a third one continues, and no worker is suspended.
#[tokio::test]
async fn a_design_whose_workers_contradict_each_other_goes_to_a_third() {
    let bench = bench().await;
    for worker in ["first", "second", "third"] {
        bench.register(bench.introduction(worker)).await.unwrap();
    }
    let (leases, _) = bench.lease("first").await;
    let mut part = bench.answer(&leases[0]);
    part.results[0].samples.truncate(4);
    part.results[0].unit.as_mut().unwrap().count = 4;
    bench.report("first", part).await;
    let (leases, _) = bench.lease("second").await;
    let mut other = bench.answer(&leases[0]);
    other.results[0].responses[0] += 1e-9;
    bench.report("second", other).await;
    assert_eq!(bench.samples().await, 4, "the rest may be wrong, too");
    let failures = bench.store.failures().await.unwrap();
    assert_eq!(failures.len(), 1);
    assert_eq!(failures[0].kind, FailureKind::Failure);
    assert!(failures[0].error.contains("second and an earlier worker"));
    let failed = bench
        .board
        .live()
        .workers
        .iter()
        .map(|(worker, ..)| worker.failed)
        .sum::<u64>();
    assert_eq!(failed, 0, "it counts against none of them");

    let (leases, _) = bench.lease("third").await;
    let answer = bench.answer(&leases[0]);
    bench.report("third", answer).await;
    assert_eq!(bench.samples().await, SAMPLES);
}

/// A worker with another simulator registers first. It has stored nothing, so it decides nothing.
#[tokio::test]
async fn the_first_stored_result_decides_which_simulator_a_campaign_has() {
    let mut bench = bench().await;
    let introduction = |worker: &str, digest: &str| RegisterRequest {
        model_digest: digest.repeat(64),
        ..bench.introduction(worker)
    };
    let wrong = introduction("wrong", "0");
    let right = introduction("right", "1");
    let late = introduction("late", "0");
    // Only workers can ask an external program.
    bench.service.model_digest = None;
    bench.register(wrong.clone()).await.unwrap();
    let (leases, _) = bench.lease("wrong").await;
    let result = LeaseResult {
        id: leases[0].id,
        results: vec![UnitResult {
            unit: leases[0].units.first().copied(),
            error: Some("no licence".to_owned()),
            serial: 1,
            ..UnitResult::default()
        }],
        wall_seconds: 0.5,
        origin: None,
    };
    bench.report("wrong", result.clone()).await;
    let pinned = || async { bench.store.campaign().await.unwrap().model_digest };
    assert_eq!(pinned().await, None);

    bench.register(right.clone()).await.unwrap();
    // The sample that has failed may have a lease of its own.
    while bench.samples().await < SAMPLES {
        let (leases, _) = bench.lease("right").await;
        let answer = bench.answer(&leases[0]);
        bench.report("right", answer).await;
    }
    assert_eq!(pinned().await, Some("1".repeat(64)));

    // The other one registered before. It is refused at its next call, whichever that is.
    let report = ReportRequest {
        worker_id: "wrong".to_owned(),
        results: vec![result],
    };
    let refused = bench.service.report(Request::new(report)).await;
    assert_eq!(Refusal::of(&refused.unwrap_err()), Some(Refusal::Model));
    let lease = LeaseRequest {
        worker_id: "wrong".to_owned(),
        credit: 1,
        seconds: 1.0,
        wait_ms: 0,
    };
    let refused = bench.service.lease(Request::new(lease)).await;
    assert_eq!(Refusal::of(&refused.unwrap_err()), Some(Refusal::Model));
    let heartbeat = HeartbeatRequest {
        worker_id: "wrong".to_owned(),
        held: Vec::new(),
    };
    let told = bench.service.heartbeat(Request::new(heartbeat)).await;
    assert_eq!(told.unwrap().into_inner().directive(), Directive::Register);
    for request in [wrong, late] {
        let refused = bench.register(request).await.unwrap_err();
        assert_eq!(Refusal::of(&refused), Some(Refusal::Model));
        assert!(
            refused.message().contains("gives other numbers"),
            "{refused}"
        );
    }
    bench.register(right).await.unwrap();
}

/// Both have registered, and both bring results: those that are stored first decide.
#[tokio::test]
async fn results_of_another_simulator_than_the_first_are_refused() {
    let mut bench = bench().await;
    let requests = [("first", "1"), ("other", "0")].map(|(worker, digest)| RegisterRequest {
        model_digest: digest.repeat(64),
        ..bench.introduction(worker)
    });
    bench.service.model_digest = None;
    for request in requests {
        bench.register(request).await.unwrap();
    }
    let (leases, _) = bench.lease("other").await;
    let whole = bench.answer(&leases[0]);
    let mut part = whole.clone();
    part.results[0].samples.truncate(4);
    part.results[0].unit.as_mut().unwrap().count = 4;
    bench.report("first", part).await;
    let report = ReportRequest {
        worker_id: "other".to_owned(),
        results: vec![whole],
    };
    let refused = bench.service.report(Request::new(report)).await;
    assert_eq!(Refusal::of(&refused.unwrap_err()), Some(Refusal::Model));
    assert_eq!(bench.samples().await, 4);
    // Its lease is free at once, and no crash is counted.
    assert_eq!(bench.board.live().counts.leased, 0);
    let (leases, _) = bench.lease("first").await;
    let rest = bench.answer(&leases[0]);
    bench.report("first", rest).await;
    assert_eq!(bench.samples().await, SAMPLES);
    assert!(bench.store.failures().await.unwrap().is_empty());
}
