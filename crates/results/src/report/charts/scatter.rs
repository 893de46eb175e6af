//! Responses of the designs against each other.

use super::{HALF, draw};
use crate::report::doe::{DoePoint, Response};
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series, drawable};

/// The range and the axes of a scatter plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// All points, linear axes.
    Full,
    /// All points, logarithmic axes: for responses that span decades.
    Logarithmic,
    /// The lowest fifth of each response, linear axes.
    Zoom,
}

/// Figures 4 and 5: two responses of the designs against each other in µm, with those of the `recommended` design.
///
/// # Errors
/// [`Error::NothingToDraw`] if no design has both responses (both positive, on logarithmic axes).
pub fn responses(
    doe: &[DoePoint],
    recommended: Option<&DoePoint>,
    measure: &str,
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
    let marked: Vec<[f64; 2]> = recommended
        .filter(|_| !points.is_empty())
        .map(|p| [x.of(p), y.of(p)])
        .into_iter()
        .collect();
    let axis = |i: usize, of: Response| Axis {
        range: match extent {
            Extent::Zoom => lowest_fifth(&points, &marked, i),
            _ => None,
        },
        ..Axis::new(format!("{} (µm)", of.label(measure)), scale)
    };
    let mut chart = Chart {
        title: match extent {
            Extent::Full => "All designs".to_owned(),
            Extent::Logarithmic => "All designs, logarithmic axes".to_owned(),
            Extent::Zoom => "Zoom on the lowest fifth".to_owned(),
        },
        x: axis(0, x),
        y: axis(1, y),
        series: vec![diagonal(&points, "equal values")],
        size: HALF,
    };
    chart.series.push(Series {
        name: Some("one design".to_owned()),
        mark: Mark::Dots,
        colour: 0,
        points,
    });
    chart.series.push(Series {
        name: Some("recommended".to_owned()),
        mark: Mark::Halo(5.0),
        colour: 1,
        points: marked,
    });
    draw(
        chart,
        "response scatter plot",
        "no design has both responses",
    )
}

/// The pairs that a chart can show.
pub(super) fn drawable_pairs(pairs: impl Iterator<Item = [f64; 2]>, scale: Scale) -> Vec<[f64; 2]> {
    pairs
        .filter(|p| drawable(p[0], scale) && drawable(p[1], scale))
        .collect()
}

/// The line of equal values, long enough for any axis around the points.
pub(super) fn diagonal(points: &[[f64; 2]], name: &str) -> Series {
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

/// From the least value of a coordinate to the 20 % quantile of the points', and to the marked ones.
fn lowest_fifth(points: &[[f64; 2]], marked: &[[f64; 2]], axis: usize) -> Option<(f64, f64)> {
    let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
    values.sort_by(f64::total_cmp);
    let ends = [*values.first()?, *values.get(values.len() / 5)?];
    let marked = marked.iter().map(|p| p[axis]).filter(|v| v.is_finite());
    Some(marked.fold((ends[0], ends[1]), |(low, high), v| {
        (low.min(v), high.max(v))
    }))
}
