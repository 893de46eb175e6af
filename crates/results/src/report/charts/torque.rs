//! ΔSTE over the torque.

use super::{HALF, draw, same_length};
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};
use crate::report::torque::TorqueCurves;

/// ΔSTE in µm over the pinion's torque in N·m; rings are at the torque that the pair is designed for.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite value, [`Error::LengthMismatch`] if a curve that is not empty is not as
/// long as the torques.
pub fn torque(curves: &TorqueCurves) -> Result<Picture, Error> {
    let mut series = Vec::new();
    let mut rings = Vec::new();
    let [low, high] = &curves.band_um;
    for (name, what, values, mark, colour) in [
        (
            Some("unworn"),
            "the unworn curve over the torque",
            &curves.unworn_um,
            Mark::Curve(""),
            0,
        ),
        (
            Some("mean wear"),
            "the worn curve over the torque",
            &curves.worn_um,
            Mark::Curve("8 3"),
            1,
        ),
        (
            Some("random wear, P10 and P90"),
            "the lower band over the torque",
            low,
            Mark::Thin("3 2"),
            1,
        ),
        (
            None,
            "the upper band over the torque",
            high,
            Mark::Thin("3 2"),
            1,
        ),
    ] {
        if values.is_empty() {
            continue;
        }
        same_length(what, &curves.torque_nm, values)?;
        let points: Vec<[f64; 2]> = curves
            .torque_nm
            .iter()
            .zip(values)
            .map(|(&x, &y)| [x, y])
            .collect();
        if let (Some(at), Mark::Curve(_)) = (points.iter().find(|p| p[0] == curves.design_nm), mark)
        {
            rings.push(Series {
                name: None,
                mark: Mark::Rings,
                colour,
                points: vec![*at],
            });
        }
        series.push(Series {
            name: name.map(str::to_owned),
            mark,
            colour,
            points,
        });
    }
    series.extend(rings);
    let chart = Chart {
        title: "ΔSTE over the torque".to_owned(),
        x: Axis::new("torque on the pinion (N·m)", Scale::Linear),
        y: Axis::new("ΔSTE (µm)", Scale::Linear),
        series,
        size: HALF,
    };
    draw(
        chart,
        "plot of ΔSTE over the torque",
        "no curve has a finite value",
    )
}
