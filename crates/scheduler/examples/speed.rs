//! What a call costs on a busy scheduler: 100 000 jobs queued, 2000 leased, 1000 workers.
//!
//! `cargo run --release -p scheduler --example speed`

#![expect(clippy::print_stdout, reason = "a measurement for people")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use scheduler::{Held, JobId, Options, Scheduler, WorkerId};

const WORKERS: u64 = 1000;
const QUEUED: u64 = 100_000;
const PER_WORKER: usize = 2;
const ROUNDS: u64 = 20;

/// Calls and the time they took.
#[derive(Default)]
struct Cost {
    calls: u64,
    time: Duration,
}

impl Cost {
    fn of<T>(&mut self, calls: u64, act: impl FnOnce() -> T) -> T {
        let since = Instant::now();
        let result = black_box(act());
        self.time += since.elapsed();
        self.calls += calls;
        result
    }

    fn print(&self, what: &str) {
        let each = self.time.as_nanos() as f64 / self.calls as f64;
        println!("{what:40} {each:>10.0} ns");
    }
}

fn main() {
    let workers: Vec<WorkerId> = (0..WORKERS)
        .map(|index| {
            WorkerId(format!(
                "{:032x}",
                index.wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ))
        })
        .collect();
    let mut scheduler = Scheduler::new(Options::default(), 1);
    let mut next_job = 0;
    let [
        mut add,
        mut lease,
        mut heartbeat,
        mut expire_none,
        mut complete,
        mut forget,
        mut expire,
        mut tail,
    ] = [const {
        Cost {
            calls: 0,
            time: Duration::ZERO,
        }
    }; 8];
    let mut now = Duration::ZERO;
    for _ in 0..ROUNDS {
        let missing = QUEUED - scheduler.queued() as u64;
        add.of(missing, || {
            for _ in 0..missing {
                scheduler.add_job(JobId(next_job), next_job, 0);
                next_job += 1;
            }
        });
        now += Duration::from_secs(1);
        let mut held = Vec::new();
        for worker in &workers {
            held.push(lease.of(1, || scheduler.lease(worker, PER_WORKER, now)));
        }
        now += Duration::from_secs(1);
        for (worker, grants) in workers.iter().zip(&held) {
            let named: Vec<Held> = grants
                .iter()
                .map(|grant| Held {
                    job: grant.job,
                    attempt: grant.attempt,
                    started: true,
                })
                .collect();
            heartbeat.of(1, || scheduler.heartbeat(worker, &named, now));
            expire_none.of(1, || scheduler.expire(now));
        }
        for (worker, grants) in workers.iter().zip(&held) {
            for grant in grants {
                complete.of(1, || {
                    scheduler.complete(worker, grant.job, grant.attempt, now)
                });
                forget.of(1, || scheduler.forget(grant.job));
            }
        }
    }
    for worker in &workers {
        scheduler.lease(worker, PER_WORKER, now);
    }
    let leased = scheduler.counts().leased as u64;
    expire.of(leased, || scheduler.expire(now + Duration::from_secs(3600)));

    // The end of a campaign: everything is leased, and workers without a job ask for second leases.
    let mut scheduler = Scheduler::new(Options::default(), 1);
    for job in 0..2 * WORKERS {
        scheduler.add_job(JobId(job), job, 0);
    }
    for worker in &workers {
        scheduler.lease(worker, PER_WORKER, now);
    }
    for index in 0..WORKERS {
        let idle = WorkerId(format!("idle {index}"));
        tail.of(1, || scheduler.lease(&idle, 1, now));
    }

    add.print("add a job");
    lease.print("lease two jobs");
    heartbeat.print("heartbeat with two jobs");
    expire_none.print("expire, when nothing has run out");
    complete.print("complete a job");
    forget.print("forget a job");
    expire.print("expire, per lease that ran out");
    tail.print("a second lease at the end");
}
