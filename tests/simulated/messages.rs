//! Whatever arrives, the service answers or refuses. A fixed budget of random messages, from bytes
//! that may decode to anything, over well-formed nonsense, to almost valid results.

use std::time::Duration;

use campaign::formulation::Problem;
use campaign::task::{SampleRange, SampleRequest, Task, execute};
use coordinator::ingest::rows;
use coordinator::service::Service;
use proptest::prelude::*;
use prost::Message;
use protocol::v1::campaign_server::Campaign as _;
use protocol::v1::{
    Directive, DrainRequest, ExplainRequest, HeartbeatRequest, Job, JobAttempt, JobResult,
    LeaseRequest, RegisterRequest, ReleaseRequest, ReportRequest, RetryRequest, StatusRequest,
    WatchRequest, job_result,
};
use tonic::Request;

use crate::bench::{Memory, campaign, introduction, service};

/// A task with its answer as JSON.
fn answered(problem: &Problem) -> (Task, Vec<u8>) {
    let request = SampleRequest {
        design: 3,
        x: [0.25, 1.37, 1.37, 0.85, 1.31, 0.80],
        samples: SampleRange { first: 5, count: 9 },
    };
    let task = Task::Sample {
        frozen: problem.printed_frozen(),
        designs: vec![request],
    };
    let result = execute(problem, &task).expect("the design can be sampled");
    (
        task,
        serde_json::to_vec(&result).expect("numbers and names"),
    )
}

/// A change of some bytes: at a place (in thousandths of the length), how many go, what comes.
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

/// Sends bytes as every kind of message that they happen to be.
async fn send(service: &Service<Memory>, bytes: &[u8]) {
    macro_rules! call {
        ($($method:ident: $message:ty),*) => {
            $(if let Ok(message) = <$message>::decode(bytes) {
                // Any answer will do, and so will any refusal.
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

/// A runtime whose clock leaps over what is waited for.
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

/// Jobs that exist, might exist, and cannot.
fn a_job() -> impl Strategy<Value = u64> {
    prop_oneof![
        (0..3_u64).prop_map(|n| n << 56),
        (0..600_u64).prop_map(|n| (2 << 56) | n),
        any::<u64>()
    ]
}

fn a_result() -> impl Strategy<Value = JobResult> {
    let payload = prop::collection::vec(any::<u8>(), 0..40).prop_map(job_result::Outcome::Result);
    let error = "\\PC{0,40}".prop_map(job_result::Outcome::Error);
    let outcome = prop::option::of(prop_oneof![payload, error]);
    let seconds = (any::<f64>(), any::<f64>());
    (a_job(), any::<u32>(), outcome, seconds, any::<u64>()).prop_map(
        |(job, attempt, outcome, (cpu_seconds, wall_seconds), serial)| JobResult {
            job,
            attempt,
            outcome,
            cpu_seconds,
            wall_seconds,
            serial,
        },
    )
}

/// A well-formed message without sense, as bytes.
fn nonsense() -> impl Strategy<Value = Vec<u8>> {
    let attempt = (a_job(), any::<u32>(), any::<bool>());
    let attempt = attempt.prop_map(|(job, attempt, started)| JobAttempt {
        job,
        attempt,
        started,
    });
    let held = (
        a_job(),
        any::<u32>(),
        prop::collection::vec(any::<u8>(), 0..60),
    );
    let held = held.prop_map(|(job, attempt, payload)| Job {
        job,
        attempt,
        payload,
        seconds: 1.0,
    });
    let version = prop_oneof![Just(env!("CARGO_PKG_VERSION").to_owned()), "\\PC{0,9}"];
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
    let heartbeat = (a_worker(), prop::collection::vec(attempt, 0..5));
    let heartbeat = heartbeat
        .prop_map(|(worker_id, held)| HeartbeatRequest { worker_id, held }.encode_to_vec());
    let report = (a_worker(), prop::collection::vec(a_result(), 0..5));
    let report = report
        .prop_map(|(worker_id, results)| ReportRequest { worker_id, results }.encode_to_vec());
    let release = (a_worker(), prop::collection::vec(a_job(), 0..5));
    let release =
        release.prop_map(|(worker_id, jobs)| ReleaseRequest { worker_id, jobs }.encode_to_vec());
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
    let (task, answer) = answered(&problem);
    assert!(rows(2 << 56, Some(&task), &answer, 0.1).is_ok());
    let bytes = prop::collection::vec(any::<u8>(), 0..200);
    let changes = prop::collection::vec(a_change(), 1..5);
    let payload = prop_oneof![
        1 => bytes,
        3 => changes.prop_map(move |changes| changed(&answer, &changes)),
    ];
    proptest!(config(4000), |(payload in payload, job: u64, known: bool, cpu: f64)| {
        if let Ok(parsed) = rows(job, known.then_some(&task), &payload, cpu) {
            prop_assert!(parsed.batch.times.iter().all(|time| time.cpu_seconds >= 0.0));
            if known {
                // What was accepted answers the task: its design, its samples.
                let asked = |row: &store::SampleRow| row.design == 3 && (5..14).contains(&row.sample);
                prop_assert!(parsed.batch.samples.iter().all(asked));
            }
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
            // It still works: a worker that makes sense gets a job, unless one of the messages
            // stopped the leasing.
            let _ = service.board.drain(false);
            // Whoever holds all jobs by now has had them for so long that others get them, too.
            tokio::time::advance(Duration::from_secs(3600)).await;
            let good = Request::new(introduction("good"));
            service.register(good).await.expect("a good introduction");
            let request = LeaseRequest { worker_id: "good".to_owned(), credit: 1, seconds: 1.0, wait_ms: 0 };
            let response = service.lease(Request::new(request)).await.expect("a good request");
            prop_assert_eq!(response.into_inner().jobs.len(), 1);
            Ok(())
        })?;
    });
}

/// So that a worker gives back what it has not begun, and the coordinator can end the sooner.
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
