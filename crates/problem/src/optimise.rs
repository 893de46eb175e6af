//! One run of CMA-ES on one of the formulations.
//!
//! A run has two parts. The *printed* part is the paper's: the penalised objective (5) with its
//! static weight, a fixed number of evaluations, and one restart half-way. With this simulator the
//! printed weight can be too small to be exact, and the penalised optimum then violates a
//! constraint. Therefore a run whose printed optimum is infeasible *continues* with
//! feasibility-first ranking, which needs no weight, until it ends at a feasible design. The result
//! has both optima.
//!
//! The built-in simulator takes microseconds, so one worker computes a whole run ([`run`]). An
//! external one may take hours for each evaluation, so the coordinator keeps the [`Search`] and
//! leases one generation of candidates at a time to the workers. The store keeps their answers, so
//! an interrupted search is recomputed from them with the same result.

mod objective;
mod run;
#[cfg(test)]
mod tests;

use cmaes::{Bounds, Restarts, RunOptions};
use rand::RngExt as _;
use stats::streams::{Purpose, StreamRng, stream};

use crate::file::{Aim, Optimise};
use crate::formulation::{Approach, Problem};
use crate::simulator::{NoAnswer, Simulator};

pub use objective::{Answer, COMMON, Candidate, answer};
use objective::{Objective, Record};
pub use run::{Run, RunResult, Solution};

/// Maximum number of times that a run with an infeasible printed optimum continues.
const CONTINUATIONS: u32 = 10;

/// The first number of the random streams of additional searches, above those of approaches.
const BESIDE: u64 = 1 << 20;

/// Runs the optimiser to the end.
///
/// # Errors
///
/// A sentence: the model is missing or cannot be read, or the simulator failed. A run without any
/// simulable design is a result, not an error.
pub fn run(simulator: &dyn Simulator, run: &Run) -> Result<RunResult, String> {
    let search = Search::new(simulator.problem(), run)?;
    ended(simulator, run, search)
}

/// Like [`run`], but ends with its budget, even without a feasible design.
///
/// # Errors
///
/// As [`run`].
pub fn trial(simulator: &dyn Simulator, run: &Run) -> Result<RunResult, String> {
    let search = Search::beside(simulator.problem(), run, 0)?;
    ended(simulator, run, search)
}

/// Runs a search to its end and returns the result.
fn ended(simulator: &dyn Simulator, run: &Run, search: Search) -> Result<RunResult, String> {
    let result = search.run_while(simulator, run, &|| true);
    let result = result.map_err(|error| error.to_string())?;
    result.ok_or_else(|| "the run was stopped".to_owned())
}

/// Like [`run`], but stops when `keep_going`, which is called before every generation, returns
/// false. Returns `None` if it was stopped.
///
/// # Errors
///
/// As [`run`].
pub(crate) fn run_while(
    simulator: &dyn Simulator,
    run: &Run,
    keep_going: &dyn Fn() -> bool,
) -> Result<Option<RunResult>, NoAnswer> {
    let search = Search::new(simulator.problem(), run).map_err(NoAnswer::Failed)?;
    search.run_while(simulator, run, keep_going)
}

/// A run in progress.
pub struct Search {
    objective: Objective,
    aim: Aim,
    settings: Optimise,
    start: u32,
    /// Number of values of each coordinate, 0 of a continuous one.
    cells: Vec<usize>,
    /// The point of the search space that is evaluated before the first generation.
    first: Option<Vec<f64>>,
    /// The value of that point, once it is known.
    first_value: Option<f64>,
    rng: StreamRng,
    search: cmaes::Run,
    seen: Record,
    /// Number of times that the run has continued beyond the printed evaluations.
    continuations: u32,
    /// Maximum number of continuations.
    most_continuations: u32,
    /// Number of evaluations of the searches before this one.
    evaluations: u64,
    /// The improvements and restarts of the printed search, after its end.
    history: Vec<(u64, f64)>,
    restarts: Vec<(u64, String)>,
}

impl Search {
    /// Starts a run.
    ///
    /// # Errors
    ///
    /// A sentence: the model is missing or cannot be read, or the approach has no runs.
    pub fn new(problem: &Problem, run: &Run) -> Result<Self, String> {
        Self::begin(problem, run, run.approach.number(), CONTINUATIONS)
    }

    /// Starts a search in addition to the runs of the campaign; `number` distinguishes it from others of the same
    /// start. It ends with its budget, even without a feasible design.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn beside(problem: &Problem, run: &Run, number: u64) -> Result<Self, String> {
        Self::begin(problem, run, BESIDE + number, 0)
    }

    fn begin(
        problem: &Problem,
        run: &Run,
        streams: u64,
        most_continuations: u32,
    ) -> Result<Self, String> {
        let objective = Objective::new(problem, run)?;
        let campaign = problem.campaign();
        let settings = campaign.optimise;
        let dimension = problem.dimension_of(run.approach);
        let bounds = Bounds::unit(dimension).map_err(|error| error.to_string())?;
        let mut rng = stream(
            campaign.seed,
            Purpose::Optimise,
            streams,
            u64::from(run.start),
        );
        let mut origin: Vec<f64> = (0..dimension).map(|_| rng.random()).collect();
        let unit_point = |x: &[f64]| {
            let mut unit = problem.unit_point(x);
            // Rounding may leave the box.
            unit.iter_mut().for_each(|u| *u = u.clamp(0.0, 1.0));
            unit
        };
        let from = run.from.as_ref();
        let from = from.map(|design| unit_point(&problem.free_values(design)));
        let mut options = settings.run(bounds);
        options.search.cells = problem.cells(run.approach);
        let mut first = None;
        match (run.approach, from) {
            (Approach::Kriging, Some(from)) => {
                origin.clone_from(&from);
                options.evaluations = (options.evaluations - 1).max(1);
                first = Some(from);
            }
            (Approach::Direct, Some(from)) => {
                origin = from;
                // The best design lies near the start, which is good already.
                options.search.step /= 3.0;
            }
            // The user's own designs do not fit an approach that varies more variables than the DoE.
            (_, None) if dimension == problem.dimension() => {
                let own = campaign.doe.points.get(run.start as usize);
                origin = own.map_or(origin, |x| unit_point(x));
            }
            _ => {}
        }
        let search = cmaes::Run::new(&origin, options);
        Ok(Self {
            objective,
            aim: problem.aim(),
            settings,
            start: run.start,
            cells: problem.cells(run.approach),
            first,
            first_value: None,
            rng,
            search: search.map_err(|error| error.to_string())?,
            seen: Record::default(),
            continuations: 0,
            most_continuations,
            evaluations: 0,
            history: Vec::new(),
            restarts: Vec::new(),
        })
    }

    /// Evaluates one generation after the other in this thread, as long as `keep_going` returns true.
    fn run_while(
        mut self,
        simulator: &dyn Simulator,
        run: &Run,
        keep_going: &dyn Fn() -> bool,
    ) -> Result<Option<RunResult>, NoAnswer> {
        let problem = simulator.problem();
        loop {
            if !keep_going() {
                return Ok(None);
            }
            // One after the other, because the questions about a candidate depend on the best one
            // before it.
            let mut told = Vec::new();
            for unit in self.draw() {
                let candidate = self.candidate(problem, unit);
                let answered = match &candidate.design {
                    Some(design) if candidate.is_asked => {
                        match answer(simulator, run.approach, design, candidate.may_improve) {
                            Ok(answer) => Some(answer),
                            Err(NoAnswer::Refused(_)) => None,
                            Err(NoAnswer::Failed(error)) => {
                                let calls = self.seen.simulator_calls;
                                let error = format!("simulator call {calls}: {error}");
                                return Err(NoAnswer::Failed(error));
                            }
                            Err(machine) => return Err(machine),
                        }
                    }
                    _ => None,
                };
                told.push(self.evaluation(problem, &candidate, answered));
            }
            if !self.tell(&told).map_err(NoAnswer::Failed)? {
                return Ok(Some(self.result()));
            }
        }
    }

    /// The next generation, to be evaluated in any order.
    pub fn ask(&mut self, problem: &Problem) -> Vec<Candidate> {
        let drawn = self.draw();
        let candidates = drawn.into_iter();
        candidates
            .map(|unit| self.candidate(problem, unit))
            .collect()
    }

    /// Continues with the answers for the last generation, in its order. An answer is `None` for a
    /// candidate that is not simulable or need not be evaluated. Returns false at the end of the
    /// run.
    ///
    /// # Errors
    ///
    /// A sentence: the search cannot continue.
    pub fn answered(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
        answers: Vec<Option<Answer>>,
    ) -> Result<bool, String> {
        let pairs = candidates.iter().zip(answers);
        let told: Vec<cmaes::Evaluation> = pairs
            .map(|(candidate, answer)| self.evaluation(problem, candidate, answer))
            .collect();
        self.tell(&told)
    }

    fn draw(&mut self) -> Vec<Vec<f64>> {
        match &self.first {
            Some(first) => vec![first.clone()],
            None => self.search.ask(&mut self.rng),
        }
    }

    fn candidate(&self, problem: &Problem, unit: Vec<f64>) -> Candidate {
        self.objective.candidate(problem, &self.seen, &unit)
    }

    fn evaluation(
        &mut self,
        problem: &Problem,
        candidate: &Candidate,
        answer: Option<Answer>,
    ) -> cmaes::Evaluation {
        let is_printed = self.continuations == 0;
        let seen = &mut self.seen;
        self.objective
            .evaluation(problem, seen, candidate, answer, is_printed)
    }

    /// Passes evaluations to the search. Returns false at the end of the run.
    fn tell(&mut self, told: &[cmaes::Evaluation]) -> Result<bool, String> {
        if self.first.take().is_some() {
            self.evaluations += 1;
            let valid = told
                .first()
                .filter(|evaluation| evaluation.violation == 0.0);
            self.first_value = valid.map(|evaluation| evaluation.value);
            return Ok(true);
        }
        self.search
            .tell(told, &mut self.rng)
            .map_err(|error| error.to_string())?;
        Ok(!self.search.is_finished() || self.continue_search()?)
    }

    /// Ends a search whose budget is spent, and starts the next one if the run continues. Returns
    /// false at the end of the run.
    fn continue_search(&mut self) -> Result<bool, String> {
        let finished = self.search.clone().outcome();
        let outcome = finished.map_err(|error| error.to_string())?;
        self.evaluations += outcome.evaluations as u64;
        if self.continuations == 0 {
            self.history = self.values(&outcome.history);
            let restarts = outcome.restarts.iter();
            let unplanned = restarts.filter(|restart| restart.cause != cmaes::Cause::Planned);
            self.restarts = unplanned
                .map(|restart| (restart.evaluations as u64, restart.cause.to_string()))
                .collect();
        }
        // If the printed optimum is feasible, the run is complete.
        let is_printed_infeasible = self
            .seen
            .printed
            .as_ref()
            .is_some_and(|(_, found)| !found.feasible);
        let is_open = self.continuations < self.most_continuations
            && (self.continuations == 0 || self.seen.best.is_none());
        if !(is_printed_infeasible && is_open) {
            return Ok(false);
        }
        self.continuations += 1;
        let bounds = Bounds::unit(outcome.x.len()).map_err(|error| error.to_string())?;
        let least = self.settings.evaluations / 2;
        let mut options = RunOptions {
            evaluations: self.settings.restart_at.unwrap_or(least).max(least) as usize,
            restarts: Restarts::FromBest,
            restart_at: None,
            ..self.settings.run(bounds)
        };
        // The constrained optimum lies near the penalised one, so the search begins there with a
        // shorter step.
        options.search.step /= 3.0;
        options.search.cells.clone_from(&self.cells);
        let search = cmaes::Run::new(&outcome.x, options);
        self.search = search.map_err(|error| error.to_string())?;
        Ok(true)
    }

    /// The number of evaluations so far.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        self.evaluations + self.search.evaluations() as u64
    }

    /// The number of evaluations at which the search ends, unless it has to continue.
    #[must_use]
    pub fn budget(&self) -> u64 {
        self.evaluations + self.search.budget() as u64
    }

    /// The improvements so far, as in [`RunResult::history`].
    #[must_use]
    pub fn history(&self) -> Vec<(u64, f64)> {
        match self.continuations {
            0 => self.values(self.search.history()),
            _ => self.history.clone(),
        }
    }

    /// A search's improvements, in the sign of the response.
    fn values(&self, history: &[(usize, cmaes::Evaluation)]) -> Vec<(u64, f64)> {
        let value = |cost: f64| match self.aim {
            Aim::Minimise => cost,
            Aim::Maximise => -cost,
        };
        let Some(first) = self.first_value else {
            let improved = history.iter();
            return improved
                .map(|(at, e)| (*at as u64, value(e.value)))
                .collect();
        };
        // The point before the first generation is evaluation 1.
        let better = history.iter().filter(|(_, e)| e.value < first);
        let better = better.map(|(at, e)| (*at as u64 + 1, value(e.value)));
        std::iter::once((1, value(first))).chain(better).collect()
    }

    /// The result of a run that has ended.
    #[must_use]
    pub fn result(self) -> RunResult {
        RunResult {
            approach: self.objective.approach(),
            start: self.start,
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
