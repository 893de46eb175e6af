//! The gRPC face of the board.

use std::sync::Arc;
use std::time::Duration;

use protocol::Refusal;
use protocol::v1::{
    Directive, HeartbeatRequest, HeartbeatResponse, JobResult, LeaseRequest, LeaseResponse,
    RegisterRequest, RegisterResponse, ReleaseRequest, ReleaseResponse, ReportRequest,
    ReportResponse, StatusRequest, StatusResponse, campaign_server, job_result,
};
use scheduler::Failure;
use store::{Batch, FailureKind, Store, Writer};
use tonic::{Request, Response, Status};
use tracing::{error, info, warn};

use crate::board::Board;
use crate::{ingest, status};

/// The longest a lease call may wait.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// What the service needs to answer.
pub struct Service {
    /// The jobs and workers.
    pub board: Arc<Board>,
    /// Where results go.
    pub writer: Writer,
    /// Where status comes from.
    pub store: Store,
    /// The campaign as JSON, for workers.
    pub campaign_json: String,
    /// What a worker's simulator must answer like.
    pub model_digest: String,
    /// How long a worker may be silent.
    pub lease: Duration,
}

#[tonic::async_trait]
impl campaign_server::Campaign for Service {
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
        if request.program_version != version {
            let theirs = &request.program_version;
            return Err(Refusal::Version.status(format!(
                "this coordinator is version {version}, the worker is {theirs:?}: run the same \
                 build on both sides"
            )));
        }
        // A worker's first call asks what the campaign is; only the one that brings the digest of
        // its answers makes it a worker.
        if !request.model_digest.is_empty() {
            if request.model_digest != self.model_digest {
                return Err(Refusal::Model.status(
                    "the worker's simulator gives other numbers than the coordinator's, so their \
                     samples must not be mixed: run the same build on both sides",
                ));
            }
            self.board
                .register(&request.worker_id, &request.host, request.slots);
            info!(worker = %request.worker_id, host = %request.host, slots = request.slots,
                "worker registered");
        }
        Ok(Response::new(RegisterResponse {
            campaign_json: self.campaign_json.clone(),
            epoch: self.board.epoch(),
            lease_ms: self.lease.as_millis() as u32,
            heartbeat_ms: (self.lease / 5).as_millis() as u32,
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
        let jobs = self.board.lease(&request.worker_id, credit, wait).await;
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
        let worker = &request.worker_id;
        let mut accepted = Vec::new();
        let mut batches = Vec::new();
        for result in &request.results {
            match self.read(result) {
                Ok(batch) => {
                    accepted.push(result);
                    batches.push(batch);
                }
                Err(error) => self.fail(worker, result, &error).await?,
            }
        }
        // One result that contradicts the store must not take the others with it, so each is a
        // batch of its own; the writer commits all that are waiting at once.
        let commits = batches.into_iter().map(|batch| {
            let writer = self.writer.clone();
            tokio::spawn(async move { writer.submit(batch).await })
        });
        let commits: Vec<_> = commits.collect();
        for (result, commit) in accepted.into_iter().zip(commits) {
            match commit
                .await
                .map_err(|_| Status::internal("the commit was abandoned"))?
            {
                Ok(_) => {
                    self.board.complete(worker, result.job, result.attempt);
                }
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
        Ok(Response::new(HeartbeatResponse {
            directive: Directive::Continue.into(),
            cancelled,
        }))
    }

    async fn release(
        &self,
        request: Request<ReleaseRequest>,
    ) -> Result<Response<ReleaseResponse>, Status> {
        let request = request.into_inner();
        self.board.release(&request.worker_id, &request.jobs);
        Ok(Response::new(ReleaseResponse {}))
    }

    async fn status(
        &self,
        _request: Request<StatusRequest>,
    ) -> Result<Response<StatusResponse>, Status> {
        let status = status::read(&self.store)
            .await
            .map_err(|error| Status::unavailable(error.to_string()))?;
        let status_json =
            serde_json::to_string(&status).map_err(|error| Status::internal(error.to_string()))?;
        Ok(Response::new(StatusResponse { status_json }))
    }
}

impl Service {
    fn read(&self, result: &JobResult) -> Result<Batch, String> {
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

    /// Counts a failure and records it.
    async fn fail(&self, worker: &str, result: &JobResult, error: &str) -> Result<(), Status> {
        let name = ingest::job_name(result.job);
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
        self.record(worker, result, kind, error).await
    }

    async fn record(
        &self,
        worker: &str,
        result: &JobResult,
        kind: FailureKind,
        error: &str,
    ) -> Result<(), Status> {
        let row = ingest::failure(result.job, result.attempt, worker, kind, error);
        let batch = Batch {
            failures: vec![row],
            ..Batch::default()
        };
        self.writer
            .submit(batch)
            .await
            .map(|_| ())
            .map_err(|error| Status::unavailable(format!("not stored: {error}")))
    }
}
