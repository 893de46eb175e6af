//! The calls of workers: registration, leases, heartbeats and results.

use std::sync::Arc;
use std::time::Duration;

use ledger::{
    Crash, Delivery, Failure, Generation, Grant, LeaseId, StreamId, Unit, Verdict, WorkerId,
};
use problem::task::Source;
use tokio::time::Instant;

use super::{Board, Course, Inner};
use crate::protocol::MAX_MESSAGE_BYTES;

/// No further lease is added to a response once its sources reach this many bytes.
const BYTES_PER_ANSWER: usize = MAX_MESSAGE_BYTES / 8;

/// The limits of a lease request.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    /// Maximum number of leases.
    pub leases: usize,
    /// No further lease is added once the leases are expected to take this long, in seconds.
    pub seconds: f64,
}

impl Board {
    /// Registers a worker with the leases that it holds from before a restart. Returns those that
    /// are no longer needed.
    pub fn register(
        &self,
        worker: &WorkerId,
        host: &str,
        slots: u32,
        held: &[(LeaseId, Vec<Unit>)],
    ) -> Vec<LeaseId> {
        self.change(|inner, now| {
            inner.ledger.register(worker, host, slots as usize, now);
            let needless = held.iter().filter(|(id, units)| {
                let is_needed = inner.ledger.adopt(worker, *id, units, now);
                !is_needed
            });
            needless.map(|(id, _)| *id).collect()
        })
    }

    /// Counts the crash of a worker that left a note of the units it was computing.
    pub fn record_crash(&self, worker: &WorkerId, begun: &[(LeaseId, Unit)]) -> Vec<Crash> {
        self.change(|inner, _| {
            let crashes = inner.ledger.record_crash(worker, begun);
            let is_unknown = |crash: &&Crash| inner.ledger.source(crash.stream).is_none();
            for crash in crashes.iter().filter(is_unknown) {
                let history = inner.histories.entry(crash.stream).or_default();
                history.crashes.insert(worker.clone(), crash.record);
            }
            crashes
        })
    }

    /// The host that a worker reported; empty if the worker is not registered.
    pub(crate) fn host(&self, worker: &WorkerId) -> String {
        let inner = self.lock();
        inner.ledger.host(worker).unwrap_or_default().to_owned()
    }

    /// Records that a worker called. Returns false if the worker is not registered.
    #[must_use]
    pub fn is_known(&self, worker: &WorkerId) -> bool {
        let now = self.now();
        self.lock().ledger.see(worker, now)
    }

    /// Grants leases up to the limits of `room`. Waits up to `wait` for a free job, and returns no
    /// lease if none becomes free or the worker is to leave.
    pub async fn lease(
        &self,
        worker: &WorkerId,
        room: Room,
        wait: Duration,
    ) -> Vec<Grant<Arc<Source>>> {
        let deadline = Instant::now() + wait;
        loop {
            let available = self.available.notified();
            let due = {
                let mut inner = self.lock();
                if inner.course != Course::Work {
                    return Vec::new();
                }
                let grants = inner.grant(worker, room, self.now());
                if !grants.is_empty() {
                    inner.revision += 1;
                    drop(inner);
                    self.changed.notify_waiters();
                    return grants;
                }
                inner.ledger.next_due(worker, self.now())
            };
            // Some jobs become free with time, without a notification.
            let due = due.map_or(deadline, |due| deadline.min(self.origin + due));
            let _ = tokio::time::timeout_at(due, available).await;
            if Instant::now() >= deadline {
                return Vec::new();
            }
        }
    }

    /// Extends the leases that a worker holds and returns those that are no longer needed.
    pub fn heartbeat(&self, worker: &WorkerId, held: &[(LeaseId, bool)]) -> Vec<LeaseId> {
        let now = self.now();
        self.lock().ledger.heartbeat(worker, held, now)
    }

    /// Takes released leases back. `leaving` says that the worker asks for no more.
    pub fn release(&self, worker: &WorkerId, leases: &[LeaseId], leaving: bool) {
        self.change(|inner, now| {
            if leaving {
                inner.ledger.leaves(worker, now);
            }
            inner.ledger.release(worker, leases, now);
        });
    }

    /// Marks that the results of a worker are being stored. Returns none while the results of an earlier call are
    /// still being stored.
    #[must_use]
    pub fn begin_report(self: &Arc<Self>, worker: &WorkerId) -> Option<ReportGuard> {
        let is_first = self.lock().reporting.insert(worker.clone());
        is_first.then(|| ReportGuard {
            board: Arc::clone(self),
            worker: worker.clone(),
        })
    }

    /// Whether the results of a unit are to be stored.
    #[must_use]
    pub fn accept(&self, unit: &Unit) -> Verdict {
        self.lock().ledger.accept(unit)
    }

    /// Ends a lease whose results are stored. Returns the consequence of each failure, and the
    /// duration of the suspension if the failures suspended the worker.
    pub fn deliver(
        &self,
        worker: &WorkerId,
        lease: LeaseId,
        delivery: Delivery,
    ) -> (Vec<Failure>, Option<Duration>) {
        self.change(|inner, now| {
            // A worker may report any number, but no lease can have lasted longer than this
            // coordinator.
            let seconds = delivery.seconds.min(now.as_secs_f64());
            let delivery = Delivery {
                seconds,
                ..delivery
            };
            // Without searches, a run is computed as a whole.
            let has_whole_runs = inner.searches.is_empty();
            inner.rates.count(worker, &delivery, has_whole_runs, now);
            let (failures, until) = inner.ledger.deliver(worker, lease, &delivery, now);
            (failures, until.map(|until| until.saturating_sub(now)))
        })
    }

    /// The generation and the source of a stream that lacks samples.
    #[must_use]
    pub fn source(&self, stream: StreamId) -> Option<(Generation, Arc<Source>)> {
        let inner = self.lock();
        let (generation, source) = inner.ledger.source(stream)?;
        Some((generation, Arc::clone(source)))
    }

    /// Gives the responses of a design, which a worker has computed, to the workers that compute more of its samples.
    pub fn analysed(&self, stream: StreamId, generation: Generation, responses: Vec<f64>) {
        let mut inner = self.lock();
        let Some((_, source)) = inner.ledger.source(stream) else {
            return;
        };
        if let Source::Design(design) = &**source {
            let design = design.clone();
            let source = Source::Analysed { design, responses };
            inner.ledger.analysed(stream, generation, Arc::new(source));
        }
    }

    /// Settles samples in whose place a failure is stored.
    pub fn conclude(&self, unit: &Unit) {
        self.change(|inner, _| inner.ledger.conclude(unit));
    }

    /// Settles a design in whose place a failure is stored.
    pub fn refuse(&self, stream: StreamId, generation: Generation) {
        self.change(|inner, _| inner.ledger.refuse(stream, generation));
    }

    /// Quarantines a stream whose failure cannot be stored as a result.
    pub fn quarantine(&self, stream: StreamId, error: &str) {
        self.change(|inner, _| inner.ledger.quarantine(stream, error));
    }

    /// Returns the instruction to workers, and records that `worker` has been told if it is to
    /// leave.
    #[must_use]
    pub fn course_for(&self, worker: &WorkerId) -> Course {
        let mut inner = self.lock();
        if inner.course != Course::Work {
            inner.ledger.dismiss(worker);
        }
        inner.course
    }
}

impl Inner {
    fn grant(&mut self, worker: &WorkerId, room: Room, now: Duration) -> Vec<Grant<Arc<Source>>> {
        let mut grants = Vec::new();
        let (mut worth, mut bytes) = (0.0, 0);
        let is_room = |worth: f64, bytes: usize| worth < room.seconds && bytes < BYTES_PER_ANSWER;
        while grants.len() < room.leases && (grants.is_empty() || is_room(worth, bytes)) {
            let Some(grant) = self.ledger.lease(worker, now) else {
                break;
            };
            worth += grant.seconds;
            bytes += grant
                .units
                .iter()
                .map(|(_, source)| source.bytes())
                .sum::<usize>();
            grants.push(grant);
        }
        grants
    }
}

/// Marks, until it is dropped, that results of a worker are being stored.
pub struct ReportGuard {
    board: Arc<Board>,
    worker: WorkerId,
}

impl Drop for ReportGuard {
    fn drop(&mut self) {
        self.board.lock().reporting.remove(&self.worker);
    }
}
