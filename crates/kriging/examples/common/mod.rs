//! What the examples have in common.

use rand::RngExt as _;
use stats::streams::StreamRng;

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
