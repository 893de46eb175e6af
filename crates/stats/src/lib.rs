//! Percentiles and their variance, normality tests, and the random streams every other crate draws from.
//!
//! Equation numbers in brackets are those of the paper the project reproduces: "Gears Design with
//! Shape Uncertainties using Monte Carlo Simulations and Kriging" (2009), section III.A.
//!
//! - [`percentile_p90`]: a 90 % percentile from the mean and the standard deviation of a normal
//!   sample, and the variance of that estimate, (8), (9), (14). Kriging takes the variance as the
//!   known noise of the observation.
//! - [`lilliefors`]: whether the sample may be called normal at all.
//! - [`streams`]: named random streams.

#![warn(missing_docs)]

mod error;
mod moments;
mod normality;
mod percentile;
mod rank;
pub mod streams;

pub use error::Error;
pub use moments::mean_sd;
pub use normality::{LILLIEFORS_MIN_SAMPLES, Lilliefors, lilliefors};
pub use percentile::{
    PAPER_Z90, PERCENTILE_MIN_SAMPLES, Percentile, p90_interval, p90_variance, percentile_p90,
};
pub use rank::spearman;
