//! A whole run: a budget of evaluations, a planned restart, and restarts when nothing moves.

use rand::Rng;

use crate::{Bounds, Error, Evaluation, Options, Outcome, Restarts, Run, RunOptions};

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

impl Schedule {
    /// The same for a [`Run`], whose caller evaluates a generation at a time.
    #[must_use]
    pub fn options(&self, bounds: &Bounds) -> RunOptions {
        RunOptions {
            search: Options {
                population: self.population,
                parents: self.parents,
                step: self.step,
                ..Options::new(bounds.clone())
            },
            evaluations: self.evaluations,
            restarts: Restarts::FromBest {
                planned: self.restart_at,
            },
        }
    }
}

/// Minimises `objective` over the box, from `start`, and returns the best design it evaluated.
///
/// The objective returns an `f64`, or an [`Evaluation`] with a violation to be ranked feasibility
/// first; NaN and +∞ mark designs that cannot be evaluated. It is called in a fixed order, exactly
/// [`Schedule::evaluations`] times; if the last generation does not fit into the budget, only its
/// first candidates are evaluated. The start point is a mean, and not itself evaluated.
///
/// The run restarts as planned, and besides whenever the search stops early ([`crate::Stop`]), so that the
/// budget is used. A restart is a fresh search, with the initial step, around the best design so
/// far; as long as all designs have failed, around a uniformly drawn point.
///
/// # Errors
///
/// [`Error::NoBudget`] without evaluations, [`Error::NothingUsable`] when all of them failed, and
/// those of [`CmaEs::new`](crate::CmaEs::new).
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
    minimise_run(start, schedule.options(bounds), rng, objective)
}

/// [`minimise`] with every setting of the search, and any kind of restarts.
///
/// # Errors
///
/// Those of [`minimise`].
pub fn minimise_run<E, R, F>(
    start: &[f64],
    options: RunOptions,
    rng: &mut R,
    objective: &mut F,
) -> Result<Outcome, Error>
where
    E: Into<Evaluation>,
    R: Rng + ?Sized,
    F: FnMut(&[f64]) -> E + ?Sized,
{
    let mut run = Run::new(start, options)?;
    while !run.is_finished() {
        let candidates = run.ask(rng);
        let told: Vec<Evaluation> = candidates.iter().map(|x| objective(x).into()).collect();
        run.tell(&told, rng)?;
    }
    run.outcome()
}
