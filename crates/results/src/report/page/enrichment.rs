//! The section about the enrichment.

use super::figure::{Figure, figure};
use crate::number::{count, interval, with_unit};
use crate::report::charts;
use crate::report::contents::Report;
use crate::report::enrichment::Enrichment;
use crate::report::error::Error;

/// The section of the page.
pub(super) struct EnrichmentView {
    pub(super) sentences: Vec<String>,
    pub(super) prediction: Figure,
    pub(super) expected: Figure,
}

impl EnrichmentView {
    /// `None` without an enrichment.
    pub(super) fn new(report: &Report) -> Result<Option<Self>, Error> {
        let Some(enrichment) = &report.enrichment else {
            return Ok(None);
        };
        let measure = &*report.snapshot.measure_name();
        let sentences = [
            effort(enrichment),
            outcome(enrichment, measure),
            enrichment.stop.clone(),
        ];
        Ok(Some(Self {
            sentences: sentences.into_iter().filter(|s| !s.is_empty()).collect(),
            prediction: figure(
                "enrichment-prediction",
                charts::prediction(enrichment, measure),
            )?,
            expected: figure(
                "enrichment-expected",
                charts::expected_improvement(enrichment),
            )?,
        }))
    }

    pub(super) fn figures(&self) -> impl Iterator<Item = &Figure> {
        [&self.prediction, &self.expected].into_iter()
    }
}

/// The numbers of points and samples, in sentences.
fn effort(enrichment: &Enrichment) -> String {
    let rounds = &enrichment.rounds;
    if rounds.is_empty() {
        return "No round has been decided yet.".to_owned();
    }
    let samples: u64 = rounds.iter().map(|round| round.samples).sum();
    let failed: u64 = rounds.iter().map(|round| round.failed).sum();
    let mut text = format!(
        "{} rounds asked for {} new designs and {} times for additional samples at an existing \
         design: {} samples beside the {} of the DoE, {} in all.",
        rounds.len(),
        count(rounds.iter().map(|round| round.new_designs).sum()),
        count(rounds.iter().map(|round| round.further_turns).sum()),
        count(samples),
        count(enrichment.doe_samples),
        count(samples + enrichment.doe_samples),
    );
    if failed > 0 {
        text += &format!(" {} of the points failed.", count(failed));
    }
    let ruled_out: u64 = rounds.iter().map(|round| round.ruled_out).sum();
    if ruled_out > 0 {
        text += &format!(
            " {} of the points broke a constraint and got no samples.",
            count(ruled_out)
        );
    }
    text
}

/// The prediction beside its verification, in sentences.
fn outcome(enrichment: &Enrichment, measure: &str) -> String {
    let Some(last) = enrichment.rounds.last() else {
        return String::new();
    };
    if !last.predicted.is_finite() {
        return String::new();
    }
    let shown = |value: f64| with_unit(value, 4, &enrichment.unit);
    let mut text = format!(
        "The model predicts a {measure} of {} (95 % interval {}) for the design that it recommends.",
        shown(last.predicted),
        interval((last.low, last.high), 4),
    );
    if let (Some(verified), Some((low, high))) =
        (enrichment.verified, enrichment.interval_of_estimate)
    {
        let lies = if (low..=high).contains(&verified) {
            "lies within"
        } else {
            "lies outside"
        };
        text += &format!(
            " Verification samples give {}, which {lies} the interval that it expects for an estimate from \
             as many samples, {}.",
            shown(verified),
            interval((low, high), 4),
        );
    }
    text
}
