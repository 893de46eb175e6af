//! One function per chart. Each returns a picture, or says why there is nothing to draw; the public
//! functions return it as an SVG file of its own.

mod contact;
mod gears;
mod intervals;
mod map;
mod model;
mod pressure;
mod rounds;
mod runs;
mod scatter;
mod solid;
mod tradeoff;

use crate::report::data::{
    ContactPattern, DoePoint, Enrichment, GearDrawing, KrigingFit, OptimiserRun, PressureCurves,
    SteCurves, WearProfiles,
};
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};

pub(crate) use contact::contact;
pub(crate) use gears::gears;
pub use intervals::{PercentileSeries, chart_front, chart_teeth};
pub use map::{ResponseMap, chart_map};
pub(crate) use model::{residuals, slice};
pub(crate) use pressure::pressure;
pub(crate) use rounds::{expected_improvement, prediction};
pub(crate) use runs::{convergence, spectrum, ste};
pub use scatter::{Extent, Response};
pub(crate) use scatter::{leave_one_out, responses};
pub(crate) use solid::solid;
pub(crate) use tradeoff::tradeoff;
pub use tradeoff::{TradeoffChart, TradeoffSeries};

/// Half a page wide.
pub(crate) const HALF: [f64; 2] = [480.0, 360.0];
/// A whole page wide.
pub(crate) const FULL: [f64; 2] = [980.0, 340.0];

/// Figure 2: Archard's depth and random depths along a flank, as an SVG file. Removed material
/// counts downwards, in µm over the roll angle in rad.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite depth, [`Error::LengthMismatch`] if a profile is not as
/// long as the roll angles.
pub fn chart_wear(profiles: &WearProfiles) -> Result<String, Error> {
    wear(profiles, FULL).map(|picture| picture.standalone())
}

/// Figures 4 and 5: two responses of the designs against each other in µm, as an SVG file.
///
/// # Errors
/// [`Error::NothingToDraw`] if no design has both responses (both positive, on logarithmic axes).
pub fn chart_responses(
    doe: &[DoePoint],
    percentile: &str,
    x: Response,
    y: Response,
    extent: Extent,
) -> Result<String, Error> {
    responses(doe, percentile, x, y, extent).map(|picture| picture.standalone())
}

/// Leave-one-out predictions against observations in µm, as an SVG file.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite pair.
pub fn chart_leave_one_out(fit: &KrigingFit) -> Result<String, Error> {
    leave_one_out(fit).map(|picture| picture.standalone())
}

/// Best penalised objective (no unit, Equation (5)) against evaluations, one line per start, as an
/// SVG file.
///
/// # Errors
/// [`Error::NothingToDraw`] without a run that recorded a finite value.
pub fn chart_convergence(title: &str, runs: &[OptimiserRun]) -> Result<String, Error> {
    convergence(title, runs).map(|picture| picture.standalone())
}

/// The gears in mesh around the pitch point, to scale, as an SVG file.
///
/// # Errors
/// [`Error::NothingToDraw`] if no outline passes near the contact.
pub fn chart_gears(drawing: &GearDrawing) -> Result<String, Error> {
    gears(drawing).map(|picture| picture.standalone())
}

/// Both gears in axonometric view, as an SVG file.
///
/// # Errors
/// [`Error::NothingToDraw`] without outlines, a face width or a helix.
pub fn chart_solid(drawing: &GearDrawing) -> Result<String, Error> {
    solid(drawing).map(|picture| picture.standalone())
}

/// Contact pressure in MPa over the flank, as an SVG file.
///
/// # Errors
/// [`Error::NothingToDraw`] if no place carries load, [`Error::LengthMismatch`] if the rows are not as many
/// as the places on the path, or not as long as those across the face.
pub fn chart_contact(pattern: &ContactPattern) -> Result<String, Error> {
    contact(pattern).map(|picture| picture.standalone())
}

/// Static transmission error over one mesh period in µm, each curve about its own mean, as an SVG
/// file.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite value, [`Error::LengthMismatch`] if a curve that is not
/// empty is not as long as the phases.
pub fn chart_ste(curves: &SteCurves) -> Result<String, Error> {
    ste(curves).map(|picture| picture.standalone())
}

/// Contact pressure in MPa along the path of contact in mm, as an SVG file.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite value, [`Error::LengthMismatch`] if a curve that is not
/// empty is not as long as the places.
pub fn chart_pressure(curves: &PressureCurves) -> Result<String, Error> {
    pressure(curves).map(|picture| picture.standalone())
}

/// The predicted `percentile` (its name, such as P90) of the recommended design against the rounds of the enrichment, as an SVG
/// file.
///
/// # Errors
/// [`Error::NothingToDraw`] if no round recommends a design.
pub fn chart_prediction(enrichment: &Enrichment, percentile: &str) -> Result<String, Error> {
    prediction(enrichment, percentile).map(|picture| picture.standalone())
}

/// The most that is expected of a further observation against the rounds of the enrichment, as
/// an SVG file.
///
/// # Errors
/// [`Error::NothingToDraw`] if there is neither a round with an expectation nor a tolerance.
pub fn chart_expected_improvement(enrichment: &Enrichment) -> Result<String, Error> {
    expected_improvement(enrichment).map(|picture| picture.standalone())
}

/// Cost against error with the Pareto front, on logarithmic axes, as an SVG file.
///
/// # Errors
/// [`Error::NothingToDraw`] if no setting has a positive cost and a positive error.
pub fn chart_tradeoff(chart: &TradeoffChart) -> Result<String, Error> {
    tradeoff(chart).map(|picture| picture.standalone())
}

/// See [`chart_wear`]; `size` is the picture's width and height in pixels.
pub(crate) fn wear(profiles: &WearProfiles, size: [f64; 2]) -> Result<Picture, Error> {
    let angles = &profiles.roll_angle_rad;
    let removed = |what: &'static str, depths: &[f64]| {
        same_length(what, angles, depths)?;
        Ok::<_, Error>(angles.iter().zip(depths).map(|(&a, &d)| [a, -d]).collect())
    };
    let mut series = Vec::with_capacity(profiles.random_um.len() + 1);
    for (i, depths) in profiles.random_um.iter().enumerate() {
        series.push(Series {
            name: (i == 0).then(|| "random profiles".to_owned()),
            mark: Mark::Thin("5 3"),
            colour: 5,
            points: removed("a random wear profile", depths)?,
        });
    }
    series.push(Series {
        name: Some("Archard’s profile".to_owned()),
        mark: Mark::Curve(""),
        colour: 1,
        points: removed("archard’s wear profile", &profiles.archard_um)?,
    });
    draw(
        Chart {
            title: "Wear of the flank".to_owned(),
            x: axis("roll angle (rad)", Scale::Linear),
            y: axis("profile change (µm)", Scale::Linear),
            series,
            size,
        },
        "wear profiles",
        "no profile has a finite depth",
    )
}

fn axis(label: impl Into<String>, scale: Scale) -> Axis {
    Axis {
        label: label.into(),
        scale,
        range: None,
    }
}

/// A quantity and its unit, if it has one.
fn with_unit(what: &str, unit: &str) -> String {
    match unit {
        "" => what.to_owned(),
        unit => format!("{what} ({unit})"),
    }
}

fn draw(chart: Chart, name: &'static str, why: &'static str) -> Result<Picture, Error> {
    chart
        .draw()
        .ok_or(Error::NothingToDraw { chart: name, why })
}

fn same_length(what: &'static str, abscissae: &[f64], values: &[f64]) -> Result<(), Error> {
    if abscissae.len() == values.len() {
        Ok(())
    } else {
        Err(Error::LengthMismatch {
            what,
            expected: abscissae.len(),
            found: values.len(),
        })
    }
}
