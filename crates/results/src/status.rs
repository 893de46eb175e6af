//! How far a campaign is, read from its store.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use campaign::formulation::Problem;
use ledger::{Kind, StreamId};
use serde::{Deserialize, Serialize};
use stages::names;
use stages::optima::NoOptimum;
use stages::stage::Stage;
use stats::OrderStatistic;
use store::{SampleTally, Store};

use crate::costs::{self, Times};
use crate::doubts;
use crate::optima::{Optima, VerifiedOptimum};
use crate::running::{Backlog, Live, Running};
use crate::snapshot;

/// What `coordinator status --json` prints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// The version of this object.
    pub schema_version: u32,
    /// The campaign's name.
    pub campaign: String,
    /// The digest of the campaign's content.
    pub campaign_digest: String,
    /// The version of the program that made the store.
    pub program_version: String,
    /// Whether every stage is done.
    pub finished: bool,
    /// The first stage that is not.
    pub stage: Stage,
    /// Every stage of the campaign in order, with how far it is.
    pub stages: Vec<StageProgress>,
    /// Designs of the DoE: wanted, made, simulated or refused, and those that can be simulated.
    pub designs: Designs,
    /// Samples of the DoE.
    pub samples: Samples,
    /// The digest of all samples, whatever their order; see [`store::Store::samples_digest`].
    pub samples_digest: String,
    /// The same of verification and infill samples; see [`store::Store::point_samples_digest`].
    pub point_samples_digest: String,
    /// Whether the digests were compared with what the store held when it was opened; as recorded
    /// otherwise.
    pub digests_checked: bool,
    /// Finished runs of optimisers and how many there will be.
    pub optimiser_runs: Progress,
    /// Runs on an external simulator that have begun and are not finished; those on the built-in one take
    /// seconds and are not among them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unfinished_runs: Vec<UnfinishedRun>,
    /// The rounds of infill; absent before the first one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enrichment: Option<Enrichment>,
    /// What the percentile is called that is minimised: P90.
    pub percentile: String,
    /// The unit of the optima's criteria; empty for a number without one.
    pub unit: String,
    /// Chosen optima.
    pub optima: Vec<Optimum>,
    /// Failures on record.
    pub failures: u64,
    /// The same, grouped by cause.
    pub failure_groups: Vec<FailureGroup>,
    /// What makes the results doubtful.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// What only the running coordinator knows; absent when the store alone was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub live: Option<Live>,
}

/// How far one stage is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageProgress {
    /// Which one.
    pub name: Stage,
    /// `done`, `current` or `ahead`. What needs no samples, such as runs of an optimiser on a
    /// deterministic criterion, is done before its stage is the current one.
    pub state: String,
    /// How much is done.
    pub done: u64,
    /// How much there will be, as far as that is known.
    pub wanted: u64,
    /// What is counted.
    pub of: String,
    /// How long the campaign has waited for it, in seconds; absent before it begins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall_seconds: Option<f64>,
    /// CPU time in seconds, once the campaign is finished.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_seconds: Option<f64>,
}

/// Failures with one cause.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailureGroup {
    /// `crash`, `failure` or `quarantine`.
    pub kind: String,
    /// What they have in common.
    pub cause: String,
    /// How many.
    pub count: u64,
    /// The last one's message.
    pub last_error: String,
    /// The last one's job.
    pub last_job: String,
}

/// Counts of designs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Designs {
    /// n.
    pub wanted: u64,
    /// Points in the store.
    pub made: u64,
    /// Designs whose criteria are stored.
    pub done: u64,
    /// Those of them that could be simulated.
    pub simulable: u64,
    /// Those of them that get no samples, because their constraints rule them out.
    pub ruled_out: u64,
}

/// Counts of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Samples {
    /// k.
    pub per_design: u64,
    /// Samples in the store.
    pub done: u64,
}

/// Done of wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    /// How many are done.
    pub done: u64,
    /// How many there will be.
    pub wanted: u64,
}

/// A run of an optimiser that is not finished.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnfinishedRun {
    /// Its approach and start.
    pub name: String,
    /// Evaluations, of those that it has without continuations.
    pub evaluations: Progress,
}

/// The rounds of infill.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Enrichment {
    /// The round that is being sampled, from 1; the last one once the enrichment has ended.
    pub round: u64,
    /// Samples of its points.
    pub samples: Progress,
    /// Infill points of all rounds, and how many of them have failed.
    pub points: u64,
    /// See `points`.
    pub failed: u64,
    /// Infill points that got no samples because they break a constraint.
    pub ruled_out: u64,
    /// Whether there will be no more rounds.
    pub ended: bool,
}

/// A chosen optimum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Optimum {
    /// The approach's name.
    pub approach: String,
    /// Its criterion, in the status's unit; absent when no feasible design was found.
    pub criterion: Option<f64>,
    /// Why there is no design: `no-model`, `none-feasible`, `none-simulable` or `nothing-computed`; absent
    /// when there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub none: Option<NoOptimum>,
    /// A remark: without a model, the reason.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub note: String,
    /// Verification samples in the store, and how many there will be.
    pub verified: Progress,
    /// The percentile of the verification samples, once all are there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub percentile: Option<Estimate>,
    /// How much worse it is than the best optimum; absent for that one, and for an approach that moves other
    /// variables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub behind: Option<Estimate>,
}

/// A percentile or a difference of two, with its 95 % confidence interval, in the status's unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Lower end of the interval; absent if the samples are too few for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// Upper end of the interval; absent if the samples are too few for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
}

impl From<OrderStatistic> for Estimate {
    fn from(estimate: OrderStatistic) -> Self {
        let (low, high) = estimate.interval.unzip();
        Self {
            value: estimate.value,
            low,
            high,
        }
    }
}

impl Optimum {
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
            percentile: verified.percentile.map(Estimate::from),
            behind: verified.behind.map(Estimate::from),
        }
    }
}

/// Reads the status of the campaign in `store`.
///
/// # Errors
///
/// The store cannot be read, or its campaign file cannot.
pub async fn read(store: &Store) -> anyhow::Result<Status> {
    let store = &store.snapshot().await?;
    let row = store.campaign().await?;
    let problem = snapshot::problem(store).await?;
    let campaign = problem.campaign();
    let progress = store.progress().await?;
    let tallies = store.sample_tallies().await?;
    let found = Optima::read(store, &problem).await?;
    let optima: Vec<Optimum> = found.iter().map(|one| Optimum::of(&problem, one)).collect();
    let wanted = u64::from(campaign.doe.designs);
    let per_design = u64::from(campaign.sampling.samples_per_design);
    let enrichment = enrichment(store, &tallies).await?;
    let stage = store.stage().await?;
    let stage = stage.and_then(|name| Stage::named(&name));
    // Before the first coordinator has seen the campaign, nothing is made.
    let stage = stage.unwrap_or(Stage::Doe);
    let mut warnings = doubts::of(store, &problem).await?;
    if stage == Stage::Done {
        let open = store
            .missing_work(per_design, &BTreeMap::new())
            .await?
            .len();
        if open > 0 {
            warnings.push(format!(
                "The campaign ended without samples of {open} designs, whose jobs were quarantined. The same command \
                 tries them again."
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
        designs: Designs {
            wanted,
            made: progress.designs,
            done: progress.criteria_done,
            simulable: progress.simulable,
            ruled_out: progress.ruled_out,
        },
        samples: Samples {
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
        unfinished_runs: unfinished_runs(store, &problem).await?,
        enrichment,
        percentile: campaign.sampling.percentile_name(),
        unit: problem.sampled().unit.to_string(),
        optima,
        failures: progress.failures,
        failure_groups: groups.map(FailureGroup::from).collect(),
        warnings,
        live: None,
    };
    let to_verify = problem.approaches().count() as u64 * u64::from(campaign.verify.first());
    status.stages = status.each_stage(to_verify, campaign.enrichment.is_some());
    time(store, &mut status, &problem).await?;
    Ok(status)
}

/// Says what the stages took. The CPU times of all units are read of finished campaigns only, whose status
/// is not asked for every second.
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
    evaluated.retain(|stream, _| !finished.contains(stream));
    Ok(evaluated
        .into_iter()
        .filter_map(|(stream, (done, _))| {
            let (approach, start) = names::approach_and_start(stream)?;
            Some(UnfinishedRun {
                name: format!("{} {start}", approach.name()),
                evaluations: Progress { done, wanted },
            })
        })
        .collect())
}

async fn enrichment(
    store: &Store,
    tallies: &BTreeMap<StreamId, SampleTally>,
) -> Result<Option<Enrichment>, store::Error> {
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
    Ok(Some(Enrichment {
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

impl Status {
    /// Adds what the running coordinator knows.
    #[must_use]
    pub fn with(mut self, running: Running) -> Self {
        let left = |progress: Progress| progress.wanted.saturating_sub(progress.done) as f64;
        let searches = running.searches.iter().map(|search| Progress {
            done: search.evaluations,
            wanted: search.budget,
        });
        let evaluations = searches.reduce(sum);
        let is_search = |stage: &&mut StageProgress| stage.name == Stage::Optimise;
        let missing = match self.stage {
            Stage::Sample => {
                let (samples, error) = self.missing();
                Some(Backlog::Counted(Kind::Design, samples, error))
            }
            Stage::Enrich => self
                .enrichment
                .map(|enrichment| Backlog::Counted(Kind::Point, left(enrichment.samples), 0.0)),
            Stage::Verify => Some(Backlog::Counted(Kind::Point, left(self.verified()), 0.0)),
            Stage::Optimise => Some(match evaluations {
                Some(evaluations) => Backlog::Counted(Kind::Run, left(evaluations), 0.0),
                None => Backlog::Runs(left(self.optimiser_runs)),
            }),
            _ => None,
        };
        if let (Some(progress), Some(stage)) = (evaluations, self.stages.iter_mut().find(is_search))
        {
            (stage.done, stage.wanted) = (progress.done, progress.wanted);
            stage.of = "evaluations of the runs that go on".to_owned();
        }
        self.live = Some(Live::of(running, missing));
        self
    }

    /// Verification samples of all optima chosen so far.
    #[must_use]
    pub fn verified(&self) -> Progress {
        let all = self.optima.iter().map(|optimum| optimum.verified);
        all.fold(Progress { done: 0, wanted: 0 }, sum)
    }

    /// The stages of a campaign that verifies with at most so many samples, with an enrichment or without.
    fn each_stage(&self, to_verify: u64, enriches: bool) -> Vec<StageProgress> {
        let all_chosen = self.stage >= Stage::Verify;
        Stage::WORK
            .into_iter()
            .filter(|stage| enriches || *stage != Stage::Enrich)
            .map(|name| {
                let state = match name.cmp(&self.stage) {
                    Ordering::Less => "done",
                    Ordering::Equal => "current",
                    Ordering::Greater => "ahead",
                };
                let is_done = u64::from(state == "done");
                let (done, wanted, of) = match name {
                    Stage::Doe => (self.designs.made, self.designs.wanted, "designs"),
                    Stage::Sample if state == "done" => {
                        (self.samples.done, self.samples.done, "samples")
                    }
                    Stage::Sample => {
                        let left = self.missing().0.round() as u64;
                        (self.samples.done, self.samples.done + left, "samples")
                    }
                    Stage::Fit => (is_done, 1, "models"),
                    Stage::Optimise => {
                        let Progress { done, wanted } = self.optimiser_runs;
                        (done, wanted, "runs")
                    }
                    Stage::Enrich => {
                        let samples = self.enrichment.map(|enrichment| enrichment.samples);
                        let (done, wanted) = samples.map_or((0, 0), |s| (s.done, s.wanted));
                        (done, wanted, "samples of the round")
                    }
                    Stage::Verify | Stage::Done => {
                        let Progress { done, wanted } = self.verified();
                        let wanted = if all_chosen { wanted } else { to_verify };
                        (done, wanted, "verification samples")
                    }
                };
                StageProgress {
                    name,
                    state: state.to_owned(),
                    done,
                    wanted,
                    of: of.to_owned(),
                    wall_seconds: None,
                    cpu_seconds: None,
                }
            })
            .collect()
    }

    /// The stage, for people: of rounds of infill, which one.
    #[must_use]
    pub fn stage_name(&self) -> String {
        match &self.enrichment {
            Some(enrichment) if self.stage == Stage::Enrich => {
                format!("enrichment round {}", enrichment.round)
            }
            _ => self.stage.name().to_owned(),
        }
    }

    /// What a round of infill waits for, while there is one.
    #[must_use]
    pub fn round_sentence(&self) -> Option<String> {
        let enrichment = self.enrichment.filter(|_| self.stage == Stage::Enrich)?;
        let Progress { done, wanted } = enrichment.samples;
        let round = enrichment.round;
        Some(if done < wanted {
            format!("round {round} of the enrichment has {done} of its {wanted} samples")
        } else {
            format!(
                "round {round} of the enrichment has its samples: the coordinator itself decides the next one"
            )
        })
    }

    /// About how many samples of the DoE are missing, with the standard error of that number: of the
    /// designs that have not been tried, as many are taken to get samples as of the others.
    #[must_use]
    pub fn missing(&self) -> (f64, f64) {
        let Designs {
            wanted,
            done,
            simulable,
            ruled_out,
            ..
        } = self.designs;
        let sampled = simulable.saturating_sub(ruled_out);
        let (share, variance) = if done > 0 {
            let share = sampled as f64 / done as f64;
            (share, share * (1.0 - share) / done as f64)
        } else {
            (1.0, 0.0)
        };
        let untried = wanted.saturating_sub(done) as f64;
        let per_design = self.samples.per_design as f64;
        let expected = (sampled as f64 + share * untried) * per_design;
        let left = (expected - self.samples.done as f64).max(0.0);
        (left, untried * per_design * variance.sqrt())
    }
}

fn sum(a: Progress, b: Progress) -> Progress {
    Progress {
        done: a.done + b.done,
        wanted: a.wanted + b.wanted,
    }
}
