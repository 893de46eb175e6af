//! A kriging model: its leave-one-out predictions and residuals, and its mean along a variable.

use stages::fitting::ModelSummary;

use super::scatter::{diagonal, drawable_pairs};
use super::{HALF, draw};
use crate::report::error::Error;
use crate::report::model::Slice;
use crate::report::quantity::label;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};

/// Leave-one-out predictions against observations, whose unit may be empty.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite pair.
pub fn leave_one_out(model: &ModelSummary, unit: &str) -> Result<Picture, Error> {
    let pairs = model.leave_one_out().map(|p| [p.observed, p.predicted]);
    let points = drawable_pairs(pairs, Scale::Linear);
    let chart = Chart {
        title: "Leave-one-out predictions".to_owned(),
        x: Axis::new(label("observed", unit), Scale::Linear),
        y: Axis::new(label("predicted from the others", unit), Scale::Linear),
        series: vec![
            diagonal(&points, "perfect prediction"),
            Series {
                name: Some("one observation".to_owned()),
                mark: Mark::Dots,
                colour: 2,
                points,
            },
        ],
        size: HALF,
    };
    draw(
        chart,
        "leave-one-out plot",
        "there is no leave-one-out prediction",
    )
}

/// The standardised leave-one-out residuals against the quantiles of the normal distribution.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite residual.
pub fn residuals(model: &ModelSummary) -> Result<Picture, Error> {
    let standardised = model.standardised.iter().copied();
    let mut ordered: Vec<f64> = standardised.filter(|r| r.is_finite()).collect();
    ordered.sort_by(f64::total_cmp);
    let n = ordered.len() as f64;
    // Blom's plotting positions.
    let place = |i: usize| (i as f64 + 0.625) / (n + 0.25);
    let points: Vec<[f64; 2]> = ordered
        .into_iter()
        .enumerate()
        .map(|(i, residual)| [stats::normal_quantile(place(i)), residual])
        .collect();
    let ends = points.first().zip(points.last());
    let guide = ends.map_or_else(Vec::new, |(first, last)| vec![[first[0]; 2], [last[0]; 2]]);
    let chart = Chart {
        title: "Standardised residuals".to_owned(),
        x: Axis::new("quantile of the normal distribution", Scale::Linear),
        y: Axis::new("residual over its standard deviation", Scale::Linear),
        series: vec![
            Series {
                name: Some("normal".to_owned()),
                mark: Mark::Guide,
                colour: 0,
                points: guide,
            },
            Series {
                name: Some("one observation".to_owned()),
                mark: Mark::Dots,
                colour: 2,
                points,
            },
        ],
        size: HALF,
    };
    draw(chart, "residuals plot", "there is no standardised residual")
}

/// The model along one variable; `unit` is the observations' and may be empty.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite mean.
pub fn slice(slice: &Slice, unit: &str) -> Result<Picture, Error> {
    let of = |place: usize| slice.points.iter().map(move |p| [p[0], p[place]]);
    let line = |name: Option<&str>, mark, place| Series {
        name: name.map(str::to_owned),
        mark,
        colour: 0,
        points: of(place).collect(),
    };
    let nearest = slice.points.iter().min_by(|a, b| {
        let to = |p: &[f64; 4]| (p[0] - slice.at).abs();
        to(a).total_cmp(&to(b))
    });
    let chart = Chart {
        title: format!("Along {}", slice.label),
        x: Axis::new(slice.label.as_str(), Scale::Linear),
        y: Axis::new(label("model", unit), Scale::Linear),
        series: vec![
            line(Some("95 % interval"), Mark::Thin("5 3"), 2),
            line(None, Mark::Thin("5 3"), 3),
            line(Some("mean"), Mark::Curve(""), 1),
            Series {
                name: Some("recommended".to_owned()),
                mark: Mark::Rings,
                colour: 1,
                points: nearest.map(|p| [slice.at, p[1]]).into_iter().collect(),
            },
        ],
        size: [320.0, 260.0],
    };
    draw(chart, "slice", "the model gives no finite value")
}
