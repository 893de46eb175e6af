//! The page of one gear pair.

use askama::Template;
use problem::formulation::Constraint;

use super::figure::{Figure, figure};
use crate::report::charts;
use crate::report::charts::VerifiedSamples;
use crate::report::drawing::{
    ContactPattern, FlankProfile, GearDrawing, PressureCurves, SteCurves,
};
use crate::report::error::Error;
use crate::report::quantity::limits;
use crate::report::svg;
use crate::report::torque::TorqueCurves;
use crate::report::wear::WearProfiles;
use crate::sheet::Section;

/// The page of one gear pair.
#[derive(Debug, Clone, PartialEq)]
pub struct PairPage {
    /// The pair's name, for example that of its file.
    pub title: String,
    /// Version of the program that simulated.
    pub program_version: String,
    /// Whether the pair is feasible, in a sentence.
    pub verdict: String,
    /// Reasons to doubt the pair, a sentence each.
    pub warnings: Vec<String>,
    /// The data sheet.
    pub sheet: Vec<Section>,
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
    /// The profiles of pinion and mate.
    pub profiles: [FlankProfile; 2],
    /// ΔSTE of the samples of random wear, µm, and their P90; absent without samples.
    pub samples: Option<(Vec<f64>, f64)>,
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
        profiles: data
            .profiles
            .iter()
            .map(profile)
            .collect::<Result<_, _>>()?,
        samples: data.samples.as_ref().map(samples).transpose()?,
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

/// The chart of a gear's profile.
fn profile(profile: &FlankProfile) -> Result<Figure, Error> {
    figure(
        &format!("profile-{}", profile.gear),
        charts::profile(profile),
    )
}

/// The histogram of samples.
fn samples((values, p90): &(Vec<f64>, f64)) -> Result<Figure, Error> {
    let samples = VerifiedSamples {
        response: "ΔSTE with random wear",
        unit: "µm",
        values,
        measure: Some(("P90".to_owned(), *p90)),
    };
    figure("samples", charts::histogram(&samples))
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
    profiles: Vec<Figure>,
    samples: Option<Figure>,
    wear: Option<Figure>,
}
