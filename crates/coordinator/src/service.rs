//! The gRPC face of the board.

use std::sync::Arc;
use std::time::Duration;

use futures_util::future::join_all;
use ledger::{Accepted, Delivery, Failure, Generation, LeaseId, StreamId, Unit, WorkerId};
use protocol::Refusal;
use protocol::v2::{
    Directive, DrainRequest, DrainResponse, ExplainRequest, ExplainResponse, HeartbeatRequest,
    HeartbeatResponse, LeaseRequest, LeaseResponse, LeaseResult, RegisterRequest, RegisterResponse,
    ReleaseRequest, ReleaseResponse, ReportRequest, ReportResponse, RetryRequest, RetryResponse,
    StatusRequest, StatusResponse, UnitResult, WatchRequest, WatchResponse, campaign_server,
};
use store::{Batch, FailureKind, FailureRow, Receipt, Store, Writer};
use tokio::sync::watch;
use tonic::{Request, Response, Status};
use tracing::{debug, error, info, warn};

use crate::board::{Board, Course, Room};
use crate::ingest;
use crate::status;

/// The longest a call may wait for something to happen.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// The most bytes of what a worker says about a failure, and of its host's name, that are kept.
const ERROR_BYTES: usize = 16 << 10;
const HOST_BYTES: usize = 256;
/// The most leases that a worker may say to hold from before: several times what one ever holds.
const HELD_LEASES: usize = 100_000;
/// How often a worker calls while a lease lasts.
const HEARTBEATS_PER_LEASE: u32 = 6;

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
    /// What is missing and who computes it.
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
        if request.held.len() > HELD_LEASES {
            return Err(Refusal::Malformed.status(format!(
                "a worker cannot hold more than {HELD_LEASES} leases"
            )));
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
            let held = request.held.iter().map(|held| {
                let units: Result<Vec<Unit>, _> = held.units.iter().map(Unit::try_from).collect();
                // Nobody needs what makes no sense.
                (
                    held.id.unwrap_or_default().into(),
                    units.unwrap_or_default(),
                )
            });
            let held: Vec<(LeaseId, Vec<Unit>)> = held.collect();
            cancelled = self.board.register(
                &WorkerId::from(request.worker_id.as_str()),
                beginning(&request.host, HOST_BYTES),
                request.slots,
                &held,
            );
            info!(worker = %request.worker_id, host = %request.host, slots = request.slots,
                held = request.held.len(), "worker registered");
        }
        let lease = self.board.lease_time();
        Ok(Response::new(RegisterResponse {
            campaign_json: self.campaign_json.clone(),
            epoch: self.board.epoch(),
            lease_ms: lease.as_millis() as u32,
            heartbeat_ms: (lease / HEARTBEATS_PER_LEASE).as_millis() as u32,
            cancelled: cancelled.into_iter().map(Into::into).collect(),
        }))
    }

    async fn lease(
        &self,
        request: Request<LeaseRequest>,
    ) -> Result<Response<LeaseResponse>, Status> {
        let request = request.into_inner();
        let worker = WorkerId::from(request.worker_id.as_str());
        if !self.board.is_known(&worker) {
            return Ok(Response::new(LeaseResponse {
                leases: Vec::new(),
                directive: Directive::Register.into(),
            }));
        }
        let wait = Duration::from_millis(request.wait_ms.into()).min(LONGEST_WAIT);
        let room = Room {
            leases: (request.credit as usize).min(10_000),
            seconds: request.seconds,
        };
        let grants = self.board.lease(&worker, room, wait).await;
        Ok(Response::new(LeaseResponse {
            leases: grants.iter().map(protocol::lease).collect(),
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
        // A worker whose calls time out must not pile them up here.
        let Some(reporting) = self.board.begin_report(&worker) else {
            return Err(Status::unavailable(
                "results of an earlier call are still being stored",
            ));
        };
        let service = self.clone();
        // A caller that goes away must not leave results stored but their leases open.
        let taken = tokio::spawn(async move {
            let taken = service.take_results(&worker, request.results).await;
            drop(reporting);
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
        let request = request.into_inner();
        let worker = WorkerId::from(request.worker_id.as_str());
        if !self.board.is_known(&worker) {
            return Ok(Response::new(HeartbeatResponse {
                directive: Directive::Register.into(),
                cancelled: Vec::new(),
            }));
        }
        let held = request.held.iter();
        let held: Vec<(LeaseId, bool)> = held
            .map(|held| (held.id.unwrap_or_default().into(), held.started))
            .collect();
        let cancelled = self.board.heartbeat(&worker, &held);
        Ok(Response::new(HeartbeatResponse {
            directive: self.directive(&worker).into(),
            cancelled: cancelled.into_iter().map(Into::into).collect(),
        }))
    }

    async fn release(
        &self,
        request: Request<ReleaseRequest>,
    ) -> Result<Response<ReleaseResponse>, Status> {
        let request = request.into_inner();
        let worker = WorkerId::from(request.worker_id.as_str());
        // What a stranger gives back is not its own.
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
            info!(leased, "draining: nothing more is leased");
        }
        Ok(Response::new(DrainResponse { leased }))
    }

    async fn retry(
        &self,
        _request: Request<RetryRequest>,
    ) -> Result<Response<RetryResponse>, Status> {
        let retried = self.board.retry().into_iter();
        let retried: Vec<String> = retried.map(ingest::stream_name).collect();
        info!(streams = %retried.join(", "), "another chance for what was given up");
        Ok(Response::new(RetryResponse { retried }))
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

    /// What a worker is to do as a whole.
    fn directive(&self, worker: &WorkerId) -> Directive {
        match self.board.course_for(worker) {
            Course::Finished => Directive::Finished,
            Course::Leave => Directive::Leave,
            Course::Work if self.board.is_draining() => Directive::Drain,
            Course::Work => Directive::Continue,
        }
    }

    async fn take_results(
        &self,
        worker: &WorkerId,
        results: Vec<LeaseResult>,
    ) -> Result<(), Status> {
        let mut all = Vec::new();
        let mut commits = Vec::new();
        for (of, result) in results.iter().enumerate() {
            let mut brought = Brought::default();
            for unit in &result.results {
                self.take(worker, unit, &mut brought);
            }
            // Designs go together; what depends on a generation goes alone.
            let (alone, together): (Vec<Part>, Vec<Part>) = std::mem::take(&mut brought.parts)
                .into_iter()
                .partition(|part| part.batch.only_for.is_some());
            let together = (!together.is_empty()).then_some(together);
            let groups = alone.into_iter().map(|part| vec![part]).chain(together);
            for group in groups {
                commits.push(async move { (of, self.commit(group).await) });
            }
            all.push(brought);
        }
        // The writer commits all that are waiting at once.
        for (of, committed) in join_all(commits).await {
            let committed = committed.map_err(|failed| {
                error!(error = %failed, "results could not be stored");
                not_stored(&failed)
            })?;
            for (part, outcome) in committed {
                all[of].note(worker, part, outcome);
            }
        }
        for (result, mut brought) in results.into_iter().zip(all) {
            // One that was reported to a coordinator before this one counts already.
            let mut counted = Vec::with_capacity(brought.failed.len());
            for failed in std::mem::take(&mut brought.failed) {
                let is_known = match failed.serial {
                    Some(serial) => self.recorder.knows_failure(worker.as_str(), serial).await,
                    None => Ok(false),
                };
                if !is_known.map_err(|error| not_stored(&error))? {
                    counted.push(failed);
                }
            }
            let lease = LeaseId::from(result.id.unwrap_or_default());
            let failures = counted.iter();
            let delivery = Delivery {
                failed: failures.map(|f| (f.stream, f.error.clone())).collect(),
                stored: brought.stored,
                refused: brought.refused,
                seconds: result.wall_seconds,
            };
            let (outcomes, suspended) = self.board.deliver(worker, lease, delivery);
            if let Some(time) = suspended {
                warn!(%worker, seconds = time.as_secs_f64().ceil(),
                    "a worker failed several in a row and gets nothing for so long");
            }
            for (failed, outcome) in counted.into_iter().zip(outcomes) {
                self.record(worker, lease, failed, outcome).await?;
            }
        }
        Ok(())
    }

    /// Sorts out what came of a unit.
    fn take(&self, worker: &WorkerId, result: &UnitResult, brought: &mut Brought) {
        let read = match ingest::read(result, |stream| self.board.point_name(stream)) {
            Ok(read) => read,
            Err(why) => {
                warn!(%worker, "a result {why}; it is dropped");
                return;
            }
        };
        let stream = read.unit.stream;
        if self.board.accept(&read.unit) == Accepted::Stale {
            debug!(stream = %ingest::stream_name(stream), %worker, "a stale result");
            return;
        }
        match read.rows {
            Ok(batch) => brought.parts.push(Part {
                unit: read.unit,
                is_refused: read.is_refused,
                serial: read.serial,
                batch,
            }),
            Err(error) => brought.failed.push(Failed {
                stream,
                serial: read.serial,
                error,
                contradicts: false,
            }),
        }
    }

    /// Stores parts, and what became of each; the outer error says that nothing was stored.
    async fn commit(
        &self,
        parts: Vec<Part>,
    ) -> Result<Vec<(Part, Result<Receipt, store::Error>)>, store::Error> {
        let mut batch = Batch::default();
        for part in &parts {
            batch.append(part.batch.clone());
        }
        match self.recorder.record(batch).await {
            Ok(receipt) => Ok(parts.into_iter().map(|part| (part, Ok(receipt))).collect()),
            Err(refused) if refused.is_refusal() && parts.len() == 1 => Ok(parts
                .into_iter()
                .map(|part| (part, Err(refused.clone())))
                .collect()),
            Err(refused) if refused.is_refusal() => {
                // One that contradicts the store must not take the others with it.
                let mut outcomes = Vec::with_capacity(parts.len());
                for part in parts {
                    match self.recorder.record(part.batch.clone()).await {
                        Err(failed) if !failed.is_refusal() => return Err(failed),
                        outcome => outcomes.push((part, outcome)),
                    }
                }
                Ok(outcomes)
            }
            Err(failed) => Err(failed),
        }
    }

    /// Records a failure, once for each of the worker's numbers.
    async fn record(
        &self,
        worker: &WorkerId,
        lease: LeaseId,
        failed: Failed,
        outcome: Failure,
    ) -> Result<(), Status> {
        let name = ingest::stream_name(failed.stream);
        let error = beginning(&failed.error, ERROR_BYTES);
        let kind = match outcome {
            Failure::GivenUp => {
                error!(stream = %name, %worker, %error, "given up");
                FailureKind::Quarantine
            }
            Failure::Retry(wait) => {
                let again_in = wait.as_secs_f64();
                warn!(stream = %name, %worker, %error, again_in, "a failure");
                FailureKind::Failure
            }
            // Other numbers than are stored must not go unrecorded, whoever brings them when.
            Failure::Ignored if failed.contradicts => FailureKind::Failure,
            Failure::Ignored => {
                info!(stream = %name, %worker, %error, "a failure that does not count");
                return Ok(());
            }
        };
        let row = FailureRow {
            job: name,
            attempt: u32::try_from(lease.number).unwrap_or(u32::MAX),
            worker: worker.to_string(),
            serial: failed.serial,
            kind,
            error: error.to_owned(),
            at_unix_ms: None,
        };
        let batch = Batch {
            failures: vec![row],
            ..Batch::default()
        };
        let recorded = self.recorder.record(batch).await;
        recorded.map(drop).map_err(|error| not_stored(&error))
    }
}

/// What a lease brought, as far as it is known.
#[derive(Debug, Default)]
struct Brought {
    /// To be stored.
    parts: Vec<Part>,
    stored: Vec<Unit>,
    refused: Vec<(StreamId, Generation)>,
    failed: Vec<Failed>,
}

/// What came of a unit, to be stored.
#[derive(Debug)]
struct Part {
    unit: Unit,
    is_refused: bool,
    serial: Option<u64>,
    batch: Batch,
}

#[derive(Debug)]
struct Failed {
    stream: StreamId,
    serial: Option<u64>,
    error: String,
    /// Whether the store holds other numbers.
    contradicts: bool,
}

impl Brought {
    /// Notes what became of a part.
    fn note(&mut self, worker: &WorkerId, part: Part, outcome: Result<Receipt, store::Error>) {
        let Part { unit, serial, .. } = part;
        let stream = ingest::stream_name(unit.stream);
        match outcome {
            Ok(receipt) if receipt.is_stale => debug!(%stream, %worker, "a stale result"),
            Ok(_) if part.is_refused => self.refused.push((unit.stream, unit.generation)),
            Ok(_) => self.stored.push(unit),
            Err(refused) => {
                // What is stored stays. Somebody computes other numbers, which must be heard; what
                // is settled stays so, anything else is tried again elsewhere.
                error!(%stream, %worker, error = %refused, "a worker contradicts the store");
                self.failed.push(Failed {
                    stream: unit.stream,
                    serial,
                    error: refused.to_string(),
                    contradicts: true,
                });
            }
        }
    }
}

fn not_stored(error: &store::Error) -> Status {
    Status::unavailable(format!("not stored: {error}"))
}

/// As much of a text as fits into so many bytes.
fn beginning(text: &str, bytes: usize) -> &str {
    &text[..text.floor_char_boundary(bytes)]
}
