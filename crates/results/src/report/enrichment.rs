//! The rounds of infill.

use problem::Approach;
use problem::formulation::Problem;
use serde::Serialize;
use stages::infill::MORE;
use stages::rounds::Round;
use stages::snapshot::response_counts;
use store::{InfillRow, RoundRow, Store};

use crate::snapshot::Snapshot;

/// Rounds of infill points near the optimum, on top of the DoE.
#[derive(Debug, Clone, PartialEq)]
pub struct Enrichment {
    /// The unit of the measure; empty for a number without one.
    pub unit: String,
    /// The rounds, in their order.
    pub rounds: Vec<EnrichmentRound>,
    /// δ of the stopping rule, in the response's unit.
    pub tolerance: f64,
    /// Why the enrichment ended, in a sentence; empty while it continues.
    pub stop: String,
    /// Samples of the DoE that the first round rests on.
    pub doe_samples: u64,
    /// The verified measure of the recommended design.
    pub verified: Option<f64>,
    /// The 95 % interval in which an estimate from as many verification samples is to be expected, from the
    /// model's uncertainty and the verification's.
    pub interval_of_estimate: Option<(f64, f64)>,
}

/// One round of infill.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EnrichmentRound {
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
    /// Points that broke a constraint and got no samples.
    pub ruled_out: u64,
    /// The largest expected improvement of an observation; NaN without a model.
    pub expected_improvement: f64,
    /// The model's prediction for the recommended design; NaN without one.
    pub predicted: f64,
    /// Lower end of its 95 % interval.
    pub low: f64,
    /// Upper end of that interval.
    pub high: f64,
}

impl EnrichmentRound {
    /// The figures of a round, with the `infill` points of all rounds.
    pub(crate) fn of(round: &Round, infill: &[InfillRow]) -> Self {
        let row = &round.row;
        let points = || infill.iter().filter(|point| point.round == row.round);
        let count = |is: fn(&InfillRow) -> bool| points().filter(|point| is(point)).count() as u64;
        let sampled = points().filter(|point| !point.is_ruled_out());
        let best = round.recommendation.as_ref();
        Self {
            round: row.round + 1,
            new_designs: count(|point| point.reason != MORE),
            further_turns: count(|point| point.reason == MORE),
            samples: sampled.map(|point| point.samples).sum(),
            failed: count(InfillRow::has_failed),
            ruled_out: count(InfillRow::is_ruled_out),
            expected_improvement: row.expected_improvement.unwrap_or(f64::NAN),
            predicted: best.map_or(f64::NAN, |best| best.predicted),
            low: best.map_or(f64::NAN, |best| best.interval.0),
            high: best.map_or(f64::NAN, |best| best.interval.1),
        }
    }
}

/// `None` without an enrichment.
pub(super) async fn of(store: &Store, snapshot: &Snapshot) -> anyhow::Result<Option<Enrichment>> {
    if snapshot.problem.campaign().enrichment.is_none() {
        return Ok(None);
    }
    let verified = snapshot.optima.of(Approach::EnrichedKriging);
    let verified = verified.map(|optimum| optimum.values(&snapshot.problem));
    let rounds = rounds(
        &snapshot.problem,
        &snapshot.rounds,
        &snapshot.infill,
        &verified.unwrap_or_default(),
    )?;
    let counts = response_counts(store, &snapshot.problem).await?;
    Ok(rounds.map(|enrichment| Enrichment {
        doe_samples: counts.values().sum(),
        ..enrichment
    }))
}

/// The rounds of infill in the store, with verification samples of the recommended design. `doe_samples` is left
/// at 0. `None` without an enrichment.
///
/// # Errors
///
/// A round is not what this version writes.
pub fn rounds(
    problem: &Problem,
    rows: &[RoundRow],
    infill: &[InfillRow],
    verified: &[f64],
) -> anyhow::Result<Option<Enrichment>> {
    let Some(section) = &problem.campaign().enrichment else {
        return Ok(None);
    };
    let mut rounds = Vec::new();
    let (mut stop, mut recommendation) = (String::new(), None);
    for row in rows {
        let round = Round::read(row.clone())?;
        rounds.push(EnrichmentRound::of(&round, infill));
        stop = round
            .stop
            .as_ref()
            .map_or_else(String::new, ToString::to_string);
        recommendation = round.recommendation;
    }
    let verified = problem.campaign().sampling.verified(verified).ok();
    Ok(Some(Enrichment {
        unit: problem.measured().unit.to_string(),
        rounds,
        tolerance: section.tolerance,
        stop,
        doe_samples: 0,
        verified: verified.map(|verified| verified.value),
        interval_of_estimate: recommendation.zip(verified).and_then(|(best, verified)| {
            // The half width combines the model's uncertainty and the verification's.
            let (low, high) = verified.interval?;
            let half = best.half_width().hypot(0.5 * (high - low));
            Some((best.predicted - half, best.predicted + half))
        }),
    }))
}
