//! The rounds of infill, for the report.

use campaign::Approach;
use campaign::formulation::Problem;
use stages::infill::MORE;
use stages::rounds::Round;
use stages::snapshot::response_counts;
use store::{InfillRow, RoundRow, Store};

use crate::optima::VerifiedOptimum;
use crate::report::{Enrichment, EnrichmentRound};
use crate::snapshot::Snapshot;

/// None without an enrichment.
pub(super) async fn enrichment(
    store: &Store,
    snapshot: &Snapshot,
) -> anyhow::Result<Option<Enrichment>> {
    if snapshot.problem.campaign().enrichment.is_none() {
        return Ok(None);
    }
    let verified = snapshot.optima.of(Approach::EnrichedKriging);
    let verified = verified.map_or(&[][..], VerifiedOptimum::samples);
    let rounds = rounds(
        &snapshot.problem,
        &snapshot.rounds,
        &snapshot.infill,
        verified,
    )?;
    let counts = response_counts(store, &snapshot.problem.campaign().sampling).await?;
    Ok(rounds.map(|enrichment| Enrichment {
        doe_samples: counts.values().sum(),
        ..enrichment
    }))
}

/// What the rounds of infill in the store did, with verification samples of the recommended design; how many
/// samples the DoE had before is left at 0. None without an enrichment.
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
        let points = || infill.iter().filter(|point| point.round == row.round);
        let further = points().filter(|point| point.reason == MORE).count() as u64;
        let best = round.recommendation.as_ref();
        rounds.push(EnrichmentRound {
            round: round.row.round + 1,
            new_designs: points().count() as u64 - further,
            further_turns: further,
            samples: points()
                .filter(|point| !point.is_ruled_out())
                .map(|point| point.samples)
                .sum(),
            failed: points().filter(|point| point.has_failed()).count() as u64,
            ruled_out: points().filter(|point| point.is_ruled_out()).count() as u64,
            expected_improvement: round.row.expected_improvement.unwrap_or(f64::NAN),
            predicted: best.map_or(f64::NAN, |best| best.predicted),
            low: best.map_or(f64::NAN, |best| best.interval.0),
            high: best.map_or(f64::NAN, |best| best.interval.1),
        });
        stop = round
            .stop
            .as_ref()
            .map_or_else(String::new, ToString::to_string);
        recommendation = round.recommendation;
    }
    let verified = problem.campaign().sampling.verified(verified).ok();
    Ok(Some(Enrichment {
        unit: problem.sampled().unit.to_string(),
        rounds,
        tolerance: section.tolerance,
        stop,
        doe_samples: 0,
        verified_um: verified.map(|verified| verified.value),
        interval_of_estimate_um: recommendation.zip(verified).and_then(|(best, verified)| {
            // Both are uncertain, the model and the verification.
            let (low, high) = verified.interval?;
            let half = best.half_width().hypot(0.5 * (high - low));
            Some((best.predicted - half, best.predicted + half))
        }),
    }))
}
