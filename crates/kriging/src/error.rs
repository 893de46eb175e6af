//! Errors of fits, predictions and stored models.

use thiserror::Error;

use crate::linalg::JITTERS;

/// Why a model could not be fitted, used or read. The text reads after "failed to …: ".
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// An array's length does not match the others.
    #[error("{what} has {got} numbers, expected {expected}")]
    Shape {
        /// Name of the array.
        what: &'static str,
        /// The length it must have.
        expected: usize,
        /// The length it has.
        got: usize,
    },
    /// A number is NaN or infinite.
    #[error("{what} number {index} is {value}, it must be finite")]
    NonFinite {
        /// Name of the array.
        what: &'static str,
        /// Position of the first such number (in a row-major array: row × d + column).
        index: usize,
        /// Value of that number.
        value: f64,
    },
    /// A noise variance is negative.
    #[error("the noise variance of observation {index} is {value}, it must not be negative")]
    NegativeNoise {
        /// Index of the observation.
        index: usize,
        /// Noise variance of the observation.
        value: f64,
    },
    /// There are too few different points to estimate a covariance from.
    #[error("the data hold {distinct} distinct points, at least 2 are needed")]
    TooFewPoints {
        /// Number of distinct rows of x.
        distinct: usize,
    },
    /// Two observations at nearly the same point differ by more than their noise permits: no smooth
    /// function has both.
    #[error(
        "observations {first} and {second} lie within 1e-9 of the points' extent but differ by \
         {difference:e}, and their noise variances permit {permitted:e}: give the noise variance \
         they have, estimate a nugget, or drop one of them"
    )]
    Contradiction {
        /// Index of the first observation, from 0.
        first: usize,
        /// Index of the second observation.
        second: usize,
        /// Difference of the two, in units of y.
        difference: f64,
        /// The largest accepted difference, in units of y.
        permitted: f64,
    },
    /// The points do not determine a linear trend: they are too few, or lie in a plane.
    #[error(
        "{distinct} distinct points do not determine a trend of {coefficients} coefficients, give \
         more points that do not lie in a plane, or choose a constant trend"
    )]
    Trend {
        /// Number of distinct points.
        distinct: usize,
        /// Number of the trend's coefficients.
        coefficients: usize,
    },
    /// The model is not better than a constant plus noise, and the options refuse such a model.
    #[error(
        "the model's log likelihood exceeds that of a constant plus noise by {gain:.2}, less than \
         {needed}: no dependence on the inputs was found; give more observations, or less noisy ones"
    )]
    NoStructure {
        /// Gain of the model's log likelihood over that of independent observations.
        gain: f64,
        /// The smallest gain accepted: the number of parameters it takes.
        needed: f64,
    },
    /// The numbers are finite, but their differences or squares exceed the range of an f64.
    #[error("{what} spans a range too wide or too narrow for an f64, use another unit")]
    Extent {
        /// Name of the array.
        what: &'static str,
    },
    /// An observation is not positive, and its logarithm is to be modelled.
    #[error("observation {index} is {value}: only positive observations have a logarithm")]
    Logarithm {
        /// Index of the observation, from 0.
        index: usize,
        /// Value of the observation.
        value: f64,
    },
    /// The options ask the approximate fit for something that only the exact one offers.
    #[error("the approximate fit does not offer {what}, choose the exact one")]
    ExactOnly {
        /// The option that the approximate fit does not offer.
        what: &'static str,
    },
    /// The covariance matrix could not be factorised anywhere the search looked, not even with the
    /// largest jitter.
    #[error(
        "no covariance matrix of the search is positive definite, even with jitter {jitter:e}{}",
        at_observation(.observation)
    )]
    NotPositiveDefinite {
        /// Index, from 0, of the first observation whose row depends on those before it in the last
        /// factorisation; `None` if only the trend's normal equations could not be factorised.
        observation: Option<usize>,
        /// The largest jitter tried, relative to the process variance.
        jitter: f64,
    },
    /// A stored model is not well-formed JSON of the expected shape.
    #[error("the stored model is not valid")]
    Json(#[source] serde_json::Error),
    /// A number of a stored model or of the options is out of its domain.
    #[error("{what} is {value}, which is invalid for a fitted model")]
    OutOfRange {
        /// Name of the parameter.
        what: &'static str,
        /// Value of the parameter.
        value: f64,
    },
    /// A stored model has a format this version does not know.
    #[error("the stored model has format version {found}, this program reads version {supported}")]
    Version {
        /// Version found.
        found: u32,
        /// The version this crate writes and reads.
        supported: u32,
    },
}

impl Error {
    /// [`Error::NotPositiveDefinite`] with the largest jitter.
    pub(crate) fn not_positive_definite(observation: Option<usize>) -> Self {
        Self::NotPositiveDefinite {
            observation,
            jitter: JITTERS[JITTERS.len() - 1],
        }
    }
}

/// [`Error::Shape`] unless the lengths are equal.
pub(crate) fn check_length(what: &'static str, expected: usize, got: usize) -> Result<(), Error> {
    if got == expected {
        return Ok(());
    }
    Err(Error::Shape {
        what,
        expected,
        got,
    })
}

/// [`Error::NonFinite`] for the first of `values` that is NaN or infinite.
pub(crate) fn check_finite(what: &'static str, values: &[f64]) -> Result<(), Error> {
    let Some(index) = values.iter().position(|v| !v.is_finite()) else {
        return Ok(());
    };
    let value = values[index];
    Err(Error::NonFinite { what, index, value })
}

/// [`Error::NegativeNoise`] for the first variance below zero.
pub(crate) fn check_noise(variances: &[f64]) -> Result<(), Error> {
    let Some(index) = variances.iter().position(|v| *v < 0.0) else {
        return Ok(());
    };
    let value = variances[index];
    Err(Error::NegativeNoise { index, value })
}

fn at_observation(observation: &Option<usize>) -> String {
    observation.map_or_else(String::new, |number| {
        format!(": observation {number} repeats others but for rounding")
    })
}
