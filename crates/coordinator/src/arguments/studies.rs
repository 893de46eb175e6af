//! The arguments of the studies.

use std::path::PathBuf;

use clap::Args;
use problem::Approach;
use runner::worker::SimulatorArguments;
use studies::pareto::Objective;
use studies::sensitivity::Tolerances;
use studies::sizing::Range;
use studies::sweep::Teeth;

use super::approach_of_name;

#[derive(Debug, Args)]
pub(crate) struct Sweep {
    /// The campaign file
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: PathBuf,
    /// Numbers of teeth of the pinion: 17..30 is 17 to 29, 17..=30 is 17 to 30
    ///
    /// The mate's number follows from pair.gear_ratio, or stays pair.gear_teeth; the module
    /// follows from pair.centre_distance_mm, or the other way round. With frozen.from = "printed"
    /// all numbers share the radii and the helix angle of the file; with "deterministic" each
    /// has its own.
    #[arg(long, value_name = "RANGE")]
    pub(crate) teeth: Teeth,
    /// The folder of the stores, reports and tables; a sweep that it holds is continued
    /// [default: NAME-sweep]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Accept stores on a network file system, whose locks and syncs may be unreliable
    #[arg(long)]
    pub(crate) allow_network_store: bool,
    /// Number of workers to start in this process [default: the processors divided by
    /// simulator.processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) workers: Option<u16>,
    #[command(flatten)]
    pub(crate) simulator: SimulatorArguments,
    /// Print the tables as one JSON object instead of the page
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Sizing {
    /// The campaign file, whose gear ratio, bounds and limits hold for all sizes
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: PathBuf,
    #[command(flatten)]
    pub(crate) range: Range,
    /// Number of sizes that get verification samples and a pair file
    #[arg(long, value_name = "N", default_value_t = 5,
        value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) top: u16,
    /// The folder of the tables and pair files; one that is not empty is refused [default: NAME-sizing]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print the tables as one JSON object instead of the page
    #[arg(long)]
    pub(crate) json: bool,
}

/// A campaign and its finished store.
#[derive(Debug, Args)]
pub(crate) struct FinishedCampaign {
    /// The campaign file
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: PathBuf,
    /// The finished store of the campaign [default: NAME.db]
    #[arg(long, value_name = "FILE")]
    pub(crate) db: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct Sensitivity {
    #[command(flatten)]
    pub(crate) finished: FinishedCampaign,
    /// The approach whose optimum is analysed [default: the one with the least verified percentile]
    #[arg(long, value_name = "NAME", value_parser = approach_of_name)]
    pub(crate) approach: Option<Approach>,
    #[command(flatten)]
    pub(crate) tolerances: Tolerances,
    /// Rows of each analysis, preferably a power of two; a row simulates two pairs more than there
    /// are inputs
    #[arg(long, value_name = "N", default_value_t = 1024,
        value_parser = clap::value_parser!(u32).range(8..=stats::SENSITIVITY_ROWS as i64))]
    pub(crate) rows: u32,
    /// The folder of the tables; one that is not empty is refused [default: NAME-sensitivity]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print the tables as one JSON object instead of the page
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Pareto {
    #[command(flatten)]
    pub(crate) finished: FinishedCampaign,
    /// The second objective, against the percentile
    #[arg(long, value_enum, default_value_t = Objective::Pressure)]
    pub(crate) against: Objective,
    /// Number of direct searches, each of optimise.evaluations designs, to add to the front
    #[arg(long, value_name = "N", default_value_t = 0,
        value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub(crate) refine: u32,
    /// The folder of the table and the chart; one that is not empty is refused
    /// [default: NAME-pareto]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print the tables as one JSON object instead of the page
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Stability {
    /// The folder of the page and its tables; one that is not empty is refused
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Print one JSON object instead of a line for each entry
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Tradeoff {
    /// The campaign file [default: the campaign of the paper]
    #[arg(value_name = "CAMPAIGN.toml")]
    pub(crate) campaign: Option<PathBuf>,
    /// The folder of tables, charts and page; studies in it of the same campaign, size and program
    /// are not measured again [default: NAME-tradeoff]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Measure only these studies: simulator, contact, percentile, estimators, kriging,
    /// optimisation, runner, cores, growth
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = study)]
    pub(crate) study: Vec<lab::tradeoff::Kind>,
    /// Measure for one to three minutes instead of ten
    #[arg(long)]
    pub(crate) quick: bool,
    /// Number of designs to measure, for tests of the command
    #[arg(long, value_name = "N", hide = true, conflicts_with = "quick",
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) designs: Option<u32>,
    /// Print the tables as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct SimulateCluster {
    /// Numbers of workers
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "10,100,1000,10000,100000",
        value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) workers: Vec<u32>,
    /// Seconds that a sample takes
    #[arg(
        long,
        value_name = "SECONDS",
        value_delimiter = ',',
        default_value = "0.1,1,60,3600",
        value_parser = positive
    )]
    pub(crate) sample_seconds: Vec<f64>,
    /// Jobs that a worker computes at once
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) slots: u32,
    /// Simulated seconds [default: 20, or the time of five samples]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) seconds: Option<f64>,
    /// Mean hours until a worker fails [default: never]
    #[arg(long, value_name = "HOURS", value_parser = positive)]
    pub(crate) failure_hours: Option<f64>,
    /// Share of the workers that each wave of preemption takes [default: no waves]
    #[arg(long, value_name = "SHARE", value_parser = positive)]
    pub(crate) wave_share: Option<f64>,
    /// Seconds between two waves
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = positive)]
    pub(crate) wave_every: f64,
    /// Seconds until preempted workers are back
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = positive)]
    pub(crate) wave_away: f64,
    /// Seed of the simulated times and failures
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// The folder for cluster.csv and cluster.svg
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object for each scenario, as a list
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct SleepProgram {
    /// Seconds for each sample
    pub(crate) seconds: f64,
}

/// Reads a number above zero.
fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if number > 0.0 && f64::is_finite(number) => Ok(number),
        _ => Err("it must be a number above 0".to_owned()),
    }
}

/// Reads the name of a trade-off study.
fn study(text: &str) -> Result<lab::tradeoff::Kind, String> {
    let mut all = lab::tradeoff::Kind::ALL.into_iter();
    all.find(|kind| kind.name() == text).ok_or_else(|| {
        let names = lab::tradeoff::Kind::ALL
            .map(lab::tradeoff::Kind::name)
            .join(", ");
        format!("the studies are {names}")
    })
}
