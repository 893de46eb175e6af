//! The page of a gear campaign.

use askama::Template;

use super::approaches::{ApproachRow, approaches};
use super::campaign::CampaignView;
use super::cases::CasesView;
use super::cells::{Show as _, ShowCount as _, ShowPercentile as _};
use super::distribution::DistributionView;
use super::enrichment::EnrichmentView;
use super::figure::{Figure, figure};
use super::kriging::KrigingView;
use super::optimum::OptimumView;
use super::stages::StagesView;
use super::{PAGE_STYLE, ReportFiles};
use crate::report::charts::{self, Extent};
use crate::report::contents::{GearFigures, Report};
use crate::report::doe::{self, DoePoint, Response, ResponseStatistics};
use crate::report::error::Error;
use crate::report::notes::notes;
use crate::report::paper::ACCURATE_SAMPLES;
use crate::report::printed::{PreliminaryDesign, PrintedDesign, SimilarDesign};
use crate::report::quantity::approach_name;
use crate::report::summary::SummaryView;
use crate::report::svg;
use crate::report::symbols::{self, KeyRow};

pub(super) fn render(report: &Report, gears: &GearFigures) -> Result<ReportFiles, Error> {
    let body = Body::new(report, gears)?;
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

#[derive(Template)]
#[template(path = "report_body.html")]
struct Body<'a> {
    report: &'a Report,
    measure: String,
    /// Whether the paper's columns are shown.
    paper: bool,
    paper_samples: usize,
    preliminary: &'a [PreliminaryDesign],
    similar: &'a [SimilarDesign],
    printed: &'a [PrintedDesign],
    samples_per_design: u32,
    summary: SummaryView<'a>,
    campaign: CampaignView<'a>,
    stages: StagesView,
    wear: Figure,
    responses: Vec<ResponseStatistics>,
    doe_is_empty: bool,
    scatter: Vec<Figure>,
    zoom: Vec<Figure>,
    kriging: Option<KrigingView<'a>>,
    approaches: Vec<ApproachRow<'a>>,
    convergence: Vec<Figure>,
    cases: Option<CasesView>,
    distribution: Option<DistributionView>,
    enrichment: Option<EnrichmentView>,
    optima: Vec<OptimumView>,
    /// The approach that a note is about, if it is about one, and the note.
    notes: Vec<(String, String)>,
}

impl<'a> Body<'a> {
    /// All figures, in the order of the page.
    fn figures(&self) -> impl Iterator<Item = &Figure> {
        let enrichment = self.enrichment.iter();
        let distribution = self.distribution.iter();
        let optima = self.optima.iter();
        self.convergence
            .iter()
            .chain(distribution.flat_map(DistributionView::figures))
            .chain(enrichment.flat_map(EnrichmentView::figures))
            .chain(optima.flat_map(|o| &o.figures))
            .chain(std::iter::once(&self.wear))
            .chain(&self.scatter)
            .chain(&self.zoom)
            .chain(self.kriging.iter().flat_map(KrigingView::figures))
    }

    fn new(report: &'a Report, gears: &'a GearFigures) -> Result<Self, Error> {
        use Response::{Archard, Percentile, Unworn};
        let snapshot = &report.snapshot;
        let measure = snapshot.measure_name();
        let paper = gears.paper.as_ref();
        let recommended = recommended(report, gears);
        let responses = |name, x, y, extent| {
            let chart = charts::responses(&gears.doe, recommended.as_ref(), &measure, x, y, extent);
            figure(name, chart)
        };
        Ok(Self {
            report,
            paper: paper.is_some(),
            preliminary: paper.map_or(&[][..], |paper| &paper.preliminary),
            similar: paper.map_or(&[][..], |paper| &paper.similar),
            printed: paper.map_or(&[][..], |paper| &paper.designs),
            paper_samples: ACCURATE_SAMPLES,
            samples_per_design: snapshot.problem.campaign().sampling.samples_per_design,
            summary: SummaryView::new(report),
            campaign: CampaignView::new(report),
            stages: StagesView::new(snapshot),
            wear: match &gears.wear {
                Some(profiles) => {
                    let chart = charts::wear(profiles, charts::FULL);
                    figure("wear", chart.map(|picture| picture.of(&profiles.subject)))?
                        .with_sentence(&profiles.subject)
                }
                None => Figure::missing("No wear profile was recorded."),
            },
            responses: doe::statistics(&gears.doe),
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
            kriging: KrigingView::new(report)?,
            approaches: approaches(report, gears),
            convergence: gears
                .runs
                .iter()
                .enumerate()
                .map(|(i, (approach, runs))| {
                    let name = approach_name(&snapshot.problem, *approach);
                    let chart = charts::convergence(name, runs);
                    figure(&format!("convergence-{}", i + 1), chart)
                })
                .collect::<Result<_, _>>()?,
            cases: CasesView::new(snapshot),
            distribution: DistributionView::new(snapshot)?,
            enrichment: EnrichmentView::new(report)?,
            optima: optima(report, gears)?,
            notes: all_notes(report),
            measure,
        })
    }
}

/// The designs in the order of the paper's figures, then those of approaches that it does not have.
fn optima(report: &Report, gears: &GearFigures) -> Result<Vec<OptimumView>, Error> {
    let mut optima: Vec<_> = report.snapshot.optima.iter().enumerate().collect();
    optima.sort_by_key(|(_, verified)| OptimumView::place(verified.optimum.approach));
    let mut views = Vec::with_capacity(optima.len() + 1);
    for design in gears.paper.iter().flat_map(|paper| &paper.designs) {
        views.extend(OptimumView::of_paper(design)?);
    }
    for (i, verified) in optima {
        views.push(OptimumView::new(i, verified, report, gears)?);
    }
    Ok(views)
}

/// The notes on the optima, then those on the campaign.
fn all_notes(report: &Report) -> Vec<(String, String)> {
    let optima = report.snapshot.optima.iter();
    let optima = optima.map(|verified| &verified.optimum);
    let on_optima = optima
        .filter(|optimum| optimum.found.is_ok() && !optimum.note.is_empty())
        .map(|optimum| {
            let name = approach_name(report.problem(), optimum.approach);
            (format!("{name}: "), optimum.note.clone())
        });
    let others = notes(&report.snapshot).into_iter();
    on_optima
        .chain(others.map(|note| (String::new(), note)))
        .collect()
}

/// The responses of the recommended design of a finished campaign.
fn recommended(report: &Report, gears: &GearFigures) -> Option<DoePoint> {
    let is_finished = report.missing.is_empty();
    let best = report
        .snapshot
        .optima
        .recommended()
        .filter(|_| is_finished)?;
    let [delta_ste_um, delta_ste_archard_um] = gears
        .illustrations
        .get(&best.optimum.approach)?
        .ste
        .delta_um;
    Some(DoePoint {
        delta_ste_um,
        delta_ste_archard_um,
        measure_um: best.measure?.value,
    })
}
