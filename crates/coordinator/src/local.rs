//! Workers in the coordinator's own process, for `coordinator run`.

use std::net::SocketAddr;
use std::time::Duration;

use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use worker::client::{Credentials, Dial};
use worker::{Exec, Options, Summary, Worker};

/// Starts `count` workers of one slot each, which connect to `address` like any other worker, with
/// the external simulator of the campaign if it has one.
#[must_use]
pub fn spawn_workers(
    address: SocketAddr,
    count: usize,
    exec: Option<&Exec>,
    shutdown: &CancellationToken,
) -> JoinSet<Result<Summary, worker::Error>> {
    let mut workers = JoinSet::new();
    for index in 0..count {
        let options = Options {
            connect: format!("http://{address}"),
            credentials: Credentials::default(),
            dial: Dial::default(),
            slots: 1,
            exec: exec.cloned(),
            host: format!("in-process:{index}"),
            connect_timeout: Duration::from_secs(30),
            give_up_after: Duration::from_secs(30),
            grace: Duration::from_secs(10),
            max_runtime: None,
            idle_exit: None,
        };
        workers.spawn(Worker::new(options).run(shutdown.clone()));
    }
    workers
}
