//! The decision to stop.

use crate::batch::Batch;
use crate::context::Context;
use crate::expectation::Expectation;
use crate::{Options, Recommendation, RoundRecord, Stop};

/// Number of rounds in a row that must expect less than δ, or fail altogether.
const IN_A_ROW: usize = 2;

/// Number of rounds in a row, counted back from the last one, with nothing but failures.
pub(crate) fn failed_rounds(rounds: &[RoundRecord]) -> usize {
    let failed = |r: &&RoundRecord| r.asked > 0 && r.failed >= r.asked;
    rounds.iter().rev().take_while(failed).count()
}

/// The reason to stop before any observation is looked for.
pub(crate) fn stop_before_search(rounds: &[RoundRecord], options: &Options) -> Option<Stop> {
    let samples = options.samples_left;
    if failed_rounds(rounds) >= IN_A_ROW {
        Some(Stop::OnlyFailures)
    } else if samples < options.samples_new.min(options.samples_more) {
        Some(Stop::Budget { samples })
    } else if rounds.len() >= options.rounds {
        let rounds = rounds.len();
        Some(Stop::Rounds { rounds })
    } else {
        None
    }
}

/// The reason to stop once the observations are chosen. `expectation` is `None` without a model,
/// `before` is the previous round's expected improvement.
pub(crate) fn stop_after_search(
    context: &Context<'_>,
    batch: &Batch,
    recommendation: Option<&Recommendation>,
    expectation: Option<&Expectation>,
    before: Option<f64>,
) -> Option<Stop> {
    let options = context.options;
    let delta = options.delta_um;
    if let (Some(best), Some(expectation), Some(before)) = (recommendation, expectation, before)
        && expectation.is_below(delta)
        && before < delta
        && best.half_width() < delta
    {
        return Some(Stop::Converged {
            expected_improvement: expectation.expected_um.max(before),
            half_width: best.half_width(),
        });
    }
    if !batch.infill.is_empty() {
        return None;
    }
    let samples = batch.left;
    let is_unaffordable = match (recommendation, expectation) {
        // Every observation that is worth δ costs more than the budget left.
        (Some(_), Some(expectation)) => expectation.expected_um >= delta,
        // Only new designs could help.
        _ => samples < options.samples_new,
    };
    if is_unaffordable {
        Some(Stop::Budget { samples })
    } else if recommendation.is_none() {
        Some(Stop::NothingFeasible)
    } else {
        // The next round looks a second time, with other random numbers.
        None
    }
}
