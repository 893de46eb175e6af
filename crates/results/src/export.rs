//! Tables of a store as CSV or JSON, units in the names of their columns.

mod designs;
mod evaluations;

use std::io::{Sink, Write};
use std::path::Path;

use clap::ValueEnum;
use ledger::StreamId;
use problem::formulation::{Problem, Quantity, RandomInputs};
use problem::task::random_values;
use stages::doe::Doe;
use stages::fitting::{ModelSummary, latest_model};
use stages::names;
use stages::rounds::Round;
use store::{OriginRow, Store};

use crate::columnar::Columns;
use crate::columns::{squared, statistic};
use crate::finer_grid::difference_um;
use crate::new_file::NewFile;
use crate::optima::Optima;
use crate::report::EnrichmentRound;
use crate::table::{Cell, Column, Format, TableWriter};
use crate::{model, modelling, row, snapshot};

/// A table that can be exported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Table {
    /// The DoE: whether each design is simulable and feasible, its criteria, and why one has no samples.
    Designs,
    /// Every sample.
    Samples,
    /// The measure of every sampled design.
    Responses,
    /// The kriging model's leave-one-out predictions.
    Loo,
    /// The optimum of each approach.
    Optima,
    /// What every round of infill decided.
    Rounds,
    /// The infill points, with the measure of the samples that each brought.
    Infill,
    /// The answer of an external simulator for each candidate of the optimiser's runs.
    Evaluations,
    /// Crashes, failures and quarantined jobs, with their errors, in the order in which they occurred.
    Failures,
    /// Which worker process computed which samples, of designs, optima and infill points.
    Blocks,
    /// The kriging model with its inputs and their bounds, as `fit --out` writes one: one JSON object.
    Model,
}

/// Writes a table; the model is one JSON object whatever the format.
///
/// # Errors
///
/// The store cannot be read or the output cannot be written.
pub async fn write(
    store: &Store,
    table: Table,
    format: Format,
    mut out: impl Write + Send,
) -> anyhow::Result<()> {
    if table == Table::Model {
        writeln!(out, "{}", model::stored(store).await?.to_json()?)?;
        return Ok(out.flush()?);
    }
    let name = table.to_possible_value();
    let name = name.as_ref().map_or("", |value| value.get_name());
    fill(store, table, Destination::File { out, format, name }).await
}

/// Writes a table into a new file, wholly or not at all.
///
/// # Errors
///
/// As [`write()`], or the file exists.
pub async fn write_new(
    store: &Store,
    table: Table,
    format: Format,
    path: &Path,
) -> anyhow::Result<()> {
    let mut file = NewFile::create(path)?;
    write(store, table, format, &mut file).await?;
    Ok(file.keep()?)
}

/// A table in memory; empty for the model, which is not a table.
///
/// # Errors
///
/// The store cannot be read.
pub async fn columns(store: &Store, table: Table) -> anyhow::Result<Columns> {
    let mut kept = Columns::default();
    fill(store, table, Destination::<Sink>::Memory(&mut kept)).await?;
    Ok(kept)
}

/// Writes the rows of a table.
async fn fill<W: Write + Send>(
    store: &Store,
    table: Table,
    out: Destination<'_, W>,
) -> anyhow::Result<()> {
    let problem = &snapshot::problem(store).await?;
    match table {
        Table::Model => Ok(()),
        Table::Designs => designs::write(store, problem, out).await,
        Table::Samples => samples(store, problem, out).await,
        Table::Responses => responses(store, problem, out).await,
        Table::Loo => leave_one_out(store, problem, out).await,
        Table::Optima => optima(store, problem, out).await,
        Table::Rounds => rounds(store, problem, out).await,
        Table::Infill => infill(store, problem, out).await,
        Table::Evaluations => evaluations::write(store, problem, out).await,
        Table::Failures => failures(store, out).await,
        Table::Blocks => blocks(store, out).await,
    }
}

/// Where a table goes.
enum Destination<'a, W: Write + Send> {
    File {
        out: W,
        format: Format,
        name: &'a str,
    },
    Memory(&'a mut Columns),
}

impl<'a, W: Write + Send> Destination<'a, W> {
    /// Begins a table with these columns.
    fn table(self, columns: Vec<Column>) -> anyhow::Result<TableWriter<'a, W>> {
        match self {
            Self::File { out, format, name } => TableWriter::new(out, format, name, columns),
            Self::Memory(kept) => Ok(TableWriter::in_memory(kept, columns)),
        }
    }
}

/// A column of a variable, a response or a criterion.
fn quantity(quantity: &Quantity) -> Column {
    number(&quantity.name, &quantity.unit)
}

/// A column of a problem's quantity with this name and unit.
fn number(name: &str, unit: &str) -> Column {
    let modelling::Quantity { name, unit } = modelling::Quantity::of_problem(name, unit);
    Column::number(name).in_unit(unit.unwrap_or_default())
}

/// Columns of the variables that the DoE moves.
fn coordinates(problem: &Problem) -> impl Iterator<Item = Column> {
    let coordinates = problem.coordinates().iter();
    coordinates.map(|coordinate| number(&coordinate.name, &coordinate.unit))
}

fn cpu_seconds() -> Column {
    Column::number("cpu_seconds").in_unit("s")
}

/// The numbers as cells, or `count` missing ones.
fn numbers(values: Option<&[f64]>, count: usize) -> Vec<Cell> {
    match values {
        Some(values) => values.iter().copied().map(Cell::from).collect(),
        None => vec![Cell::Missing; count],
    }
}

async fn failures<W: Write + Send>(store: &Store, out: Destination<'_, W>) -> anyhow::Result<()> {
    let mut out = out.table(vec![
        Column::text("job"),
        Column::whole("lease"),
        Column::text("worker"),
        Column::text("kind"),
        Column::text("error"),
        Column::whole("at_unix_ms"),
    ])?;
    for row in store.failures().await? {
        let job = names::failed_job(&row);
        out.write(&row![
            job,
            row.lease,
            row.worker,
            row.kind.as_str(),
            row.error,
            row.at_unix_ms.map(i64::cast_unsigned)
        ])?;
    }
    out.finish()
}

async fn blocks<W: Write + Send>(store: &Store, out: Destination<'_, W>) -> anyhow::Result<()> {
    let mut out = out.table(vec![
        Column::text("job"),
        Column::whole("first_sample"),
        Column::whole("samples"),
        Column::text("worker"),
        Column::text("host"),
        Column::text("build"),
    ])?;
    store
        .visit_blocks(|block, origin| {
            let named = |name: fn(&OriginRow) -> &String| origin.map(name).cloned();
            out.write(&row![
                names::stream_name(block.stream),
                block.first_sample,
                block.samples.len(),
                named(|origin| &origin.worker),
                named(|origin| &origin.host),
                named(|origin| &origin.build),
            ])
        })
        .await?;
    out.finish()
}

async fn samples<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: Destination<'_, W>,
) -> anyhow::Result<()> {
    let mut columns = ["design", "sample"].map(Column::whole).to_vec();
    columns.extend(problem.sampled().iter().map(quantity));
    let random = problem.random().map_or(&[][..], RandomInputs::quantities);
    columns.extend(random.iter().map(quantity));
    let mut out = out.table(columns)?;
    // The random inputs of a sample follow from its design.
    let designs = match random {
        [] => Vec::new(),
        _ => store.designs().await?,
    };
    let base = problem.base();
    store
        .visit_samples(|block| {
            let number = block.stream.index;
            let row = designs.get(number as usize);
            let design = row.map(|row| problem.design(&row.x, base));
            block.indexed().try_for_each(|(sample, sampled)| {
                let mut row = row![number, sample].to_vec();
                row.extend(sampled.iter().copied().map(Cell::from));
                let values = design
                    .as_ref()
                    .and_then(|design| random_values(problem, block.stream, design, sample));
                row.extend(values.into_iter().flatten().map(Cell::from));
                out.write(&row)
            })
        })
        .await?;
    out.finish()
}

async fn responses<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: Destination<'_, W>,
) -> anyhow::Result<()> {
    let mut columns = vec![Column::whole("design")];
    columns.extend(["mean", "sd", "{p}", "{p}_variance"].map(|what| statistic(problem, what)));
    columns.push(Column::number("lilliefors_p"));
    for measured in problem.limited() {
        let Quantity { name, .. } = &measured.quantity;
        let unit = &measured.response.unit;
        columns.push(Column::number(name.to_string()).in_unit(unit.to_string()));
        columns.push(Column::number(format!("{name}_variance")).in_unit(squared(unit)));
    }
    let mut out = out.table(columns)?;
    let doe = Doe::read(store).await?;
    let limited = doe.estimates(problem);
    for row in &doe.responses {
        let mut cells = row![
            row.design,
            row.mean,
            row.standard_deviation,
            row.measure,
            row.measure_variance,
            row.lilliefors_p,
        ]
        .to_vec();
        let estimates = limited.get(&row.design).into_iter().flatten();
        cells.extend(estimates.flat_map(|(value, variance)| row![*value, *variance]));
        out.write(&cells)?;
    }
    out.finish()
}

async fn leave_one_out<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: Destination<'_, W>,
) -> anyhow::Result<()> {
    let mut columns = vec![Column::whole("design")];
    columns.extend(["observed", "predicted"].map(|what| statistic(problem, what)));
    columns.push(Column::number("standardised_residual"));
    let mut out = out.table(columns)?;
    if let Some(row) = latest_model(store).await? {
        let summary: ModelSummary = serde_json::from_str(&row.summary_json)?;
        for left_out in summary.leave_one_out() {
            out.write(&row![
                left_out.number,
                left_out.observed,
                left_out.predicted,
                left_out.standardised,
            ])?;
        }
    }
    out.finish()
}

async fn rounds<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: Destination<'_, W>,
) -> anyhow::Result<()> {
    let counts = ["round", "points", "samples", "failed", "ruled_out"];
    let mut columns: Vec<Column> = counts.map(Column::whole).to_vec();
    let predictions = [
        "expected_improvement",
        "predicted",
        "predicted_low",
        "predicted_high",
    ];
    columns.extend(predictions.map(|what| statistic(problem, what)));
    columns.extend([
        Column::whole("simulator_calls"),
        cpu_seconds(),
        Column::text("stop"),
    ]);
    let mut out = out.table(columns)?;
    let infill = store.infill().await?;
    for row in store.rounds().await? {
        let round = Round::read(row)?;
        let figures = EnrichmentRound::of(&round, &infill);
        let known = |value: f64| Some(value).filter(|value| value.is_finite());
        let stop = round.stop.as_ref();
        out.write(&row![
            figures.round,
            figures.new_designs + figures.further_turns,
            figures.samples,
            figures.failed,
            figures.ruled_out,
            known(figures.expected_improvement),
            known(figures.predicted),
            known(figures.low),
            known(figures.high),
            round.row.simulator_calls,
            round.row.cpu_seconds,
            stop.map_or_else(String::new, ToString::to_string),
        ])?;
    }
    out.finish()
}

async fn infill<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: Destination<'_, W>,
) -> anyhow::Result<()> {
    let mut columns = vec![
        Column::text("point"),
        Column::whole("round"),
        Column::text("reason"),
    ];
    columns.extend(coordinates(problem));
    columns.extend([
        Column::number("violation"),
        Column::whole("samples"),
        Column::whole("failed"),
    ]);
    columns.extend(["{p}", "{p}_variance"].map(|what| statistic(problem, what)));
    let mut out = out.table(columns)?;
    for point in store.infill().await? {
        let stream = StreamId::point(point.number);
        let samples = store.first_samples_of(stream, problem.sampled().len());
        let values = problem.objective().values(&samples.await?);
        let is_whole = values.len() as u64 == point.samples && !point.failed;
        let estimate = problem.campaign().sampling.estimate(&values).ok();
        let estimate = estimate
            .filter(|_| is_whole)
            .map(|estimate| estimate.chosen);
        let mut row = row![point.name, point.round + 1, point.reason].to_vec();
        row.extend(numbers(Some(&point.x), 0));
        row.extend(row![
            point.violation,
            point.samples,
            point.failed,
            estimate.map(|estimate| estimate.value),
            estimate.map(|estimate| estimate.variance),
        ]);
        out.write(&row)?;
    }
    out.finish()
}

async fn optima<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: Destination<'_, W>,
) -> anyhow::Result<()> {
    let (variables, criteria) = (problem.variables(), problem.deterministic());
    let mut columns = vec![Column::text("approach")];
    columns.extend(variables.iter().map(quantity));
    let estimates = ["criterion", "{p}", "{p}_low", "{p}_high"];
    columns.extend(estimates.map(|what| statistic(problem, what)));
    let has_grid = problem.gears().is_some();
    columns.extend(has_grid.then(|| statistic(problem, "{p}_grid_difference")));
    columns.extend(criteria.iter().map(quantity));
    for measured in problem.limited() {
        let name = &measured.quantity.name;
        let ends = ["", "_low", "_high"].map(|end| format!("{name}{end}"));
        let in_unit = |name| Column::number(name).in_unit(measured.limit_unit().to_owned());
        columns.extend(ends.map(in_unit));
        columns.push(Column::number(format!("{name}_confidence")));
    }
    columns.extend([
        Column::whole("feasible"),
        Column::whole("simulator_calls"),
        cpu_seconds(),
    ]);
    let mut out = out.table(columns)?;
    for verified in Optima::read(store, problem).await?.iter() {
        let optimum = &verified.optimum;
        let found = optimum.found.as_ref().ok();
        let measure = verified.measure;
        let interval = measure.and_then(|measure| measure.interval);
        let mut row = row![problem.approach_name(optimum.approach)].to_vec();
        row.extend(numbers(
            found.map(|found| found.design.values()),
            variables.len(),
        ));
        row.extend(row![
            found.map(|found| found.criterion),
            measure.map(|measure| measure.value),
            interval.map(|(low, _)| low),
            interval.map(|(_, high)| high),
        ]);
        if has_grid {
            let difference = found.and_then(|found| difference_um(problem, &found.design));
            row.push(difference.into());
        }
        row.extend(numbers(
            found.map(|found| &found.criteria.values()[..criteria.len()]),
            criteria.len(),
        ));
        for place in 0..problem.limited().len() {
            let limit = verified.limits.get(place);
            row.extend(row![
                limit.map(|limit| limit.value.value),
                limit.and_then(|limit| limit.value.low),
                limit.and_then(|limit| limit.value.high),
                limit.and_then(|limit| limit.confidence),
            ]);
        }
        row.extend(row![
            verified.keeps_limits(),
            optimum.cost.simulator_calls,
            optimum.cost.cpu_seconds,
        ]);
        out.write(&row)?;
    }
    out.finish()
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    /// The radii are free in modules, and variables in millimetres.
    #[test]
    fn every_coordinate_has_a_column() {
        let text = Campaign::PAIR.replacen(
            "tip_radius_modules = 0.02",
            "tip_radius_modules = [0.0, 0.05]",
            1,
        );
        let problem = Problem::new(Campaign::parse("c.toml", &text).unwrap());
        assert_eq!(problem.dimension(), 7);
        assert_eq!(coordinates(&problem).count(), 7);
    }
}
