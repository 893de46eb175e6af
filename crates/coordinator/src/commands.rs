//! The commands: read files, call the library, print, choose an exit code.

use std::ffi::OsStr;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use problem::Campaign;
use problem::accuracy::CampaignFile;
use problem::formulation::Problem;
use results::describing::describe;
use results::new_file::NewFile;
use results::optima::Optima;
use results::table::VersionedObject;
use results::{comparison, pair_file, report, snapshot, status};
use runner::coordinator::local::LocalWorkers;
use runner::coordinator::server::{self, Outcome, Plan};
use runner::coordinator::serving::Port;
use runner::exit::{self, HasExitCode, ProgramError};
use runner::gateway::access;
use stages::designs;
use store::Store;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::arguments::{self, Command};
use crate::progress::Progress;

mod checking;
mod cluster;
mod discarding;
mod modelling;
mod output;
mod output_folder;
mod sharding;
mod share;
mod simulating;
mod stability;
mod steering;
mod studies;
mod tradeoff;
mod um_bridge;
mod viewing;

use self::output::{FileAccess, print, print_either, print_text};
use self::output_folder::OutputFolder;

/// Arguments that contradict each other or the campaign.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Usage(String);

impl HasExitCode for Usage {
    fn exit_code(&self) -> u8 {
        exit::USAGE
    }
}

/// Executes the command and returns the exit code.
pub(crate) async fn execute(command: Command) -> Result<u8, ProgramError> {
    match command {
        Command::Run(arguments) => run(arguments).await,
        Command::Serve(arguments) => serve(arguments).await,
        Command::Plan(arguments) => sharding::plan(arguments).await,
        Command::Merge(arguments) => sharding::merge(arguments).await,
        Command::Status(arguments) => steering::status(arguments).await,
        Command::View(arguments) => viewing::view(arguments).await,
        Command::Explain(arguments) => steering::explain(&arguments).await,
        Command::Drain(arguments) => steering::drain(&arguments).await,
        Command::Retry(arguments) => steering::retry(&arguments).await,
        Command::Discard(arguments) => discarding::discard(arguments).await,
        Command::Sweep(arguments) => studies::sweep(arguments).await,
        Command::Sizing(arguments) => studies::sizing(arguments).await,
        Command::Sensitivity(arguments) => studies::sensitivity(arguments).await,
        Command::Pareto(arguments) => studies::pareto(arguments).await,
        Command::Tradeoff(arguments) => tradeoff::tradeoff(arguments).await,
        Command::SimulateCluster(arguments) => cluster::simulate_cluster(&arguments),
        Command::SleepProgram(arguments) => tradeoff::sleep_program(arguments.seconds),
        Command::Report(arguments) => write_report(arguments).await,
        Command::Export(arguments) => export(arguments).await,
        Command::Compare(arguments) => compare(arguments).await,
        Command::Fit(arguments) => modelling::fit(&arguments).await,
        Command::Predict(arguments) => modelling::predict(&arguments).await,
        Command::Simulate(arguments) => simulating::simulate(&arguments),
        Command::Import(arguments) => simulating::import(&arguments),
        Command::UmBridge(arguments) => um_bridge::um_bridge(arguments).await,
        Command::Stability(arguments) => stability::stability(&arguments),
        Command::Check(arguments) => checking::check(&arguments),
        Command::Init(arguments) => init(&arguments),
        Command::Completions(arguments) => share::completions(arguments.shell),
        Command::Share(arguments) => share::share(&arguments.out),
    }
}

fn read(path: &Path) -> Result<String, FileAccess> {
    read_by(path, |path| fs::read_to_string(path))
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, FileAccess> {
    read_by(path, |path| fs::read(path))
}

fn read_by<T>(path: &Path, by: impl FnOnce(&Path) -> std::io::Result<T>) -> Result<T, FileAccess> {
    by(path).map_err(|source| FileAccess::new("read", path, source))
}

/// Reads a campaign file, or takes the paper's.
fn campaign_or_paper(file: Option<&Path>) -> Result<CampaignFile, ProgramError> {
    match file {
        Some(path) => campaign_file(path),
        None => Ok(CampaignFile::parse(
            "the built-in campaign",
            Campaign::PAPER,
        )?),
    }
}

/// Reads a campaign file, with the table of designs that it names.
fn campaign_file(path: &Path) -> Result<CampaignFile, ProgramError> {
    let file = CampaignFile::parse(&path.display().to_string(), &read(path)?)?;
    let Some(table) = &file.campaign.doe.table else {
        return Ok(file);
    };
    let table = folder_of(Some(path)).join(table);
    let text = read(&table)?;
    Ok(file.with_designs(&table.display().to_string(), &text)?)
}

/// The number of workers to start in this process: as given, or as many as there are processors for one call of the
/// simulator each.
fn workers_or_default(given: Option<u16>, campaign: &Campaign) -> u16 {
    given.unwrap_or_else(|| {
        let count = u32::from(processors()) / campaign.simulator.processors();
        u16::try_from(count.max(1)).unwrap_or(u16::MAX)
    })
}

async fn run(arguments: arguments::Run) -> Result<u8, ProgramError> {
    let file = arguments.campaign.as_deref();
    let CampaignFile { campaign, text, .. } = campaign_or_paper(file)?;
    let db = arguments
        .db
        .unwrap_or_else(|| PathBuf::from(format!("{}.db", campaign.name)));
    refuse_network_store(&db, arguments.allow_network_store)?;
    let count = workers_or_default(arguments.workers, &campaign);
    let workers = local_workers(&campaign, file, &arguments.how.simulator, count)?;
    let shutdown = CancellationToken::new();
    if arguments.until_input_ends {
        runner::console::watch_input(shutdown.clone(), "stopping: standard input ended");
    }
    conduct(plan(campaign, text, db, workers, arguments.how)?, shutdown).await
}

/// The plan of a campaign without a port.
fn plan(
    campaign: Campaign,
    file_text: String,
    db: PathBuf,
    workers: LocalWorkers,
    how: arguments::RunArguments,
) -> Result<Plan, Usage> {
    viewing::refuse_open(how.http)?;
    Ok(Plan {
        out: out_folder(how.out, &campaign),
        check_out,
        campaign,
        file_text,
        db,
        workers,
        port: None,
        keep_serving: false,
        retry_failed: how.retry_failed,
        lease: server::LEASE,
        http: how.http,
    })
}

fn processors() -> u16 {
    let processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    u16::try_from(processors).unwrap_or(u16::MAX)
}

/// The folder of the campaign file.
fn folder_of(file: Option<&Path>) -> &Path {
    let folder = file.and_then(Path::parent);
    // The parent of a plain name is empty.
    let folder = folder.filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

/// The settings of `count` workers of this process, with the simulator of the arguments or of the campaign `file`.
fn local_workers(
    campaign: &Campaign,
    file: Option<&Path>,
    simulator: &runner::worker::SimulatorArguments,
    count: u16,
) -> Result<LocalWorkers, Usage> {
    let exec = simulator.exec_or(&campaign.simulator, folder_of(file));
    match (campaign.is_external(), &exec) {
        (true, None) if count > 0 => {
            return Err(Usage(format!(
                "campaign {} is simulated by an external program: name it in the file, with [simulator] command, \
                 or give --exec 'CMD'",
                campaign.name
            )));
        }
        (false, Some(_)) => {
            return Err(Usage(format!(
                "campaign {} is simulated by the built-in model: leave out --exec, or give the \
                 campaign a section [simulator] with kind = \"external\"",
                campaign.name
            )));
        }
        _ => {}
    }
    Ok(LocalWorkers {
        count: usize::from(count),
        exec,
    })
}

async fn serve(arguments: arguments::Serve) -> Result<u8, ProgramError> {
    let file = Some(&*arguments.campaign);
    let CampaignFile { campaign, text, .. } = campaign_or_paper(file)?;
    let port = port(arguments.port, &campaign.name)?;
    refuse_network_store(&arguments.db, arguments.allow_network_store)?;
    let simulator = &arguments.how.simulator;
    let workers = local_workers(&campaign, file, simulator, arguments.workers)?;
    let plan = Plan {
        port: Some(port),
        keep_serving: arguments.keep_serving,
        lease: Duration::from_secs(arguments.lease),
        ..plan(campaign, text, arguments.db, workers, arguments.how)?
    };
    conduct(plan, CancellationToken::new()).await
}

/// The port of the campaign `name`.
fn port(arguments: arguments::PortArguments, name: &str) -> Result<Port, runner::gateway::Error> {
    Ok(Port {
        listen: arguments.listen,
        access: match arguments.access {
            Some(file) => file,
            None => access::default_file(name)?,
        },
        hosts: arguments.hosts,
    })
}

/// Refuses a store on a network file system unless allowed: locks and syncs of its file may be
/// unreliable there.
fn refuse_network_store(db: &Path, allowed: bool) -> Result<(), Usage> {
    let folder = match db.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    // Without a mount table or a folder, opening the store reports the error.
    let (Ok(mounts), Ok(folder)) = (
        fs::read_to_string("/proc/self/mountinfo"),
        fs::canonicalize(folder),
    ) else {
        return Ok(());
    };
    match store::network_file_system(&folder, &mounts) {
        Some(kind) if !allowed => Err(Usage(format!(
            "{} lies on a network file system ({kind}), whose locks and syncs may be unreliable: \
             put the store on a local disk, or accept the risk with --allow-network-store",
            db.display()
        ))),
        _ => Ok(()),
    }
}

fn out_folder(out: Option<PathBuf>, campaign: &Campaign) -> PathBuf {
    out.unwrap_or_else(|| PathBuf::from(format!("{}-report", campaign.name)))
}

/// Refuses the report folder if it holds the report of a campaign other than this one and the one in the store.
async fn require_own_report(
    out: &Path,
    campaign: &Campaign,
    db: &Path,
) -> Result<(), ProgramError> {
    let mut lineages = vec![campaign.lineage()];
    // The report beside a store of another campaign is accepted here: opening that store is refused
    // with the better message.
    if let Ok(store) = Store::open_read_only(db).await {
        let row = store.campaign().await?;
        let stored = Campaign::stored(&row.file_text);
        lineages.extend(stored.map(|stored| stored.lineage()));
        store.close().await?;
    }
    Ok(OutputFolder(out).require_own_report(&lineages)?)
}

/// All results are stored, but another campaign has written its report into the folder in the meantime.
#[derive(Debug, thiserror::Error)]
#[error(
    "all results are in {}, but the report is not written: start the same command again with another \
     --out",
    db.display()
)]
struct ReportPlaceTaken {
    db: PathBuf,
    source: FileAccess,
}

impl HasExitCode for ReportPlaceTaken {
    fn exit_code(&self) -> u8 {
        self.source.exit_code()
    }
}

/// Refuses the report folder if another campaign has written its report there since this one began.
fn check_out(plan: &Plan) -> Result<(), ProgramError> {
    let own = OutputFolder(&plan.out).require_own_report(&[plan.campaign.lineage()]);
    Ok(own.map_err(|source| ReportPlaceTaken {
        db: plan.db.clone(),
        source,
    })?)
}

async fn conduct(plan: Plan, shutdown: CancellationToken) -> Result<u8, ProgramError> {
    tokio::spawn(runner::console::watch_signals(shutdown.clone(), "stopping"));
    let db = plan.db.clone();
    require_own_report(&plan.out, &plan.campaign, &db).await?;
    let problem = Problem::new(plan.campaign.clone());
    let progress = Progress::new();
    let observer: server::Observer = Box::new(move |status| progress.show(status));
    match server::run(plan, Some(observer), shutdown).await? {
        Outcome::Finished {
            quarantined,
            report,
        } => {
            let store = Store::open_read_only(&db).await?;
            let status = status::read(&store).await?;
            let evenness = designs::evenness(&problem, &store.designs().await?);
            let doe = evenness.map_or_else(String::new, |text| format!("doe             {text}\n"));
            print_text(&format!(
                "{}{doe}report          {}\n",
                describe(&status),
                report.display()
            ))?;
            if quarantined.is_empty() {
                return code_of_finished(&problem, &store).await;
            }
            warn!(streams = %quarantined.join(", "), "finished, but some samples were quarantined");
            Ok(exit::INCOMPLETE)
        }
        Outcome::Interrupted => {
            info!("stopped; start the same command again to continue");
            Ok(exit::INTERRUPTED)
        }
    }
}

/// The exit code for the end of a campaign from which nothing is missing.
async fn code_of_finished(problem: &Problem, store: &Store) -> Result<u8, ProgramError> {
    let designs = store.progress().await?;
    let optima = Optima::read(store, problem).await?;
    Ok(if designs.simulable == designs.ruled_out {
        warn!("finished, but no design got samples; the report says why");
        exit::NOT_SIMULABLE
    } else if optima.iter().all(|one| one.cost(problem).is_none()) {
        warn!(
            "finished, but no approach found a design that keeps every limit; the report says why"
        );
        exit::NONE_FEASIBLE
    } else {
        exit::OK
    })
}

async fn write_report(arguments: arguments::Report) -> Result<u8, ProgramError> {
    let store = Store::open_read_only(&arguments.db).await?;
    let problem = snapshot::problem(&store).await?;
    OutputFolder(&arguments.out).require_own_report(&[problem.campaign().lineage()])?;
    let labels = runner::coordinator::provenance::labels();
    let report = report::write(&store, &arguments.out, &labels).await?;
    print(&format!("{}\n", report.display()))?;
    Ok(exit::OK)
}

async fn export(arguments: arguments::Export) -> Result<u8, ProgramError> {
    let store = Store::open_read_only(&arguments.db).await?;
    let what = &arguments.what;
    if let (Some(table), Some(out)) = (what.table, &arguments.out) {
        output::write_table(out, &store, table, arguments.format).await?;
    }
    if let Some(out) = &what.pair {
        let approach = match arguments.approach {
            Some(approach) => approach,
            None => pair_file::recommended(&store).await?,
        };
        let text = if arguments.infeasible {
            let (text, broken) = pair_file::of_least_violation(&store, approach).await?;
            warn!("infeasible: the design breaks {broken}");
            text
        } else {
            pair_file::of_optimum(&store, approach).await?.to_toml()
        };
        output::write(out, text.as_bytes())?;
    }
    Ok(exit::OK)
}

async fn compare(arguments: arguments::Compare) -> Result<u8, ProgramError> {
    let store = Store::open_read_only(&arguments.db).await?;
    let compared = comparison::compare(&store).await?;
    print_either(
        arguments.json,
        &VersionedObject::new(compared.summary()),
        || compared.page(),
    )?;
    Ok(exit::OK)
}

fn init(arguments: &arguments::Init) -> Result<u8, ProgramError> {
    let stem = arguments.file.file_stem().and_then(OsStr::to_str);
    let stem = stem.unwrap_or_default();
    if arguments.external {
        let (name, [campaign, program]) = Campaign::external_named(stem);
        let path = arguments.file.with_file_name(format!("{name}.py"));
        let mut file = NewFile::create(&arguments.file)?;
        file.write_all(campaign.as_bytes())?;
        output::write_new(&path, program.as_bytes())?;
        file.keep()?;
        print(&format!(
            "{} states a problem of your own, and {} is its program: edit both, then check and run the campaign\n",
            arguments.file.display(),
            path.display()
        ))?;
        return Ok(exit::OK);
    }
    output::write_new(&arguments.file, Campaign::pair_named(stem).as_bytes())?;
    print(&format!(
        "{} optimises the profile shifts of a helical gear pair cut with standard hobs: edit it, then check it\n",
        arguments.file.display()
    ))?;
    Ok(exit::OK)
}
