//! The `worker` binary: see `worker --help`.

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser as _;
use runner::exit::{self, ProgramError};
use runner::gateway::client::ConnectArguments;
use runner::gateway::port::{self, Listeners};
use runner::gateway::{Link, Role};
use runner::shards::Shard;
use runner::worker::{Arguments, Options, Summary, Worker};
use tokio_util::sync::CancellationToken;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    // The compute threads use the processors; the network needs little.
    let threads = 1;
    runner::console::run(arguments.log_format, threads, work(arguments))
}

/// Works until the campaign is finished or a signal comes, and returns the exit code.
async fn work(arguments: Arguments) -> Result<u8, ProgramError> {
    let processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    // Without a home folder, the current folder is used.
    let folder = arguments.undelivered.clone().unwrap_or_else(|| {
        let state = runner::gateway::access::folder().unwrap_or_default();
        state.join("undelivered")
    });
    let options = Options {
        slots: arguments.slots.map_or(processors, usize::from),
        exec: arguments.simulator.exec(),
        host: host(),
        connect_timeout: Duration::from_secs(arguments.connect_timeout),
        give_up_after: Duration::from_secs(arguments.give_up_after),
        journal: Some((folder.clone(), "worker-".to_owned())),
        undelivered: Some(folder),
        grace: Duration::from_secs(arguments.grace),
        max_runtime: arguments.max_runtime.map(Duration::from_secs),
        idle_exit: arguments.idle_exit.map(Duration::from_secs),
    };
    let shutdown = CancellationToken::new();
    tokio::spawn(runner::console::watch_signals(
        shutdown.clone(),
        "leaving: finishing the running jobs; Ctrl-C again leaves at once",
    ));
    let summary = match (&arguments.shard, &arguments.out) {
        (Some(shard), Some(out)) => compute_shard(shard, out, options, shutdown).await?,
        _ => serve_coordinator(&arguments.connect, options, shutdown).await?,
    };
    tracing::info!(
        leases = summary.leases,
        finished = summary.finished,
        "leaving"
    );
    Ok(if summary.finished {
        exit::OK
    } else {
        exit::INTERRUPTED
    })
}

/// Computes jobs of the coordinator that the arguments name.
async fn serve_coordinator(
    connect: &ConnectArguments,
    options: Options,
    shutdown: CancellationToken,
) -> Result<Summary, ProgramError> {
    let link = tokio::select! {
        link = connect.link_within(Role::Worker, options.connect_timeout) => link?,
        () = shutdown.cancelled() => return Ok(Summary::default()),
    };
    Ok(Worker::new(link, options).run(shutdown).await?)
}

/// Computes a shard, with a service in this process as the coordinator.
async fn compute_shard(
    shard: &Path,
    out: &Path,
    options: Options,
    shutdown: CancellationToken,
) -> Result<Summary, ProgramError> {
    let service = runner::shards::Service::new(Shard::read(shard)?, out.to_owned());
    let (dial, local) = port::local();
    let listeners = Listeners { port: None, local };
    tokio::spawn(port::serve(
        service.clone(),
        listeners,
        CancellationToken::new(),
    ));
    let options = Options {
        undelivered: None,
        journal: None,
        ..options
    };
    let worked = Worker::new(Link::local(dial), options).run(shutdown).await;
    match service.failed() {
        Some(error) => Err(error.into()),
        None => Ok(worked?),
    }
}

/// The machine's name and the process id, as [`Options::host`] wants them.
fn host() -> String {
    format!("{}:{}", runner::worker::machine(), std::process::id())
}
