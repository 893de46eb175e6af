//! The distribution of samples.

use super::{HALF, axis, draw};
use crate::report::error::Error;
use crate::report::quantity::label;
use crate::report::svg::{Chart, Mark, Picture, Scale, Series};

/// The fewest and the most intervals of a histogram.
const INTERVALS: (usize, usize) = (8, 60);
/// The most points of a distribution function: more than a picture can show apart.
const POINTS: usize = 400;

/// Verification samples of a design.
#[derive(Debug, Clone, PartialEq)]
pub struct VerifiedSamples<'a> {
    pub response: &'a str,
    /// The unit; empty for a number without one.
    pub unit: &'a str,
    pub values: &'a [f64],
    /// The measure that is optimised, by name and value, if it can be shown beside the samples.
    pub measure: Option<(String, f64)>,
}

impl VerifiedSamples<'_> {
    /// The samples that are numbers, in rising order.
    fn ordered(&self) -> Vec<f64> {
        let finite = self
            .values
            .iter()
            .copied()
            .filter(|value| value.is_finite());
        let mut ordered: Vec<f64> = finite.collect();
        ordered.sort_by(f64::total_cmp);
        ordered
    }

    /// A vertical line at the measure, up to `top`.
    fn line(&self, top: f64) -> Option<Series> {
        let (name, value) = self.measure.clone()?;
        Some(Series {
            name: Some(name),
            mark: Mark::Thin("5 3"),
            colour: 1,
            points: vec![[value, 0.0], [value, top]],
        })
    }
}

/// The numbers of samples in intervals of equal width, by the rule of D. Freedman and P. Diaconis (Zeitschrift für
/// Wahrscheinlichkeitstheorie 57 (1981) 453–476).
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite sample.
pub fn histogram(samples: &VerifiedSamples<'_>) -> Result<Picture, Error> {
    let ordered = samples.ordered();
    let n = ordered.len();
    let mut outline = Vec::new();
    let mut most = 0.0_f64;
    if let (Some(&low), Some(&high)) = (ordered.first(), ordered.last()) {
        let quartiles = ordered[3 * (n - 1) / 4] - ordered[(n - 1) / 4];
        let wanted = 2.0 * quartiles / (n as f64).cbrt();
        let intervals = (((high - low) / wanted).ceil() as usize).clamp(INTERVALS.0, INTERVALS.1);
        // Equal samples are one interval about their value.
        let (low, width) = if high > low {
            (low, (high - low) / intervals as f64)
        } else {
            let half = 0.5 * low.abs().max(1.0) * f64::EPSILON.sqrt();
            (low - half, 2.0 * half)
        };
        let mut counts = vec![0_u32; if high > ordered[0] { intervals } else { 1 }];
        let last = counts.len() - 1;
        for value in &ordered {
            counts[(((value - low) / width) as usize).min(last)] += 1;
        }
        outline.push([low, 0.0]);
        for (i, &count) in counts.iter().enumerate() {
            let count = f64::from(count);
            most = most.max(count);
            outline.push([low + i as f64 * width, count]);
            outline.push([low + (i + 1) as f64 * width, count]);
        }
        outline.push([low + counts.len() as f64 * width, 0.0]);
    }
    let bars = Series {
        name: Some("verification samples".to_owned()),
        mark: Mark::Curve(""),
        colour: 0,
        points: outline,
    };
    let chart = Chart {
        title: format!("Samples of {}", samples.response),
        x: axis(label(samples.response, samples.unit), Scale::Linear),
        y: axis("number of samples", Scale::Linear),
        series: [Some(bars), samples.line(most)]
            .into_iter()
            .flatten()
            .collect(),
        size: HALF,
    };
    draw(chart, "histogram", "there is no verification sample")
}

/// The share of samples that are no greater than a value.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite sample.
pub fn cumulative(samples: &VerifiedSamples<'_>) -> Result<Picture, Error> {
    let ordered = samples.ordered();
    let n = ordered.len();
    let share = |count: usize| count as f64 / n as f64;
    let mut steps = Vec::new();
    let shown = n.min(POINTS);
    for k in 0..shown {
        let i = k * n / shown;
        steps.push([ordered[i], share(i)]);
        steps.push([ordered[i], share((k + 1) * n / shown)]);
    }
    let function = Series {
        name: Some("verification samples".to_owned()),
        mark: Mark::Curve(""),
        colour: 0,
        points: steps,
    };
    let chart = Chart {
        title: "Distribution function".to_owned(),
        x: axis(label(samples.response, samples.unit), Scale::Linear),
        y: axis("share of the samples", Scale::Linear),
        series: [Some(function), samples.line(1.0)]
            .into_iter()
            .flatten()
            .collect(),
        size: HALF,
    };
    draw(
        chart,
        "distribution function",
        "there is no verification sample",
    )
}
