//! The distribution of samples.

use super::{HALF, draw};
use crate::report::error::Error;
use crate::report::quantity::label;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};

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

    /// A curve over the response, and a vertical line at the measure up to `top`.
    fn chart(&self, title: String, y: &str, curve: Vec<[f64; 2]>, top: f64) -> Chart {
        let line = self.measure.clone().map(|(name, value)| Series {
            name: Some(name),
            mark: Mark::Thin("5 3"),
            colour: 1,
            points: vec![[value, 0.0], [value, top]],
        });
        let curve = Series {
            name: Some("samples".to_owned()),
            mark: Mark::Curve(""),
            colour: 0,
            points: curve,
        };
        Chart {
            title,
            x: Axis::new(label(self.response, self.unit), Scale::Linear),
            y: Axis::new(y, Scale::Linear),
            series: [curve].into_iter().chain(line).collect(),
            size: HALF,
        }
    }
}

/// The numbers of samples in intervals of equal width, by the rule of D. Freedman and P. Diaconis (Zeitschrift für
/// Wahrscheinlichkeitstheorie 57 (1981) 453–476).
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite sample.
pub fn histogram(samples: &VerifiedSamples<'_>) -> Result<Picture, Error> {
    let counts = counts(&samples.ordered());
    let mut outline = Vec::new();
    for &(low, high, count) in &counts {
        outline.extend([[low, count], [high, count]]);
    }
    // The outline ends on the axis.
    if let (Some(first), Some(last)) = (counts.first(), counts.last()) {
        outline.insert(0, [first.0, 0.0]);
        outline.push([last.1, 0.0]);
    }
    let most = counts.iter().map(|one| one.2).fold(0.0, f64::max);
    let title = format!("Samples of {}", samples.response);
    draw(
        samples.chart(title, "number of samples", outline, most),
        "histogram",
        "there is no verification sample",
    )
}

/// Lower end, upper end and number of samples of each interval.
fn counts(ordered: &[f64]) -> Vec<(f64, f64, f64)> {
    let (Some(&low), Some(&high)) = (ordered.first(), ordered.last()) else {
        return Vec::new();
    };
    let n = ordered.len();
    if low == high {
        // One narrow interval about the value.
        let half = 0.5 * low.abs().max(1.0) * f64::EPSILON.sqrt();
        return vec![(low - half, low + half, n as f64)];
    }
    let quartiles = ordered[3 * (n - 1) / 4] - ordered[(n - 1) / 4];
    let wanted = 2.0 * quartiles / (n as f64).cbrt();
    let intervals = (((high - low) / wanted).ceil() as usize).clamp(INTERVALS.0, INTERVALS.1);
    let width = (high - low) / intervals as f64;
    let end = |i: usize| low + i as f64 * width;
    let mut counts: Vec<(f64, f64, f64)> =
        (0..intervals).map(|i| (end(i), end(i + 1), 0.0)).collect();
    for value in ordered {
        let i = ((value - low) / width) as usize;
        counts[i.min(intervals - 1)].2 += 1.0;
    }
    counts
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
    let title = "Distribution function".to_owned();
    draw(
        samples.chart(title, "share of the samples", steps, 1.0),
        "distribution function",
        "there is no verification sample",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_is_in_one_interval() {
        let samples = |f: fn(f64) -> f64, n: u32| -> Vec<f64> {
            let mut all: Vec<f64> = (0..n).map(|i| f(f64::from(i) / f64::from(n))).collect();
            all.sort_by(f64::total_cmp);
            all
        };
        // Even, with far outliers, nearly all equal, all equal, one, none.
        for (ordered, intervals) in [
            (samples(|u| u, 1000), 8..=20),
            (samples(|u| (u + 1e-3).recip(), 1000), 60..=60),
            (samples(|u| f64::from(u > 0.9), 1000), 60..=60),
            (samples(|_| 2.0, 30), 1..=1),
            (samples(|u| u, 1), 1..=1),
            (Vec::new(), 0..=0),
        ] {
            let counts = counts(&ordered);
            assert!(intervals.contains(&counts.len()), "{}", counts.len());
            let sum: f64 = counts.iter().map(|one| one.2).sum();
            assert_eq!(sum, ordered.len() as f64);
            assert!(counts.windows(2).all(|two| two[0].1 == two[1].0));
        }
    }
}
