//! What the service accepts, refuses and stores.

use std::sync::Arc;
use std::time::Duration;

use campaign::formulation::Problem;
use campaign::task::{SampleRange, SampleRequest, Task, execute};
use campaign::{Campaign, probe};
use coordinator::board::Board;
use coordinator::service::Service;
use protocol::Refusal;
use protocol::v1::campaign_server::Campaign as _;
use protocol::v1::{
    Directive, HeartbeatRequest, Job, JobAttempt, JobResult, LeaseRequest, RegisterRequest,
    ReleaseRequest, ReportRequest, job_result,
};
use store::{CampaignRow, DesignRow, FailureKind, Store};
use tempfile::TempDir;
use tonic::{Request, Status};

/// The number of the only job on the board.
const JOB: u64 = 2 << 56;

struct Bench {
    _folder: TempDir,
    problem: Problem,
    service: Service,
    board: Arc<Board>,
    store: Store,
}

async fn bench() -> Bench {
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
    let store = Store::create_or_open(&folder.path().join("s.db"), &row)
        .await
        .unwrap();
    let x = [0.25, 1.37, 1.37, 0.85, 1.31, 0.80];
    let [x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r] = x;
    store
        .put_designs(&[DesignRow {
            design: 0,
            x_p,
            x_r,
            ha0_p,
            ha0_r,
            hf0_p,
            hf0_r,
        }])
        .await
        .unwrap();
    let problem = Problem::new(campaign.clone());
    let board = Arc::new(Board::new(scheduler::Options::default(), 7));
    board.post(vec![(
        JOB,
        Task::Sample {
            frozen: problem.printed_frozen(),
            designs: vec![SampleRequest {
                design: 0,
                x,
                samples: SampleRange {
                    first: 0,
                    count: 30,
                },
            }],
        },
    )]);
    let service = Service {
        board: Arc::clone(&board),
        writer: store.writer().unwrap(),
        store: store.clone(),
        campaign_json: campaign.to_json(),
        model_digest: probe::model_digest(&problem),
        lease: Duration::from_secs(5),
    };
    Bench {
        _folder: folder,
        problem,
        service,
        board,
        store,
    }
}

impl Bench {
    fn introduction(&self, worker: &str) -> RegisterRequest {
        RegisterRequest {
            worker_id: worker.to_owned(),
            host: "here".to_owned(),
            program_version: env!("CARGO_PKG_VERSION").to_owned(),
            model_digest: self.service.model_digest.clone(),
            slots: 1,
        }
    }

    async fn register(&self, request: RegisterRequest) -> Result<(), Status> {
        self.service.register(Request::new(request)).await.map(drop)
    }

    async fn lease(&self, worker: &str) -> (Vec<Job>, Directive) {
        let request = LeaseRequest {
            worker_id: worker.to_owned(),
            credit: 1,
            wait_ms: 0,
        };
        let response = self
            .service
            .lease(Request::new(request))
            .await
            .unwrap()
            .into_inner();
        let directive = response.directive();
        (response.jobs, directive)
    }

    async fn report(&self, worker: &str, attempt: u32, outcome: job_result::Outcome) -> Directive {
        let result = JobResult {
            job: JOB,
            attempt,
            outcome: Some(outcome),
            cpu_seconds: 0.5,
        };
        let request = ReportRequest {
            worker_id: worker.to_owned(),
            results: vec![result],
        };
        self.service
            .report(Request::new(request))
            .await
            .unwrap()
            .into_inner()
            .directive()
    }

    fn answer(&self, job: &Job) -> Vec<u8> {
        let task: Task = serde_json::from_slice(&job.payload).unwrap();
        serde_json::to_vec(&execute(&self.problem, &task).unwrap()).unwrap()
    }

    async fn samples(&self) -> usize {
        self.store.samples_of(0).await.unwrap().len()
    }
}

#[tokio::test]
async fn another_version_or_another_model_is_refused_for_good() {
    let bench = bench().await;
    let mut request = bench.introduction("w");
    request.program_version = "99.0.0".to_owned();
    let refused = bench.register(request).await.unwrap_err();
    assert_eq!(Refusal::of(&refused), Some(Refusal::Version));
    assert!(refused.message().contains("99.0.0"), "{refused}");

    let mut request = bench.introduction("w");
    request.model_digest = "0".repeat(64);
    let refused = bench.register(request).await.unwrap_err();
    assert_eq!(Refusal::of(&refused), Some(Refusal::Model));

    let refused = bench.register(bench.introduction("")).await.unwrap_err();
    assert_eq!(Refusal::of(&refused), Some(Refusal::Malformed));
    assert!(bench.board.workers().is_empty());
}

#[tokio::test]
async fn strangers_are_asked_to_register_and_store_nothing() {
    let bench = bench().await;
    assert_eq!(
        bench.lease("stranger").await,
        (Vec::new(), Directive::Register)
    );
    let outcome = job_result::Outcome::Result(b"{}".to_vec());
    assert_eq!(
        bench.report("stranger", 1, outcome).await,
        Directive::Register
    );
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
    let (jobs, _) = bench.lease("w").await;
    assert_eq!(jobs.len(), 1);
    let answer = bench.answer(&jobs[0]);
    for _ in 0..2 {
        let outcome = job_result::Outcome::Result(answer.clone());
        assert_eq!(
            bench.report("w", jobs[0].attempt, outcome).await,
            Directive::Continue
        );
        assert_eq!(bench.samples().await, 30);
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
    let (jobs, _) = bench.lease("honest").await;
    let answer = bench.answer(&jobs[0]);
    let outcome = job_result::Outcome::Result(answer.clone());
    bench.report("honest", jobs[0].attempt, outcome).await;
    let held = bench.store.samples_digest().await.unwrap();

    let mut result: campaign::task::TaskResult = serde_json::from_slice(&answer).unwrap();
    if let campaign::task::TaskResult::Sample { designs } = &mut result
        && let campaign::task::DesignOutcome::Simulated { samples_um, .. } = &mut designs[0].outcome
    {
        samples_um[17] += 1e-9;
    }
    let outcome = job_result::Outcome::Result(serde_json::to_vec(&result).unwrap());
    bench.report("wrong", 2, outcome).await;
    assert_eq!(bench.store.samples_digest().await.unwrap(), held);
    let failures = bench.store.failures().await.unwrap();
    assert_eq!(failures.len(), 1);
    assert_eq!(failures[0].worker, "wrong");
    assert!(
        failures[0].error.contains("sample 17 of design 0"),
        "{}",
        failures[0].error
    );
}

#[tokio::test]
async fn garbage_counts_as_a_failure_until_the_job_is_given_up() {
    let bench = bench().await;
    for worker in ["a", "b", "c", "d"] {
        bench.register(bench.introduction(worker)).await.unwrap();
        let (jobs, _) = bench.lease(worker).await;
        let Some(job) = jobs.first() else { break };
        let outcome = job_result::Outcome::Result(b"\xffgarbage".to_vec());
        assert_eq!(
            bench.report(worker, job.attempt, outcome).await,
            Directive::Continue
        );
    }
    assert_eq!(
        bench.board.quarantined().into_iter().collect::<Vec<_>>(),
        [JOB]
    );
    assert_eq!(bench.samples().await, 0);
    let failures = bench.store.failures().await.unwrap();
    assert_eq!(
        failures.last().map(|row| row.kind),
        Some(FailureKind::Quarantine)
    );
    assert!(
        failures
            .iter()
            .all(|row| row.error.contains("cannot be read"))
    );
}

#[tokio::test]
async fn released_jobs_go_to_the_next_worker_without_blame() {
    let bench = bench().await;
    for worker in ["leaver", "next"] {
        bench.register(bench.introduction(worker)).await.unwrap();
    }
    let (jobs, _) = bench.lease("leaver").await;
    let held = vec![JobAttempt {
        job: JOB,
        attempt: jobs[0].attempt,
        started: true,
    }];
    let request = HeartbeatRequest {
        worker_id: "leaver".to_owned(),
        held,
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
        jobs: vec![JOB],
    };
    bench.service.release(Request::new(request)).await.unwrap();
    let (jobs, _) = bench.lease("next").await;
    assert_eq!(jobs.len(), 1);
    assert!(bench.store.failures().await.unwrap().is_empty());
}
