//! The page of one gear pair.

use askama::Template;
use problem::formulation::Constraint;

use super::figure::{Figure, figure};
use crate::report::charts;
use crate::report::drawing::{
    ContactPattern, GearDrawing, PressureCurves, SteCurves, TorqueCurves,
};
use crate::report::error::Error;
use crate::report::quantity::limits;
use crate::report::svg;
use crate::report::wear::WearProfiles;

/// The page of one gear pair.
#[derive(Debug, Clone, PartialEq)]
pub struct PairPage {
    /// The pair's name, for example that of its file.
    pub title: String,
    /// Version of the program that simulated.
    pub program_version: String,
    /// Whether the pair is feasible, in a sentence.
    pub verdict: String,
    /// The constraints with the pair's values.
    pub constraints: Vec<Constraint>,
    /// Further (label, value with unit) pairs, shown as they are.
    pub figures: Vec<(String, String)>,
    /// The gears in mesh.
    pub drawing: GearDrawing,
    /// Static transmission error over the mesh.
    pub ste: SteCurves,
    /// ΔSTE at several torques.
    pub torque: TorqueCurves,
    /// Contact pressure along the path of contact.
    pub pressure: PressureCurves,
    /// Contact pressure over the flank.
    pub contact: ContactPattern,
    /// Wear depths of the pinion's flank; absent without wear.
    pub wear: Option<WearProfiles>,
}

/// One gear pair as one HTML page that loads nothing and runs nothing.
///
/// # Errors
/// [`Error::LengthMismatch`] if lists of one curve differ in length, [`Error::Template`] if the
/// template fails.
pub fn render_pair(data: &PairPage) -> Result<String, Error> {
    let page = Page {
        data,
        page_css: super::PAGE_STYLE,
        chart_css: svg::CSS,
        limits: limits(&data.constraints),
        section: figure("section", charts::gears(&data.drawing))?,
        ste: figure("ste", charts::ste(&data.ste))?,
        torque: figure("torque", charts::torque(&data.torque))?,
        solid: figure("axonometric", charts::solid(&data.drawing))?,
        pressure: figure("pressure", charts::pressure(&data.pressure))?,
        contact: figure("contact", charts::contact(&data.contact))?,
        wear: match &data.wear {
            Some(profiles) => {
                let chart = figure("wear", charts::wear(profiles, charts::HALF))?;
                Some(chart.with_sentence(&profiles.subject))
            }
            None => None,
        },
    };
    Ok(page.render()?)
}

#[derive(Template)]
#[template(path = "pair.html")]
struct Page<'a> {
    data: &'a PairPage,
    page_css: &'static str,
    chart_css: &'static str,
    /// Value, limit and margin of each constraint.
    limits: Vec<[String; 3]>,
    section: Figure,
    ste: Figure,
    torque: Figure,
    solid: Figure,
    pressure: Figure,
    contact: Figure,
    wear: Option<Figure>,
}
