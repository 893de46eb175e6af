//! How far a campaign is, read from its store.

use std::collections::BTreeMap;

use campaign::Campaign;
use serde::{Deserialize, Serialize};
use stages::optima;
use store::Store;

use crate::live::{Live, Running};

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
    /// The first stage that is not: `doe`, `sample`, `fit`, `optimise`, `enrich`, `verify` or `done`.
    pub stage: String,
    /// Designs of the DoE: wanted, made, simulated or refused, and those that can be simulated.
    pub designs: Designs,
    /// Samples of the DoE.
    pub samples: Samples,
    /// The digest of all samples, whatever their order; see [`store::Store::samples_digest`].
    pub samples_digest: String,
    /// The same of verification and infill samples; see [`store::Store::verify_samples_digest`].
    #[serde(default)]
    pub verify_samples_digest: String,
    /// Whether the digests were compared with what the store held when it was opened; as recorded
    /// otherwise.
    #[serde(default)]
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
    /// The unit of the optima's criteria; empty for a number without one.
    #[serde(default = "micrometres")]
    pub unit: String,
    /// Chosen optima.
    pub optima: Vec<Optimum>,
    /// Failures on record.
    pub failures: u64,
    /// The same, grouped by cause.
    pub failure_groups: Vec<FailureGroup>,
    /// What only the running coordinator knows; absent when the store alone was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub live: Option<Live>,
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
    #[serde(default)]
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
    #[serde(default)]
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
    pub criterion_um: Option<f64>,
    /// Fresh samples in the store, and how many there will be.
    pub verified: Progress,
}

/// The unit of earlier versions, which knew gears only.
fn micrometres() -> String {
    "µm".to_owned()
}

/// Reads the status of the campaign in `store`.
///
/// # Errors
///
/// The store cannot be read, or its campaign file cannot.
pub async fn read(store: &Store) -> anyhow::Result<Status> {
    let row = store.campaign().await?;
    let campaign = Campaign::parse("the store's campaign file", &row.file_text)?;
    let progress = store.progress().await?;
    let problem = campaign::formulation::Problem::new(campaign.clone());
    let verify = u64::from(campaign.verify.samples);
    let counts: BTreeMap<String, u64> = store.verify_counts().await?.into_iter().collect();
    let mut optima = Vec::new();
    for row in optima::stored(store).await? {
        let done = counts.get(&row.approach).copied().unwrap_or(0);
        optima.push(Optimum {
            criterion_um: row.feasible.then_some(row.criterion_um),
            verified: Progress {
                done,
                wanted: if row.feasible { verify } else { 0 },
            },
            approach: optima::approach_of(&row.approach).map_or_else(
                || row.approach.clone(),
                |approach| problem.approach_name(approach).to_owned(),
            ),
        });
    }
    let wanted = u64::from(campaign.doe.designs);
    let per_design = u64::from(campaign.sampling.samples_per_design);
    // How many samples a precision takes is known only at the end.
    let sampled = progress.responses > 0
        || campaign.sampling.precision_um.is_none()
            && progress.designs == wanted
            && progress.criteria_done == wanted
            && progress.samples >= (progress.feasible - progress.ruled_out) * per_design;
    let verified = optima
        .iter()
        .all(|optimum| optimum.verified.done >= optimum.verified.wanted);
    // Later stages speak for earlier ones: designs that were given up stay without samples.
    let chosen = |approach: campaign::Approach| {
        let name = problem.approach_name(approach);
        optima.iter().any(|optimum| optimum.approach == name)
    };
    let all_chosen = problem.approaches().all(chosen);
    let enrichment = enrichment(store, &counts).await?;
    let is_left = |approach| approach != campaign::Approach::EnrichedKriging && !chosen(approach);
    let only_enriched = !all_chosen && !problem.approaches().any(is_left);
    let stage = if progress.designs < wanted {
        "doe"
    } else if all_chosen {
        if verified { "done" } else { "verify" }
    } else if only_enriched {
        "enrich"
    } else if progress.models > 0 || chosen(campaign::Approach::Kriging) {
        "optimise"
    } else if sampled || chosen(campaign::Approach::BestOfDoe) {
        "fit"
    } else {
        "sample"
    };
    let groups = store.failure_groups().await?.into_iter();
    Ok(Status {
        schema_version: 3,
        campaign: row.name,
        campaign_digest: row.digest,
        program_version: row.program_version,
        finished: stage == "done",
        stage: stage.to_owned(),
        designs: Designs {
            wanted,
            made: progress.designs,
            done: progress.criteria_done,
            simulable: progress.feasible,
            ruled_out: progress.ruled_out,
        },
        samples: Samples {
            per_design,
            done: progress.samples,
        },
        samples_digest: store.samples_digest().await?,
        verify_samples_digest: store.verify_samples_digest().await?,
        digests_checked: store.is_checked(),
        optimiser_runs: Progress {
            done: progress.optimiser_runs,
            wanted: problem.optimiser_runs(),
        },
        unfinished_runs: unfinished_runs(store, &problem).await?,
        enrichment,
        unit: problem.sampled().unit.to_string(),
        optima,
        failures: progress.failures,
        failure_groups: groups.map(FailureGroup::from).collect(),
        live: None,
    })
}

async fn unfinished_runs(
    store: &Store,
    problem: &campaign::formulation::Problem,
) -> Result<Vec<UnfinishedRun>, store::Error> {
    let wanted = u64::from(problem.campaign().optimise.evaluations);
    let runs = store.unfinished_runs().await?.into_iter();
    let run = |(name, done): (String, u64)| UnfinishedRun {
        name: name.trim_start_matches("run ").to_owned(),
        evaluations: Progress { done, wanted },
    };
    Ok(runs.map(run).collect())
}

async fn enrichment(
    store: &Store,
    counts: &BTreeMap<String, u64>,
) -> Result<Option<Enrichment>, store::Error> {
    let rounds = store.rounds().await?;
    let Some(last) = rounds.last() else {
        return Ok(None);
    };
    let infill = store.infill().await?;
    let of_last = infill.iter().filter(|row| row.round == last.round);
    let done = of_last.clone().map(|row| {
        let held = counts.get(&row.name).copied().unwrap_or(0);
        held.min(row.samples)
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
            last_job: group.last_job,
        }
    }
}

impl Status {
    /// Adds what the running coordinator knows.
    #[must_use]
    pub fn with(self, running: Running) -> Self {
        let left = |progress: Progress| progress.wanted.saturating_sub(progress.done) as f64;
        let missing = match self.stage.as_str() {
            "sample" => Some(self.missing()),
            "enrich" => self.enrichment.map(|enrichment| left(enrichment.samples)),
            "verify" => Some(
                self.optima
                    .iter()
                    .map(|optimum| left(optimum.verified))
                    .sum(),
            ),
            _ => None,
        };
        let runs_left = (self.stage == "optimise").then(|| left(self.optimiser_runs));
        let live = Live::of(running, missing, runs_left);
        Self {
            live: Some(live),
            ..self
        }
    }

    /// The stage, for people: of rounds of infill, which one.
    #[must_use]
    pub fn stage_name(&self) -> String {
        match &self.enrichment {
            Some(enrichment) if self.stage == "enrich" => {
                format!("enrichment round {}", enrichment.round)
            }
            _ => self.stage.clone(),
        }
    }

    /// What a round of infill waits for, while there is one.
    #[must_use]
    pub fn round_sentence(&self) -> Option<String> {
        let enrichment = self.enrichment.filter(|_| self.stage == "enrich")?;
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

    /// About how many samples of the DoE are missing: of the designs that have not been tried, as
    /// many are taken to get samples as of the others.
    #[must_use]
    pub fn missing(&self) -> f64 {
        let Designs {
            wanted,
            done,
            simulable,
            ruled_out,
            ..
        } = self.designs;
        let sampled = simulable.saturating_sub(ruled_out);
        let share = if done > 0 {
            sampled as f64 / done as f64
        } else {
            1.0
        };
        let expected = (sampled as f64 + share * wanted.saturating_sub(done) as f64)
            * self.samples.per_design as f64;
        (expected - self.samples.done as f64).max(0.0)
    }
}
