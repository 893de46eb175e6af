//! One design: its gears, its transmission error and its contact.

use problem::Approach;
use problem::optimise::Solution;

use super::approaches::difference;
use super::cells::ShowPercentile as _;
use super::figure::{Figure, figure};
use crate::number::{fixed, significant};
use crate::optima::VerifiedOptimum;
use crate::report::charts;
use crate::report::contents::{GearFigures, Report};
use crate::report::drawing::Illustration;
use crate::report::error::Error;
use crate::report::paper;
use crate::report::printed::PrintedDesign;
use crate::report::quantity::{approach_name, capitalised, criterion_name};
use crate::report::svg::Picture;
use crate::report::symbols;
use crate::sheet::Section;

/// The section of one design.
pub(super) struct OptimumView {
    pub(super) anchor: String,
    pub(super) title: String,
    pub(super) summary: String,
    /// The paper's figure of the same design, and the values that the paper prints with it.
    pub(super) printed: Option<(u8, String)>,
    pub(super) failed: bool,
    /// The data sheet of the recommended design; empty for others.
    pub(super) sheet: Vec<Section>,
    pub(super) figures: Vec<Figure>,
    /// The caption of the figures.
    pub(super) caption: String,
}

impl OptimumView {
    /// The design that an approach found, whose number is `index`.
    pub(super) fn new(
        index: usize,
        verified: &VerifiedOptimum,
        report: &Report,
        gears: &GearFigures,
    ) -> Result<Self, Error> {
        let approach = verified.optimum.approach;
        let label = approach_name(report.problem(), approach);
        let anchor = format!("optimum-{}", index + 1);
        let found = verified.optimum.found_or_sentence();
        let is_missing = found.is_err();
        let (summary, figures) = match found {
            Err(reason) => (format!("This approach has no design: {reason}"), Vec::new()),
            Ok(found) => {
                let name = format!("Optimum of the approach “{label}”");
                let named = named(&name, &found.design.gears().values());
                let illustration = gears.illustrations.get(&approach);
                (
                    summary(
                        verified,
                        found,
                        illustration,
                        &report.snapshot.measure_name(),
                    ),
                    match illustration {
                        Some(illustration) => figures(&anchor, &named, illustration)?,
                        None => Vec::new(),
                    },
                )
            }
        };
        let recommended = report.snapshot.optima.recommended();
        let is_recommended = recommended.is_some_and(|best| best.optimum.approach == approach);
        let row = paper::approach(approach).filter(|_| gears.paper.is_some());
        Ok(Self {
            anchor,
            title: label.to_owned(),
            summary,
            printed: row
                .and_then(|row| Some((row.figure, caption(paper::printed(row.figure)?)))),
            failed: is_missing,
            sheet: match is_recommended {
                true => gears.sheet.clone(),
                false => Vec::new(),
            },
            figures,
            caption: "The gears near the contact, to scale, and in axonometric view; the static transmission \
                      error over one mesh period, each curve about its own mean, and its spectrum; the pressure \
                      with which each place of the flank carries load; and ΔSTE over the torque, with flanks \
                      worn under the torque of the ring."
                .to_owned(),
        })
    }

    /// A design of the paper that no approach has; `None` without a drawing.
    pub(super) fn of_paper(design: &PrintedDesign) -> Result<Option<Self>, Error> {
        let Some(illustration) = &design.illustration else {
            return Ok(None);
        };
        let printed = design.printed;
        let anchor = format!("figure-{}", printed.figure);
        let title = capitalised(printed.name);
        let named = named(&format!("{title} of the paper"), &printed.variables);
        Ok(Some(Self {
            summary: "The paper’s design, on this model.".to_owned(),
            printed: Some((printed.figure, caption(printed))),
            failed: false,
            sheet: Vec::new(),
            figures: figures(&anchor, &named, illustration)?,
            caption: "The gears near the contact, to scale, and in axonometric view; the static transmission \
                      error over one mesh period, each curve about its own mean, and its spectrum."
                .to_owned(),
            anchor,
            title,
        }))
    }

    /// The paper's figure, for the order of the sections; the greatest number for a design that the paper
    /// does not have.
    pub(super) fn place(approach: Approach) -> u8 {
        paper::approach(approach).map_or(u8::MAX, |row| row.figure)
    }
}

/// A design with its variables, for readers who do not see a chart.
fn named(name: &str, variables: &[f64; 11]) -> String {
    format!("{name}, {}", symbols::design(variables))
}

fn figures(anchor: &str, design: &str, shown: &Illustration) -> Result<Vec<Figure>, Error> {
    let contact = shown.contact.as_ref();
    let torque = shown.torque.as_ref();
    let all: [(&str, Option<Result<Picture, Error>>); 6] = [
        ("gears", Some(charts::gears(&shown.drawing))),
        ("axonometric", Some(charts::solid(&shown.drawing))),
        ("ste", Some(charts::ste(&shown.ste))),
        ("spectrum", Some(charts::spectrum(&shown.ste))),
        ("contact", contact.map(charts::contact)),
        ("torque", torque.map(charts::torque)),
    ];
    let figures = all.into_iter().filter_map(|(name, picture)| {
        let picture = picture?.map(|picture| picture.of(design));
        Some(figure(&format!("{anchor}-{name}"), picture))
    });
    figures.collect()
}

fn summary(
    verified: &VerifiedOptimum,
    found: &Solution,
    illustration: Option<&Illustration>,
    measure: &str,
) -> String {
    let converged = illustration.and_then(|shown| shown.grid_difference_um);
    let converged = converged.map_or_else(String::new, |value| {
        format!(" ({} µm on a finer grid)", difference(value))
    });
    format!(
        "{} {} µm, verified {measure} {} µm{converged}; {}.",
        capitalised(&criterion_name(verified.optimum.approach, measure)),
        significant(found.criterion, 3),
        verified.measure.estimate(),
        if found.feasible && verified.keeps_limits() {
            "feasible"
        } else {
            "infeasible"
        },
    )
}

/// The caption that the paper prints with a design.
fn caption(design: &paper::PrintedDesign) -> String {
    let p90 = design.p90_um.map_or_else(String::new, |value| {
        format!(", P90 {} µm from 500 samples", fixed(value, 2))
    });
    format!(
        "{}; ε_γ {}, ζ {}, σ_vm {} MPa, p_H {} MPa; {} {} µm{p90}.",
        symbols::design(&design.variables),
        fixed(design.contact_ratio, 2),
        fixed(
            design.specific_slip,
            if design.specific_slip < 100.0 { 2 } else { 0 }
        ),
        fixed(design.von_mises_mpa, 0),
        fixed(design.pressure_mpa, 0),
        design.criterion,
        fixed(design.criterion_um, 2),
    )
}
