//! Reads a finished campaign.

use anyhow::Context as _;
use problem::formulation::Problem;
use problem::optimise::{self, RunResult};
use problem::task::Run;
use problem::{Approach, Campaign, Design};
use rayon::prelude::*;
use results::optima::{Optima, VerifiedOptimum};
use results::status;
use store::Store;

use crate::refusal::UnfinishedCampaign;

/// A design that an approach found, with its verification samples.
#[derive(Debug, Clone, PartialEq)]
pub struct FeasibleOptimum {
    pub approach: Approach,
    pub design: Design,
    /// Verification samples of ΔSTE, µm.
    pub verified: Vec<f64>,
}

/// The problem of the campaign in `store`, which must be that of `campaign` and finished.
///
/// # Errors
///
/// The store holds another campaign, or is not finished, or cannot be read.
pub async fn problem(store: &Store, campaign: &Campaign) -> anyhow::Result<Problem> {
    let stored = store.campaign().await?;
    if stored.digest != campaign.digest() {
        let changes = Campaign::stored(&stored.file_text)
            .map_or_else(|_| Vec::new(), |stored| campaign.changes_from(&stored));
        return Err(store::Error::other_campaign(
            store.path(),
            [&stored.name, &stored.digest],
            [&campaign.name, &campaign.digest()],
            changes,
        )
        .into());
    }
    let status = status::read(store).await?;
    if !status.finished {
        return Err(UnfinishedCampaign {
            store: store.path().display().to_string(),
            stage: status.stage.to_string(),
        }
        .into());
    }
    Ok(Problem::new(campaign.clone()))
}

impl FeasibleOptimum {
    /// The optimum of an approach; `None` if it is not feasible.
    fn of(problem: &Problem, verified: &VerifiedOptimum) -> Option<Self> {
        let found = verified.optimum.feasible()?;
        Some(Self {
            approach: verified.optimum.approach,
            design: found.design.clone(),
            verified: verified.values(problem),
        })
    }
}

/// The optimum of an approach, or the recommended one.
///
/// # Errors
///
/// The store cannot be read, or the approach has no feasible optimum.
pub async fn optimum(
    store: &Store,
    problem: &Problem,
    approach: Option<Approach>,
) -> anyhow::Result<FeasibleOptimum> {
    let optima = Optima::read(store, problem).await?;
    let (optimum, none) = match approach {
        Some(approach) => (
            optima.of(approach),
            format!("approach {} found no feasible design", approach.name()),
        ),
        None => (
            optima.recommended(),
            "no approach found a feasible design".to_owned(),
        ),
    };
    optimum
        .and_then(|one| FeasibleOptimum::of(problem, one))
        .context(none)
}

/// The values of the variables that the DoE does not vary, which all its designs share.
#[must_use]
pub fn base(problem: &Problem, optima: &Optima) -> Design {
    let base = stages::optima::base(problem, optima.iter().map(|one| &one.optimum));
    // Without an optimum the values are those of the campaign file.
    base.unwrap_or_else(|| problem.base().clone())
}

/// [`base`] for a campaign without a store: if the variables come from the optimum without wear, this
/// searches for it.
///
/// # Errors
///
/// A search fails.
pub fn searched_base(problem: &Problem) -> anyhow::Result<Design> {
    let printed = problem.base().clone();
    if problem.base_from().is_none() {
        return Ok(printed);
    }
    let run = |start| {
        let run = Run {
            approach: Approach::Nominal,
            start,
            base: printed.clone(),
            models: Vec::new(),
            from: None,
        };
        optimise::run(problem, &run).map_err(anyhow::Error::msg)
    };
    let starts = 0..problem.campaign().optimise.starts;
    let results: anyhow::Result<Vec<RunResult>> = starts.into_par_iter().map(run).collect();
    let results = results?;
    let best = results
        .iter()
        .filter_map(|result| result.best.as_ref())
        .min_by(|a, b| a.criterion.total_cmp(&b.criterion));
    Ok(best.map_or(printed, |found| problem.base_of(&found.design)))
}
