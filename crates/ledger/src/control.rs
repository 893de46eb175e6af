//! Attribution of failures: to the sample, to the worker, or to something that all workers depend on.
//!
//! [`Options::max_failures`](crate::Options::max_failures) asks for a success of the worker between two failures. If no
//! other work brings one, the worker gets a *control*: a unit that was computed before. A worker
//! that fails its control is suspended, and nothing counts against the samples.

use std::time::Duration;

use crate::ledger::Ledger;
use crate::state::{Control, Lease};
use crate::types::{Delivery, Grant, Kind, LeaseId, StreamId, Unit, WorkerId};

/// The order in which units are preferred as controls. A design comes first: it makes every kind of request that a
/// simulator can get, and its generation does not change.
const fn preference(kind: Kind) -> u32 {
    match kind {
        Kind::Design => 0,
        Kind::Point => 1,
        Kind::Run => 2,
    }
}

impl<P: Clone> Ledger<P> {
    /// Offers a unit that was computed before as the control for workers whose jobs fail. It replaces the present
    /// control only if its kind is preferred. The ledger also offers delivered units. Only the first sample of the
    /// unit is used.
    pub fn set_control(&mut self, mut unit: Unit, source: P) {
        let rank = |unit: &Unit| preference(unit.stream.kind);
        let held = self.control.as_ref();
        if held.is_none_or(|held| rank(&unit) < rank(&held.unit)) {
            unit.samples.end = unit.samples.start + 1;
            self.control = Some(Control { unit, source });
        }
    }

    /// Whether the worker must succeed with a control before it gets these units: it has failed too many streams, or a
    /// unit has failed since the worker last succeeded. No control is required after an outage longer than
    /// [`Options::retry_for`](crate::Options::retry_for).
    pub(crate) fn needs_control(&self, worker: &WorkerId, units: &[Unit], now: Duration) -> bool {
        if self.control.is_none() || self.is_hopeless(now) {
            return false;
        }
        let Some(state) = self.workers.known.get(worker) else {
            return false;
        };
        let is_doubtful = |unit: &Unit| {
            let stream = self.streams.get(&unit.stream);
            let failed_at = stream.and_then(|stream| stream.failed_at(&unit.samples));
            failed_at.is_some_and(|turn| turn > state.succeeded_at)
        };
        state.strikes.len() >= self.options.max_worker_strikes.max(1)
            || units.iter().any(is_doubtful)
    }

    /// Grants a control to a worker that has none yet.
    pub(crate) fn grant_control(&mut self, worker: &WorkerId, now: Duration) -> Option<Grant<P>> {
        let Control { unit, source } = self.control.clone()?;
        let held = &self.workers.known.get(worker)?.held;
        let mut leases = held.iter().filter_map(|id| self.leases.get(id));
        if leases.any(|lease| lease.is_control) {
            return None;
        }
        self.newest += 1;
        let id = LeaseId {
            epoch: self.epoch,
            number: self.newest,
        };
        let units = vec![unit];
        let seconds = self.expected(&units);
        let lease = Lease {
            worker: worker.clone(),
            units: Vec::new(),
            granted: now,
            expires: now.saturating_add(self.options.lease),
            started: false,
            seconds,
            is_control: true,
        };
        self.add(id, lease);
        Some(Grant {
            lease: id,
            units: units
                .into_iter()
                .map(|unit| (unit, source.clone()))
                .collect(),
            seconds,
            is_control: true,
        })
    }

    /// The samples of a unit that need the simulator, which excludes samples known beforehand; `None` if there are
    /// none.
    pub(crate) fn simulated(&self, unit: &Unit) -> Option<Unit> {
        let StreamId { kind, index } = unit.stream;
        let known = match kind {
            Kind::Design => self.options.known_samples.get(index as usize),
            _ => None,
        };
        let samples = unit.samples.start.max(known.copied().unwrap_or(0))..unit.samples.end;
        (!samples.is_empty()).then_some(Unit { samples, ..*unit })
    }

    /// Records that a worker has succeeded with a lease.
    pub(crate) fn succeeded(&mut self, worker: &WorkerId, lease: &Lease, delivery: &Delivery) {
        self.turn += 1;
        self.fails_since = None;
        if let Some(state) = self.workers.known.get_mut(worker) {
            state.has_delivered(self.turn);
        }
        let refused = delivery.refused.iter().map(|(stream, _)| *stream);
        let computed = |stream: StreamId| {
            let mut units = lease.units.iter();
            units.find(|unit| unit.stream == stream).cloned()
        };
        let mut stored = delivery.stored.iter();
        let unit = stored.find_map(|unit| self.simulated(unit));
        let mut refused = refused.filter_map(computed);
        let unit = unit.or_else(|| refused.find_map(|unit| self.simulated(&unit)));
        if let Some(unit) = unit
            && let Some(stream) = self.streams.get(&unit.stream)
        {
            let source = stream.source.clone();
            self.set_control(unit, source);
        }
    }

    /// Whether failures are final: nothing has succeeded for [`Options::retry_for`](crate::Options::retry_for), and no
    /// lease from before the first failure is still open.
    pub(crate) fn is_hopeless(&self, now: Duration) -> bool {
        self.fails_since.is_some_and(|since| {
            now.saturating_sub(since) >= self.options.retry_for
                && !self.leases.values().any(|lease| lease.granted < since)
        })
    }
}
