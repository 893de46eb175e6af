//! The ledger behind a lock, with real time and notifications. The service and the engine share it.
//!
//! `jobs` has the calls of the engine, `workers` those of workers, and `clients` those of the status, `drain` and
//! `retry`. `connections` notices the crashes of workers.

mod clients;
mod connections;
mod jobs;
mod workers;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use ledger::{History, Ledger, Options, StreamId, WorkerId};
use problem::formulation::Problem;
use problem::task::{Source, samples_not_asked};
use stages::searching::Progress;
use tokio::sync::Notify;
use tokio::time::Instant;

use crate::coordinator::pace::Rates;
use connections::Connections;

pub use workers::{ReportGuard, Room};

/// The instruction to all workers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// Keep working.
    Work,
    /// Leave: the campaign is finished.
    Finished,
    /// Leave: the coordinator ends before the campaign is finished.
    Leave,
}

struct Inner {
    ledger: Ledger<Arc<Source>>,
    /// Crashes and failures before this coordinator started, of streams that are not wanted yet.
    histories: BTreeMap<StreamId, History>,
    connections: Connections,
    rates: Rates,
    /// Progress of the searches on an external simulator.
    searches: Vec<Progress>,
    /// Workers whose results are being stored.
    reporting: BTreeSet<WorkerId>,
    /// Whether the engine has posted its first plan. Before, the service refuses workers.
    is_ready: bool,
    course: Course,
    retries: u64,
    /// Number of the current state, for clients that watch for changes.
    revision: u64,
    /// Time of the last call of such a client.
    watched: Option<Duration>,
}

/// The ledger of a campaign.
pub struct Board {
    inner: Mutex<Inner>,
    epoch: u64,
    origin: Instant,
    /// Notified when a job may have become free.
    available: Notify,
    /// Notified when a group of streams is settled.
    settled: Notify,
    /// Notified when the revision grows.
    changed: Notify,
}

/// The limits of a campaign's ledger.
#[must_use]
pub fn options(problem: &Problem) -> Options {
    let campaign = problem.campaign();
    let own = campaign.doe.points.len() as u64;
    Options {
        long_samples: campaign.is_external(),
        known_samples: (0..own)
            .map(|design| samples_not_asked(problem, design))
            .collect(),
        max_failures: campaign.simulator.attempts(),
        retry_for: campaign.simulator.retry_for(),
        ..Options::default()
    }
}

impl Board {
    /// Creates a board without jobs.
    #[must_use]
    pub fn new(options: Options, epoch: u64) -> Self {
        Self {
            epoch,
            inner: Mutex::new(Inner {
                ledger: Ledger::new(options, epoch),
                histories: BTreeMap::new(),
                connections: Connections::default(),
                rates: Rates::default(),
                searches: Vec::new(),
                reporting: BTreeSet::new(),
                is_ready: false,
                course: Course::Work,
                retries: 0,
                revision: 1,
                watched: None,
            }),
            origin: Instant::now(),
            available: Notify::new(),
            settled: Notify::new(),
            changed: Notify::new(),
        }
    }

    /// A number that differs after every start of the coordinator.
    #[must_use]
    pub const fn epoch(&self) -> u64 {
        self.epoch
    }

    #[must_use]
    pub fn lease_time(&self) -> Duration {
        self.lock().ledger.lease_time()
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // A panic cannot leave an update half done, so the state stays usable.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        self.origin.elapsed()
    }

    /// Applies a change and notifies the tasks that wait for it.
    fn change<T>(&self, act: impl FnOnce(&mut Inner, Duration) -> T) -> T {
        let mut inner = self.lock();
        let result = act(&mut inner, self.now());
        self.ring(inner);
        result
    }

    fn ring(&self, mut inner: MutexGuard<'_, Inner>) {
        inner.revision += 1;
        let has_settled = inner.ledger.take_settled();
        let has_work = inner.ledger.counts().free > 0 || inner.course != Course::Work;
        drop(inner);
        if has_work {
            self.available.notify_waiters();
        }
        if has_settled {
            self.settled.notify_waiters();
        }
        self.changed.notify_waiters();
    }
}
