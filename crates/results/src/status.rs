//! The progress of a campaign.

mod reading;

use std::cmp::Ordering;

use ledger::Kind;
use problem::file::Aim;
use serde::{Deserialize, Serialize};
use stages::optima::NoOptimum;
use stages::stage::Stage;

pub(crate) use self::reading::of;
pub use self::reading::read;
use crate::estimate::Estimate;
use crate::optima::VerifiedLimit;
use crate::running::{Backlog, CoordinatorState, CoordinatorStatus};

/// The object that `coordinator status --json` prints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Status {
    pub schema_version: u32,
    pub campaign: String,
    /// The digest of the campaign's content.
    pub campaign_digest: String,
    /// The version of the program that made the store.
    pub program_version: String,
    /// Whether every stage is done.
    pub finished: bool,
    /// The first unfinished stage.
    pub stage: Stage,
    /// Every stage of the campaign in order, with how far it is.
    pub stages: Vec<StageProgress>,
    /// Designs of the DoE: wanted, made, simulated or refused, and those that can be simulated.
    pub designs: DesignCounts,
    /// Samples of the DoE.
    pub samples: SampleCounts,
    /// The digest of all samples, whatever their order; see [`store::Store::samples_digest`].
    pub samples_digest: String,
    /// The digest of verification and infill samples; see [`store::Store::point_samples_digest`].
    pub point_samples_digest: String,
    /// Whether the digests were computed from the samples when the store was opened; otherwise they are those
    /// on record.
    pub digests_checked: bool,
    /// Finished runs of optimisers, and their total number.
    pub optimiser_runs: Progress,
    /// Runs on an external simulator that have begun and are not finished; those on the built-in one take
    /// seconds and are not among them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unfinished_runs: Vec<UnfinishedRun>,
    /// The rounds of infill; absent before the first one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enrichment: Option<EnrichmentStatus>,
    /// Name of the optimised measure, such as P90.
    pub measure: String,
    /// Whether small or large values of the response are preferred.
    #[serde(default)]
    pub aim: Aim,
    /// The unit of the optima's criteria; empty for a number without one.
    pub unit: String,
    /// Chosen optima.
    pub optima: Vec<OptimumStatus>,
    /// Failures on record.
    pub failures: u64,
    /// The failures grouped by cause.
    pub failure_groups: Vec<FailureGroup>,
    /// Reasons to doubt the results, in sentences.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The running coordinator; absent when the store alone was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub live: Option<CoordinatorStatus>,
}

/// The progress of one stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageProgress {
    /// The stage.
    pub name: Stage,
    /// `done`, `current` or `ahead`. Work that needs no samples, such as runs of an optimiser on a
    /// deterministic criterion, is done before its stage is the current one.
    pub state: String,
    pub done: u64,
    /// The amount of work, as far as it is known.
    pub wanted: u64,
    /// The unit of `done` and `wanted`.
    pub of: String,
    /// Seconds that the campaign has waited for the stage; absent before it begins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall_seconds: Option<f64>,
    /// CPU time, s; absent until the campaign is finished.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_seconds: Option<f64>,
}

/// Failures with one cause.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailureGroup {
    /// `crash`, `failure` or `quarantine`.
    pub kind: String,
    pub cause: String,
    pub count: u64,
    /// The message of the last one.
    pub last_error: String,
    /// The job of the last one.
    pub last_job: String,
}

/// Counts of designs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct DesignCounts {
    pub wanted: u64,
    /// Designs in the store.
    pub made: u64,
    /// Designs whose criteria are stored.
    pub done: u64,
    /// Simulable ones among them.
    pub simulable: u64,
    /// Simulable ones that get no samples, because their constraints rule them out.
    pub ruled_out: u64,
}

/// Counts of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SampleCounts {
    /// k, the samples of each design.
    pub per_design: u64,
    /// Samples in the store.
    pub done: u64,
}

/// A count of done work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    pub done: u64,
    pub wanted: u64,
}

/// A run of an optimiser that is not finished.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnfinishedRun {
    /// The name of its job.
    pub name: String,
    /// Evaluations; `wanted` does not count continuations.
    pub evaluations: Progress,
}

/// The rounds of infill.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EnrichmentStatus {
    /// The round that is being sampled, from 1; the last one once the enrichment has ended.
    pub round: u64,
    /// Samples of its points.
    pub samples: Progress,
    /// Infill points of all rounds.
    pub points: u64,
    /// Failed infill points.
    pub failed: u64,
    /// Infill points that got no samples because they break a constraint.
    pub ruled_out: u64,
    /// Whether no round follows.
    pub ended: bool,
}

/// A chosen optimum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OptimumStatus {
    /// The approach's name.
    pub approach: String,
    /// The criterion, in the status's unit; absent when no feasible design was found.
    pub criterion: Option<f64>,
    /// Why there is no design: `no-model`, `none-feasible`, `none-simulable` or `nothing-computed`; absent
    /// when there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub none: Option<NoOptimum>,
    /// A remark, such as why an approach has no model; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub note: String,
    /// Verification samples in the store, and how many there will be.
    pub verified: Progress,
    /// The measure of the verification samples, once all are there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measure: Option<Estimate>,
    /// The constraints on measures of samples, once all verification samples are there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<VerifiedLimit>,
    /// The difference between the measure and that of the best optimum, positive if the optimum is worse. Its interval
    /// may include negative values. Absent for the best optimum, and for an approach that moves other variables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub behind: Option<Estimate>,
}

impl Status {
    /// Adds the state of the running coordinator.
    #[must_use]
    pub fn with(mut self, running: CoordinatorState) -> Self {
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
                // Then designs need more samples for the precision: their number is not known.
                (samples > 0.0).then_some(Backlog::Counted(Kind::Design, samples, error))
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
        self.live = Some(CoordinatorStatus::of(running, missing));
        self
    }

    /// Verification samples of all optima chosen so far.
    #[must_use]
    pub fn verified(&self) -> Progress {
        let all = self.optima.iter().map(|optimum| optimum.verified);
        all.fold(Progress { done: 0, wanted: 0 }, sum)
    }

    /// The progress of each stage; `to_verify` is the number of verification samples before the optima are chosen.
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

    /// The stage's name; during the enrichment, with the round.
    #[must_use]
    pub fn stage_name(&self) -> String {
        match &self.enrichment {
            Some(enrichment) if self.stage == Stage::Enrich => {
                format!("enrichment round {}", enrichment.round)
            }
            _ => self.stage.to_string(),
        }
    }

    /// The progress of the current round of infill, in a sentence; `None` outside the enrichment.
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

    /// An estimate of the number of missing samples of the DoE, with its standard error. The share of designs that get
    /// samples is assumed to be the same among the designs that have not been tried. Further samples for a precision are
    /// not counted.
    #[must_use]
    pub fn missing(&self) -> (f64, f64) {
        let DesignCounts {
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
