//! The page: everything as text, ready for the template, which only arranges it.

mod atlas;
mod enrichment;
mod figure;
mod kriging;
mod optimum;
mod pair;
mod problem;
mod rows;
mod tradeoff;

use askama::Template;

use crate::costs::StageCost;
use crate::report::charts::{self, Extent, Response};
use crate::report::data::{GearData, Header, ReportData};
use crate::report::error::Error;
use crate::report::number::{MISSING, count, percent, seconds};
use crate::report::paper;
use crate::report::quantity::approach_name;
use crate::report::summary::SummaryView;
use crate::report::svg;
use crate::report::symbols::{self, KeyRow};
pub use atlas::render_atlas;
use enrichment::EnrichmentView;
pub use figure::ChartFile;
use figure::{Figure, figure};
use kriging::{KrigingView, kriging_view};
use optimum::OptimumView;
pub use pair::render_pair;
pub(in crate::report) use rows::p90_by_paper_um;
use rows::{ApproachRow, ComparedDesign, PreliminaryRow, ResponseRow, SimilarRow, Value};
pub use tradeoff::{TradeoffPage, TradeoffRow, TradeoffStudy, render_tradeoff};

/// The style of the report's pages, light and dark, for other pages that are to look like them.
pub const PAGE_STYLE: &str = include_str!("../../../templates/report.css");

/// A report: one HTML page that loads nothing and runs nothing, and its charts as files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportFiles {
    /// The page.
    pub html: String,
    /// Its charts.
    pub charts: Vec<ChartFile>,
}

/// The report of a campaign.
///
/// Missing parts appear as sentences: an experiment without simulable designs or an approach without
/// a design makes a shorter report, not an error.
///
/// # Errors
/// [`Error::LengthMismatch`] if lists of one curve differ in length, [`Error::UnknownFigure`] if a
/// printed design is not one of Figures 6 to 10, [`Error::Template`] if the template fails.
pub fn render(data: &ReportData) -> Result<ReportFiles, Error> {
    let Some(gears) = &data.gears else {
        return problem::render(data);
    };
    let body = Body::new(data, gears)?;
    let html = body.render()?;
    let page = Page {
        page: &body,
        page_css: PAGE_STYLE,
        chart_css: svg::CSS,
        key: symbols::key(&html),
        body: html,
    };
    Ok(ReportFiles {
        html: page.render()?,
        charts: body.figures().filter_map(|f| f.file.clone()).collect(),
    })
}

/// A page with its body, and the key to the symbols that the body uses.
#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    page: &'a Body<'a>,
    page_css: &'static str,
    chart_css: &'static str,
    body: String,
    key: Vec<KeyRow>,
}

/// The digest of the campaign whose report begins with `html`, as [`render`] wrote it; none if this is no
/// report, or one of a version that did not write the digest.
#[must_use]
pub fn campaign_digest(html: &str) -> Option<&str> {
    let mark = "<meta name=\"campaign-digest\" content=\"";
    let (_, rest) = html.split_once(mark)?;
    let (digest, _) = rest.split_once('"')?;
    Some(digest)
}

#[derive(Template)]
#[template(path = "report_body.html")]
struct Body<'a> {
    header: &'a Header,
    /// Whether the paper's columns are shown.
    paper: bool,
    paper_samples: usize,
    summary: SummaryView,
    tiles: Vec<(String, String)>,
    refused: Vec<(String, String, String)>,
    /// Stage, wall and CPU time.
    stages: Vec<[String; 3]>,
    stages_total: [String; 2],
    wear: Figure,
    preliminary: Vec<PreliminaryRow>,
    responses: Vec<ResponseRow>,
    doe_is_empty: bool,
    scatter: Vec<Figure>,
    zoom: Vec<Figure>,
    similar: Vec<SimilarRow>,
    kriging: Option<KrigingView>,
    approaches: Vec<ApproachRow>,
    convergence: Vec<Figure>,
    enrichment: Option<EnrichmentView>,
    optima: Vec<OptimumView>,
    printed: Vec<ComparedDesign>,
    notes: Vec<(String, String)>,
}

impl<'a> Body<'a> {
    /// All figures, in the order of the page.
    fn figures(&self) -> impl Iterator<Item = &Figure> {
        let enrichment = self.enrichment.iter();
        let optima = self.optima.iter();
        self.convergence
            .iter()
            .chain(enrichment.flat_map(|e| [&e.prediction, &e.expected]))
            .chain(optima.flat_map(|o| &o.figures))
            .chain(std::iter::once(&self.wear))
            .chain(&self.scatter)
            .chain(&self.zoom)
            .chain(self.kriging.iter().flat_map(KrigingView::figures))
    }

    fn new(data: &'a ReportData, gears: &GearData) -> Result<Self, Error> {
        use Response::{Archard, Percentile, Unworn};
        let paper = gears.compare_with_paper;
        let header = &data.header;
        let responses = |name, x, y, extent| {
            figure(
                name,
                charts::responses(&gears.doe, &header.percentile, x, y, extent),
            )
        };
        Ok(Self {
            header,
            paper,
            paper_samples: paper::ACCURATE_SAMPLES,
            summary: SummaryView::new(data, &nothing_found(&header.percentile)),
            tiles: tiles(header, paper),
            refused: refused(header),
            stages: header.stages.iter().map(stage).collect(),
            stages_total: [
                total(header, |stage| stage.wall_seconds),
                total(header, |stage| stage.cpu_seconds),
            ],
            wear: match &gears.wear {
                Some(profiles) => {
                    let chart = charts::wear(profiles, charts::FULL);
                    figure("wear", chart.map(|picture| picture.of(&profiles.subject)))?
                        .with_sentence(&profiles.subject)
                }
                None => Figure::missing("No wear profile was recorded."),
            },
            preliminary: rows::preliminary(gears),
            responses: rows::responses(gears, &header.percentile),
            doe_is_empty: gears.doe.is_empty(),
            scatter: vec![
                responses("doe-unworn-archard", Unworn, Archard, Extent::Logarithmic)?,
                responses(
                    "doe-unworn-percentile",
                    Unworn,
                    Percentile,
                    Extent::Logarithmic,
                )?,
            ],
            zoom: vec![
                responses("doe-archard-percentile", Archard, Percentile, Extent::Full)?,
                responses(
                    "doe-archard-percentile-zoom",
                    Archard,
                    Percentile,
                    Extent::Zoom,
                )?,
            ],
            similar: rows::similar(gears),
            kriging: data.kriging.as_ref().map(kriging_view).transpose()?,
            approaches: rows::approaches(data, gears),
            convergence: gears
                .runs
                .iter()
                .enumerate()
                .map(|(i, (approach, runs))| {
                    let chart = charts::convergence(approach_name(&data.problem, *approach), runs);
                    figure(&format!("convergence-{}", i + 1), chart)
                })
                .collect::<Result<_, _>>()?,
            enrichment: gears
                .enrichment
                .as_ref()
                .map(|enrichment| EnrichmentView::new(enrichment, &header.percentile))
                .transpose()?,
            optima: optima(data, gears)?,
            printed: if paper {
                rows::printed(gears)?
            } else {
                Vec::new()
            },
            notes: data
                .optima
                .iter()
                .map(|verified| &verified.optimum)
                .filter(|optimum| optimum.found.is_ok() && !optimum.note.is_empty())
                .map(|optimum| {
                    let name = approach_name(&data.problem, optimum.approach);
                    (format!("{name}: "), optimum.note.clone())
                })
                .chain(data.notes.iter().map(|note| (String::new(), note.clone())))
                .collect(),
        })
    }
}

/// The designs in the order of the paper's figures, then those of approaches that it does not have.
fn optima(data: &ReportData, gears: &GearData) -> Result<Vec<OptimumView>, Error> {
    let mut optima: Vec<_> = data.optima.iter().enumerate().collect();
    optima.sort_by_key(|(_, verified)| OptimumView::place(verified.optimum.approach));
    let mut views = Vec::with_capacity(optima.len() + 1);
    for design in gears.printed.iter().filter(|_| gears.compare_with_paper) {
        views.extend(OptimumView::of_paper(design)?);
    }
    for (i, verified) in optima {
        views.push(OptimumView::new(i, verified, data, gears)?);
    }
    Ok(views)
}

/// The reasons for which designs were refused, with their number and share.
fn refused(header: &Header) -> Vec<(String, String, String)> {
    let row = |(reason, designs): &(String, usize)| {
        let share = *designs as f64 / header.designs as f64;
        (reason.clone(), count(*designs as u64), percent(share))
    };
    header.refused.iter().map(row).collect()
}

/// A stage with its wall and CPU time.
fn stage(stage: &StageCost) -> [String; 3] {
    let [wall, cpu] = [stage.wall_seconds, stage.cpu_seconds].map(seconds);
    [stage.stage.name().to_owned(), wall, cpu]
}

/// What all stages took, of what is known.
fn total(header: &Header, of: fn(&StageCost) -> f64) -> String {
    let known = header.stages.iter().map(of).filter(|s| s.is_finite());
    match known.clone().next() {
        Some(_) => seconds(known.sum()),
        None => MISSING.to_owned(),
    }
}

/// What stands in the place of a recommendation.
fn nothing_found(percentile: &str) -> String {
    format!("No approach ended on a feasible design with a verified {percentile}.")
}

fn tiles(header: &Header, compare: bool) -> Vec<(String, String)> {
    let mut simulable = count(header.simulable as u64);
    if header.designs > 0 {
        let share = header.simulable as f64 / header.designs as f64;
        simulable.push_str(&format!(" ({})", percent(share)));
    }
    if compare {
        simulable.push_str(&format!(
            "; paper {} of {}",
            paper::SIMULABLE,
            paper::DESIGNS
        ));
    }
    let mut tiles: Vec<(String, String)> = [
        ("Seed", header.seed.to_string()),
        ("Program version", header.program_version.clone()),
        ("Designs n", count(header.designs as u64)),
        (
            "Samples per design k",
            count(header.samples_per_design as u64),
        ),
        ("Simulable designs", simulable),
        ("Simulator calls", count(header.simulator_calls)),
    ]
    .map(|(label, value)| (label.to_owned(), value))
    .to_vec();
    tiles.extend(header.facts.iter().cloned());
    tiles
}
