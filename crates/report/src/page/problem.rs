//! The report of a campaign with a problem of the user's.

use askama::Template;

use super::kriging::{KrigingView, kriging_view};
use super::rows::{limited, named};
use super::{Rendered, Value, nothing_found, tiles};
use crate::error::Error;
use crate::number::{count, percent, significant};
use crate::problem::{ProblemOptimum, ProblemReport};
use crate::summary::{SummaryView, digits_of, with_unit};
use crate::svg;

/// The report of a campaign with a problem of the user's.
///
/// # Errors
/// [`Error::Template`] if the template fails.
pub fn render_problem(data: &ProblemReport) -> Result<Rendered, Error> {
    let header = &data.header;
    let share = |designs: usize| percent(designs as f64 / header.designs as f64);
    let page = Page {
        data,
        page_css: super::PAGE_STYLE,
        chart_css: svg::CSS,
        summary: SummaryView::new(&data.summary, &nothing_found(&header.percentile)),
        tiles: tiles(header, false),
        refused: header
            .refused
            .iter()
            .map(|row| {
                let designs = count(row.count as u64);
                (row.reason.clone(), designs, share(row.count))
            })
            .collect(),
        optima: data
            .optima
            .iter()
            .map(|row| Row::new(row, &data.unit))
            .collect(),
        kriging: data
            .kriging
            .iter()
            .map(kriging_view)
            .collect::<Result<_, _>>()?,
        paper: false,
    };
    let figures = page.kriging.iter().flat_map(KrigingView::figures);
    let charts = figures.filter_map(|figure| figure.file.clone()).collect();
    Ok(Rendered {
        html: page.render()?,
        charts,
    })
}

#[derive(Template)]
#[template(path = "problem.html")]
struct Page<'a> {
    data: &'a ProblemReport,
    page_css: &'static str,
    chart_css: &'static str,
    summary: SummaryView,
    tiles: Vec<(String, String)>,
    refused: Vec<(String, String, String)>,
    optima: Vec<Row<'a>>,
    kriging: Vec<KrigingView>,
    /// The paper's problem is one of gears.
    paper: bool,
}

struct Row<'a> {
    approach: &'a str,
    /// Variables, and criteria with a mark where one breaks its limit; or why there is no design.
    design: Result<(Vec<String>, Vec<Value>), &'a str>,
    criterion: String,
    p90: String,
    interval: String,
    calls: String,
}

impl<'a> Row<'a> {
    fn new(optimum: &'a ProblemOptimum, unit: &str) -> Self {
        let constraints = optimum.constraints.iter().map(limited);
        let p90 = &optimum.p90;
        let digits = digits_of(p90).max(4);
        Self {
            approach: &optimum.approach,
            design: match &optimum.design {
                Ok(variables) => Ok((variables.iter().map(named).collect(), constraints.collect())),
                Err(why) => Err(why),
            },
            criterion: with_unit(optimum.criterion, 4, unit),
            p90: with_unit(p90.value, digits, unit),
            interval: match p90.low.is_nan() {
                true => "none: too few samples".to_owned(),
                false => format!(
                    "{} to {}",
                    significant(p90.low, digits),
                    significant(p90.high, digits)
                ),
            },
            calls: count(optimum.simulator_calls),
        }
    }
}
