//! The pages: texts and figures ready for the templates, which arrange them.

mod approaches;
mod atlas;
mod campaign;
mod cases;
mod cells;
mod distribution;
mod enrichment;
mod figure;
mod gears;
mod kriging;
mod optimum;
mod pair;
mod problem;
mod stages;
mod tradeoff;

pub use atlas::render_atlas;
pub use figure::ChartFile;
pub use pair::{PairPage, render_pair};
pub use tradeoff::{TradeoffPage, TradeoffRow, TradeoffStudy, render_tradeoff};

use crate::report::contents::Report;
use crate::report::error::Error;

/// The style of the report's pages, light and dark, for other pages that are to look like them.
pub const PAGE_STYLE: &str = include_str!("../../../templates/report.css");

/// A report: one HTML page that loads nothing and runs nothing, and its charts as files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportFiles {
    pub html: String,
    pub charts: Vec<ChartFile>,
}

/// The report of a campaign.
///
/// Missing parts appear as sentences: an experiment without simulable designs or an approach without
/// a design makes a shorter report, not an error.
///
/// # Errors
/// [`Error::LengthMismatch`] if lists of one curve differ in length, [`Error::Template`] if the template fails.
pub fn render(report: &Report) -> Result<ReportFiles, Error> {
    match &report.gears {
        Some(gears) => gears::render(report, gears),
        None => problem::render(report),
    }
}

/// The digest of the campaign whose report begins with `html`, as [`render`] wrote it; none if this is no
/// report, or one of a version that did not write the digest.
#[must_use]
pub fn campaign_digest(html: &str) -> Option<&str> {
    meta(html, "campaign-digest")
}

/// The name of the campaign whose report begins with `html`, under the conditions of [`campaign_digest`].
#[must_use]
pub fn campaign_name(html: &str) -> Option<&str> {
    meta(html, "campaign")
}

/// The content of the `meta` element of this name.
fn meta<'a>(html: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = html.split_once(&format!("<meta name=\"{name}\" content=\""))?;
    rest.split_once('"').map(|(content, _)| content)
}
