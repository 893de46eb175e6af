//! Contact pressure along the path of contact.

use super::{HALF, draw, same_length};
use crate::number;
use crate::report::drawing::PressureCurves;
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};

/// Contact pressure in MPa along the path of contact in mm.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite value, [`Error::LengthMismatch`] if a curve that is not
/// empty is not as long as the places.
pub fn pressure(curves: &PressureCurves) -> Result<Picture, Error> {
    let mut series = Vec::new();
    for (name, what, values, mark, colour) in [
        (
            "unworn",
            "the unworn pressure curve",
            &curves.unworn_mpa,
            Mark::Curve(""),
            0,
        ),
        (
            "with the mean wear",
            "the worn pressure curve",
            &curves.worn_mpa,
            Mark::Curve("8 3"),
            1,
        ),
    ] {
        if values.is_empty() {
            continue;
        }
        same_length(what, &curves.place_mm, values)?;
        let finite = values.iter().copied().filter(|v| v.is_finite());
        let most = finite.fold(f64::NEG_INFINITY, f64::max);
        series.push(Series {
            name: Some(format!(
                "{name}: at most {} MPa",
                number::significant(most, 4)
            )),
            mark,
            colour,
            points: curves
                .place_mm
                .iter()
                .zip(values)
                .map(|(&s, &p)| [s, p])
                .collect(),
        });
    }
    let chart = Chart {
        title: "Contact pressure along the path of contact".to_owned(),
        x: Axis::new("distance from the pitch point (mm)", Scale::Linear),
        y: Axis::new("largest pressure over the mesh (MPa)", Scale::Linear),
        series,
        size: HALF,
    };
    draw(chart, "pressure plot", "no curve has a finite value")
}
