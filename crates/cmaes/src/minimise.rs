//! A whole run: a budget of evaluations, a planned restart, and restarts when nothing moves.

use rand::{Rng, RngExt as _};

use crate::{Bounds, CmaEs, Error, Evaluation, Options, Stop};

/// How a run spends its evaluations. The default is the gear paper's.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    /// All evaluations of the run, restarts included; every one of them is used.
    pub evaluations: usize,
    /// The evaluation at which the run restarts, whatever its state, from the best design so far
    /// with the initial step; at the end of the generation in which the number is reached. 0, or
    /// `evaluations` and more, means no planned restart.
    pub restart_at: usize,
    /// The initial step size and that of each restart, as a fraction of the range.
    pub step: f64,
    /// The candidates of one generation, λ.
    pub population: usize,
    /// How many of them make the next mean, µ.
    pub parents: usize,
}

impl Default for Schedule {
    /// 12 000 evaluations, restart at 6 000, step 0.3, (5, 10) selection. The paper speaks of "10
    /// parents and 5 child designs"; CMA-ES needs more children than parents, so the two numbers
    /// are read the other way round.
    fn default() -> Self {
        Self {
            evaluations: 12_000,
            restart_at: 6_000,
            step: 0.3,
            population: 10,
            parents: 5,
        }
    }
}

/// Why a run restarted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cause {
    /// The schedule said so.
    Planned,
    /// The search had nothing more to gain.
    Stopped(Stop),
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

/// Minimises `objective` over the box, from `start`, and returns the best design it evaluated.
///
/// The objective returns an `f64`, or an [`Evaluation`] with a violation to be ranked feasibility
/// first; NaN and +∞ mark designs that cannot be evaluated. It is called in a fixed order, exactly
/// [`Schedule::evaluations`] times; if the last generation does not fit into the budget, only its
/// first candidates are evaluated. The start point is a mean, and not itself evaluated.
///
/// The run restarts as planned, and besides whenever the search stops early ([`Stop`]), so that the
/// budget is used. A restart is a fresh search, with the initial step, around the best design so
/// far; as long as all designs have failed, around a uniformly drawn point.
///
/// # Errors
///
/// [`Error::NoBudget`] without evaluations, [`Error::NothingUsable`] when all of them failed, and
/// those of [`CmaEs::new`].
pub fn minimise<E, R, F>(
    start: &[f64],
    bounds: &Bounds,
    schedule: &Schedule,
    rng: &mut R,
    objective: &mut F,
) -> Result<Outcome, Error>
where
    E: Into<Evaluation>,
    R: Rng + ?Sized,
    F: FnMut(&[f64]) -> E + ?Sized,
{
    if schedule.evaluations == 0 {
        return Err(Error::NoBudget);
    }
    let options = Options {
        population: schedule.population,
        parents: schedule.parents,
        step: schedule.step,
        ..Options::new(bounds.clone())
    };
    let mut search = CmaEs::new(start, options.clone())?;
    let mut best: Option<(Vec<f64>, Evaluation)> = None;
    let mut evaluations = 0;
    let mut history = Vec::new();
    let mut restarts = Vec::new();
    let mut planned = (1..schedule.evaluations).contains(&schedule.restart_at);

    loop {
        let mut told = Vec::with_capacity(schedule.population);
        for x in search
            .ask(rng)
            .into_iter()
            .take(schedule.evaluations - evaluations)
        {
            let evaluation: Evaluation = objective(&x).into();
            evaluations += 1;
            told.push(evaluation);
            let better = best
                .as_ref()
                .is_none_or(|(_, best)| evaluation.is_better_than(best));
            if evaluation.is_usable() && better {
                history.push((evaluations, evaluation));
                best = Some((x, evaluation));
            }
        }
        if evaluations == schedule.evaluations {
            break;
        }
        search.tell(&told)?;

        let due = planned && evaluations >= schedule.restart_at;
        let cause = match search.stop() {
            _ if due => Some(Cause::Planned),
            stop => stop.map(Cause::Stopped),
        };
        if let Some(cause) = cause {
            planned &= !due;
            let best_so_far = best.as_ref().map(|(_, evaluation)| *evaluation);
            restarts.push(Restart {
                evaluations,
                cause,
                best: best_so_far,
            });
            let start = match &best {
                Some((x, _)) => x.clone(),
                None => {
                    let unit: Vec<f64> = start.iter().map(|_| rng.random()).collect();
                    bounds.unscale(&unit)
                }
            };
            search = CmaEs::new(&start, options.clone())?;
        }
    }

    let (x, Evaluation { value, violation }) = best.ok_or(Error::NothingUsable { evaluations })?;
    Ok(Outcome {
        x,
        value,
        violation,
        evaluations,
        history,
        restarts,
    })
}
