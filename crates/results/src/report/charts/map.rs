//! A response over two coordinates of the designs.

use super::{HALF, draw};
use crate::number::significant;
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, SHADES, Scale, Series, drawable};

/// Number of classes of responses.
const CLASSES: usize = 6;

/// A response over two coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseMap {
    /// The horizontal coordinate, with its unit.
    pub x: String,
    /// The vertical coordinate, with its unit.
    pub y: String,
    /// The response's name, with its unit.
    pub response: String,
    /// Both coordinates and the response of each design.
    pub points: Vec<[f64; 3]>,
    /// The place of the best design.
    pub best: Option<[f64; 2]>,
}

/// The response of designs over two of their coordinates. Every colour has the same number of designs: with classes
/// of equal width, a few large values would give nearly all designs one colour.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite response.
pub fn map(map: &ResponseMap) -> Result<Picture, Error> {
    let is_drawable = |point: &&[f64; 3]| point.iter().all(|v| drawable(*v, Scale::Linear));
    let mut points: Vec<[f64; 3]> = map.points.iter().filter(is_drawable).copied().collect();
    points.sort_by(|a, b| a[2].total_cmp(&b[2]));
    let classes = points.chunks(points.len().div_ceil(CLASSES).max(1));
    let mut series: Vec<Series> = classes
        .enumerate()
        .map(|(colour, class)| Series {
            name: class.first().zip(class.last()).map(|(least, greatest)| {
                let ends = [least[2], greatest[2]].map(|value| significant(value, 3));
                format!("{} to {}", ends[0], ends[1])
            }),
            mark: Mark::Shades,
            colour: colour * (SHADES - 1) / (CLASSES - 1),
            points: class.iter().map(|point| [point[0], point[1]]).collect(),
        })
        .collect();
    series.push(Series {
        name: Some("best that keeps the constraints".to_owned()),
        mark: Mark::Rings,
        colour: 2,
        points: map
            .best
            .filter(|_| !points.is_empty())
            .into_iter()
            .collect(),
    });
    let chart = Chart {
        title: map.response.clone(),
        x: Axis::new(map.x.clone(), Scale::Linear),
        y: Axis::new(map.y.clone(), Scale::Linear),
        series,
        size: [HALF[0] + 80.0, HALF[1] + 60.0],
    };
    draw(chart, "response map", "no design has a response yet")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_design_is_a_dot_in_one_of_six_shades() {
        let point = |i: u32| {
            let i = f64::from(i);
            [i, -i, (i - 50.0).powi(2)]
        };
        let map = ResponseMap {
            x: "x1 (mm)".to_owned(),
            y: "x2".to_owned(),
            response: "P95 of y".to_owned(),
            points: (0..100).map(point).chain([[1.0, 2.0, f64::NAN]]).collect(),
            best: Some([50.0, -50.0]),
        };
        let svg = super::map(&map).unwrap().standalone();
        assert_eq!(svg.matches("h0").count(), 100);
        assert!(
            [0, 4, 9, 13, 18, 23]
                .iter()
                .all(|shade| svg.contains(&format!("shades q{shade}")))
        );
        assert!(svg.contains("x1 (mm)") && svg.contains("P95 of y"));
        let empty = ResponseMap {
            points: Vec::new(),
            ..map
        };
        assert!(matches!(
            super::map(&empty),
            Err(Error::NothingToDraw { .. })
        ));
    }
}
