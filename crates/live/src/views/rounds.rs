//! The rounds of an enrichment.

use report::{Enrichment, EnrichmentRound};
use serde::Serialize;

use super::{Chart, SCHEMA_VERSION, rounded};

/// All rounds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rounds {
    /// The version of this object.
    pub schema_version: u32,
    /// Whether the campaign has an enrichment.
    pub enriches: bool,
    /// Why the enrichment ended, in a sentence; empty while it goes on.
    pub stop: String,
    /// The rounds, in their order.
    pub rounds: Vec<Round>,
    /// The prediction, and what a further observation may gain.
    pub charts: Vec<Chart>,
}

/// One round.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Round {
    /// The round, from 1.
    pub round: u64,
    /// New designs.
    pub new_designs: u64,
    /// Designs that got more samples.
    pub further_turns: u64,
    /// Samples asked for.
    pub samples: u64,
    /// Points whose samples were quarantined.
    pub failed: u64,
    /// The most that was expected of an observation; `null` where no model could tell.
    pub expected_improvement: f64,
    /// The model's prediction for the recommended design; `null` without one.
    pub predicted: f64,
    /// The lower end of its 95 % interval.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// The view of an enrichment; of none, if the campaign has none.
#[must_use]
pub fn rounds(enrichment: Option<&Enrichment>, percentile: &str) -> Rounds {
    let rounds = enrichment.map_or(&[][..], |enrichment| &enrichment.rounds);
    let number = |value: f64| rounded(value, 5).to_string();
    let rows: Vec<Vec<String>> = rounds
        .iter()
        .map(|round| {
            let ends = [round.predicted_um, round.low_um, round.high_um].map(number);
            let [predicted, low, high] = ends;
            vec![round.round.to_string(), predicted, low, high]
        })
        .collect();
    let gains: Vec<Vec<String>> = rounds
        .iter()
        .map(|round| {
            vec![
                round.round.to_string(),
                number(round.expected_improvement_um),
            ]
        })
        .collect();
    // Before the first round there is only the tolerance to draw.
    let begun = enrichment.filter(|_| !rounds.is_empty());
    let charts = begun.map_or_else(Vec::new, |enrichment| {
        let prediction = Chart::new(
            report::chart_prediction(enrichment, percentile),
            &["round", "predicted", "95 % interval from", "to"],
            rows,
        );
        let gain = Chart::new(
            report::chart_expected_improvement(enrichment),
            &["round", "expected improvement"],
            gains,
        );
        prediction.into_iter().chain(gain).collect()
    });
    Rounds {
        schema_version: SCHEMA_VERSION,
        enriches: enrichment.is_some(),
        stop: enrichment.map_or_else(String::new, |enrichment| enrichment.stop.clone()),
        rounds: rounds.iter().map(of_round).collect(),
        charts,
    }
}

fn of_round(round: &EnrichmentRound) -> Round {
    Round {
        round: round.round,
        new_designs: round.new_designs,
        further_turns: round.further_turns,
        samples: round.samples,
        failed: round.failed,
        expected_improvement: round.expected_improvement_um,
        predicted: round.predicted_um,
        low: round.low_um,
        high: round.high_um,
    }
}
