//! The `worker` binary: see `worker --help`.

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use gateway::Role;
use gateway::client::Reach;
use protocol::exit;
use tokio_util::sync::CancellationToken;
use worker::{Options, SimulatorArguments, Summary, Worker};

/// Leases jobs from a coordinator, simulates, and reports the results.
// Batch scripts and service files append the user's options to their own: the last one counts.
#[derive(Debug, Parser)]
#[command(version = identity::BUILD, after_help = console::help_footer(), args_override_self = true)]
struct Arguments {
    /// How to write the log
    #[arg(long, value_enum, default_value_t)]
    log_format: console::LogFormat,
    #[command(flatten)]
    reach: Reach,
    /// How many jobs to compute at once [default: the number of processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    slots: Option<u16>,
    #[command(flatten)]
    simulator: SimulatorArguments,
    /// How many seconds to wait for the coordinator to answer for the first time
    #[arg(long, value_name = "SECONDS", default_value_t = 30)]
    connect_timeout: u64,
    /// After how many seconds without the coordinator to leave
    #[arg(long, value_name = "SECONDS", default_value_t = 60)]
    give_up_after: u64,
    /// How many seconds jobs that are being computed may take to end after SIGTERM
    #[arg(long, value_name = "SECONDS", default_value_t = 30)]
    grace: u64,
    /// After how many seconds to drain and leave, as when the time on a cluster ends
    #[arg(long, value_name = "SECONDS")]
    max_runtime: Option<u64>,
    /// After how many seconds without any job to leave
    #[arg(long, value_name = "SECONDS")]
    idle_exit: Option<u64>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if let Err(error) = console::start_log(arguments.log_format) {
        console::complain(&error.to_string());
        return ExitCode::from(exit::USAGE);
    }
    let processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let options = Options {
        slots: arguments.slots.map_or(processors, usize::from),
        exec: arguments.simulator.exec(),
        host: host(),
        connect_timeout: Duration::from_secs(arguments.connect_timeout),
        give_up_after: Duration::from_secs(arguments.give_up_after),
        grace: Duration::from_secs(arguments.grace),
        max_runtime: arguments.max_runtime.map(Duration::from_secs),
        idle_exit: arguments.idle_exit.map(Duration::from_secs),
    };
    let runtime = match tokio::runtime::Builder::new_multi_thread()
        // The compute threads have the processors; the network needs next to nothing.
        .worker_threads(1)
        .enable_all()
        .build()
    {
        Ok(runtime) => runtime,
        Err(error) => {
            console::complain(&format!("cannot start: {error}"));
            return ExitCode::from(exit::FAILURE);
        }
    };
    let result = runtime.block_on(async {
        let shutdown = CancellationToken::new();
        tokio::spawn(console::watch_signals(
            shutdown.clone(),
            "leaving: finishing what is being computed; Ctrl-C once more leaves at once",
        ));
        let patience = options.connect_timeout;
        let link = tokio::select! {
            link = arguments.reach.link_within(Role::Worker, patience) => link?,
            () = shutdown.cancelled() => return Ok(Summary::default()),
        };
        Worker::new(link, options).run(shutdown).await
    });
    // Threads that still compute what nobody waits for must not hold up the exit.
    runtime.shutdown_background();
    match result {
        Ok(summary) => {
            tracing::info!(
                leases = summary.leases,
                finished = summary.finished,
                "leaving"
            );
            ExitCode::from(if summary.finished {
                exit::OK
            } else {
                exit::INTERRUPTED
            })
        }
        Err(error) => {
            console::complain(&error.to_string());
            ExitCode::from(error.exit_code())
        }
    }
}

/// The machine's name and the process, for people.
fn host() -> String {
    let name = std::fs::read_to_string("/etc/hostname")
        .map_or_else(|_| "unknown".to_owned(), |name| name.trim().to_owned());
    format!("{name}:{}", std::process::id())
}
