//! The command line.

use std::net::SocketAddr;
use std::path::PathBuf;

use ::studies::simulate::WearChoice;
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use problem::Approach;
use results::export::Table;
use results::table::Format;
use runner::console::LogFormat;
use runner::coordinator::server;
use runner::gateway::address;
use runner::gateway::client::ConnectArguments;
use runner::worker::SimulatorArguments;
use store::FailPoint;

mod modelling;
mod studies;
pub(crate) use self::modelling::{Fit, Predict};
pub(crate) use self::studies::{
    FinishedCampaign, Pareto, Sensitivity, SimulateCluster, Sizing, SleepProgram, Stability, Sweep,
    Tradeoff,
};

/// Plans a Monte Carlo campaign of gear designs, leases its jobs to workers, and writes the report.
// Batch scripts append the user's options to their own: the last one counts.
#[derive(Debug, Parser)]
#[command(version = runner::identity::BUILD, after_help = runner::console::help_footer(), args_override_self = true)]
pub(crate) struct Arguments {
    /// The format of the log
    #[arg(long, value_enum, default_value_t, global = true)]
    pub(crate) log_format: LogFormat,
    /// The fail point at which a test ends the program, see the documentation of the crate `store`
    #[arg(long, hide = true)]
    pub(crate) fail_point: Option<FailPoint>,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run a whole campaign on this machine
    Run(Run),
    /// Run a campaign with workers that connect over the network
    Serve(Serve),
    /// Write the missing jobs as shard files, for nodes that cannot connect to a coordinator
    Plan(Plan),
    /// Store the result files (parts) that workers made of shards
    Merge(Merge),
    /// Print the progress of a campaign, during or after the run
    Status(Status),
    /// Serve the live page of a campaign from its store alone, during or after the run
    View(View),
    /// Print why no job, or no further job, is being computed
    Explain(Explain),
    /// Stop leasing jobs; the coordinator ends once the leased jobs are reported
    Drain(Drain),
    /// Try the quarantined jobs again
    Retry(Retry),
    /// Remove stored results of a design or of a worker, to be computed again
    Discard(Discard),
    /// Run a campaign for each of several numbers of teeth, and compare
    Sweep(Sweep),
    /// Design with other teeth, modules, face widths, helix angles and racks, and rank them
    Sizing(Sizing),
    /// Measure how tolerances, the wear's parameters and the torque affect the recommended design
    Sensitivity(Sensitivity),
    /// Show the trade-off between the percentile and the contact pressure or the root stress
    Pareto(Pareto),
    /// Chart speed against accuracy: simulator, percentile, kriging, optimisation, runner
    Tradeoff(Tradeoff),
    /// Simulate a cluster, to show how many workers one coordinator can serve
    SimulateCluster(SimulateCluster),
    /// Answer as a simulator that sleeps, for `tradeoff`
    #[command(hide = true)]
    SleepProgram(SleepProgram),
    /// Write the report of a campaign, during or after the run
    Report(Report),
    /// Write a table of a campaign as CSV or JSON, its model, or an optimum as a pair file
    Export(Export),
    /// Fit a kriging model to a table of your own, and validate it
    Fit(Fit),
    /// Predict at points with a fitted model
    Predict(Predict),
    /// Print a campaign's figures next to the paper's, as Markdown
    Compare(Compare),
    /// Simulate one gear pair
    Simulate(Simulate),
    /// Convert a gear stage in REXS to a pair file for `simulate`
    Import(Import),
    /// Offer a campaign's gear model to other programs, as a UM-Bridge model
    UmBridge(UmBridge),
    /// Run inputs on which numerical methods fail, and write how each failure is detected and
    /// handled
    Stability(Stability),
    /// Validate a campaign file and say what it would do
    Check(Check),
    /// Write a commented campaign file to start from
    Init(Init),
    /// Print what a shell needs to complete commands and options of both programs
    Completions(Completions),
    /// Write man pages, completions of all shells and schemas into a folder, for packages
    #[command(hide = true)]
    Share(Share),
}

#[derive(Debug, Args)]
pub(crate) struct Run {
    /// The campaign file [default: the campaign of the paper]
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: Option<PathBuf>,
    /// The store; a campaign that it holds is continued [default: NAME.db]
    #[arg(long, value_name = "FILE")]
    pub(crate) db: Option<PathBuf>,
    /// Accept a store on a network file system, whose locks and syncs may be unreliable
    #[arg(long)]
    pub(crate) allow_network_store: bool,
    /// Number of workers to start in this process [default: the processors divided by
    /// simulator.processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) workers: Option<u16>,
    /// Stop as at Ctrl-C once standard input ends: for a program that starts this one and may be killed
    #[arg(long, hide = true)]
    pub(crate) until_input_ends: bool,
    #[command(flatten)]
    pub(crate) how: RunArguments,
}

/// How `run` and `serve` work on a campaign.
#[derive(Debug, Args)]
pub(crate) struct RunArguments {
    #[command(flatten)]
    pub(crate) simulator: SimulatorArguments,
    /// Compute again what failed in every attempt: samples that count as failed, designs, and candidates of
    /// searches
    #[arg(long)]
    pub(crate) retry_failed: bool,
    /// The folder of the report [default: NAME-report]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Serve a live page at http://ADDR, with its data at /api/v1/status and the like, and metrics for
    /// Prometheus at /metrics; loopback only
    #[arg(long, value_name = "ADDR")]
    pub(crate) http: Option<SocketAddr>,
}

#[derive(Debug, Args)]
pub(crate) struct Plan {
    /// The campaign file
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: PathBuf,
    /// The store; a campaign that it holds is continued
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    /// Accept a store on a network file system, whose locks and syncs may be unreliable
    #[arg(long)]
    pub(crate) allow_network_store: bool,
    /// Number of shards to divide the jobs among
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) shards: u32,
    /// The folder of the shards; one that is not empty is refused
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// The folder of the report, which is written if no job is missing [default: NAME-report]
    #[arg(long, value_name = "DIR")]
    pub(crate) report: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Merge {
    /// The store that planned the shards
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    /// Accept a store on a network file system, whose locks and syncs may be unreliable
    #[arg(long)]
    pub(crate) allow_network_store: bool,
    /// Result files that workers made of shards; the same part may be merged again
    #[arg(value_name = "FILE.part", required = true)]
    pub(crate) parts: Vec<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// The port for workers and commands of other processes.
#[derive(Debug, Args)]
pub(crate) struct PortArguments {
    /// The address to listen on, such as 127.0.0.1:7400 [default: all interfaces, at the port of
    /// the last run if it is free, else at any free port]
    #[arg(long, value_name = "ADDR")]
    pub(crate) listen: Option<SocketAddr>,
    /// The access file to write, for workers and commands [default: NAME.access in
    /// ~/.local/state/pitchline]
    #[arg(long, value_name = "FILE", env = "PITCHLINE_ACCESS")]
    pub(crate) access: Option<PathBuf>,
    /// A further name or address of this machine for the access file; may be repeated
    #[arg(long = "host", value_name = "NAME", value_parser = address::host)]
    pub(crate) hosts: Vec<String>,
}

#[derive(Debug, Args)]
pub(crate) struct Serve {
    /// The campaign file
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: PathBuf,
    /// The store; a campaign that it holds is continued
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    /// Accept a store on a network file system, whose locks and syncs may be unreliable
    #[arg(long)]
    pub(crate) allow_network_store: bool,
    #[command(flatten)]
    pub(crate) port: PortArguments,
    /// Number of workers to start in this process
    #[arg(long, value_name = "N", default_value_t = 0,
        value_parser = clap::value_parser!(u16).range(0..=1024))]
    pub(crate) workers: u16,
    #[command(flatten)]
    pub(crate) how: RunArguments,
    /// Keep serving when the campaign is finished, until a signal or `drain`
    #[arg(long)]
    pub(crate) keep_serving: bool,
    /// Seconds without a heartbeat after which a worker's leases expire and others get the jobs;
    /// results that arrive later are still stored
    #[arg(long, value_name = "SECONDS", default_value_t = server::LEASE.as_secs(),
        value_parser = clap::value_parser!(u64).range(2..=86_400))]
    pub(crate) lease: u64,
}

#[derive(Debug, Args)]
pub(crate) struct Status {
    /// Read the store instead of asking the running coordinator; workers and rates are then not
    /// shown
    #[arg(long, value_name = "FILE")]
    pub(crate) db: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) connect: ConnectArguments,
    /// Check everything in the store against its digests first, which takes seconds for millions of
    /// samples
    #[arg(long, requires = "db")]
    pub(crate) check: bool,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    /// Print again whenever something has changed, until the campaign is finished
    #[arg(long)]
    pub(crate) watch: bool,
}

#[derive(Debug, Args)]
pub(crate) struct View {
    /// The store, which is only read
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    /// The address of the page; loopback only [default: 127.0.0.1 at a free port]
    #[arg(long, value_name = "ADDR")]
    pub(crate) http: Option<SocketAddr>,
}

#[derive(Debug, Args)]
pub(crate) struct Explain {
    #[command(flatten)]
    pub(crate) connect: ConnectArguments,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Drain {
    #[command(flatten)]
    pub(crate) connect: ConnectArguments,
    /// Lease jobs again after an earlier `drain`
    #[arg(long)]
    pub(crate) resume: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Retry {
    #[command(flatten)]
    pub(crate) connect: ConnectArguments,
}

#[derive(Debug, Args)]
pub(crate) struct Discard {
    /// The store, which no coordinator may have open
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    #[command(flatten)]
    pub(crate) what: DiscardTarget,
    /// Remove them; without it they are only counted
    #[arg(long)]
    pub(crate) yes: bool,
    /// Accept a store on a network file system, whose locks and syncs may be unreliable
    #[arg(long)]
    pub(crate) allow_network_store: bool,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// The results that `discard` removes.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub(crate) struct DiscardTarget {
    /// Samples, criteria and recorded failures of the design with this number
    #[arg(long, value_name = "N")]
    pub(crate) design: Option<u32>,
    /// Everything that came from this worker, or from all workers of this host
    #[arg(long, value_name = "ID-or-HOST")]
    pub(crate) worker: Option<String>,
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
    #[command(flatten)]
    pub(crate) what: ExportTarget,
    /// The form of the table; the model is always JSON
    #[arg(long, value_enum, default_value_t, conflicts_with = "pair")]
    pub(crate) format: Format,
    /// The table's file, or - for standard output; one that exists is refused
    #[arg(
        long,
        value_name = "FILE|-",
        required_unless_present = "pair",
        conflicts_with = "pair"
    )]
    pub(crate) out: Option<PathBuf>,
    /// The approach whose optimum --pair writes [default: the recommended one]
    #[arg(long, value_name = "APPROACH", value_parser = approach_of_name, requires = "pair", conflicts_with = "table")]
    pub(crate) approach: Option<Approach>,
    /// Write the design that violates the constraints least, where the approach found no feasible one
    #[arg(
        long,
        requires = "pair",
        requires = "approach",
        conflicts_with = "table"
    )]
    pub(crate) infeasible: bool,
}

/// The object to export.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub(crate) struct ExportTarget {
    /// The table to export
    #[arg(long, value_enum)]
    pub(crate) table: Option<Table>,
    /// Write an optimum as a pair file for `simulate`; one that exists is refused
    #[arg(long, value_name = "OUT.toml")]
    pub(crate) pair: Option<PathBuf>,
}

fn approach_of_name(name: &str) -> Result<Approach, String> {
    Approach::named(name).ok_or_else(|| {
        let known = Approach::ALL.map(Approach::name).join(", ");
        format!("the approaches are: {known}")
    })
}

#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// The store
    #[arg(long, value_name = "FILE")]
    pub(crate) db: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct UmBridge {
    /// The campaign file with the gears and their wear [default: the paper's]
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: Option<PathBuf>,
    /// The address of the server; loopback only [default: 127.0.0.1:4242]
    #[arg(long, value_name = "ADDR")]
    pub(crate) http: Option<SocketAddr>,
}

#[derive(Debug, Args)]
pub(crate) struct Import {
    /// The REXS file, with one cylindrical stage of two external gears
    #[arg(value_name = "PAIR.rexs")]
    pub(crate) file: PathBuf,
    /// Torque on the pinion in N·m [default: that of the first load case]
    #[arg(long, value_name = "NM")]
    pub(crate) torque: Option<f64>,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// The pair file
    #[arg(long, value_name = "PAIR.toml")]
    pub(crate) pair: PathBuf,
    /// The wear of the tooth flanks
    #[arg(long, value_enum, default_value_t = WearChoice::None)]
    pub(crate) wear: WearChoice,
    /// The seed of random wear; only with --wear random [default: 1]
    #[arg(long, value_name = "S")]
    pub(crate) seed: Option<u64>,
    /// Number of samples of random wear, at least 4; only with --wear random [default: 30]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(4..=10_000_000))]
    pub(crate) samples: Option<u32>,
    /// Write an HTML page with charts (SVG) and their points (CSV), the data sheet, and files for other programs (DXF,
    /// REXS) into this folder, new or empty
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Check {
    /// The campaign file
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) simulator: SimulatorArguments,
}

#[derive(Debug, Args)]
pub(crate) struct Init {
    /// The file to write; one that exists is refused
    #[arg(value_name = "FILE.toml")]
    pub(crate) file: PathBuf,
    /// Write a problem without gears, and a program in Python that simulates it
    #[arg(long)]
    pub(crate) external: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    pub(crate) shell: Shell,
}

#[derive(Debug, Args)]
pub(crate) struct Share {
    /// The folder
    #[arg(value_name = "DIR")]
    pub(crate) out: PathBuf,
}
