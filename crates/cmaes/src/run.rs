//! A whole run as a state: searches, restarts and the best so far, within a budget.

use std::fmt;

use crate::{CmaEs, Error, Evaluation, Options, Stop};
use rand::{Rng, RngExt as _};

/// Where and how a run starts again after a search has stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Restarts {
    /// From the best design so far, with the same population and the initial step; as long as all
    /// designs have failed, from a uniformly drawn point.
    FromBest {
        /// An evaluation at which to start again whatever the state, at the end of the generation
        /// in which it is reached: the gear paper's plan. 0, or the budget and more, means none.
        planned: usize,
    },
    /// From a uniformly drawn point with twice the population (A. Auger and N. Hansen, *A restart
    /// CMA evolution strategy with increasing population size*, CEC 2005).
    Ipop,
    /// In turns that share the budget evenly: as with [`Restarts::Ipop`], and with a small
    /// population λ₀(½ λ/λ₀)^(U²) and step σ₀ 10^(−2U), U uniform in 0…1 each, for at most half the
    /// evaluations of the last large search (N. Hansen, *Benchmarking a BI-population CMA-ES on the
    /// BBOB-2009 function testbed*, GECCO 2009).
    Bipop,
}

/// How to spend a budget of evaluations.
#[derive(Debug, Clone, PartialEq)]
pub struct RunOptions {
    /// The first search's settings.
    pub search: Options,
    /// All evaluations of the run, restarts included; every one of them is used.
    pub evaluations: usize,
    /// What follows when a search stops.
    pub restarts: Restarts,
}

/// Why a run restarted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cause {
    /// The options said so.
    Planned,
    /// A small search of [`Restarts::Bipop`] used up its share of the budget.
    Share,
    /// The search had nothing more to gain.
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
    /// The evaluations spent before it.
    pub evaluations: usize,
    /// Why it came.
    pub cause: Cause,
    /// The best evaluation before it; none if all had failed.
    pub best: Option<Evaluation>,
}

/// What a run found.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The best design, d coordinates in the caller's units.
    pub x: Vec<f64>,
    /// Its objective.
    pub value: f64,
    /// Its violation, 0 or less if it is feasible.
    pub violation: f64,
    /// The evaluations spent: always the whole budget.
    pub evaluations: usize,
    /// Every improvement: the evaluation (from 1) that brought it, and its result. The last entry
    /// is the outcome.
    pub history: Vec<(usize, Evaluation)>,
    /// Every restart, planned or not.
    pub restarts: Vec<Restart>,
}

/// A run in progress, with an ask-and-tell interface. It ends when its budget is spent.
#[derive(Debug, Clone)]
pub struct Run {
    options: RunOptions,
    search: CmaEs,
    best: Option<(Vec<f64>, Evaluation)>,
    evaluations: usize,
    generation: usize,
    /// How many candidates of the last generation fit into the budget.
    waiting: usize,
    history: Vec<(usize, Evaluation)>,
    restarts: Vec<Restart>,
    planned: bool,
    turns: Turns,
}

/// The bookkeeping of restarts with growing populations.
#[derive(Debug, Clone)]
struct Turns {
    /// The evaluations before the current search.
    begun_at: usize,
    /// The population of the last search in the sequence of growing ones.
    large: usize,
    /// The evaluations of all large searches after the first, and of the last of them.
    large_cost: usize,
    last_large_cost: usize,
    /// The evaluations of all small searches.
    small_cost: usize,
    /// The evaluations that the current search may use, if it is a small one.
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
        let planned = matches!(options.restarts,
            Restarts::FromBest { planned } if (1..options.evaluations).contains(&planned));
        Ok(Self {
            search: CmaEs::new(start, options.search.clone())?,
            best: None,
            evaluations: 0,
            generation: 0,
            waiting: 0,
            history: Vec::new(),
            restarts: Vec::new(),
            planned,
            turns: Turns {
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

    /// Draws the next generation, or what of it the budget allows; nothing once the run has ended.
    pub fn ask<R: Rng + ?Sized>(&mut self, rng: &mut R) -> Vec<Vec<f64>> {
        let mut candidates = self.search.ask(rng);
        candidates.truncate(self.options.evaluations - self.evaluations);
        self.waiting = candidates.len();
        candidates
    }

    /// Learns from the evaluations of the candidates last asked for, and restarts if it is time.
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
        for (x, evaluation) in self.search.waiting().zip(evaluations) {
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

        let due = match self.options.restarts {
            Restarts::FromBest { planned } => self.planned && self.evaluations >= planned,
            _ => false,
        };
        let spent = self.evaluations - self.turns.begun_at;
        let used_up = self
            .turns
            .small_budget
            .is_some_and(|budget| spent >= budget);
        let cause = match self.search.stop() {
            _ if due => Some(Cause::Planned),
            _ if used_up => Some(Cause::Share),
            stop => stop.map(Cause::Stopped),
        };
        if let Some(cause) = cause {
            self.planned &= !due;
            self.restarts.push(Restart {
                evaluations: self.evaluations,
                cause,
                best: self.best.as_ref().map(|(_, evaluation)| *evaluation),
            });
            self.restart(rng)?;
        }
        Ok(())
    }

    fn restart<R: Rng + ?Sized>(&mut self, rng: &mut R) -> Result<(), Error> {
        let mut options = self.options.search.clone();
        let from_best = matches!(self.options.restarts, Restarts::FromBest { .. });
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
            let (population, step) = self.next_turn(rng);
            // The parents keep their share.
            let parents = options.parents * population / options.population;
            options.parents = parents.max(1);
            options.population = population;
            options.step = step;
        }
        self.search = CmaEs::new(&start, options)?;
        Ok(())
    }

    /// Population and step of the next search, with the regime that has had less of the budget.
    fn next_turn<R: Rng + ?Sized>(&mut self, rng: &mut R) -> (usize, f64) {
        let Options {
            population, step, ..
        } = self.options.search;
        let turns = &mut self.turns;
        let spent = self.evaluations - turns.begun_at;
        match turns.small_budget {
            Some(_) => turns.small_cost += spent,
            None if !turns.is_first => {
                turns.large_cost += spent;
                turns.last_large_cost = spent;
            }
            None => {}
        }
        let was_first = std::mem::take(&mut turns.is_first);
        turns.begun_at = self.evaluations;
        let small = self.options.restarts == Restarts::Bipop
            && !was_first
            && turns.small_cost < turns.large_cost;
        if small {
            turns.small_budget = Some(turns.last_large_cost.max(2) / 2);
            let ratio = 0.5 * turns.large as f64 / population as f64;
            let exponent = rng.random::<f64>().powi(2);
            let smaller = (population as f64 * ratio.powf(exponent)).floor() as usize;
            let shorter = step * 10_f64.powf(-2.0 * rng.random::<f64>());
            (smaller.max(2), shorter)
        } else {
            turns.small_budget = None;
            // No population beyond the budget: it would never be ranked.
            turns.large = (2 * turns.large).min(self.options.evaluations.max(population));
            (turns.large, step)
        }
    }

    /// Whether the budget is spent.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.evaluations >= self.options.evaluations
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

    /// The number of evaluations with which the run ends.
    #[must_use]
    pub fn budget(&self) -> usize {
        self.options.evaluations
    }

    /// Every improvement so far: the evaluation (from 1) that brought it, and its result.
    #[must_use]
    pub fn history(&self) -> &[(usize, Evaluation)] {
        &self.history
    }

    /// Every restart so far.
    #[must_use]
    pub fn restarts(&self) -> &[Restart] {
        &self.restarts
    }

    /// What the run has found.
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
