//! What a worker does over and over: it leases jobs, computes them, hands in results and says that it
//! is there.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use campaign::task::{Task, execute_until};
use protocol::v1::{
    Directive, HeartbeatRequest, Job, JobResult, LeaseRequest, ReportRequest, job_result,
};
use rustix::time::{ClockId, clock_gettime};
use tokio_util::sync::CancellationToken;
use tracing::{debug, warn};

use super::{CALL_TIMEOUT, End, Shared};
use crate::backoff::Backoff;
use crate::client::cause;
use crate::connection::Error;

/// How long a lease call waits at the coordinator for a job to turn up.
const LEASE_WAIT: Duration = Duration::from_secs(5);

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

/// Does one job on a compute thread.
fn compute(shared: &Shared, job: &Job) {
    let Some(cancelled) = shared.held.start(job.job) else {
        return;
    };
    let keep_going = || !cancelled.load(Ordering::Relaxed) && !shared.hurry.load(Ordering::Relaxed);
    let began = Instant::now();
    let before = clock_gettime(ClockId::ThreadCPUTime);
    let (outcome, program_seconds) = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        attempt(shared, job, &keep_going)
    }))
    .unwrap_or_else(|_| {
        let error = "the job panicked; the worker's log has the message".to_owned();
        (Err(error), 0.0)
    });
    let after = clock_gettime(ClockId::ThreadCPUTime);
    // What an external program takes is somebody else's time on the processor.
    let cpu_seconds = (after.tv_sec - before.tv_sec) as f64
        + 1e-9 * (after.tv_nsec - before.tv_nsec) as f64
        + program_seconds;
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
    });
}

/// The result's payload, and how many seconds an external program took for it.
fn attempt(
    shared: &Shared,
    job: &Job,
    keep_going: &dyn Fn() -> bool,
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

/// Tells the coordinator regularly what is held, and does what it answers.
pub(super) async fn heartbeat(shared: Arc<Shared>) -> Result<End, Error> {
    let mut client = shared.connection.client();
    loop {
        let period = shared
            .registered()
            .map_or(Duration::from_secs(1), |registered| registered.heartbeat);
        tokio::select! {
            () = tokio::time::sleep(period) => {}
            () = shared.stop.cancelled() => return Ok(End::Stopped),
        }
        let epoch = shared.epoch();
        let request = HeartbeatRequest {
            worker_id: shared.worker_id.clone(),
            held: shared.held.attempts(),
        };
        let call = tokio::time::timeout(CALL_TIMEOUT, client.heartbeat(request));
        // A lost heartbeat needs nothing but the next one; the lease task watches how long the
        // coordinator is away.
        let Ok(Ok(response)) = call.await else {
            continue;
        };
        let response = response.into_inner();
        shared.held.cancel(&response.cancelled);
        if response.directive() == Directive::Register {
            shared.register_again(epoch).await?;
        }
    }
}
