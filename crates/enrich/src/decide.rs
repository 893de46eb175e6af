//! One round: from rows to infill points, a recommendation and perhaps a reason to stop.

use std::sync::atomic::AtomicU64;

use crate::batch::Batch;
use crate::confirm::confirm;
use crate::context::Context;
use crate::fill::fill;
use crate::models::Regions;
use crate::simulability::SimulabilityModel;
use crate::state::Rows;
use crate::stop::{failed_rounds, stop_after_search, stop_before_search};
use crate::{Decision, Error, ExactCriteria, Note, Options, State};

/// Decides the next round.
///
/// `exact` evaluates the cheap deterministic criteria of a design: the violation of the constraints
/// (in the caller's units; 0 or less is feasible) and a [baseline](ExactCriteria::baseline) of the
/// response if there is one. It returns `None` if the design cannot be evaluated. No surrogate
/// stands in for it. It is called from several threads (rayon's).
///
/// **Models.** One model is fitted to all designs. Another one is fitted around each of the [`Options::basins`] best
/// designs that are at least 15 % of a range apart, to the [`Options::local_points`] nearest designs; it replaces the
/// first one there if its leave-one-out residuals are smaller. Every model is fitted on each scale that the responses
/// allow: the response itself, its logarithm if all responses are positive, and its difference from the baseline if
/// there are baselines. In each basin the model of every scale is a region of its own to search; the one with the
/// smallest residuals recommends a design. The whole box is searched with the model that predicts left-out responses
/// with the highest density.
///
/// **Regions.** Infill points are sought in the basins' trust regions in turn, boxes around the
/// [`Options::region_points`] nearest designs, which shrink as designs gather. Every
/// [`Options::global_every`]-th point is sought in the whole box. Improvement in a basin is counted
/// from the basin's own best design; the search leaves a basin in which less than a quarter of δ is
/// expected. If a batch is too small for all regions, the next round goes on with those that had no
/// turn. A round that would report an expectation below δ first consults the regions that had no
/// turn. So [`Stop::Converged`](crate::Stop) holds for every basin and the whole box; this costs
/// one search a region.
///
/// **Failures.** The value of a new design is multiplied by the probability that it can be simulated, which
/// kriging of an indicator predicts from the simulated and the failed designs.
///
/// **Batch.** The batch is built point by point, and each observation is assumed to come out as
/// predicted (kriging believer: D. Ginsbourger, R. Le Riche, L. Carraro, *Kriging is well-suited to
/// parallelize optimization*, 2010). For each observation the best new design competes with more
/// samples at existing designs, by the criterion's value **per sample**. A round without a
/// worthwhile observation gives the recommended design as many samples as its interval needs.
///
/// The result is a function of the arguments alone, whatever the number of threads.
///
/// # Errors
///
/// [`Error::Design`], [`Error::Variance`] and [`Error::Setting`] for unusable rows and settings. A
/// model that cannot be fitted is a note, not an error.
pub fn decide<F, K>(state: &State, options: &Options, exact: &F) -> Result<Decision, Error>
where
    F: Fn(&[f64]) -> Option<K> + Sync,
    K: Into<ExactCriteria>,
{
    options.check()?;
    let rows = Rows::new(state, options)?;
    let context = Context {
        simulability: SimulabilityModel::fit(&rows, options),
        rows,
        options,
        round: state.rounds.len(),
        exact: &|x: &[f64]| exact(x).map(Into::into),
        evaluations: AtomicU64::new(0),
    };
    let mut batch = Batch {
        infill: Vec::new(),
        left: options.samples_left,
        notes: notes_on(&context.rows, state),
    };
    let regions = Regions::fit(&context, &mut batch.notes);
    let recommendation = regions.as_ref().and_then(|r| r.recommendation(&context));
    let mut stop = stop_before_search(&state.rounds, options);
    let mut expectation = None;
    if stop.is_none() {
        expectation = match regions {
            Some(regions) => Some(batch.choose(&context, regions)?),
            None => None,
        };
        match &recommendation {
            Some(best) => confirm(options, best, &mut batch),
            None if batch.infill.is_empty() => fill(&context, &mut batch),
            None => {}
        }
        let last = state.rounds.last();
        let before = last.and_then(|round| round.expected_improvement);
        let best = recommendation.as_ref();
        stop = stop_after_search(&context, &batch, best, expectation.as_ref(), before);
    }
    Ok(Decision {
        round: context.round,
        infill: if stop.is_some() {
            Vec::new()
        } else {
            batch.infill
        },
        recommendation,
        expected_improvement: expectation.map(|expectation| expectation.expected_um),
        stop,
        notes: batch.notes,
        constraint_evaluations: context.evaluations.into_inner(),
    })
}

/// Notes on the rows, before any model is fitted.
fn notes_on(rows: &Rows, state: &State) -> Vec<Note> {
    let (merged, not_numbers) = (rows.merged, rows.not_numbers);
    let notes = [
        (merged > 0).then_some(Note::Merged { entries: merged }),
        (not_numbers > 0).then_some(Note::NotNumbers {
            entries: not_numbers,
        }),
        (failed_rounds(&state.rounds) > 0).then_some(Note::RoundFailed),
    ];
    notes.into_iter().flatten().collect()
}
