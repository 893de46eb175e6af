//! The Hartmann function with noise, against the figures in `data/peers.json`.

use kriging::{FitOptions, Kernel, Model, fit};

use crate::common::Sample;

const TRAIN: &str = include_str!("../../data/hart6_low_n500_train.csv");
const TEST: &str = include_str!("../../data/hart6_test2000.csv");

fn rows(text: &str) -> impl Iterator<Item = Vec<f64>> {
    text.lines()
        .skip(1)
        .map(|line| line.split(',').map(|v| v.parse().unwrap()).collect())
}

fn train() -> Sample {
    let mut sample = Sample {
        x: vec![],
        d: 6,
        y: vec![],
        noise: vec![],
    };
    for row in rows(TRAIN) {
        sample.x.extend(&row[..6]);
        sample.y.push(row[6]);
        sample.noise.push(row[7]);
    }
    sample
}

/// Root mean square error against the truth and coverage of the 90 % intervals.
fn score(model: &Model) -> (f64, f64) {
    let (mut squares, mut covered, mut count) = (0.0, 0, 0);
    for row in rows(TEST) {
        let p = model.predict(&row[..6]);
        let error = row[6] - p.mean;
        squares += error * error;
        covered += usize::from(error.abs() <= 1.6449 * p.variance.sqrt());
        count += 1;
    }
    (
        (squares / f64::from(count)).sqrt(),
        covered as f64 / f64::from(count),
    )
}

#[test]
fn matern52_reaches_the_likelihood_of_established_libraries() {
    let model = fit(&train().data(), &FitOptions::default()).unwrap();
    // The libraries print one decimal.
    let nll = model.negative_log_likelihood();
    assert!((nll - 990.7).abs() < 0.05, "{nll}");
    assert!(model.warnings().is_empty());
    // DiceKriging's figures on the same points, and the better RMSE of libKriging.
    let (rmse, coverage) = score(&model);
    assert!((rmse - 1.0929).abs() < 0.001, "{rmse}");
    assert!(rmse < 1.01 * 1.0926, "{rmse}");
    assert!((coverage - 0.921).abs() < 0.002, "{coverage}");
    let loo = model.leave_one_out();
    assert!((loo.q2 - 0.934).abs() < 0.02, "{}", loo.q2);
}

#[test]
fn squared_exponential_reaches_the_likelihood_of_established_libraries() {
    let options = FitOptions {
        kernel: Kernel::SquaredExponential,
        ..FitOptions::default()
    };
    let nll = fit(&train().data(), &options)
        .unwrap()
        .negative_log_likelihood();
    assert!((nll - 1001.9).abs() < 0.05, "{nll}");
}

#[test]
fn every_seed_finds_the_same_optimum() {
    let sample = train();
    for seed in 0..20 {
        let options = FitOptions {
            seed,
            ..FitOptions::default()
        };
        let nll = fit(&sample.data(), &options)
            .unwrap()
            .negative_log_likelihood();
        assert!((nll - 990.670).abs() < 1e-3, "seed {seed}: {nll}");
    }
}
