//! How far a campaign is, read from its store.

use std::collections::BTreeMap;
use std::time::Duration;

use campaign::Campaign;
use serde::{Deserialize, Serialize};
use store::Store;

use crate::board;
use crate::snapshot;

/// After this long without a word, a worker is taken not to help any more.
const GONE: Duration = Duration::from_secs(15);

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
    /// Finished runs of optimisers and how many there will be.
    pub optimiser_runs: Progress,
    /// The rounds of infill; absent before the first one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enrichment: Option<Enrichment>,
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

/// What only the running coordinator knows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Live {
    /// Designs, points and runs that wait; leases that are out; leases that were delivered since the
    /// start; designs, points and runs that were given up.
    pub jobs_queued: u64,
    /// See `jobs_queued`.
    pub jobs_leased: u64,
    /// See `jobs_queued`.
    pub jobs_done: u64,
    /// See `jobs_queued`.
    pub jobs_given_up: u64,
    /// Samples stored per second, lately.
    pub samples_per_second: f64,
    /// Seconds until the stage ends at the rate of late, while samples of the DoE, of a round of
    /// infill or of the optima are taken or optimisers run.
    pub eta_seconds: Option<f64>,
    /// Whether leasing was stopped.
    pub draining: bool,
    /// The workers.
    pub workers: Vec<Worker>,
}

/// A worker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Worker {
    /// Where it runs.
    pub host: String,
    /// How many leases it computes at once.
    pub slots: u32,
    /// Leases that it holds.
    pub leased: u64,
    /// Leases that it delivered.
    pub completed: u64,
    /// What failed on it or died with it.
    pub failed: u64,
    /// Seconds since it was heard of.
    pub silent_seconds: f64,
    /// Whether it gets nothing for a while, having failed too many.
    pub set_aside: bool,
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
    pub feasible: u64,
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
    /// Whether there will be no more rounds.
    pub ended: bool,
}

/// A chosen optimum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Optimum {
    /// The approach's name.
    pub approach: String,
    /// Its criterion, µm; absent when no feasible design was found.
    pub criterion_um: Option<f64>,
    /// Fresh samples in the store, and how many there will be.
    pub verified: Progress,
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
    let wanted_runs = 3 * u64::from(campaign.optimise.starts);
    let verify = u64::from(campaign.verify.samples);
    let counts: BTreeMap<String, u64> = store.verify_counts().await?.into_iter().collect();
    let mut optima = Vec::new();
    for row in snapshot::optima(store).await? {
        let done = counts.get(&row.approach).copied().unwrap_or(0);
        optima.push(Optimum {
            criterion_um: row.feasible.then_some(row.criterion_um),
            verified: Progress {
                done,
                wanted: if row.feasible { verify } else { 0 },
            },
            approach: row.approach,
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
        optima
            .iter()
            .any(|optimum| optimum.approach == approach.name())
    };
    let all_chosen = campaign::Approach::of(&campaign).all(chosen);
    let enrichment = enrichment(store, &counts).await?;
    let is_left = |approach| approach != campaign::Approach::EnrichedKriging && !chosen(approach);
    let only_enriched = !all_chosen && !campaign::Approach::of(&campaign).any(is_left);
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
        schema_version: 2,
        campaign: row.name,
        campaign_digest: row.digest,
        program_version: row.program_version,
        finished: stage == "done",
        stage: stage.to_owned(),
        designs: Designs {
            wanted,
            made: progress.designs,
            done: progress.criteria_done,
            feasible: progress.feasible,
            ruled_out: progress.ruled_out,
        },
        samples: Samples {
            per_design,
            done: progress.samples,
        },
        samples_digest: store.samples_digest().await?,
        optimiser_runs: Progress {
            done: progress.optimiser_runs,
            wanted: wanted_runs,
        },
        enrichment,
        optima,
        failures: progress.failures,
        failure_groups: groups.map(FailureGroup::from).collect(),
        live: None,
    })
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
        failed: infill.iter().filter(|row| row.failed).count() as u64,
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
    pub fn with(self, live: board::Live) -> Self {
        let rate = live.samples_per_second;
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
        let silent_for = |seen: Duration| live.now.saturating_sub(seen);
        let present = live.workers.iter();
        let present = present.filter(|worker| silent_for(worker.last_seen) < GONE);
        let slots: usize = present.map(|worker| worker.slots).sum();
        let eta_seconds = match (self.stage.as_str(), live.run_seconds) {
            ("optimise", Some(seconds)) if slots > 0 => {
                Some(left(self.optimiser_runs) * seconds / slots as f64)
            }
            _ => missing.filter(|_| rate > 0.0).map(|missing| missing / rate),
        };
        let count = |count: usize| count as u64;
        let workers = live.workers.into_iter().map(|worker| Worker {
            host: worker.host,
            slots: u32::try_from(worker.slots).unwrap_or(u32::MAX),
            leased: count(worker.leased),
            completed: worker.delivered,
            failed: worker.failed + worker.crashed,
            silent_seconds: live.now.saturating_sub(worker.last_seen).as_secs_f64(),
            set_aside: worker.suspended_until.is_some_and(|until| until > live.now),
        });
        let live = Live {
            jobs_queued: count(live.counts.free + live.counts.waiting),
            jobs_leased: count(live.counts.leased),
            jobs_done: live.counts.delivered,
            jobs_given_up: count(live.counts.given_up),
            samples_per_second: rate,
            eta_seconds,
            draining: live.is_draining,
            workers: workers.collect(),
        };
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
    /// many are taken to be feasible as of the others.
    #[must_use]
    pub fn missing(&self) -> f64 {
        let Designs {
            wanted,
            done,
            feasible,
            ruled_out,
            ..
        } = self.designs;
        let feasible = feasible.saturating_sub(ruled_out);
        let share = if done > 0 {
            feasible as f64 / done as f64
        } else {
            1.0
        };
        let expected = (feasible as f64 + share * wanted.saturating_sub(done) as f64)
            * self.samples.per_design as f64;
        (expected - self.samples.done as f64).max(0.0)
    }
}

/// The status for people.
#[must_use]
pub fn describe(status: &Status) -> String {
    use std::fmt::Write as _;
    let mut text = String::new();
    let Status {
        designs,
        samples,
        optimiser_runs,
        ..
    } = status;
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        "campaign        {} ({})",
        status.campaign,
        &status.campaign_digest[..12]
    );
    let _ = writeln!(text, "stage           {}", status.stage_name());
    let _ = writeln!(
        text,
        "designs         {} of {} done, {} can be simulated{}",
        designs.done,
        designs.wanted,
        designs.feasible,
        match designs.ruled_out {
            0 => String::new(),
            count => format!(", {count} of them ruled out by constraints"),
        }
    );
    let _ = writeln!(
        text,
        "samples         {} ({} per design)",
        samples.done, samples.per_design
    );
    let _ = writeln!(text, "samples digest  {}", status.samples_digest);
    let _ = writeln!(
        text,
        "optimiser runs  {} of {}",
        optimiser_runs.done, optimiser_runs.wanted
    );
    if let Some(enrichment) = &status.enrichment {
        let Enrichment {
            round,
            samples,
            points,
            failed,
            ended,
        } = enrichment;
        let state = if *ended {
            "ended".to_owned()
        } else {
            format!("{} of {} samples", samples.done, samples.wanted)
        };
        let failed = match failed {
            0 => String::new(),
            failed => format!(", {failed} of them failed"),
        };
        let _ = writeln!(
            text,
            "enrichment      round {round}: {state}; {points} infill points{failed}"
        );
    }
    for optimum in &status.optima {
        let criterion = optimum.criterion_um.map_or_else(
            || "no feasible design".to_owned(),
            |value| format!("{value:.4} µm"),
        );
        let Progress { done, wanted } = optimum.verified;
        let _ = writeln!(
            text,
            "optimum         {:<16} {criterion}, {done} of {wanted} fresh samples",
            optimum.approach
        );
    }
    let _ = writeln!(text, "failures        {}", status.failures);
    for group in &status.failure_groups {
        let FailureGroup {
            kind,
            cause,
            count,
            last_job,
            ..
        } = group;
        let _ = writeln!(text, "  {count:>6} x {kind}: {cause} (last: {last_job})");
    }
    if let Some(live) = &status.live {
        describe_live(live, &mut text);
    }
    text
}

fn describe_live(live: &Live, text: &mut String) {
    use std::fmt::Write as _;
    let Live {
        jobs_queued,
        jobs_leased,
        jobs_done,
        jobs_given_up,
        ..
    } = live;
    let _ = writeln!(
        text,
        "jobs            {jobs_leased} leased, {jobs_queued} queued, {jobs_done} done, \
         {jobs_given_up} given up{}",
        if live.draining { "; draining" } else { "" }
    );
    let eta = live
        .eta_seconds
        .map_or_else(String::new, |seconds| format!(", {} to go", span(seconds)));
    let _ = writeln!(
        text,
        "rate            {:.0} samples per second{eta}",
        live.samples_per_second
    );
    for worker in &live.workers {
        let Worker {
            host,
            slots,
            leased,
            completed,
            failed,
            silent_seconds,
            set_aside,
        } = worker;
        let aside = if *set_aside { ", set aside" } else { "" };
        let _ = writeln!(
            text,
            "worker          {host}: {slots} slots, {leased} jobs, {completed} done, {failed} \
             failed, heard of {silent_seconds:.1} s ago{aside}"
        );
    }
}

/// A length of time for people.
#[must_use]
pub fn span(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} d", s / 86_400.0),
    }
}
