//! Percentiles with their confidence intervals, against a number.

use stats::IntervalEstimate;

use super::{FULL, draw};
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};

/// Percentiles of one kind, each at its abscissa.
#[derive(Debug, Clone, PartialEq)]
pub struct PercentileSeries {
    /// The entry in the legend.
    pub name: String,
    /// Abscissae, ascending, with the measures there.
    pub points: Vec<(f64, IntervalEstimate)>,
    /// Abscissae without a feasible design.
    pub infeasible: Vec<f64>,
}

/// The `measure` (its name, such as P90) of ΔSTE in µm (logarithmic) against the pinion's number of teeth, with 95 %
/// intervals as bars, one line per approach.
///
/// # Errors
/// [`Error::NothingToDraw`] without a positive measure.
pub fn teeth(measure: &str, series: &[PercentileSeries]) -> Result<Picture, Error> {
    let values = series.iter().flat_map(|one| middle(&one.points));
    let least = values.map(|p| p[1]).fold(f64::INFINITY, f64::min);
    let mut all = Vec::new();
    for (colour, one) in series.iter().enumerate() {
        all.push(Series {
            name: None,
            mark: Mark::Thin("2 3"),
            colour,
            points: middle(&one.points),
        });
        all.extend(with_bars(&one.name, Mark::Points, colour, &one.points));
    }
    // A row of rings for each approach at the foot of the chart.
    for (colour, one) in series.iter().enumerate() {
        let foot = least * 0.94f64.powi(colour as i32 + 1);
        all.push(Series {
            name: (!one.infeasible.is_empty()).then(|| format!("{}: none feasible", one.name)),
            mark: Mark::Rings,
            colour,
            points: one.infeasible.iter().map(|x| [*x, foot]).collect(),
        });
    }
    let chart = Chart {
        title: format!("{measure} of ΔSTE at the optima, with 95 % intervals"),
        x: Axis::new("teeth of the pinion", Scale::Whole),
        y: Axis::new(format!("{measure} of ΔSTE (µm)"), Scale::Log),
        series: all,
        size: [FULL[0], 420.0],
    };
    draw(
        chart,
        "percentile against the teeth",
        "no approach found a feasible design",
    )
}

/// The `measure` (its name, such as P90) of ΔSTE in µm (logarithmic) against another objective in MPa with its
/// `limit`: `designs` as dots, the non-dominated points `front`, ascending, joined by a staircase, and `series` with
/// 95 % intervals as bars.
///
/// # Errors
/// [`Error::NothingToDraw`] without a positive measure.
pub fn front(
    measure: &str,
    against: &str,
    limit: f64,
    designs: &[[f64; 2]],
    front: &[[f64; 2]],
    series: &[PercentileSeries],
) -> Result<Picture, Error> {
    // A staircase: no design between two of the front is known.
    let mut steps: Vec<[f64; 2]> = Vec::new();
    for &[x, y] in front {
        if let Some(&[_, last]) = steps.last() {
            steps.push([x, last]);
        }
        steps.push([x, y]);
    }
    let one = |name: &str, mark, colour, points| Series {
        name: Some(name.to_owned()),
        mark,
        colour,
        points,
    };
    let mut all = vec![
        one("designs of the DoE", Mark::Dots, 5, designs.to_vec()),
        // Longer than any axis.
        one("limit", Mark::Guide, 0, vec![[limit, 1e-9], [limit, 1e9]]),
        one("front", Mark::Curve(""), 1, steps),
    ];
    let colours = [2, 0, 3, 4, 5];
    all.extend(
        series
            .iter()
            .zip(colours)
            .flat_map(|(one, colour)| with_bars(&one.name, Mark::Rings, colour, &one.points)),
    );
    let chart = Chart {
        title: format!("{measure} of ΔSTE against {against}"),
        x: Axis::new(against, Scale::Linear),
        y: Axis::new(format!("{measure} of ΔSTE (µm)"), Scale::Log),
        series: all,
        size: [FULL[0], 420.0],
    };
    draw(chart, "Pareto front", "no design satisfies the constraints")
}

fn middle(points: &[(f64, IntervalEstimate)]) -> Vec<[f64; 2]> {
    points.iter().map(|(x, p90)| [*x, p90.value]).collect()
}

/// A mark for each measure and a bar for its interval.
fn with_bars(
    name: &str,
    mark: Mark,
    colour: usize,
    points: &[(f64, IntervalEstimate)],
) -> Vec<Series> {
    let bar = |(x, p90): &(f64, IntervalEstimate)| {
        let (low, high) = p90.interval?;
        Some(Series {
            name: None,
            mark: Mark::Curve(""),
            colour,
            points: vec![[*x, low], [*x, high]],
        })
    };
    let mut series: Vec<Series> = points.iter().filter_map(bar).collect();
    series.push(Series {
        name: Some(name.to_owned()),
        mark,
        colour,
        points: middle(points),
    });
    // Bars are drawn after the marks: with many samples a bar is shorter than a ring and would be hidden.
    series.rotate_right(1);
    series
}
