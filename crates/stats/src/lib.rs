//! Percentiles and their variance, normality tests, and the random streams every other crate draws from.
//!
//! Equation numbers in brackets are those of the paper the project reproduces: "Gears Design with
//! Shape Uncertainties using Monte Carlo Simulations and Kriging" (2009), section III.A.
//!
//! ```
//! use stats::streams::{Purpose, stream};
//! use stats::{NormalOptions, lilliefors, normal_p90, percentile_interval};
//! use rand::RngExt as _;
//!
//! // Thirty samples, each from a random stream of its own: sums of twelve uniform numbers are nearly normal.
//! let draw = |sample| {
//!     let mut rng = stream(2, Purpose::Test, 0, sample);
//!     (0..12).map(|_| rng.random::<f64>()).sum::<f64>()
//! };
//! let samples: Vec<f64> = (0..30).map(draw).collect();
//! assert!(lilliefors(&samples)?.p_value > 0.05);
//! let found = normal_p90(&samples, &NormalOptions::default())?;
//! let (low, high) = percentile_interval(&found, 0.95)?;
//! // The sum's 90th percentile is 6 + 1.28 = 7.28.
//! assert!(low < 7.28 && 7.28 < high);
//! # Ok::<(), stats::Error>(())
//! ```
//!
//! - [`percentile_p90`]: a 90th percentile from the mean and the standard deviation of a normal
//!   sample, and the variance of that estimate, (8), (9), (14). Kriging takes the variance as the
//!   known noise of the observation.
//! - [`normal_p90`]: the same with the exact quantile, the exact variance or without bias.
//! - [`order_statistic`]: a percentile and its interval for any continuous distribution, as reported for
//!   verified designs; [`paired_difference`] compares two of them.
//! - [`Samples`]: samples of several responses at once.
//! - [`Measure`]: the measures of a random response (percentile, mean, mean + k sd, mean of a tail, probability), with
//!   estimates and intervals; [`choose`] estimates one from few samples.
//! - [`harrell_davis_p90`]: a percentile of samples that are not normal, and its variance;
//!   [`exact_bootstrap_variance`] of any weighted sum of order statistics.
//! - [`Shape`]: a percentile of designs that share the shape of their response's distribution.
//! - [`mod@reference`]: responses with known percentiles.
//! - [`control_variate_p90`], [`normal_coefficients`] and [`grouped_p90`]: the same percentile from fewer
//!   samples, by a control variate, antithetic or quasi-random coefficients.
//! - [`Marginal`], [`Copula`]: the values of random inputs from standard normal scores.
//! - [`samples_needed`]: how many more samples until the percentile is precise enough.
//! - [`SensitivityPlan`]: which share of an output's variance comes from which input; [`main_effect`] the same from
//!   samples that are there.
//! - [`lilliefors`]: a test of normality.
//! - [`streams`]: named random streams.

#![warn(missing_docs)]

mod bootstrap;
mod choice;
mod coefficients;
mod control;
mod copula;
mod error;
mod exact;
mod main_effect;
mod marginal;
mod measure;
mod moments;
mod normal;
mod normality;
mod order;
mod percentile;
mod pooled;
mod quantile;
mod rank;
pub mod reference;
mod samples;
mod sensitivity;
mod sequential;
mod sobol;
pub mod streams;

pub use bootstrap::exact_bootstrap_variance;
pub use choice::{Choice, ChoiceRule, choose};
pub use coefficients::{
    GROUPED_MIN_GROUPS, Sampling, grouped_p90, normal_coefficients, normal_scores,
};
pub use control::{CONTROL_MIN_SAMPLES, Control, ControlledPercentile, control_variate_p90};
pub use copula::Copula;
pub use error::Error;
pub use exact::{
    EXACT_Z90, c4, exact_percentile_variance, normal_probability, normal_quantile, sd_bias,
};
pub use main_effect::{MAIN_EFFECT_MIN_SAMPLES, main_effect};
pub use marginal::{Family, Marginal};
pub use measure::Measure;
pub use moments::mean_sd;
pub use normal::{NormalOptions, VarianceFormula, normal_p90, percentile_p90};
pub use normality::{
    LILLIEFORS_MIN_SAMPLES, Lilliefors, lilliefors, lilliefors_critical_value, lilliefors_p_value,
};
pub use order::{IntervalEstimate, order_interval_min_samples, order_statistic, paired_difference};
pub use percentile::{
    PAPER_Z90, PERCENTILE_MIN_SAMPLES, Percentile, percentile_interval, percentile_variance,
};
pub use pooled::Shape;
pub use quantile::{
    Estimate, HarrellDavisVariance, Method, harrell_davis, harrell_davis_min_samples,
    harrell_davis_p90,
};
pub use rank::spearman;
pub use samples::Samples;
pub use sensitivity::{
    SENSITIVITY_INPUTS, SENSITIVITY_ROWS, Sensitivity, SensitivityIndex, SensitivityPlan,
};
pub use sequential::{SequentialRule, samples_needed};
pub use sobol::{SOBOL_DIMENSIONS, SOBOL_POINTS, SOBOL_SPACING, sobol_coordinate};
