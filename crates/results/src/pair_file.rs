//! The pair file of an optimum, for `coordinator simulate`.

use anyhow::{Context as _, bail};
use campaign::formulation::Problem;
use campaign::{Approach, Campaign, PairFile};
use stages::optima;
use store::Store;

/// The pair file of the design that `approach` found, which `coordinator simulate` computes with the
/// campaign's load, material, wear and limits.
///
/// # Errors
///
/// The store cannot be read, the approach has no design yet, or an external program simulates the
/// campaign.
pub async fn of_optimum(store: &Store, approach: Approach) -> anyhow::Result<PairFile> {
    let row = store.campaign().await?;
    let campaign = Campaign::parse("the store's campaign file", &row.file_text)?;
    if campaign.is_external() {
        bail!(
            "campaign {} is simulated by an external program: `simulate` computes a pair file with \
             the built-in model only",
            campaign.name
        );
    }
    let name = approach.name();
    let rows = optima::stored(store).await?;
    let Some(row) = rows.iter().find(|row| row.approach == name) else {
        let known: Vec<&str> = rows.iter().map(|row| row.approach.as_str()).collect();
        bail!(
            "{} holds no optimum of approach {name}; it holds those of: {}",
            store.path().display(),
            if known.is_empty() {
                "none".to_owned()
            } else {
                known.join(", ")
            }
        );
    };
    let problem = Problem::new(campaign);
    let sections = problem.campaign().gears();
    let sections = sections.context("a pair file is of gears")?;
    let design = optima::optimum_design(&problem, row)
        .with_context(|| format!("approach {name} found no design: {}", row.note))?;
    Ok(PairFile::of_design(sections, &design.gears()))
}
