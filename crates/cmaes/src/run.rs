//! A run: searches with restarts within a budget, and the best design so far.

use std::fmt;

use rand::{Rng, RngExt as _};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{CmaEs, Error, Evaluation, Options, Stop};

/// The restarts of a run after a search has stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Restarts {
    /// From the best design so far, with the same population and the initial step. While all
    /// designs have failed, the restart is from a uniformly drawn point.
    #[default]
    FromBest,
    /// From a uniformly drawn point with twice the population (A. Auger and N. Hansen, *A restart
    /// CMA evolution strategy with increasing population size*, CEC 2005).
    Ipop,
    /// Two regimes that share the budget evenly: large searches as with `"ipop"`, and
    /// small ones with the population λ₀(½ λ/λ₀)^(U²) and the step σ₀ 10^(−2U), each U uniform in
    /// 0…1, for at most half the evaluations of the last large search (N. Hansen, *Benchmarking a
    /// BI-population CMA-ES on the BBOB-2009 function testbed*, GECCO 2009).
    Bipop,
}

/// Settings of a [`Run`].
#[derive(Debug, Clone, PartialEq)]
pub struct RunOptions {
    /// Settings of the first search.
    pub search: Options,
    /// Budget of the run, restarts included.
    pub evaluations: usize,
    /// Smallest relative change of the best value that is worth more evaluations. With [`Restarts::FromBest`] a
    /// search also stops when the values of its window differ by less, and the run ends when a restart gains less.
    /// With 0 the run uses the whole budget. Other kinds of restart ignore the tolerance.
    pub tolerance: f64,
    /// The restarts after a search has stopped.
    pub restarts: Restarts,
    /// Number of evaluations after which a run with [`Restarts::FromBest`] restarts at the end of the generation,
    /// even if the search has not stopped (the gear paper plans this restart). A number that is 0 or not below the
    /// budget has no effect.
    pub restart_at: Option<usize>,
}

/// Why a run restarted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cause {
    /// The restart was planned: [`RunOptions::restart_at`].
    Planned,
    /// A small search of [`Restarts::Bipop`] used up its share of the budget.
    Share,
    /// The search stopped.
    Stopped(Stop),
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Planned => f.write_str("the restart was planned"),
            Self::Share => f.write_str("a small search used up its share"),
            Self::Stopped(stop) => stop.fmt(f),
        }
    }
}

/// One restart of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Restart {
    /// Evaluations spent before the restart.
    pub evaluations: usize,
    /// Cause of the restart.
    pub cause: Cause,
    /// Best evaluation before the restart; `None` if all had failed.
    pub best: Option<Evaluation>,
}

/// The result of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The best design, d coordinates in the caller's units.
    pub x: Vec<f64>,
    /// Objective of the best design.
    pub value: f64,
    /// Constraint violation of the best design, 0 or less if it is feasible.
    pub violation: f64,
    /// Evaluations spent.
    pub evaluations: usize,
    /// Every improvement: the number of the evaluation, from 1, and its result. The last entry is
    /// the outcome.
    pub history: Vec<(usize, Evaluation)>,
    /// Every restart, planned or not.
    pub restarts: Vec<Restart>,
}

/// A run in progress, with an ask-and-tell interface. It ends when its budget is spent, or when a restart gained less
/// than [`RunOptions::tolerance`].
#[derive(Debug, Clone)]
pub struct Run {
    options: RunOptions,
    search: CmaEs,
    best: Option<(Vec<f64>, Evaluation)>,
    evaluations: usize,
    generation: usize,
    /// Number of candidates of the last generation that fit into the budget.
    waiting: usize,
    history: Vec<(usize, Evaluation)>,
    restarts: Vec<Restart>,
    /// Whether the restart of [`RunOptions::restart_at`] is still to come.
    planned: bool,
    /// Whether a restart gained less than [`RunOptions::tolerance`].
    is_settled: bool,
    regimes: Regimes,
}

/// Evaluations spent by large and small searches, for restarts with growing populations.
#[derive(Debug, Clone)]
struct Regimes {
    /// Evaluations before the current search.
    begun_at: usize,
    /// Population of the last large search: one in the sequence of growing populations.
    large: usize,
    /// Evaluations of all large searches after the first.
    large_cost: usize,
    /// Evaluations of the last large search.
    last_large_cost: usize,
    /// Evaluations of all small searches.
    small_cost: usize,
    /// Evaluations that the current search may use, if it is a small one.
    small_budget: Option<usize>,
    is_first: bool,
}

impl Run {
    /// A run from `start` (d coordinates in the caller's units, within the bounds).
    ///
    /// # Errors
    ///
    /// [`Error::NoBudget`] without evaluations, and those of [`CmaEs::new`].
    pub fn new(start: &[f64], options: RunOptions) -> Result<Self, Error> {
        if options.evaluations == 0 {
            return Err(Error::NoBudget);
        }
        let within = |at| (1..options.evaluations).contains(&at);
        let planned =
            options.restarts == Restarts::FromBest && options.restart_at.is_some_and(within);
        Ok(Self {
            search: CmaEs::new(start, options.search.clone())?,
            best: None,
            evaluations: 0,
            generation: 0,
            waiting: 0,
            history: Vec::new(),
            restarts: Vec::new(),
            planned,
            is_settled: false,
            regimes: Regimes {
                begun_at: 0,
                large: options.search.population,
                large_cost: 0,
                last_large_cost: 0,
                small_cost: 0,
                small_budget: None,
                is_first: true,
            },
            options,
        })
    }

    /// Draws the next generation, or as many of its candidates as the budget allows; none once the
    /// run has ended.
    pub fn ask<R: Rng + ?Sized>(&mut self, rng: &mut R) -> Vec<Vec<f64>> {
        let mut candidates = self.search.ask(rng);
        candidates.truncate(self.options.evaluations - self.evaluations);
        self.waiting = candidates.len();
        candidates
    }

    /// Learns from the evaluations of the candidates last asked for, and restarts when due.
    ///
    /// # Errors
    ///
    /// [`Error::NothingAsked`] without candidates, [`Error::Count`] when `evaluations` is not one
    /// per candidate.
    pub fn tell<E, R>(&mut self, evaluations: &[E], rng: &mut R) -> Result<(), Error>
    where
        E: Into<Evaluation> + Copy,
        R: Rng + ?Sized,
    {
        let (expected, got) = (self.waiting, evaluations.len());
        if expected == 0 {
            return Err(Error::NothingAsked);
        }
        if expected != got {
            return Err(Error::Count { expected, got });
        }
        self.waiting = 0;
        self.generation += 1;
        for (x, evaluation) in self.search.candidates().zip(evaluations) {
            let evaluation: Evaluation = (*evaluation).into();
            self.evaluations += 1;
            let better = |(_, best): &(_, Evaluation)| evaluation.is_better_than(best);
            if evaluation.is_usable() && self.best.as_ref().is_none_or(better) {
                self.history.push((self.evaluations, evaluation));
                self.best = Some((x.to_vec(), evaluation));
            }
        }
        if self.is_finished() {
            return Ok(());
        }
        self.search.tell(evaluations)?;

        let reached = |at| self.evaluations >= at;
        let due = self.planned && self.options.restart_at.is_some_and(reached);
        let spent = self.evaluations - self.regimes.begun_at;
        let used_up = self
            .regimes
            .small_budget
            .is_some_and(|budget| spent >= budget);
        let cause = match self.search.stop() {
            _ if due => Some(Cause::Planned),
            _ if used_up => Some(Cause::Share),
            stop => stop.or_else(|| self.flat()).map(Cause::Stopped),
        };
        if let Some(cause) = cause {
            self.planned &= !due;
            self.is_settled = has_converged(cause) && self.has_gained_nothing();
            if self.is_settled {
                return Ok(());
            }
            self.restarts.push(Restart {
                evaluations: self.evaluations,
                cause,
                best: self.best.as_ref().map(|(_, evaluation)| *evaluation),
            });
            self.restart(rng)?;
        }
        Ok(())
    }

    /// The reason to stop a search whose values differ by less than the tolerance.
    fn flat(&self) -> Option<Stop> {
        let spread = self.search.spread()?;
        (spread < self.tolerated()).then_some(Stop::ValueTolerance { spread })
    }

    /// Whether the last restart improved the best value by less than the tolerance.
    fn has_gained_nothing(&self) -> bool {
        let before = self.restarts.last().and_then(|restart| restart.best);
        let best = self.best.as_ref();
        best.zip(before)
            .is_some_and(|((_, best), before)| best.gap(&before) < self.tolerated())
    }

    /// The tolerance in the unit of the best value; 0 unless searches restart from the best design.
    fn tolerated(&self) -> f64 {
        match (&self.best, self.options.restarts) {
            (Some((_, best)), Restarts::FromBest) => self.options.tolerance * best.magnitude(),
            _ => 0.0,
        }
    }

    fn restart<R: Rng + ?Sized>(&mut self, rng: &mut R) -> Result<(), Error> {
        let mut options = self.options.search.clone();
        let from_best = self.options.restarts == Restarts::FromBest;
        let start = match &self.best {
            Some((x, _)) if from_best => x.clone(),
            _ => {
                let unit: Vec<f64> = (0..options.bounds.dimension())
                    .map(|_| rng.random())
                    .collect();
                options.bounds.unscale(&unit)
            }
        };
        if !from_best {
            let (population, step) = self.next_regime(rng);
            // The ratio of parents to population stays the same.
            let parents = options.parents * population / options.population;
            options.parents = parents.max(1);
            options.population = population;
            options.step = step;
        }
        self.search = CmaEs::new(&start, options)?;
        Ok(())
    }

    /// Chooses population and step of the next search, from the regime that has spent less.
    fn next_regime<R: Rng + ?Sized>(&mut self, rng: &mut R) -> (usize, f64) {
        let Options {
            population, step, ..
        } = self.options.search;
        let regimes = &mut self.regimes;
        let spent = self.evaluations - regimes.begun_at;
        match regimes.small_budget {
            Some(_) => regimes.small_cost += spent,
            None if !regimes.is_first => {
                regimes.large_cost += spent;
                regimes.last_large_cost = spent;
            }
            None => {}
        }
        let was_first = std::mem::take(&mut regimes.is_first);
        regimes.begun_at = self.evaluations;
        let small = self.options.restarts == Restarts::Bipop
            && !was_first
            && regimes.small_cost < regimes.large_cost;
        if small {
            regimes.small_budget = Some(regimes.last_large_cost.max(2) / 2);
            let ratio = 0.5 * regimes.large as f64 / population as f64;
            let exponent = rng.random::<f64>().powi(2);
            let smaller = (population as f64 * ratio.powf(exponent)).floor() as usize;
            let shorter = step * 10_f64.powf(-2.0 * rng.random::<f64>());
            (smaller.max(2), shorter)
        } else {
            regimes.small_budget = None;
            // A population beyond the budget would never be ranked.
            regimes.large = (2 * regimes.large).min(self.options.evaluations.max(population));
            (regimes.large, step)
        }
    }

    /// Whether the budget is spent, or a restart gained less than [`RunOptions::tolerance`].
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.is_settled || self.evaluations >= self.options.evaluations
    }

    /// The number of generations told so far, those of all searches.
    #[must_use]
    pub fn generation(&self) -> usize {
        self.generation
    }

    /// The number of evaluations told so far.
    #[must_use]
    pub fn evaluations(&self) -> usize {
        self.evaluations
    }

    /// The number of evaluations after which the run ends at the latest.
    #[must_use]
    pub fn budget(&self) -> usize {
        self.options.evaluations
    }

    /// Every improvement so far: the number of the evaluation, from 1, and its result.
    #[must_use]
    pub fn history(&self) -> &[(usize, Evaluation)] {
        &self.history
    }

    /// Every restart so far.
    #[must_use]
    pub fn restarts(&self) -> &[Restart] {
        &self.restarts
    }

    /// The result of the run.
    ///
    /// # Errors
    ///
    /// [`Error::NothingUsable`] when all evaluations failed.
    pub fn outcome(self) -> Result<Outcome, Error> {
        let evaluations = self.evaluations;
        let (x, evaluation) = self.best.ok_or(Error::NothingUsable { evaluations })?;
        Ok(Outcome {
            x,
            value: evaluation.value,
            violation: evaluation.violation,
            evaluations,
            history: self.history,
            restarts: self.restarts,
        })
    }
}

/// Whether a search ended at an optimum. On a plateau, and where all candidates fail, another search may find more.
fn has_converged(cause: Cause) -> bool {
    matches!(
        cause,
        Cause::Stopped(
            Stop::ValueTolerance { .. } | Stop::StepTooSmall { .. } | Stop::IllConditioned { .. }
        )
    )
}
