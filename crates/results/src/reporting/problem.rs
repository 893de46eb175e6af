//! The report of a campaign with a problem of the user's.

use campaign::formulation::Constraint;
use campaign::{Criteria, Design};
use report::{NamedValue, ProblemOptimum, ProblemReport, Summary};
use stages::optima::{approach_of, optimum_design, sentence};
use store::{OptimumRow, Store};

use super::sources::Sources;
use super::{costs, header, model, notes, summary};
use crate::percentile::percentile;

/// Gathers the data of an external campaign's report.
pub(super) async fn gather(
    store: &Store,
    sources: &Sources,
    summary: Summary,
) -> anyhow::Result<ProblemReport> {
    let digest = store.samples_digest().await?;
    let stages = costs(store, sources).await?;
    let sampled = sources.problem.sampled();
    let best = summary::best(sources);
    let optima = sources.optima.iter().map(|row| optimum(sources, row));
    Ok(ProblemReport {
        header: header(sources, digest, stages),
        summary,
        response: sampled.name.to_string(),
        unit: sampled.unit.to_string(),
        optima: optima.collect::<anyhow::Result<_>>()?,
        kriging: model::kriging(sources, best.as_ref())?,
        notes: notes::notes(sources, &store.failures().await?),
    })
}

fn optimum(sources: &Sources, row: &OptimumRow) -> anyhow::Result<ProblemOptimum> {
    let problem = &sources.problem;
    let criteria: Option<Criteria> = serde_json::from_str(&row.criteria_json)?;
    let constraints = criteria.map_or_else(Vec::new, |criteria| problem.constraints(&criteria));
    let variables = |design: Design| {
        let values = problem.variables().iter().zip(design.values());
        let named = values.map(|(variable, value)| NamedValue {
            name: variable.name.to_string(),
            unit: variable.unit.to_string(),
            value: *value,
        });
        named.collect::<Vec<_>>()
    };
    let verified = sources.verified.get(&row.approach);
    Ok(ProblemOptimum {
        approach: approach_of(&row.approach).map_or_else(
            || row.approach.clone(),
            |a| problem.approach_name(a).to_owned(),
        ),
        design: optimum_design(problem, row)
            .map(variables)
            .ok_or_else(|| sentence(problem, row)),
        criterion: row.criterion,
        p90: percentile(
            &problem.campaign().sampling,
            verified.map_or(&[][..], Vec::as_slice),
        ),
        constraints: constraints.into_iter().map(limited).collect(),
        simulator_calls: row.simulator_calls,
    })
}

/// A constrained quantity, and whether its limit holds.
pub(super) fn limited(constraint: Constraint) -> (NamedValue, bool) {
    let holds = constraint.holds();
    let value = NamedValue {
        name: constraint.name.into_owned(),
        unit: constraint.unit.trim_start().to_owned(),
        value: constraint.value,
    };
    (value, holds)
}
