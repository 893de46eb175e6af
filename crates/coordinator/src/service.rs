//! The gRPC face of the board.

use std::sync::Arc;
use std::time::Duration;

use futures_util::future::join_all;
use protocol::Refusal;
use protocol::v1::{
    Directive, DrainRequest, DrainResponse, ExplainRequest, ExplainResponse, HeartbeatRequest,
    HeartbeatResponse, JobResult, LeaseRequest, LeaseResponse, RegisterRequest, RegisterResponse,
    ReleaseRequest, ReleaseResponse, ReportRequest, ReportResponse, RetryRequest, RetryResponse,
    StatusRequest, StatusResponse, WatchRequest, WatchResponse, campaign_server, job_result,
};
use scheduler::Failure;
use store::{Batch, FailureKind, FailureRow, Receipt, Store, Writer};
use tokio::sync::watch;
use tonic::{Request, Response, Status};
use tracing::{debug, error, info, warn};

use crate::board::Board;
use crate::ingest::{self, Parsed};
use crate::status;

/// The longest a call may wait for something to happen.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// The most bytes of what a worker says about a failure, and of its host's name, that are kept.
const ERROR_BYTES: usize = 16 << 10;
const HOST_BYTES: usize = 256;
/// The most jobs that a worker may say to hold from before: several times what one ever holds.
const HELD_JOBS: usize = 100_000;

/// Where results go and where status comes from: the store, or a stand-in for it in tests whose
/// clock is not the system's.
#[tonic::async_trait]
pub trait Recorder: Clone + Send + Sync + 'static {
    /// Stores a batch, all of it or nothing, and returns when it is safe.
    async fn record(&self, batch: Batch) -> Result<Receipt, store::Error>;

    /// Whether the failure to which its worker gave this number is recorded.
    async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, store::Error>;

    /// The digest of the simulator whose samples are held, which becomes `offered` if there is none.
    async fn pin_model(&self, offered: &str) -> Result<(), store::Error>;

    /// How far the campaign is.
    async fn status(&self) -> anyhow::Result<status::Status>;
}

/// The real thing.
#[derive(Debug, Clone)]
pub struct StoreRecorder {
    store: Store,
    writer: Writer,
    /// The first failure to write that is not the rows' fault.
    broken: Arc<watch::Sender<Option<store::Error>>>,
}

impl StoreRecorder {
    /// A recorder of this store.
    ///
    /// # Errors
    ///
    /// The store was opened for reading.
    pub fn new(store: &Store) -> Result<Self, store::Error> {
        Ok(Self {
            store: store.clone(),
            writer: store.writer()?,
            broken: Arc::new(watch::Sender::new(None)),
        })
    }

    /// Ends when the store cannot be written any more, as when the disk is full, with the reason.
    pub async fn broken(&self) -> store::Error {
        let mut watched = self.broken.subscribe();
        loop {
            if let Some(error) = watched.borrow_and_update().clone() {
                return error;
            }
            if watched.changed().await.is_err() {
                // This recorder is a sender, so there is one.
                std::future::pending::<()>().await;
            }
        }
    }
}

#[tonic::async_trait]
impl Recorder for StoreRecorder {
    async fn record(&self, batch: Batch) -> Result<Receipt, store::Error> {
        let outcome = self.writer.submit(batch).await;
        if let Err(error) = &outcome
            && !error.is_refusal()
        {
            self.broken.send_if_modified(|first| match first {
                Some(_) => false,
                None => {
                    *first = Some(error.clone());
                    true
                }
            });
        }
        outcome
    }

    async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, store::Error> {
        self.store.knows_failure(worker, serial).await
    }

    async fn pin_model(&self, offered: &str) -> Result<(), store::Error> {
        self.store.pin_model_digest(offered).await
    }

    async fn status(&self) -> anyhow::Result<status::Status> {
        status::read(&self.store).await
    }
}

/// What the service needs to answer; clones share it.
#[derive(Clone)]
pub struct Service<R> {
    /// The jobs and workers.
    pub board: Arc<Board>,
    /// Where results go.
    pub recorder: R,
    /// The campaign as JSON, for workers.
    pub campaign_json: String,
    /// What a worker's simulator must answer like; none for an external simulator, which only
    /// workers can ask.
    pub model_digest: Option<String>,
}

#[tonic::async_trait]
impl<R: Recorder> campaign_server::Campaign for Service<R> {
    async fn register(
        &self,
        request: Request<RegisterRequest>,
    ) -> Result<Response<RegisterResponse>, Status> {
        let request = request.into_inner();
        let version = env!("CARGO_PKG_VERSION");
        if request.worker_id.is_empty() || request.worker_id.len() > 128 || request.slots == 0 {
            return Err(Refusal::Malformed
                .status("a worker needs an id of 1 to 128 characters and at least one slot"));
        }
        if request.held.len() > HELD_JOBS {
            return Err(Refusal::Malformed
                .status(format!("a worker cannot hold more than {HELD_JOBS} jobs")));
        }
        if request.program_version != version {
            let theirs = &request.program_version;
            return Err(Refusal::Version.status(format!(
                "this coordinator is version {version}, the worker is {theirs:?}: run the same \
                 build on both sides"
            )));
        }
        self.require_open()?;
        // A worker's first call asks what the campaign is; only the one that brings the digest of
        // its answers makes it a worker.
        let mut cancelled = Vec::new();
        if !request.model_digest.is_empty() {
            self.check_model(&request.model_digest).await?;
            cancelled = self.board.register(
                &request.worker_id,
                beginning(&request.host, HOST_BYTES),
                request.slots,
                &request.held,
            );
            info!(worker = %request.worker_id, host = %request.host, slots = request.slots,
                held = request.held.len(), "worker registered");
        }
        let lease = self.board.lease_time();
        Ok(Response::new(RegisterResponse {
            campaign_json: self.campaign_json.clone(),
            epoch: self.board.epoch(),
            lease_ms: lease.as_millis() as u32,
            heartbeat_ms: (lease / 5).as_millis() as u32,
            cancelled,
        }))
    }

    async fn lease(
        &self,
        request: Request<LeaseRequest>,
    ) -> Result<Response<LeaseResponse>, Status> {
        let request = request.into_inner();
        if !self.board.is_known(&request.worker_id) {
            return Ok(Response::new(LeaseResponse {
                jobs: Vec::new(),
                directive: Directive::Register.into(),
            }));
        }
        let wait = Duration::from_millis(request.wait_ms.into()).min(LONGEST_WAIT);
        let credit = (request.credit as usize).min(10_000);
        let (worker, seconds) = (&request.worker_id, request.seconds);
        let jobs = self.board.lease(worker, credit, seconds, wait).await;
        let directive = if self.board.is_finished_for(&request.worker_id) {
            Directive::Finished
        } else {
            Directive::Continue
        };
        Ok(Response::new(LeaseResponse {
            jobs,
            directive: directive.into(),
        }))
    }

    async fn report(
        &self,
        request: Request<ReportRequest>,
    ) -> Result<Response<ReportResponse>, Status> {
        let request = request.into_inner();
        if !self.board.is_known(&request.worker_id) {
            return Ok(Response::new(ReportResponse {
                directive: Directive::Register.into(),
            }));
        }
        let service = self.clone();
        // A caller that goes away must not leave results stored but their jobs open.
        tokio::spawn(async move { service.take_results(request).await })
            .await
            .map_err(|_| Status::internal("the report was abandoned"))??;
        Ok(Response::new(ReportResponse {
            directive: Directive::Continue.into(),
        }))
    }

    async fn heartbeat(
        &self,
        request: Request<HeartbeatRequest>,
    ) -> Result<Response<HeartbeatResponse>, Status> {
        let request = request.into_inner();
        if !self.board.is_known(&request.worker_id) {
            return Ok(Response::new(HeartbeatResponse {
                directive: Directive::Register.into(),
                cancelled: Vec::new(),
            }));
        }
        let cancelled = self.board.heartbeat(&request.worker_id, &request.held);
        let directive = if self.board.is_draining() {
            Directive::Drain
        } else {
            Directive::Continue
        };
        Ok(Response::new(HeartbeatResponse {
            directive: directive.into(),
            cancelled,
        }))
    }

    async fn release(
        &self,
        request: Request<ReleaseRequest>,
    ) -> Result<Response<ReleaseResponse>, Status> {
        let request = request.into_inner();
        // What a stranger gives back is not its own.
        if self.board.is_known(&request.worker_id) {
            self.board.release(&request.worker_id, &request.jobs);
        }
        Ok(Response::new(ReleaseResponse {}))
    }

    async fn status(
        &self,
        _request: Request<StatusRequest>,
    ) -> Result<Response<StatusResponse>, Status> {
        let status_json = self.status_json().await?;
        Ok(Response::new(StatusResponse { status_json }))
    }

    async fn watch(
        &self,
        request: Request<WatchRequest>,
    ) -> Result<Response<WatchResponse>, Status> {
        let request = request.into_inner();
        let wait = Duration::from_millis(request.wait_ms.into()).min(LONGEST_WAIT);
        let revision = self.board.changed(request.seen, wait).await;
        Ok(Response::new(WatchResponse {
            revision,
            status_json: self.status_json().await?,
        }))
    }

    async fn explain(
        &self,
        _request: Request<ExplainRequest>,
    ) -> Result<Response<ExplainResponse>, Status> {
        let mut sentences = self.board.explain();
        // Without the store there is less to say, but something.
        let status = self.recorder.status().await.ok();
        sentences.extend(status.and_then(|status| status.round_sentence()));
        Ok(Response::new(ExplainResponse { sentences }))
    }

    async fn drain(
        &self,
        request: Request<DrainRequest>,
    ) -> Result<Response<DrainResponse>, Status> {
        let resume = request.into_inner().resume;
        let leased = self.board.drain(!resume) as u64;
        if resume {
            info!("leasing again");
        } else {
            info!(leased, "draining: no more jobs are leased");
        }
        Ok(Response::new(DrainResponse { leased }))
    }

    async fn retry(
        &self,
        _request: Request<RetryRequest>,
    ) -> Result<Response<RetryResponse>, Status> {
        let jobs = self.board.retry();
        let jobs: Vec<String> = jobs.into_iter().map(ingest::job_name).collect();
        info!(jobs = %jobs.join(", "), "another chance for jobs that were given up");
        Ok(Response::new(RetryResponse { jobs }))
    }
}

impl<R: Recorder> Service<R> {
    /// Refuses, for a moment only, while the board does not know yet what is needed.
    fn require_open(&self) -> Result<(), Status> {
        if self.board.is_open() {
            Ok(())
        } else {
            Err(Status::unavailable("the coordinator is starting"))
        }
    }

    async fn check_model(&self, offered: &str) -> Result<(), Status> {
        let refuse = || {
            Refusal::Model.status(
                "the worker's simulator gives other numbers than the one that this campaign was \
                 started with, so their samples must not be mixed: run the same build (or \
                 the same external program) everywhere",
            )
        };
        match &self.model_digest {
            Some(digest) if digest == offered => Ok(()),
            Some(_) => Err(refuse()),
            None => match self.recorder.pin_model(offered).await {
                Ok(()) => Ok(()),
                Err(store::Error::ModelDigestConflict { .. }) => Err(refuse()),
                Err(failed) => Err(Status::unavailable(format!("not stored: {failed}"))),
            },
        }
    }

    async fn status_json(&self) -> Result<String, Status> {
        let status = self
            .recorder
            .status()
            .await
            .map_err(|error| Status::unavailable(error.to_string()))?
            .with(self.board.live());
        serde_json::to_string(&status).map_err(|error| Status::internal(error.to_string()))
    }

    async fn take_results(&self, request: ReportRequest) -> Result<(), Status> {
        let worker = &request.worker_id;
        let mut accepted = Vec::new();
        let mut commits = Vec::new();
        for result in &request.results {
            match self.read(result) {
                Ok(Parsed { batch, covered }) => {
                    if batch == Batch::default() {
                        debug!(job = %ingest::job_name(result.job), %worker, "a stale result");
                    }
                    accepted.push((result, covered));
                    commits.push(self.recorder.record(batch));
                }
                Err(error) => self.fail(worker, result, &error).await?,
            }
        }
        // One result that contradicts the store must not take the others with it, so each is a
        // batch of its own; the writer commits all that are waiting at once.
        for ((result, covered), commit) in accepted.into_iter().zip(join_all(commits).await) {
            match commit {
                Ok(_) => self.board.complete(
                    worker,
                    result.job,
                    result.attempt,
                    &covered,
                    result.wall_seconds,
                ),
                Err(refused) if refused.is_refusal() => {
                    // What is stored stays. Somebody computes other numbers, which must be heard;
                    // a job that is done stays done, any other one is tried again elsewhere.
                    error!(job = %ingest::job_name(result.job), %worker, error = %refused,
                        "a worker contradicts the store");
                    self.fail(worker, result, &refused.to_string()).await?;
                }
                Err(failed) => {
                    error!(error = %failed, "results could not be stored");
                    return Err(Status::unavailable(format!("not stored: {failed}")));
                }
            }
        }
        Ok(())
    }

    fn read(&self, result: &JobResult) -> Result<Parsed, String> {
        match &result.outcome {
            Some(job_result::Outcome::Result(payload)) => {
                let posted = self.board.task(result.job);
                let task = posted.as_ref().map(|posted| &posted.task);
                ingest::rows(result.job, task, payload, result.cpu_seconds)
            }
            Some(job_result::Outcome::Error(error)) => Err(error.clone()),
            None => Err("the report brings neither a result nor an error".to_owned()),
        }
    }

    /// Counts a failure and records it, once for each of the worker's numbers.
    async fn fail(&self, worker: &str, result: &JobResult, error: &str) -> Result<(), Status> {
        let serial = (result.serial > 0).then_some(result.serial);
        let not_stored = |error: store::Error| Status::unavailable(format!("not stored: {error}"));
        if let Some(serial) = serial
            && self
                .recorder
                .knows_failure(worker, serial)
                .await
                .map_err(not_stored)?
        {
            let (job, attempt) = (result.job, result.attempt);
            self.board.failed_before(worker, job, attempt);
            return Ok(());
        }
        let name = ingest::job_name(result.job);
        let error = beginning(error, ERROR_BYTES);
        let failure = self
            .board
            .fail(worker, result.job, result.attempt, error.to_owned());
        let kind = if failure == Failure::Quarantined {
            error!(job = %name, %worker, %error, "a job was given up");
            FailureKind::Quarantine
        } else {
            warn!(job = %name, %worker, %error, "a job failed");
            FailureKind::Failure
        };
        let row = FailureRow {
            serial,
            ..ingest::failure(result.job, result.attempt, worker, kind, error)
        };
        let batch = Batch {
            failures: vec![row],
            ..Batch::default()
        };
        self.recorder
            .record(batch)
            .await
            .map(|_| ())
            .map_err(not_stored)
    }
}

/// As much of a text as fits into so many bytes.
fn beginning(text: &str, bytes: usize) -> &str {
    &text[..text.floor_char_boundary(bytes)]
}
