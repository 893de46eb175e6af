//! A check that progress never decreases.

use serde_json::Value;

use super::Violation;

/// The greatest progress seen so far.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    /// Numbers of samples, designs, optimiser runs, samples at optima, and infill points.
    pub(crate) last: Option<[u64; 5]>,
    /// Whether a coordinator was told to remove failed samples and has not done so yet, as far as was seen.
    pub(crate) will_go_back: bool,
}

impl Progress {
    /// Records the progress in a status. Optimiser runs and later results may decrease if optima
    /// may be chosen again.
    pub(crate) fn advance(&mut self, status: &Value, takes_turn: bool) -> Result<(), Violation> {
        let number = |value: &Value| value.as_u64().unwrap_or(0);
        let verified = status["optima"].as_array().map_or(0, |optima| {
            let done = optima.iter().map(|one| number(&one["verified"]["done"]));
            done.sum()
        });
        let now = [
            number(&status["samples"]["done"]),
            number(&status["designs"]["done"]),
            number(&status["optimiser_runs"]["done"]),
            verified,
            number(&status["enrichment"]["points"]),
        ];
        let lasting = if takes_turn { 2 } else { now.len() };
        let pairs = |before: [u64; 5]| before.into_iter().zip(now).take(lasting);
        if let Some(before) = self.last
            && pairs(before).any(|(before, now)| now < before)
            && !std::mem::take(&mut self.will_go_back)
        {
            return Err(Violation(format!(
                "progress went back from {before:?} to {now:?} (samples, designs, optimiser runs, \
                 samples at optima, points of infill)"
            )));
        }
        self.last = Some(now);
        Ok(())
    }
}
