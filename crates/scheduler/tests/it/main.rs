//! The scheduler as its callers see it.

mod life;
mod machine;
mod model;
mod operations;

use std::time::Duration;

use scheduler::{Grant, Held, JobId, Options, Scheduler, WorkerId};

fn worker(name: &str) -> WorkerId {
    WorkerId(name.to_owned())
}

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

/// Leases of 10 s, two chances each, no second leases: short enough to count on fingers.
fn options() -> Options {
    Options {
        lease: at(10),
        max_crashes: 2,
        max_failures: 2,
        max_worker_strikes: 3,
        set_aside: at(100),
        duplicate_tail: false,
        duplicate_after: Duration::ZERO,
    }
}

/// A scheduler with the jobs `0..jobs`, the payload of each being its name.
fn scheduler(options: Options, jobs: u64) -> Scheduler<String> {
    let mut scheduler = Scheduler::new(options, 1);
    for id in 0..jobs {
        assert!(scheduler.add_job(JobId(id), format!("job {id}"), 0));
    }
    scheduler
}

fn ids<J>(grants: &[Grant<J>]) -> Vec<u64> {
    grants.iter().map(|grant| grant.job.0).collect()
}

fn running(job: u64, attempt: u32) -> Held {
    Held {
        job: JobId(job),
        attempt,
        started: true,
    }
}

fn waiting(job: u64, attempt: u32) -> Held {
    Held {
        job: JobId(job),
        attempt,
        started: false,
    }
}
