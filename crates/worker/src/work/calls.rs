//! What a worker does over and over: it leases jobs, computes them, hands in results and says that it
//! is there.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use campaign::task::{KeepGoing, Task, TaskResult, execute_until};
use protocol::v1::{
    Directive, HeartbeatRequest, Job, JobResult, LeaseRequest, ReportRequest, job_result,
};
use rustix::time::{ClockId, clock_gettime};
use tokio::sync::mpsc::UnboundedReceiver;
use tokio_util::sync::CancellationToken;
use tracing::{debug, warn};

use super::{CALL_TIMEOUT, End, Shared};
use crate::backoff::Backoff;
use crate::client::cause;
use crate::connection::Error;
use crate::held::Part;

/// How long a lease call waits at the coordinator for a job to turn up.
const LEASE_WAIT: Duration = Duration::from_secs(5);

/// How often what is finished of a job is kept, in case that the rest takes too long.
const KEEP_EVERY: Duration = Duration::from_secs(1);
/// The most samples between two looks at the clock.
const MAX_STRIDE: u32 = 64;

/// How long a job waits until the coordinator knows that it begins.
const ANNOUNCE_TIMEOUT: Duration = Duration::from_secs(5);

/// Leases jobs and hands them to the compute threads.
pub(super) async fn lease(shared: Arc<Shared>, pool: rayon::ThreadPool) -> Result<End, Error> {
    let slots = shared.options.slots.max(1);
    let mut backoff = Backoff::new();
    let mut away_since: Option<Instant> = None;
    let mut client = shared.connection.client();
    loop {
        let changed = shared.held.changed.notified();
        let Some(wanted) = shared.held.wanted(slots) else {
            tokio::select! {
                () = changed => continue,
                () = shared.stop.cancelled() => return Ok(End::Stopped),
            }
        };
        let epoch = shared.epoch();
        let request = LeaseRequest {
            worker_id: shared.worker_id.clone(),
            credit: u32::try_from(wanted.jobs).unwrap_or(u32::MAX),
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
                        return Err(refusal);
                    }
                    debug!(reason = %cause(status), "leasing failed");
                }
                let since = *away_since.get_or_insert_with(Instant::now);
                if since.elapsed() > shared.options.give_up_after {
                    return Err(Error::Away {
                        url: shared.connection.url().to_owned(),
                        seconds: shared.options.give_up_after.as_secs(),
                    });
                }
                tokio::select! {
                    () = backoff.pause() => continue,
                    () = shared.stop.cancelled() => return Ok(End::Stopped),
                }
            }
        };
        away_since = None;
        backoff.reset();
        match response.directive() {
            Directive::Finished => return Ok(End::Finished),
            Directive::Register => {
                tokio::select! {
                    done = shared.register_again(epoch) => done?,
                    () = shared.stop.cancelled() => return Ok(End::Stopped),
                }
            }
            _ => {}
        }
        for job in response.jobs {
            let job = Arc::new(job);
            if shared.held.take(&job) {
                let shared = Arc::clone(&shared);
                pool.spawn_fifo(move || compute(&shared, &job));
            }
        }
    }
}

/// Processor time of this thread, in seconds.
fn thread_seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// What a compute thread knows of the job at hand.
struct Computing<'a> {
    shared: &'a Shared,
    job: &'a Job,
    cancelled: &'a AtomicBool,
    began: Instant,
    /// Processor time of the thread when the job began.
    before: f64,
    /// When a part was last kept.
    kept: Cell<Instant>,
    /// How many samples there are between two looks at the clock, and how many are left of them.
    stride: Cell<u32>,
    left: Cell<u32>,
}

impl Computing<'_> {
    /// Whether to go on with the next sample. What is finished is kept now and then, because the next
    /// sample may last longer than the worker.
    fn go_on(&self, so_far: &dyn Fn() -> TaskResult) -> bool {
        let is_wanted = !self.cancelled.load(Ordering::Relaxed);
        if !is_wanted || self.shared.hurry.load(Ordering::Relaxed) {
            return false;
        }
        self.left.set(self.left.get() - 1);
        if self.left.get() == 0 {
            // Looking at the clock costs too much to be done for every short sample.
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
                let result = so_far();
                if !result.is_empty() {
                    let part = Part {
                        result,
                        cpu_seconds: thread_seconds() - self.before,
                        wall_seconds: self.began.elapsed().as_secs_f64(),
                    };
                    self.shared.held.keep(self.job.job, part);
                }
            }
        }
        true
    }
}

/// Does one job on a compute thread.
fn compute(shared: &Shared, job: &Job) {
    let Some(cancelled) = shared.held.start(job.job) else {
        return;
    };
    if job.attempt > 1 {
        // Whoever had it before may have died of it, and so may this worker before its next
        // heartbeat: unless the coordinator knows that it has begun, nobody would blame the job.
        shared.announce();
    }
    let began = Instant::now();
    let computing = Computing {
        shared,
        job,
        cancelled: &cancelled,
        began,
        before: thread_seconds(),
        kept: Cell::new(began),
        stride: Cell::new(1),
        left: Cell::new(1),
    };
    let (outcome, program_seconds) = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        attempt(shared, job, &|so_far| computing.go_on(so_far))
    }))
    .unwrap_or_else(|_| {
        let error = "the job panicked; the worker's log has the message".to_owned();
        (Err(error), 0.0)
    });
    // What an external program takes is somebody else's time on the processor.
    let cpu_seconds = thread_seconds() - computing.before + program_seconds;
    if outcome.is_err() && shared.programs_are_stopped() {
        // Nobody waits for it any more: the job was given back, or the campaign is finished.
        return;
    }
    if let Err(error) = &outcome {
        warn!(job = job.job, attempt = job.attempt, %error, "a job failed");
    }
    let outcome = match outcome {
        Ok(result) => job_result::Outcome::Result(result),
        Err(error) => job_result::Outcome::Error(error),
    };
    shared.held.finish(JobResult {
        job: job.job,
        attempt: job.attempt,
        outcome: Some(outcome),
        cpu_seconds,
        wall_seconds: began.elapsed().as_secs_f64(),
        serial: 0,
    });
}

/// The result's payload, and how many seconds an external program took for it.
fn attempt(
    shared: &Shared,
    job: &Job,
    keep_going: &KeepGoing<'_>,
) -> (Result<Vec<u8>, String>, f64) {
    let task: Task = match serde_json::from_slice(&job.payload) {
        Ok(task) => task,
        Err(error) => return (Err(format!("the task cannot be read: {error}")), 0.0),
    };
    let Some(registered) = shared.registered() else {
        return (Err("the worker is not registered".to_owned()), 0.0);
    };
    let (result, seconds) = registered.backend.with(&registered.problem, |simulator| {
        execute_until(simulator, &task, keep_going)
    });
    let payload = result.and_then(|result| {
        serde_json::to_vec(&result)
            .map_err(|error| format!("the result cannot be written: {error}"))
    });
    (payload, seconds)
}

/// Hands in results until they are acknowledged.
pub(super) async fn report(shared: Arc<Shared>, stop: CancellationToken) {
    let mut backoff = Backoff::new();
    let mut client = shared.connection.client();
    let mut attempts_after_stop = 0;
    loop {
        let changed = shared.held.changed.notified();
        let results = shared.held.results();
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
        match tokio::time::timeout(CALL_TIMEOUT, client.report(request)).await {
            Ok(Ok(response)) => {
                backoff.reset();
                let directive = response.into_inner().directive();
                if directive == Directive::Register {
                    // Results are welcome from a registered worker only: introduce ourselves and
                    // hand them in again.
                    if shared.register_again(epoch).await.is_err() {
                        return;
                    }
                    continue;
                }
                shared
                    .acknowledged
                    .fetch_add(results.len() as u64, Ordering::Relaxed);
                shared.held.acknowledge(&results);
            }
            failed => {
                if let Ok(Err(status)) = &failed {
                    debug!(reason = %cause(status), "handing in results failed");
                }
                if stop.is_cancelled() {
                    attempts_after_stop += 1;
                    if attempts_after_stop > 5 {
                        let lost = shared.held.unacknowledged();
                        warn!(lost, "leaving with results that nobody acknowledged");
                        return;
                    }
                }
                backoff.pause().await;
            }
        }
    }
}

/// Somebody who waits until the coordinator knows what is held.
pub(super) type Announcement = std::sync::mpsc::SyncSender<()>;

impl Shared {
    /// Tells the coordinator at once what is held and what has begun. Waits until it knows, but not
    /// for one that is away.
    fn announce(&self) {
        let (told, heard) = std::sync::mpsc::sync_channel(1);
        if self.announcements.send(told).is_ok() {
            // An error says that it took too long, or that the worker ends.
            let _ = heard.recv_timeout(ANNOUNCE_TIMEOUT);
        }
    }
}

/// Tells the coordinator regularly what is held, and does what it answers. Goes on while the worker
/// leaves: until then the jobs are its own.
pub(super) async fn heartbeat(
    shared: Arc<Shared>,
    mut announcements: UnboundedReceiver<Announcement>,
) -> Result<End, Error> {
    let mut client = shared.connection.client();
    loop {
        let period = shared
            .registered()
            .map_or(Duration::from_secs(1), |registered| registered.heartbeat);
        let mut waiting: Vec<Announcement> = Vec::new();
        tokio::select! {
            () = tokio::time::sleep(period) => {}
            // The shared state has a sender, so there always is one.
            announcement = announcements.recv() => waiting.extend(announcement),
        }
        while let Ok(announcement) = announcements.try_recv() {
            waiting.push(announcement);
        }
        let epoch = shared.epoch();
        let request = HeartbeatRequest {
            worker_id: shared.worker_id.clone(),
            held: shared.held.attempts(),
        };
        let call = tokio::time::timeout(CALL_TIMEOUT, client.heartbeat(request)).await;
        for told in waiting {
            // One that waits no longer needs no answer.
            let _ = told.try_send(());
        }
        // A lost heartbeat needs nothing but the next one; the lease task watches how long the
        // coordinator is away.
        let Ok(Ok(response)) = call else {
            continue;
        };
        let response = response.into_inner();
        shared.held.cancel(&response.cancelled);
        match response.directive() {
            Directive::Register => shared.register_again(epoch).await?,
            Directive::Drain => shared.give_back(shared.held.give_up_waiting()).await,
            _ => {}
        }
    }
}
