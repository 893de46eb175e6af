//! Helpers that the entries of kriging share.

use kriging::{Data, Error, FitOptions, Kernel, Model, fit};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use stats::streams::{Purpose, stream};

use crate::summary::root_mean_square;

/// A fit to observations with the noise variance `noise` at row-major points in d dimensions.
pub(super) fn model(
    x: &[f64],
    d: usize,
    y: &[f64],
    noise: f64,
    options: &FitOptions,
) -> Result<Model, Error> {
    let noise_variance = vec![noise; y.len()];
    let data = Data {
        x,
        d,
        y,
        noise_variance: &noise_variance,
    };
    fit(&data, options)
}

pub(super) fn kernel(kernel: Kernel) -> FitOptions {
    FitOptions {
        kernel,
        ..FitOptions::default()
    }
}

/// n evenly spaced points of [0, 1].
pub(super) fn grid(n: usize) -> Vec<f64> {
    (0..n).map(|i| i as f64 / (n - 1) as f64).collect()
}

/// n points of the unit box in d dimensions, row-major.
pub(super) fn random_points(n: usize, d: usize, number: u64) -> Vec<f64> {
    let mut rng = stream(21, Purpose::Test, number, 0);
    (0..n * d).map(|_| rng.random()).collect()
}

/// n standard normal numbers.
pub(super) fn normal(n: usize, number: u64) -> Vec<f64> {
    let mut rng = stream(21, Purpose::Test, number, 1);
    (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
}

/// A smooth function of the unit cube with a range of about 8.
pub(super) fn smooth(x: &[f64]) -> f64 {
    10.0 + 3.0 * (5.0 * x[0]).sin() + x.iter().map(|x| x * x).sum::<f64>()
}

/// The values of a function at row-major points in d dimensions.
pub(super) fn values(x: &[f64], d: usize, truth: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    x.chunks(d).map(truth).collect()
}

/// The root mean square of the model's errors on a fine grid of [0, 1].
pub(super) fn rmse(model: &Model, truth: impl Fn(f64) -> f64) -> f64 {
    rmse_at(model, &grid(997), 1, |x| truth(x[0]))
}

/// The root mean square of the model's errors at row-major points in d dimensions.
pub(super) fn rmse_at(model: &Model, x: &[f64], d: usize, truth: impl Fn(&[f64]) -> f64) -> f64 {
    let errors: Vec<f64> = x.chunks(d).map(|x| model.mean(x) - truth(x)).collect();
    root_mean_square(&errors)
}
