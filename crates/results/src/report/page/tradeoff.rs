//! The page of speed against accuracy.

use askama::Template;

use super::ReportFiles;
use super::figure::{Figure, figure};
use crate::report::charts::{self, TradeoffChart};
use crate::report::error::Error;
use crate::report::number::significant;
use crate::report::svg;

/// What a page of speed against accuracy shows.
#[derive(Debug, Clone, PartialEq)]
pub struct TradeoffPage {
    /// The campaign's name.
    pub campaign: String,
    /// The campaign's digest.
    pub digest: String,
    /// What was measured, and how thoroughly.
    pub lead: String,
    /// Label and value of further facts: machine, program version.
    pub facts: Vec<(String, String)>,
    /// The studies.
    pub studies: Vec<TradeoffStudy>,
    /// What the page does not show, and where it is found.
    pub notes: Vec<String>,
}

/// One study: what it measured, and what follows.
#[derive(Debug, Clone, PartialEq)]
pub struct TradeoffStudy {
    /// Its name in the address of its section.
    pub anchor: String,
    /// Its heading.
    pub title: String,
    /// What was measured.
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
    /// For what it was measured.
    pub panel: String,
    /// The method.
    pub method: String,
    /// The method's setting.
    pub setting: String,
    /// What it is beside that: the campaign's setting, or a recommended one.
    pub mark: String,
    /// One value for each column; not finite where there is none.
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
        page_css: include_str!("../../../templates/report.css"),
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
    let rows = study.rows.iter().map(|row| {
        let cells = row.values.iter().map(|value| match value.is_finite() {
            true => significant(*value, 4),
            false => "–".to_owned(),
        });
        (row, cells.collect())
    });
    Ok(StudyView {
        study,
        figures: figures.collect::<Result<_, Error>>()?,
        rows: rows.collect(),
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
    figures: Vec<Figure>,
    rows: Vec<(&'a TradeoffRow, Vec<String>)>,
}
