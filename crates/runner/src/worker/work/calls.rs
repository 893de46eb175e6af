//! The repeated calls of a worker: leasing, computing, reporting results and sending heartbeats.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::cpu::thread_seconds;
use crate::gateway::link::cause;
use crate::outside;
use crate::protocol::v1::{Directive, HeartbeatRequest, LeaseRequest, ReportRequest, UnitResult};
use ledger::Unit;
use problem::task::{Failure, Outcome, Output, Source, compute_until};
use tokio_util::sync::CancellationToken;
use tracing::{debug, warn};

use super::contact::SILENCE;
use super::registering::Registration;
use super::{CALL_TIMEOUT, End, SharedState, ids};
use crate::worker::backoff::Backoff;
use crate::worker::error::Error;
use crate::worker::held::Lease;

/// Time that a lease request waits at the coordinator for a free job.
const LEASE_WAIT: Duration = Duration::from_secs(5);

/// Interval at which the finished part of a unit is kept, in case the rest takes too long.
const KEEP_EVERY: Duration = Duration::from_secs(1);
/// Maximum number of samples between two readings of the clock.
const MAX_STRIDE: u32 = 64;

/// Time to wait, after an external program failed, for a request that this worker leave. systemd and Slurm signal
/// both at once, and the program often ends first.
const AFTERTHOUGHT: Duration = Duration::from_millis(500);

/// Time without new leases after the last pause for a machine that could not run the simulator: enough for the
/// repeated request to fail again.
const SETTLING: Duration = Duration::from_millis(500);

/// Maximum size of the results in a report, in bytes, unless one result is larger. The size is
/// halved after each report that timed out.
const BYTES_PER_REPORT: usize = 1 << 20;
/// Minimum of that size after timeouts.
const FEWEST_BYTES: usize = 1 << 14;
/// Speed of the slowest supported connection, in bytes per second.
const SLOWEST_LINE: f64 = 1e4;

/// Requests leases and starts them on the compute threads.
pub(super) async fn lease(shared: Arc<SharedState>, pool: rayon::ThreadPool) -> Result<End, Error> {
    let slots = shared.options.slots.max(1);
    let mut backoff = Backoff::new();
    let mut client = shared.connection.client();
    let mut ability = shared.ability.subscribe();
    loop {
        if ability.borrow_and_update().waiting > 0 {
            shared.release(shared.held.release_waiting(), false).await;
            tokio::select! {
                () = shared.ability_settles() => continue,
                () = shared.stop.cancelled() => return Ok(End::Stopped),
            }
        }
        let changed = shared.held.changed.notified();
        let Some(wanted) = shared.held.wanted(slots) else {
            tokio::select! {
                () = changed => continue,
                Ok(()) = ability.changed() => continue,
                () = shared.stop.cancelled() => return Ok(End::Stopped),
            }
        };
        let epoch = shared.epoch();
        let request = LeaseRequest {
            worker_id: shared.worker_id.clone(),
            credit: u32::try_from(wanted.leases).unwrap_or(u32::MAX),
            seconds: wanted.seconds,
            wait_ms: LEASE_WAIT.as_millis() as u32,
        };
        let call = tokio::time::timeout(LEASE_WAIT + CALL_TIMEOUT, client.lease(request));
        let answer = tokio::select! {
            answer = call => answer,
            () = shared.stop.cancelled() => return Ok(End::Stopped),
        };
        let response = match answer {
            Ok(Ok(response)) => response.into_inner(),
            failed => {
                if let Ok(Err(status)) = &failed {
                    if let Some(refusal) = shared.connection.refusal(status) {
                        return Err(refusal.into());
                    }
                    debug!(reason = %cause(status), "leasing failed");
                }
                shared.contact.missed();
                tokio::select! {
                    () = backoff.pause() => continue,
                    () = shared.stop.cancelled() => return Ok(End::Stopped),
                }
            }
        };
        shared.contact.answered();
        backoff.reset();
        match response.directive() {
            Directive::Finished => return Ok(End::Finished),
            Directive::Leave => return Ok(End::Dismissed),
            Directive::Register => {
                tokio::select! {
                    done = shared.register_again(epoch) => done?,
                    () = shared.stop.cancelled() => return Ok(End::Stopped),
                }
            }
            _ => {}
        }
        for lease in response.leases {
            let units = lease
                .units()
                .map_err(|why| crate::gateway::Error::InvalidAnswer {
                    address: shared.connection.address(),
                    reason: format!("a lease {why}"),
                })?;
            let lease = Arc::new(Lease {
                id: lease.name(),
                units,
                seconds: lease.seconds,
            });
            if shared.held.take(&lease) {
                let shared = Arc::clone(&shared);
                pool.spawn_fifo(move || compute(&shared, &lease));
            }
        }
    }
}

/// The state of a compute thread for its current unit.
struct UnitComputation<'a> {
    shared: &'a SharedState,
    lease: &'a Lease,
    unit: &'a Unit,
    cancelled: &'a AtomicBool,
    /// Start of the lease.
    began: Instant,
    /// Start of the unit, and the thread's CPU time then.
    unit_began: Instant,
    before: f64,
    /// Whether an external program simulates: all elapsed time then counts as its time.
    is_external: bool,
    /// Time at which a part was last kept.
    kept: Cell<Instant>,
    /// Number of samples between two readings of the clock, and how many of them are left.
    stride: Cell<u32>,
    left: Cell<u32>,
}

impl UnitComputation<'_> {
    /// Whether to continue with the next sample. The finished part is kept at intervals, because
    /// the next sample may take longer than the worker lives.
    fn go_on(&self, so_far: &dyn Fn() -> Option<Output>) -> bool {
        let is_wanted = !self.cancelled.load(Ordering::Relaxed);
        if !is_wanted || self.shared.hurry.load(Ordering::Relaxed) {
            return false;
        }
        self.left.set(self.left.get() - 1);
        if self.left.get() == 0 {
            // Reading the clock for every short sample costs too much.
            let since = self.kept.get().elapsed();
            let stride = if since < KEEP_EVERY / 16 {
                (2 * self.stride.get()).min(MAX_STRIDE)
            } else {
                1
            };
            self.stride.set(stride);
            self.left.set(stride);
            if since >= KEEP_EVERY {
                self.kept.set(Instant::now());
                if let Some(output) = so_far() {
                    let spent = if self.is_external {
                        self.unit_began.elapsed().as_secs_f64()
                    } else {
                        thread_seconds() - self.before
                    };
                    let part = crate::protocol::result(self.unit, &Ok(Some(output)), spent);
                    let seconds = self.began.elapsed().as_secs_f64();
                    self.shared.held.keep(self.lease.id, part, seconds);
                }
            }
        }
        true
    }
}

/// Computes a lease on a compute thread, unit by unit, so that a unit that fails does not fail the
/// others.
fn compute(shared: &SharedState, lease: &Lease) {
    let Some(cancelled) = shared.held.start(lease.id) else {
        return;
    };
    let began = Instant::now();
    if let Some(registered) = shared.registered() {
        for (unit, source) in &lease.units {
            let is_stopped =
                cancelled.load(Ordering::Relaxed) || shared.hurry.load(Ordering::Relaxed);
            if is_stopped || shared.is_unable() {
                break;
            }
            let computation = UnitComputation {
                shared,
                lease,
                unit,
                cancelled: &cancelled,
                began,
                unit_began: Instant::now(),
                before: thread_seconds(),
                is_external: registered.backend.is_external(),
                kept: Cell::new(Instant::now()),
                stride: Cell::new(1),
                left: Cell::new(1),
            };
            let note = shared.journal.begin(lease.id, unit);
            for result in attempt(&registered, &computation, source) {
                shared
                    .held
                    .add(lease.id, result, began.elapsed().as_secs_f64());
            }
            drop(note);
        }
    }
    shared.held.finish(lease.id);
}

/// Computes a unit. Returns nothing if the unit was stopped before it had a result.
fn attempt(
    registered: &Registration,
    computation: &UnitComputation<'_>,
    source: &Source,
) -> Vec<UnitResult> {
    let UnitComputation { shared, unit, .. } = computation;
    let go_on = |so_far: &dyn Fn() -> Option<Output>| computation.go_on(so_far);
    let backend = &registered.backend;
    let guarded = std::panic::AssertUnwindSafe(|| {
        backend.with(&registered.problem, |simulator| {
            compute_until(simulator, unit, source, &go_on)
        })
    });
    let (mut computed, program_seconds) = std::panic::catch_unwind(guarded).unwrap_or_else(|_| {
        let error = format!(
            "{}: the worker panicked; its log has the message",
            unit.stream
        );
        let failure = Failure {
            sample: None,
            error,
            by_machine: false,
        };
        (Outcome::from(failure), 0.0)
    });
    // The time of an external program is not CPU time of this thread.
    let cpu_seconds = thread_seconds() - computation.before + program_seconds;
    if let Some(failure) = &computed.failure {
        // A request to leave has ended the program as well.
        let is_no_failure =
            failure.by_machine || backend.is_external() && shared.leaves_within(AFTERTHOUGHT);
        if is_no_failure {
            computed.failure = None;
            return crate::protocol::results(unit, &computed, cpu_seconds);
        }
        let error = outside::line(&failure.error);
        warn!(stream = %problem::task::stream_name(unit.stream), lease = %computation.lease.id, error, "a failure");
    }
    crate::protocol::results(unit, &computed, cpu_seconds)
}

/// Reports results until they are acknowledged.
pub(super) async fn report(shared: Arc<SharedState>, stop: CancellationToken) {
    let mut backoff = Backoff::new();
    let mut client = shared.connection.client();
    let mut attempts_after_stop = 0;
    let mut most = BYTES_PER_REPORT;
    loop {
        let changed = shared.held.changed.notified();
        let (results, bytes) = shared.held.results(most);
        if results.is_empty() {
            if stop.is_cancelled() {
                return;
            }
            tokio::select! {
                () = changed => {}
                () = stop.cancelled() => {}
            }
            continue;
        }
        let epoch = shared.epoch();
        let request = ReportRequest {
            worker_id: shared.worker_id.clone(),
            results: results.clone(),
        };
        let patience = CALL_TIMEOUT + Duration::from_secs_f64(bytes as f64 / SLOWEST_LINE);
        match tokio::time::timeout(patience, client.report(request)).await {
            Ok(Ok(response)) => {
                shared.contact.answered();
                backoff.reset();
                most = BYTES_PER_REPORT;
                let directive = response.into_inner().directive();
                if directive == Directive::Register {
                    // Only a registered worker can report: register and report again.
                    if shared.register_again(epoch).await.is_err() {
                        return;
                    }
                    continue;
                }
                shared
                    .acknowledged
                    .fetch_add(results.len() as u64, Ordering::Relaxed);
                shared.held.acknowledge(&results);
                shared.files.settle(&shared.held);
            }
            failed => {
                match &failed {
                    Ok(Err(status)) => {
                        debug!(reason = %cause(status), "reporting results failed");
                    }
                    _ => most = (most / 2).max(FEWEST_BYTES),
                }
                shared.contact.missed();
                if shared.contact.away() > Some(SILENCE) {
                    // This worker may be killed before the coordinator is back.
                    shared.keep_undelivered();
                }
                if stop.is_cancelled() {
                    attempts_after_stop += 1;
                    if attempts_after_stop > 5 {
                        return;
                    }
                }
                backoff.pause().await;
            }
        }
    }
}

impl SharedState {
    /// Waits until no request waits for the end of a shortage on this machine, and the last one has
    /// had time to fail again.
    async fn ability_settles(&self) {
        let mut ability = self.ability.subscribe();
        // An error means that the worker ends.
        let _ = ability.wait_for(|ability| ability.waiting == 0).await;
        tokio::time::sleep(SETTLING).await;
    }

    /// Whether this worker is asked to leave within `moment`.
    fn leaves_within(&self, moment: Duration) -> bool {
        let since = Instant::now();
        loop {
            if self.stop.is_cancelled() || self.programs_are_stopped() {
                return true;
            }
            if since.elapsed() > moment {
                return false;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// Sends heartbeats and follows the directives in the responses. Heartbeats continue while the worker is leaving,
/// because it holds its leases until the end.
pub(super) async fn heartbeat(shared: Arc<SharedState>) -> Result<End, Error> {
    let mut client = shared.connection.client();
    let mut told = shared.heartbeat.subscribe();
    loop {
        let period = *told.borrow_and_update();
        tokio::select! {
            () = tokio::time::sleep(period) => {}
            // A restarted coordinator may want heartbeats more often.
            _ = told.changed() => {}
        }
        let epoch = shared.epoch();
        let request = HeartbeatRequest {
            worker_id: shared.worker_id.clone(),
            held: shared.held.states(),
        };
        // A heartbeat that hangs must not delay the next one.
        let call = tokio::time::timeout(2 * period, client.heartbeat(request)).await;
        // After a lost heartbeat, the next one is enough.
        let Ok(Ok(response)) = call else {
            shared.contact.missed();
            continue;
        };
        shared.contact.answered();
        let response = response.into_inner();
        shared.set_heartbeat(response.heartbeat_ms);
        shared.held.cancel(&ids(&response.cancelled));
        match response.directive() {
            Directive::Finished => return Ok(End::Finished),
            Directive::Leave => return Ok(End::Dismissed),
            Directive::Register => shared.register_again(epoch).await?,
            Directive::Drain => shared.release(shared.held.release_waiting(), false).await,
            _ => {}
        }
    }
}
