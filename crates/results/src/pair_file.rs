//! The pair file of an optimum, for `coordinator simulate`.

use anyhow::{Context as _, bail};
use problem::{Approach, PairFile};
use stages::optima;
use store::Store;

use crate::snapshot;

/// The pair file of the design that `approach` found, which `coordinator simulate` computes with the
/// campaign's load, material, wear and limits.
///
/// # Errors
///
/// The store cannot be read, the approach has no design yet, or an external program simulates the
/// campaign.
pub async fn of_optimum(store: &Store, approach: Approach) -> anyhow::Result<PairFile> {
    let problem = snapshot::problem(store).await?;
    let campaign = problem.campaign();
    if campaign.is_external() {
        bail!(
            "campaign {} is simulated by an external program: `simulate` computes a pair file with \
             the built-in model only",
            campaign.name
        );
    }
    let name = approach.name();
    let optima = optima::stored(store, &problem).await?;
    let Some(optimum) = optima.iter().find(|optimum| optimum.approach == approach) else {
        let known: Vec<&str> = optima
            .iter()
            .map(|optimum| optimum.approach.name())
            .collect();
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
    let sections = campaign.gears();
    let sections = sections.context("a pair file is of gears")?;
    let found = optimum.found_or_sentence();
    let found = found.map_err(|why| anyhow::anyhow!("approach {name} found no design: {why}"))?;
    Ok(PairFile::of_design(sections, &found.design))
}
