//! How much a coordinator bears, and what it costs.
//!
//! ```text
//! load noop [JOBS]         jobs that do nothing, each leased, run, reported and committed by itself, by
//!                          two workers of one slot in processes of their own
//! load overhead [SAMPLES]  the CPU time of a campaign's samples over gRPC and into the store, against
//!                          the same samples in one process; with the built-in simulator, and with
//!                          an external one that takes a millisecond per sample
//! load crowd [WORKERS] [SECONDS]   workers that are connected at once, the coordinator in a process
//!                          of its own: what it takes and how soon it answers
//! load large [DESIGNS] [SAMPLES]   a large store: how soon status answers and leasing starts
//! ```
//!
//! Run it in release mode; every figure is printed with what it is compared to, measured in the
//! same run.

#![expect(clippy::print_stdout, reason = "a program for the command line")]

use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use campaign::formulation::Problem;
use campaign::plan::DesignState;
use campaign::task::{SampleRange, SampleRequest, Task, execute};
use campaign::{Campaign, probe};
use coordinator::board::Board;
use coordinator::guard::Guard;
use coordinator::listening;
use coordinator::server::{self, Plan, Workers};
use coordinator::service::{Recorder, Service, StoreRecorder};
use protocol::v1::{
    Directive, HeartbeatRequest, JobResult, LeaseRequest, RegisterRequest, ReportRequest,
    job_result,
};
use protocol::{Role, v1::campaign_client::CampaignClient};
use store::{Batch, CampaignRow, CriteriaRow, DesignRow, SampleRow, Store};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use worker::client::{Credentials, Dial, connect};
use worker::{Exec, Options, Worker};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: usize| -> anyhow::Result<usize> {
        arguments.get(index).map_or(Ok(default), |text| {
            text.parse()
                .with_context(|| format!("{text:?} is no number"))
        })
    };
    let runtime = tokio::runtime::Runtime::new()?;
    match arguments.first().map(String::as_str) {
        Some("noop") => runtime.block_on(noop(number(1, 100_000)?)),
        Some("overhead") => runtime.block_on(overhead(number(1, 90_000)?)),
        Some("crowd") => runtime.block_on(crowd(number(1, 1000)?, number(2, 20)?)),
        Some("large") => runtime.block_on(large(number(1, 100_000)?, number(2, 100)?)),
        // What the others start.
        Some("worker") => runtime.block_on(work(&arguments[1..])),
        Some("serve") => runtime.block_on(serve(&arguments[1..])),
        Some("simulate") => slow::simulate(),
        _ => bail!("say what to measure: noop, overhead, crowd or large"),
    }
}

/// A process of this program that ends with its handle.
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
        // It may have ended.
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
    campaign.report.compare_with_paper = false;
    Ok(campaign)
}

async fn new_store(path: &Path, campaign: &Campaign) -> anyhow::Result<Store> {
    let row = CampaignRow {
        name: campaign.name.clone(),
        file_text: toml::to_string(campaign)?,
        digest: campaign.digest(),
        seed: campaign.seed,
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        model_digest: None,
    };
    Ok(Store::create_or_open(path, &row).await?)
}

/// A service on loopback.
struct Served {
    board: Arc<Board>,
    store: Store,
    address: SocketAddr,
    stop: CancellationToken,
    _folder: tempfile::TempDir,
}

async fn served(campaign: &Campaign, digest: Option<String>) -> anyhow::Result<Served> {
    // Beside the program rather than in /tmp, which may be memory: commits are to cost what they do.
    let exe = std::env::current_exe()?;
    let folder = tempfile::tempdir_in(exe.parent().context("the program has a folder")?)?;
    let store = new_store(&folder.path().join("load.db"), campaign).await?;
    let options = scheduler::Options {
        lease: Duration::from_secs(5),
        duplicate_after: Duration::from_secs(2),
        ..scheduler::Options::default()
    };
    let board = Arc::new(Board::new(options, 1));
    let service = Service {
        board: Arc::clone(&board),
        recorder: StoreRecorder::new(&store)?,
        campaign_json: campaign.to_json(),
        model_digest: digest,
    };
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
    let address = listener.local_addr()?;
    let stop = CancellationToken::new();
    tokio::spawn(listening::serve(
        service,
        listener,
        Guard::default(),
        stop.clone(),
    ));
    Ok(Served {
        board,
        store,
        address,
        stop,
        _folder: folder,
    })
}

async fn work(arguments: &[String]) -> anyhow::Result<()> {
    let [url, rest @ ..] = arguments else {
        bail!("a worker needs an address");
    };
    let options = Options {
        connect: url.clone(),
        credentials: Credentials::default(),
        dial: Dial::default(),
        slots: 1,
        exec: rest.first().map(|command| Exec {
            command: command.clone(),
            timeout: Duration::from_secs(60),
        }),
        host: format!("load:{}", std::process::id()),
        connect_timeout: Duration::from_secs(30),
        give_up_after: Duration::from_secs(30),
        grace: Duration::from_secs(10),
        max_runtime: None,
        idle_exit: None,
    };
    Worker::new(options).run(CancellationToken::new()).await?;
    Ok(())
}

async fn noop(jobs: usize) -> anyhow::Result<()> {
    let campaign = campaign(2, 4)?;
    let problem = Problem::new(campaign.clone());
    let served = served(&campaign, Some(probe::model_digest(&problem))).await?;
    let url = format!("http://{}", served.address);
    let task = Task::Sample {
        frozen: problem.printed_frozen(),
        designs: Vec::new(),
    };
    // Numbers of sampling jobs that no design has.
    let numbers = (1..=jobs as u64).map(|job| (2 << 56) | (1 << 55) | job);
    served
        .board
        .post(numbers.map(|job| (job, task.clone())).collect());
    let before = cpu();
    let workers = [
        Process::start(&["worker", &url])?,
        Process::start(&["worker", &url])?,
    ];
    served.board.open();
    let mut began = None;
    while served.board.live().done < jobs as u64 {
        // Not the start of the processes, but from the first job on.
        if began.is_none() && served.board.live().done > 0 {
            began = Some((Instant::now(), served.board.live().done));
        }
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    let (began, already) = began.context("too few jobs to measure")?;
    let seconds = began.elapsed().as_secs_f64();
    served.board.finish();
    for worker in workers {
        worker.wait()?;
    }
    let used = cpu() - before;
    let recorded = served.store.job_times().await?.len();
    ensure!(recorded == jobs, "{recorded} of {jobs} jobs are on record");
    println!(
        "{jobs} jobs: {:.0} per second, {:.1} µs of CPU time each (coordinator and workers); all are \
         on disk",
        (jobs as u64 - already) as f64 / seconds,
        1e6 * used / jobs as f64
    );
    served.stop.cancel();
    Ok(())
}

/// Designs spread over the paper's box; those that cannot be simulated are left out.
fn designs(problem: &Problem, count: usize) -> Vec<[f64; 6]> {
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};
    let mut rng = stream(1, Purpose::Test, 0, 0);
    let mut designs = Vec::new();
    while designs.len() < count {
        let unit: [f64; 6] = std::array::from_fn(|_| rng.random());
        let x = problem.robust_point(&unit);
        let variables = campaign::Variables::robust(&x, &problem.printed_frozen());
        if problem.pair(&variables).is_ok() {
            designs.push(x);
        }
    }
    designs
}

async fn overhead(samples: usize) -> anyhow::Result<()> {
    const PER_DESIGN: usize = 30;
    let built_in = campaign((samples / PER_DESIGN) as u32, PER_DESIGN as u32)?;
    let problem = Problem::new(built_in.clone());
    let points = designs(&problem, samples / PER_DESIGN);
    // The same work in one process, on two threads, as the workers have two processors; twice, as
    // the first time warms up.
    let mut alone = 0.0;
    for _ in 0..2 {
        let before = cpu();
        std::thread::scope(|scope| {
            for half in points.chunks(points.len().div_ceil(2)) {
                let problem = &problem;
                scope.spawn(move || {
                    for (design, x) in (0..).zip(half) {
                        let designs = vec![SampleRequest {
                            design,
                            x: *x,
                            samples: SampleRange {
                                first: 0,
                                count: PER_DESIGN as u32,
                            },
                        }];
                        let frozen = problem.printed_frozen();
                        let _ = std::hint::black_box(execute(
                            problem,
                            &Task::Sample { frozen, designs },
                        ));
                    }
                });
            }
        });
        alone = cpu() - before;
    }
    let digest = Some(probe::model_digest(&problem));
    let spread = over_grpc(&built_in, &points, digest, None).await?;
    tell("built-in simulator", samples, alone, spread);

    let exe = std::env::current_exe()?;
    let command = format!("exec {} simulate", exe.display());
    let slow = samples / 10;
    let text = toml::to_string(&campaign((slow / PER_DESIGN) as u32, PER_DESIGN as u32)?)?
        + "\n[simulator]\nkind = \"external\"\nprobe_designs = 0\n";
    let external = Campaign::parse("external.toml", &text)?;
    let points = &points[..slow / PER_DESIGN];
    // One process that asks the program itself: a worker's slot without coordinator and store.
    let before = cpu();
    slow::ask(&exe, points.len(), PER_DESIGN)?;
    let alone = cpu() - before;
    let spread = over_grpc(&external, points, None, Some(&command)).await?;
    tell("a simulator of 1 ms per sample", slow, alone, spread);
    Ok(())
}

/// An external simulator that takes a millisecond of CPU time per sample.
mod slow {
    use std::io::{BufRead as _, BufReader, Write as _};
    use std::path::Path;
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    use anyhow::Context as _;
    use serde_json::{Value, json};

    /// Answers requests until there are no more.
    pub(super) fn simulate() -> anyhow::Result<()> {
        let mut out = std::io::stdout().lock();
        for line in std::io::stdin().lock().lines() {
            let request: Value = serde_json::from_str(&line?)?;
            let id = &request["id"];
            let answer = match request["request"].as_str() {
                Some("start") => json!({"id": id, "protocol": 1, "version": "slow 1"}),
                Some("criteria") => json!({"id": id, "contact_ratio": 1.6,
                    "specific_sliding": 1.3, "root_stress_mpa": 500.0,
                    "clearance_mm": [0.9, 0.6], "flank_margin_mm": [0.4, 0.2]}),
                Some("sample") => {
                    let began = Instant::now();
                    while began.elapsed() < Duration::from_millis(1) {
                        std::hint::spin_loop();
                    }
                    json!({"id": id, "delta_ste_um": 1.5})
                }
                _ => json!({"id": id, "delta_ste_um": 1.25, "hertz_pressure_mpa": 1180.0}),
            };
            writeln!(out, "{answer}")?;
            out.flush()?;
        }
        Ok(())
    }

    /// Asks such a program what a worker asks it.
    pub(super) fn ask(program: &Path, designs: usize, samples: usize) -> anyhow::Result<()> {
        let mut child = Command::new(program)
            .arg("simulate")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let mut to = child.stdin.take().context("it is piped")?;
        let mut from = BufReader::new(child.stdout.take().context("it is piped")?);
        let design = json!({"x_p": 0.25, "x_r": 0.5, "ha0_p": 1.4, "ha0_r": 1.3, "hf0_p": 1.1,
            "hf0_r": 1.0, "rho_a_p_mm": 0.1, "rho_a_r_mm": 0.1, "rho_f_p_mm": 0.8,
            "rho_f_r_mm": 0.8, "beta_deg": 30.0, "normal_module_mm": 4.36});
        let mut line = String::new();
        for _ in 0..designs {
            let questions = ["criteria", "unworn", "archard"]
                .into_iter()
                .chain(std::iter::repeat_n("sample", samples));
            for request in questions {
                let seed = [
                    2_683_476_519_u32,
                    2_690_815_214,
                    3_170_936_498,
                    3_816_220_716,
                ];
                let asked = json!({"id": 1, "request": request, "design": design, "seed": seed});
                writeln!(to, "{asked}")?;
                line.clear();
                from.read_line(&mut line)?;
                let answer: Value = serde_json::from_str(&line)?;
                std::hint::black_box(answer["delta_ste_um"].as_f64());
            }
        }
        drop(to);
        child.wait()?;
        Ok(())
    }
}

/// CPU time of a campaign's samples with two workers, their and the coordinator's start included.
async fn over_grpc(
    campaign: &Campaign,
    points: &[[f64; 6]],
    digest: Option<String>,
    exec: Option<&str>,
) -> anyhow::Result<[f64; 2]> {
    let before = cpu_parts();
    let served = served(campaign, digest).await?;
    let rows: Vec<DesignRow> = (0..)
        .zip(points)
        .map(|(design, x)| row(design, x))
        .collect();
    served.store.put_designs(&rows).await?;
    let missing = 0..campaign.sampling.samples_per_design;
    let states: Vec<DesignState> = points
        .iter()
        .map(|x| DesignState {
            x: *x,
            has_criteria: false,
            simulated: false,
            missing: vec![missing.clone()],
        })
        .collect();
    let problem = Problem::new(campaign.clone());
    served.board.post_designs(problem.printed_frozen(), &states);
    served.board.open();
    let url = format!("http://{}", served.address);
    let mut arguments = vec!["worker", &url];
    arguments.extend(exec);
    let workers = [Process::start(&arguments)?, Process::start(&arguments)?];
    let wanted = points.len() as u64 * u64::from(campaign.sampling.samples_per_design);
    while served.store.progress().await?.samples < wanted {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    served.board.finish();
    for worker in workers {
        worker.wait()?;
    }
    served.stop.cancel();
    served.store.close().await?;
    let after = cpu_parts();
    Ok([after[0] - before[0], after[1] - before[1]])
}

fn row(design: u64, x: &[f64; 6]) -> DesignRow {
    let [x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r] = *x;
    DesignRow {
        design,
        x_p,
        x_r,
        ha0_p,
        ha0_r,
        hf0_p,
        hf0_r,
    }
}

fn tell(what: &str, samples: usize, alone: f64, spread: [f64; 2]) {
    let micros = |seconds: f64| 1e6 * seconds / samples as f64;
    let [coordinator, workers] = spread;
    println!(
        "{what}: {samples} samples, {:.1} µs each in one process; over gRPC {:.1} µs in the workers \
         and {:.1} µs in the coordinator and its store: {:+.1} % CPU time",
        micros(alone),
        micros(workers),
        micros(coordinator),
        100.0 * ((coordinator + workers) / alone - 1.0)
    );
}

async fn serve(arguments: &[String]) -> anyhow::Result<()> {
    let [db, address, file] = arguments else {
        bail!("serve needs a store, an address and a campaign file");
    };
    let text = std::fs::read_to_string(file)?;
    let plan = Plan {
        campaign: Campaign::parse(file, &text)?,
        file_text: text,
        db: db.into(),
        listen: address.parse()?,
        guard: Guard::default(),
        out: Path::new(db).with_extension("report"),
        workers: Workers::Remote {
            keep_serving: false,
        },
        metrics: None,
    };
    server::run(plan, None, CancellationToken::new()).await?;
    Ok(())
}

/// A coordinator in a process of its own, with the campaign's file and store in `folder`.
async fn coordinator(folder: &Path, campaign: &Campaign) -> anyhow::Result<(Process, String)> {
    let file = folder.join("load.toml");
    std::fs::write(&file, toml::to_string(campaign)?)?;
    let address = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?;
    let db = folder.join("load.db");
    let text = |path: &Path| path.display().to_string();
    let process = Process::start(&["serve", &text(&db), &address.to_string(), &text(&file)])?;
    Ok((process, format!("http://{address}")))
}

async fn crowd(workers: usize, seconds: usize) -> anyhow::Result<()> {
    let exe = std::env::current_exe()?;
    let folder = tempfile::tempdir_in(exe.parent().context("the program has a folder")?)?;
    // Work for much longer than it lasts.
    let campaign = campaign(20_000, 200)?;
    let problem = Arc::new(Problem::new(campaign.clone()));
    let digest = probe::model_digest(&problem);
    let (process, url) = coordinator(folder.path(), &campaign).await?;
    wait_for_jobs(&url, &digest).await?;
    println!("{workers} workers at once, for {seconds} s");
    let until = tokio::time::Instant::now() + Duration::from_secs(seconds as u64);
    let mut crowd = tokio::task::JoinSet::new();
    for index in 0..workers {
        let (url, digest, problem) = (url.clone(), digest.clone(), Arc::clone(&problem));
        crowd.spawn(member(index, url, digest, problem, until));
    }
    let mut waits = Vec::new();
    let (mut served, mut registered) = (0, Vec::new());
    while let Some(member) = crowd.join_next().await {
        let member = member??;
        waits.extend(member.heartbeats);
        registered.push(member.registered);
        served += usize::from(member.jobs > 0);
    }
    waits.sort();
    registered.sort();
    let memory = std::fs::read_to_string(format!("/proc/{}/status", process.0.id()))?;
    let peak = memory
        .lines()
        .find(|line| line.starts_with("VmHWM"))
        .unwrap_or("VmHWM: unknown");
    let quantile = |sorted: &[Duration], part: f64| {
        sorted[((sorted.len() as f64 * part) as usize).min(sorted.len() - 1)]
    };
    println!(
        "registered: the last one after {:.2?}",
        quantile(&registered, 1.0)
    );
    println!("served with jobs: {served} of {workers}");
    println!(
        "{} heartbeats: median {:.2?}, 99 % within {:.2?}, slowest {:.2?}",
        waits.len(),
        quantile(&waits, 0.5),
        quantile(&waits, 0.99),
        quantile(&waits, 1.0)
    );
    println!(
        "the coordinator's memory at its peak: {}",
        peak.trim_start_matches("VmHWM:").trim()
    );
    Ok(())
}

struct Member {
    registered: Duration,
    heartbeats: Vec<Duration>,
    jobs: u64,
}

/// One worker of the crowd: real calls on a connection of its own, and real results.
async fn member(
    index: usize,
    url: String,
    digest: String,
    problem: Arc<Problem>,
    until: tokio::time::Instant,
) -> anyhow::Result<Member> {
    let worker_id = format!("member-{index}");
    let began = Instant::now();
    let mut client = loop {
        match CampaignClient::connect(url.clone()).await {
            Ok(client) => break client,
            Err(_) => tokio::time::sleep(Duration::from_millis(50)).await,
        }
    };
    client.register(introduction(&worker_id, &digest)).await?;
    let mut member = Member {
        registered: began.elapsed(),
        heartbeats: Vec::new(),
        jobs: 0,
    };
    let mut working = client.clone();
    let name = worker_id.clone();
    let work = async {
        let mut jobs = 0;
        loop {
            let request = LeaseRequest {
                worker_id: name.clone(),
                credit: 1,
                wait_ms: 5000,
            };
            for job in working.lease(request).await?.into_inner().jobs {
                let task: Task = serde_json::from_slice(&job.payload)?;
                if matches!(task, Task::Optimise { .. }) {
                    // The processors are needed to measure with: this one is busy to the end.
                    tokio::time::sleep_until(until).await;
                    return Ok(1);
                }
                // Off the network's threads: it is the coordinator that is to be measured.
                let problem = Arc::clone(&problem);
                let computed = tokio::task::spawn_blocking(move || execute(&*problem, &task));
                let result = computed.await?.map_err(anyhow::Error::msg)?;
                let result = JobResult {
                    job: job.job,
                    attempt: job.attempt,
                    outcome: Some(job_result::Outcome::Result(serde_json::to_vec(&result)?)),
                    cpu_seconds: 0.0,
                    // As from a slow machine, so that jobs stay small and all get some.
                    wall_seconds: 1.0,
                };
                let request = ReportRequest {
                    worker_id: name.clone(),
                    results: vec![result],
                };
                working.report(request).await?;
                jobs += 1;
                if tokio::time::Instant::now() > until {
                    return anyhow::Ok(jobs);
                }
                // The time that the job would take there.
                tokio::time::sleep(Duration::from_secs(1)).await;
            }
            if tokio::time::Instant::now() > until {
                return Ok(jobs);
            }
        }
    };
    let beat = async {
        let mut waits = Vec::new();
        loop {
            tokio::time::sleep(Duration::from_secs(1)).await;
            let request = HeartbeatRequest {
                worker_id: worker_id.clone(),
                held: Vec::new(),
            };
            let before = Instant::now();
            let answer = client.heartbeat(request).await?.into_inner();
            ensure!(
                answer.directive() == Directive::Continue,
                "not known any more"
            );
            waits.push(before.elapsed());
            if tokio::time::Instant::now() > until {
                return Ok(waits);
            }
        }
    };
    (member.jobs, member.heartbeats) = tokio::try_join!(work, beat)?;
    Ok(member)
}

fn introduction(worker_id: &str, digest: &str) -> RegisterRequest {
    RegisterRequest {
        worker_id: worker_id.to_owned(),
        host: "load".to_owned(),
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        model_digest: digest.to_owned(),
        slots: 1,
        held: Vec::new(),
    }
}

/// Waits until a sampling job can be leased, and how long that took.
async fn wait_for_jobs(url: &str, digest: &str) -> anyhow::Result<Duration> {
    let began = Instant::now();
    let link = connect(url, &Credentials::default(), Role::Worker)?;
    loop {
        let request = introduction("first", digest);
        if link.client().register(request).await.is_ok() {
            let request = LeaseRequest {
                worker_id: "first".to_owned(),
                credit: 100,
                wait_ms: 10,
            };
            let leased = link.client().lease(request).await?.into_inner();
            if leased.jobs.iter().any(|job| job.job >> 56 == 2) {
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
    let rows: Vec<DesignRow> = (0..designs as u64).map(|design| row(design, &x)).collect();
    store.put_designs(&rows).await?;
    let writer = store.writer()?;
    let began = Instant::now();
    // All but the last hundred designs: there is something to lease.
    let held = designs.saturating_sub(100) as u64;
    let mut commits = tokio::task::JoinSet::new();
    for first in (0..held).step_by(200) {
        let range = first..(first + 200).min(held);
        let criteria = range.clone().map(|design| CriteriaRow {
            design,
            feasible: true,
            ..CriteriaRow::default()
        });
        let rows = range.flat_map(|design| {
            (0..samples as u64).map(move |sample| SampleRow {
                design,
                sample,
                delta_ste_um: 1.0 + (design * 31 + sample) as f64 * 1e-6,
            })
        });
        let batch = Batch {
            criteria: criteria.collect(),
            samples: rows.collect(),
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
    let began = Instant::now();
    let (_process, url) = coordinator(folder.path(), &campaign).await?;
    wait_for_jobs(&url, &digest).await?;
    println!(
        "a coordinator started on the store of {} MB leases after {:.2?}",
        size / 1_000_000,
        began.elapsed()
    );
    Ok(())
}
