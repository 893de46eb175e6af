//! How far a campaign is, read from its store.

use campaign::Campaign;
use serde::Serialize;
use store::Store;

use crate::snapshot;

/// What `coordinator status --json` prints.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// The first stage that is not: `doe`, `sample`, `fit`, `optimise`, `verify` or `done`.
    pub stage: &'static str,
    /// Designs of the DoE: wanted, made, simulated or refused, and those that can be simulated.
    pub designs: Designs,
    /// Samples of the DoE.
    pub samples: Samples,
    /// SHA-256 of the samples table, in (design, sample) order.
    pub samples_digest: String,
    /// Finished runs of optimisers and how many there will be.
    pub optimiser_runs: Progress,
    /// Chosen optima.
    pub optima: Vec<Optimum>,
    /// Failures on record.
    pub failures: u64,
}

/// Counts of designs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Designs {
    /// n.
    pub wanted: u64,
    /// Points in the store.
    pub made: u64,
    /// Designs whose criteria are stored.
    pub done: u64,
    /// Those of them that could be simulated.
    pub feasible: u64,
}

/// Counts of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Samples {
    /// k.
    pub per_design: u64,
    /// Samples in the store.
    pub done: u64,
}

/// Done of wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Progress {
    /// How many are done.
    pub done: u64,
    /// How many there will be.
    pub wanted: u64,
}

/// A chosen optimum.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    let mut optima = Vec::new();
    for row in snapshot::optima(store).await? {
        let done = store.verify_samples(&row.approach).await?.len() as u64;
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
    let sampled = progress.designs == wanted
        && progress.criteria_done == wanted
        && progress.samples >= progress.feasible * per_design;
    let verified = optima
        .iter()
        .all(|optimum| optimum.verified.done >= optimum.verified.wanted);
    let stage = if progress.designs == 0 {
        "doe"
    } else if !sampled {
        "sample"
    } else if optima.iter().any(|optimum| optimum.approach == "kriging") {
        match (optima.len() == campaign::Approach::ALL.len(), verified) {
            (false, _) => "optimise",
            (true, false) => "verify",
            (true, true) => "done",
        }
    } else if progress.models == 0 {
        "fit"
    } else {
        "optimise"
    };
    Ok(Status {
        schema_version: 1,
        campaign: row.name,
        campaign_digest: row.digest,
        program_version: row.program_version,
        finished: stage == "done",
        stage,
        designs: Designs {
            wanted,
            made: progress.designs,
            done: progress.criteria_done,
            feasible: progress.feasible,
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
        optima,
        failures: progress.failures,
    })
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
    let _ = writeln!(text, "stage           {}", status.stage);
    let _ = writeln!(
        text,
        "designs         {} of {} done, {} can be simulated",
        designs.done, designs.wanted, designs.feasible
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
    for optimum in &status.optima {
        let criterion = optimum.criterion_um.map_or_else(
            || "no feasible design".to_owned(),
            |value| format!("{value:.4} µm"),
        );
        let Progress { done, wanted } = optimum.verified;
        let _ = writeln!(
            text,
            "optimum         {:<12} {criterion}, {done} of {wanted} fresh samples",
            optimum.approach
        );
    }
    let _ = writeln!(text, "failures        {}", status.failures);
    text
}
