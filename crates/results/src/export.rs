//! Tables of a store as CSV or JSON, units in the names of their columns.

mod designs;
mod evaluations;

use std::collections::BTreeMap;
use std::io::Write;

use campaign::Campaign;
use campaign::formulation::{Criteria, Problem};
use clap::ValueEnum;
use ledger::StreamId;
use stages::fitting::{ModelSummary, latest_model};
use stages::names;
use stages::optima::{self, approach_of, optimum_design};
use stages::rounds::Round;
use store::Store;

use crate::converged::difference_um;
use crate::model;
use crate::rows::{Format, RowWriter};

/// A table that can be exported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Table {
    /// The DoE: whether each design is simulable and feasible, its criteria, and why one has no samples.
    Designs,
    /// Every sample.
    Samples,
    /// The percentile of every sampled design.
    Responses,
    /// The kriging model's leave-one-out predictions.
    Loo,
    /// What the approaches found.
    Optima,
    /// What every round of infill decided.
    Rounds,
    /// The infill points, with the percentile of the samples that each brought.
    Infill,
    /// What an external simulator said of each candidate of the optimiser's runs.
    Evaluations,
    /// Everything that went wrong, in its order, with all that was said about it.
    Failures,
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
    let file = store.campaign().await?.file_text;
    let campaign = Campaign::parse("the store's campaign file", &file)?;
    let problem = &Problem::new(campaign);
    let name = table.to_possible_value();
    let name = name.as_ref().map_or("", |value| value.get_name());
    let mut out = RowWriter::new(out, format, name, units(problem));
    match table {
        Table::Model => {}
        Table::Designs => designs::write(store, problem, &mut out).await?,
        Table::Samples => samples(store, problem, &mut out).await?,
        Table::Responses => responses(store, problem, &mut out).await?,
        Table::Loo => leave_one_out(store, problem, &mut out).await?,
        Table::Optima => optima(store, problem, &mut out).await?,
        Table::Rounds => rounds(store, problem, &mut out).await?,
        Table::Infill => infill(store, problem, &mut out).await?,
        Table::Evaluations => evaluations::write(store, problem, &mut out).await?,
        Table::Failures => failures(store, &mut out).await?,
    }
    out.finish()
}

/// The columns about the sampled response, as [`column`] takes them.
const STATISTICS: [&str; 13] = [
    "criterion",
    "expected_improvement",
    "mean",
    "observed",
    "predicted",
    "predicted_high",
    "predicted_low",
    "sd",
    "{p}",
    "{p}_converged_difference",
    "{p}_high",
    "{p}_low",
    "{p}_variance",
];

/// The name of a column about the sampled response: of a gear pair with µm, otherwise without a unit,
/// as the user's own names are. `{p}` stands for the percentile's.
pub(crate) fn column(problem: &Problem, what: &str) -> String {
    let sampling = &problem.campaign().sampling;
    let name = what.replace("{p}", &sampling.percentile_column());
    let square = if what.ends_with("variance") { "2" } else { "" };
    match problem.gears() {
        Some(_) => format!("{name}_um{square}"),
        None => name,
    }
}

/// The units of columns, by their names.
fn units(problem: &Problem) -> BTreeMap<String, String> {
    let sampled = problem.sampled();
    let squared = match &*sampled.unit {
        "" => String::new(),
        unit => format!("{unit}²"),
    };
    let statistics = STATISTICS.map(|what| {
        let is_squared = what.ends_with("variance");
        let unit = if is_squared {
            &*squared
        } else {
            &*sampled.unit
        };
        (column(problem, what), unit.to_owned())
    });
    let quantities = [problem.variables(), problem.responses(), problem.criteria()];
    let quantities = quantities.into_iter().flatten().chain([sampled]);
    let quantities = quantities.map(|quantity| {
        let unit = match &*quantity.unit {
            "" => modelling::Quantity::new(&quantity.name).unit,
            unit => Some(unit.to_owned()),
        };
        (quantity.name.to_string(), unit.unwrap_or_default())
    });
    let cost = ("cpu_seconds".to_owned(), "s".to_owned());
    let mut units: BTreeMap<String, String> = statistics.into_iter().chain([cost]).collect();
    units.extend(quantities);
    units.retain(|_, unit| !unit.is_empty());
    units
}

fn number(value: f64) -> String {
    // The shortest digits that read back as the same number.
    format!("{value}")
}

fn optional(value: Option<f64>) -> String {
    value.map_or_else(String::new, number)
}

async fn failures<W: Write + Send>(store: &Store, out: &mut RowWriter<W>) -> anyhow::Result<()> {
    out.write_record(["job", "lease", "worker", "kind", "error"])?;
    for row in store.failures().await? {
        let lease = row.lease.to_string();
        let kind = row.kind.as_str();
        out.write_record([
            &names::failed_job(&row),
            &lease,
            &row.worker,
            kind,
            &row.error,
        ])?;
    }
    Ok(())
}

async fn samples<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: &mut RowWriter<W>,
) -> anyhow::Result<()> {
    out.write_record(["design", "sample", &problem.sampled().name])?;
    store
        .visit_samples(|block| {
            let design = block.stream.index.to_string();
            block.indexed().try_for_each(|(sample, value)| {
                out.write_record([&design, &sample.to_string(), &number(value)])
            })
        })
        .await
}

async fn responses<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: &mut RowWriter<W>,
) -> anyhow::Result<()> {
    let [mean, sd, percentile, variance] =
        ["mean", "sd", "{p}", "{p}_variance"].map(|what| column(problem, what));
    out.write_record(["design", &mean, &sd, &percentile, &variance, "lilliefors_p"])?;
    for row in store.responses().await? {
        out.write_record([
            row.design.to_string(),
            number(row.mean),
            number(row.standard_deviation),
            number(row.percentile),
            number(row.percentile_variance),
            optional(row.lilliefors_p),
        ])?;
    }
    Ok(())
}

async fn leave_one_out<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: &mut RowWriter<W>,
) -> anyhow::Result<()> {
    let [observed, predicted] = ["observed", "predicted"].map(|what| column(problem, what));
    out.write_record(["design", &observed, &predicted, "standardised_residual"])?;
    let Some(row) = latest_model(store).await? else {
        return Ok(());
    };
    let summary: ModelSummary = serde_json::from_str(&row.summary_json)?;
    for left_out in summary.leave_one_out() {
        out.write_record([
            left_out.number.to_string(),
            number(left_out.observed),
            number(left_out.predicted),
            number(left_out.standardised),
        ])?;
    }
    Ok(())
}

async fn rounds<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: &mut RowWriter<W>,
) -> anyhow::Result<()> {
    let [improvement, predicted, low, high] = [
        "expected_improvement",
        "predicted",
        "predicted_low",
        "predicted_high",
    ]
    .map(|what| column(problem, what));
    out.write_record([
        "round",
        "points",
        "samples",
        "failed",
        "ruled_out",
        &improvement,
        &predicted,
        &low,
        &high,
        "simulator_calls",
        "cpu_seconds",
        "stop",
    ])?;
    let infill = store.infill().await?;
    for row in store.rounds().await? {
        let round = Round::read(row)?;
        let row = &round.row;
        let points = || infill.iter().filter(|point| point.round == row.round);
        let best = round.recommendation.as_ref();
        out.write_record([
            (row.round + 1).to_string(),
            points().count().to_string(),
            points()
                .filter(|point| !point.is_ruled_out())
                .map(|point| point.samples)
                .sum::<u64>()
                .to_string(),
            points()
                .filter(|point| point.has_failed())
                .count()
                .to_string(),
            points()
                .filter(|point| point.is_ruled_out())
                .count()
                .to_string(),
            optional(row.expected_improvement),
            optional(best.map(|best| best.predicted)),
            optional(best.map(|best| best.interval.0)),
            optional(best.map(|best| best.interval.1)),
            row.simulator_calls.to_string(),
            number(row.cpu_seconds),
            round
                .stop
                .as_ref()
                .map_or_else(String::new, ToString::to_string),
        ])?;
    }
    Ok(())
}

async fn infill<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: &mut RowWriter<W>,
) -> anyhow::Result<()> {
    let mut header = vec!["point", "round", "reason"];
    header.extend(problem.free_names());
    let [percentile, variance] = ["{p}", "{p}_variance"].map(|what| column(problem, what));
    header.extend(["violation", "samples", "failed", &percentile, &variance]);
    out.write_record(&header)?;
    for row in store.infill().await? {
        let samples = store.values_of(StreamId::point(row.number)).await?;
        let is_whole = samples.len() as u64 == row.samples && !row.failed;
        let estimate = problem.campaign().sampling.estimate(&samples).ok();
        let estimate = estimate
            .filter(|_| is_whole)
            .map(|estimate| estimate.chosen);
        let mut record = vec![row.name, (row.round + 1).to_string(), row.reason];
        record.extend(row.x.iter().copied().map(number));
        record.push(number(row.violation));
        record.push(row.samples.to_string());
        record.push(u8::from(row.failed).to_string());
        record.push(optional(estimate.map(|estimate| estimate.p90)));
        record.push(optional(estimate.map(|estimate| estimate.variance)));
        out.write_record(&record)?;
    }
    Ok(())
}

async fn optima<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: &mut RowWriter<W>,
) -> anyhow::Result<()> {
    let variables = problem.variables();
    let criteria = problem.criteria();
    let mut header = vec!["approach"];
    header.extend(variables.iter().map(|variable| &*variable.name));
    let names = ["criterion", "{p}", "{p}_low", "{p}_high"].map(|what| column(problem, what));
    header.extend(names.iter().map(String::as_str));
    let has_grid = problem.gears().is_some();
    let difference = column(problem, "{p}_converged_difference");
    header.extend(has_grid.then_some(&*difference));
    header.extend(criteria.iter().map(|criterion| &*criterion.name));
    header.extend(["feasible", "simulator_calls", "cpu_seconds"]);
    out.write_record(&header)?;
    for row in optima::stored(store).await? {
        let design = optimum_design(problem, &row);
        let found: Option<Criteria> = serde_json::from_str(&row.criteria_json)?;
        let samples = optima::verification_samples(store, &row).await?;
        let percentile = problem.campaign().sampling.verified(&samples).ok();
        let interval = percentile.and_then(|percentile| percentile.interval);
        let approach = approach_of(&row.approach).map(|a| problem.approach_name(a).to_owned());
        let mut record = vec![approach.unwrap_or_else(|| row.approach.clone())];
        let blanks = |count| std::iter::repeat_n(String::new(), count);
        match &design {
            Some(design) => record.extend(design.values().iter().copied().map(number)),
            None => record.extend(blanks(variables.len())),
        }
        record.push(optional(design.as_ref().map(|_| row.criterion)));
        record.push(optional(percentile.map(|percentile| percentile.value)));
        record.push(optional(interval.map(|(low, _)| low)));
        record.push(optional(interval.map(|(_, high)| high)));
        if has_grid {
            let difference = design.and_then(|design| difference_um(problem, &design));
            record.push(optional(difference));
        }
        match found {
            Some(found) => record.extend(found.values().iter().copied().map(number)),
            None => record.extend(blanks(criteria.len())),
        }
        record.push(u8::from(row.feasible).to_string());
        record.push(row.simulator_calls.to_string());
        record.push(number(row.cpu_seconds));
        out.write_record(&record)?;
    }
    Ok(())
}
