//! Workers in the coordinator's own process.

use std::time::Duration;

use crate::gateway::{Dial, Link};
use crate::worker::{Exec, Options, Summary, Worker};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// Workers of the coordinator's own process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LocalWorkers {
    /// The number of workers, of one slot each.
    pub count: usize,
    /// The external simulator of the workers, if the campaign uses one.
    pub exec: Option<Exec>,
}

impl LocalWorkers {
    /// Starts the workers, which connect by `dial`.
    #[must_use]
    pub fn start(
        &self,
        dial: &Dial,
        shutdown: &CancellationToken,
    ) -> JoinSet<Result<Summary, crate::worker::Error>> {
        let mut workers = JoinSet::new();
        for index in 0..self.count {
            let link = Link::local(dial.clone());
            let options = Options {
                slots: 1,
                exec: self.exec.clone(),
                host: format!("in-process:{index}"),
                connect_timeout: Duration::from_secs(30),
                give_up_after: Duration::from_secs(30),
                undelivered: None,
                grace: Duration::from_secs(10),
                max_runtime: None,
                idle_exit: None,
            };
            workers.spawn(Worker::new(link, options).run(shutdown.clone()));
        }
        workers
    }
}
