//! Doubts about what a store holds: workers that contradict each other and, for an external program, ignored seeds,
//! absurd samples and failed evaluations.

use std::collections::BTreeSet;

use ledger::{Kind, StreamId};
use problem::Approach;
use problem::file::FailedSamples;
use problem::formulation::Problem;
use stages::plausibility::Plausibility;
use stages::{contradiction, names};
use store::{CriteriaRow, InfillRow, ResponseRow, Store};

/// One sentence for each doubt about what `store` holds.
///
/// # Errors
///
/// The store cannot be read.
pub(crate) async fn of(store: &Store, problem: &Problem) -> Result<Vec<String>, store::Error> {
    let campaign = problem.campaign();
    let mut doubts: Vec<String> = contradictions(store).await?.into_iter().collect();
    if !campaign.is_external() {
        return Ok(doubts);
    }
    let responses = store.responses().await?;
    let limited = store.limited_responses().await?;
    doubts.extend(ignored_seeds(problem, &responses, &limited));
    doubts.extend(Plausibility::read(store).await?.sentences(problem));
    let meaning = match campaign.sampling.failed {
        FailedSamples::LeftOut => "They are left out.",
        FailedSamples::RefusesDesign => "A design with one of them gets no response.",
        FailedSamples::Worst | FailedSamples::QuarantinesDesign => {
            "They count as worse than all others."
        }
    };
    let tallies = store.sample_tallies().await?;
    let of_kind = |kind: Kind| {
        tallies
            .iter()
            .filter(move |(stream, _)| stream.kind == kind)
    };
    let failed = |kind| {
        of_kind(kind)
            .map(|(_, tally)| tally.failed as usize)
            .sum::<usize>()
    };
    let all: u64 = of_kind(Kind::Design).map(|(_, tally)| tally.samples).sum();
    let is_failure = |reason: &str| reason.starts_with(problem::task::FAILED);
    let mut candidates = 0;
    for approach in Approach::OPTIMISED {
        for start in 0..campaign.optimise.starts {
            let rows = store.evaluations(names::run(approach, start), 0).await?;
            let reasons = rows.iter().filter_map(|row| row.refused.as_deref());
            candidates += reasons.filter(|reason| is_failure(reason)).count();
        }
    }
    let without = responses.iter().filter(|row| !row.measure.is_finite());
    let criteria = store.criteria().await?;
    let has_failed = |row: &&CriteriaRow| row.reason.as_deref().is_some_and(is_failure);
    let infill = store.infill().await?;
    let is_absurd = |row: &&InfillRow| {
        let tally = tallies.get(&StreamId::point(row.number));
        row.has_failed() && tally.is_some_and(|tally| tally.samples >= row.samples)
    };
    let counted = [
        (
            infill.iter().filter(is_absurd).count(),
            "infill points are left out because of an absurd sample; the log names it.".to_owned(),
        ),
        (
            criteria.iter().filter(has_failed).count(),
            "designs failed in every attempt; they are recorded as not simulable.".to_owned(),
        ),
        (
            failed(Kind::Design),
            format!("of {all} samples of the DoE failed. {meaning}"),
        ),
        (
            without.count(),
            "designs have no response, because too many of their samples failed.".to_owned(),
        ),
        (
            failed(Kind::Point),
            format!("verification and infill samples failed. {meaning}"),
        ),
        (
            candidates,
            "evaluations in the searches failed; these candidates ranked last.".to_owned(),
        ),
    ];
    let counted = counted.into_iter().filter(|(count, _)| *count > 0);
    doubts.extend(counted.map(|(count, what)| format!("{count} {what}")));
    Ok(doubts)
}

/// The doubt about results that two workers computed differently.
async fn contradictions(store: &Store) -> Result<Option<String>, store::Error> {
    let groups = store.failure_groups().await?;
    let mut causes = groups.iter().map(|group| &*group.cause);
    if !causes.any(contradiction::is_recorded) {
        return Ok(None);
    }
    let failures = store.failures().await?;
    let rows = failures
        .iter()
        .filter(|row| contradiction::is_recorded(&row.error));
    let jobs: BTreeSet<String> = rows.map(|row| names::stream_name(row.stream)).collect();
    let jobs = jobs.into_iter().collect::<Vec<_>>().join(", ");
    Ok(Some(format!(
        "Two workers gave different results for the same job, and the first result counts: {jobs}. The table failures \
         names the workers."
    )))
}

/// The doubt about a program whose samples do not depend on its seed. `limited` has the measures of constraints. If one
/// of them scatters, an objective without scatter, such as a weight, is no reason for doubt.
fn ignored_seeds(
    problem: &Problem,
    responses: &[ResponseRow],
    limited: &[ResponseRow],
) -> Option<String> {
    // Rounding leaves a small standard deviation of equal numbers.
    // A design whose samples all failed has an infinite mean.
    let is_constant = |row: &ResponseRow| {
        row.mean.is_finite() && row.standard_deviation <= 1e-12 * row.mean.abs()
    };
    let mut all = responses.iter().chain(limited);
    let is_suspicious = !responses.is_empty() && all.all(is_constant);
    is_suspicious.then(|| {
        format!(
            "The program seems to ignore its {}: in each of {} designs, all samples of {} are equal, as of a response \
             without random effects.",
            if problem.random().is_some() { "random inputs" } else { "seed" },
            responses.len(),
            problem.objective().response.name,
        )
    })
}
