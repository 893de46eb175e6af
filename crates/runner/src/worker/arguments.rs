//! The command line of the program `worker`.

use std::path::PathBuf;

use clap::Parser;

use super::SimulatorArguments;
use crate::console::{self, LogFormat};
use crate::gateway::client::ConnectArguments;
use crate::identity;

/// Leases jobs from a coordinator, simulates, and reports the results.
// Batch scripts and service files append the user's options to their own: the last one counts.
#[derive(Debug, Parser)]
#[command(name = "worker", version = identity::BUILD, after_help = console::help_footer(), args_override_self = true)]
pub struct Arguments {
    /// The format of the log
    #[arg(long, value_enum, default_value_t)]
    pub log_format: LogFormat,
    #[command(flatten)]
    pub connect: ConnectArguments,
    /// Number of jobs to compute at once [default: the number of processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub slots: Option<u16>,
    #[command(flatten)]
    pub simulator: SimulatorArguments,
    /// Compute a shard written by `coordinator plan`, without a coordinator; needs --out
    #[arg(long, value_name = "FILE.json", requires = "out")]
    pub shard: Option<PathBuf>,
    /// The file for the shard's results; an existing file of the same shard is continued
    #[arg(long, value_name = "FILE.part", requires = "shard")]
    pub out: Option<PathBuf>,
    /// Seconds to wait for the first answer of the coordinator
    #[arg(long, value_name = "SECONDS", default_value_t = 30)]
    pub connect_timeout: u64,
    /// Seconds without an answer of the coordinator and without a running job after which to leave
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    pub give_up_after: u64,
    /// The folder for results that this worker cannot deliver before it ends; the next worker of
    /// the campaign delivers them, or `coordinator merge` [default:
    /// ~/.local/state/pitchline/undelivered]
    #[arg(long, value_name = "DIR")]
    pub undelivered: Option<PathBuf>,
    /// Seconds that running jobs may take to end after SIGTERM
    #[arg(long, value_name = "SECONDS", default_value_t = 30)]
    pub grace: u64,
    /// Seconds after which to drain and leave, for example before the time on a cluster ends
    #[arg(long, value_name = "SECONDS")]
    pub max_runtime: Option<u64>,
    /// Seconds without any job after which to leave
    #[arg(long, value_name = "SECONDS")]
    pub idle_exit: Option<u64>,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_version_names_the_program() {
        let version = Arguments::command().render_version();
        assert_eq!(version.trim_end(), format!("worker {}", identity::BUILD));
    }
}
