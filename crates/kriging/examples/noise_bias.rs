//! The bias of a model of percentiles whose noise is estimated from the same samples, and what smoothing the
//! noise does to it.
//!
//! `cargo run --release -p kriging --example noise_bias -- [SEEDS]` (10 by default)
//!
//! A percentile is m + 1.28 s of k normal samples, whose mean and standard deviation depend on three
//! coordinates. 400 designs; bias, RMSE and 90 % coverage at 1000 other points, the first two in units of
//! the mean standard deviation σ of a sample: means over the seeds.

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

use std::error::Error;

use kriging::{Data, FitOptions, fit, smoothed_noise};
use rand::RngExt as _;
use stats::streams::{Purpose, StreamRng, stream};

const D: usize = 3;
const DESIGNS: usize = 400;
const Z: f64 = 1.28;

fn mean(x: &[f64]) -> f64 {
    3.0 + (4.0 * x[0]).sin() + x[1] * x[1] + x[0] * x[2]
}

/// Standard deviation of a sample, between 0.55 and 1.5.
fn deviation(x: &[f64]) -> f64 {
    (0.5 * ((3.0 * x[1]).cos() + x[2]) - 0.1).exp()
}

fn normal(rng: &mut StreamRng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}

fn main() -> Result<(), Box<dyn Error>> {
    let seeds: u64 = std::env::args()
        .nth(1)
        .map_or(Ok(10), |text| text.parse())?;
    println!("  k  noise      bias/σ  rmse/σ  coverage");
    for k in [10, 30, 100] {
        let mut scores = [[0.0; 3]; 3];
        for seed in 0..seeds {
            for (total, score) in scores.iter_mut().zip(of_seed(k, seed)?) {
                for (total, value) in total.iter_mut().zip(score) {
                    *total += value / seeds as f64;
                }
            }
        }
        for (name, [bias, rmse, coverage]) in ["true", "own", "smoothed"].iter().zip(scores) {
            println!("{k:3}  {name:8}  {bias:7.4}  {rmse:6.4}  {coverage:8.3}");
        }
    }
    Ok(())
}

/// Bias, RMSE and coverage with the true noise variance, that of the design's own samples, and the smoothed
/// one.
fn of_seed(k: usize, seed: u64) -> Result<[[f64; 3]; 3], Box<dyn Error>> {
    let mut rng = stream(seed, Purpose::Test, k as u64, 0);
    let x = doe::random_lhs(DESIGNS, D, seed)?;
    let x: Vec<f64> = (0..DESIGNS).flat_map(|i| x.point(i).to_vec()).collect();
    // Var(m + z s) of normal samples is about σ²(1/k + z²/(2(k − 1))).
    let per_variance = 1.0 / k as f64 + Z * Z / (2.0 * (k as f64 - 1.0));
    let (mut y, mut of_truth, mut own) = (Vec::new(), Vec::new(), Vec::new());
    for x in x.chunks(D) {
        let samples: Vec<f64> = (0..k)
            .map(|_| mean(x) + deviation(x) * normal(&mut rng))
            .collect();
        let m = samples.iter().sum::<f64>() / k as f64;
        let squares: f64 = samples.iter().map(|s| (s - m).powi(2)).sum();
        let variance = squares / (k as f64 - 1.0);
        // Unbiased: c₄ ≈ 1 − 1/(4k − 3), so that all bias left is the model's.
        let c4 = 1.0 - 1.0 / (4.0 * k as f64 - 3.0);
        y.push(m + Z * variance.sqrt() / c4);
        own.push(variance * per_variance);
        of_truth.push(deviation(x).powi(2) * per_variance);
    }
    let smooth = smoothed_noise(&x, D, &own, k as f64 - 1.0, seed)?;
    let tests: Vec<f64> = (0..1000 * D).map(|_| rng.random()).collect();
    let unit = tests.chunks(D).map(deviation).sum::<f64>() / 1000.0;
    let score = |noise_variance: &[f64]| -> Result<[f64; 3], kriging::Error> {
        let data = Data {
            x: &x,
            d: D,
            y: &y,
            noise_variance,
        };
        let model = fit(&data, &FitOptions::default())?;
        let (mut sum, mut squares, mut covered) = (0.0, 0.0, 0.0);
        for (x, p) in tests.chunks(D).zip(model.predict_many(&tests)?) {
            let error = p.mean - mean(x) - Z * deviation(x);
            sum += error / unit;
            squares += (error / unit).powi(2);
            covered += f64::from(u8::from(error.abs() <= 1.645 * p.variance.sqrt()));
        }
        Ok([sum / 1000.0, (squares / 1000.0).sqrt(), covered / 1000.0])
    };
    Ok([score(&of_truth)?, score(&own)?, score(&smooth)?])
}
