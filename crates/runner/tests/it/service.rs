//! Calls that the service accepts and refuses, and the rows that it stores.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use ledger::{Options, StreamId};
use problem::Approach;
use problem::task::{Candidate, Inputs, Source};
use results::status::Status;
use runner::coordinator::board::Board;
use runner::protocol::Refusal;
use runner::protocol::v1::campaign_server::Campaign as _;
use runner::protocol::v1::{
    Directive, DrainRequest, ExplainRequest, HeartbeatRequest, HeldLease, Lease, LeaseResult,
    LeaseState, Origin, ReleaseRequest, RetryRequest, UnitResult, WatchRequest,
};
use store::{Discard, FailureKind};
use tonic::Request;

use crate::bench::{SAMPLES, X, bench, board};

#[tokio::test]
async fn another_version_or_another_model_is_refused_for_good() {
    let bench = bench().await;
    let mut request = bench.introduction("w");
    // The same version, built from other sources.
    request.program_version = "0.1.0+000000000000".to_owned();
    let refused = bench.register(request).await.unwrap_err();
    assert_eq!(Refusal::of(&refused), Some(Refusal::Version));
    for part in [
        "0.1.0+000000000000",
        runner::identity::BUILD,
        "same sources",
    ] {
        assert!(refused.message().contains(part), "{part}: {refused}");
    }

    let mut request = bench.introduction("w");
    request.model_digest = "0".repeat(64);
    let refused = bench.register(request).await.unwrap_err();
    assert_eq!(Refusal::of(&refused), Some(Refusal::Model));

    let refused = bench.register(bench.introduction("")).await.unwrap_err();
    assert_eq!(Refusal::of(&refused), Some(Refusal::Malformed));
    assert!(bench.board.live().workers.is_empty());
}

#[tokio::test]
async fn strangers_are_asked_to_register_and_store_nothing() {
    let bench = bench().await;
    assert_eq!(
        bench.lease("stranger").await,
        (Vec::new(), Directive::Register)
    );
    let result = LeaseResult::default();
    assert_eq!(bench.report("stranger", result).await, Directive::Register);
    let request = HeartbeatRequest {
        worker_id: "stranger".to_owned(),
        held: Vec::new(),
    };
    let heartbeat = bench
        .service
        .heartbeat(Request::new(request))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(heartbeat.directive(), Directive::Register);
    assert!(bench.store.failures().await.unwrap().is_empty());
}

#[tokio::test]
async fn a_result_is_stored_before_it_is_acknowledged_and_only_once() {
    let bench = bench().await;
    bench.register(bench.introduction("w")).await.unwrap();
    let (leases, _) = bench.lease("w").await;
    assert_eq!(leases.len(), 1);
    for _ in 0..2 {
        let answer = bench.answer(&leases[0]);
        assert_eq!(bench.report("w", answer).await, Directive::Continue);
        assert_eq!(bench.samples().await, SAMPLES);
    }
    assert!(bench.store.failures().await.unwrap().is_empty());
    let times = bench.store.job_times().await.unwrap();
    assert_eq!((times.len(), times[0].cpu_seconds), (1, 0.5));
}

#[tokio::test]
async fn a_result_that_contradicts_the_store_is_loud_and_changes_nothing() {
    let bench = bench().await;
    bench.register(bench.introduction("honest")).await.unwrap();
    bench.register(bench.introduction("wrong")).await.unwrap();
    let (leases, _) = bench.lease("honest").await;
    let answer = bench.answer(&leases[0]);
    // The stored numbers are accepted from any worker and under any lease.
    bench.report("honest", answer.clone()).await;
    bench.report("wrong", answer.clone()).await;
    let held = bench.store.samples_digest().await.unwrap();
    assert!(bench.store.failures().await.unwrap().is_empty());

    let mut other = answer;
    other.results[0].samples[7] += 1e-9;
    bench.report("wrong", other).await;
    assert_eq!(bench.store.samples_digest().await.unwrap(), held);
    let failures = bench.store.failures().await.unwrap();
    assert_eq!(failures.len(), 1);
    assert_eq!(failures[0].worker, "wrong");
    let error = &failures[0].error;
    for part in [
        "sample 7 of design-0",
        "wrong and honest",
        "coordinator discard --db FILE --design 0 --yes",
    ] {
        assert!(error.contains(part), "{part}: {error}");
    }
    let status = results::status::read(&bench.store).await.unwrap();
    let warnings = &status.warnings;
    assert!(
        warnings.len() == 1
            && warnings[0].contains("for the same job")
            && warnings[0].contains("design-0"),
        "{warnings:?}"
    );
}

#[tokio::test]
async fn numbers_that_cannot_be_are_failures_until_the_design_is_quarantined() {
    let bench = bench().await;
    for (worker, absurd) in [("a", -1.0), ("b", 1e308), ("c", f64::NAN)] {
        bench.register(bench.introduction(worker)).await.unwrap();
        let (leases, _) = bench.lease(worker).await;
        let mut answer = bench.answer(&leases[0]);
        answer.results[0].samples[3] = absurd;
        assert_eq!(bench.report(worker, answer).await, Directive::Continue);
    }
    let design = StreamId::design(0);
    assert_eq!(bench.board.quarantined(), BTreeSet::from([design]));
    assert_eq!(bench.samples().await, 0);
    let failures = bench.store.failures().await.unwrap();
    assert_eq!(
        failures.last().map(|row| row.kind),
        Some(FailureKind::Quarantine)
    );
    for row in &failures {
        assert!(
            row.error.contains("design-0: delta_ste_um of sample 3 is"),
            "{row:?}"
        );
    }

    // A retry, and this time a correct worker. The retry may arrive while the report is written.
    let seen = bench.board.retries();
    let retried = bench.service.retry(Request::new(RetryRequest {})).await;
    assert_eq!(retried.unwrap().into_inner().retried, ["design-0"]);
    assert!(
        !bench.board.finish(seen),
        "what was retried must not be lost"
    );
    bench.register(bench.introduction("e")).await.unwrap();
    let (leases, _) = bench.lease("e").await;
    let answer = bench.answer(&leases[0]);
    bench.report("e", answer).await;
    assert_eq!(bench.samples().await, SAMPLES);
    assert!(bench.board.quarantined().is_empty());
    assert!(bench.board.finish(bench.board.retries()));
}

#[tokio::test]
async fn what_a_partial_result_leaves_undone_is_leased_again() {
    let bench = bench().await;
    bench.register(bench.introduction("leaver")).await.unwrap();
    let (leases, _) = bench.lease("leaver").await;
    let mut part = bench.answer(&leases[0]);
    part.results[0].samples.truncate(4);
    part.results[0].unit.as_mut().unwrap().count = 4;
    bench.report("leaver", part).await;
    assert_eq!(bench.samples().await, 4);

    bench.register(bench.introduction("next")).await.unwrap();
    let (leases, _) = bench.lease("next").await;
    let units = leases[0].units().unwrap();
    assert_eq!(units[0].0.samples, 4..10);
}

/// Three workers share the candidates of a generation; one of them reports only a part of its
/// lease.
#[tokio::test]
async fn the_candidates_of_a_generation_are_shared() {
    let bench = bench().await;
    let inputs = Inputs::new(bench.problem.campaign(), None);
    let stream = StreamId::run(Approach::Baseline.number() as u32, 1);
    let candidates = (0..10).map(|evaluation| {
        let x = X.map(|x| x + 1e-3 * f64::from(evaluation));
        Candidate {
            evaluation,
            design: bench.problem.design(&x, bench.problem.base()),
            may_improve: true,
        }
    });
    let source = Source::Candidates(candidates.collect());
    let wanted = inputs.wanted(stream, source, 10);
    let generation = [(stream, wanted.generation.0)];
    bench.store.put_generations(&generation).await.unwrap();
    bench.board.want(vec![wanted]);
    let mut held = Vec::new();
    for worker in ["first", "second", "third"] {
        bench.register(bench.introduction(worker)).await.unwrap();
        let (leases, _) = bench.lease(worker).await;
        assert_eq!(leases[0].units().unwrap()[0].0.stream, stream);
        held.push((worker, leases[0].clone()));
    }
    let counts = held.iter().map(|(_, lease)| lease.candidates.len());
    let counts: Vec<usize> = counts.collect();
    assert!(
        counts.iter().all(|count| (1..=4).contains(count)),
        "{counts:?}"
    );
    let numbers = async || {
        let rows = bench.store.evaluations(stream, 0).await.unwrap();
        rows.iter().map(|row| row.evaluation).collect::<Vec<_>>()
    };
    for (worker, lease) in held {
        bench.report(worker, bench.answer(&lease)).await;
    }
    let stored = numbers().await;
    assert_eq!(stored.len(), counts.iter().sum::<usize>());
    while numbers().await.len() < 10 {
        let (leases, _) = bench.lease("first").await;
        bench.report("first", bench.answer(&leases[0])).await;
    }
    assert_eq!(numbers().await, (0..10).collect::<Vec<_>>());
    let rows = bench.store.evaluations(stream, 0).await.unwrap();
    assert!(rows.iter().all(|row| row.criteria.is_some()));
}

/// A worker is cut off while the optimum that it samples is chosen again. If its samples were
/// stored, the new optimum would be judged by another design's numbers.
#[tokio::test]
async fn samples_of_an_optimum_that_was_replaced_are_not_stored_for_the_new_one() {
    let bench = bench().await;
    let inputs = Inputs::new(bench.problem.campaign(), None);
    let stream = StreamId::point(Approach::Kriging.number());
    let want = async |x_p: f64| {
        let mut x = X;
        x[0] = x_p;
        let design = bench.problem.design(&x, bench.problem.base());
        let wanted = inputs.wanted(stream, Source::Point(design), 8);
        let generation = [(stream, wanted.generation.0)];
        bench.store.put_generations(&generation).await.unwrap();
        bench.board.want(vec![wanted]);
    };
    let lease = async |worker: &str| loop {
        let (leases, _) = bench.lease(worker).await;
        if leases[0].units().unwrap()[0].0.stream == stream {
            return leases[0].clone();
        }
        let answer = bench.answer(&leases[0]);
        bench.report(worker, answer).await;
    };
    for worker in ["old", "new"] {
        bench.register(bench.introduction(worker)).await.unwrap();
    }
    want(0.25).await;
    let old = lease("old").await;
    let late = bench.answer(&old);
    // As the engine does when the model is fitted again.
    bench.board.forget(|id| id == stream);
    let removed = store::DerivedResult::Verification(stream);
    bench.store.remove(&[removed]).await.unwrap();
    bench.report("old", late.clone()).await;
    assert!(bench.store.blocks_of(stream).await.unwrap().is_empty());
    want(0.20).await;
    bench.report("old", late).await;
    assert!(bench.store.blocks_of(stream).await.unwrap().is_empty());
    let new = lease("new").await;
    let units = new.units().unwrap();
    assert_eq!(units[0].0.samples, 0..8, "nothing of it is there");
    let expected = bench.answer(&new);
    bench.report("new", expected.clone()).await;
    let stored = bench.store.first_samples_of(stream, 1).await.unwrap();
    assert_eq!(stored.values(), expected.results[0].samples);
}

#[tokio::test]
async fn a_restarted_coordinator_takes_over_what_its_workers_hold() {
    let mut bench = bench().await;
    bench.register(bench.introduction("w")).await.unwrap();
    let (leases, _) = bench.lease("w").await;
    let held = |lease: &Lease| HeldLease {
        id: lease.id,
        units: lease.units.clone(),
    };

    // After a restart the board knows no leases and workers.
    let empty = Arc::new(Board::new(Options::default(), 8));
    bench.service.board = Arc::clone(&empty);
    let mut request = bench.introduction("w");
    request.held = leases.iter().map(held).collect();
    let starting = bench.register(request.clone()).await.unwrap_err();
    assert_eq!(starting.code(), tonic::Code::Unavailable, "it may pass");
    bench.service.board = board(&bench.problem, 8);
    let mut stale = held(&leases[0]);
    stale.id.as_mut().unwrap().number += 1;
    stale.units[0].generation += 1;
    request.held.push(stale.clone());
    let answer = bench.service.register(Request::new(request)).await.unwrap();
    assert_eq!(answer.into_inner().cancelled, [stale.id.unwrap()]);

    bench.register(bench.introduction("other")).await.unwrap();
    assert!(
        bench.lease("other").await.0.is_empty(),
        "it is computed already"
    );
    let answer = bench.answer(&leases[0]);
    bench.report("w", answer).await;
    assert_eq!(bench.samples().await, SAMPLES);
    assert!(bench.store.failures().await.unwrap().is_empty());
}

/// The coordinator commits a failure and ends before it acknowledges it; its worker reports it to the
/// next one.
#[tokio::test]
async fn a_failure_reported_again_counts_once() {
    let mut bench = bench().await;
    bench.register(bench.introduction("w")).await.unwrap();
    let (leases, _) = bench.lease("w").await;
    let failure = |lease: &Lease, serial| LeaseResult {
        id: lease.id,
        results: vec![UnitResult {
            unit: lease.units.first().copied(),
            error: Some("no load path".to_owned()),
            serial,
            ..UnitResult::default()
        }],
        wall_seconds: 0.5,
        origin: None,
    };
    for _ in 0..2 {
        bench.report("w", failure(&leases[0], 1)).await;
    }
    let histories = || async { bench.store.stream_histories().await.unwrap() };
    assert_eq!(histories().await[&StreamId::design(0)].failures, 1);

    let restarted = board(&bench.problem, 8);
    restarted.remember(histories().await);
    bench.service.board = Arc::clone(&restarted);
    let mut request = bench.introduction("w");
    request.held = vec![HeldLease {
        id: leases[0].id,
        units: leases[0].units.clone(),
    }];
    bench.register(request).await.unwrap();
    assert_eq!(restarted.live().counts.leased, 1, "it is taken over");
    bench.report("w", failure(&leases[0], 1)).await;
    assert_eq!(restarted.live().counts.leased, 0, "and free for others");
    assert_eq!(restarted.live().workers[0].0.failed, 0);
    assert_eq!(bench.store.failures().await.unwrap().len(), 1);

    // Another failure of the same design by the same worker counts. A second copy of the first
    // report does not end the lease that was granted since.
    let (again, _) = bench.lease("w").await;
    bench.report("w", failure(&leases[0], 1)).await;
    assert_eq!(restarted.live().counts.leased, 1);
    bench.report("w", failure(&again[0], 2)).await;
    assert_eq!(restarted.live().workers[0].0.failed, 1);
    assert_eq!(histories().await[&StreamId::design(0)].failures, 2);
}

/// A worker delivers what another one had computed before it ended.
#[tokio::test]
async fn results_from_a_file_are_those_of_the_worker_that_computed_them() {
    let bench = bench().await;
    bench.register(bench.introduction("w")).await.unwrap();
    let (leases, _) = bench.lease("w").await;
    let origin = Some(Origin {
        worker_id: "gone".to_owned(),
        host: "node7:12".to_owned(),
    });
    let result = LeaseResult {
        origin,
        ..bench.answer(&leases[0])
    };
    bench.report("w", result).await;
    assert_eq!(bench.samples().await, SAMPLES);
    for (name, samples) in [("w", 0), ("gone", SAMPLES), ("node7", SAMPLES)] {
        let of = Discard::Worker(name.to_owned());
        let removed = bench.store.discard(&of, true).await.unwrap();
        assert_eq!(removed.samples, samples as u64, "{name}");
    }
}

#[tokio::test]
async fn what_a_worker_says_of_itself_is_bounded() {
    let bench = bench().await;
    let mut request = bench.introduction("w");
    request.host = "\u{e4}".repeat(10_000);
    bench.register(request.clone()).await.unwrap();
    let host = bench.board.live().workers[0].0.host.clone();
    assert!(host.len() <= 256 && host.len() >= 250, "{}", host.len());
    assert!(
        host.chars().all(|c| "\u{e4} …".contains(c)),
        "cut within a character"
    );
    request.worker_id = "x".to_owned();
    request.host = "node\u{1b}[31m\n7".to_owned();
    bench.register(request.clone()).await.unwrap();
    assert_eq!(bench.board.live().workers[1].0.host, "node␛[31m⏎7");
    let mut named = request.clone();
    named.worker_id = "w\u{1b}[2J".to_owned();
    let refused = bench.register(named).await.unwrap_err();
    assert_eq!(Refusal::of(&refused), Some(Refusal::Malformed));

    request.held = vec![HeldLease::default(); 100_001];
    let refused = bench.register(request).await.unwrap_err();
    assert_eq!(Refusal::of(&refused), Some(Refusal::Malformed));
    assert!(refused.message().contains("100000"), "{refused}");
}

#[tokio::test]
async fn a_long_error_is_stored_without_its_middle_and_without_control_characters() {
    let bench = bench().await;
    bench.register(bench.introduction("w")).await.unwrap();
    let (leases, _) = bench.lease("w").await;
    let error = format!("it\u{1b}[2J failed\n{}\nno licence", "x".repeat(10_000));
    let result = LeaseResult {
        id: leases[0].id,
        results: vec![UnitResult {
            unit: leases[0].units.first().copied(),
            error: Some(error),
            serial: 1,
            ..UnitResult::default()
        }],
        wall_seconds: 0.5,
        origin: None,
    };
    bench.report("w", result).await;
    let stored = bench.store.failures().await.unwrap().remove(0).error;
    assert!(stored.len() <= 1024, "{}", stored.len());
    assert!(stored.starts_with("it␛[2J failed\nxxx"), "{stored}");
    assert!(stored.ends_with("xxx\nno licence"), "{stored}");
}

#[tokio::test]
async fn a_drained_coordinator_leases_nothing_and_says_so() {
    let bench = bench().await;
    bench.register(bench.introduction("w")).await.unwrap();
    let drain = |resume| bench.service.drain(Request::new(DrainRequest { resume }));
    assert_eq!(drain(false).await.unwrap().into_inner().leased, 0);
    assert!(bench.lease("w").await.0.is_empty());
    let explain = bench.service.explain(Request::new(ExplainRequest {})).await;
    let sentences = explain.unwrap().into_inner().sentences;
    assert!(
        sentences.iter().any(|s| s.contains("draining")),
        "{sentences:?}"
    );
    tokio::time::timeout(Duration::from_secs(5), bench.board.drained())
        .await
        .expect("nothing is out");
    drain(true).await.unwrap();
    assert_eq!(bench.lease("w").await.0.len(), 1);
}

#[tokio::test]
async fn whoever_watches_hears_of_a_change_and_of_nothing_else() {
    let bench = bench().await;
    let watch = |seen, wait_ms| {
        let request = WatchRequest { seen, wait_ms };
        let call = bench.service.watch(Request::new(request));
        async { call.await.unwrap().into_inner() }
    };
    let first = watch(0, 0).await;
    let status: Status = serde_json::from_str(&first.status_json).unwrap();
    assert_eq!((status.samples.done, status.live.is_some()), (0, true));
    let again = watch(first.revision, 50).await;
    assert_eq!(again.revision, first.revision, "nothing has happened");
    let (changed, _) = tokio::join!(
        watch(first.revision, 60_000),
        bench.register(bench.introduction("w"))
    );
    assert!(changed.revision > first.revision);
    assert!(changed.status_json.contains("\"host\":\"here\""));
}

#[tokio::test]
async fn a_released_lease_goes_to_the_next_worker_and_counts_as_no_failure() {
    let bench = bench().await;
    for worker in ["leaver", "next"] {
        bench.register(bench.introduction(worker)).await.unwrap();
    }
    let (leases, _) = bench.lease("leaver").await;
    let request = HeartbeatRequest {
        worker_id: "leaver".to_owned(),
        held: vec![LeaseState {
            id: leases[0].id,
            started: true,
        }],
    };
    let heartbeat = bench
        .service
        .heartbeat(Request::new(request))
        .await
        .unwrap()
        .into_inner();
    assert!(heartbeat.cancelled.is_empty());
    let request = ReleaseRequest {
        worker_id: "leaver".to_owned(),
        leases: leases.iter().filter_map(|lease| lease.id).collect(),
        leaving: true,
    };
    bench.service.release(Request::new(request)).await.unwrap();
    assert!(bench.lease("leaver").await.0.is_empty(), "it leaves");
    assert_eq!(bench.lease("next").await.0.len(), 1);
    assert!(bench.store.failures().await.unwrap().is_empty());
}
