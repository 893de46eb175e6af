//! One run of CMA-ES on one of the formulations.
//!
//! A run has two parts. The *printed* part is the paper's: the penalised objective (5) with its
//! static weight, a fixed number of evaluations, one restart half-way. On this simulator the
//! printed weight can be too small to be exact: then the penalised winner breaks a constraint. So
//! a run whose printed winner is infeasible *continues* with feasibility-first ranking, which needs
//! no weight, until it ends on a feasible design, and the result keeps both.
//!
//! A run may take hours. Before each generation its state can be saved as a [`Checkpoint`], from which
//! it goes on, on any worker, to the same result.

mod checkpoint;
mod objective;
#[cfg(test)]
mod tests;

use cmaes::{Bounds, Restarts, RunOptions};
use ledger::Unit;
use rand::RngExt as _;
use serde::{Deserialize, Serialize};
use stats::streams::{Purpose, StreamRng, stream};

use crate::file::Optimise;
use crate::formulation::{Approach, Criteria, Design};
use crate::simulator::Simulator;
use crate::task::{KeepGoing, Output, Run};

use checkpoint::State;
pub use checkpoint::{Checkpoint, MAX_STATE_BYTES, Saved};
use objective::{Objective, Seen};

/// How often a run whose printed winner is infeasible continues before it gives up.
const CONTINUATIONS: u32 = 10;

/// A design that a run found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Found {
    /// The design; `variables` in JSON of earlier versions.
    #[serde(alias = "variables")]
    pub design: Design,
    /// The criterion that the run minimised, µm.
    pub criterion_um: f64,
    /// Its criteria.
    pub criteria: Criteria,
    /// Whether it satisfies every constraint.
    pub feasible: bool,
}

/// One run's result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunResult {
    /// Which problem.
    pub approach: Approach,
    /// Which of its starts, from 0.
    pub start: u32,
    /// The best design by the penalised objective (5) after the printed number of evaluations, if
    /// any design could be simulated.
    pub printed: Option<Found>,
    /// The best feasible design.
    pub best: Option<Found>,
    /// How many times the run continued beyond the printed evaluations to end on a feasible design.
    pub continuations: u32,
    /// Evaluations, continuations included.
    pub evaluations: u64,
    /// Calls of the simulator: one per unworn analysis, two with Archard's wear.
    pub simulator_calls: u64,
    /// Improvements of the penalised objective: (evaluation, value).
    pub history: Vec<(u64, f64)>,
    /// Why the search restarted, besides the planned restart: (evaluation, reason).
    pub restarts: Vec<(u64, String)>,
}

/// Runs the optimiser to the end.
///
/// # Errors
///
/// A sentence: the model is missing or cannot be read, or the simulator failed. A run in which no
/// design could be simulated is a result.
pub fn run(simulator: &dyn Simulator, run: &Run) -> Result<RunResult, String> {
    let mut search = Search::new(simulator, run, None)?;
    while search.step()? {}
    Ok(search.state.result(run))
}

/// Runs the optimiser, from `saved` if given, for as long as `keep_going` says, which is asked before
/// every generation. The output is the result or, of a run that was stopped, its checkpoint; none if
/// nothing was evaluated, or if the state is larger than [`MAX_STATE_BYTES`].
///
/// # Errors
///
/// As [`run`].
pub(crate) fn run_until(
    simulator: &dyn Simulator,
    unit: &Unit,
    run: &Run,
    saved: Option<Saved>,
    keep_going: &KeepGoing<'_>,
) -> Result<Option<Output>, String> {
    let mut search = Search::new(simulator, run, saved)?;
    loop {
        let so_far = || search.state.checkpoint(unit).map(Output::Unfinished);
        if !keep_going(&so_far) {
            return Ok(so_far());
        }
        if !search.step()? {
            let result = search.state.result(run);
            return Ok(Some(Output::Run(Box::new(result))));
        }
    }
}

/// A run in progress.
struct Search<'a> {
    objective: Objective<'a>,
    settings: Optimise,
    rng: StreamRng,
    state: State,
}

impl<'a> Search<'a> {
    fn new(simulator: &'a dyn Simulator, run: &Run, saved: Option<Saved>) -> Result<Self, String> {
        let objective = Objective::new(simulator, run)?;
        let campaign = simulator.problem().campaign();
        let settings = campaign.optimise;
        let dimension = simulator.problem().dimension_of(run.approach);
        let bounds = Bounds::unit(dimension).map_err(|error| error.to_string())?;
        let mut rng = stream(
            campaign.seed,
            Purpose::Optimise,
            run.approach.number(),
            u64::from(run.start),
        );
        let state = match saved {
            Some(saved) => {
                rng.set_word_pos(saved.0.word);
                saved.0
            }
            None => {
                let origin: Vec<f64> = (0..dimension).map(|_| rng.random()).collect();
                let search = cmaes::Run::new(&origin, settings.run(bounds));
                State {
                    search: search.map_err(|error| error.to_string())?,
                    word: rng.get_word_pos(),
                    seen: Seen::default(),
                    continuations: 0,
                    evaluations: 0,
                    history: Vec::new(),
                    restarts: Vec::new(),
                }
            }
        };
        Ok(Self {
            objective,
            settings,
            rng,
            state,
        })
    }

    /// Evaluates one generation; false at the end of the run.
    fn step(&mut self) -> Result<bool, String> {
        let state = &mut self.state;
        let candidates = state.search.ask(&mut self.rng);
        let mut told = Vec::with_capacity(candidates.len());
        for unit in &candidates {
            told.push(if state.continuations == 0 {
                self.objective.printed(&mut state.seen, unit)?
            } else {
                self.objective.feasibility_first(&mut state.seen, unit)?
            });
        }
        state
            .search
            .tell(&told, &mut self.rng)
            .map_err(|error| error.to_string())?;
        let goes_on = !state.search.is_finished() || state.continue_search(&self.settings)?;
        state.word = self.rng.get_word_pos();
        Ok(goes_on)
    }
}

impl State {
    /// Ends a search whose budget is spent, and begins the one that continues the run; false at the
    /// end of the run.
    fn continue_search(&mut self, settings: &Optimise) -> Result<bool, String> {
        let finished = self.search.clone().outcome();
        let outcome = finished.map_err(|error| error.to_string())?;
        self.evaluations += outcome.evaluations as u64;
        if self.continuations == 0 {
            let improved = outcome.history.iter();
            self.history = improved.map(|(at, e)| (*at as u64, e.value)).collect();
            let restarts = outcome.restarts.iter();
            let unplanned = restarts.filter(|restart| restart.cause != cmaes::Cause::Planned);
            self.restarts = unplanned
                .map(|restart| (restart.evaluations as u64, restart.cause.to_string()))
                .collect();
        }
        // The printed winner is feasible exactly when nothing is left to do.
        let is_printed_infeasible = self
            .seen
            .printed
            .as_ref()
            .is_some_and(|(_, found)| !found.feasible);
        let is_open = self.continuations == 0
            || self.seen.best.is_none() && self.continuations < CONTINUATIONS;
        if !(is_printed_infeasible && is_open) {
            return Ok(false);
        }
        self.continuations += 1;
        let bounds = Bounds::unit(outcome.x.len()).map_err(|error| error.to_string())?;
        let least = settings.evaluations / 2;
        let mut options = RunOptions {
            evaluations: settings.restart_at.unwrap_or(least).max(least) as usize,
            restarts: Restarts::FromBest { planned: 0 },
            ..settings.run(bounds)
        };
        // The constrained optimum lies near the penalised one: look there first.
        options.search.step /= 3.0;
        let search = cmaes::Run::new(&outcome.x, options);
        self.search = search.map_err(|error| error.to_string())?;
        Ok(true)
    }

    /// The result of a run that has ended.
    fn result(self, run: &Run) -> RunResult {
        RunResult {
            approach: run.approach,
            start: run.start,
            printed: self.seen.printed.map(|(_, found)| found),
            best: self.seen.best,
            continuations: self.continuations,
            evaluations: self.evaluations,
            simulator_calls: self.seen.simulator_calls,
            history: self.history,
            restarts: self.restarts,
        }
    }
}
