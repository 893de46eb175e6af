//! The cost of one free job when many workers wait for it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use ledger::{StreamId, WorkerId};
use problem::formulation::Problem;
use problem::task::{Inputs, Source};
use runner::coordinator::board::{Board, Room};

/// Jobs that become free, one after the other.
const JOBS: u32 = 10;

/// Frees jobs singly while `workers` lease requests wait. Prints the time until each is granted and
/// the CPU time until the others wait again.
pub(crate) async fn waiting(workers: usize) -> anyhow::Result<()> {
    let campaign = super::campaign(2, 4)?;
    let problem = Problem::new(campaign.clone());
    let design = problem.design(&[0.0; 6], problem.base());
    let inputs = Inputs::new(&campaign, None);
    let board = Arc::new(Board::new(ledger::Options::default(), 1));
    board.open();
    let (granted, mut grants) = tokio::sync::mpsc::unbounded_channel();
    for number in 0..workers {
        let worker = WorkerId::from(format!("worker {number}").as_str());
        board.register(&worker, "load", 1, &[]);
        let (board, granted) = (Arc::clone(&board), granted.clone());
        tokio::spawn(async move {
            let room = Room {
                leases: 1,
                seconds: 60.0,
            };
            let grants = board.lease(&worker, room, Duration::from_secs(3600)).await;
            granted.send((Instant::now(), grants))
        });
    }
    let settle = || tokio::time::sleep(Duration::from_secs(2));
    settle().await;
    let before = super::cpu();
    let mut latency = Duration::ZERO;
    for job in 0..JOBS {
        let since = Instant::now();
        let stream = StreamId::design(job);
        board.want(vec![inputs.wanted(
            stream,
            Source::Design(design.clone()),
            1,
        )]);
        let (at, _) = grants.recv().await.context("a grant")?;
        latency += at - since;
        settle().await;
    }
    let jobs = f64::from(JOBS);
    println!(
        "{workers} waiting workers: a free job is leased after {:.2} ms and costs {:.0} ms of CPU time",
        1e3 * latency.as_secs_f64() / jobs,
        1e3 * (super::cpu() - before) / jobs,
    );
    Ok(())
}
