use std::fmt;

use serde::{Deserialize, Serialize};

/// Something about the data or the fit that a user of the model should know.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
#[non_exhaustive]
pub enum Warning {
    /// The likelihood hardly prefers the fitted covariance to a constant plus noise: the model may
    /// have found no dependence on x at all.
    NoStructure {
        /// By how much the model's log likelihood exceeds that of independent observations around a
        /// constant.
        gain: f64,
        /// The gain below which this warning is given: the number of fitted ranges, as Akaike's
        /// criterion asks for.
        needed: f64,
    },
    /// All observations are equal.
    ConstantResponse,
    /// There are fewer distinct points than two per estimated parameter: the fit follows chance, and
    /// its variances leave out how uncertain the parameters are.
    FewPoints {
        /// Number of distinct points.
        distinct: usize,
        /// Number of parameters that were estimated from them: ranges, σ², a nugget, the trend's
        /// coefficients. Models stored by earlier versions counted coordinates here.
        #[serde(alias = "dimensions")]
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
        /// Which coordinate, from 0.
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
    /// Some observations are further from what all others predict than a right model permits, by the
    /// limit of [`crate::LeaveOneOut::outliers`]. They are gross errors, or the function is unlike
    /// everywhere else there; they were not left out.
    Outliers {
        /// Number of such observations.
        count: usize,
        /// The worst ten of them, the worst first.
        worst: Vec<Outlier>,
    },
    /// The covariance matrix is too close to singular without an addition to its diagonal.
    Jitter {
        /// The addition, relative to the process variance.
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
        /// Which coordinates, from 0.
        coordinates: Vec<usize>,
    },
    /// The ranges of some coordinates ended at a bound of the search.
    RangesAtBound {
        /// Which coordinates, from 0.
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

/// An observation that the others do not predict.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Outlier {
    /// Its number among the observations given, from 0; the first one where several at one point
    /// were merged.
    pub observation: usize,
    /// Its leave-one-out residual over the residual's standard deviation.
    pub standardised: f64,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoStructure { gain, needed } => write!(
                f,
                "the model's log likelihood exceeds that of a constant plus noise by {gain:.2}, \
                 less than {needed}: no dependence on x was found"
            ),
            Self::ConstantResponse => write!(f, "all observations are equal"),
            Self::FewPoints {
                distinct,
                parameters,
            } => write!(
                f,
                "{distinct} distinct points are few for {parameters} parameters, at least twice as \
                 many points are advisable"
            ),
            Self::SharedRange {
                distinct,
                dimensions,
            } => write!(
                f,
                "{distinct} distinct points are too few to fit {dimensions} ranges, all \
                 coordinates share one"
            ),
            Self::IgnoredCoordinate { coordinate } => write!(
                f,
                "all points agree in coordinate {coordinate}, the model does not depend on it"
            ),
            Self::MergedDuplicates {
                observations,
                distinct,
            } => write!(
                f,
                "{observations} observations lie at {distinct} distinct points, those at equal \
                 points were merged"
            ),
            Self::ContradictoryDuplicates { points, sd } => write!(
                f,
                "observations at {points} points differ among each other by more than their noise \
                 permits, their standard deviation {sd:e} was taken as noise"
            ),
            Self::Outliers { count, worst } => {
                write!(f, "the others do not predict {count} observations: ")?;
                for (i, outlier) in worst.iter().enumerate() {
                    let comma = if i == 0 { "" } else { ", " };
                    let Outlier {
                        observation,
                        standardised,
                    } = outlier;
                    write!(
                        f,
                        "{comma}number {observation} is off by {standardised:.1} standard deviations"
                    )?;
                }
                if *count > worst.len() {
                    write!(f, ", and others")?;
                }
                write!(
                    f,
                    "; check them: a gross error that is taken for exact bends the model far around \
                     it, so leave it out, give it its noise variance, or estimate a nugget"
                )
            }
            Self::Jitter { relative } => write!(
                f,
                "the covariance matrix is nearly singular, {relative:e} of the process variance \
                 was added to its diagonal"
            ),
            Self::NotConverged { iterations } => {
                write!(
                    f,
                    "the likelihood search had not converged after {iterations} iterations"
                )
            }
            Self::FlatRanges { coordinates } => write!(
                f,
                "the ranges of coordinates {coordinates:?} may as well be half or twice as long: \
                 the data do not determine them"
            ),
            Self::RangesAtBound { coordinates, upper } => {
                let (bound, meaning) = if *upper {
                    ("upper", "the response hardly depends on them, or linearly")
                } else {
                    ("lower", "neighbouring points are uncorrelated")
                };
                write!(
                    f,
                    "the ranges of coordinates {coordinates:?} are at their {bound} bound: {meaning}"
                )
            }
            Self::ProcessVarianceAtBound { upper } => {
                let (bound, meaning) = if *upper {
                    ("upper", "the observations look like a polynomial")
                } else {
                    ("lower", "the noise explains the observations")
                };
                write!(f, "the process variance is at its {bound} bound: {meaning}")
            }
            Self::NuggetAtBound { upper } => {
                let (bound, meaning) = if *upper {
                    ("upper", "the observations are noise")
                } else {
                    ("lower", "no noise but the known one was found")
                };
                write!(f, "the nugget is at its {bound} bound: {meaning}")
            }
        }
    }
}
