//! The tables, charts and page of a sensitivity analysis.

use std::path::Path;

use problem::Campaign;
use results::number::{fixed, percent};
use results::report::{charts, symbol, write_file};
use results::row;
use results::table::{Column, Table};
use stats::SensitivityIndex;

use super::{Indices, Input, Scenario};
use crate::finished::FeasibleOptimum;
use crate::table::{Document, PageTable, percentile_cells, with_interval};

/// Writes `scenarios.csv`, `indices.csv`, `sensitivity.md` and a chart for each output into `out`; returns what it
/// wrote.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(
    out: &Path,
    campaign: &Campaign,
    optimum: &FeasibleOptimum,
    scenarios: &[Scenario],
    indices: &[Indices],
    rows: usize,
) -> anyhow::Result<Document> {
    let name = &campaign.name;
    let [value, low, high] = campaign.sampling.measure_columns();
    let mut columns = vec![Column::text("parameter"), Column::number("factor")];
    columns.extend([value, low, high].map(Column::number));
    let mut table = Table::new(columns);
    let measure = campaign.measure_name();
    let mut shown = PageTable::new(["scenario", &format!("{measure}, µm")]);
    for row in scenarios {
        let p90 = &row.p90;
        let mut line = row![row.parameter, row.factor].to_vec();
        line.extend(percentile_cells(Some(*p90)));
        table.rows.push(line);
        let label = if row.factor == 1.0 {
            row.parameter.to_owned()
        } else {
            format!("{} × {}", row.parameter, row.factor)
        };
        shown.rows.push(vec![label, with_interval(p90)]);
    }
    write_file(out, "scenarios.csv", table.csv()?)?;
    let figures = index_figures(indices);
    write_file(out, "indices.csv", figures.csv()?)?;
    let mut page = format!(
        "# {name}: sensitivity of the design of approach {}\n\n{}",
        optimum.approach.name(),
        shown.markdown()
    );
    page += "\nShares of the variance when all inputs deviate by up to ±, evenly and independently, with 95 % bootstrap \
             intervals. The first-order index is what an input does alone, the total one what it does with the others, \
             too.\n";
    for (one, chart) in indices.iter().zip(["sensitivity", "sensitivity-of-a-pair"]) {
        let found = &one.sensitivity;
        let mut shown = PageTable::new(["input", "±", "first-order index", "total index"]);
        let mut has_negative = false;
        let mut index = |i: &SensitivityIndex| {
            let [value, low, high] = [i.value, i.low, i.high].map(|share| fixed(share, 3));
            has_negative |= value.starts_with('−');
            format!("{value} [{low}; {high}]")
        };
        for ((input, first), total) in one.inputs.iter().zip(&found.first).zip(&found.total) {
            shown.rows.push(vec![
                symbol(&input.name),
                deviation(input),
                index(first),
                index(total),
            ]);
        }
        page += &format!(
            "\n{}: mean {} µm, standard deviation {} µm",
            one.output,
            fixed(found.mean, 3),
            fixed(found.variance.sqrt(), 3)
        );
        if found.left_out > 0 {
            page += &format!(
                "; {} of {} rows left out, because a deviated pair cannot be simulated",
                found.left_out, rows
            );
        }
        page += &format!(".\n\n{}", shown.markdown());
        if has_negative {
            page += "\nA negative index is the estimate of a small one: no index is below 0, but its Monte Carlo \
                     estimate scatters, and the interval shows how much.\n";
        }
        let inputs: Vec<String> = one.inputs.iter().map(|input| symbol(&input.name)).collect();
        let drawn = charts::indices(&one.output, &inputs, &found.first, &found.total)?;
        write_file(out, &format!("{chart}.svg"), drawn.standalone())?;
        page += &format!("\n![Indices of {}]({chart}.svg)\n", one.output);
    }
    write_file(out, "sensitivity.md", &page)?;
    Ok(Document {
        page,
        tables: vec![("scenarios", table), ("indices", figures)],
    })
}

/// The largest deviation of an input for a page.
fn deviation(input: &Input) -> String {
    match (input.deviation, input.unit) {
        (None, _) => "random".to_owned(),
        (Some(share), "") => percent(share),
        (Some(deviation), "°") => format!("{deviation}°"),
        (Some(deviation), unit) => format!("{deviation} {unit}"),
    }
}

fn index_figures(indices: &[Indices]) -> Table {
    let mut columns = ["output", "input"].map(Column::text).to_vec();
    columns.extend([Column::number("deviation"), Column::text("unit")]);
    let figures = [
        "first",
        "first_low",
        "first_high",
        "total",
        "total_low",
        "total_high",
    ];
    columns.extend(figures.map(Column::number));
    let mut table = Table::new(columns);
    for one in indices {
        let found = &one.sensitivity;
        for ((input, first), total) in one.inputs.iter().zip(&found.first).zip(&found.total) {
            let mut line = row![
                one.output.as_str(),
                input.name.as_str(),
                input.deviation,
                input.unit,
            ]
            .to_vec();
            for index in [first, total] {
                line.extend(row![index.value, index.low, index.high]);
            }
            table.rows.push(line);
        }
    }
    table
}
