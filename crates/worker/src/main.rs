//! The `worker` binary: see `worker --help`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use runner::exit::{self, ProgramError};
use runner::gateway::client::ConnectArguments;
use runner::gateway::port::{self, Listeners};
use runner::gateway::{Link, Role};
use runner::shards::Shard;
use runner::worker::{Options, SimulatorArguments, Summary, Worker};
use tokio_util::sync::CancellationToken;

/// Leases jobs from a coordinator, simulates, and reports the results.
// Batch scripts and service files append the user's options to their own: the last one counts.
#[derive(Debug, Parser)]
#[command(version = runner::identity::BUILD, after_help = runner::console::help_footer(), args_override_self = true)]
struct Arguments {
    /// The format of the log
    #[arg(long, value_enum, default_value_t)]
    log_format: runner::console::LogFormat,
    #[command(flatten)]
    connect: ConnectArguments,
    /// Number of jobs to compute at once [default: the number of processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    slots: Option<u16>,
    #[command(flatten)]
    simulator: SimulatorArguments,
    /// Compute a shard written by `coordinator plan`, without a coordinator; needs --out
    #[arg(long, value_name = "FILE.json", requires = "out")]
    shard: Option<PathBuf>,
    /// The file for the shard's results; an existing file of the same shard is continued
    #[arg(long, value_name = "FILE.part", requires = "shard")]
    out: Option<PathBuf>,
    /// Seconds to wait for the first answer of the coordinator
    #[arg(long, value_name = "SECONDS", default_value_t = 30)]
    connect_timeout: u64,
    /// Seconds without an answer of the coordinator and without a running job after which to leave
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    give_up_after: u64,
    /// The folder for results that this worker cannot deliver before it ends; the next worker of
    /// the campaign delivers them, or `coordinator merge` [default:
    /// ~/.local/state/pitchline/undelivered]
    #[arg(long, value_name = "DIR")]
    undelivered: Option<PathBuf>,
    /// Seconds that running jobs may take to end after SIGTERM
    #[arg(long, value_name = "SECONDS", default_value_t = 30)]
    grace: u64,
    /// Seconds after which to drain and leave, for example before the time on a cluster ends
    #[arg(long, value_name = "SECONDS")]
    max_runtime: Option<u64>,
    /// Seconds without any job after which to leave
    #[arg(long, value_name = "SECONDS")]
    idle_exit: Option<u64>,
}

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

/// The machine's name and the process id, for display.
fn host() -> String {
    format!("{}:{}", runner::worker::machine(), std::process::id())
}
