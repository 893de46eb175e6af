//! Helpers that the entries of CMA-ES share.

use cmaes::{
    Bounds, Cause, Error, Evaluation, Options, Outcome as Found, Restarts, RunOptions, Stop,
    minimise_run,
};
use stats::streams::{Purpose, StreamRng, stream};

use crate::stability::outcome::Outcome;

pub(super) fn rng(number: u64) -> StreamRng {
    stream(23, Purpose::Test, number, 0)
}

/// A run in the unit box of `d` variables from its point (0.8, …).
pub(super) fn run<E: Into<Evaluation>>(
    d: usize,
    evaluations: usize,
    restarts: Restarts,
    seed: u64,
    mut objective: impl FnMut(&[f64]) -> E,
) -> Result<Found, Error> {
    let options = RunOptions {
        search: Options::new(Bounds::unit(d)?),
        evaluations,
        restarts,
        restart_at: None,
    };
    minimise_run(&vec![0.8; d], options, &mut rng(seed), &mut objective)
}

pub(super) const FROM_BEST: Restarts = Restarts::FromBest;

/// Records the reasons why searches of a run stopped.
pub(super) fn stops(found: &mut Outcome, run: &Found, expected: &[&str]) {
    let stops: Vec<Stop> = run
        .restarts
        .iter()
        .filter_map(|restart| match restart.cause {
            Cause::Stopped(stop) => Some(stop),
            _ => None,
        })
        .take(1)
        .collect();
    found.warned(&stops, expected);
}

pub(super) fn sphere(x: &[f64], centre: f64) -> f64 {
    x.iter().map(|x| (x - centre).powi(2)).sum()
}

pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
