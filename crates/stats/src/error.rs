//! Errors of samples and parameters that a statistic cannot take.

use thiserror::Error;

/// The reason why a statistic could not be computed. The text reads after "failed to …: ".
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// The statistic is not defined for this number of samples.
    #[error("{statistic} needs at least {needed} samples, got {got}")]
    TooFewSamples {
        /// Name of the statistic.
        statistic: &'static str,
        /// The smallest number of samples it is defined for.
        needed: usize,
        /// The number of samples given.
        got: usize,
    },
    /// A sample is NaN or infinite.
    #[error("sample {index} is {value}, every sample must be a finite number")]
    NonFinite {
        /// Index of the first such sample, from 0.
        index: usize,
        /// Value of the sample.
        value: f64,
    },
    /// The samples are finite, but their mean or standard deviation is not.
    #[error("the mean or standard deviation of the {n} samples exceeds the range of an f64")]
    Overflow {
        /// The number of samples.
        n: usize,
    },
    /// All values are equal, and the statistic needs values that differ.
    #[error("all {n} values equal {value}: they must differ")]
    Constant {
        /// The number of samples.
        n: usize,
        /// Their common value.
        value: f64,
    },
    /// A parameter lies outside the range where the formula holds.
    #[error("{name} is {value}, it must be {expected}")]
    OutOfRange {
        /// Name of the parameter.
        name: &'static str,
        /// Value of the parameter.
        value: f64,
        /// The accepted values, in words.
        expected: &'static str,
    },
}
