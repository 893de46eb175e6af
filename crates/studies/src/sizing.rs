//! `coordinator sizing`: pairs with other teeth and modules, each at its own optimum, in the order of their
//! percentiles.
//!
//! Each pair of tooth numbers within a tolerance of the gear ratio, with each combination of the listed modules, face
//! widths, helix angles and racks, is a size. A direct search finds the best design of a size (see [`direct`]), and the
//! best sizes get verification samples.

use std::path::Path;

use anyhow::Context as _;
use problem::file::Dimensions;
use problem::formulation::Problem;
use problem::optimise::Solution;
use problem::{Campaign, PairFile};
use rayon::prelude::*;
use results::doubts;
use results::number::fixed;
use results::report::charts::{self, PercentileSeries};
use results::report::write_file;
use results::row;
use results::table::{Cell, Column, Table};
use stats::IntervalEstimate;

use crate::direct::{self, Start};
use crate::table::{
    CRITERIA, Document, PageTable, criteria_cells, percentile_cells, with_interval,
};
use crate::{finished, samples};

mod range;

pub use range::{Range, Size};

/// The best design of a size.
#[derive(Debug, Clone, PartialEq)]
pub struct SizeResult {
    pub size: Size,
    /// The best feasible design, if the searches met one.
    pub best: Option<Solution>,
    /// The measure from verification samples, for the best sizes.
    pub verified: Option<IntervalEstimate>,
}

/// A dimension in the tables: its column, its head on the page, and its value.
type Listed = (Column, &'static str, fn(&Dimensions) -> Option<Cell>);

/// The dimensions besides the module that some of the sizes list.
fn listed_dimensions(all: &[SizeResult]) -> Vec<Listed> {
    let columns: [Listed; 3] = [
        (Column::number("face_width_mm"), "face width, mm", |one| {
            one.face_width_mm.map(Cell::from)
        }),
        (Column::number("helix_angle_deg"), "helix angle, °", |one| {
            one.helix_angle_deg.map(Cell::from)
        }),
        (Column::text("rack"), "rack", |one| {
            one.rack.map(|rack| rack.to_string().into())
        }),
    ];
    let mut columns = columns.to_vec();
    let has = |of: fn(&Dimensions) -> Option<Cell>| {
        all.iter().any(|one| of(&one.size.dimensions).is_some())
    };
    columns.retain(|(_, _, of)| has(*of));
    columns
}

/// Searches every size, and verifies the best `top` of them; the best comes first.
///
/// # Errors
///
/// A search fails.
pub fn run(sizes: Vec<Size>, top: usize) -> anyhow::Result<Vec<SizeResult>> {
    let searched: anyhow::Result<Vec<SizeResult>> = sizes.into_par_iter().map(search).collect();
    let mut all = searched?;
    let criterion = |one: &SizeResult| {
        one.best
            .as_ref()
            .map_or(f64::INFINITY, |best| best.criterion)
    };
    // Stable, so that equal ones keep the order of the sizes.
    all.sort_by(|a, b| criterion(a).total_cmp(&criterion(b)));
    let verified: anyhow::Result<Vec<Option<IntervalEstimate>>> = all
        .iter()
        .take(top)
        .map(|one| {
            let Some(best) = &one.best else {
                return Ok(None);
            };
            let problem = Problem::new(one.size.campaign.clone());
            let drawn = samples::verification(&problem, &best.design)?;
            Ok(Some(problem.campaign().sampling.verified(&drawn)?))
        })
        .collect();
    for (one, verified) in all.iter_mut().zip(verified?) {
        one.verified = verified;
    }
    // The percentile of a search is biased, because the search chose its design by the same samples. Verification
    // samples therefore order the best `top` sizes.
    let first = top.min(all.len());
    let judged = |one: &SizeResult| one.verified.map_or(f64::INFINITY, |measure| measure.value);
    all[..first].sort_by(|a, b| judged(a).total_cmp(&judged(b)));
    Ok(all)
}

/// The best design of one size over the campaign's starts.
fn search(size: Size) -> anyhow::Result<SizeResult> {
    let problem = Problem::new(size.campaign.clone());
    let base = finished::searched_base(&problem)?;
    let mut best: Option<Solution> = None;
    for start in 0..size.campaign.optimise.starts {
        let start = Start {
            number: 0,
            start,
            base: &base,
            from: None,
        };
        let found = direct::search(&problem, start)?.best;
        let is_better = |found: &Solution| {
            let known = best.as_ref();
            known.is_none_or(|known| found.criterion < known.criterion)
        };
        if let Some(found) = found.filter(is_better) {
            best = Some(found);
        }
    }
    Ok(SizeResult {
        size,
        best,
        verified: None,
    })
}

/// Writes `sizing.csv`, `sizing.md`, `sizing.svg` and a pair file of each verified design into `out`; returns the
/// tables.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(
    out: &Path,
    campaign: &Campaign,
    all: &[SizeResult],
) -> anyhow::Result<Document> {
    let figures = all_figures(campaign, all);
    write_file(out, "sizing.csv", figures.csv()?)?;
    let measure = campaign.measure_name();
    let feasible = all.iter().filter(|one| one.best.is_some()).count();
    let mut page = format!(
        "# {}: sizes\n\n{} sizes, {feasible} of them with a feasible design. {measure} of ΔSTE in µm at the best of {} \
         direct searches of {} designs for each size, with its 95 % interval from {} verification samples.\n\n{}",
        campaign.name,
        all.len(),
        campaign.optimise.starts,
        campaign.optimise.evaluations,
        campaign.verify.first(),
        summary(campaign, all).markdown()
    );
    for (place, one) in all.iter().enumerate() {
        let (Some(best), Some(_)) = (&one.best, one.verified) else {
            continue;
        };
        let sections = one.size.campaign.gears();
        let sections = sections.context("sizes are of gears")?;
        let file = PairFile::of_design(sections, &best.design);
        write_file(out, &format!("pair-{}.toml", place + 1), file.to_toml())?;
    }
    page += &doubts(all);
    match charts::teeth(&measure, &lines(all)) {
        Ok(chart) => {
            write_file(out, "sizing.svg", chart.standalone())?;
            page += "\n![The best design of each size, by the samples of its search](sizing.svg)\n";
        }
        Err(why) => page += &format!("\n{why}\n"),
    }
    write_file(out, "sizing.md", &page)?;
    Ok(Document {
        page,
        tables: vec![("sizing", figures)],
    })
}

/// The warnings about the verified designs, each with the pairs that it is about, as Markdown.
fn doubts(all: &[SizeResult]) -> String {
    let mut about: Vec<(String, Vec<String>)> = Vec::new();
    for (place, one) in (1..).zip(all) {
        let (Some(best), Some(_)) = (&one.best, one.verified) else {
            continue;
        };
        let problem = Problem::new(one.size.campaign.clone());
        let of_design = doubts::pair::of_design(&problem, &best.design);
        for doubt in one.size.campaign.warnings().into_iter().chain(of_design) {
            let pair = place.to_string();
            match about.iter_mut().find(|(known, _)| *known == doubt) {
                Some((_, pairs)) => pairs.push(pair),
                None => about.push((doubt, vec![pair])),
            }
        }
    }
    let line = |(doubt, pairs): &(String, Vec<String>)| {
        let pair = if pairs.len() > 1 { "pairs" } else { "pair" };
        format!("\n> Warning, {pair} {}: {doubt}\n", pairs.join(", "))
    };
    about.iter().map(line).collect()
}

fn summary(campaign: &Campaign, all: &[SizeResult]) -> PageTable {
    let measure = campaign.measure_name();
    let dimensions = listed_dimensions(all);
    let searched = format!("{measure} in the search, µm");
    let measure = format!("{measure}, µm");
    let mut heads = vec!["pair", "teeth", "ratio", "module, mm"];
    heads.extend(dimensions.iter().map(|(_, head, _)| *head));
    heads.extend(["centre distance, mm", &searched, &measure, "file"]);
    let mut table = PageTable::new(heads);
    for (place, one) in all.iter().enumerate() {
        let (Some(best), Some(verified)) = (&one.best, &one.verified) else {
            continue;
        };
        let [pinion, mate] = one.size.teeth;
        let problem = Problem::new(one.size.campaign.clone());
        let unloaded = problem.gears().map(|gears| gears.unloaded(&best.design));
        let distance = unloaded
            .and_then(Result::ok)
            .map_or(f64::NAN, |pair| pair.geometry().centre_distance);
        let mut row = vec![
            (place + 1).to_string(),
            format!("{pinion} : {mate}"),
            fixed(f64::from(mate) / f64::from(pinion), 4),
            fixed(best.criteria.gears().normal_module_mm, 3),
        ];
        row.extend(
            dimensions
                .iter()
                .map(|(_, _, of)| match of(&one.size.dimensions) {
                    Some(Cell::Text(text)) => text,
                    Some(Cell::Number(number)) => number.to_string(),
                    _ => String::new(),
                }),
        );
        row.extend([
            fixed(distance, 3),
            fixed(best.criterion, 3),
            with_interval(verified),
            format!("pair-{}.toml", place + 1),
        ]);
        table.rows.push(row);
    }
    table
}

fn all_figures(campaign: &Campaign, all: &[SizeResult]) -> Table {
    let problem = Problem::new(campaign.clone());
    let names = problem.variables().iter().map(|variable| &*variable.name);
    let measures = campaign.sampling.measure_columns();
    let searched = measures[0].replace("_um", "_searched_um");
    let mut columns = ["teeth_p", "teeth_r"].map(Column::whole).to_vec();
    columns.push(Column::number("normal_module_mm"));
    let dimensions = listed_dimensions(all);
    columns.extend(dimensions.iter().map(|(column, _, _)| column.clone()));
    columns.extend(names.map(Column::number));
    columns.push(Column::number(searched));
    columns.extend(measures.map(Column::number));
    columns.extend(CRITERIA.map(Column::number));
    let mut table = Table::new(columns);
    for one in all {
        let [pinion, mate] = one.size.teeth;
        let best = one.best.as_ref();
        let criteria = best.map(|best| best.criteria.gears());
        let mut line = row![pinion, mate].to_vec();
        let module = criteria.map(|criteria| criteria.normal_module_mm);
        line.push(module.or(one.size.dimensions.normal_module_mm).into());
        let listed = dimensions.iter().map(|(_, _, of)| of(&one.size.dimensions));
        line.extend(listed.map(|cell| cell.unwrap_or(Cell::Missing)));
        match best {
            Some(best) => line.extend(best.design.values().iter().copied().map(Cell::from)),
            None => line.extend(problem.variables().iter().map(|_| Cell::Missing)),
        }
        line.push(best.map(|best| best.criterion).into());
        line.extend(percentile_cells(one.verified));
        line.extend(criteria_cells(criteria.as_ref()));
        table.rows.push(line);
    }
    table
}

/// The best size for each number of pinion teeth, as a line for each module. Other dimensions are those of the best
/// size.
fn lines(all: &[SizeResult]) -> Vec<PercentileSeries> {
    let mut modules: Vec<Option<f64>> = all
        .iter()
        .map(|one| one.size.dimensions.normal_module_mm)
        .collect();
    modules.sort_by(|a, b| a.unwrap_or(0.0).total_cmp(&b.unwrap_or(0.0)));
    modules.dedup();
    let of_module = |module: Option<f64>| {
        let mut points: Vec<(f64, IntervalEstimate)> = Vec::new();
        for one in all
            .iter()
            .filter(|one| one.size.dimensions.normal_module_mm == module)
        {
            let teeth = f64::from(one.size.teeth[0]);
            // The best come first.
            if points.iter().any(|(known, _)| *known == teeth) {
                continue;
            }
            let searched = one.best.as_ref().map(|best| IntervalEstimate {
                n: one.size.campaign.sampling.samples_per_design as usize,
                value: best.criterion,
                interval: None,
            });
            points.extend(one.verified.or(searched).map(|measure| (teeth, measure)));
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let of_module = all
            .iter()
            .filter(|one| one.size.dimensions.normal_module_mm == module);
        let mut infeasible: Vec<f64> = of_module
            .map(|one| f64::from(one.size.teeth[0]))
            .filter(|teeth| points.iter().all(|(known, _)| known != teeth))
            .collect();
        infeasible.sort_by(f64::total_cmp);
        infeasible.dedup();
        PercentileSeries {
            name: module.map_or_else(
                || "best size".to_owned(),
                |module| format!("module {module} mm"),
            ),
            infeasible,
            points,
        }
    };
    modules.into_iter().map(of_module).collect()
}

#[cfg(test)]
mod tests;
