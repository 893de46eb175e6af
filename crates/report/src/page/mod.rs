//! The page: everything as text, ready for the template, which only arranges it.

mod enrichment;
mod pair;
mod problem;
mod rows;

use askama::Template;

use crate::charts::{self, Extent, Response};
use crate::data::{ApproachResult, Header, KrigingFit, ReportData};
use crate::error::Error;
use crate::number::{self, count, fixed, percent, seconds, significant};
use crate::paper;
use crate::svg::{self, Picture};
use enrichment::EnrichmentView;
pub use pair::render_pair;
pub use problem::render_problem;
use rows::{ApproachRow, ComparedDesign, PreliminaryRow, ResponseRow, SimilarRow, Value};

/// The style of the report's pages, light and dark, for other pages that are to look like them.
pub const PAGE_STYLE: &str = include_str!("../../templates/report.css");

/// The report as one HTML page that loads nothing and runs nothing.
///
/// Missing parts appear as sentences: an experiment without simulable designs or an approach without
/// a design makes a shorter report, not an error.
///
/// # Errors
/// [`Error::LengthMismatch`] if lists of one curve differ in length, [`Error::UnknownFigure`] if a
/// printed design is not one of Figures 6 to 10, [`Error::Template`] if the template fails.
pub fn render(data: &ReportData) -> Result<String, Error> {
    Ok(Page::new(data)?.render()?)
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
    headline: String,
    tiles: Vec<(String, String)>,
    refused: Vec<(String, String, String)>,
    stages: Vec<(String, String)>,
    stages_total: String,
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
}

/// A chart, or the sentence that stands in its place.
struct Figure {
    svg: Option<String>,
    sentence: String,
}

struct KrigingView {
    title: String,
    kernel: String,
    quality: Vec<(String, String)>,
    warnings: Vec<String>,
    parameters: Vec<(String, String, String)>,
    figure: Figure,
}

struct OptimumView {
    anchor: String,
    title: String,
    summary: String,
    failed: bool,
    gears: Figure,
    ste: Figure,
}

impl<'a> Page<'a> {
    fn new(data: &'a ReportData) -> Result<Self, Error> {
        use Response::{Archard, Percentile, Unworn};
        let paper = data.compare_with_paper;
        let header = &data.header;
        let responses = |x, y, extent| {
            figure(charts::responses(
                &data.doe,
                &header.percentile,
                x,
                y,
                extent,
            ))
        };
        Ok(Self {
            header,
            page_css: PAGE_STYLE,
            chart_css: svg::CSS,
            paper,
            paper_samples: paper::ACCURATE_SAMPLES,
            headline: headline(data),
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
            stages: header
                .stages
                .iter()
                .map(|stage| (stage.stage.clone(), seconds(stage.cpu_seconds)))
                .collect(),
            stages_total: seconds(
                header
                    .stages
                    .iter()
                    .map(|s| s.cpu_seconds)
                    .filter(|s| s.is_finite())
                    .sum(),
            ),
            wear: match &data.wear {
                Some(profiles) => {
                    figure(charts::wear(profiles, charts::FULL))?.with_sentence(&profiles.subject)
                }
                None => Figure::missing("No wear profile was recorded."),
            },
            preliminary: rows::preliminary(data),
            responses: rows::responses(data),
            doe_is_empty: data.doe.is_empty(),
            scatter: vec![
                responses(Unworn, Archard, Extent::Logarithmic)?,
                responses(Unworn, Percentile, Extent::Logarithmic)?,
            ],
            zoom: vec![
                responses(Archard, Percentile, Extent::Full)?,
                responses(Archard, Percentile, Extent::Zoom)?,
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
                .map(|result| figure(charts::convergence(result.approach.label(), &result.runs)))
                .collect::<Result<_, _>>()?,
            enrichment: data
                .enrichment
                .as_ref()
                .map(|enrichment| EnrichmentView::new(enrichment, &header.percentile))
                .transpose()?,
            optima: data
                .approaches
                .iter()
                .enumerate()
                .map(|(i, result)| optimum_view(i, result, &header.percentile))
                .collect::<Result<_, _>>()?,
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
        })
    }
}

impl Figure {
    fn missing(sentence: &str) -> Self {
        Self {
            svg: None,
            sentence: sentence.to_owned(),
        }
    }

    fn with_sentence(mut self, sentence: &str) -> Self {
        if self.svg.is_some() {
            self.sentence = sentence.to_owned();
        }
        self
    }
}

/// A chart for the page. Nothing to draw is a sentence, any other error stays one.
fn figure(picture: Result<Picture, Error>) -> Result<Figure, Error> {
    match picture {
        Ok(picture) => Ok(Figure {
            svg: Some(picture.inline()),
            sentence: String::new(),
        }),
        Err(Error::NothingToDraw { why, .. }) => Ok(Figure {
            svg: None,
            sentence: format!("Nothing to draw: {why}."),
        }),
        Err(other) => Err(other),
    }
}

/// The result in a sentence or two.
fn headline(data: &ReportData) -> String {
    let best = data
        .approaches
        .iter()
        .filter_map(|result| Some((result.approach, result.outcome.as_ref().ok()?)))
        .filter(|(_, optimum)| optimum.feasible && optimum.p90.value_um.is_finite())
        .min_by(|a, b| a.1.p90.value_um.total_cmp(&b.1.p90.value_um));
    match best {
        Some((approach, optimum)) => format!(
            "The lowest verified {} of a feasible design is {} µm (95 % interval {} to {} µm, {} \
             samples), found by the approach “{}”.",
            data.header.percentile,
            significant(optimum.p90.value_um, 3),
            significant(optimum.p90.low_um, 3),
            significant(optimum.p90.high_um, 3),
            count(optimum.p90.samples as u64),
            approach.label(),
        ),
        None if data.approaches.is_empty() => "No approach has been run.".to_owned(),
        None => format!(
            "No approach ended on a feasible design with a verified {}.",
            data.header.percentile
        ),
    }
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

/// A number with its unit, if it has one.
fn with_unit(value: f64, digits: usize, unit: &str) -> String {
    format!("{} {unit}", significant(value, digits))
        .trim_end()
        .to_owned()
}

fn kriging_view(fit: &KrigingFit) -> Result<KrigingView, Error> {
    let standardised = fit.leave_one_out.iter();
    let standardised = standardised.filter_map(|p| Some((p.design, p.standardised?)));
    let largest = standardised.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let largest = largest.map(|(design, residual)| {
        (
            "Largest standardised residual".to_owned(),
            format!("{} (design {design})", fixed(residual, 1)),
        )
    });
    Ok(KrigingView {
        title: fit.title.clone(),
        kernel: fit.kernel.clone(),
        warnings: fit.warnings.clone(),
        quality: [
            ("Q²".to_owned(), fixed(fit.q2, 3)),
            ("RMSE".to_owned(), with_unit(fit.rmse_um, 3, &fit.unit)),
            (
                "Within the 90 % interval".to_owned(),
                percent(fit.coverage_90),
            ),
            (
                "Observations".to_owned(),
                count(fit.leave_one_out.len() as u64),
            ),
        ]
        .into_iter()
        .chain(largest)
        .collect(),
        parameters: fit
            .parameters
            .iter()
            .map(|p| (p.name.clone(), significant(p.value, 4), p.unit.clone()))
            .collect(),
        figure: figure(charts::leave_one_out(fit))?,
    })
}

fn optimum_view(
    index: usize,
    result: &ApproachResult,
    percentile: &str,
) -> Result<OptimumView, Error> {
    let approach = result.approach;
    let mut view = OptimumView {
        anchor: format!("optimum-{}", index + 1),
        title: approach.label().to_owned(),
        summary: String::new(),
        failed: result.outcome.is_err(),
        gears: Figure::missing("No outline was recorded for this design."),
        ste: Figure::missing("No transmission error curve was recorded for this design."),
    };
    match &result.outcome {
        Err(reason) => {
            view.summary = format!("This approach has no design: {reason}");
        }
        Ok(optimum) => {
            let converged = optimum
                .converged_difference_um
                .map_or_else(String::new, |value| {
                    format!(" ({} µm on the converged grid)", rows::difference(value))
                });
            view.summary = format!(
                "{} {} µm, verified {percentile} {} µm{converged}; {}.",
                number::capitalised(&approach.criterion(percentile)),
                significant(optimum.criterion_um, 3),
                significant(optimum.p90.value_um, 3),
                if optimum.feasible {
                    "feasible"
                } else {
                    "infeasible"
                },
            );
            if let Some(drawing) = &optimum.drawing {
                view.gears = figure(charts::gears(drawing))?;
            }
            if let Some(curves) = &optimum.ste {
                view.ste = figure(charts::ste(curves))?;
            }
        }
    }
    Ok(view)
}
