//! The evaluations of an external simulator, of the candidates of the optimiser's runs and of infill points.

use std::io::Write;

use ledger::StreamId;
use problem::Approach;
use problem::formulation::Problem;
use stages::names;
use stats::Samples;
use store::{EvaluationRow, Store};

use super::{Destination, numbers, quantity};
use crate::columns::statistic;
use crate::row;
use crate::table::{Cell, Column};

/// A row for each evaluation, in the order of approaches, starts and evaluations, infill points last.
pub(super) async fn write<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: Destination<'_, W>,
) -> anyhow::Result<()> {
    let mut columns = vec![Column::text("approach")];
    columns.extend(["start", "evaluation"].map(Column::whole));
    columns.extend(problem.variables().iter().map(quantity));
    columns.extend([Column::whole("simulable"), Column::text("reason")]);
    // The response without random effects.
    let response = &problem.objective().response;
    let sampled = problem.sampled();
    let baseline = sampled.iter().find(|one| one.name == response.name);
    columns.push(quantity(baseline.unwrap_or(&sampled[0])));
    columns.extend(problem.deterministic().iter().map(quantity));
    columns.extend([Column::whole("samples"), statistic(problem, "{p}")]);
    let mut out = out.table(columns)?;
    for approach in Approach::OPTIMISED {
        let name = problem.approach_name(approach);
        for start in 0..problem.campaign().optimise.starts {
            for row in store.evaluations(names::run(approach, start), 0).await? {
                out.write(&cells(problem, row![name, start].to_vec(), row))?;
            }
        }
    }
    // Infill points whose constraints only the simulator knows, by their number in the enrichment.
    let name = problem.approach_name(Approach::EnrichedKriging);
    for point in store.infill().await? {
        let stream = StreamId::point(point.number);
        for row in store.evaluations(stream, 0).await? {
            let row = EvaluationRow {
                evaluation: point.infill,
                ..row
            };
            out.write(&cells(problem, row![name, None::<u64>].to_vec(), row))?;
        }
    }
    out.finish()
}

/// The row of an evaluation; `first` holds the cells that name the run.
fn cells(problem: &Problem, first: Vec<Cell>, row: EvaluationRow) -> Vec<Cell> {
    let mut cells = first;
    cells.push(row.evaluation.into());
    cells.extend(numbers(Some(&row.x), 0));
    cells.extend(row![
        row.refused.is_none(),
        row.refused.unwrap_or_default(),
        row.value,
    ]);
    // The criteria that decide whether the design is feasible.
    let criteria = row.worn_criteria.or(row.criteria);
    cells.extend(numbers(criteria.as_deref(), problem.deterministic().len()));
    let samples = row.samples.unwrap_or_default();
    let samples = Samples::new(problem.sampled().len(), samples);
    let values = samples.map(|samples| problem.objective().values(&samples));
    let values = values.unwrap_or_default();
    let measure = problem.campaign().sampling.estimate(&values).ok();
    cells.extend(row![
        values.len(),
        measure.map(|estimate| estimate.chosen.value),
    ]);
    cells
}
