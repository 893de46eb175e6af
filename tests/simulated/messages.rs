//! The service answers or refuses any message. A fixed number of random messages ranges from bytes
//! that may decode to anything, through well-formed nonsense, to almost valid results.

use std::time::Duration;

use ledger::{Generation, StreamId, Unit};
use problem::formulation::Problem;
use problem::task::compute;
use proptest::prelude::*;
use prost::Message;
use runner::coordinator::ingest;
use runner::coordinator::service::Service;
use runner::protocol::v1::campaign_server::Campaign as _;
use runner::protocol::v1::{
    self, Design, Directive, DrainRequest, Evaluated, ExplainRequest, HeartbeatRequest, HeldLease,
    LeaseRequest, LeaseResult, LeaseState, Origin, RegisterRequest, ReleaseRequest, ReportRequest,
    RetryRequest, StatusRequest, UnitResult, WatchRequest,
};
use tonic::Request;

use crate::bench::{Memory, campaign, introduction, service, source};

/// A worker's result with nine samples of design 3.
fn answer(problem: &Problem) -> UnitResult {
    let unit = Unit {
        stream: StreamId::design(3),
        generation: Generation(7),
        samples: 5..14,
    };
    let output = compute(problem, &unit, &source(problem, 3));
    runner::protocol::result(&unit, &output.map(Some), 0.1)
}

/// A change of some bytes: the place in thousandths of the length, the number of bytes removed, and
/// the bytes inserted.
type Change = (usize, usize, Vec<u8>);

fn a_change() -> impl Strategy<Value = Change> {
    let words = prop::sample::select(vec![
        "null",
        "-1",
        "1e999",
        "1e308",
        "0",
        "4294967295",
        "18446744073709551616",
        "NaN",
        "[]",
        "{}",
        "\"\"",
        ",",
        "}",
        "\u{0}",
        "\"task\":\"verify\"",
        "\"outcome\":\"refused\"",
    ]);
    let words = words.prop_map(|word| word.as_bytes().to_vec());
    let bytes = prop::collection::vec(any::<u8>(), 0..6);
    (0..1000_usize, 0..12_usize, prop_oneof![words, bytes])
}

fn changed(bytes: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (place, length, new) in changes {
        let start = bytes.len() * place / 1000;
        let end = bytes.len().min(start + length);
        bytes.splice(start..end, new.iter().copied());
    }
    bytes
}

/// Decodes bytes as every kind of message and sends those that are valid.
async fn send(service: &Service<Memory>, bytes: &[u8]) {
    macro_rules! call {
        ($($method:ident: $message:ty),*) => {
            $(if let Ok(message) = <$message>::decode(bytes) {
                // Any answer or refusal is acceptable.
                let _ = service.$method(Request::new(message)).await;
            })*
        };
    }
    call!(
        register: RegisterRequest,
        lease: LeaseRequest,
        heartbeat: HeartbeatRequest,
        report: ReportRequest,
        release: ReleaseRequest,
        status: StatusRequest,
        watch: WatchRequest,
        explain: ExplainRequest,
        drain: DrainRequest,
        retry: RetryRequest
    );
}

/// A runtime whose clock jumps to the end of every wait.
fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_current_thread()
        .enable_time()
        .start_paused(true)
        .build()
        .expect("a runtime")
}

fn a_worker() -> impl Strategy<Value = String> {
    prop_oneof![4 => Just("known".to_owned()), 1 => "\\PC{0,200}"]
}

/// Ids of leases that exist, may exist, and cannot exist.
fn a_lease() -> impl Strategy<Value = v1::LeaseId> {
    let epoch = prop_oneof![4 => Just(1), 1 => any::<u64>()];
    let number = prop_oneof![4 => 0..40_u64, 1 => any::<u64>()];
    (epoch, number).prop_map(|(epoch, number)| v1::LeaseId { epoch, number })
}

fn a_unit() -> impl Strategy<Value = v1::Unit> {
    let index = prop_oneof![3 => 0..8_u64, 1 => any::<u64>()];
    let first = prop_oneof![3 => 0..500_u32, 1 => any::<u32>()];
    let count = prop_oneof![3 => 0..500_u32, 1 => any::<u32>()];
    (0..5_i32, index, any::<u64>(), first, count).prop_map(
        |(kind, index, generation, first, count)| v1::Unit {
            kind,
            index,
            generation,
            first,
            count,
        },
    )
}

fn a_unit_result() -> impl Strategy<Value = UnitResult> {
    let numbers = || prop::collection::vec(any::<f64>(), 0..12);
    let text = || prop::option::of("\\PC{0,40}");
    let unit = (
        prop::option::of(a_unit()),
        numbers(),
        numbers(),
        text(),
        text(),
    );
    let evaluated = (
        numbers(),
        text(),
        any::<f64>(),
        numbers(),
        numbers(),
        numbers(),
    );
    let evaluated = evaluated.prop_map(
        |(values, refused, value, criteria, worn_criteria, samples)| Evaluated {
            design: (!values.is_empty()).then_some(Design {
                values,
                responses: Vec::new(),
            }),
            refused,
            value,
            criteria,
            worn_criteria,
            samples,
        },
    );
    let evaluated = prop::collection::vec(evaluated, 0..3);
    (unit, text(), text(), any::<u64>(), any::<f64>(), evaluated).prop_map(
        |(
            (unit, responses, samples, ruled_out, refused),
            run_json,
            error,
            serial,
            cpu_seconds,
            evaluated,
        )| {
            UnitResult {
                unit,
                responses,
                samples,
                ruled_out,
                refused,
                run_json,
                error,
                serial,
                cpu_seconds,
                evaluated,
            }
        },
    )
}

fn a_result() -> impl Strategy<Value = LeaseResult> {
    let units = prop::collection::vec(a_unit_result(), 0..4);
    let origin = prop::option::of(any::<(String, String)>());
    (a_lease(), units, any::<f64>(), origin).prop_map(|(id, results, wall_seconds, origin)| {
        LeaseResult {
            id: Some(id),
            results,
            wall_seconds,
            origin: origin.map(|(worker_id, host)| Origin { worker_id, host }),
        }
    })
}

/// The bytes of a well-formed but meaningless message.
fn nonsense() -> impl Strategy<Value = Vec<u8>> {
    let state = (a_lease(), any::<bool>());
    let state = state.prop_map(|(id, started)| LeaseState {
        id: Some(id),
        started,
    });
    let held = (a_lease(), prop::collection::vec(a_unit(), 0..4));
    let held = held.prop_map(|(id, units)| HeldLease {
        id: Some(id),
        units,
    });
    let version = prop_oneof![Just(runner::identity::BUILD.to_owned()), "\\PC{0,9}"];
    let held = prop::collection::vec(held, 0..4);
    let register = (a_worker(), version, any::<u32>(), "[0-9a-f]{0,64}", held).prop_map(
        |(worker_id, program_version, slots, model_digest, held)| {
            RegisterRequest {
                worker_id,
                host: String::new(),
                program_version,
                model_digest,
                slots,
                held,
                died: Vec::new(),
            }
            .encode_to_vec()
        },
    );
    let lease = (a_worker(), any::<u32>(), any::<u32>(), any::<f64>());
    let lease = lease.prop_map(|(worker_id, credit, wait_ms, seconds)| {
        LeaseRequest {
            worker_id,
            credit,
            wait_ms,
            seconds,
        }
        .encode_to_vec()
    });
    let heartbeat = (a_worker(), prop::collection::vec(state, 0..5));
    let heartbeat = heartbeat
        .prop_map(|(worker_id, held)| HeartbeatRequest { worker_id, held }.encode_to_vec());
    let report = (a_worker(), prop::collection::vec(a_result(), 0..5));
    let report = report
        .prop_map(|(worker_id, results)| ReportRequest { worker_id, results }.encode_to_vec());
    // No worker announces that it leaves, since it would get no further leases.
    let release = (a_worker(), prop::collection::vec(a_lease(), 0..5));
    let release = release.prop_map(|(worker_id, leases)| {
        ReleaseRequest {
            worker_id,
            leases,
            leaving: false,
        }
        .encode_to_vec()
    });
    prop_oneof![register, lease, heartbeat, report, release]
}

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

#[test]
fn no_bytes_break_the_reading_of_results() {
    let problem = Problem::new(campaign());
    let good = answer(&problem);
    let read = ingest::read(&problem, &good).expect("it is whole");
    assert_eq!(read.rows.expect("it is right").samples[0].samples.len(), 9);
    let answer = good.encode_to_vec();
    let bytes = prop::collection::vec(any::<u8>(), 0..200);
    let changes = prop::collection::vec(a_change(), 1..5);
    let payload = prop_oneof![
        1 => bytes,
        3 => changes.prop_map(move |changes| changed(&answer, &changes)),
    ];
    proptest!(config(4000), |(payload in payload)| {
        let Ok(result) = UnitResult::decode(&*payload) else {
            return Ok(());
        };
        let Ok(read) = ingest::read(&problem, &result) else {
            return Ok(());
        };
        if let Ok(batch) = read.rows {
            prop_assert!(batch.times.iter().all(|time| time.cpu_seconds >= 0.0));
            // The rows cover the unit and hold only plausible values.
            let range = u64::from(read.unit.samples.start)..u64::from(read.unit.samples.end);
            let is_right = |block: &store::SampleBlock| {
                let is_right =
                    |(sample, values): (u64, &[f64])| range.contains(&sample) && (0.0..=1e6).contains(&values[0]);
                block.stream == read.unit.stream && block.indexed().all(is_right)
            };
            prop_assert!(batch.samples.iter().all(is_right));
        }
    });
}

#[test]
fn no_message_breaks_the_service() {
    let problem = Problem::new(campaign());
    let bytes = prop::collection::vec(any::<u8>(), 0..300);
    let broken = (nonsense(), prop::collection::vec(a_change(), 1..3))
        .prop_map(|(message, changes)| changed(&message, &changes));
    let message = prop_oneof![1 => bytes, 3 => nonsense(), 2 => broken];
    proptest!(config(300), |(messages in prop::collection::vec(message, 1..12))| {
        runtime().block_on(async {
            let memory = Memory::default();
            let service = service(&problem, &memory, 1);
            let known = Request::new(introduction("known"));
            service.register(known).await.expect("a good introduction");
            for message in &messages {
                send(&service, message).await;
            }
            // The service still works: a well-behaved worker gets a lease, unless one of the
            // messages stopped leasing.
            let _ = service.board.drain(false);
            // A worker that holds all jobs has had them so long that others get copies.
            tokio::time::advance(Duration::from_secs(3600)).await;
            let good = Request::new(introduction("good"));
            service.register(good).await.expect("a good introduction");
            let request = LeaseRequest { worker_id: "good".to_owned(), credit: 1, seconds: 1.0, wait_ms: 0 };
            let response = service.lease(Request::new(request)).await.expect("a good request");
            prop_assert_eq!(response.into_inner().leases.len(), 1);
            Ok(())
        })?;
    });
}

/// A worker that knows this releases the jobs that it has not started, so that the coordinator can end sooner.
#[test]
fn a_heartbeat_says_whether_jobs_are_leased_at_all() {
    let problem = Problem::new(campaign());
    runtime().block_on(async {
        let memory = Memory::default();
        let service = service(&problem, &memory, 1);
        let known = Request::new(introduction("known"));
        service.register(known).await.expect("a good introduction");
        let told = async || {
            let request = HeartbeatRequest {
                worker_id: "known".to_owned(),
                held: Vec::new(),
            };
            let answer = service.heartbeat(Request::new(request)).await;
            answer.expect("it is known").into_inner().directive()
        };
        assert_eq!(told().await, Directive::Continue);
        service.board.drain(true);
        assert_eq!(told().await, Directive::Drain);
        service.board.drain(false);
        assert_eq!(told().await, Directive::Continue);
    });
}
