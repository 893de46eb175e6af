//! The coordinator's service for the worker of a shard.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::protocol::Refusal;
use crate::protocol::v1::{
    Directive, DrainRequest, DrainResponse, ExplainRequest, ExplainResponse, HeartbeatRequest,
    HeartbeatResponse, Lease, LeaseRequest, LeaseResponse, Origin, RegisterRequest,
    RegisterResponse, ReleaseRequest, ReleaseResponse, ReportRequest, ReportResponse, RetryRequest,
    RetryResponse, StatusRequest, StatusResponse, WatchRequest, WatchResponse, campaign_server,
};
use tonic::{Request, Response, Status};

use crate::shards::error::Error;
use crate::shards::part::{PartWriter, is_done};
use crate::shards::shard::Shard;

/// Time that a lease request waits if no lease is left.
const PAUSE: Duration = Duration::from_millis(20);
/// Duration of a lease: long, because no other worker waits for its jobs.
const LEASE_MS: u32 = 3_600_000;
const HEARTBEAT_MS: u32 = 600_000;

/// The service of a shard, which leases its jobs and writes its part. Clones share their state.
#[derive(Clone)]
pub struct Service(Arc<Inner>);

struct Inner {
    shard: Shard,
    out: PathBuf,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// The part, open once the worker has sent its simulator's digest.
    part: Option<PartWriter>,
    waiting: VecDeque<Lease>,
    leased: Vec<Lease>,
    /// The worker of the shard.
    worker: Option<Origin>,
    failed: Option<Error>,
}

impl Service {
    /// Creates the service of a shard, whose part is `out`.
    #[must_use]
    pub fn new(shard: Shard, out: PathBuf) -> Self {
        Self(Arc::new(Inner {
            shard,
            out,
            state: Mutex::default(),
        }))
    }

    /// Takes the error that prevents writing the part, if there is one.
    #[must_use]
    pub fn failed(&self) -> Option<Error> {
        self.state().failed.take()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Opens the part. Jobs with results in it are not leased again.
    fn open(&self, worker: Origin, model_digest: &str) -> Result<(), Status> {
        let shard = &self.0.shard;
        if shard
            .model_digest
            .as_deref()
            .is_some_and(|own| own != model_digest)
        {
            return Err(Refusal::Model.status(
                "the simulator gives other numbers than the one that planned the shard: use the same build \
                 everywhere",
            ));
        }
        let mut state = self.state();
        if state.part.is_some() {
            return Ok(());
        }
        match PartWriter::open(&self.0.out, shard, model_digest) {
            Ok(part) => {
                let is_open =
                    |lease: &&Lease| lease.units.iter().any(|unit| !is_done(unit, &part.results));
                state.waiting = shard.leases.iter().filter(is_open).cloned().collect();
                state.part = Some(part);
                state.worker = Some(worker);
                Ok(())
            }
            Err(error) => Err(state.fail(error)),
        }
    }
}

impl State {
    /// Records the error and returns the refusal that makes the worker leave.
    fn fail(&mut self, error: Error) -> Status {
        let status = Refusal::Malformed.status(error.to_string());
        self.failed = Some(error);
        status
    }
}

fn none<T>() -> Result<Response<T>, Status> {
    Err(Status::unimplemented("a shard has no clients"))
}

#[tonic::async_trait]
impl campaign_server::Campaign for Service {
    async fn register(
        &self,
        request: Request<RegisterRequest>,
    ) -> Result<Response<RegisterResponse>, Status> {
        let request = request.into_inner();
        // The first call only asks for the campaign.
        if !request.model_digest.is_empty() {
            let worker = Origin {
                worker_id: request.worker_id,
                host: request.host,
            };
            self.open(worker, &request.model_digest)?;
        }
        Ok(Response::new(RegisterResponse {
            campaign_json: self.0.shard.campaign_json.clone(),
            epoch: 1,
            lease_ms: LEASE_MS,
            heartbeat_ms: HEARTBEAT_MS,
            cancelled: Vec::new(),
        }))
    }

    async fn lease(
        &self,
        request: Request<LeaseRequest>,
    ) -> Result<Response<LeaseResponse>, Status> {
        let credit = request.into_inner().credit as usize;
        let (leases, is_finished) = {
            let mut state = self.state();
            let count = credit.min(state.waiting.len());
            let leases: Vec<Lease> = state.waiting.drain(..count).collect();
            state.leased.extend(leases.iter().cloned());
            (leases, state.leased.is_empty())
        };
        if leases.is_empty() && !is_finished {
            tokio::time::sleep(PAUSE).await;
        }
        let directive = match is_finished {
            true => Directive::Finished,
            false => Directive::Continue,
        };
        Ok(Response::new(LeaseResponse {
            leases,
            directive: directive.into(),
        }))
    }

    async fn report(
        &self,
        request: Request<ReportRequest>,
    ) -> Result<Response<ReportResponse>, Status> {
        let mut results = request.into_inner().results;
        let mut state = self.state();
        // `coordinator merge` reports the results of each process under its name.
        for result in &mut results {
            result.origin.clone_from(&state.worker);
        }
        let Some(part) = &mut state.part else {
            return Err(Status::failed_precondition("the worker is not registered"));
        };
        if let Err(error) = part.append(&results) {
            return Err(state.fail(error));
        }
        state
            .leased
            .retain(|lease| !results.iter().any(|result| result.id == lease.id));
        Ok(Response::new(ReportResponse {
            directive: Directive::Continue.into(),
        }))
    }

    async fn heartbeat(
        &self,
        _: Request<HeartbeatRequest>,
    ) -> Result<Response<HeartbeatResponse>, Status> {
        Ok(Response::new(HeartbeatResponse {
            directive: Directive::Continue.into(),
            cancelled: Vec::new(),
            heartbeat_ms: HEARTBEAT_MS,
        }))
    }

    /// A released lease has no results in the part; the next worker of the shard computes it.
    async fn release(
        &self,
        _: Request<ReleaseRequest>,
    ) -> Result<Response<ReleaseResponse>, Status> {
        Ok(Response::new(ReleaseResponse {}))
    }

    async fn status(&self, _: Request<StatusRequest>) -> Result<Response<StatusResponse>, Status> {
        none()
    }

    async fn watch(&self, _: Request<WatchRequest>) -> Result<Response<WatchResponse>, Status> {
        none()
    }

    async fn explain(
        &self,
        _: Request<ExplainRequest>,
    ) -> Result<Response<ExplainResponse>, Status> {
        none()
    }

    async fn drain(&self, _: Request<DrainRequest>) -> Result<Response<DrainResponse>, Status> {
        none()
    }

    async fn retry(&self, _: Request<RetryRequest>) -> Result<Response<RetryResponse>, Status> {
        none()
    }
}
