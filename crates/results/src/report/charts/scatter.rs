//! Scatter plots: responses against each other, predictions against observations.

use super::{HALF, axis, draw, with_unit};
use crate::report::data::{DoePoint, KrigingFit};
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series, drawable};

/// The three responses of a design.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Response {
    /// ΔSTE without wear.
    Unworn,
    /// ΔSTE with Archard's wear.
    Archard,
    /// Estimated percentile of ΔSTE with random wear.
    Percentile,
}

impl Response {
    /// The response of a design, µm.
    #[must_use]
    pub fn of(self, point: &DoePoint) -> f64 {
        match self {
            Self::Unworn => point.delta_ste_um,
            Self::Archard => point.delta_ste_archard_um,
            Self::Percentile => point.p90_um,
        }
    }

    /// The response's name; `percentile` is the percentile's.
    #[must_use]
    pub fn label(self, percentile: &str) -> String {
        match self {
            Self::Unworn => "ΔSTE without wear".to_owned(),
            Self::Archard => "ΔSTE with Archard’s wear".to_owned(),
            Self::Percentile => format!("{percentile} of ΔSTE with random wear"),
        }
    }
}

/// Which part of the data a scatter plot shows, and how.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// All points, linear axes.
    Full,
    /// All points, logarithmic axes: for responses that span decades.
    Logarithmic,
    /// The lowest fifth of each response, linear axes.
    Zoom,
}

/// See [`super::chart_responses`].
pub(crate) fn responses(
    doe: &[DoePoint],
    percentile: &str,
    x: Response,
    y: Response,
    extent: Extent,
) -> Result<Picture, Error> {
    let scale = if extent == Extent::Logarithmic {
        Scale::Log
    } else {
        Scale::Linear
    };
    let points: Vec<[f64; 2]> = drawable_pairs(doe.iter().map(|p| [x.of(p), y.of(p)]), scale);
    let range = |i: usize| {
        (extent == Extent::Zoom)
            .then(|| lowest_fifth(&points, i))
            .flatten()
    };
    let mut chart = Chart {
        title: match extent {
            Extent::Full => "All designs".to_owned(),
            Extent::Logarithmic => "All designs, logarithmic axes".to_owned(),
            Extent::Zoom => "Zoom on the lowest fifth".to_owned(),
        },
        x: Axis {
            range: range(0),
            ..axis(format!("{} (µm)", x.label(percentile)), scale)
        },
        y: Axis {
            range: range(1),
            ..axis(format!("{} (µm)", y.label(percentile)), scale)
        },
        series: vec![diagonal(&points, "equal values")],
        size: HALF,
    };
    chart.series.push(Series {
        name: Some("one design".to_owned()),
        mark: Mark::Dots,
        colour: 0,
        points,
    });
    draw(
        chart,
        "response scatter plot",
        "no design has both responses",
    )
}

/// See [`super::chart_leave_one_out`].
pub(crate) fn leave_one_out(fit: &KrigingFit) -> Result<Picture, Error> {
    let pairs = fit.leave_one_out.iter().map(|p| [p.observed, p.predicted]);
    let points = drawable_pairs(pairs, Scale::Linear);
    let chart = Chart {
        title: "Leave-one-out predictions".to_owned(),
        x: axis(with_unit("observed", &fit.unit), Scale::Linear),
        y: axis(
            with_unit("predicted from the others", &fit.unit),
            Scale::Linear,
        ),
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

fn drawable_pairs(pairs: impl Iterator<Item = [f64; 2]>, scale: Scale) -> Vec<[f64; 2]> {
    pairs
        .filter(|p| drawable(p[0], scale) && drawable(p[1], scale))
        .collect()
}

/// The line of equal values, long enough for any axis around the points.
fn diagonal(points: &[[f64; 2]], name: &str) -> Series {
    let values = || points.iter().flatten().copied();
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    let ends = if low > high {
        Vec::new()
    } else if low > 0.0 {
        vec![[0.01 * low; 2], [100.0 * high; 2]]
    } else {
        let size = 100.0 * high.abs().max(low.abs()).max(1.0);
        vec![[-size; 2], [size; 2]]
    };
    Series {
        name: Some(name.to_owned()),
        mark: Mark::Guide,
        colour: 0,
        points: ends,
    }
}

/// From the least value of a coordinate to its 20 % quantile.
fn lowest_fifth(points: &[[f64; 2]], axis: usize) -> Option<(f64, f64)> {
    let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
    values.sort_by(f64::total_cmp);
    Some((*values.first()?, *values.get(values.len() / 5)?))
}
