//! The measurements of the trade-off studies that need programs: samples through board, workers and store, and whole
//! campaigns.

use std::io::{BufRead as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use lab::tradeoff::{ApproachResult, CampaignTimes, Load, RunnerTimes, process_seconds};
use ledger::{Generation, StreamId, Unit};
use problem::formulation::Problem;
use problem::task::{Inputs, Output, Source, compute};
use problem::{Campaign, probe};
use rand::RngExt as _;
use results::optima::Optima;
use results::snapshot::Snapshot;
use runner::coordinator::board::{self, Board};
use runner::coordinator::local::LocalWorkers;
use runner::coordinator::recorder::StoreRecorder;
use runner::coordinator::service::Service;
use runner::cpu::thread_seconds;
use runner::exit::{self, ProgramError};
use runner::gateway::port::{self, Listeners};
use runner::worker::{Exec, Interface};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde_json::{Value, json};
use stats::streams::{Purpose, stream};
use store::{CampaignRow, DesignRow, Store};
use tokio::runtime::Handle;
use tokio_util::sync::CancellationToken;

/// Number of samples of a design.
const PER_DESIGN: u32 = 30;
/// Number of designs whose samples are timed in one thread.
const TIMED: usize = 100;
/// The store of a whole campaign.
const STORE: &str = "campaign.db";
/// Interval between polls.
const POLL_PERIOD: Duration = Duration::from_millis(2);

/// The campaign of the sleeping program: one variable, one response.
const SLEEPING: &str = r#"
kind = "external"
format = 1
name = "sleep"
seed = 1
[[variables]]
name = "x"
low = 0.0
high = 1.0
[[responses]]
name = "y"
baseline = true
[doe]
designs = 10
[sampling]
samples_per_design = 30
[simulator]
probe_designs = 0
"#;

/// Runs the program of [`SLEEPING`]: answers requests until standard input ends.
pub(crate) fn sleep_program(seconds: f64) -> Result<u8, ProgramError> {
    let mut out = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let request: Value = serde_json::from_str(&line?)?;
        let mut answer = match request["request"].as_str() {
            Some("describe") => json!({"protocol": 2, "version": "sleep 1",
                "variables": ["x"], "responses": ["y"]}),
            Some("sample") => {
                std::thread::sleep(Duration::from_secs_f64(seconds));
                json!({"y": 1.0})
            }
            _ => json!({"y": 1.0}),
        };
        answer["id"] = request["id"].clone();
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(exit::OK)
}

/// Runs the programs for the studies of a campaign, with their stores in the folder `out`.
pub(super) struct Programs<'a> {
    pub(super) campaign: &'a Campaign,
    pub(super) out: &'a Path,
    pub(super) runtime: Handle,
    pub(super) shutdown: CancellationToken,
}

impl lab::tradeoff::Runner for Programs<'_> {
    fn samples(&mut self, load: &Load) -> anyhow::Result<RunnerTimes> {
        self.runtime.block_on(run(self.campaign, self.out, load))
    }

    fn campaign(&mut self, campaign: &Campaign) -> anyhow::Result<Vec<ApproachResult>> {
        let folder = tempfile::tempdir_in(self.out)?;
        whole(campaign, folder.path(), None, &self.shutdown)?;
        self.runtime.block_on(approaches(campaign, folder.path()))
    }

    fn timed(&mut self, campaign: &Campaign, processors: usize) -> anyhow::Result<CampaignTimes> {
        let folder = tempfile::tempdir_in(self.out)?;
        let began = Instant::now();
        whole(campaign, folder.path(), Some(processors), &self.shutdown)?;
        let seconds = began.elapsed().as_secs_f64();
        self.runtime.block_on(async {
            let store = Store::open_read_only(&folder.path().join(STORE)).await?;
            let snapshot = Snapshot::read(&store).await?;
            store.close().await?;
            Ok(CampaignTimes {
                seconds,
                stages: snapshot.costs,
            })
        })
    }
}

/// Starts a program on the first `processors` of this program's processors, or on all if `None`.
fn spawn_on(program: &mut Command, processors: Option<usize>) -> anyhow::Result<Child> {
    let Some(processors) = processors else {
        return Ok(program.spawn()?);
    };
    // A program begins with the processors of the thread that starts it.
    let all = sched_getaffinity(None)?;
    let mut some = CpuSet::new();
    let allowed = (0..CpuSet::MAX_CPU).filter(|cpu| all.is_set(*cpu));
    allowed.take(processors).for_each(|cpu| some.set(cpu));
    sched_setaffinity(None, &some)?;
    let started = program.spawn();
    sched_setaffinity(None, &all)?;
    Ok(started?)
}

/// Runs a campaign in a separate process, which ends with `shutdown`, with its files in `folder`.
fn whole(
    campaign: &Campaign,
    folder: &Path,
    processors: Option<usize>,
    shutdown: &CancellationToken,
) -> anyhow::Result<()> {
    let path = |name: &str| folder.join(name);
    std::fs::write(path("campaign.toml"), toml::to_string(campaign)?)?;
    let mut program = Command::new(std::env::current_exe()?);
    program
        .arg("run")
        .arg(path("campaign.toml"))
        .arg("--db")
        .arg(path(STORE))
        .arg("--out")
        .arg(path("report"))
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(path("log"))?);
    let mut program = spawn_on(&mut program, processors)?;
    let status = loop {
        if let Some(status) = program.try_wait()? {
            break status;
        }
        if shutdown.is_cancelled() {
            program.kill()?;
            program.wait()?;
            bail!("stopped");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    if !status.success() {
        let log = std::fs::read_to_string(path("log"))?;
        bail!(
            "a campaign of {} designs ended with {status}:\n{log}",
            campaign.doe.designs
        );
    }
    Ok(())
}

/// The result of each approach of the campaign that ran in `folder`.
async fn approaches(campaign: &Campaign, folder: &Path) -> anyhow::Result<Vec<ApproachResult>> {
    let store = Store::open_read_only(&folder.join(STORE)).await?;
    let mut results = Vec::new();
    let problem = Problem::new(campaign.clone());
    for verified in Optima::read(&store, &problem).await?.iter() {
        let optimum = &verified.optimum;
        let percentile = verified.measure.filter(|_| optimum.feasible().is_some());
        results.push(ApproachResult {
            approach: optimum.approach,
            calls: optimum.cost.simulator_calls as f64,
            seconds: optimum.cost.cpu_seconds,
            percentile: percentile.map_or(f64::INFINITY, |found| found.value),
        });
    }
    store.close().await?;
    Ok(results)
}

/// Runs samples of this campaign, or of the sleeping program, with a store in the folder `out`.
async fn run(own: &Campaign, out: &Path, load: &Load) -> anyhow::Result<RunnerTimes> {
    let (campaign, exec) = match load.sleep {
        None => (own.clone(), None),
        Some(seconds) => {
            let program = std::env::current_exe()?;
            let command = format!("exec '{}' sleep-program {seconds}", program.display());
            let exec = Exec {
                interface: Interface::Lines(command),
                timeout: Duration::from_secs(60),
                environment: Vec::new(),
            };
            (
                Campaign::parse("the sleeping campaign", SLEEPING)?,
                Some(exec),
            )
        }
    };
    let problem = Arc::new(Problem::new(campaign));
    // A job of the sleeping program is one sample. Designs have few samples, so that every worker gets one.
    let per_design = match load.sleep {
        None => PER_DESIGN,
        Some(_) => PER_DESIGN.min((load.samples / load.workers as u32).max(1)),
    };
    let designs = load.samples.div_ceil(per_design);
    let points = points(&problem, designs as usize)?;
    let alone_seconds = match load.sleep {
        None => alone(&problem, &points[..points.len().min(TIMED)]),
        Some(_) => 0.0,
    };
    let mut ran = through(out, &problem, &points, per_design, load.workers, exec).await?;
    // The run computed whole designs; the times are scaled to the samples asked for.
    let share = f64::from(load.samples) / f64::from(designs * per_design);
    ran.seconds *= share;
    ran.cpu_seconds *= share;
    Ok(RunnerTimes {
        alone_seconds,
        ..ran
    })
}

/// Returns `count` random designs that get samples; at most [`TIMED`] different ones, repeated.
fn points(problem: &Problem, count: usize) -> anyhow::Result<Vec<Vec<f64>>> {
    let mut rng = stream(problem.campaign().seed, Purpose::Test, 6, 0);
    let mut found: Vec<Vec<f64>> = Vec::new();
    for _ in 0..10_000 {
        if found.len() == count.min(TIMED) {
            break;
        }
        let unit: Vec<f64> = (0..problem.dimension()).map(|_| rng.random()).collect();
        let x = problem.free_point(&unit);
        let source = Source::Design(problem.design(&x, problem.base()));
        let is_sampled = || {
            let output = compute(problem, &design_unit(0, 1), &source);
            matches!(output, Ok(Output::Design { samples, .. }) if !samples.is_empty())
        };
        if problem.gears().is_none() || is_sampled() {
            found.push(x);
        }
    }
    anyhow::ensure!(!found.is_empty(), "no random design gets samples");
    Ok(found.iter().cycle().take(count).cloned().collect())
}

/// The first samples of a design.
fn design_unit(design: u32, samples: u32) -> Unit {
    Unit {
        stream: StreamId::design(design),
        generation: Generation::default(),
        samples: 0..samples,
    }
}

/// CPU time of a sample in this thread, in seconds, including its share of the design's analyses.
fn alone(problem: &Problem, points: &[Vec<f64>]) -> f64 {
    let before = thread_seconds();
    for (design, x) in (0..).zip(points) {
        let source = Source::Design(problem.design(x, problem.base()));
        let unit = design_unit(design, PER_DESIGN);
        let _ = std::hint::black_box(compute(problem, &unit, &source));
    }
    (thread_seconds() - before) / (points.len() * PER_DESIGN as usize) as f64
}

/// Computes samples of all points with workers of this process, timed from the first lease until
/// the last sample is stored.
async fn through(
    out: &Path,
    problem: &Arc<Problem>,
    points: &[Vec<f64>],
    per_design: u32,
    workers: usize,
    exec: Option<Exec>,
) -> anyhow::Result<RunnerTimes> {
    let campaign = problem.campaign();
    let folder = tempfile::tempdir_in(out)?;
    let row = CampaignRow {
        name: campaign.name.clone(),
        file_text: String::new(),
        digest: campaign.digest(),
        seed: campaign.seed,
        program_version: runner::identity::BUILD.to_owned(),
        model_digest: None,
    };
    let store = Store::create_or_open(&folder.path().join("runner.db"), &row).await?;
    let rows = (0..).zip(points);
    let rows: Vec<DesignRow> = rows
        .map(|(design, x)| DesignRow::new(design, x.clone()))
        .collect();
    store.put_designs(&rows).await?;
    let board = Arc::new(Board::new(board::options(problem), 1));
    let service = Service {
        board: Arc::clone(&board),
        recorder: StoreRecorder::new(&store)?,
        problem: Arc::clone(problem),
        model_digest: (!campaign.is_external()).then(|| probe::model_digest(problem)),
    };
    let (dial, local) = port::local();
    let stop = CancellationToken::new();
    let listeners = Listeners { port: None, local };
    let served = tokio::spawn(port::serve(service, listeners, stop.clone()));
    let inputs = Inputs::new(campaign, None);
    let wanted = (0..).zip(points).map(|(design, x)| {
        let source = Source::Design(problem.design(x, problem.base()));
        inputs.wanted(StreamId::design(design), source, per_design)
    });
    let count = points.len() as u64 * u64::from(per_design);
    let workers = LocalWorkers {
        count: workers,
        exec,
    };
    let mut workers = workers.start(&dial, &stop, None);
    // Nothing is wanted yet: the workers register and start their programs before the clock starts.
    board.open();
    while board.live().workers.len() < workers.len() {
        tokio::time::sleep(POLL_PERIOD).await;
    }
    let (began, cpu) = (Instant::now(), process_seconds());
    board.want(wanted.collect());
    // A lease ends when its results are stored.
    loop {
        let counts = board.live().counts;
        if counts.free + counts.waiting + counts.leased == 0 {
            break;
        }
        if let Some(ended) = workers.try_join_next() {
            ended.context("a worker")??;
        }
        tokio::time::sleep(POLL_PERIOD).await;
    }
    let ran = RunnerTimes {
        seconds: began.elapsed().as_secs_f64(),
        cpu_seconds: process_seconds() - cpu,
        alone_seconds: 0.0,
    };
    let stored = store.progress().await?.samples;
    anyhow::ensure!(
        stored == count,
        "{stored} of {count} samples are in the store"
    );
    stop.cancel();
    while workers.join_next().await.is_some() {}
    served.await??;
    store.close().await?;
    Ok(ran)
}
