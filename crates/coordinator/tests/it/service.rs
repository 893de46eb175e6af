//! What the service accepts, refuses and stores.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use campaign::batches::StreamId;
use campaign::formulation::Problem;
use campaign::plan::OpenDesign;
use campaign::task::{DesignOutcome, Task, TaskResult, execute};
use campaign::{Campaign, probe};
use coordinator::board::Board;
use coordinator::service::{Service, StoreRecorder};
use coordinator::status::{Optimum, Progress, Status};
use protocol::Refusal;
use protocol::v1::campaign_server::Campaign as _;
use protocol::v1::{
    Directive, DrainRequest, ExplainRequest, HeartbeatRequest, Job, JobAttempt, JobResult,
    LeaseRequest, RegisterRequest, ReleaseRequest, ReportRequest, RetryRequest, WatchRequest,
    job_result,
};
use store::{CampaignRow, DesignRow, FailureKind, Store};
use tempfile::TempDir;
use tonic::Request;

/// The number of the only job on the board.
const JOB: u64 = 2 << 56;

/// How many samples it asks for.
const SAMPLES: usize = 10;

/// The only design.
const X: [f64; 6] = [0.25, 1.37, 1.37, 0.85, 1.31, 0.80];

/// A board with one design that lacks its samples.
fn board(problem: &Problem, epoch: u64) -> Arc<Board> {
    let board = Board::new(scheduler::Options::default(), epoch);
    let design = OpenDesign {
        design: 0,
        x: X,
        missing: std::iter::once(0..SAMPLES as u32).collect(),
    };
    board.post_designs(problem.printed_frozen(), &[design]);
    board.open();
    Arc::new(board)
}

struct Bench {
    _folder: TempDir,
    problem: Problem,
    service: Service<StoreRecorder>,
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
    store.put_designs(&[DesignRow::new(0, X)]).await.unwrap();
    let problem = Problem::new(campaign.clone());
    let board = board(&problem, 7);
    let service = Service {
        board: Arc::clone(&board),
        recorder: StoreRecorder::new(&store).unwrap(),
        campaign_json: campaign.to_json(),
        model_digest: Some(probe::model_digest(&problem)),
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
            model_digest: self.service.model_digest.clone().unwrap(),
            slots: 1,
            held: Vec::new(),
        }
    }

    async fn register(&self, request: RegisterRequest) -> Result<(), tonic::Status> {
        self.service.register(Request::new(request)).await.map(drop)
    }

    async fn lease(&self, worker: &str) -> (Vec<Job>, Directive) {
        let request = LeaseRequest {
            worker_id: worker.to_owned(),
            credit: 1,
            seconds: 1.0,
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
        self.report_numbered(worker, attempt, outcome, 0).await
    }

    async fn report_numbered(
        &self,
        worker: &str,
        attempt: u32,
        outcome: job_result::Outcome,
        serial: u64,
    ) -> Directive {
        let result = JobResult {
            job: JOB,
            attempt,
            outcome: Some(outcome),
            cpu_seconds: 0.5,
            wall_seconds: 0.5,
            serial,
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
    assert!(bench.board.live().workers.is_empty());
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
    let (jobs, _) = bench.lease("honest").await;
    let answer = bench.answer(&jobs[0]);
    let outcome = job_result::Outcome::Result(answer.clone());
    bench.report("honest", jobs[0].attempt, outcome).await;
    let held = bench.store.samples_digest().await.unwrap();

    let mut result: TaskResult = serde_json::from_slice(&answer).unwrap();
    if let TaskResult::Sample { designs } = &mut result
        && let DesignOutcome::Simulated { samples_um, .. } = &mut designs[0].outcome
    {
        samples_um[7] += 1e-9;
    }
    let outcome = job_result::Outcome::Result(serde_json::to_vec(&result).unwrap());
    bench.report("wrong", 2, outcome).await;
    assert_eq!(bench.store.samples_digest().await.unwrap(), held);
    let failures = bench.store.failures().await.unwrap();
    assert_eq!(failures.len(), 1);
    assert_eq!(failures[0].worker, "wrong");
    assert!(
        failures[0].error.contains("sample 7 of design 0"),
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
    let (given_up, _) = bench.board.given_up();
    assert_eq!(given_up, BTreeSet::from([StreamId::Design(0)]));
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

    // Another chance, and this time an honest worker.
    let retried = bench.service.retry(Request::new(RetryRequest {})).await;
    assert_eq!(retried.unwrap().into_inner().jobs, ["sample-0-0"]);
    bench.register(bench.introduction("e")).await.unwrap();
    let (jobs, _) = bench.lease("e").await;
    let outcome = job_result::Outcome::Result(bench.answer(&jobs[0]));
    bench.report("e", jobs[0].attempt, outcome).await;
    assert_eq!(bench.samples().await, SAMPLES);
    assert!(bench.board.given_up().0.is_empty());
}

#[tokio::test]
async fn what_a_partial_result_leaves_undone_is_leased_again() {
    let bench = bench().await;
    bench.register(bench.introduction("leaver")).await.unwrap();
    let (jobs, _) = bench.lease("leaver").await;
    let mut result: TaskResult = serde_json::from_slice(&bench.answer(&jobs[0])).unwrap();
    let TaskResult::Sample { designs } = &mut result else {
        panic!("a sampling result")
    };
    let DesignOutcome::Simulated { samples_um, .. } = &mut designs[0].outcome else {
        panic!("the design can be simulated")
    };
    samples_um.truncate(4);
    let outcome = job_result::Outcome::Result(serde_json::to_vec(&result).unwrap());
    bench.report("leaver", jobs[0].attempt, outcome).await;
    assert_eq!(bench.samples().await, 4);

    bench.register(bench.introduction("next")).await.unwrap();
    let (jobs, _) = bench.lease("next").await;
    let Ok(Task::Sample { designs, .. }) = serde_json::from_slice(&jobs[0].payload) else {
        panic!("a sampling task")
    };
    assert_eq!((designs[0].samples.first, designs[0].samples.count), (4, 6));
}

#[tokio::test]
async fn a_restarted_coordinator_takes_over_what_its_workers_hold() {
    let mut bench = bench().await;
    bench.register(bench.introduction("w")).await.unwrap();
    let (jobs, _) = bench.lease("w").await;

    // The restart: nothing is known of jobs and workers.
    let empty = Arc::new(Board::new(scheduler::Options::default(), 8));
    bench.service.board = Arc::clone(&empty);
    let mut request = bench.introduction("w");
    request.held = jobs.clone();
    let starting = bench.register(request.clone()).await.unwrap_err();
    assert_eq!(starting.code(), tonic::Code::Unavailable, "it may pass");
    bench.service.board = board(&bench.problem, 8);
    let mut stale = jobs[0].clone();
    stale.job += 1 << 24;
    stale.payload = br#"{"verify":{}}"#.to_vec();
    request.held.push(stale.clone());
    let answer = bench.service.register(Request::new(request)).await.unwrap();
    assert_eq!(answer.into_inner().cancelled, [stale.job]);

    bench.register(bench.introduction("other")).await.unwrap();
    let (others, _) = bench.lease("other").await;
    let is_other = |job: &Job| job.job != jobs[0].job || job.attempt > jobs[0].attempt;
    assert!(others.iter().all(is_other), "it is computed already");
    let outcome = job_result::Outcome::Result(bench.answer(&jobs[0]));
    bench.report("w", jobs[0].attempt, outcome).await;
    assert_eq!(bench.samples().await, SAMPLES);
    assert!(bench.store.failures().await.unwrap().is_empty());
}

/// The coordinator commits a failure and ends before it acknowledges it; its worker reports it to the
/// next one.
#[tokio::test]
async fn a_failure_reported_again_counts_once() {
    let mut bench = bench().await;
    let error = || job_result::Outcome::Error("no load path".to_owned());
    bench.register(bench.introduction("w")).await.unwrap();
    let (jobs, _) = bench.lease("w").await;
    let attempt = jobs[0].attempt;
    for _ in 0..2 {
        bench.report_numbered("w", attempt, error(), 1).await;
    }
    let histories = || async { bench.store.job_histories().await.unwrap() };
    assert_eq!(histories().await[0].failures, 1);

    let restarted = board(&bench.problem, 8);
    restarted.remember(histories().await);
    bench.service.board = Arc::clone(&restarted);
    let mut request = bench.introduction("w");
    request.held = jobs.clone();
    bench.register(request).await.unwrap();
    assert_eq!(restarted.live().counts.leased, 1, "it is taken over");
    bench.report_numbered("w", attempt, error(), 1).await;
    assert_eq!(restarted.live().counts.leased, 0, "and free for others");
    assert_eq!(restarted.live().workers[0].failed, 0);
    assert_eq!(bench.store.failures().await.unwrap().len(), 1);

    // Another failure counts, also of the same job by the same worker; an overtaken copy of the first
    // one takes nothing away from whoever holds the job now.
    let (jobs, _) = bench.lease("w").await;
    assert_eq!(jobs[0].job, JOB);
    bench.report_numbered("w", attempt, error(), 1).await;
    assert_eq!(restarted.live().counts.leased, 1);
    bench
        .report_numbered("w", jobs[0].attempt, error(), 2)
        .await;
    assert_eq!(restarted.live().workers[0].failed, 1);
    assert_eq!(bench.store.job_histories().await.unwrap()[0].failures, 2);
}

#[tokio::test]
async fn what_a_worker_says_of_itself_is_bounded() {
    let bench = bench().await;
    let mut request = bench.introduction("w");
    request.host = "\u{e4}".repeat(10_000);
    bench.register(request.clone()).await.unwrap();
    let host = bench.board.live().workers[0].host.clone();
    assert!(host.len() <= 256 && host.len() >= 255, "{}", host.len());
    assert!(
        host.chars().all(|c| c == '\u{e4}'),
        "cut within a character"
    );

    request.held = vec![Job::default(); 100_001];
    let refused = bench.register(request).await.unwrap_err();
    assert_eq!(Refusal::of(&refused), Some(Refusal::Malformed));
    assert!(refused.message().contains("100000"), "{refused}");
}

#[tokio::test]
async fn time_to_go_is_that_of_the_stage() {
    let bench = bench().await;
    bench.register(bench.introduction("w")).await.unwrap();
    let mut live = bench.board.live();
    live.workers[0].slots = 4;
    live.samples_per_second = 50.0;
    live.run_seconds = Some(6.0);
    let mut status = coordinator::status::read(&bench.store).await.unwrap();
    let of_stage = |status: &Status| status.clone().with(live.clone()).live.unwrap().eta_seconds;

    // Three approaches with as many starts as the paper's file says.
    status.stage = "optimise".to_owned();
    status.optimiser_runs.done = status.optimiser_runs.wanted - 2;
    assert_eq!(of_stage(&status), Some(2.0 * 6.0 / 4.0));

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
    let mut idle = live.clone();
    idle.samples_per_second = 0.0;
    status.stage = "verify".to_owned();
    assert_eq!(status.with(idle).live.unwrap().eta_seconds, None);
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
