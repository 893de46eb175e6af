//! Gaussian-process regression (kriging) with a known noise variance at every observation.
//!
//! Ordinary kriging: the observed function is a realisation of μ + Z(x), Z a stationary Gaussian
//! process of variance σ² and product correlation, and every observation carries independent noise
//! of its own, known variance. A linear [`Trend`], radial correlations and an estimated nugget are
//! options of the fit. Equation numbers in brackets are those of the paper the project
//! reproduces, "Gears Design with Shape Uncertainties using Monte Carlo Simulations and Kriging"
//! (2009), section III.B: mean (19) and variance (20) of the prediction.
//!
//! ```
//! use kriging::{Data, FitOptions, fit};
//!
//! let x: Vec<f64> = (0..12).map(|i| f64::from(i) / 11.0).collect();
//! let y: Vec<f64> = x.iter().map(|x| (5.0 * x).sin()).collect();
//! let data = Data { x: &x, d: 1, y: &y, noise_variance: &[1e-6; 12] };
//! let model = fit(&data, &FitOptions::default())?;
//! assert!((model.mean(&[0.5]) - 2.5_f64.sin()).abs() < 0.01);
//! assert!(model.leave_one_out().q2 > 0.99);
//! # Ok::<(), kriging::Error>(())
//! ```
//!
//! For more points than a dense matrix can hold there is [`fit_vecchia`]. A [`Surrogate`] is a model by
//! either method, of the response or of its logarithm.
//!
//! The covariance parameters are those of the highest likelihood, see [`fit()`]; predictions and
//! leave-one-out validation are methods of [`Model`].

#![warn(missing_docs)]

mod data;
mod error;
mod fit;
mod guidance;
mod kernel;
mod likelihood;
mod linalg;
mod model;
mod noise;
mod surrogate;
mod vecchia;
mod warning;

pub use data::Data;
pub use error::Error;
pub use fit::fit;
pub use fit::options::{FitOptions, Nugget};
pub use guidance::Guidance;
pub use kernel::Kernel;
pub use likelihood::gls::Trend;
pub use likelihood::prior::Estimator;
pub use model::loo::LeaveOneOut;
pub use model::predict::{Conditional, Prediction};
pub use model::{Model, Parameters};
pub use noise::{Noise, smoothed_noise};
pub use surrogate::{Method, Response, Settings, Surrogate};
pub use vecchia::{Vecchia, VecchiaOptions, fit_vecchia};
pub use warning::{Names, Outlier, Warning};
