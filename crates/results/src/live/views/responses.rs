//! The measure over the design space.

use problem::formulation::Problem;
use serde::Serialize;

use super::Chart;
use super::chart::rows_of;
use crate::number::{column, rounded};
use crate::report::charts::{self, ResponseMap};
use crate::report::{label, response_name, variable_name};

/// Maximum number of points: more would not be visible in a chart, and every page would have to
/// load them.
const POINTS: usize = 3000;
/// Number of lowest measures in a map's table.
const ROWS: usize = 20;
/// Significant digits of coordinates and measures.
const DIGITS: usize = 6;

/// The designs that have a measure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Responses {
    /// The measure's name.
    pub measure: String,
    /// The response's name, as pages show it.
    pub response: String,
    /// The response's unit; empty for a number without one.
    pub unit: String,
    /// The coordinates that the DoE varies, in the order of each point's `x`.
    pub coordinates: Vec<Coordinate>,
    /// Whether the measures are preliminary: estimated from each design's first samples, without
    /// the methods that the campaign applies to all of them.
    pub preliminary: bool,
    /// Number of designs with a measure.
    pub designs: usize,
    /// A selection of them, evenly spaced, of limited size. The best is always included.
    pub points: Vec<Point>,
    /// The feasible design with the best measure.
    pub best: Option<u64>,
}

/// A coordinate that the DoE varies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coordinate {
    pub name: String,
    /// The name as pages show it, with the unit.
    pub label: String,
    /// The unit, if the name does not contain it; empty for a number without one.
    pub unit: String,
    /// The interval, as `[low, high]`.
    pub range: [f64; 2],
}

/// A design with its measure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Point {
    /// The design's number.
    pub design: u64,
    pub x: Vec<f64>,
    pub value: f64,
}

/// The view of all `points`.
#[must_use]
pub fn responses(
    problem: &Problem,
    points: impl ExactSizeIterator<Item = Point>,
    best: Option<u64>,
    preliminary: bool,
) -> Responses {
    let designs = points.len();
    let shown = designs.min(POINTS);
    // Selects `shown` evenly spaced places of `designs`.
    let is_chosen = |place: usize| place * shown % designs < shown;
    let chosen = points
        .enumerate()
        .filter(|(place, point)| is_chosen(*place) || Some(point.design) == best)
        .map(|(_, point)| Point {
            x: point.x.iter().map(|x| rounded(*x, DIGITS)).collect(),
            value: rounded(point.value, DIGITS),
            ..point
        });
    let coordinates = problem.coordinates().iter().map(|coordinate| Coordinate {
        name: coordinate.name.to_string(),
        label: label(&variable_name(problem, &coordinate.name), &coordinate.unit),
        unit: coordinate.unit.to_string(),
        range: coordinate.range,
    });
    Responses {
        measure: problem.measured().name.to_string(),
        response: response_name(problem),
        unit: problem.measured().unit.to_string(),
        coordinates: coordinates.collect(),
        preliminary,
        designs,
        points: chosen.collect(),
        best,
    }
}

/// The measure over two of the coordinates: a chart for the page, without the numbers of every
/// point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Map {
    /// The measure's name.
    pub measure: String,
    /// The coordinates that the DoE varies.
    pub coordinates: Vec<Coordinate>,
    /// Whether the measures are preliminary, as in [`Responses`].
    pub preliminary: bool,
    /// Number of designs with a measure.
    pub designs: usize,
    /// Number of designs in the chart.
    pub shown: usize,
    /// The chart, with a table of the lowest measures; `None` until a design has a measure.
    pub chart: Option<Chart>,
}

/// The map over the coordinates with these numbers; `None` if one does not exist.
#[must_use]
pub fn map(responses: &Responses, x: usize, y: usize) -> Option<Map> {
    let axis = |place: usize| {
        let coordinate = responses.coordinates.get(place)?;
        Some(coordinate.label.clone())
    };
    let labels = [axis(x)?, axis(y)?];
    let of_response = format!("{} of {}", responses.measure, responses.response);
    let place = |point: &Point| Some([*point.x.get(x)?, *point.x.get(y)?]);
    let triple = |point: &Point| place(point).map(|[x, y]| [x, y, point.value]);
    let mut least: Vec<&Point> = responses.points.iter().collect();
    least.sort_by(|a, b| a.value.total_cmp(&b.value));
    let best = responses.points.iter();
    let best = best
        .filter(|point| Some(point.design) == responses.best)
        .find_map(place);
    let drawn = charts::map(&ResponseMap {
        x: labels[0].clone(),
        y: labels[1].clone(),
        response: label(&of_response, &responses.unit),
        points: responses.points.iter().filter_map(triple).collect(),
        best,
    });
    let least: Vec<(&Point, [f64; 3])> = least
        .into_iter()
        .filter_map(|point| Some((point, triple(point)?)))
        .take(ROWS)
        .collect();
    let numbers = least.iter().map(|(point, _)| point.design.to_string());
    let texts = [0, 1, 2].map(|i| {
        let values: Vec<(f64, &str)> = least.iter().map(|(_, all)| (all[i], "")).collect();
        column(&values, DIGITS)
    });
    let rows = rows_of(&[&[numbers.collect()][..], &texts].concat());
    let columns = [
        "design, the least first",
        &labels[0],
        &labels[1],
        &label(&responses.measure, &responses.unit),
    ];
    Some(Map {
        measure: responses.measure.clone(),
        coordinates: responses.coordinates.clone(),
        preliminary: responses.preliminary,
        designs: responses.designs,
        shown: responses.points.len(),
        chart: Chart::new(drawn, &columns, rows),
    })
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    fn points(count: u64) -> impl ExactSizeIterator<Item = Point> {
        (0..count as usize).map(|design| Point {
            design: design as u64,
            x: vec![0.1 * design as f64; 6],
            value: 10_000.0 - design as f64,
        })
    }

    #[test]
    fn many_points_are_thinned_and_the_best_stays() {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let problem = Problem::new(campaign);
        let few = responses(&problem, points(3000), Some(7), false);
        assert_eq!((few.designs, few.points.len()), (3000, 3000));
        let labels = few.coordinates.iter().map(|one| &*one.label);
        assert!(labels.eq(["x₁", "x₂", "haP₀₁", "haP₀₂", "hfP₀₁", "hfP₀₂"]));
        let many = responses(&problem, points(6001), Some(5998), true);
        assert_eq!((many.designs, many.points.len()), (6001, POINTS + 1));
        assert!(many.points.iter().any(|point| point.design == 5998));

        let map = super::map(&many, 0, 5).unwrap().chart.unwrap();
        assert_eq!(map.svg.matches("h0").count(), many.points.len());
        assert_eq!((map.rows.len(), map.columns.len()), (ROWS, 4));
        // Design 6000 has the lowest measure but is not among the points shown.
        assert_eq!(map.rows[0][0], "5999");
        assert_eq!(super::map(&many, 0, 6), None, "there are six coordinates");
        let none = responses(&problem, points(0), None, false);
        assert_eq!(super::map(&none, 0, 1).unwrap().chart, None);
    }
}
