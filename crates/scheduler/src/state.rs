//! What a scheduler remembers of a job, a lease and a worker.

use std::collections::BTreeSet;
use std::time::Duration;

use crate::types::{Details, JobId, WorkerId};

#[derive(Debug, Clone)]
pub(crate) struct Job<J> {
    pub(crate) payload: J,
    pub(crate) priority: i32,
    /// What a worker is blamed for that fails it.
    pub(crate) kin: JobId,
    /// The newest attempt, 0 before the first.
    pub(crate) attempts: u32,
    pub(crate) crashes: u32,
    pub(crate) failures: u32,
    pub(crate) state: State,
    /// Where the indices of leased jobs have it.
    pub(crate) filed: Option<Filed>,
}

impl<J> Job<J> {
    pub(crate) fn new(id: JobId, payload: J, details: Details) -> Self {
        let history = details.history;
        Self {
            payload,
            priority: details.priority,
            kin: details.kin.unwrap_or(id),
            attempts: history.attempts,
            crashes: history.crashes,
            failures: history.failures,
            state: State::Queued,
            filed: None,
        }
    }
}

#[derive(Debug, Clone)]
pub(crate) enum State {
    Queued,
    /// One or two leases, of different workers.
    Leased(Vec<Lease>),
    Done,
    Quarantined {
        error: String,
    },
}

#[derive(Debug, Clone)]
pub(crate) struct Lease {
    pub(crate) worker: WorkerId,
    pub(crate) attempt: u32,
    pub(crate) granted: Duration,
    pub(crate) expires: Duration,
    pub(crate) started: bool,
}

/// The keys under which a leased job is found again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Filed {
    /// When the first of its leases runs out.
    pub(crate) expires: Duration,
    /// When its lease was granted, if it has only one.
    pub(crate) alone: Option<Duration>,
}

impl Filed {
    pub(crate) fn of(state: &State) -> Option<Self> {
        let State::Leased(leases) = state else {
            return None;
        };
        Some(Self {
            expires: leases.iter().map(|lease| lease.expires).min()?,
            alone: match leases.as_slice() {
                [lease] => Some(lease.granted),
                _ => None,
            },
        })
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Worker {
    /// How many jobs it computes at once.
    pub(crate) slots: usize,
    pub(crate) held: BTreeSet<JobId>,
    /// The kins of the jobs that it failed since it last finished one.
    pub(crate) strikes: BTreeSet<JobId>,
    pub(crate) set_aside_until: Option<Duration>,
    /// In a row, without finishing a job in between.
    pub(crate) times_set_aside: u32,
    pub(crate) completed: u64,
    pub(crate) failed: u64,
    pub(crate) crashed: u64,
    pub(crate) last_seen: Duration,
}

impl Default for Worker {
    fn default() -> Self {
        Self {
            slots: 1,
            held: BTreeSet::new(),
            strikes: BTreeSet::new(),
            set_aside_until: None,
            times_set_aside: 0,
            completed: 0,
            failed: 0,
            crashed: 0,
            last_seen: Duration::ZERO,
        }
    }
}
