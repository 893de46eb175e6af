//! The decision to stop.

use crate::batch::Batch;
use crate::context::Context;
use crate::{Options, Recommendation, RoundRecord, Stop};

/// Number of rounds in a row that must expect less than δ, or fail altogether.
const IN_A_ROW: usize = 2;

/// The highest expectation in a round, and the regions it was sought in.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outlook {
    /// The highest value of any observation in the consulted regions.
    pub(crate) expected_um: f64,
    consulted: Vec<bool>,
}

impl Outlook {
    /// An outlook on `regions` regions, none of which is consulted yet.
    pub(crate) fn new(regions: usize) -> Self {
        Self {
            expected_um: 0.0,
            consulted: vec![false; regions],
        }
    }

    /// Records the highest value in a region.
    pub(crate) fn record(&mut self, region: usize, value: f64) {
        self.expected_um = self.expected_um.max(value);
        self.consulted[region] = true;
    }

    pub(crate) fn was_consulted(&self, region: usize) -> bool {
        self.consulted[region]
    }

    /// Whether less than δ is expected in every basin and in the whole box.
    fn is_below(&self, delta_um: f64) -> bool {
        self.expected_um < delta_um && self.consulted.iter().all(|consulted| *consulted)
    }
}

/// Number of rounds in a row, counted back from the last one, with nothing but failures.
pub(crate) fn failures(rounds: &[RoundRecord]) -> usize {
    let failed = |r: &&RoundRecord| r.asked > 0 && r.failed >= r.asked;
    rounds.iter().rev().take_while(failed).count()
}

/// The reason to stop before any observation is looked for.
pub(crate) fn before_search(rounds: &[RoundRecord], options: &Options) -> Option<Stop> {
    let samples = options.samples_left;
    if failures(rounds) >= IN_A_ROW {
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

/// The reason to stop once the observations are chosen. `outlook` is `None` without a model,
/// `before` is the expectation of the round before.
pub(crate) fn after_search(
    context: &Context<'_>,
    batch: &Batch,
    recommendation: Option<&Recommendation>,
    outlook: Option<&Outlook>,
    before: Option<f64>,
) -> Option<Stop> {
    let options = context.options;
    let delta = options.delta_um;
    if let (Some(best), Some(outlook), Some(before)) = (recommendation, outlook, before)
        && outlook.is_below(delta)
        && before < delta
        && best.half_width() < delta
    {
        return Some(Stop::Converged {
            expected_improvement: outlook.expected_um.max(before),
            half_width: best.half_width(),
        });
    }
    if !batch.infill.is_empty() {
        return None;
    }
    let samples = batch.left;
    let is_unaffordable = match (recommendation, outlook) {
        // Everything that is worth δ costs more than is left.
        (Some(_), Some(outlook)) => outlook.expected_um >= delta,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlook_is_below_delta_only_if_every_region_was_consulted() {
        let mut outlook = Outlook::new(2);
        outlook.record(0, 0.01);
        assert!(!outlook.is_below(0.02));
        outlook.record(1, 0.005);
        assert!(outlook.is_below(0.02));
        assert!(!outlook.is_below(0.01));
        outlook.record(0, 0.03);
        assert!(!outlook.is_below(0.02));
    }
}
