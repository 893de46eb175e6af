//! One design: its gears, its transmission error and its contact.

use super::figure::{Figure, figure};
use super::rows;
use crate::charts;
use crate::data::{
    Approach, ApproachResult, ContactPattern, GearDrawing, Optimum, PrintedDesign, SteCurves,
};
use crate::error::Error;
use crate::number::{capitalised, fixed, significant};
use crate::paper;
use crate::summary::digits_of;
use crate::svg::Picture;
use crate::symbols;

/// The section of one design.
pub(super) struct OptimumView {
    pub(super) anchor: String,
    pub(super) title: String,
    pub(super) summary: String,
    /// The paper's figure of the same design, and what is printed with it.
    pub(super) printed: Option<(u8, String)>,
    pub(super) failed: bool,
    /// Charts and drawings that there are.
    pub(super) figures: Vec<Figure>,
    /// What the figures show, in words.
    pub(super) caption: String,
}

impl OptimumView {
    /// The design that an approach found, whose number is `index`; beside the paper's with `paper`.
    pub(super) fn new(
        index: usize,
        result: &ApproachResult,
        percentile: &str,
        paper: bool,
    ) -> Result<Self, Error> {
        let approach = result.approach;
        let anchor = format!("optimum-{}", index + 1);
        let (summary, figures) = match &result.outcome {
            Err(reason) => (format!("This approach has no design: {reason}"), Vec::new()),
            Ok(optimum) => {
                let name = format!("Optimum of the approach “{}”", approach.label());
                let named = named(&name, &optimum.variables);
                let all = figures(
                    &anchor,
                    &named,
                    optimum.drawing.as_ref(),
                    optimum.ste.as_ref(),
                    optimum.contact.as_ref(),
                )?;
                (summary(approach, optimum, percentile), all)
            }
        };
        Ok(Self {
            anchor,
            title: approach.label().to_owned(),
            summary,
            printed: match paper::approach(approach).filter(|_| paper) {
                Some(row) => paper::printed(row.figure).map(|design| (row.figure, caption(design))),
                None => None,
            },
            failed: result.outcome.is_err(),
            figures,
            caption: "The gears near the contact, to scale, and in axonometric view; the static transmission \
                      error over one mesh period, each curve about its own mean, and its spectrum; the pressure \
                      with which each place of the flank carries load."
                .to_owned(),
        })
    }

    /// A design of the paper that no approach has; `None` without a drawing.
    pub(super) fn of_paper(design: &PrintedDesign) -> Result<Option<Self>, Error> {
        let Some((drawing, ste)) = &design.drawing else {
            return Ok(None);
        };
        let printed = paper::printed(design.figure).ok_or(Error::UnknownFigure {
            figure: design.figure,
        })?;
        let anchor = format!("figure-{}", design.figure);
        let title = capitalised(printed.name);
        let named = named(&format!("{title} of the paper"), &printed.variables);
        Ok(Some(Self {
            summary: "The paper’s design, on this model.".to_owned(),
            printed: Some((design.figure, caption(printed))),
            failed: false,
            figures: figures(&anchor, &named, Some(drawing), Some(ste), None)?,
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

/// A design with its variables, for those who do not see a chart.
fn named(name: &str, variables: &[f64; 11]) -> String {
    format!("{name}, {}", symbols::design(variables))
}

fn figures(
    anchor: &str,
    design: &str,
    drawing: Option<&GearDrawing>,
    ste: Option<&SteCurves>,
    contact: Option<&ContactPattern>,
) -> Result<Vec<Figure>, Error> {
    let all: [(&str, Option<Result<Picture, Error>>); 5] = [
        ("gears", drawing.map(charts::gears)),
        ("axonometric", drawing.map(charts::solid)),
        ("ste", ste.map(charts::ste)),
        ("spectrum", ste.map(charts::spectrum)),
        ("contact", contact.map(charts::contact)),
    ];
    let figures = all.into_iter().filter_map(|(name, picture)| {
        let picture = picture?.map(|picture| picture.of(design));
        Some(figure(&format!("{anchor}-{name}"), picture))
    });
    figures.collect()
}

fn summary(approach: Approach, optimum: &Optimum, percentile: &str) -> String {
    let converged = optimum
        .converged_difference_um
        .map_or_else(String::new, |value| {
            format!(" ({} µm on the converged grid)", rows::difference(value))
        });
    format!(
        "{} {} µm, verified {percentile} {} µm{converged}; {}.",
        capitalised(&approach.criterion(percentile)),
        significant(optimum.criterion, 3),
        significant(optimum.p90.value, digits_of(&optimum.p90)),
        if optimum.feasible {
            "feasible"
        } else {
            "infeasible"
        },
    )
}

/// What the paper prints with a design.
fn caption(design: &paper::PrintedDesign) -> String {
    let p90 = design.p90_um.map_or_else(String::new, |value| {
        format!(", P90 {} µm from 500 samples", fixed(value, 2))
    });
    format!(
        "{}; r_c {}, g_s {}, σ_vm {} MPa, p_H {} MPa; {} {} µm{p90}.",
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
