//! The commands: read files, call the library, print, choose an exit code.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context as _;
use campaign::formulation::{Problem, ROBUST_VARIABLES};
use campaign::plan;
use campaign::task::{self, SampleRange, SampleRequest, Task};
use campaign::{Approach, Campaign, FileError, PairFile};
use coordinator::server::{self, Outcome, Plan, Workers};
use coordinator::{comparing, export, references, reporting, simulate, status};
use protocol::exit;
use rand::RngExt as _;
use stats::streams::{Purpose, stream};
use store::Store;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::arguments::{self, Command};

/// A file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {doing} {}", path.display())]
struct FileAccess {
    doing: &'static str,
    path: PathBuf,
    source: std::io::Error,
}

/// A command line that makes no sense although it parses.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Usage(String);

/// Does what the command line says; returns the exit code.
pub(crate) async fn execute(command: Command) -> anyhow::Result<u8> {
    match command {
        Command::Run(arguments) => run(arguments).await,
        Command::Serve(arguments) => serve(arguments).await,
        Command::Status(arguments) => print_status(arguments).await,
        Command::Report(arguments) => write_report(arguments).await,
        Command::Export(arguments) => export_table(arguments).await,
        Command::Compare(arguments) => compare(arguments).await,
        Command::Simulate(arguments) => simulate_pair(&arguments),
        Command::Check(arguments) => check(&arguments),
        Command::Init(arguments) => init(&arguments),
    }
}

/// The exit code that an error means.
pub(crate) fn exit_code(error: &anyhow::Error) -> u8 {
    for cause in error.chain() {
        if cause.is::<FileError>() {
            return exit::BAD_FILE;
        }
        if cause.is::<FileAccess>() {
            return exit::FILE_ACCESS;
        }
        if cause.is::<Usage>() {
            return exit::USAGE;
        }
        if let Some(store) = cause.downcast_ref::<store::Error>() {
            return store_exit_code(store);
        }
        match cause.downcast_ref::<server::Error>() {
            Some(server::Error::Store(store)) => return store_exit_code(store),
            Some(server::Error::Listen { .. }) => return exit::CANNOT_LISTEN,
            Some(server::Error::Other(error)) => return exit_code(error),
            None => {}
        }
    }
    exit::FAILURE
}

const fn store_exit_code(error: &store::Error) -> u8 {
    use store::Error as E;
    match error {
        E::NoStore { .. } => exit::NO_STORE,
        E::OtherCampaign { .. } | E::ModelDigestConflict { .. } => exit::OTHER_CAMPAIGN,
        E::NotADatabase { .. } | E::NotAStore { .. } => exit::NOT_A_STORE,
        E::Damaged { .. } | E::NewerSchema { .. } | E::OlderSchema { .. } => exit::UNUSABLE_STORE,
        E::Locked { .. } => exit::STORE_LOCKED,
        E::Io { .. } | E::DiskFull { .. } => exit::FILE_ACCESS,
        _ => exit::FAILURE,
    }
}

fn read(path: &Path) -> Result<String, FileAccess> {
    fs::read_to_string(path).map_err(|source| FileAccess {
        doing: "read",
        path: path.to_owned(),
        source,
    })
}

fn create_new(path: &Path) -> Result<File, FileAccess> {
    OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(path)
        .map_err(|source| FileAccess {
            doing: "write a new file",
            path: path.to_owned(),
            source,
        })
}

/// Prints to standard output; a reader that has gone away is no error.
fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

async fn run(arguments: arguments::Run) -> anyhow::Result<u8> {
    let (name, text) = match &arguments.campaign {
        Some(path) => (path.display().to_string(), read(path)?),
        None => (
            "the built-in campaign".to_owned(),
            Campaign::PAPER.to_owned(),
        ),
    };
    let campaign = Campaign::parse(&name, &text)?;
    let processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let db = arguments
        .db
        .unwrap_or_else(|| PathBuf::from(format!("{}.db", campaign.name)));
    refuse_network_store(&db, arguments.allow_network_store)?;
    let plan = Plan {
        out: out_folder(arguments.out, &campaign),
        campaign,
        file_text: text,
        db,
        listen: SocketAddr::from(([127, 0, 0, 1], 0)),
        workers: Workers::Local(arguments.workers.map_or(processors, usize::from)),
    };
    conduct(plan).await
}

async fn serve(arguments: arguments::Serve) -> anyhow::Result<u8> {
    let text = read(&arguments.campaign)?;
    let campaign = Campaign::parse(&arguments.campaign.display().to_string(), &text)?;
    if !arguments.listen.ip().is_loopback() && !arguments.insecure {
        return Err(Usage(format!(
            "--listen {} is reachable by others, and the connection is neither encrypted nor \
             guarded: listen on 127.0.0.1 (through a tunnel, if workers are elsewhere), or accept \
             the risk with --insecure",
            arguments.listen
        ))
        .into());
    }
    refuse_network_store(&arguments.db, arguments.allow_network_store)?;
    let plan = Plan {
        out: out_folder(arguments.out, &campaign),
        campaign,
        file_text: text,
        db: arguments.db,
        listen: arguments.listen,
        workers: Workers::Remote {
            keep_serving: arguments.keep_serving,
        },
    };
    conduct(plan).await
}

/// A store must be able to lock its file and to sync it, which network file systems promise rather
/// than do.
fn refuse_network_store(db: &Path, allowed: bool) -> anyhow::Result<()> {
    let folder = match db.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    // Where there is no such list, or no such folder, opening the store says what is wrong.
    let (Ok(mounts), Ok(folder)) = (
        fs::read_to_string("/proc/self/mountinfo"),
        fs::canonicalize(folder),
    ) else {
        return Ok(());
    };
    match store::network_file_system(&folder, &mounts) {
        Some(kind) if !allowed => Err(Usage(format!(
            "{} lies on a network file system ({kind}), whose locks and syncs may not keep their \
             word: put the store on a local disk, or accept the risk with --allow-network-store",
            db.display()
        ))
        .into()),
        _ => Ok(()),
    }
}

fn out_folder(out: Option<PathBuf>, campaign: &Campaign) -> PathBuf {
    out.unwrap_or_else(|| PathBuf::from(format!("{}-report", campaign.name)))
}

async fn conduct(plan: Plan) -> anyhow::Result<u8> {
    let shutdown = CancellationToken::new();
    tokio::spawn(worker::console::watch_signals(shutdown.clone(), "stopping"));
    let db = plan.db.clone();
    match server::run(plan, shutdown).await? {
        Outcome::Finished { given_up, report } => {
            let store = Store::open_read_only(&db).await?;
            let status = status::read(&store).await?;
            print(&format!(
                "{}report          {}\n",
                status::describe(&status),
                report.display()
            ))?;
            if given_up.is_empty() {
                Ok(exit::OK)
            } else {
                warn!(jobs = %given_up.join(", "), "finished, but some jobs were given up");
                Ok(exit::INCOMPLETE)
            }
        }
        Outcome::Interrupted => {
            info!("stopped; start the same command again to continue");
            Ok(exit::INTERRUPTED)
        }
    }
}

async fn print_status(arguments: arguments::Status) -> anyhow::Result<u8> {
    let store = Store::open_read_only(&arguments.db).await?;
    let status = status::read(&store).await?;
    if arguments.json {
        print(&(serde_json::to_string(&status)? + "\n"))?;
    } else {
        print(&status::describe(&status))?;
    }
    Ok(exit::OK)
}

async fn write_report(arguments: arguments::Report) -> anyhow::Result<u8> {
    let store = Store::open_read_only(&arguments.db).await?;
    let report = reporting::write(&store, &arguments.out).await?;
    print(&format!("{}\n", report.display()))?;
    Ok(exit::OK)
}

async fn export_table(arguments: arguments::Export) -> anyhow::Result<u8> {
    let store = Store::open_read_only(&arguments.db).await?;
    let file = create_new(&arguments.out)?;
    export::write(&store, arguments.table, std::io::BufWriter::new(file)).await?;
    Ok(exit::OK)
}

async fn compare(arguments: arguments::Compare) -> anyhow::Result<u8> {
    let store = Store::open_read_only(&arguments.db).await?;
    print(&comparing::page(&store).await?)?;
    Ok(exit::OK)
}

fn simulate_pair(arguments: &arguments::Simulate) -> anyhow::Result<u8> {
    let text = read(&arguments.pair)?;
    let file = PairFile::parse(&arguments.pair.display().to_string(), &text)?;
    let request = simulate::Request {
        wear: arguments.wear,
        seed: arguments.seed,
        samples: arguments.samples,
    };
    let simulation = simulate::run(&file, request)?;
    if arguments.json {
        print(&(simulate::to_json(&simulation)? + "\n"))?;
    } else {
        print(&simulate::describe(&simulation))?;
    }
    Ok(exit::OK)
}

fn init(arguments: &arguments::Init) -> anyhow::Result<u8> {
    let mut file = create_new(&arguments.file)?;
    file.write_all(Campaign::PAPER.as_bytes())
        .map_err(|source| FileAccess {
            doing: "write",
            path: arguments.file.clone(),
            source,
        })?;
    print(&format!(
        "{} holds the paper's campaign: edit it, then check it\n",
        arguments.file.display()
    ))?;
    Ok(exit::OK)
}

fn check(arguments: &arguments::Check) -> anyhow::Result<u8> {
    let text = read(&arguments.campaign)?;
    let campaign = Campaign::parse(&arguments.campaign.display().to_string(), &text)?;
    let problem = Problem::new(campaign.clone());
    let n = u64::from(campaign.doe.designs);
    let k = u64::from(campaign.sampling.samples_per_design);
    let per_job = u64::from(plan::designs_per_job(&campaign));
    let starts = u64::from(campaign.optimise.starts);
    let evaluations = u64::from(campaign.optimise.evaluations);
    let points = references::points(&problem).len() as u64 + Approach::ALL.len() as u64;
    let verify = u64::from(campaign.verify.samples);
    let measured = measure(&problem)?;

    let feasible = n as f64 * measured.feasible;
    let sampling =
        n as f64 * measured.design_seconds + feasible * k as f64 * measured.sample_seconds;
    let analyses = (3 * starts * evaluations) as f64;
    let optimising = analyses * measured.design_seconds;
    let verifying = (points * verify) as f64 * measured.sample_seconds;
    // Measured with the paper's campaign: 6 s of search for its DoE, and 10 s of a fit whose time is
    // cubic in the points.
    let making = 6.0 * n as f64 / 3000.0;
    let fitting = 10.0 * (feasible / 3000.0).powi(3);
    let mut plan = format!(
        "{} is valid: campaign {}, seed {}, {} and {} teeth\n\n",
        arguments.campaign.display(),
        campaign.name,
        campaign.seed,
        campaign.teeth()[0],
        campaign.teeth()[1]
    );
    let rows = [
        ("doe", 1, format!("{n} points, maximin"), making),
        (
            "sample",
            n.div_ceil(per_job),
            format!("{n} designs, at most {} samples", n * k),
            sampling,
        ),
        (
            "fit",
            1,
            format!("about {feasible:.0} designs that can be simulated"),
            fitting,
        ),
        (
            "optimise",
            3 * starts,
            format!("{} analyses", 3 * starts * evaluations),
            optimising,
        ),
        (
            "verify",
            points * verify.div_ceil(u64::from(plan::VERIFY_SAMPLES_PER_JOB)),
            format!("{points} designs, {} samples", points * verify),
            verifying,
        ),
    ];
    for (stage, jobs, what, seconds) in &rows {
        plan += &format!("{stage:<10}{jobs:>6} jobs   {what:<50}{seconds:>8.1} core-seconds\n");
    }
    let total: f64 = rows.iter().map(|row| row.3).sum();
    let jobs: u64 = rows.iter().map(|row| row.1).sum();
    plan += &format!(
        "{:<10}{jobs:>6} jobs   {:<50}{total:>8.1} core-seconds (estimated)\n",
        "all", ""
    );
    for warning in campaign.warnings() {
        plan += &format!("\nwarning: {warning}\n");
    }
    print(&plan)?;
    Ok(exit::OK)
}

/// What one processor of this machine takes, from a few designs of the campaign.
struct Measured {
    /// The share of random designs that can be simulated.
    feasible: f64,
    /// Criteria and both deterministic analyses of a design, seconds.
    design_seconds: f64,
    /// A sample of ΔSTE, seconds.
    sample_seconds: f64,
}

fn measure(problem: &Problem) -> anyhow::Result<Measured> {
    const DESIGNS: u32 = 40;
    let mut seconds = [0.0; 2];
    let mut feasible = 0.0;
    let samples = [4, 104];
    for (pass, count) in samples.into_iter().enumerate() {
        let designs: Vec<SampleRequest> = (0..DESIGNS)
            .map(|design| {
                let mut rng = stream(problem.campaign().seed, Purpose::Test, u64::from(design), 1);
                let unit: [f64; ROBUST_VARIABLES] = std::array::from_fn(|_| rng.random());
                SampleRequest {
                    design,
                    x: problem.robust_point(&unit),
                    samples: SampleRange { first: 0, count },
                }
            })
            .collect();
        let task = Task::Sample {
            frozen: problem.printed_frozen(),
            designs,
        };
        let before = Instant::now();
        let result = task::execute(problem, &task)
            .map_err(anyhow::Error::msg)
            .context("a trial run")?;
        seconds[pass] = before.elapsed().as_secs_f64();
        if let campaign::task::TaskResult::Sample { designs } = result {
            let simulated = |design: &&campaign::task::DesignResult| {
                matches!(
                    design.outcome,
                    campaign::task::DesignOutcome::Simulated { .. }
                )
            };
            feasible = designs.iter().filter(simulated).count() as f64;
        }
    }
    let drawn = feasible.max(1.0) * f64::from(samples[1] - samples[0]);
    let sample_seconds = ((seconds[1] - seconds[0]) / drawn).max(0.0);
    let without_samples = seconds[0] - feasible * f64::from(samples[0]) * sample_seconds;
    Ok(Measured {
        feasible: feasible / f64::from(DESIGNS),
        design_seconds: (without_samples / f64::from(DESIGNS)).max(0.0),
        sample_seconds,
    })
}
