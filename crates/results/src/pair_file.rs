//! The pair file of an optimum, for `coordinator simulate`.

use anyhow::{Context as _, anyhow, bail};
use problem::formulation::Problem;
use problem::optimise::{RunResult, Solution};
use problem::{Approach, PairFile};
use stages::names;
use stages::optima::{self, NoOptimum, Optimum};
use store::Store;

use crate::optima::Optima;
use crate::snapshot;

/// The approach whose optimum is recommended.
///
/// # Errors
///
/// The store cannot be read, or no approach has a feasible design.
pub async fn recommended(store: &Store) -> anyhow::Result<Approach> {
    let optima = Optima::read(store, &snapshot::problem(store).await?).await?;
    let best = optima.recommended();
    let best = best.context(
        "no optimum is recommended yet: none is feasible, fully verified and within all limits. Name an approach with \
         --approach, and add --infeasible if it found no feasible design",
    )?;
    Ok(best.optimum.approach)
}

/// The pair file of the design that `approach` found, which `coordinator simulate` computes with the
/// campaign's load, material, wear and limits.
///
/// # Errors
///
/// The store cannot be read, the approach has no feasible design, or an external program simulates the
/// campaign.
pub async fn of_optimum(store: &Store, approach: Approach) -> anyhow::Result<PairFile> {
    let problem = gears(store).await?;
    let optimum = stored(store, &problem, approach).await?;
    let found = optimum.found_or_sentence().map_err(|why| {
        let searched = match optimum.found {
            Err(NoOptimum::NoneFeasible)
                if !matches!(approach, Approach::BestOfDoe | Approach::EnrichedKriging) =>
            {
                "; --infeasible writes the design of its runs that violates the constraints least"
            }
            _ => "",
        };
        anyhow!(
            "approach {} found no design: {why}{searched}",
            approach.name()
        )
    })?;
    pair(&problem, found)
}

/// The pair file of an infeasible design as text, and the constraints that the design breaks, in words. If no design
/// that the approach tried is feasible, this is the design that violates the constraints least among those that its
/// runs ended with under the penalised objective. Comments in the file say so.
///
/// # Errors
///
/// The store cannot be read, the approach has a feasible design or no run that ended with one that can be simulated, or
/// an external program simulates the campaign.
pub async fn of_least_violation(
    store: &Store,
    approach: Approach,
) -> anyhow::Result<(String, String)> {
    let problem = gears(store).await?;
    let name = approach.name();
    let optimum = stored(store, &problem, approach).await?;
    if optimum.found.is_ok() {
        bail!("approach {name} found a feasible design: leave out --infeasible");
    }
    let mut least: Option<(f64, Solution)> = None;
    for row in store.optimiser_runs().await? {
        if names::approach_and_start(row.stream).is_none_or(|(of, _)| of != approach) {
            continue;
        }
        let run: RunResult = serde_json::from_str(&row.result_json)?;
        let Some(ended) = run.printed else { continue };
        let violation = problem.violation(&ended.criteria);
        if least.as_ref().is_none_or(|(known, _)| violation < *known) {
            least = Some((violation, ended));
        }
    }
    let (_, found) = least.with_context(|| {
        format!("no run of approach {name} ended with a design that can be simulated")
    })?;
    let broken = problem.constraints(&found.criteria).into_iter();
    let broken: Vec<String> = broken
        .filter(|constraint| !constraint.holds())
        .map(|constraint| constraint.to_string())
        .collect();
    let broken = broken.join(", ");
    let text = pair(&problem, &found)?.to_toml();
    let head = format!(
        "# INFEASIBLE: approach {name} of campaign {} found no feasible design. This one violates the constraints least:\n\
         # {broken}\n",
        problem.campaign().name
    );
    Ok((head + &text, broken))
}

/// The problem of a campaign that the built-in model simulates.
async fn gears(store: &Store) -> anyhow::Result<Problem> {
    let problem = snapshot::problem(store).await?;
    let campaign = problem.campaign();
    if campaign.is_external() {
        bail!(
            "campaign {} is simulated by an external program: `simulate` computes a pair file with \
             the built-in model only",
            campaign.name
        );
    }
    Ok(problem)
}

async fn stored(store: &Store, problem: &Problem, approach: Approach) -> anyhow::Result<Optimum> {
    let mut optima = optima::stored(store, problem).await?;
    if let Some(place) = optima.iter().position(|one| one.approach == approach) {
        return Ok(optima.swap_remove(place));
    }
    let known: Vec<&str> = optima.iter().map(|one| one.approach.name()).collect();
    bail!(
        "{} holds no optimum of approach {}; it holds those of: {}",
        store.path().display(),
        approach.name(),
        if known.is_empty() {
            "none".to_owned()
        } else {
            known.join(", ")
        }
    )
}

fn pair(problem: &Problem, found: &Solution) -> anyhow::Result<PairFile> {
    let sections = problem.campaign().gears();
    let sections = sections.context("a pair file is of gears")?;
    Ok(PairFile::of_design(sections, &found.design))
}
