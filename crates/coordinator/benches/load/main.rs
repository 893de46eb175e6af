//! Load tests of the coordinator: its throughput and its cost.
//!
//! ```text
//! load noop [LEASES]       leases without work, each granted, run, reported and committed singly,
//!                          by two workers of one slot in separate processes
//! load overhead [SAMPLES]  the CPU time of a campaign's samples over gRPC and into the store, against
//!                          the same samples in one process; with the built-in simulator, and with
//!                          an external one that takes a millisecond per sample
//! load crowd [WORKERS] [SECONDS] [PERIOD]   simultaneously connected workers that call every so
//!                          many seconds, with the coordinator in a separate process: its memory and response times
//! load large [DESIGNS] [SAMPLES]   a large store: the time until status answers and leasing starts
//! load waiting [WORKERS]   workers that wait for a job: the time until a free one is leased
//! load busy [SECONDS]      16 slots of a program whose calls take so long, in a campaign with
//!                          enrichment and searches: the share of their time that they are busy
//! ```
//!
//! Run it with `cargo bench -p coordinator --bench load -- noop`, for example. Each figure is printed
//! with the figure that it is compared to, measured in the same run.

#![expect(clippy::disallowed_methods, reason = "it measures time")]
#![expect(clippy::print_stdout, reason = "a program for the command line")]

mod busy;
mod crowd;
mod overhead;
mod slow;
mod waiting;

use std::net::Ipv4Addr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use ledger::StreamId;
use problem::formulation::Problem;
use problem::task::{Inputs, Source};
use problem::{Campaign, probe};
use runner::coordinator::board::{Board, Course};
use runner::coordinator::local::LocalWorkers;
use runner::coordinator::recorder::{Recorder, StoreRecorder};
use runner::coordinator::server::{self, Plan};
use runner::coordinator::service::Service;
use runner::coordinator::serving::Port;
use runner::gateway::access::Issuer;
use runner::gateway::client::ConnectArguments;
use runner::gateway::port::{self, Listeners};
use runner::gateway::{Link, Role};
use runner::protocol::v1::{Kind, LeaseRequest};
use runner::worker::{Exec, Interface, Options, Worker};
use store::{Batch, CampaignRow, CriteriaRow, DesignRow, SampleBlock, Store};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

fn main() -> anyhow::Result<()> {
    // `cargo bench` adds the argument `--bench`.
    let arguments = std::env::args().skip(1).filter(|text| text != "--bench");
    let arguments: Vec<String> = arguments.collect();
    let number = |index: usize, default: usize| -> anyhow::Result<usize> {
        arguments.get(index).map_or(Ok(default), |text| {
            text.parse()
                .with_context(|| format!("{text:?} is not a number"))
        })
    };
    let seconds = |index: usize| -> anyhow::Result<f64> {
        let text = arguments.get(index).map_or("3", String::as_str);
        text.parse()
            .with_context(|| format!("{text:?} is not a number"))
    };
    let what = arguments.first().map(String::as_str);
    port::allow_many_files();
    // The same number of threads as in the two programs.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(if what == Some("worker") { 1 } else { 2 })
        .enable_all()
        .build()?;
    match what {
        Some("noop") => runtime.block_on(noop(number(1, 100_000)?)),
        Some("overhead") => runtime.block_on(overhead::measure(number(1, 90_000)?)),
        Some("crowd") => runtime.block_on(crowd::crowd(
            number(1, 1000)?,
            number(2, 20)?,
            number(3, 1)?,
        )),
        Some("large") => runtime.block_on(large(number(1, 100_000)?, number(2, 100)?)),
        Some("waiting") => runtime.block_on(waiting::waiting(number(1, 10_000)?)),
        Some("busy") => busy::busy(seconds(1)?),
        // Processes that the measurements start.
        Some("sleep") => busy::sleep(seconds(1)?, arguments.get(2).context("a folder")?.as_ref()),
        Some("worker") => runtime.block_on(work(&arguments[1..])),
        Some("serve") => runtime.block_on(serve(&arguments[1..])),
        Some("simulate") => slow::simulate(),
        _ => bail!("say what to measure: noop, overhead, crowd, large, waiting or busy"),
    }
}

/// A process of this program that is killed when its handle is dropped.
struct Process(Child);

impl Process {
    fn start(arguments: &[&str]) -> anyhow::Result<Self> {
        let child = Command::new(std::env::current_exe()?)
            .args(arguments)
            .stdout(Stdio::null())
            .spawn()?;
        Ok(Self(child))
    }

    fn wait(mut self) -> anyhow::Result<()> {
        let status = self.0.wait()?;
        ensure!(status.success(), "a process ended with {status}");
        Ok(())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // The process may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// CPU time of this process and of its children that have ended, in seconds.
fn cpu_parts() -> [f64; 2] {
    // Fields 14 to 17 of proc(5)'s stat: user and system time, own and of waited-for children, in
    // hundredths of a second.
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace();
    let ticks: Vec<f64> = fields
        .skip(11)
        .take(4)
        .filter_map(|field| field.parse().ok())
        .collect();
    match ticks.as_slice() {
        [user, system, child_user, child_system] => {
            [0.01 * (user + system), 0.01 * (child_user + child_system)]
        }
        _ => [f64::NAN; 2],
    }
}

fn cpu() -> f64 {
    cpu_parts().iter().sum()
}

fn campaign(designs: u32, samples: u32) -> anyhow::Result<Campaign> {
    let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER)?;
    campaign.doe.designs = designs;
    campaign.sampling.samples_per_design = samples;
    if let Some(sections) = campaign.gears_mut() {
        sections.report.compare_with_paper = false;
    }
    Ok(campaign)
}

async fn new_store(path: &Path, campaign: &Campaign) -> anyhow::Result<Store> {
    let row = CampaignRow {
        name: campaign.name.clone(),
        file_text: toml::to_string(campaign)?,
        digest: campaign.digest(),
        seed: campaign.seed,
        program_version: runner::identity::BUILD.to_owned(),
        model_digest: None,
    };
    Ok(Store::create_or_open(path, &row).await?)
}

/// A service on loopback.
struct Server {
    board: Arc<Board>,
    store: Store,
    access: String,
    stop: CancellationToken,
    _issuer: Issuer,
    _folder: tempfile::TempDir,
}

async fn served(
    campaign: &Campaign,
    digest: Option<String>,
    bundle: bool,
) -> anyhow::Result<Server> {
    // Beside the program rather than in /tmp, which may be memory: commits must cost their real
    // time.
    let exe = std::env::current_exe()?;
    let folder = tempfile::tempdir_in(exe.parent().context("the program has a folder")?)?;
    let store = new_store(&folder.path().join("load.db"), campaign).await?;
    let options = ledger::Options {
        bundle,
        ..ledger::Options::default()
    };
    let board = Arc::new(Board::new(options, 1));
    let service = Service {
        board: Arc::clone(&board),
        recorder: StoreRecorder::new(&store)?,
        problem: Arc::new(Problem::new(campaign.clone())),
        model_digest: digest,
    };
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
    let mut issuer = Issuer::new(&folder.path().join("load.access"), &campaign.name)?;
    let access = issuer.publish(listener.local_addr()?, &[])?;
    let access = access.display().to_string();
    let listeners = Listeners {
        port: Some((listener, issuer.guard()?)),
        local: port::local().1,
    };
    let stop = CancellationToken::new();
    tokio::spawn(port::serve(service, listeners, stop.clone()));
    Ok(Server {
        board,
        store,
        access,
        stop,
        _issuer: issuer,
        _folder: folder,
    })
}

fn link(access: &Path) -> anyhow::Result<Link> {
    let arguments = ConnectArguments {
        access: Some(access.to_owned()),
        ..ConnectArguments::default()
    };
    Ok(arguments.link(Role::Worker)?)
}

async fn work(arguments: &[String]) -> anyhow::Result<()> {
    let [access, rest @ ..] = arguments else {
        bail!("a worker needs an access file");
    };
    let options = Options {
        slots: 1,
        exec: rest.first().map(|command| Exec {
            interface: Interface::Lines(command.clone()),
            timeout: Duration::from_secs(60),
            environment: Vec::new(),
        }),
        host: format!("load:{}", std::process::id()),
        connect_timeout: Duration::from_secs(30),
        give_up_after: Duration::from_secs(30),
        undelivered: None,
        journal: None,
        grace: Duration::from_secs(10),
        max_runtime: None,
        idle_exit: None,
    };
    let link = link(Path::new(access))?;
    Worker::new(link, options)
        .run(CancellationToken::new())
        .await?;
    Ok(())
}

async fn noop(jobs: usize) -> anyhow::Result<()> {
    let campaign = campaign(2, 4)?;
    let problem = Problem::new(campaign.clone());
    let served = served(&campaign, Some(probe::model_digest(&problem)), false).await?;
    let access = &served.access;
    // Designs that are no gear pair: the simulator refuses them at once.
    let impossible = problem.design(&[-1.0; 6], problem.base());
    let rows: Vec<DesignRow> = (0..jobs as u64)
        .map(|design| DesignRow::new(design, [-1.0; 6]))
        .collect();
    served.store.put_designs(&rows).await?;
    let inputs = Inputs::new(&campaign, None);
    let wanted = (0..jobs as u32).map(|design| {
        let source = Source::Design(impossible.clone());
        inputs.wanted(StreamId::design(design), source, 1)
    });
    served.board.want(wanted.collect());
    let before = cpu();
    let workers = [
        Process::start(&["worker", access])?,
        Process::start(&["worker", access])?,
    ];
    served.board.open();
    let mut began = None;
    while served.board.live().counts.delivered < jobs as u64 {
        // The time counts from the first delivery, not from the start of the processes.
        if began.is_none() && served.board.live().counts.delivered > 0 {
            began = Some((Instant::now(), served.board.live().counts.delivered));
        }
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    let (began, already) = began.context("too few leases to measure")?;
    let seconds = began.elapsed().as_secs_f64();
    served.board.set_course(Course::Finished);
    for worker in workers {
        worker.wait()?;
    }
    let used = cpu() - before;
    let recorded = served.store.job_times().await?.len();
    ensure!(
        recorded == jobs,
        "{recorded} of {jobs} leases are on record"
    );
    println!(
        "{jobs} leases: {:.0} per second, {:.1} µs of CPU time each (coordinator and workers); all are \
         on disk",
        (jobs as u64 - already) as f64 / seconds,
        1e6 * used / jobs as f64
    );
    served.stop.cancel();
    Ok(())
}

async fn serve(arguments: &[String]) -> anyhow::Result<()> {
    let [db, access, file] = arguments else {
        bail!("serve needs a store, an access file and a campaign file");
    };
    let text = std::fs::read_to_string(file)?;
    let plan = Plan {
        campaign: Campaign::parse(file, &text)?,
        file_text: text,
        db: db.into(),
        out: Path::new(db).with_extension("report"),
        check_out: |_| Ok(()),
        workers: LocalWorkers {
            count: 0,
            exec: None,
        },
        port: Some(Port {
            listen: Some((Ipv4Addr::LOCALHOST, 0).into()),
            access: access.into(),
            hosts: Vec::new(),
        }),
        keep_serving: false,
        retry_failed: false,
        lease: server::LEASE,
        http: None,
    };
    let ended = server::run(plan, None, CancellationToken::new()).await;
    ended.map_err(|error| anyhow::anyhow!("{error:#}"))?;
    Ok(())
}

/// Starts a coordinator in a separate process, with the campaign's file and store in `folder`.
/// Returns it with its access file.
async fn coordinator(folder: &Path, campaign: &Campaign) -> anyhow::Result<(Process, PathBuf)> {
    let file = folder.join("load.toml");
    std::fs::write(&file, toml::to_string(campaign)?)?;
    let (db, access) = (folder.join("load.db"), folder.join("load.access"));
    let text = |path: &Path| path.display().to_string();
    let process = Process::start(&["serve", &text(&db), &text(&access), &text(&file)])?;
    Ok((process, access))
}

/// Waits until a design can be leased, and returns the time that this took.
async fn wait_for_jobs(access: &Path, digest: &str) -> anyhow::Result<Duration> {
    let began = Instant::now();
    let link = loop {
        match link(access) {
            Ok(link) => break link,
            Err(_) => tokio::time::sleep(Duration::from_millis(2)).await,
        }
    };
    loop {
        let request = crowd::introduction("first", digest);
        if link.client().register(request).await.is_ok() {
            let request = LeaseRequest {
                worker_id: "first".to_owned(),
                credit: 100,
                seconds: 1.0,
                wait_ms: 10,
            };
            let leased = link.client().lease(request).await?.into_inner();
            let leases = leased.leases.iter();
            if leases
                .flat_map(|lease| &lease.units)
                .any(|unit| unit.kind() == Kind::Design)
            {
                return Ok(began.elapsed());
            }
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

async fn large(designs: usize, samples: usize) -> anyhow::Result<()> {
    let exe = std::env::current_exe()?;
    let folder = tempfile::tempdir_in(exe.parent().context("the program has a folder")?)?;
    let campaign = campaign(designs as u32, samples as u32)?;
    let problem = Problem::new(campaign.clone());
    let digest = probe::model_digest(&problem);
    let path = folder.path().join("load.db");
    let store = new_store(&path, &campaign).await?;
    let x = [0.25, 1.37, 1.37, 0.85, 1.31, 0.80];
    let rows: Vec<DesignRow> = (0..designs as u64)
        .map(|design| DesignRow::new(design, x))
        .collect();
    store.put_designs(&rows).await?;
    // As in the store of every interrupted campaign.
    store.pin_model_digest(&digest).await?;
    let writer = store.writer()?;
    let began = Instant::now();
    // All but the last hundred designs, so that there is something to lease.
    let held = designs.saturating_sub(100) as u64;
    let mut commits = tokio::task::JoinSet::new();
    for first in (0..held).step_by(200) {
        let range = first..(first + 200).min(held);
        let criteria = range.clone().map(|design| CriteriaRow {
            design,
            simulable: true,
            ..CriteriaRow::default()
        });
        let blocks = range.map(|design| {
            let value = |sample| 1.0 + (design * 31 + sample) as f64 * 1e-6;
            SampleBlock {
                stream: StreamId::design(design as u32),
                first_sample: 0,
                samples: (0..samples as u64).map(value).collect(),
            }
        });
        let batch = Batch {
            criteria: criteria.collect(),
            samples: blocks.collect(),
            ..Batch::default()
        };
        let writer = writer.clone();
        commits.spawn(async move { writer.submit(batch).await });
        if commits.len() >= 16 {
            commits.join_next().await.context("one is out")???;
        }
    }
    while let Some(commit) = commits.join_next().await {
        commit??;
    }
    println!(
        "{} samples stored in {:.1?}",
        store.progress().await?.samples,
        began.elapsed()
    );
    let recorder = StoreRecorder::new(&store)?;
    recorder.status().await?;
    let began = Instant::now();
    let status = recorder.status().await?;
    println!(
        "status ({} samples) in {:.1?}",
        status.samples.done,
        began.elapsed()
    );
    drop(recorder);
    drop(writer);
    store.close().await?;
    let size = std::fs::metadata(&path)?.len();
    // The first start stores the generations of the wanted streams, and the pages of the file are
    // checked before that. After a restart the generations are known.
    for how in ["started", "restarted"] {
        let began = Instant::now();
        let (_process, url) = coordinator(folder.path(), &campaign).await?;
        wait_for_jobs(&url, &digest).await?;
        println!(
            "a coordinator {how} on the store of {} MB leases after {:.2?}",
            size / 1_000_000,
            began.elapsed()
        );
    }
    Ok(())
}
