//! The connections of workers. A worker whose last connection ends, and that has not said that it leaves, has most
//! likely crashed.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use ledger::WorkerId;

use super::Board;

/// Time for a worker to connect again after its last connection has ended. A living worker needs less than a tenth of
/// that, unless the network is down.
const RETURN: Duration = Duration::from_millis(2500);

/// The connections of workers.
#[derive(Debug, Default)]
pub(super) struct Connections {
    /// The number of connections of each worker that has one.
    open: BTreeMap<WorkerId, usize>,
    /// The workers without a connection, and when they count as crashed.
    lost: BTreeMap<WorkerId, Duration>,
}

impl Connections {
    /// Removes and returns the workers that have not come back in time.
    pub(super) fn take_lost(&mut self, now: Duration) -> Vec<WorkerId> {
        let lost = self.lost.extract_if(.., |_, until| *until <= now);
        lost.map(|(worker, _)| worker).collect()
    }
}

/// A connection of a worker, until it is dropped.
pub struct Connection {
    board: Arc<Board>,
    worker: WorkerId,
}

impl Board {
    /// Records a connection of a worker.
    #[must_use]
    pub fn connect(self: &Arc<Self>, worker: &WorkerId) -> Connection {
        let mut inner = self.lock();
        *inner.connections.open.entry(worker.clone()).or_default() += 1;
        inner.connections.lost.remove(worker);
        Connection {
            board: Arc::clone(self),
            worker: worker.clone(),
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        let until = self.board.now() + RETURN;
        let inner = &mut *self.board.lock();
        let connections = &mut inner.connections;
        if let Some(open) = connections.open.get_mut(&self.worker) {
            *open -= 1;
            if *open == 0 {
                connections.open.remove(&self.worker);
                connections.lost.insert(self.worker.clone(), until);
                inner.ledger.mark_disconnected(&self.worker);
            }
        }
    }
}
