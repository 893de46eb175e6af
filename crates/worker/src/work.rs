//! The worker itself.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, RwLock};
use std::time::{Duration, Instant};

use campaign::Campaign;
use campaign::formulation::Problem;
use campaign::task::{Task, execute_until};
use protocol::Role;
use protocol::v1::{
    Directive, HeartbeatRequest, Job, JobResult, LeaseRequest, RegisterRequest, ReleaseRequest,
    ReportRequest, job_result,
};
use rustix::time::{ClockId, clock_gettime};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tracing::{debug, info, warn};

use crate::backoff::Backoff;
use crate::client::{Credentials, Dial, Link, cause, connect_by};
use crate::connection::Error;
use crate::exec::{Backend, Exec};
use crate::held::HeldJobs;

/// How long a lease call waits at the coordinator for a job to turn up.
const LEASE_WAIT: Duration = Duration::from_secs(5);
/// How long beyond that the answer may take before the call counts as lost.
const CALL_TIMEOUT: Duration = Duration::from_secs(20);

/// The part of the grace period for which jobs may go on as if nothing had happened.
const PATIENT_PART: f64 = 0.8;
/// How long a leaving worker waits for the programs that it has ended.
const LAST_PROGRAMS: Duration = Duration::from_secs(1);
/// How long a worker that has nothing left to compute tries at least to hand in what it has.
const LAST_REPORT: Duration = Duration::from_secs(2);

/// A worker's settings.
#[derive(Debug, Clone)]
pub struct Options {
    /// The coordinator's address, as in `http://127.0.0.1:7400`.
    pub connect: String,
    /// What the worker shows to the coordinator, and what it trusts it by.
    pub credentials: Credentials,
    /// How connections are opened; over TCP by default.
    pub dial: Dial,
    /// How many jobs are computed at once.
    pub slots: usize,
    /// The external simulator, for a campaign that is not simulated by the built-in model.
    pub exec: Option<Exec>,
    /// Where the worker runs, for people.
    pub host: String,
    /// How long the first contact may take.
    pub connect_timeout: Duration,
    /// How long a coordinator that was there before may be away.
    pub give_up_after: Duration,
    /// How long jobs that are being computed may take to end after a shutdown was asked for.
    pub grace: Duration,
    /// After how long the worker drains by itself, as when its time on a cluster ends.
    pub max_runtime: Option<Duration>,
    /// After how long without any job the worker leaves.
    pub idle_exit: Option<Duration>,
}

/// What a worker did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Jobs whose results were acknowledged.
    pub jobs: u64,
    /// Whether the coordinator said that the campaign is finished (or else a shutdown came first).
    pub finished: bool,
}

/// A worker, ready to run.
#[derive(Debug)]
pub struct Worker {
    options: Options,
}

/// What all tasks of a worker share.
struct Shared {
    options: Options,
    connection: Link,
    worker_id: String,
    /// The problem with the digest of its model; replaced when a restarted coordinator names
    /// another campaign.
    problem: RwLock<Option<Arc<Registered>>>,
    held: HeldJobs,
    /// Asks samplers to stop between two samples.
    hurry: AtomicBool,
    /// Results that the coordinator has.
    acknowledged: AtomicU64,
    /// Ends the worker.
    stop: CancellationToken,
}

/// What registering brought.
#[derive(Debug)]
struct Registered {
    epoch: u64,
    problem: Problem,
    /// What simulates the campaign's designs here.
    backend: Arc<Backend>,
    campaign_json: String,
    model_digest: String,
    heartbeat: Duration,
}

impl Worker {
    /// A worker with these settings.
    #[must_use]
    pub const fn new(options: Options) -> Self {
        Self { options }
    }

    /// Works until the coordinator says that the campaign is finished, or until `shutdown`.
    ///
    /// # Errors
    ///
    /// The coordinator cannot be reached or refuses the worker.
    pub async fn run(self, shutdown: CancellationToken) -> Result<Summary, Error> {
        let slots = self.options.slots.max(1);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(slots)
            .thread_name(|index| format!("compute-{index}"))
            .build()
            .map_err(|error| Error::Threads {
                slots,
                reason: error.to_string(),
            })?;
        let connection = connect_by(
            self.options.dial.clone(),
            &self.options.connect,
            &self.options.credentials,
            Role::Worker,
        )?;
        // Cancelled by us when the campaign is finished or an error ends the worker, too.
        let stop = CancellationToken::new();
        let shared = Arc::new(Shared {
            worker_id: format!("{:032x}", rand::random::<u128>()),
            options: self.options,
            connection,
            problem: RwLock::new(None),
            held: HeldJobs::default(),
            hurry: AtomicBool::new(false),
            acknowledged: AtomicU64::new(0),
            stop: stop.clone(),
        });
        let registered = tokio::select! {
            registered = shared.register(true) => registered?,
            () = shutdown.cancelled() => return Ok(Summary { jobs: 0, finished: false }),
        };
        info!(
            coordinator = %shared.connection.url(),
            campaign = %registered.problem.campaign().name,
            slots,
            "registered"
        );

        let mut tasks: JoinSet<Result<End, Error>> = JoinSet::new();
        tasks.spawn(lease(Arc::clone(&shared), pool));
        tasks.spawn(heartbeat(Arc::clone(&shared)));
        let reporter_stop = CancellationToken::new();
        let mut reporter = tokio::spawn(report(Arc::clone(&shared), reporter_stop.clone()));

        let end = tokio::select! {
            ended = tasks.join_next() => match ended {
                Some(Ok(end)) => end,
                Some(Err(panic)) => std::panic::resume_unwind(panic.into_panic()),
                None => Ok(End::Stopped),
            },
            () = shutdown.cancelled() => Ok(End::Stopped),
            () = after(shared.options.max_runtime) => {
                info!("the time is up: draining");
                Ok(End::Stopped)
            }
            () = shared.idle() => {
                info!("no jobs for too long: leaving");
                Ok(End::Stopped)
            }
        };
        stop.cancel();
        let asked = tokio::time::Instant::now();
        if matches!(end, Ok(End::Stopped)) {
            shared.drain().await;
        }
        reporter_stop.cancel();
        // A coordinator that does not answer must not keep a worker that was asked to leave.
        let last = tokio::time::Instant::now() + LAST_REPORT;
        let leave_by = last.max(asked + shared.options.grace);
        if tokio::time::timeout_at(leave_by, &mut reporter)
            .await
            .is_err()
        {
            reporter.abort();
            let lost = shared.held.unacknowledged();
            warn!(lost, "leaving with results that nobody acknowledged");
        }
        let jobs = shared.acknowledged.load(Ordering::Relaxed);
        tasks.shutdown().await;
        if let Some(registered) = shared.registered() {
            registered.backend.stop();
            // Programs that are asked something end within a moment; a worker that left before them
            // would leave nobody to wait for them.
            let since = Instant::now();
            while registered.backend.is_busy() && since.elapsed() < LAST_PROGRAMS {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        }
        let finished = matches!(end?, End::Finished);
        Ok(Summary { jobs, finished })
    }
}

/// Why a task of a worker ended by itself.
#[derive(Debug, Clone, Copy)]
enum End {
    /// The campaign is finished.
    Finished,
    /// The worker was asked to stop.
    Stopped,
}

impl Shared {
    /// Registers, again and again until it works or has taken too long.
    async fn register(&self, first: bool) -> Result<Arc<Registered>, Error> {
        let options = &self.options;
        let patience = if first {
            options.connect_timeout
        } else {
            options.give_up_after
        };
        let since = Instant::now();
        let mut backoff = Backoff::new();
        let url = self.connection.url().to_owned();
        loop {
            // The digest depends on the campaign, which only the coordinator knows: the first call
            // asks for it, the second one answers the question.
            let known = self.registered();
            let request = RegisterRequest {
                worker_id: self.worker_id.clone(),
                host: options.host.clone(),
                program_version: env!("CARGO_PKG_VERSION").to_owned(),
                model_digest: known
                    .as_ref()
                    .map_or_else(String::new, |k| k.model_digest.clone()),
                slots: u32::try_from(options.slots).unwrap_or(u32::MAX),
                held: if known.is_some() {
                    self.held.jobs()
                } else {
                    Vec::new()
                },
            };
            let mut client = self.connection.client();
            let call = tokio::time::timeout(CALL_TIMEOUT, client.register(request));
            let reason = match call.await {
                Ok(answer) => match answer {
                    Ok(response) => {
                        let response = response.into_inner();
                        let confirmed = known
                            .as_ref()
                            .filter(|known| known.campaign_json == response.campaign_json);
                        let (problem, backend, model_digest) = match confirmed {
                            Some(known) => (
                                known.problem.clone(),
                                Arc::clone(&known.backend),
                                known.model_digest.clone(),
                            ),
                            None => self.learn(&response.campaign_json).await?,
                        };
                        let registered = Arc::new(Registered {
                            epoch: response.epoch,
                            model_digest,
                            problem,
                            backend,
                            campaign_json: response.campaign_json.clone(),
                            heartbeat: Duration::from_millis(response.heartbeat_ms.max(10).into()),
                        });
                        let done = confirmed.is_some();
                        if done {
                            self.held.cancel(&response.cancelled);
                        } else {
                            // What is held belongs to another campaign, if to any.
                            self.held.cancel_all();
                        }
                        *self.problem.write().unwrap_or_else(|e| e.into_inner()) =
                            Some(Arc::clone(&registered));
                        if done {
                            return Ok(registered);
                        }
                        continue;
                    }
                    Err(status) => match self.connection.refusal(&status) {
                        Some(refusal) => return Err(refusal),
                        None => cause(&status),
                    },
                },
                Err(_) => "no answer in time".to_owned(),
            };
            debug!(%reason, "registering failed");
            if since.elapsed() > patience {
                return Err(if first {
                    Error::Unreachable { url, reason }
                } else {
                    Error::Away {
                        url,
                        seconds: patience.as_secs(),
                    }
                });
            }
            backoff.pause().await;
        }
    }

    /// The problem of a new campaign, what simulates it here, and the digest of its model.
    async fn learn(&self, campaign_json: &str) -> Result<(Problem, Arc<Backend>, String), Error> {
        let campaign = Campaign::from_json(campaign_json).map_err(|error| Error::Nonsense {
            url: self.connection.url().to_owned(),
            reason: error.to_string(),
        })?;
        let problem = Problem::new(campaign);
        let backend = Arc::new(Backend::choose(&problem, self.options.exec.as_ref())?);
        // An external program may take its time to answer, and must not hold up anything else.
        let questions = {
            let (problem, backend) = (problem.clone(), Arc::clone(&backend));
            tokio::task::spawn_blocking(move || backend.model_digest(&problem))
        };
        // Should the worker be asked to end meanwhile, this wait is dropped, and nobody else
        // would end the program.
        let unwatched = Unwatched(Some(Arc::clone(&backend)));
        let model_digest = questions.await.map_err(|error| Error::Program {
            reason: error.to_string(),
        })??;
        unwatched.keep();
        Ok((problem, backend, model_digest))
    }

    /// Whether an external simulator was ended because this worker ends.
    fn programs_are_stopped(&self) -> bool {
        self.registered()
            .is_some_and(|registered| registered.backend.is_stopped())
    }

    fn registered(&self) -> Option<Arc<Registered>> {
        self.problem
            .read()
            .unwrap_or_else(|e| e.into_inner())
            .clone()
    }

    /// Registers again after a coordinator said that it does not know this worker, unless another
    /// task has done so already.
    async fn register_again(&self, epoch: u64) -> Result<(), Error> {
        if self
            .registered()
            .is_some_and(|registered| registered.epoch == epoch)
        {
            info!(coordinator = %self.connection.url(), "registering again");
            self.register(false).await?;
        }
        Ok(())
    }

    fn epoch(&self) -> u64 {
        self.registered().map_or(0, |registered| registered.epoch)
    }

    /// Ends when nothing has been held for as long as the options allow.
    async fn idle(&self) {
        let Some(limit) = self.options.idle_exit else {
            return std::future::pending().await;
        };
        let mut since = Instant::now();
        while since.elapsed() < limit {
            tokio::time::sleep(limit.min(Duration::from_millis(200))).await;
            if self.held.computing() + self.held.unacknowledged() > 0 {
                since = Instant::now();
            }
        }
    }

    /// Gives back what has not started and waits for the rest. Towards the end of the grace period
    /// samplers stop between two samples and hand in what they have; what is not done even then is
    /// given back.
    async fn drain(&self) {
        let mut given_up = self.held.give_up_waiting();
        let now = tokio::time::Instant::now();
        self.computed_by(now + self.options.grace.mul_f64(PATIENT_PART))
            .await;
        self.hurry.store(true, Ordering::Relaxed);
        self.computed_by(now + self.options.grace).await;
        given_up.extend(self.held.give_up_all());
        if given_up.is_empty() {
            return;
        }
        let request = ReleaseRequest {
            worker_id: self.worker_id.clone(),
            jobs: given_up,
        };
        let mut client = self.connection.client();
        // A release that gets lost costs no more than the wait for the lease to run out.
        let call = tokio::time::timeout(Duration::from_secs(2), client.release(request));
        if !matches!(call.await, Ok(Ok(_))) {
            debug!("the release of unfinished jobs was not acknowledged");
        }
    }
}

impl Shared {
    /// Waits until nothing is being computed, at most until `deadline`.
    async fn computed_by(&self, deadline: tokio::time::Instant) {
        loop {
            let changed = self.held.changed.notified();
            if self.held.computing() == 0
                || tokio::time::timeout_at(deadline, changed).await.is_err()
            {
                return;
            }
        }
    }
}

/// Ends an external program unless it is kept.
struct Unwatched(Option<Arc<Backend>>);

impl Unwatched {
    fn keep(mut self) {
        self.0 = None;
    }
}

impl Drop for Unwatched {
    fn drop(&mut self) {
        if let Some(backend) = &self.0 {
            backend.stop();
        }
    }
}

/// Waits for a limit, or for ever without one.
async fn after(limit: Option<Duration>) {
    match limit {
        Some(limit) => tokio::time::sleep(limit).await,
        None => std::future::pending().await,
    }
}

/// Leases jobs and hands them to the compute threads.
async fn lease(shared: Arc<Shared>, pool: rayon::ThreadPool) -> Result<End, Error> {
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
async fn report(shared: Arc<Shared>, stop: CancellationToken) {
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
async fn heartbeat(shared: Arc<Shared>) -> Result<End, Error> {
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
