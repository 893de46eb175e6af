//! Helpers that the entries of kriging share.

use kriging::{Data, Error, FitOptions, Kernel, Model, fit};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use stats::streams::{Purpose, stream};

/// A fit of exact or noisy observations in d coordinates, the points row-major.
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

/// The root mean square of the model's errors on a fine grid of [0, 1].
pub(super) fn rmse(model: &Model, truth: impl Fn(f64) -> f64) -> f64 {
    let at = grid(997);
    let squares = at.iter().map(|&x| (model.mean(&[x]) - truth(x)).powi(2));
    (squares.sum::<f64>() / at.len() as f64).sqrt()
}
