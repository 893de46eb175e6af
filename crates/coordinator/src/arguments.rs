//! The command line.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use coordinator::export::Table;
use coordinator::simulate::WearChoice;

/// Plans a Monte Carlo campaign of gear designs, leases its jobs to workers, and writes the report.
#[derive(Debug, Parser)]
#[command(version, after_help = worker::console::help_footer())]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run a whole campaign on this machine
    Run(Run),
    /// Run a campaign with workers that connect from anywhere
    Serve(Serve),
    /// Say how far a campaign is, also while it runs
    Status(Status),
    /// Write the report of a campaign, also while it runs
    Report(Report),
    /// Write a table of a campaign as CSV
    Export(Export),
    /// Print the paper's figures beside a campaign's, as Markdown
    Compare(Compare),
    /// Simulate one gear pair
    Simulate(Simulate),
    /// Validate a campaign file and say what it would do
    Check(Check),
    /// Write a commented campaign file to start from
    Init(Init),
}

#[derive(Debug, Args)]
pub(crate) struct Run {
    /// The campaign file [default: the campaign of the paper]
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: Option<PathBuf>,
    /// The store; a campaign that it holds is continued [default: NAME.db]
    #[arg(long, value_name = "FILE")]
    pub(crate) db: Option<PathBuf>,
    /// Accept a store on a network file system, whose locks and syncs may not keep their word
    #[arg(long)]
    pub(crate) allow_network_store: bool,
    /// How many workers to start in this process [default: the number of processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) workers: Option<u16>,
    /// The folder of the report [default: NAME-report]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct Serve {
    /// The campaign file
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: PathBuf,
    /// The store; a campaign that it holds is continued
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    /// Accept a store on a network file system, whose locks and syncs may not keep their word
    #[arg(long)]
    pub(crate) allow_network_store: bool,
    /// The address to listen on, such as 127.0.0.1:7400; loopback only, as the connection is open
    #[arg(long, value_name = "ADDR")]
    pub(crate) listen: SocketAddr,
    /// Listen on an address that is not loopback although anybody there could join or read along
    #[arg(long)]
    pub(crate) insecure: bool,
    /// The folder of the report [default: NAME-report]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Stay up when the campaign is finished, until a signal comes
    #[arg(long)]
    pub(crate) keep_serving: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Status {
    /// The store
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Report {
    /// The store
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    /// The folder of the report
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// The store
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    /// Which table
    #[arg(long, value_enum)]
    pub(crate) table: Table,
    /// The file; one that exists is refused
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// The store
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// The pair file
    #[arg(long, value_name = "PAIR.toml")]
    pub(crate) pair: PathBuf,
    /// Which wear
    #[arg(long, value_enum, default_value_t = WearChoice::None)]
    pub(crate) wear: WearChoice,
    /// The seed of random wear
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(crate) seed: u64,
    /// How many samples of random wear, at least 4
    #[arg(long, value_name = "K", default_value_t = 30,
        value_parser = clap::value_parser!(u32).range(4..=10_000_000))]
    pub(crate) samples: u32,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Check {
    /// The campaign file
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Init {
    /// The file to write; one that exists is refused
    #[arg(value_name = "FILE.toml")]
    pub(crate) file: PathBuf,
}
