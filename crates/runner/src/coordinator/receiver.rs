//! The path of reported results: the board accepts them, the recorder stores them, the board counts
//! them.

use std::ops::Range;

use crate::protocol::Refusal;
use crate::protocol::v1::{LeaseResult, UnitResult};
use futures_util::future::join_all;
use ledger::{Delivery, Failure, Generation, Kind, LeaseId, StreamId, Unit, Verdict, WorkerId};
use problem::formulation::Problem;
use problem::task::{self, Evaluation, Output, Source};
use stages::{contradiction, names};
use stats::Samples;
use store::{Batch, CriteriaRow, FailureKind, FailureRow, OriginRow, Receipt, SampleBlock};
use tonic::Status;
use tracing::{debug, error, info, warn};

use crate::coordinator::board::Board;
use crate::coordinator::recorder::Recorder;
use crate::coordinator::{ingest, provenance};
use crate::outside;

/// Maximum length of a recorded error message, in bytes.
const ERROR_BYTES: usize = 1 << 10;

/// The worker of a stored result that the store does not name.
const EARLIER: &str = "an earlier worker";

/// The receiver of reported results.
pub(crate) struct Receiver<'a, R> {
    /// The campaign's problem.
    pub(crate) problem: &'a Problem,
    /// The board with the jobs.
    pub(crate) board: &'a Board,
    /// The recorder of results.
    pub(crate) recorder: &'a R,
}

impl<R: Recorder> Receiver<'_, R> {
    /// Stores the results of a worker's leases and delivers the leases.
    pub(crate) async fn take_results(
        &self,
        worker: &WorkerId,
        results: Vec<LeaseResult>,
    ) -> Result<(), Status> {
        let mut all = Vec::new();
        let mut commits = Vec::new();
        for (of, result) in results.iter().enumerate() {
            let mut brought = LeaseResults::of(self.origin(worker, result));
            for unit in &result.results {
                self.take(worker, unit, &mut brought);
            }
            for part in &mut brought.parts {
                part.batch.origin = Some(brought.origin.clone());
            }
            // Designs are committed together. A result that depends on a generation is committed
            // alone.
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
        if !commits.is_empty() {
            self.pin_model(worker).await?;
        }
        // The writer commits all waiting batches at once.
        for (of, committed) in join_all(commits).await {
            let committed = committed.map_err(|failed| {
                error!(error = %failed, "results could not be stored");
                not_stored(&failed)
            })?;
            for (part, outcome) in committed {
                all[of].note(part, outcome);
            }
        }
        for (result, mut brought) in results.into_iter().zip(all) {
            // A failure that an earlier coordinator recorded counts already.
            let mut counted = Vec::with_capacity(brought.failed.len());
            for failed in std::mem::take(&mut brought.failed) {
                let is_known = match failed.serial {
                    Some(serial) => {
                        let computer = &brought.origin.worker;
                        self.recorder.knows_failure(computer, serial).await
                    }
                    None => Ok(false),
                };
                if !is_known.map_err(|error| not_stored(&error))? {
                    counted.push(failed);
                }
            }
            if self.problem.campaign().is_external() {
                for (unit, responses) in std::mem::take(&mut brought.analysed) {
                    self.board.analysed(unit.stream, unit.generation, responses);
                }
            }
            let lease = LeaseId::from(result.id.unwrap_or_default());
            let failures = counted.iter();
            let delivery = Delivery {
                failed: failures.map(FailedUnit::to_ledger).collect(),
                stored: brought.stored,
                refused: brought.refused,
                has_answers: brought.has_answers,
                seconds: result.wall_seconds,
            };
            let (outcomes, suspended) = self.board.deliver(worker, lease, delivery);
            if let Some(time) = suspended {
                warn!(%worker, seconds = time.as_secs_f64().ceil(),
                    "suspended a worker after several failures in a row");
            }
            for (failed, outcome) in counted.into_iter().zip(outcomes) {
                let outcome = match outcome {
                    // A contradiction is not a failure of the simulator, so it cannot be a result.
                    Failure::Conclusive
                        if failed.contradicts || !self.conclude(&failed).await? =>
                    {
                        self.board.quarantine(failed.stream, &failed.error);
                        Failure::Quarantined
                    }
                    outcome => outcome,
                };
                self.record(&brought.origin.worker, lease, failed, outcome)
                    .await?;
            }
        }
        Ok(())
    }

    /// Who computed the results of a lease: `worker`, or the one that the results name.
    fn origin(&self, worker: &WorkerId, result: &LeaseResult) -> OriginRow {
        let (worker, host) = match &result.origin {
            Some(other) => (outside::name(&other.worker_id), outside::name(&other.host)),
            None => (worker.to_string(), self.board.host(worker)),
        };
        OriginRow {
            worker,
            host,
            // Workers and files of another build are refused.
            build: crate::identity::BUILD.to_owned(),
        }
    }

    /// Records the worker's simulator as the campaign's, if no result of another one is stored.
    async fn pin_model(&self, worker: &WorkerId) -> Result<(), Status> {
        let pinned = self.recorder.pin_model(worker.as_str()).await;
        pinned.map_err(|failed| match failed {
            store::Error::ModelDigestConflict { .. } => other_model(),
            failed => not_stored(&failed),
        })
    }

    /// Reads the result of a unit and adds it to `brought`.
    fn take(&self, worker: &WorkerId, result: &UnitResult, brought: &mut LeaseResults) {
        let read = match ingest::read(self.problem, result) {
            Ok(read) => read,
            Err(why) => {
                warn!(%worker, "a result {why}; it is dropped");
                return;
            }
        };
        let stream = read.unit.stream;
        let known = match stream.kind {
            Kind::Design => task::samples_not_asked(self.problem, stream.index),
            _ => 0,
        };
        let samples = &read.unit.samples;
        let is_answer = match read.is_refused {
            // The refusal of a design that the campaign file's own responses rule out is not an answer of the
            // simulator.
            true => known < u32::MAX,
            false => samples.end > known.max(samples.start),
        };
        brought.has_answers |= read.rows.is_ok() && is_answer;
        if self.board.accept(&read.unit) == Verdict::Stale {
            debug!(job = %names::job_name(stream, &read.unit.samples), %worker, "a stale result");
            return;
        }
        match read.rows {
            Ok(batch) => brought.parts.push(Part {
                unit: read.unit,
                is_refused: read.is_refused,
                serial: read.serial,
                batch,
            }),
            Err(error) => brought.failed.push(FailedUnit {
                stream,
                samples: match result.error {
                    Some(_) => read.unit.samples,
                    // The numbers are implausible: all of the unit is computed again.
                    None => read.unit.samples.start..read.unit.samples.start,
                },
                serial: read.serial,
                error: outside::shortened(&outside::clean(&error), ERROR_BYTES),
                contradicts: false,
            }),
        }
    }

    /// Stores parts and returns the outcome of each. The outer error says that nothing was stored.
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
                // A part that contradicts the store must not keep the others from being stored.
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

    /// The rows that stand for a failure that is a result, and the unit that they settle; `None` if the
    /// failure cannot be one.
    fn conclusion(&self, failed: &FailedUnit) -> Option<(Batch, Unit)> {
        let (generation, source) = self.board.source(failed.stream)?;
        let unit = Unit {
            stream: failed.stream,
            generation,
            samples: failed.samples.clone(),
        };
        let first = unit.samples.start;
        let reason = task::failed(failed.stream, first, &failed.error);
        let failed_sample = self.problem.failed_sample();
        let failed_sample = Samples::new(failed_sample.len(), failed_sample)?;
        let output = match &*source {
            Source::Candidates(candidates) => {
                let mut candidates = candidates.iter();
                let candidate = candidates.find(|one| one.evaluation == first)?;
                Output::Evaluations(vec![Evaluation {
                    design: candidate.design.clone(),
                    answer: Err(reason),
                }])
            }
            Source::Design(_) | Source::Analysed { .. } if unit.samples.is_empty() => {
                Output::Refused(reason)
            }
            // The design's criteria came with the failure, or the stream has no criteria.
            Source::Design(_) | Source::Analysed { .. } | Source::Point(_)
                if !unit.samples.is_empty() =>
            {
                Output::Samples(failed_sample.clone())
            }
            _ => return None,
        };
        let mut batch = Batch::default();
        let is_of_design = unit.stream.kind == Kind::Design;
        if is_of_design && matches!(output, Output::Samples(_)) {
            batch.samples.push(SampleBlock {
                stream: unit.stream,
                first_sample: first.into(),
                samples: failed_sample,
            });
            if self.problem.responses().is_empty() {
                batch.criteria.push(CriteriaRow {
                    design: unit.stream.index,
                    simulable: true,
                    reason: None,
                    responses: Some(Vec::new()),
                });
            }
            return Some((batch, unit));
        }
        batch = ingest::rows(self.problem, &unit, output, 0.0).ok()?;
        batch.times.clear();
        Some((batch, unit))
    }

    /// Stores a failure as a result. Returns false if it cannot be one.
    async fn conclude(&self, failed: &FailedUnit) -> Result<bool, Status> {
        let Some((batch, unit)) = self.conclusion(failed) else {
            return Ok(false);
        };
        match self.recorder.record(batch).await {
            Ok(_) => {}
            // For example, another lease had brought the design's criteria.
            Err(refused) if refused.is_refusal() => return Ok(false),
            Err(failed) => return Err(not_stored(&failed)),
        }
        if unit.samples.is_empty() {
            self.board.refuse(unit.stream, unit.generation);
        } else {
            self.board.conclude(&unit);
        }
        Ok(true)
    }

    /// Records a failure, once for each serial number of the worker.
    async fn record(
        &self,
        worker: &str,
        lease: LeaseId,
        failed: FailedUnit,
        outcome: Failure,
    ) -> Result<(), Status> {
        let job = names::job_name(failed.stream, &failed.samples);
        let error = outside::line(&failed.error);
        let kind = match outcome {
            Failure::Quarantined => {
                error!(%job, %worker, %error, "quarantined");
                FailureKind::Quarantine
            }
            Failure::Retry(wait) => {
                let again_in = wait.as_secs_f64();
                warn!(%job, %worker, %error, again_in, "a failure");
                FailureKind::Failure
            }
            Failure::Conclusive => {
                warn!(%job, %worker, %error, "a conclusive failure, stored as the result");
                FailureKind::Failure
            }
            // A contradiction of the store is always recorded, even if the lease no longer counts.
            Failure::Ignored if failed.contradicts => FailureKind::Failure,
            Failure::Ignored => {
                info!(%job, %worker, %error, "an ignored failure");
                return Ok(());
            }
        };
        let row = FailureRow {
            stream: failed.stream,
            sample: (!failed.samples.is_empty()).then_some(failed.samples.start),
            shared: false,
            lease: u32::try_from(lease.number).unwrap_or(u32::MAX),
            worker: worker.to_owned(),
            serial: failed.serial,
            kind,
            error: failed.error,
            at_unix_ms: provenance::unix_ms(),
        };
        let batch = Batch {
            failures: vec![row],
            ..Batch::default()
        };
        let recorded = self.recorder.record(batch).await;
        recorded.map(drop).map_err(|error| not_stored(&error))
    }
}

/// The results of a lease, sorted by outcome.
#[derive(Debug)]
struct LeaseResults {
    origin: OriginRow,
    /// Results not yet stored.
    parts: Vec<Part>,
    stored: Vec<Unit>,
    refused: Vec<(StreamId, Generation)>,
    /// The responses of stored designs without random effects.
    analysed: Vec<(Unit, Vec<f64>)>,
    failed: Vec<FailedUnit>,
    /// Whether the worker brought any result, even a stale one.
    has_answers: bool,
}

/// The result of a unit, not yet stored.
#[derive(Debug)]
struct Part {
    unit: Unit,
    is_refused: bool,
    serial: Option<u64>,
    batch: Batch,
}

#[derive(Debug)]
struct FailedUnit {
    stream: StreamId,
    /// The sample that failed; empty for a failure of the stream as a whole.
    samples: Range<u32>,
    serial: Option<u64>,
    error: String,
    /// Whether the result differs from the stored one.
    contradicts: bool,
}

impl FailedUnit {
    fn to_ledger(&self) -> ledger::FailureReport {
        ledger::FailureReport {
            stream: self.stream,
            sample: (!self.samples.is_empty()).then_some(self.samples.start),
            error: self.error.clone(),
            is_contradiction: self.contradicts,
        }
    }
}

impl LeaseResults {
    const fn of(origin: OriginRow) -> Self {
        Self {
            origin,
            parts: Vec::new(),
            stored: Vec::new(),
            refused: Vec::new(),
            analysed: Vec::new(),
            failed: Vec::new(),
            has_answers: false,
        }
    }

    /// Records the outcome of storing a part.
    fn note(&mut self, part: Part, outcome: Result<Receipt, store::Error>) {
        let worker = &self.origin.worker;
        let Part {
            unit,
            is_refused,
            serial,
            batch,
        } = part;
        let job = names::job_name(unit.stream, &unit.samples);
        match outcome {
            Ok(receipt) if receipt.is_stale => debug!(%job, %worker, "a stale result"),
            Ok(_) if is_refused => self.refused.push((unit.stream, unit.generation)),
            Ok(_) => {
                let criteria = batch.criteria.into_iter();
                let responses = criteria.filter_map(|row| row.responses);
                let analysed = responses.filter(|responses| !responses.is_empty());
                self.analysed
                    .extend(analysed.map(|responses| (unit.clone(), responses)));
                self.stored.push(unit);
            }
            Err(refused) => {
                // The stored numbers stay, and the contradiction is recorded. Settled samples stay
                // settled; any others are leased to another worker.
                let conflict = match &refused {
                    store::Error::Conflict { worker, .. } => Some(worker.as_deref()),
                    _ => None,
                };
                let contradicts = conflict.is_some();
                let error = match conflict {
                    Some(earlier) => contradiction::record(
                        unit.stream,
                        worker,
                        earlier.unwrap_or(EARLIER),
                        &refused.to_string(),
                    ),
                    None => refused.to_string(),
                };
                error!(%job, %worker, %error, "a result that cannot be stored");
                self.failed.push(FailedUnit {
                    stream: unit.stream,
                    samples: unit.samples.start..unit.samples.start,
                    serial,
                    error,
                    contradicts,
                });
            }
        }
    }
}

/// The refusal of a worker with another simulator.
pub(crate) fn other_model() -> Status {
    Refusal::Model.status(
        "the worker's simulator gives other numbers than this campaign's, so their samples must not be mixed: run the \
         same build (or the same external program) everywhere",
    )
}

pub(crate) fn not_stored(error: &store::Error) -> Status {
    Status::unavailable(format!("not stored: {error}"))
}
