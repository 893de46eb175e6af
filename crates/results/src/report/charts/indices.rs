//! Sobol' indices as bars.

use stats::SensitivityIndex;

use super::draw;
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};

/// First-order and total indices of inputs on an output, with their intervals.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite index.
pub fn indices(
    output: &str,
    inputs: &[String],
    first: &[SensitivityIndex],
    total: &[SensitivityIndex],
) -> Result<Picture, Error> {
    let kinds = [
        ("first order: alone", first, 0, 0.2),
        ("total: with the others, too", total, 1, -0.2),
    ];
    let mut series = Vec::new();
    for (name, indices, colour, shift) in kinds {
        // The first input is at the top.
        let height = |place: usize| (inputs.len() - 1 - place) as f64 + shift;
        let placed = || indices.iter().enumerate().map(|(i, one)| (height(i), one));
        let bars = placed().flat_map(|(y, one)| [[0.0, y - 0.17], [one.value, y + 0.17]]);
        series.push(Series {
            name: Some(name.to_owned()),
            mark: Mark::Bars,
            colour,
            points: bars.collect(),
        });
        series.extend(placed().map(|(y, one)| Series {
            name: None,
            mark: Mark::Curve(""),
            colour,
            points: vec![[one.low, y], [one.high, y]],
        }));
    }
    let chart = Chart {
        title: format!("Shares of the variance of {output}, with 95 % intervals"),
        x: Axis::new("Sobol’ index", Scale::Linear),
        y: Axis {
            names: inputs.iter().rev().cloned().collect(),
            ..Axis::new("", Scale::Linear)
        },
        series,
        size: [640.0, 110.0 + 36.0 * inputs.len() as f64],
    };
    draw(chart, "Sobol’ indices", "there is no index")
}
