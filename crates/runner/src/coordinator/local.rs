//! Workers in the coordinator's own process.

use std::path::PathBuf;
use std::time::Duration;

use crate::gateway::{Dial, Link};
use crate::worker::{Exec, Options, Summary, Worker};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// Grace period for jobs of the built-in model when the user stops the process. Computing them again takes little
/// longer.
const BUILT_IN_GRACE: Duration = Duration::from_millis(1500);
/// Grace period for an external program, whose job may be expensive.
const EXTERNAL_GRACE: Duration = Duration::from_secs(10);

/// Workers of the coordinator's own process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LocalWorkers {
    /// The number of jobs to compute at once.
    pub count: usize,
    /// The external simulator of the workers, if the campaign uses one.
    pub exec: Option<Exec>,
}

impl LocalWorkers {
    /// Starts a worker with `count` slots, which connects by `dial`; none if `count` is 0. A single worker suffices,
    /// because the process ends as a whole. For `journal` see [`Options::journal`].
    #[must_use]
    pub fn start(
        &self,
        dial: &Dial,
        shutdown: &CancellationToken,
        journal: Option<(PathBuf, String)>,
    ) -> JoinSet<Result<Summary, crate::worker::Error>> {
        let mut workers = JoinSet::new();
        if self.count > 0 {
            let options = Options {
                slots: self.count,
                exec: self.exec.clone(),
                host: format!("{}:in-process", crate::worker::machine()),
                connect_timeout: Duration::from_secs(30),
                give_up_after: Duration::from_secs(30),
                undelivered: None,
                journal,
                grace: match self.exec {
                    Some(_) => EXTERNAL_GRACE,
                    None => BUILT_IN_GRACE,
                },
                max_runtime: None,
                idle_exit: None,
            };
            let link = Link::local(dial.clone());
            workers.spawn(Worker::new(link, options).run(shutdown.clone()));
        }
        workers
    }
}
