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

use crate::charts::{self, Extent, Response};
use crate::data::{Header, ReportData, StageCost};
use crate::error::Error;
use crate::number::{MISSING, count, percent, seconds};
use crate::paper;
use crate::summary::SummaryView;
use crate::svg;
use crate::symbols::{self, KeyRow};
pub use atlas::render_atlas;
use enrichment::EnrichmentView;
pub use figure::ChartFile;
use figure::{Figure, figure};
use kriging::{KrigingView, kriging_view};
use optimum::OptimumView;
pub use pair::render_pair;
pub use problem::render_problem;
use rows::{ApproachRow, ComparedDesign, PreliminaryRow, ResponseRow, SimilarRow, Value};
pub use tradeoff::{TradeoffPage, TradeoffRow, TradeoffStudy, render_tradeoff};

/// The style of the report's pages, light and dark, for other pages that are to look like them.
pub const PAGE_STYLE: &str = include_str!("../../templates/report.css");

/// A report: one HTML page that loads nothing and runs nothing, and its charts as files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rendered {
    /// The page.
    pub html: String,
    /// Its charts.
    pub charts: Vec<ChartFile>,
}

/// The report of a gear campaign.
///
/// Missing parts appear as sentences: an experiment without simulable designs or an approach without
/// a design makes a shorter report, not an error.
///
/// # Errors
/// [`Error::LengthMismatch`] if lists of one curve differ in length, [`Error::UnknownFigure`] if a
/// printed design is not one of Figures 6 to 10, [`Error::Template`] if the template fails.
pub fn render(data: &ReportData) -> Result<Rendered, Error> {
    let mut page = Page::new(data)?;
    page.key = symbols::key(&page.render()?);
    Ok(Rendered {
        html: page.render()?,
        charts: page.figures().filter_map(|f| f.file.clone()).collect(),
    })
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
#[template(path = "report.html")]
struct Page<'a> {
    header: &'a Header,
    page_css: &'static str,
    chart_css: &'static str,
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
    kriging: Vec<KrigingView>,
    approaches: Vec<ApproachRow>,
    convergence: Vec<Figure>,
    enrichment: Option<EnrichmentView>,
    optima: Vec<OptimumView>,
    printed: Vec<ComparedDesign>,
    notes: Vec<(String, String)>,
    /// The symbols that the rest of the page uses.
    key: Vec<KeyRow>,
}

impl<'a> Page<'a> {
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

    fn new(data: &'a ReportData) -> Result<Self, Error> {
        use Response::{Archard, Percentile, Unworn};
        let paper = data.compare_with_paper;
        let header = &data.header;
        let responses = |name, x, y, extent| {
            figure(
                name,
                charts::responses(&data.doe, &header.percentile, x, y, extent),
            )
        };
        Ok(Self {
            header,
            page_css: PAGE_STYLE,
            chart_css: svg::CSS,
            paper,
            paper_samples: paper::ACCURATE_SAMPLES,
            summary: SummaryView::new(&data.summary, &nothing_found(&header.percentile)),
            tiles: tiles(header, paper),
            refused: header
                .refused
                .iter()
                .map(|reason| {
                    let share = reason.count as f64 / header.designs as f64;
                    (
                        reason.reason.clone(),
                        count(reason.count as u64),
                        percent(share),
                    )
                })
                .collect(),
            stages: header.stages.iter().map(stage).collect(),
            stages_total: [
                total(header, |stage| stage.wall_seconds),
                total(header, |stage| stage.cpu_seconds),
            ],
            wear: match &data.wear {
                Some(profiles) => {
                    let chart = charts::wear(profiles, charts::FULL);
                    figure("wear", chart.map(|picture| picture.of(&profiles.subject)))?
                        .with_sentence(&profiles.subject)
                }
                None => Figure::missing("No wear profile was recorded."),
            },
            preliminary: rows::preliminary(data),
            responses: rows::responses(data),
            doe_is_empty: data.doe.is_empty(),
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
            similar: rows::similar(data),
            kriging: data
                .kriging
                .iter()
                .map(kriging_view)
                .collect::<Result<_, _>>()?,
            approaches: rows::approaches(data),
            convergence: data
                .approaches
                .iter()
                .filter(|result| !result.runs.is_empty())
                .enumerate()
                .map(|(i, result)| {
                    let chart = charts::convergence(result.approach.label(), &result.runs);
                    figure(&format!("convergence-{}", i + 1), chart)
                })
                .collect::<Result<_, _>>()?,
            enrichment: data
                .enrichment
                .as_ref()
                .map(|enrichment| EnrichmentView::new(enrichment, &header.percentile))
                .transpose()?,
            optima: optima(data)?,
            printed: if paper {
                rows::printed(data)?
            } else {
                Vec::new()
            },
            notes: data
                .approaches
                .iter()
                .filter(|result| !result.note.is_empty())
                .map(|result| {
                    (
                        format!("{}: ", result.approach.label()),
                        result.note.clone(),
                    )
                })
                .chain(data.notes.iter().map(|note| (String::new(), note.clone())))
                .collect(),
            key: Vec::new(),
        })
    }
}

/// The designs in the order of the paper's figures, then those of approaches that it does not have.
fn optima(data: &ReportData) -> Result<Vec<OptimumView>, Error> {
    let paper = data.compare_with_paper;
    let mut results: Vec<_> = data.approaches.iter().enumerate().collect();
    results.sort_by_key(|(_, result)| OptimumView::place(result.approach));
    let mut views = Vec::with_capacity(results.len() + 1);
    for design in data.printed.iter().filter(|_| paper) {
        views.extend(OptimumView::of_paper(design)?);
    }
    for (i, result) in results {
        views.push(OptimumView::new(i, result, &data.header.percentile, paper)?);
    }
    Ok(views)
}

/// A stage with its wall and CPU time.
fn stage(stage: &StageCost) -> [String; 3] {
    let [wall, cpu] = [stage.wall_seconds, stage.cpu_seconds].map(seconds);
    [stage.stage.clone(), wall, cpu]
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
