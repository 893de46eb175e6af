//! Common parts of the examples.

#![allow(dead_code, reason = "each example uses some of it")]

use kriging::Data;
use rand::RngExt as _;
use rustix::time::{ClockId, clock_gettime};
use stats::streams::StreamRng;

/// Variables of [`hart6`].
pub(crate) const D: usize = 6;

/// Random points in the unit cube with noisy values of [`hart6`].
pub(crate) struct NoisyHart6 {
    x: Vec<f64>,
    y: Vec<f64>,
    noise_variance: Vec<f64>,
}

impl NoisyHart6 {
    /// `n` points with noise of a standard deviation of 0.10 to 0.16.
    pub(crate) fn draw(n: usize, rng: &mut StreamRng) -> Self {
        let x: Vec<f64> = (0..n * D).map(|_| rng.random()).collect();
        let noise_variance: Vec<f64> = (0..n)
            .map(|_| (0.10 + 0.06 * rng.random::<f64>()).powi(2))
            .collect();
        let y = x
            .chunks_exact(D)
            .zip(&noise_variance)
            .map(|(x, v)| hart6(x) + v.sqrt() * normal(rng))
            .collect();
        Self {
            x,
            y,
            noise_variance,
        }
    }

    pub(crate) fn data(&self) -> Data<'_> {
        Data {
            x: &self.x,
            d: D,
            y: &self.y,
            noise_variance: &self.noise_variance,
        }
    }
}

/// A standard normal number (Box and Muller).
pub(crate) fn normal(rng: &mut StreamRng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}

/// The Hartmann function of six variables, rescaled to 2…40 (L. Dixon, G. Szegő, "The global
/// optimization problem: an introduction", 1978).
pub(crate) fn hart6(x: &[f64]) -> f64 {
    const ALPHA: [f64; 4] = [1.0, 1.2, 3.0, 3.2];
    const A: [[f64; 6]; 4] = [
        [10.0, 3.0, 17.0, 3.5, 1.7, 8.0],
        [0.05, 10.0, 17.0, 0.1, 8.0, 14.0],
        [3.0, 3.5, 1.7, 10.0, 17.0, 8.0],
        [17.0, 8.0, 0.05, 10.0, 0.1, 14.0],
    ];
    const CENTRES: [[f64; 6]; 4] = [
        [0.1312, 0.1696, 0.5569, 0.0124, 0.8283, 0.5886],
        [0.2329, 0.4135, 0.8307, 0.3736, 0.1004, 0.9991],
        [0.2348, 0.1451, 0.3522, 0.2883, 0.3047, 0.6650],
        [0.4047, 0.8828, 0.8732, 0.5743, 0.1091, 0.0381],
    ];
    let sum: f64 = (0..4)
        .map(|i| {
            let exponent: f64 = (0..6)
                .map(|j| A[i][j] * (x[j] - CENTRES[i][j]).powi(2))
                .sum();
            ALPHA[i] * (-exponent).exp()
        })
        .sum();
    40.0 - 38.0 / 3.32237 * sum
}

/// Processor time that all threads of this program have taken so far, in seconds.
pub(crate) fn processor_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
