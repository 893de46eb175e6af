//! A simulated worker: its leases and its requests for more, as in `runner::worker`.

use std::collections::VecDeque;

use ledger::{LeaseId, Unit, WorkerId};
use runner::worker::LeaseDemand;

/// A lease of a worker.
#[derive(Debug, Clone)]
pub(crate) struct HeldLease {
    pub(crate) id: LeaseId,
    pub(crate) units: Vec<Unit>,
    /// Expected time, in seconds.
    pub(crate) seconds: f64,
}

impl HeldLease {
    pub(crate) fn samples(&self) -> u64 {
        self.units
            .iter()
            .map(|unit| unit.samples.len() as u64)
            .sum()
    }
}

/// A simulated worker process.
#[derive(Debug)]
pub(crate) struct Worker {
    pub(crate) name: WorkerId,
    /// Number of the worker process in this place. Events of earlier processes are ignored.
    pub(crate) life: u32,
    pub(crate) is_up: bool,
    pub(crate) waiting: VecDeque<HeldLease>,
    pub(crate) computing: Vec<HeldLease>,
    /// Whether a lease request is under way.
    pub(crate) asks: bool,
}

impl Worker {
    pub(crate) fn new(number: u32, life: u32) -> Self {
        Self {
            name: WorkerId::from(format!("w{number}-{life}").as_str()),
            life,
            is_up: true,
            waiting: VecDeque::new(),
            computing: Vec::new(),
            asks: false,
        }
    }

    fn held(&self) -> impl Iterator<Item = &HeldLease> {
        self.computing.iter().chain(&self.waiting)
    }

    /// How much work to ask for; none while the worker has enough.
    pub(crate) fn wanted(&self, slots: usize) -> Option<LeaseDemand> {
        LeaseDemand::of(slots, self.held().map(|held| held.seconds))
    }

    /// The leases for a heartbeat, each with whether it is being computed.
    pub(crate) fn states(&self) -> Vec<(LeaseId, bool)> {
        let computing = self.computing.iter().map(|held| (held.id, true));
        let waiting = self.waiting.iter().map(|held| (held.id, false));
        computing.chain(waiting).collect()
    }
}
