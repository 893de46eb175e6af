//! The calls of the engine: missing jobs, expired leases, and the end of a campaign.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use ledger::{Crash, History, StreamDemand, StreamId, Unit};
use problem::task::Source;
use stages::searching::Progress;

use super::{Board, Course};

impl Board {
    /// Restores the crashes and failures of streams from before a restart.
    pub fn remember(&self, histories: BTreeMap<StreamId, History>) {
        self.lock().histories = histories;
    }

    /// Grants no lease for this long, so that workers that hold leases from before a restart can
    /// report them first.
    pub fn delay_leases(&self, grace: Duration) {
        let until = self.now() + grace;
        self.change(|inner, _| inner.ledger.close_until(until));
    }

    /// Adds missing samples to the ledger. Samples known already keep their state.
    pub fn want(&self, wanted: Vec<StreamDemand<Arc<Source>>>) {
        self.change(|inner, _| {
            for mut wanted in wanted {
                if !inner.histories.is_empty() {
                    wanted.history = inner.histories.remove(&wanted.stream).unwrap_or_default();
                }
                inner.ledger.want(wanted);
            }
        });
    }

    /// Offers a unit whose samples are stored as the control: workers whose jobs fail compute it to show that they
    /// can compute anything.
    pub fn set_control(&self, unit: Unit, source: Arc<Source>) {
        self.lock().ledger.set_control(unit, source);
    }

    /// Forgets streams whose samples are no longer needed.
    pub fn forget(&self, which: impl Fn(StreamId) -> bool) {
        self.change(|inner, _| inner.ledger.forget(which));
    }

    /// Lets workers register: the first plan is posted.
    pub fn open(&self) {
        self.lock().is_ready = true;
    }

    /// Whether the first plan is posted.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.lock().is_ready
    }

    /// Ends the leases of workers that are silent or have lost their connection. Returns the streams that they held.
    pub fn expire(&self) -> Vec<Crash> {
        let now = self.now();
        let mut inner = self.lock();
        let before = inner.ledger.counts();
        let mut crashes = inner.ledger.expire(now);
        for worker in inner.connections.take_lost(now) {
            crashes.extend(inner.ledger.mark_crashed(&worker, now));
        }
        if inner.ledger.counts() != before {
            self.ring(inner);
        }
        crashes
    }

    #[must_use]
    pub fn quarantined(&self) -> BTreeSet<StreamId> {
        let inner = self.lock();
        inner
            .ledger
            .quarantined()
            .map(|(stream, _)| stream)
            .collect()
    }

    /// Returns a future that ends when the next group of streams is settled.
    pub fn watch(&self) -> tokio::sync::futures::Notified<'_> {
        self.settled.notified()
    }

    /// Whether leasing was stopped and no lease is left.
    #[must_use]
    pub fn is_drained(&self) -> bool {
        let inner = self.lock();
        inner.ledger.is_draining() && inner.ledger.is_idle()
    }

    /// Waits until [`is_drained`](Self::is_drained).
    pub async fn drained(&self) {
        loop {
            let changed = self.changed.notified();
            if self.is_drained() {
                return;
            }
            changed.await;
        }
    }

    /// Sets the instruction to all workers.
    pub fn set_course(&self, course: Course) {
        self.change(|inner, _| inner.course = course);
    }

    /// Number of retries that found quarantined streams.
    #[must_use]
    pub fn retries(&self) -> u64 {
        self.lock().retries
    }

    /// Tells all workers that the campaign is finished, unless there were more retries than `seen`:
    /// a retry may arrive while the report is written. Returns whether the campaign is finished.
    #[must_use]
    pub fn finish(&self, seen: u64) -> bool {
        self.change(|inner, _| {
            let is_finished = inner.retries == seen;
            if is_finished {
                inner.course = Course::Finished;
            }
            is_finished
        })
    }

    /// Waits until a finished campaign has work again, which a retry adds.
    pub async fn reopened(&self) {
        loop {
            let changed = self.changed.notified();
            if self.lock().course == Course::Work {
                return;
            }
            changed.await;
        }
    }

    /// Whether every worker that called within the duration of a lease has been told to leave.
    #[must_use]
    pub fn all_dismissed(&self) -> bool {
        let inner = self.lock();
        let recently = inner.ledger.lease_time();
        inner.ledger.all_dismissed(recently, self.now())
    }

    /// Records the progress of the searches on an external simulator.
    pub fn show_searches(&self, searches: Vec<Progress>) {
        self.lock().searches = searches;
    }
}
