//! The worker: its start and its end.

mod calls;
mod contact;
mod journal;
mod registering;
mod undelivered;

use std::path::PathBuf;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, RwLock};
use std::time::{Duration, Instant};

use crate::gateway::Link;
use crate::protocol::v1::{Origin, ReleaseRequest};
use ledger::LeaseId;
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tracing::{debug, info, warn};

use crate::worker::error::Error;
use crate::worker::exec::{Ability, Exec};
use crate::worker::held::HeldLeases;

use contact::Contact;
use journal::Journal;
use registering::Registration;
use undelivered::Files;

/// Interval between heartbeats until the coordinator names one.
const FIRST_HEARTBEAT: Duration = Duration::from_secs(1);
/// Time limit of a call.
const CALL_TIMEOUT: Duration = Duration::from_secs(20);
/// Share of the grace period during which jobs continue as usual.
const PATIENT_PART: f64 = 0.8;
/// Time that a leaving worker waits for the programs that it has ended.
const LAST_PROGRAMS: Duration = Duration::from_secs(4);
/// Minimum time for the last report of a leaving worker.
const LAST_REPORT: Duration = Duration::from_secs(2);

/// A worker's settings.
#[derive(Debug, Clone)]
pub struct Options {
    /// Number of jobs computed at once.
    pub slots: usize,
    /// The external simulator, for a campaign that is not simulated by the built-in model.
    pub exec: Option<Exec>,
    /// The machine and the process of the worker, `MACHINE:PROCESS`. Failures are attributed by the machine.
    pub host: String,
    /// Time limit of the first contact with the coordinator.
    pub connect_timeout: Duration,
    /// Time without an answer of the coordinator and without a running job after which the worker
    /// leaves.
    pub give_up_after: Duration,
    /// The folder for results that cannot be delivered; none if the coordinator is in this process.
    pub undelivered: Option<PathBuf>,
    /// The folder for notes of the units that are being computed, and the prefix of the notes' names; none for no
    /// notes.
    pub journal: Option<(PathBuf, String)>,
    /// Time for running jobs to end after a shutdown.
    pub grace: Duration,
    /// Time after which the worker drains, for example because its time on a cluster ends.
    pub max_runtime: Option<Duration>,
    /// Time without any job after which the worker leaves.
    pub idle_exit: Option<Duration>,
}

/// The result of a worker's run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Summary {
    /// Leases whose results were acknowledged.
    pub leases: u64,
    /// Whether the coordinator said that the campaign is finished. Otherwise the worker left
    /// before.
    pub finished: bool,
}

#[derive(Debug)]
pub struct Worker {
    connection: Link,
    options: Options,
}

/// The state shared by all tasks of a worker.
struct SharedState {
    options: Options,
    connection: Link,
    worker_id: String,
    /// The problem with the digest of its model; replaced when a restarted coordinator names
    /// another campaign.
    problem: RwLock<Option<Arc<Registration>>>,
    /// Held by the task that registers again: another one that did the same would cancel what was leased since.
    registering: tokio::sync::Mutex<()>,
    held: HeldLeases,
    /// Whether this machine can run the external simulator.
    ability: watch::Sender<Ability>,
    contact: Contact,
    files: Files,
    /// Interval between heartbeats, as last named by the coordinator.
    heartbeat: watch::Sender<Duration>,
    /// Set to stop jobs between two samples.
    hurry: AtomicBool,
    /// Number of acknowledged results.
    acknowledged: AtomicU64,
    /// Cancelled to end the worker.
    stop: CancellationToken,
    /// The note of the units that are being computed.
    journal: Journal,
}

impl Worker {
    /// Creates a worker for the coordinator at the other end of `connection`, which must be a link
    /// in the role of a worker.
    #[must_use]
    pub const fn new(connection: Link, options: Options) -> Self {
        Self {
            connection,
            options,
        }
    }

    /// Works until the coordinator says that the campaign is finished, or until `shutdown`.
    // A boxed future is compiled once, in this crate. An `async fn` would be compiled again in each
    // program that awaits it.
    pub fn run(
        self,
        shutdown: CancellationToken,
    ) -> Pin<Box<dyn Future<Output = Result<Summary, Error>> + Send>> {
        Box::pin(self.work(shutdown))
    }

    async fn work(self, shutdown: CancellationToken) -> Result<Summary, Error> {
        let slots = self.options.slots.max(1);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(slots)
            .thread_name(|index| format!("compute-{index}"))
            .build()
            .map_err(|error| Error::Threads {
                slots,
                reason: error.to_string(),
            })?;
        // Also cancelled when the campaign is finished or an error ends the worker.
        let stop = CancellationToken::new();
        let journal = Journal::new(self.options.journal.clone(), slots);
        let files = Files::new(self.options.undelivered.clone());
        let shared = Arc::new(SharedState {
            worker_id: format!("{:032x}", rand::random::<u128>()),
            options: self.options,
            connection: self.connection,
            problem: RwLock::new(None),
            registering: tokio::sync::Mutex::default(),
            held: HeldLeases::default(),
            ability: watch::Sender::default(),
            contact: Contact::default(),
            files,
            heartbeat: watch::Sender::new(FIRST_HEARTBEAT),
            hurry: AtomicBool::new(false),
            acknowledged: AtomicU64::new(0),
            stop: stop.clone(),
            journal,
        });
        let registered = tokio::select! {
            registered = shared.register(true) => registered?,
            () = shutdown.cancelled() => return Ok(Summary { leases: 0, finished: false }),
        };
        info!(
            coordinator = %shared.connection.address(),
            campaign = %registered.problem.campaign().name,
            slots,
            "registered"
        );
        shared.files.take_up(&registered, &shared.held);
        if registered.backend.is_external() {
            let digest = registered.problem.campaign().digest();
            shared.journal.open(&shared.worker_id, &digest);
        }

        let mut tasks: JoinSet<Result<End, Error>> = JoinSet::new();
        tasks.spawn(calls::lease(Arc::clone(&shared), pool));
        tasks.spawn(calls::heartbeat(Arc::clone(&shared)));
        let reporter_stop = CancellationToken::new();
        let mut reporter = tokio::spawn(calls::report(Arc::clone(&shared), reporter_stop.clone()));

        let end = tokio::select! {
            ended = tasks.join_next() => match ended {
                Some(Ok(end)) => end,
                Some(Err(panic)) => std::panic::resume_unwind(panic.into_panic()),
                None => Ok(End::Stopped),
            },
            () = shutdown.cancelled() => Ok(End::Stopped),
            () = after(shared.options.max_runtime) => {
                info!("the maximum runtime is over: draining");
                Ok(End::Stopped)
            }
            () = shared.idle() => {
                info!("no jobs for too long: leaving");
                Ok(End::Stopped)
            }
            away = shared.away() => Err(away),
            unable = shared.unable() => Err(unable),
        };
        stop.cancel();
        // From here on, the end of this worker counts as no crash.
        shared.journal.remove();
        let asked = tokio::time::Instant::now();
        if let Ok(End::Dismissed) = end {
            warn!("the coordinator ends before the campaign does");
        }
        if !matches!(end, Ok(End::Finished)) {
            shared.drain().await;
        }
        reporter_stop.cancel();
        // A coordinator that does not answer must not delay a worker that was asked to leave.
        let last = tokio::time::Instant::now() + LAST_REPORT;
        let leave_by = match end {
            Ok(_) => last.max(asked + shared.options.grace),
            Err(_) => last,
        };
        if tokio::time::timeout_at(leave_by, &mut reporter)
            .await
            .is_err()
        {
            reporter.abort();
        }
        if !matches!(end, Ok(End::Finished)) {
            shared.keep_undelivered();
            shared.files.leave();
        }
        let leases = shared.acknowledged.load(Ordering::Relaxed);
        tasks.shutdown().await;
        if let Some(registered) = shared.registered() {
            let backend = Arc::clone(&registered.backend);
            // An error means that the runtime ends, and with it this program.
            let _ = tokio::task::spawn_blocking(move || backend.stop()).await;
            // Programs with a request end soon. If the worker left before them, no process would
            // wait for them.
            let since = Instant::now();
            while registered.backend.is_busy() && since.elapsed() < LAST_PROGRAMS {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        }
        let finished = matches!(end?, End::Finished);
        Ok(Summary { leases, finished })
    }
}

/// The reason why a worker's task ended.
#[derive(Debug, Clone, Copy)]
enum End {
    /// The campaign is finished.
    Finished,
    /// The worker was asked to stop.
    Stopped,
    /// The coordinator ends before the campaign is finished.
    Dismissed,
}

impl SharedState {
    /// Records the interval between heartbeats that the coordinator named. Zero changes nothing.
    fn set_heartbeat(&self, milliseconds: u32) {
        let period = Duration::from_millis(milliseconds.max(10).into());
        self.heartbeat.send_if_modified(|held| {
            let is_news = milliseconds > 0 && *held != period;
            if is_news {
                *held = period;
            }
            is_news
        });
    }

    /// Writes the results that are not acknowledged to a file.
    fn keep_undelivered(&self) {
        let results = self.held.own_results();
        let lost = results.len();
        let is_kept = self
            .registered()
            .is_some_and(|registered| self.files.keep(&registered, &self.origin(), results));
        if !is_kept && lost > 0 {
            warn!(lost, "leaving with unacknowledged results");
        }
    }

    /// This worker, for results that another process delivers.
    fn origin(&self) -> Origin {
        Origin {
            worker_id: self.worker_id.clone(),
            host: self.options.host.clone(),
        }
    }

    /// Whether an external simulator was ended because this worker ends.
    fn programs_are_stopped(&self) -> bool {
        self.registered()
            .is_some_and(|registered| registered.backend.is_stopped())
    }

    /// Waits until this machine has failed to run the simulator in every attempt.
    async fn unable(&self) -> Error {
        let mut ability = self.ability.subscribe();
        let unable = ability.wait_for(|ability| ability.fault.is_some()).await;
        match unable.ok().and_then(|ability| ability.fault.clone()) {
            Some(reason) => Error::Machine { reason },
            // The sender lives as long as this future.
            None => std::future::pending().await,
        }
    }

    /// Whether [`Self::unable`] has ended.
    fn is_unable(&self) -> bool {
        self.ability.borrow().fault.is_some()
    }

    /// Waits until the worker has had no lease for the time limit of the options.
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

    /// Tells the coordinator that this worker leaves, releases the leases that have not started,
    /// and waits for the others. Towards the end of the grace period, jobs stop between two samples
    /// and report what they have. If a sample takes even longer, the kept part of its lease is
    /// reported; without one the lease is released.
    async fn drain(&self) {
        let now = tokio::time::Instant::now();
        let patient_until = now + self.options.grace.mul_f64(PATIENT_PART);
        let waiting = self.held.release_waiting();
        tokio::join!(self.release(waiting, true), self.computed_by(patient_until));
        self.hurry.store(true, Ordering::Relaxed);
        self.computed_by(now + self.options.grace).await;
        self.release(self.held.release_all(), true).await;
    }

    /// Releases leases, and tells the coordinator whether this worker leaves.
    async fn release(&self, leases: Vec<LeaseId>, leaving: bool) {
        if leases.is_empty() && !leaving {
            return;
        }
        let request = ReleaseRequest {
            worker_id: self.worker_id.clone(),
            leases: leases.into_iter().map(Into::into).collect(),
            leaving,
        };
        let mut client = self.connection.client();
        // If the release is lost, the leases expire.
        let call = tokio::time::timeout(Duration::from_secs(2), client.release(request));
        if !matches!(call.await, Ok(Ok(_))) {
            debug!("the release of unfinished leases was not acknowledged");
        }
    }

    /// Waits until no lease is being computed, at most until `deadline`.
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

/// Waits for a time limit, or for ever without one.
async fn after(limit: Option<Duration>) {
    match limit {
        Some(limit) => tokio::time::sleep(limit).await,
        None => std::future::pending().await,
    }
}

/// Converts the ids of leases.
fn ids(leases: &[crate::protocol::v1::LeaseId]) -> Vec<LeaseId> {
    leases.iter().map(|id| (*id).into()).collect()
}
