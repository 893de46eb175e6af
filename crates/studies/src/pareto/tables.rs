//! The front as CSV, Markdown and a chart.

use std::path::Path;

use problem::formulation::Problem;
use results::number::{MISSING, fixed};
use results::report::charts::{self, PercentileSeries};
use results::report::{Error, Picture, write_file};
use results::row;
use results::table::{Cell, Column, Table};

use super::front::{Objective, Point, Source};
use crate::table::{
    CRITERIA, Document, PageTable, criteria_cells, percentile_cells, with_interval,
};

/// Writes `pareto.csv`, `pareto.md` and `pareto.svg` into `out`; returns what it wrote. `all` are
/// the designs behind the front of the DoE, `marked` those that [`super::mark`] has marked, after
/// `searches` searches.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(
    out: &Path,
    problem: &Problem,
    against: Objective,
    all: &[Point],
    marked: &[Point],
    searches: u32,
) -> anyhow::Result<Document> {
    let figures = all_figures(problem, marked);
    write_file(out, "pareto.csv", figures.csv()?)?;
    let mut page = format!(
        "# {}: {} of ΔSTE against the {}\n\n\
         {} designs of the DoE satisfy the constraints other than that on {} (below {} MPa). The \
         table has their front by the samples of the campaign, the optima, and the results of \
         searches; intervals are of 95 %. A design is on the front if no other one is at least as good in both \
         and better in one, by verification samples where there are any.\n\n{}",
        problem.campaign().name,
        problem.campaign().measure_name(),
        against.label(),
        all.len(),
        against.constraint(),
        against.limit(problem),
        summary(problem, against, marked).markdown()
    );
    if searches > 0 {
        let found = marked.iter().filter(|point| point.source == Source::Search);
        page += &format!(
            "\n{} of {searches} direct searches found a design within their limit.\n",
            found.count()
        );
    }
    match chart(problem, against, all, marked) {
        Ok(chart) => {
            write_file(out, "pareto.svg", chart.standalone())?;
            page += "\n![The front](pareto.svg)\n";
        }
        Err(why) => page += &format!("\n{why}\n"),
    }
    write_file(out, "pareto.md", &page)?;
    Ok(Document {
        page,
        tables: vec![("pareto", figures)],
    })
}

fn summary(problem: &Problem, against: Objective, points: &[Point]) -> PageTable {
    let measure = problem.measured().name.to_string();
    let mut table = PageTable::new([
        "design",
        against.label(),
        &format!("{measure} of its samples, µm"),
        &format!("{measure} of verification samples, µm"),
        "on the front",
    ]);
    for point in points {
        let value = against.of(&point.criteria);
        let beyond = if value < against.limit(problem) {
            ""
        } else {
            " (beyond the limit)"
        };
        table.rows.push(vec![
            point.source.name(),
            fixed(value, 0) + beyond,
            with_interval(&point.p90),
            point
                .verified
                .as_ref()
                .map_or(MISSING.to_owned(), with_interval),
            if point.on_front { "yes" } else { "no" }.to_owned(),
        ]);
    }
    table
}

fn all_figures(problem: &Problem, points: &[Point]) -> Table {
    let estimated = problem.campaign().sampling.measure_columns();
    let verified = estimated
        .each_ref()
        .map(|column| format!("verified_{column}"));
    let mut columns = vec![Column::text("source")];
    let names = problem.variables().iter().map(|variable| &*variable.name);
    columns.extend(names.map(Column::number));
    columns.extend(CRITERIA.map(Column::number));
    columns.extend(estimated.into_iter().chain(verified).map(Column::number));
    columns.push(Column::whole("on_front"));
    let mut table = Table::new(columns);
    for point in points {
        let mut line = row![point.source.name()].to_vec();
        line.extend(point.design.values().iter().copied().map(Cell::from));
        line.extend(criteria_cells(Some(&point.criteria)));
        line.extend(percentile_cells(Some(point.p90)));
        line.extend(percentile_cells(point.verified));
        line.push(point.on_front.into());
        table.rows.push(line);
    }
    table
}

fn chart(
    problem: &Problem,
    against: Objective,
    all: &[Point],
    marked: &[Point],
) -> Result<Picture, Error> {
    let at = |point: &Point| against.of(&point.criteria);
    let series = |name: &str, of: &dyn Fn(&Source) -> bool| PercentileSeries {
        name: name.to_owned(),
        points: marked
            .iter()
            .filter(|point| of(&point.source))
            .map(|point| (at(point), point.verified.unwrap_or(point.p90)))
            .collect(),
        infeasible: Vec::new(),
    };
    let dots: Vec<[f64; 2]> = all
        .iter()
        .map(|point| [at(point), point.p90.value])
        .collect();
    let front: Vec<[f64; 2]> = marked
        .iter()
        .filter(|point| point.on_front)
        .map(|point| [at(point), point.judged()])
        .collect();
    charts::front(
        &problem.measured().name,
        against.label(),
        against.limit(problem),
        &dots,
        &front,
        &[
            series("front of the DoE", &|s| matches!(s, Source::Doe(_))),
            series("optima", &|s| matches!(s, Source::Optimum(_))),
            series("direct searches", &|s| matches!(s, Source::Search)),
        ],
    )
}

#[cfg(test)]
mod tests {
    use gear::paper::printed::Place;
    use problem::Campaign;
    use stats::IntervalEstimate;

    use super::*;

    #[test]
    fn the_tables_are_whole_and_the_chart_shows_what_there_is() {
        let problem = Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap());
        let design = stages::references::design(Place::Figure(9));
        let gears = problem.gears().unwrap();
        let pair = gears.pair(&design).unwrap();
        let point = |source, pressure| Point {
            source,
            design: design.clone(),
            criteria: gears.pair_criteria(&pair, pressure),
            p90: IntervalEstimate {
                n: 30,
                value: 2.0,
                interval: Some((1.9, 2.1)),
            },
            verified: None,
            on_front: true,
        };
        let points = [
            point(Source::Doe(0), 1000.0),
            point(Source::Optimum("kriging"), 1300.0),
        ];
        assert!(
            all_figures(&problem, &points).csv().is_ok(),
            "every row is complete"
        );
        let chart = chart(&problem, Objective::Pressure, &points, &points);
        let svg = chart.unwrap().standalone();
        assert!(svg.contains("front of the DoE") && !svg.contains("direct searches"));
    }
}
