//! The rounds of an enrichment.

use super::{HALF, draw};
use crate::report::enrichment::{Enrichment, EnrichmentRound};
use crate::report::error::Error;
use crate::report::quantity::label;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};

/// The predicted `measure` (its name, such as P90) of the recommended design against the rounds of the enrichment.
///
/// # Errors
/// [`Error::NothingToDraw`] if no round recommends a design.
pub fn prediction(enrichment: &Enrichment, measure: &str) -> Result<Picture, Error> {
    let line = |name: &str, mark, colour, value: fn(&EnrichmentRound) -> f64| Series {
        name: (!name.is_empty()).then(|| name.to_owned()),
        mark,
        colour,
        points: enrichment
            .rounds
            .iter()
            .map(|round| [round.round as f64, value(round)])
            .collect(),
    };
    let mut series = vec![
        line("95 % interval", Mark::Thin("5 3"), 0, |r| r.low),
        line("", Mark::Thin("5 3"), 0, |r| r.high),
        line("prediction", Mark::Curve(""), 0, |r| r.predicted),
    ];
    if let (Some(verified), Some(last)) = (enrichment.verified, enrichment.rounds.last()) {
        series.push(Series {
            name: Some("verified".to_owned()),
            mark: Mark::Rings,
            colour: 1,
            points: vec![[last.round as f64, verified]],
        });
    }
    let chart = Chart {
        title: format!("{measure} of the recommended design"),
        x: Axis::new("round", Scale::Linear),
        y: Axis::new(label(measure, &enrichment.unit), Scale::Linear),
        series,
        size: HALF,
    };
    draw(chart, "prediction plot", "no round recommends a design")
}

/// The largest expected improvement of a further observation against the rounds of the enrichment.
///
/// # Errors
/// [`Error::NothingToDraw`] if there is neither a round with an expectation nor a tolerance.
pub fn expected_improvement(enrichment: &Enrichment) -> Result<Picture, Error> {
    let points: Vec<[f64; 2]> = enrichment
        .rounds
        .iter()
        .map(|round| [round.round as f64, round.expected_improvement])
        .collect();
    let last = enrichment.rounds.last().map_or(1.0, |r| r.round as f64);
    let tolerance = enrichment.tolerance;
    let series = vec![
        Series {
            name: Some("tolerance".to_owned()),
            mark: Mark::Thin("3 2"),
            colour: 1,
            points: vec![[1.0, tolerance], [last, tolerance]],
        },
        Series {
            name: Some("expected improvement".to_owned()),
            mark: Mark::Curve(""),
            colour: 0,
            points,
        },
    ];
    let chart = Chart {
        title: "What a further observation may gain".to_owned(),
        x: Axis::new("round", Scale::Linear),
        y: Axis::new(label("expected improvement", &enrichment.unit), Scale::Log),
        series,
        size: HALF,
    };
    draw(
        chart,
        "expected improvement plot",
        "no round has an expected improvement",
    )
}
