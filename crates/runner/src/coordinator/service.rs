//! The gRPC service of the board.

use std::sync::Arc;
use std::time::Duration;

use crate::gateway::Peer;
use crate::protocol::Refusal;
use crate::protocol::v1::{
    DeadWorker, Directive, DrainRequest, DrainResponse, ExplainRequest, ExplainResponse,
    HeartbeatRequest, HeartbeatResponse, LeaseRequest, LeaseResponse, RegisterRequest,
    RegisterResponse, ReleaseRequest, ReleaseResponse, ReportRequest, ReportResponse, RetryRequest,
    RetryResponse, StatusRequest, StatusResponse, WatchRequest, WatchResponse, campaign_server,
};
use ledger::{HEARTBEATS_PER_LEASE, LeaseId, Unit, WorkerId};
use problem::formulation::Problem;
use stages::names;
use tonic::{Request, Response, Status};
use tracing::info;

use crate::coordinator::board::{Board, Course, Room};
use crate::coordinator::leases;
use crate::coordinator::receiver::{Receiver, not_stored, other_model};
use crate::coordinator::recorder::Recorder;
use crate::outside;

/// Maximum time that a call may wait for a change.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// Maximum number of leases that a worker may register with: several times what a worker ever
/// holds.
const HELD_LEASES: usize = 100_000;

/// The service. Clones share their state.
#[derive(Clone)]
pub struct Service<R> {
    /// The missing jobs, and the workers that compute them.
    pub board: Arc<Board>,
    /// The recorder of results.
    pub recorder: R,
    /// The campaign's problem.
    pub problem: Arc<Problem>,
    /// The digest that a worker's simulator must have; none for an external simulator, which only
    /// workers can ask.
    pub model_digest: Option<String>,
}

#[tonic::async_trait]
impl<R: Recorder> campaign_server::Campaign for Service<R> {
    async fn register(
        &self,
        request: Request<RegisterRequest>,
    ) -> Result<Response<RegisterResponse>, Status> {
        let peer = peer(&request);
        let request = request.into_inner();
        let id = &request.worker_id;
        let is_id = (1..=128).contains(&id.len()) && !id.contains(char::is_control);
        if !is_id || request.slots == 0 {
            return Err(Refusal::Malformed
                .status("a worker needs an id of 1 to 128 characters and at least one slot"));
        }
        if request.held.len() > HELD_LEASES {
            return Err(Refusal::Malformed.status(format!(
                "a worker cannot hold more than {HELD_LEASES} leases"
            )));
        }
        if request.program_version != crate::identity::BUILD {
            let theirs = &request.program_version;
            return Err(Refusal::Version.status(format!(
                "this coordinator is build {}, the worker is build {theirs:?}: build both from the \
                 same sources, or copy both programs from one machine",
                crate::identity::BUILD
            )));
        }
        self.require_open()?;
        // A worker's first call only asks for the campaign. The call that brings the digest of its
        // simulator registers it.
        let mut cancelled = Vec::new();
        if !request.model_digest.is_empty() {
            self.check_model(&request.worker_id, &request.model_digest)
                .await?;
            for crashed in &request.died {
                self.record_crash(crashed).await?;
            }
            let held = request.held.iter().map(|held| {
                let units: Result<Vec<Unit>, _> = held.units.iter().map(Unit::try_from).collect();
                // A lease with malformed units is registered without units and thus cancelled.
                (
                    held.id.unwrap_or_default().into(),
                    units.unwrap_or_default(),
                )
            });
            let held: Vec<(LeaseId, Vec<Unit>)> = held.collect();
            let host = outside::name(&request.host);
            cancelled = self.board.register(
                &WorkerId::from(request.worker_id.as_str()),
                &host,
                request.slots,
                &held,
            );
            self.attend(peer, &WorkerId::from(request.worker_id.as_str()));
            info!(worker = %request.worker_id, %host, slots = request.slots,
                held = request.held.len(), "worker registered");
        }
        Ok(Response::new(RegisterResponse {
            campaign_json: self.problem.campaign().to_json(),
            epoch: self.board.epoch(),
            lease_ms: self.board.lease_time().as_millis() as u32,
            heartbeat_ms: self.heartbeat_ms(),
            cancelled: cancelled.into_iter().map(Into::into).collect(),
        }))
    }

    async fn lease(
        &self,
        request: Request<LeaseRequest>,
    ) -> Result<Response<LeaseResponse>, Status> {
        let peer = peer(&request);
        let request = request.into_inner();
        let worker = WorkerId::from(request.worker_id.as_str());
        if !self.board.is_known(&worker) {
            return Ok(Response::new(LeaseResponse {
                leases: Vec::new(),
                directive: Directive::Register.into(),
            }));
        }
        self.attend(peer, &worker);
        if self.recorder.has_other_model(worker.as_str()) {
            return Err(other_model());
        }
        let wait = Duration::from_millis(request.wait_ms.into()).min(LONGEST_WAIT);
        let room = Room {
            leases: (request.credit as usize).min(10_000),
            seconds: request.seconds,
        };
        let grants = self.board.lease(&worker, room, wait).await;
        Ok(Response::new(LeaseResponse {
            leases: grants.iter().map(crate::protocol::lease).collect(),
            directive: self.directive(&worker).into(),
        }))
    }

    async fn report(
        &self,
        request: Request<ReportRequest>,
    ) -> Result<Response<ReportResponse>, Status> {
        let request = request.into_inner();
        let worker = WorkerId::from(request.worker_id.as_str());
        if !self.board.is_known(&worker) {
            return Ok(Response::new(ReportResponse {
                directive: Directive::Register.into(),
            }));
        }
        let leases = request.results.iter();
        let leases: Vec<LeaseId> = leases
            .map(|result| result.id.unwrap_or_default().into())
            .collect();
        if self.recorder.has_other_model(worker.as_str()) {
            return Err(self.dismiss_other_model(&worker, &leases));
        }
        // A worker whose calls time out must not pile up reports here.
        let Some(reporting) = self.board.begin_report(&worker) else {
            return Err(Status::unavailable(
                "results of an earlier call are still being stored",
            ));
        };
        let service = self.clone();
        // The task outlives its caller, so that no lease stays open whose results are stored.
        let taken = tokio::spawn(async move {
            let receiver = Receiver {
                problem: &service.problem,
                board: &service.board,
                recorder: &service.recorder,
            };
            let taken = receiver.take_results(&worker, request.results).await;
            drop(reporting);
            // Another worker's results were stored first.
            if taken.is_err() && service.recorder.has_other_model(worker.as_str()) {
                return Err(service.dismiss_other_model(&worker, &leases));
            }
            taken
        });
        taken
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
        let peer = peer(&request);
        let request = request.into_inner();
        let worker = WorkerId::from(request.worker_id.as_str());
        // The worker learns the refusal when it registers again.
        let is_refused = self.recorder.has_other_model(worker.as_str());
        if is_refused || !self.board.is_known(&worker) {
            return Ok(Response::new(HeartbeatResponse {
                directive: Directive::Register.into(),
                cancelled: Vec::new(),
                heartbeat_ms: self.heartbeat_ms(),
            }));
        }
        self.attend(peer, &worker);
        let held = request.held.iter();
        let held: Vec<(LeaseId, bool)> = held
            .map(|held| (held.id.unwrap_or_default().into(), held.started))
            .collect();
        let cancelled = self.board.heartbeat(&worker, &held);
        Ok(Response::new(HeartbeatResponse {
            directive: self.directive(&worker).into(),
            cancelled: cancelled.into_iter().map(Into::into).collect(),
            heartbeat_ms: self.heartbeat_ms(),
        }))
    }

    async fn release(
        &self,
        request: Request<ReleaseRequest>,
    ) -> Result<Response<ReleaseResponse>, Status> {
        let request = request.into_inner();
        let worker = WorkerId::from(request.worker_id.as_str());
        // Only a registered worker can release its leases.
        if self.board.is_known(&worker) {
            let leases: Vec<LeaseId> = request.leases.into_iter().map(Into::into).collect();
            self.board.release(&worker, &leases, request.leaving);
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
        // If the store cannot be read, only the board's sentences are returned.
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
            info!(leased, "draining: nothing more is leased");
        }
        Ok(Response::new(DrainResponse { leased }))
    }

    async fn retry(
        &self,
        _request: Request<RetryRequest>,
    ) -> Result<Response<RetryResponse>, Status> {
        let retried = self.board.retry().into_iter();
        let retried: Vec<String> = retried.map(names::stream_name).collect();
        match &retried[..] {
            [] => info!("asked to retry quarantined streams, but there are none"),
            streams => info!(streams = %streams.join(", "), "retrying quarantined streams"),
        }
        Ok(Response::new(RetryResponse { retried }))
    }
}

/// The connection of a call.
fn peer<T>(request: &Request<T>) -> Option<Peer> {
    request.extensions().get::<Peer>().cloned()
}

impl<R: Recorder> Service<R> {
    /// Notes that a registered worker has called through this connection, so that the end of the connection is noticed.
    /// This does not apply to a worker of this process, which does not die alone.
    fn attend(&self, peer: Option<Peer>, worker: &WorkerId) {
        if let Some(peer) = peer.filter(|peer| !peer.is_local()) {
            peer.keep(worker.as_str(), || self.board.connect(worker));
        }
    }

    /// Counts the crash of a former worker of the caller's machine.
    async fn record_crash(&self, crashed: &DeadWorker) -> Result<(), Status> {
        let worker = WorkerId::from(crashed.worker_id.as_str());
        let begun = crashed.begun.iter().filter_map(|begun| {
            let units = begun
                .units
                .iter()
                .filter_map(|unit| Unit::try_from(unit).ok());
            Some((begun.id?.into(), units.collect::<Vec<Unit>>()))
        });
        let begun = begun.flat_map(|(id, units)| units.into_iter().map(move |unit| (id, unit)));
        let begun: Vec<(LeaseId, Unit)> = begun.collect();
        let crashes = self.board.record_crash(&worker, &begun);
        let recorded = leases::record(crashes, true, &self.recorder).await;
        recorded.map_err(|error| not_stored(&error))
    }

    /// Refuses calls until the first plan is posted, shortly after the start.
    fn require_open(&self) -> Result<(), Status> {
        if self.board.is_open() {
            Ok(())
        } else {
            Err(Status::unavailable("the coordinator is starting"))
        }
    }

    /// Interval between a worker's heartbeats, in milliseconds.
    fn heartbeat_ms(&self) -> u32 {
        (self.board.lease_time() / HEARTBEATS_PER_LEASE).as_millis() as u32
    }

    /// Refuses a worker whose simulator differs from the campaign's. An external program becomes the campaign's
    /// simulator when its first result is stored.
    async fn check_model(&self, worker: &str, offered: &str) -> Result<(), Status> {
        match &self.model_digest {
            Some(digest) if digest == offered => Ok(()),
            Some(_) => Err(other_model()),
            None => match self.recorder.offer_model(worker, offered).await {
                Ok(()) => Ok(()),
                Err(store::Error::ModelDigestConflict { .. }) => Err(other_model()),
                Err(failed) => Err(not_stored(&failed)),
            },
        }
    }

    /// Frees the leases of a worker whose results are refused, without counting a crash, and returns the refusal.
    fn dismiss_other_model(&self, worker: &WorkerId, leases: &[LeaseId]) -> Status {
        self.board.release(worker, leases, true);
        other_model()
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

    /// The instruction to a worker.
    fn directive(&self, worker: &WorkerId) -> Directive {
        match self.board.course_for(worker) {
            Course::Finished => Directive::Finished,
            Course::Leave => Directive::Leave,
            Course::Work if self.board.is_draining() => Directive::Drain,
            Course::Work => Directive::Continue,
        }
    }
}
