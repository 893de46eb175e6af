//! What an external simulator said of the candidates of the optimiser's runs and of infill points.

use std::io::Write;

use campaign::Approach;
use campaign::formulation::Problem;
use ledger::StreamId;
use stages::names;
use store::{EvaluationRow, Store};

use super::{column, number, optional};
use crate::rows::RowWriter;

/// A row for each evaluation, in the order of approaches, starts and evaluations, infill points last.
pub(super) async fn write<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: &mut RowWriter<W>,
) -> anyhow::Result<()> {
    let mut header = vec!["approach", "start", "evaluation"];
    header.extend(problem.variables().iter().map(|variable| &*variable.name));
    // The response without random effects.
    header.extend(["simulable", "reason", &*problem.sampled().name]);
    header.extend(problem.criteria().iter().map(|criterion| &*criterion.name));
    let percentile = column(problem, "{p}");
    header.extend(["samples", &percentile]);
    out.write_record(&header)?;
    for approach in Approach::OPTIMISED {
        for start in 0..problem.campaign().optimise.starts {
            for row in store.evaluations(names::run(approach, start), 0).await? {
                let first = [
                    problem.approach_name(approach).to_owned(),
                    start.to_string(),
                ];
                let rest = record(problem, row);
                out.write_record(first.into_iter().chain(rest).collect::<Vec<_>>())?;
            }
        }
    }
    // Infill points whose constraints only the simulator knows, by their number in the enrichment.
    for point in store.infill().await? {
        let stream = StreamId::point(point.number);
        for row in store.evaluations(stream, 0).await? {
            let name = problem.approach_name(Approach::EnrichedKriging);
            let rest = EvaluationRow {
                evaluation: point.infill,
                ..row
            };
            let first = [name.to_owned(), String::new()];
            let rest = record(problem, rest);
            out.write_record(first.into_iter().chain(rest).collect::<Vec<_>>())?;
        }
    }
    Ok(())
}

/// The columns of an evaluation after those that name its run.
fn record(problem: &Problem, row: EvaluationRow) -> Vec<String> {
    let mut record = vec![row.evaluation.to_string()];
    record.extend(row.x.iter().copied().map(number));
    record.push(u8::from(row.refused.is_none()).to_string());
    record.push(row.refused.unwrap_or_default());
    record.push(optional(row.value));
    // Those that decide whether the design is feasible.
    match row.worn_criteria.or(row.criteria) {
        Some(criteria) => record.extend(criteria.into_iter().map(number)),
        None => record.extend(problem.criteria().iter().map(|_| String::new())),
    }
    let samples = row.samples.unwrap_or_default();
    let percentile = problem.campaign().sampling.estimate(&samples).ok();
    record.push(samples.len().to_string());
    record.push(optional(percentile.map(|estimate| estimate.chosen.p90)));
    record
}
