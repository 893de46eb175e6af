//! Results that the coordinator has not acknowledged yet.

use std::collections::BTreeMap;
use std::sync::Arc;

use ledger::LeaseId;
use prost::Message as _;
use protocol::v2::LeaseResult;

use super::Lease;

/// The most results of a report: what their commit takes must stay short.
const RESULTS_PER_REPORT: usize = 4096;

/// Nothing more is asked for while so many bytes of results wait for their acknowledgement: a line that
/// is slower than the computing must not fill the memory.
pub(super) const UNACKNOWLEDGED_BYTES: usize = 8 << 20;

#[derive(Debug)]
struct Finished {
    lease: Arc<Lease>,
    result: LeaseResult,
    bytes: usize,
}

/// The results of finished leases that the coordinator has not acknowledged yet.
#[derive(Debug, Default)]
pub(super) struct Outbox {
    finished: BTreeMap<LeaseId, Finished>,
    /// How many bytes wait for their acknowledgement.
    bytes: usize,
}

impl Outbox {
    /// Adds the result of a lease.
    pub(super) fn put(&mut self, lease: Arc<Lease>, result: LeaseResult) {
        let bytes = result.encoded_len();
        self.bytes += bytes;
        let id = lease.id;
        let finished = Finished {
            lease,
            result,
            bytes,
        };
        self.finished.insert(id, finished);
    }

    /// Whether the result of this lease waits for its acknowledgement.
    pub(super) fn contains(&self, id: LeaseId) -> bool {
        self.finished.contains_key(&id)
    }

    /// How many results wait for their acknowledgement.
    pub(super) fn len(&self) -> usize {
        self.finished.len()
    }

    /// Whether so many bytes wait that the worker should ask for no more leases.
    pub(super) const fn is_full(&self) -> bool {
        self.bytes > UNACKNOWLEDGED_BYTES
    }

    /// The leases whose results wait for their acknowledgement.
    pub(super) fn leases(&self) -> impl Iterator<Item = &Lease> {
        self.finished.values().map(|finished| &*finished.lease)
    }

    /// The first results, `most` bytes at most unless the first one alone is larger; and how many bytes
    /// they have.
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
            }
        }
    }

    /// Forgets all results.
    pub(super) fn clear(&mut self) {
        self.finished.clear();
        self.bytes = 0;
    }
}
