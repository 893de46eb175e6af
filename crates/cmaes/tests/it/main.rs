//! The search as a caller sees it: on standard functions, at bounds, and on objectives that
//! misbehave.

mod budget;
mod discrete;
mod functions;
mod restarts;
mod robustness;

use cmaes::{Bounds, CmaEs, Evaluation, Options, Restarts, RunOptions, Stop};
use stats::streams::{Purpose, StreamRng, stream};

fn rng(seed: u64) -> StreamRng {
    stream(seed, Purpose::Test, 0, 0)
}

/// (5, 10) selection and a step of 0.3, in the given bounds.
fn options(bounds: Bounds) -> Options {
    Options {
        population: 10,
        parents: 5,
        ..Options::new(bounds)
    }
}

/// A run as in the gear paper, with `evaluations` in all and a restart at `planned`.
fn planned(bounds: Bounds, evaluations: usize, planned: usize) -> RunOptions {
    RunOptions {
        search: options(bounds),
        evaluations,
        tolerance: 0.0,
        restarts: Restarts::FromBest,
        restart_at: Some(planned),
    }
}

fn cube(lower: f64, upper: f64, dimension: usize) -> Bounds {
    Bounds::new(vec![(lower, upper); dimension]).expect("the box is proper")
}

/// Runs a search until it stops or has spent `limit` evaluations.
fn run<E: Into<Evaluation> + Copy>(
    search: &mut CmaEs,
    limit: usize,
    rng: &mut StreamRng,
    f: impl Fn(&[f64]) -> E,
) -> Option<Stop> {
    while search.stop().is_none() && search.evaluations() < limit {
        let results: Vec<E> = search.ask(rng).iter().map(|x| f(x)).collect();
        search.tell(&results).expect("one result per candidate");
    }
    search.stop()
}
