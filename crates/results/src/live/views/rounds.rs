//! The rounds of an enrichment.

use std::iter;

use crate::report::{Enrichment, EnrichmentRound, charts};
use serde::Serialize;

use super::Chart;
use super::chart::rows_of;
use crate::number::column;

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
    let texts = |of: &[fn(&EnrichmentRound) -> f64]| {
        let all = of.iter().flat_map(|of| rounds.iter().map(of));
        let texts = column(&all.map(|value| (value, "")).collect::<Vec<_>>(), 5);
        let numbers = rounds.iter().map(|round| round.round.to_string());
        let columns = texts.chunks(rounds.len().max(1)).map(<[String]>::to_vec);
        rows_of(
            &iter::once(numbers.collect())
                .chain(columns)
                .collect::<Vec<_>>(),
        )
    };
    let rows = texts(&[|r| r.predicted, |r| r.low, |r| r.high]);
    let gains = texts(&[|r| r.expected_improvement]);
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
