//! The page of speed against accuracy.

use askama::Template;

use super::ReportFiles;
use super::figure::{Figure, figure};
use crate::number::{short_time, significant};
use crate::report::charts::{self, TradeoffChart};
use crate::report::error::Error;
use crate::report::svg;

/// The page of speed against accuracy.
#[derive(Debug, Clone, PartialEq)]
pub struct TradeoffPage {
    pub campaign: String,
    pub digest: String,
    /// The measurement, in a sentence.
    pub lead: String,
    /// Label and value of further facts: machine, program version.
    pub facts: Vec<(String, String)>,
    pub studies: Vec<TradeoffStudy>,
    /// Remarks on what the page leaves out.
    pub notes: Vec<String>,
}

/// One study with its recommendations.
#[derive(Debug, Clone, PartialEq)]
pub struct TradeoffStudy {
    /// The id of its section.
    pub anchor: String,
    pub title: String,
    /// The measurement, in a sentence.
    pub lead: String,
    /// The charts, each with its recommendation.
    pub charts: Vec<TradeoffChart>,
    /// The heads of the columns with numbers, with units.
    pub columns: Vec<String>,
    /// All settings.
    pub rows: Vec<TradeoffRow>,
    /// The file that has the table.
    pub csv: String,
}

/// One setting of one method.
#[derive(Debug, Clone, PartialEq)]
pub struct TradeoffRow {
    /// The chart in which the setting stands.
    pub panel: String,
    pub method: String,
    pub setting: String,
    /// Marks the campaign's setting and a recommended one; empty for others.
    pub mark: String,
    /// One value for each column; NaN if there is none.
    pub values: Vec<f64>,
}

/// The studies of speed and accuracy as one HTML page that loads nothing and runs nothing, and its charts as
/// files.
///
/// # Errors
/// [`Error::Template`] if the template fails.
pub fn render_tradeoff(data: &TradeoffPage) -> Result<ReportFiles, Error> {
    let studies = data.studies.iter().map(view);
    let page = Page {
        data,
        page_css: super::PAGE_STYLE,
        chart_css: svg::CSS,
        studies: studies.collect::<Result<_, _>>()?,
    };
    let figures = page.studies.iter().flat_map(|study| &study.figures);
    let charts = figures.filter_map(|figure| figure.file.clone()).collect();
    Ok(ReportFiles {
        html: page.render()?,
        charts,
    })
}

fn view(study: &TradeoffStudy) -> Result<StudyView<'_>, Error> {
    let figures = study.charts.iter().map(|chart| {
        let figure = figure(&chart.file, charts::tradeoff(chart))?;
        Ok(figure.with_sentence(&chart.recommendation))
    });
    let is_time = |place: usize| study.columns[place].ends_with("(s)");
    let cells = |row: &TradeoffRow| {
        let values = row.values.iter().enumerate();
        let texts = values.map(|(place, value)| match is_time(place) {
            true => short_time(*value),
            false => significant(*value, 4),
        });
        texts.collect()
    };
    Ok(StudyView {
        study,
        rows: study.rows.iter().map(|row| (row, cells(row))).collect(),
        figures: figures.collect::<Result<_, Error>>()?,
    })
}

#[derive(Template)]
#[template(path = "tradeoff.html")]
struct Page<'a> {
    data: &'a TradeoffPage,
    page_css: &'static str,
    chart_css: &'static str,
    studies: Vec<StudyView<'a>>,
}

struct StudyView<'a> {
    study: &'a TradeoffStudy,
    /// All settings with their values as text.
    rows: Vec<(&'a TradeoffRow, Vec<String>)>,
    figures: Vec<Figure>,
}
