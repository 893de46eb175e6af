//! A whole run with a function as its objective.

use rand::Rng;

use crate::{Error, Evaluation, Outcome, Run, RunOptions};

/// Minimises `objective` over the box, from `start`, and returns the best design it evaluated.
///
/// The objective returns an `f64`, or an [`Evaluation`] with a violation, which ranks feasibility first; NaN and +∞
/// mark designs that cannot be evaluated. The objective is called in a fixed order, at most
/// [`RunOptions::evaluations`] times: fewer only if a restart gains less than [`RunOptions::tolerance`]. If the last
/// generation does not fit into the budget, only its first candidates are evaluated. The start point is the first
/// mean and is not evaluated itself.
///
/// # Errors
///
/// [`Error::NoBudget`] without evaluations, [`Error::NothingUsable`] when all of them failed, and
/// those of [`CmaEs::new`](crate::CmaEs::new).
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
