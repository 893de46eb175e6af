//! Helpers that the entries of CMA-ES share.

use cmaes::{
    Bounds, Cause, CmaEs, Error, Evaluation, Options, Outcome as RunOutcome, Restarts, RunOptions,
    Stop, minimise_run,
};
use stats::streams::{Purpose, StreamRng, stream};

use crate::stability::outcome::Outcome;

pub(super) fn rng(number: u64) -> StreamRng {
    stream(23, Purpose::Test, number, 0)
}

/// Runs a search with restarts in the unit box of `d` variables, from (0.8, …).
pub(super) fn run<E: Into<Evaluation>>(
    d: usize,
    evaluations: usize,
    restarts: Restarts,
    seed: u64,
    mut objective: impl FnMut(&[f64]) -> E,
) -> Result<RunOutcome, Error> {
    let options = RunOptions {
        search: Options::new(Bounds::unit(d)?),
        evaluations,
        tolerance: 0.0,
        restarts,
        restart_at: None,
    };
    minimise_run(&vec![0.8; d], options, &mut rng(seed), &mut objective)
}

pub(super) const FROM_BEST: Restarts = Restarts::FromBest;

/// Options with (5, 10) selection and a step of 0.3.
pub(super) fn ten_candidates(bounds: Bounds) -> Options {
    Options {
        population: 10,
        parents: 5,
        ..Options::new(bounds)
    }
}

/// A search without restarts, with its best evaluations by the number of evaluations.
pub(super) struct Search {
    pub(super) cma_es: CmaEs,
    pub(super) history: Vec<(usize, Evaluation)>,
}

impl Search {
    /// Runs until the search stops or has spent `limit` evaluations.
    pub(super) fn run<E: Into<Evaluation> + Copy>(
        start: &[f64],
        options: Options,
        limit: usize,
        seed: u64,
        objective: impl Fn(&[f64]) -> E,
    ) -> Result<Self, Error> {
        let mut cma_es = CmaEs::new(start, options)?;
        let mut history: Vec<(usize, Evaluation)> = Vec::new();
        let mut rng = rng(seed);
        while cma_es.stop().is_none() && cma_es.evaluations() < limit {
            let candidates = cma_es.ask(&mut rng);
            let evaluations: Vec<E> = candidates.iter().map(|x| objective(x)).collect();
            cma_es.tell(&evaluations)?;
            if let Some((_, best)) = cma_es.best()
                && history
                    .last()
                    .is_none_or(|(_, last)| best.is_better_than(last))
            {
                history.push((cma_es.evaluations(), best));
            }
        }
        Ok(Self { cma_es, history })
    }

    /// The best evaluation; infinite without one.
    pub(super) fn best(&self) -> Evaluation {
        let failure = Evaluation::from(f64::INFINITY);
        self.history.last().map_or(failure, |(_, best)| *best)
    }

    /// The number of evaluations until a feasible value of at most `value`.
    pub(super) fn evaluations_to(&self, value: f64) -> f64 {
        let mut feasible = self.history.iter().filter(|(_, best)| best.is_feasible());
        let first = feasible.find(|(_, best)| best.value <= value);
        first.map_or(f64::INFINITY, |(at, _)| *at as f64)
    }
}

/// Records why the first search of a run stopped.
pub(super) fn stops(outcome: &mut Outcome, run: &RunOutcome, expected: &[&str]) {
    let stops: Vec<Stop> = run
        .restarts
        .iter()
        .filter_map(|restart| match restart.cause {
            Cause::Stopped(stop) => Some(stop),
            _ => None,
        })
        .take(1)
        .collect();
    outcome.warned(&stops, expected);
}

pub(super) fn sphere(x: &[f64], centre: f64) -> f64 {
    x.iter().map(|x| (x - centre).powi(2)).sum()
}
