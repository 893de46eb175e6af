//! Many workers at once, each with its own connection, real calls and real results.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use problem::formulation::Problem;
use problem::probe;
use problem::task::compute;
use runner::protocol::v1::{
    Directive, HeartbeatRequest, LeaseRequest, LeaseResult, RegisterRequest, ReportRequest,
};

use super::{campaign, coordinator, link, wait_for_jobs};

/// A crowd for some seconds. Each worker sends a heartbeat and finishes a job every `period` seconds.
pub(super) async fn crowd(workers: usize, seconds: usize, period: usize) -> anyhow::Result<()> {
    let exe = std::env::current_exe()?;
    let folder = tempfile::tempdir_in(exe.parent().context("the program has a folder")?)?;
    // More work than the measurement can finish.
    let campaign = campaign(20_000, 200)?;
    let problem = Arc::new(Problem::new(campaign.clone()));
    let digest = probe::model_digest(&problem);
    let (process, access) = coordinator(folder.path(), &campaign).await?;
    wait_for_jobs(&access, &digest).await?;
    println!(
        "{workers} workers at once, for {seconds} s, each with a heartbeat and a job every {period} s"
    );
    let period = Duration::from_secs(period as u64);
    let until = tokio::time::Instant::now() + Duration::from_secs(seconds as u64);
    let mut crowd = tokio::task::JoinSet::new();
    for index in 0..workers {
        let (access, digest, problem) = (access.clone(), digest.clone(), Arc::clone(&problem));
        let rhythm = Rhythm {
            first: period.mul_f64(index as f64 / workers as f64),
            period,
            until,
        };
        crowd.spawn(member(index, access, digest, problem, rhythm));
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

/// When a worker calls.
struct Rhythm {
    /// Wait before the first call, so that workers that start together do not call together.
    first: Duration,
    period: Duration,
    until: tokio::time::Instant,
}

struct Member {
    registered: Duration,
    heartbeats: Vec<Duration>,
    jobs: u64,
}

/// One worker of the crowd: real calls on its own connection, and real results.
async fn member(
    index: usize,
    access: PathBuf,
    digest: String,
    problem: Arc<Problem>,
    Rhythm {
        first,
        period,
        until,
    }: Rhythm,
) -> anyhow::Result<Member> {
    let worker_id = format!("member-{index}");
    let began = Instant::now();
    let mut client = link(&access)?.client();
    // A worker that is late on a busy machine tries again, as real workers do.
    while let Err(status) = client.register(introduction(&worker_id, &digest)).await {
        ensure!(status.code() == tonic::Code::Unavailable, "{status}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let mut member = Member {
        registered: began.elapsed(),
        heartbeats: Vec::new(),
        jobs: 0,
    };
    let mut working = client.clone();
    let name = worker_id.clone();
    tokio::time::sleep(first).await;
    let work = async {
        let mut jobs = 0;
        loop {
            let request = LeaseRequest {
                worker_id: name.clone(),
                credit: 1,
                seconds: 1.0,
                wait_ms: 5000,
            };
            for lease in working.lease(request).await?.into_inner().leases {
                let units = lease
                    .units()
                    .map_err(|why| anyhow::anyhow!("a lease {why}"))?;
                if units
                    .iter()
                    .any(|(unit, _)| unit.stream.kind == ledger::Kind::Run)
                {
                    // The processors are needed for the measurement: this worker pretends to be
                    // busy to the end.
                    tokio::time::sleep_until(until).await;
                    return Ok(1);
                }
                // Computed outside the network's threads, because the coordinator is to be
                // measured.
                let problem = Arc::clone(&problem);
                let computed = tokio::task::spawn_blocking(move || {
                    let result = |(unit, source): &(_, _)| {
                        let output = compute(&*problem, unit, source);
                        runner::protocol::result(unit, &output.map(Some), 0.0)
                    };
                    units.iter().map(result).collect()
                });
                let result = LeaseResult {
                    id: lease.id,
                    results: computed.await?,
                    // The time of a slow machine, so that leases stay small and all workers get
                    // some.
                    wall_seconds: 1.0,
                    origin: None,
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
                // The time that the job would take on the slow machine.
                tokio::time::sleep(period).await;
            }
            if tokio::time::Instant::now() > until {
                return Ok(jobs);
            }
        }
    };
    let beat = async {
        let mut waits = Vec::new();
        loop {
            tokio::time::sleep(period).await;
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

pub(super) fn introduction(worker_id: &str, digest: &str) -> RegisterRequest {
    RegisterRequest {
        worker_id: worker_id.to_owned(),
        host: "load".to_owned(),
        program_version: runner::identity::BUILD.to_owned(),
        model_digest: digest.to_owned(),
        slots: 1,
        held: Vec::new(),
        died: Vec::new(),
    }
}
