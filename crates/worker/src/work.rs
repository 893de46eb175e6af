//! The worker itself: how it begins and how it leaves.

mod calls;
mod registering;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, RwLock};
use std::time::{Duration, Instant};

use gateway::Link;
use ledger::LeaseId;
use protocol::v2::ReleaseRequest;
use tokio::sync::mpsc::UnboundedSender;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tracing::{debug, info, warn};

use crate::error::Error;
use crate::exec::Exec;
use crate::held::HeldLeases;

use registering::Registered;

/// How long the answer to a call may take before it counts as lost.
const CALL_TIMEOUT: Duration = Duration::from_secs(20);
/// How long the coordinator may be silent before the worker says so.
const SILENCE: Duration = Duration::from_secs(10);

/// The part of the grace period for which jobs may go on as if nothing had happened.
const PATIENT_PART: f64 = 0.8;
/// How long a leaving worker waits for the programs that it has ended.
const LAST_PROGRAMS: Duration = Duration::from_secs(1);
/// How long a worker that has nothing left to compute tries at least to hand in what it has.
const LAST_REPORT: Duration = Duration::from_secs(2);

/// A worker's settings.
#[derive(Debug, Clone)]
pub struct Options {
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
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Summary {
    /// Leases whose results were acknowledged.
    pub leases: u64,
    /// Whether the coordinator said that the campaign is finished; or else the worker was asked to
    /// leave before.
    pub finished: bool,
}

/// A worker, ready to run.
#[derive(Debug)]
pub struct Worker {
    connection: Link,
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
    held: HeldLeases,
    /// Asks samplers to stop between two samples.
    hurry: AtomicBool,
    /// Results that the coordinator has.
    acknowledged: AtomicU64,
    /// Ends the worker.
    stop: CancellationToken,
    /// Those who want the coordinator to know at once what is held.
    announcements: UnboundedSender<calls::Announcement>,
}

impl Worker {
    /// A worker with these settings for the coordinator at the other end of `connection`, which must
    /// be a link of a worker's role.
    #[must_use]
    pub const fn new(connection: Link, options: Options) -> Self {
        Self {
            connection,
            options,
        }
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
        // Cancelled by us when the campaign is finished or an error ends the worker, too.
        let stop = CancellationToken::new();
        let (announcements, announced) = tokio::sync::mpsc::unbounded_channel();
        let shared = Arc::new(Shared {
            worker_id: format!("{:032x}", rand::random::<u128>()),
            options: self.options,
            connection: self.connection,
            problem: RwLock::new(None),
            held: HeldLeases::default(),
            hurry: AtomicBool::new(false),
            acknowledged: AtomicU64::new(0),
            stop: stop.clone(),
            announcements,
        });
        let registered = tokio::select! {
            registered = shared.register(true) => registered?,
            () = shutdown.cancelled() => return Ok(Summary { leases: 0, finished: false }),
        };
        info!(
            coordinator = %shared.connection.url(),
            campaign = %registered.problem.campaign().name,
            slots,
            "registered"
        );

        let mut tasks: JoinSet<Result<End, Error>> = JoinSet::new();
        tasks.spawn(calls::lease(Arc::clone(&shared), pool));
        tasks.spawn(calls::heartbeat(Arc::clone(&shared), announced));
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
        match end {
            Ok(End::Stopped) => shared.drain().await,
            Ok(End::Dismissed) => warn!("the coordinator ends before the campaign does"),
            Ok(End::Finished) | Err(_) => {}
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
        let leases = shared.acknowledged.load(Ordering::Relaxed);
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
        Ok(Summary { leases, finished })
    }
}

/// Why a task of a worker ended by itself.
#[derive(Debug, Clone, Copy)]
enum End {
    /// The campaign is finished.
    Finished,
    /// The worker was asked to stop.
    Stopped,
    /// The coordinator said that it ends, and that the campaign is not finished.
    Dismissed,
}

impl Shared {
    /// Whether an external simulator was ended because this worker ends.
    fn programs_are_stopped(&self) -> bool {
        self.registered()
            .is_some_and(|registered| registered.backend.is_stopped())
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

    /// Says that this worker leaves, gives back what has not started and waits for the rest. Towards
    /// the end of the grace period samplers stop between two samples and hand in what they have. Of a
    /// lease whose sample takes even longer, what was kept is handed in; if that is nothing, it is
    /// given back.
    async fn drain(&self) {
        let now = tokio::time::Instant::now();
        let patient_until = now + self.options.grace.mul_f64(PATIENT_PART);
        let waiting = self.held.give_up_waiting();
        tokio::join!(
            self.give_back(waiting, true),
            self.computed_by(patient_until)
        );
        self.hurry.store(true, Ordering::Relaxed);
        self.computed_by(now + self.options.grace).await;
        self.give_back(self.held.give_up_all(), true).await;
    }

    /// Tells the coordinator that it may lease this to others, and whether this worker leaves.
    async fn give_back(&self, leases: Vec<LeaseId>, leaving: bool) {
        if leases.is_empty() && !leaving {
            return;
        }
        let request = ReleaseRequest {
            worker_id: self.worker_id.clone(),
            leases: leases.into_iter().map(Into::into).collect(),
            leaving,
        };
        let mut client = self.connection.client();
        // A release that gets lost costs no more than the wait for the lease to run out.
        let call = tokio::time::timeout(Duration::from_secs(2), client.release(request));
        if !matches!(call.await, Ok(Ok(_))) {
            debug!("the release of unfinished leases was not acknowledged");
        }
    }

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

/// Waits for a limit, or for ever without one.
async fn after(limit: Option<Duration>) {
    match limit {
        Some(limit) => tokio::time::sleep(limit).await,
        None => std::future::pending().await,
    }
}
