//! The rounds of an enrichment.

use crate::report::{Enrichment, EnrichmentRound, charts};
use serde::Serialize;

use super::Chart;
use crate::number::rounded;

/// All rounds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rounds {
    /// Whether the campaign has an enrichment.
    pub enriches: bool,
    /// Why the enrichment ended, in a sentence; empty while it continues.
    pub stop: String,
    /// The rounds, in order.
    pub rounds: Vec<EnrichmentRound>,
    /// Charts of the prediction and of the expected improvement.
    pub charts: Vec<Chart>,
}

/// The view of an enrichment; without rounds if the campaign has none.
#[must_use]
pub fn rounds(enrichment: Option<&Enrichment>, measure: &str) -> Rounds {
    let rounds = enrichment.map_or(&[][..], |enrichment| &enrichment.rounds);
    let number = |value: f64| rounded(value, 5).to_string();
    let rows: Vec<Vec<String>> = rounds
        .iter()
        .map(|round| {
            let ends = [round.predicted, round.low, round.high].map(number);
            let [predicted, low, high] = ends;
            vec![round.round.to_string(), predicted, low, high]
        })
        .collect();
    let gains: Vec<Vec<String>> = rounds
        .iter()
        .map(|round| vec![round.round.to_string(), number(round.expected_improvement)])
        .collect();
    // Before the first round there is nothing to draw except the tolerance.
    let begun = enrichment.filter(|_| !rounds.is_empty());
    let charts = begun.map_or_else(Vec::new, |enrichment| {
        let prediction = Chart::new(
            charts::prediction(enrichment, measure),
            &["round", "predicted", "95 % interval from", "to"],
            rows,
        );
        let gain = Chart::new(
            charts::expected_improvement(enrichment),
            &["round", "expected improvement"],
            gains,
        );
        prediction.into_iter().chain(gain).collect()
    });
    Rounds {
        enriches: enrichment.is_some(),
        stop: enrichment.map_or_else(String::new, |enrichment| enrichment.stop.clone()),
        rounds: rounds.to_vec(),
        charts,
    }
}
