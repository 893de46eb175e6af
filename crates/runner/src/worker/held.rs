//! The leases of a worker: those that wait, those that are being computed, and those whose results
//! the coordinator has not acknowledged yet.

mod outbox;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::protocol::v1::{HeldLease, LeaseResult, LeaseState, UnitResult};
use ledger::{LeaseId, Unit};
use problem::task::Source;
use tokio::sync::Notify;

use super::demand::LeaseDemand;
use outbox::Outbox;

/// A lease read from a response.
#[derive(Debug)]
pub(crate) struct Lease {
    pub(crate) id: LeaseId,
    pub(crate) units: Vec<(Unit, Source)>,
    /// Expected time, in seconds.
    pub(crate) seconds: f64,
}

#[derive(Debug)]
struct OpenLease {
    lease: Arc<Lease>,
    started: bool,
    cancelled: Arc<AtomicBool>,
    /// Results of finished units.
    done: Vec<UnitResult>,
    /// The finished part of the current unit, in case there is no time for the rest.
    part: Option<UnitResult>,
    /// Time taken so far, in seconds.
    seconds: f64,
}

#[derive(Debug, Default)]
struct Inner {
    computing: BTreeMap<LeaseId, OpenLease>,
    outbox: Outbox,
    /// The serial number of the newest failure.
    serial: u64,
}

impl Inner {
    /// Keeps the results of a lease until they are acknowledged.
    fn finish(&mut self, held: OpenLease) {
        let result = LeaseResult {
            id: Some(held.lease.id.into()),
            results: held.done.into_iter().chain(held.part).collect(),
            wall_seconds: held.seconds,
            origin: None,
        };
        self.outbox.put(held.lease, result);
    }
}

/// The leases of a worker.
#[derive(Debug, Default)]
pub(crate) struct HeldLeases {
    inner: Mutex<Inner>,
    /// Notified when the leases change.
    pub(crate) changed: Notify,
}

impl HeldLeases {
    fn with<T>(&self, act: impl FnOnce(&mut Inner) -> T) -> T {
        // A panic cannot leave an update half done.
        act(&mut self.inner.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Adds a lease. Returns false if the worker has it already, for example because a response
    /// arrived twice.
    pub(crate) fn take(&self, lease: &Arc<Lease>) -> bool {
        self.with(|inner| {
            let id = lease.id;
            if inner.computing.contains_key(&id) || inner.outbox.contains(id) {
                return false;
            }
            let held = OpenLease {
                lease: Arc::clone(lease),
                started: false,
                cancelled: Arc::default(),
                done: Vec::new(),
                part: None,
                seconds: 0.0,
            };
            inner.computing.insert(id, held);
            true
        })
    }

    /// Marks a lease as started. Returns its cancellation flag, or none if the lease was released
    /// or cancelled meanwhile.
    pub(crate) fn start(&self, id: LeaseId) -> Option<Arc<AtomicBool>> {
        self.with(|inner| {
            let held = inner.computing.get_mut(&id)?;
            held.started = true;
            Some(Arc::clone(&held.cancelled))
        })
    }

    /// Keeps the finished part of a unit, in case there is no time for the rest. `seconds` is the
    /// time that the lease has taken so far.
    pub(crate) fn keep(&self, id: LeaseId, part: UnitResult, seconds: f64) {
        self.with(|inner| {
            if let Some(held) = inner.computing.get_mut(&id) {
                held.part = Some(part);
                held.seconds = seconds;
            }
        });
    }

    /// Adds the result of a unit. A failure gets its serial number here.
    pub(crate) fn add(&self, id: LeaseId, result: UnitResult, seconds: f64) {
        self.with(|inner| {
            let Some(held) = inner.computing.get_mut(&id) else {
                return;
            };
            let mut result = result;
            if result.error.is_some() {
                inner.serial += 1;
                result.serial = inner.serial;
            }
            held.part = None;
            held.done.push(result);
            held.seconds = seconds;
        });
    }

    /// Ends the computation of a lease. Its results are kept for a report, unless the lease was
    /// cancelled.
    pub(crate) fn finish(&self, id: LeaseId) {
        self.with(|inner| {
            if let Some(held) = inner.computing.remove(&id)
                && !held.cancelled.load(Ordering::Relaxed)
            {
                inner.finish(held);
            }
        });
        self.changed.notify_waiters();
    }

    /// Forgets leases that are no longer needed and stops those that are being computed. Finished
    /// results are reported all the same: the coordinator decides whether it needs them.
    pub(crate) fn cancel(&self, leases: &[LeaseId]) {
        if leases.is_empty() {
            return;
        }
        self.with(|inner| {
            for id in leases {
                match inner.computing.get(id) {
                    Some(held) if held.started => held.cancelled.store(true, Ordering::Relaxed),
                    _ => {
                        inner.computing.remove(id);
                    }
                }
            }
        });
        self.changed.notify_waiters();
    }

    /// Forgets everything, for a coordinator with another campaign.
    pub(crate) fn cancel_all(&self) {
        let leases: Vec<LeaseId> = self.with(|inner| {
            inner.outbox.clear();
            inner.computing.keys().copied().collect()
        });
        self.cancel(&leases);
    }

    /// Forgets the leases that have not started, and returns them.
    pub(crate) fn release_waiting(&self) -> Vec<LeaseId> {
        let released = self.with(|inner| {
            let waiting = inner.computing.extract_if(.., |_, held| !held.started);
            waiting.map(|(id, _)| id).collect()
        });
        self.changed.notify_waiters();
        released
    }

    /// Ends the leases that are not finished. Those with kept results are finished with these; the
    /// others are forgotten and returned.
    pub(crate) fn release_all(&self) -> Vec<LeaseId> {
        let released = self.with(|inner| {
            let mut released = Vec::new();
            for (id, held) in std::mem::take(&mut inner.computing) {
                let is_wanted = !held.cancelled.swap(true, Ordering::Relaxed);
                if is_wanted && (!held.done.is_empty() || held.part.is_some()) {
                    inner.finish(held);
                } else {
                    released.push(id);
                }
            }
            released
        });
        self.changed.notify_waiters();
        released
    }

    /// Number of unfinished leases.
    pub(crate) fn computing(&self) -> usize {
        self.with(|inner| inner.computing.len())
    }

    /// Number of results that are not acknowledged.
    pub(crate) fn unacknowledged(&self) -> usize {
        self.with(|inner| inner.outbox.len())
    }

    /// Adds the results of a former worker. They are reported before any lease is requested, because they may be the
    /// results of the jobs that would be leased.
    pub(crate) fn restore(&self, results: Vec<LeaseResult>) {
        self.with(|inner| {
            for result in results {
                inner.outbox.restore(result);
            }
        });
        self.changed.notify_waiters();
    }

    /// The unacknowledged results of this worker itself, without failures.
    pub(crate) fn own_results(&self) -> Vec<LeaseResult> {
        self.with(|inner| inner.outbox.own())
    }

    /// Whether results of former workers are unacknowledged.
    pub(crate) fn has_restored(&self) -> bool {
        self.with(|inner| inner.outbox.has_restored())
    }

    /// Returns the amount of work to ask for with `slots` slots; none while there is enough, or too
    /// many results are unacknowledged.
    pub(crate) fn wanted(&self, slots: usize) -> Option<LeaseDemand> {
        self.with(|inner| {
            if inner.outbox.is_full() || inner.outbox.has_restored() {
                return None;
            }
            let held = inner.computing.values();
            LeaseDemand::of(slots, held.map(|held| held.lease.seconds))
        })
    }

    /// Returns unacknowledged results of at most `most` bytes, or one larger result, and their size
    /// in bytes.
    pub(crate) fn results(&self, most: usize) -> (Vec<LeaseResult>, usize) {
        self.with(|inner| inner.outbox.first(most))
    }

    /// Forgets acknowledged results.
    pub(crate) fn acknowledge(&self, results: &[LeaseResult]) {
        self.with(|inner| inner.outbox.acknowledge(results));
        self.changed.notify_waiters();
    }

    /// All leases, for a heartbeat. Finished but unacknowledged leases are included: they still
    /// belong to this worker.
    pub(crate) fn states(&self) -> Vec<LeaseState> {
        let state = |id: LeaseId, started| LeaseState {
            id: Some(id.into()),
            started,
        };
        self.with(|inner| {
            let computing = inner.computing.iter();
            let computing = computing.map(|(id, held)| state(*id, held.started));
            let finished = inner.outbox.leases().map(|lease| state(lease.id, true));
            computing.chain(finished).collect()
        })
    }

    /// All leases with their units, for a coordinator that may have been restarted.
    pub(crate) fn leases(&self) -> Vec<HeldLease> {
        let named = |lease: &Lease| HeldLease {
            id: Some(lease.id.into()),
            units: lease.units.iter().map(|(unit, _)| unit.into()).collect(),
        };
        self.with(|inner| {
            let computing = inner.computing.values();
            let computing = computing.filter(|held| !held.cancelled.load(Ordering::Relaxed));
            let computing = computing.map(|held| named(&held.lease));
            computing.chain(inner.outbox.leases().map(named)).collect()
        })
    }
}
