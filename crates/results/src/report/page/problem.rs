//! The page of a campaign with a problem of the user's.

use askama::Template;
use problem::Approach;
use problem::formulation::Problem;

use super::campaign::CampaignView;
use super::cells::{Show as _, ShowCount as _, Value, limited, limited_measure, named};
use super::distribution::DistributionView;
use super::enrichment::EnrichmentView;
use super::kriging::KrigingView;
use super::stages::StagesView;
use super::{PAGE_STYLE, ReportFiles};
use crate::number::{MISSING, digits_of, interval, with_unit};
use crate::optima::VerifiedOptimum;
use crate::report::contents::Report;
use crate::report::error::Error;
use crate::report::notes::notes;
use crate::report::quantity::{approach_name, variables};
use crate::report::summary::SummaryView;
use crate::report::svg;

pub(super) fn render(report: &Report) -> Result<ReportFiles, Error> {
    let snapshot = &report.snapshot;
    let page = Page {
        report,
        measure: snapshot.measure_name(),
        response: &snapshot.problem.objective().response.name,
        page_css: PAGE_STYLE,
        chart_css: svg::CSS,
        summary: SummaryView::new(report),
        campaign: CampaignView::new(report),
        optima: snapshot
            .optima
            .iter()
            .map(|verified| OptimumRow::new(&snapshot.problem, verified))
            .collect(),
        stages: StagesView::new(snapshot),
        distribution: DistributionView::new(snapshot)?,
        enrichment: EnrichmentView::new(report)?,
        kriging: KrigingView::new(report)?,
        paper: false,
        notes: notes(snapshot),
    };
    let distribution = page.distribution.iter();
    let enrichment = page.enrichment.iter();
    let kriging = page.kriging.iter();
    let figures = distribution
        .flat_map(DistributionView::figures)
        .chain(enrichment.flat_map(EnrichmentView::figures))
        .chain(kriging.flat_map(KrigingView::figures));
    let charts = figures.filter_map(|figure| figure.file.clone()).collect();
    Ok(ReportFiles {
        html: page.render()?,
        charts,
    })
}

#[derive(Template)]
#[template(path = "problem.html")]
struct Page<'a> {
    report: &'a Report,
    measure: String,
    response: &'a str,
    page_css: &'static str,
    chart_css: &'static str,
    summary: SummaryView<'a>,
    campaign: CampaignView<'a>,
    optima: Vec<OptimumRow<'a>>,
    stages: StagesView,
    distribution: Option<DistributionView>,
    enrichment: Option<EnrichmentView>,
    kriging: Option<KrigingView<'a>>,
    /// Always false: only a gear campaign can have the paper's problem.
    paper: bool,
    notes: Vec<String>,
}

struct OptimumRow<'a> {
    approach: &'static str,
    verified: &'a VerifiedOptimum,
    /// Variables, and constraints with a mark where one is broken; or why there is no design.
    design: Result<(Vec<String>, Vec<Value>), String>,
    criterion: String,
    p90: String,
    interval: String,
}

impl<'a> OptimumRow<'a> {
    fn new(problem: &Problem, verified: &'a VerifiedOptimum) -> Self {
        let optimum = &verified.optimum;
        let unit = &problem.measured().unit;
        // Searches without random effects minimise the response itself.
        let of_criterion = match optimum.approach {
            Approach::Nominal | Approach::Baseline => &*problem.objective().response.unit,
            _ => unit,
        };
        let found = optimum.found_or_sentence();
        let (p90, interval) = match verified.measure {
            None => (MISSING.to_owned(), MISSING.to_owned()),
            Some(p90) => {
                let digits = digits_of(p90.value, p90.interval).max(4);
                let too_few = || "none: too few samples".to_owned();
                let ends = p90.interval.map(|ends| interval(ends, digits));
                (
                    with_unit(p90.value, digits, unit),
                    ends.unwrap_or_else(too_few),
                )
            }
        };
        Self {
            approach: approach_name(problem, optimum.approach),
            verified,
            criterion: found.as_ref().map_or_else(
                |_| String::new(),
                |found| with_unit(found.criterion, 4, of_criterion),
            ),
            design: found.map(|found| {
                let constraints = limited(verified.constraints.iter()).into_iter();
                let limits = verified.limits.iter().map(limited_measure);
                (
                    named(&variables(problem, &found.design)),
                    constraints.chain(limits).collect(),
                )
            }),
            p90,
            interval,
        }
    }
}
