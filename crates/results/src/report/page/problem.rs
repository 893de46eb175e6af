//! The page of a campaign with a problem of the user's.

use askama::Template;
use campaign::formulation::Problem;

use super::kriging::{KrigingView, kriging_view};
use super::rows::{limited, named};
use super::{ReportFiles, Value, nothing_found, refused, tiles};
use crate::optima::VerifiedOptimum;
use crate::report::data::ReportData;
use crate::report::error::Error;
use crate::report::number::count;
use crate::report::quantity::{approach_name, variables};
use crate::report::summary::{SummaryView, percentile_and_interval, with_unit};
use crate::report::svg;

/// The report of a campaign with a problem of the user's.
pub(super) fn render(data: &ReportData) -> Result<ReportFiles, Error> {
    let header = &data.header;
    let page = Page {
        data,
        page_css: super::PAGE_STYLE,
        chart_css: svg::CSS,
        summary: SummaryView::new(data, &nothing_found(&header.percentile)),
        tiles: tiles(header, false),
        refused: refused(header),
        optima: data
            .optima
            .iter()
            .map(|verified| Row::new(&data.problem, verified))
            .collect(),
        kriging: data.kriging.as_ref().map(kriging_view).transpose()?,
        paper: false,
    };
    let figures = page.kriging.iter().flat_map(KrigingView::figures);
    let charts = figures.filter_map(|figure| figure.file.clone()).collect();
    Ok(ReportFiles {
        html: page.render()?,
        charts,
    })
}

#[derive(Template)]
#[template(path = "problem.html")]
struct Page<'a> {
    data: &'a ReportData,
    page_css: &'static str,
    chart_css: &'static str,
    summary: SummaryView,
    tiles: Vec<(String, String)>,
    refused: Vec<(String, String, String)>,
    optima: Vec<Row>,
    kriging: Option<KrigingView>,
    /// The paper's problem is one of gears.
    paper: bool,
}

struct Row {
    approach: &'static str,
    /// Variables, and criteria with a mark where one breaks its limit; or why there is no design.
    design: Result<(Vec<String>, Vec<Value>), String>,
    criterion: String,
    p90: String,
    interval: String,
    calls: String,
}

impl Row {
    fn new(problem: &Problem, verified: &VerifiedOptimum) -> Self {
        let optimum = &verified.optimum;
        let unit = &problem.sampled().unit;
        let [p90, interval] = percentile_and_interval(verified.percentile, 4, unit);
        let found = optimum.found_or_sentence();
        Self {
            approach: approach_name(problem, optimum.approach),
            criterion: found.as_ref().map_or_else(
                |_| String::new(),
                |found| with_unit(found.criterion, 4, unit),
            ),
            design: found.map(|found| {
                let variables = variables(problem, &found.design);
                let constraints = verified.constraints.iter();
                (
                    variables.iter().map(named).collect(),
                    constraints.map(limited).collect(),
                )
            }),
            p90,
            interval,
            calls: count(optimum.cost.simulator_calls),
        }
    }
}
