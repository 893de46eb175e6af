//! Cost against error, with the Pareto front, the campaign's settings and the recommended one.

use super::draw;
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};

/// Width and height in pixels: two charts fit beside each other, and a legend of several lines fits below.
const SIZE: [f64; 2] = [480.0, 420.0];
/// Number of colours in the palette. Further series repeat the colours with rings instead of dots.
const COLOURS: usize = 6;

/// One method in a chart of cost against error.
#[derive(Debug, Clone, PartialEq)]
pub struct TradeoffSeries {
    /// The entry in the legend.
    pub name: String,
    /// Cost and error of the method's settings. A series without points is left out, but keeps its colour.
    pub points: Vec<[f64; 2]>,
}

/// A chart of cost against error, on logarithmic axes.
#[derive(Debug, Clone, PartialEq)]
pub struct TradeoffChart {
    /// The name of the chart's files, without an ending.
    pub file: String,
    /// The title, shown above the chart.
    pub title: String,
    /// The cost, with its unit.
    pub cost: String,
    /// The error, with its unit.
    pub error: String,
    /// The methods.
    pub series: Vec<TradeoffSeries>,
    /// A line through the settings: the Pareto front, or a fitted law.
    pub line: TradeoffSeries,
    /// The settings of the campaign.
    pub campaign: Vec<[f64; 2]>,
    /// The recommended setting.
    pub recommended: Option<[f64; 2]>,
    /// The reason for the recommendation, in a sentence.
    pub recommendation: String,
}

/// Cost against error with the Pareto front, on logarithmic axes.
///
/// # Errors
/// [`Error::NothingToDraw`] if no setting has a positive cost and a positive error.
pub fn tradeoff(chart: &TradeoffChart) -> Result<Picture, Error> {
    let marked = |name: &str, mark, colour, points: Vec<[f64; 2]>| Series {
        name: Some(name.to_owned()),
        mark,
        colour,
        points,
    };
    let mut series = vec![marked(
        &chart.line.name,
        Mark::Thin("5 3"),
        1,
        chart.line.points.clone(),
    )];
    let methods = chart.series.iter().enumerate();
    series.extend(
        methods
            .filter(|(_, one)| !one.points.is_empty())
            .map(|(i, one)| {
                let mark = if i < COLOURS {
                    Mark::Points
                } else {
                    Mark::Rings
                };
                marked(&one.name, mark, i % COLOURS, one.points.clone())
            }),
    );
    series.push(marked(
        "campaign",
        Mark::Halo(6.5),
        3,
        chart.campaign.clone(),
    ));
    let recommended = chart.recommended.into_iter().collect();
    series.push(marked("recommended", Mark::Halo(9.5), 1, recommended));
    draw(
        Chart {
            title: chart.title.clone(),
            x: Axis::new(chart.cost.clone(), Scale::Log),
            y: Axis::new(chart.error.clone(), Scale::Log),
            series,
            size: SIZE,
        },
        "chart of cost against error",
        "no setting has a positive cost and a positive error",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn front_campaign_and_recommendation_are_drawn_over_the_methods() {
        let mut chart = TradeoffChart {
            file: "a".to_owned(),
            title: "A".to_owned(),
            cost: "µs a sample".to_owned(),
            error: "error, %".to_owned(),
            series: vec![
                TradeoffSeries {
                    name: "elsewhere".to_owned(),
                    points: Vec::new(),
                },
                TradeoffSeries {
                    name: "grid".to_owned(),
                    points: vec![[1.0, 2.0], [2.0, 1.0], [3.0, 1.5]],
                },
            ],
            line: TradeoffSeries {
                name: "Pareto front".to_owned(),
                points: vec![[1.0, 2.0], [2.0, 1.0]],
            },
            campaign: vec![[3.0, 1.5]],
            recommended: Some([2.0, 1.0]),
            recommendation: String::new(),
        };
        let svg = tradeoff(&chart).unwrap().standalone();
        assert!(!svg.contains("elsewhere"), "a method without settings");
        for name in ["Pareto front", "grid", "campaign", "recommended"] {
            assert!(svg.contains(name), "no {name}");
        }
        // Each halo once in the chart and once in the legend.
        assert_eq!(svg.matches("class=\"halo s1\"").count(), 2);
        assert_eq!(svg.matches("class=\"halo s3\"").count(), 2);
        // A title wider than the chart goes on in a second line.
        assert_eq!(svg.matches("class=\"ttl\"").count(), 1);
        chart.title = "whole-face-beam: error with random wear over CPU time a sample".to_owned();
        let wrapped = tradeoff(&chart).unwrap().standalone();
        assert_eq!(wrapped.matches("class=\"ttl\"").count(), 2);
        chart.recommended = None;
        let svg = tradeoff(&chart).unwrap().standalone();
        assert!(!svg.contains("recommended"));
        (chart.series, chart.campaign) = (Vec::new(), Vec::new());
        chart.line.points.clear();
        assert!(matches!(tradeoff(&chart), Err(Error::NothingToDraw { .. })));
    }
}
