//! Reads the status from a store.

use std::collections::{BTreeMap, BTreeSet};

use ledger::{Kind, StreamId};
use problem::formulation::Problem;
use stages::names;
use stages::stage::Stage;
use store::{SampleTally, Store};

use super::{
    DesignCounts, EnrichmentStatus, FailureGroup, OptimumStatus, Progress, SampleCounts, Status,
    UnfinishedRun,
};
use crate::costs::{self, Times};
use crate::estimate::Estimate;
use crate::optima::{Optima, VerifiedOptimum};
use crate::{doubts, snapshot};

/// Reads the status of the campaign in `store`.
///
/// # Errors
///
/// The store cannot be read, or its campaign file cannot.
pub async fn read(store: &Store) -> anyhow::Result<Status> {
    let store = &store.snapshot().await?;
    let problem = snapshot::problem(store).await?;
    let optima = Optima::read(store, &problem).await?;
    of(store, &problem, &optima).await
}

/// The status of a campaign, with the optima `found` in the same snapshot of its store.
pub(crate) async fn of(store: &Store, problem: &Problem, found: &Optima) -> anyhow::Result<Status> {
    let row = store.campaign().await?;
    let campaign = problem.campaign();
    let progress = store.progress().await?;
    let tallies = store.sample_tallies().await?;
    let optima: Vec<OptimumStatus> = found
        .iter()
        .map(|one| OptimumStatus::of(problem, one))
        .collect();
    let wanted = u64::from(campaign.doe.designs);
    let per_design = u64::from(campaign.sampling.samples_per_design);
    let enrichment = enrichment(store, &tallies).await?;
    let stage = store.stage().await?;
    let stage = stage.and_then(|name| Stage::named(&name));
    // No coordinator has seen the campaign yet.
    let stage = stage.unwrap_or(Stage::Doe);
    let mut warnings = doubts::campaign::of(store, problem).await?;
    warnings.extend(found.doubts(problem));
    if stage == Stage::Done {
        let open = store
            .missing_work(per_design, &BTreeMap::new())
            .await?
            .len();
        if open > 0 {
            warnings.push(format!(
                "The campaign ended without samples of {open} designs, whose jobs were quarantined. `coordinator run` or `serve` \
                 computes them, and all results that depend on them."
            ));
        }
    }
    let groups = store.failure_groups().await?.into_iter();
    let mut status = Status {
        schema_version: 3,
        campaign: row.name,
        campaign_digest: row.digest,
        program_version: row.program_version,
        finished: stage == Stage::Done,
        stage,
        stages: Vec::new(),
        designs: DesignCounts {
            wanted,
            made: progress.designs,
            done: progress.criteria_done,
            simulable: progress.simulable,
            ruled_out: progress.ruled_out,
        },
        samples: SampleCounts {
            per_design,
            done: progress.samples,
        },
        samples_digest: store.samples_digest().await?,
        point_samples_digest: store.point_samples_digest().await?,
        digests_checked: store.is_checked(),
        optimiser_runs: Progress {
            done: progress.optimiser_runs,
            wanted: problem.optimiser_runs(),
        },
        unfinished_runs: unfinished_runs(store, problem).await?,
        enrichment,
        measure: campaign.measure_name(),
        aim: problem.aim(),
        unit: problem.measured().unit.to_string(),
        optima,
        failures: progress.failures,
        failure_groups: groups.map(FailureGroup::from).collect(),
        warnings,
        live: None,
    };
    let to_verify = problem.approaches().count() as u64 * u64::from(campaign.verify.first());
    status.stages = status.each_stage(to_verify, campaign.enrichment.is_some());
    time(store, &mut status, problem).await?;
    Ok(status)
}

/// Adds the times of the stages. The CPU times of all units are read only for finished campaigns, whose status is not
/// asked for every second.
async fn time(store: &Store, status: &mut Status, problem: &Problem) -> anyhow::Result<()> {
    if status.finished {
        let costs = Times::read(store, problem).await?.stages();
        let known = |seconds: f64| Some(seconds).filter(|seconds| seconds.is_finite());
        for (stage, cost) in status.stages.iter_mut().zip(costs) {
            stage.wall_seconds = known(cost.wall_seconds);
            stage.cpu_seconds = known(cost.cpu_seconds);
        }
        return Ok(());
    }
    let stages = store.stage_times().await?;
    for stage in &mut status.stages {
        stage.wall_seconds = costs::wall_seconds(&stages, stage.name);
    }
    Ok(())
}

async fn unfinished_runs(
    store: &Store,
    problem: &Problem,
) -> Result<Vec<UnfinishedRun>, store::Error> {
    let wanted = u64::from(problem.campaign().optimise.evaluations);
    let finished: BTreeSet<StreamId> = store
        .optimiser_runs()
        .await?
        .into_iter()
        .map(|row| row.stream)
        .collect();
    let mut evaluated = store.evaluated().await?;
    evaluated.retain(|stream, _| stream.kind == Kind::Run && !finished.contains(stream));
    Ok(evaluated
        .into_iter()
        .map(|(stream, (done, _))| UnfinishedRun {
            name: names::stream_name(stream),
            evaluations: Progress { done, wanted },
        })
        .collect())
}

async fn enrichment(
    store: &Store,
    tallies: &BTreeMap<StreamId, SampleTally>,
) -> Result<Option<EnrichmentStatus>, store::Error> {
    let rounds = store.rounds().await?;
    let Some(last) = rounds.last() else {
        return Ok(None);
    };
    let infill = store.infill().await?;
    let of_last = infill.iter().filter(|row| row.round == last.round);
    let done = of_last.clone().map(|row| {
        let tally = tallies.get(&StreamId::point(row.number));
        tally.map_or(0, |tally| tally.samples).min(row.samples)
    });
    Ok(Some(EnrichmentStatus {
        round: last.round + 1,
        samples: Progress {
            done: done.sum(),
            wanted: of_last.map(|row| row.samples).sum(),
        },
        points: infill.len() as u64,
        failed: infill.iter().filter(|row| row.has_failed()).count() as u64,
        ruled_out: infill.iter().filter(|row| row.is_ruled_out()).count() as u64,
        ended: last.stop_json.is_some(),
    }))
}

impl From<store::FailureGroup> for FailureGroup {
    fn from(group: store::FailureGroup) -> Self {
        Self {
            kind: group.kind.as_str().to_owned(),
            cause: group.cause,
            count: group.count,
            last_error: group.last_error,
            last_job: names::stream_name(group.last_stream),
        }
    }
}

impl OptimumStatus {
    fn of(problem: &Problem, verified: &VerifiedOptimum) -> Self {
        let optimum = &verified.optimum;
        let (done, wanted) = match (&verified.verification, optimum.feasible()) {
            (Some(verification), Some(_)) => (verification.samples.len(), verification.wanted),
            _ => (0, 0),
        };
        Self {
            approach: problem.approach_name(optimum.approach).to_owned(),
            criterion: optimum.feasible().map(|found| found.criterion),
            none: optimum.found.as_ref().err().copied(),
            note: optimum.note.clone(),
            verified: Progress {
                done: done as u64,
                wanted: wanted as u64,
            },
            measure: verified.measure.map(Estimate::from),
            limits: verified.limits.clone(),
            behind: verified.behind.map(Estimate::from),
        }
    }
}
