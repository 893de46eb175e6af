//! Results that the coordinator has not acknowledged yet.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::protocol::v1::LeaseResult;
use ledger::LeaseId;
use prost::Message as _;

use super::Lease;

/// Maximum number of results in a report, which bounds the time of their commit.
const RESULTS_PER_REPORT: usize = 4096;

/// Size of unacknowledged results, in bytes, above which the worker asks for no leases: a
/// connection slower than the computation must not fill the memory.
pub(super) const UNACKNOWLEDGED_BYTES: usize = 8 << 20;

#[derive(Debug)]
struct FinishedLease {
    lease: Arc<Lease>,
    result: LeaseResult,
    bytes: usize,
}

/// The results of finished leases that the coordinator has not acknowledged yet.
#[derive(Debug, Default)]
pub(super) struct Outbox {
    finished: BTreeMap<LeaseId, FinishedLease>,
    /// Size of the results, in bytes.
    bytes: usize,
    /// The leases of former workers among them, whose results are in files already.
    restored: BTreeSet<LeaseId>,
}

impl Outbox {
    /// Adds the result of a lease.
    pub(super) fn put(&mut self, lease: Arc<Lease>, result: LeaseResult) {
        let bytes = result.encoded_len();
        self.bytes += bytes;
        let id = lease.id;
        let finished = FinishedLease {
            lease,
            result,
            bytes,
        };
        self.finished.insert(id, finished);
    }

    /// Adds the result of a lease of a former worker.
    pub(super) fn restore(&mut self, result: LeaseResult) {
        let lease = Lease {
            id: result.id.unwrap_or_default().into(),
            units: Vec::new(),
            seconds: 0.0,
        };
        self.restored.insert(lease.id);
        self.put(Arc::new(lease), result);
    }

    /// Whether there are results of former workers.
    pub(super) fn has_restored(&self) -> bool {
        !self.restored.is_empty()
    }

    /// The results of this worker, without its failures, which are worth nothing to anyone else.
    pub(super) fn own(&self) -> Vec<LeaseResult> {
        let own = self.finished.iter();
        let own = own.filter(|(id, _)| !self.restored.contains(id));
        own.filter_map(|(_, finished)| {
            let mut result = finished.result.clone();
            result.results.retain(|unit| unit.error.is_none());
            (!result.results.is_empty()).then_some(result)
        })
        .collect()
    }

    /// Whether the result of a lease is here.
    pub(super) fn contains(&self, id: LeaseId) -> bool {
        self.finished.contains_key(&id)
    }

    /// Number of results.
    pub(super) fn len(&self) -> usize {
        self.finished.len()
    }

    /// Whether the results are so large that the worker should ask for no more leases.
    pub(super) const fn is_full(&self) -> bool {
        self.bytes > UNACKNOWLEDGED_BYTES
    }

    /// The leases of the results.
    pub(super) fn leases(&self) -> impl Iterator<Item = &Lease> {
        self.finished.values().map(|finished| &*finished.lease)
    }

    /// Returns the first results, at most `most` bytes unless the first one is larger, and their
    /// size in bytes.
    pub(super) fn first(&self, most: usize) -> (Vec<LeaseResult>, usize) {
        let mut bytes = 0;
        let mut results = Vec::new();
        for finished in self.finished.values().take(RESULTS_PER_REPORT) {
            if bytes + finished.bytes > most && !results.is_empty() {
                break;
            }
            bytes += finished.bytes;
            results.push(finished.result.clone());
        }
        (results, bytes)
    }

    /// Forgets acknowledged results.
    pub(super) fn acknowledge(&mut self, results: &[LeaseResult]) {
        for result in results {
            let id = result.id.unwrap_or_default().into();
            if let Some(finished) = self.finished.remove(&id) {
                self.bytes -= finished.bytes;
                self.restored.remove(&id);
            }
        }
    }

    /// Forgets all results.
    pub(super) fn clear(&mut self) {
        self.finished.clear();
        self.restored.clear();
        self.bytes = 0;
    }
}
