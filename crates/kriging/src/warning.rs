//! Warnings about the data or the fit, and their texts.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A property of the data or of the fit that a user of the model should know.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
#[non_exhaustive]
pub enum Warning {
    /// The likelihood hardly prefers the fitted covariance to a constant plus noise: the model may
    /// have found no dependence on the inputs at all.
    NoStructure {
        /// Gain of the model's log likelihood over that of independent observations around a
        /// constant.
        gain: f64,
        /// The gain below which this warning is given: the number of parameters beyond those of a constant plus noise
        /// (ranges, nugget and slopes), as Akaike's criterion asks for.
        needed: f64,
    },
    /// All observations are equal.
    ConstantResponse,
    /// There are fewer distinct points than two per estimated parameter: the fit is largely chance,
    /// and its variances do not include the uncertainty of the parameters.
    FewPoints {
        /// Number of distinct points.
        distinct: usize,
        /// Number of parameters that were estimated from them: ranges, σ², a nugget, the trend's
        /// coefficients.
        parameters: usize,
    },
    /// There are too few points to fit one range per coordinate: all coordinates share one, in
    /// units of their extents.
    SharedRange {
        /// Number of distinct points.
        distinct: usize,
        /// Number of coordinates.
        dimensions: usize,
    },
    /// All points agree in this coordinate, so the model does not depend on it.
    IgnoredCoordinate {
        /// Index of the coordinate, from 0.
        coordinate: usize,
    },
    /// Observations at equal x were merged into one (precision-weighted mean).
    MergedDuplicates {
        /// Number of observations given.
        observations: usize,
        /// Number of distinct points left.
        distinct: usize,
    },
    /// Observations at equal x differ by more than their noise permits: noise-free ones at all,
    /// noisy ones by several standard deviations. Their scatter was taken as noise, on top of the
    /// known one.
    ContradictoryDuplicates {
        /// Number of points with such observations.
        points: usize,
        /// Pooled standard deviation of the scatter, in units of y.
        sd: f64,
    },
    /// Some observations are further from their leave-one-out predictions than a right model
    /// permits, by the limit of [`crate::LeaveOneOut::outliers`]. They are gross errors, or the
    /// function differs there from everywhere else. They were not left out of the fit.
    Outliers {
        /// Number of such observations.
        count: usize,
        /// The worst ten of them, the worst first.
        worst: Vec<Outlier>,
    },
    /// The covariance matrix is too close to singular without jitter, an addition to its diagonal.
    Jitter {
        /// The jitter, relative to the process variance.
        relative: f64,
    },
    /// The search for the likelihood's maximum stopped before it converged.
    NotConverged {
        /// Number of iterations of the last search.
        iterations: usize,
    },
    /// The likelihood hardly changes when one of these ranges is halved or doubled (by less than half
    /// a unit of its logarithm, σ² following): the data do not determine them.
    FlatRanges {
        /// Indices of the coordinates, from 0.
        coordinates: Vec<usize>,
    },
    /// The ranges of some coordinates ended at a bound of the search.
    RangesAtBound {
        /// Indices of the coordinates, from 0.
        coordinates: Vec<usize>,
        /// True at the upper bound (the response hardly depends on these coordinates, or linearly),
        /// false at the lower one (neighbouring points are uncorrelated).
        upper: bool,
    },
    /// The process variance σ² ended at a bound of the search.
    ProcessVarianceAtBound {
        /// True at the upper bound (the observations look like a polynomial), false at the lower one
        /// (the noise explains them).
        upper: bool,
    },
    /// The estimated nugget ended at a bound of the search.
    NuggetAtBound {
        /// True at the upper bound (the observations are noise), false at the lower one (no noise
        /// but the known one was found).
        upper: bool,
    },
}

/// An observation far from its leave-one-out prediction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Outlier {
    /// Number of the observation among those given, from 0; the first one where several at one
    /// point were merged.
    pub observation: usize,
    /// Leave-one-out residual of the observation over the residual's standard deviation.
    pub standardised: f64,
}

/// Names of the coordinates and observations of the data.
pub struct Names<'a> {
    /// Name of a coordinate, numbered from 0.
    pub coordinate: &'a dyn Fn(usize) -> String,
    /// Name of an observation, numbered from 0.
    pub observation: &'a dyn Fn(usize) -> String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(&Names {
            coordinate: &|j| format!("coordinate {j}"),
            observation: &|i| format!("observation {i}"),
        }))
    }
}

impl Warning {
    /// The warning in the names of the caller's data.
    #[must_use]
    pub fn text(&self, names: &Names<'_>) -> String {
        let listed = |coordinates: &[usize]| {
            let names = coordinates.iter().map(|&j| (names.coordinate)(j));
            names.collect::<Vec<_>>().join(", ")
        };
        match self {
            Self::NoStructure { gain, needed } => format!(
                "the model's log likelihood exceeds that of a constant plus noise by {gain:.2}, less than \
                 {needed}: no dependence on the inputs was found"
            ),
            Self::ConstantResponse => "all observations are equal".to_owned(),
            Self::FewPoints {
                distinct,
                parameters,
            } => format!(
                "{distinct} distinct points are few for {parameters} parameters: at least twice as many \
                 points are advisable"
            ),
            Self::SharedRange {
                distinct,
                dimensions,
            } => format!(
                "{distinct} distinct points are too few to fit {dimensions} ranges: all coordinates share one"
            ),
            Self::IgnoredCoordinate { coordinate } => format!(
                "all points agree in {}: the model does not depend on it",
                (names.coordinate)(*coordinate)
            ),
            Self::MergedDuplicates {
                observations,
                distinct,
            } => format!(
                "{observations} observations lie at {distinct} distinct points: those at equal points were \
                 merged"
            ),
            Self::ContradictoryDuplicates { points, sd } => format!(
                "observations at {points} points differ by more than their noise permits: the standard \
                 deviation of their scatter, {sd:.3e}, was taken as noise"
            ),
            Self::Outliers { count, worst } => {
                let each = |outlier: &Outlier| {
                    let name = (names.observation)(outlier.observation);
                    format!(
                        "{name} lies {:.1} standard deviations from its leave-one-out prediction",
                        outlier.standardised.abs()
                    )
                };
                let mut text = worst.iter().map(each).collect::<Vec<_>>().join("; ");
                if *count > worst.len() {
                    text += &format!("; and {} more", count - worst.len());
                }
                text
            }
            Self::Jitter { relative } => format!(
                "the covariance matrix is nearly singular: {relative:e} of the process variance was added to \
                 its diagonal"
            ),
            Self::NotConverged { iterations } => format!(
                "the search for the parameters had not converged after {iterations} iterations"
            ),
            Self::FlatRanges { coordinates } => format!(
                "the data do not determine the range in {}: half or twice of it is nearly as likely",
                listed(coordinates)
            ),
            Self::RangesAtBound { coordinates, upper } => at_bound(
                &format!("the range in {}", listed(coordinates)),
                *upper,
                "neighbouring points are uncorrelated",
                "the response hardly depends on it, or linearly",
            ),
            Self::ProcessVarianceAtBound { upper } => at_bound(
                "the process variance",
                *upper,
                "the noise explains the observations",
                "the observations look like a polynomial",
            ),
            Self::NuggetAtBound { upper } => at_bound(
                "the nugget",
                *upper,
                "no noise but the known one was found",
                "the observations are noise",
            ),
        }
    }
}

/// The text of a parameter at a bound, with the meaning of the lower or of the upper one.
fn at_bound(parameter: &str, upper: bool, of_lower: &str, of_upper: &str) -> String {
    let (bound, meaning) = if upper {
        ("upper", of_upper)
    } else {
        ("lower", of_lower)
    };
    format!("{parameter} is at its {bound} bound: {meaning}")
}
