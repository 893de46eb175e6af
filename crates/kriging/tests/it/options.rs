//! The options of the fit beside ordinary kriging: linear trend, nugget, calibration, refusal.

use kriging::{Estimator, FitOptions, Model, Nugget, Trend, fit};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::common::{DenseKriging, Sample, read, written};

fn linear() -> FitOptions {
    FitOptions {
        trend: Trend::Linear,
        ..FitOptions::default()
    }
}

#[test]
fn universal_kriging_is_that_of_the_dense_formulas() {
    for nugget in [Nugget::Known, Nugget::Estimated] {
        let sample = Sample::smooth(40, 3, 0.02);
        let options = FitOptions { nugget, ..linear() };
        let model = fit(&sample.data(), &options).unwrap();
        let dense = DenseKriging::with_trend(model.kernel(), &sample, model.parameters());
        // Rounding times the condition of the matrix, below 1e6 here.
        let error = model.negative_log_likelihood() - dense.negative_log_likelihood();
        assert!(error.abs() < 1e-7, "{error}");
        let other = Sample::smooth(150, 3, 0.02);
        let many = model.predict_many(&other.x).unwrap();
        for (i, batch) in many.iter().enumerate() {
            let (mean, variance) = dense.predict(other.row(i));
            assert!((batch.mean - mean).abs() < 1e-7, "{batch:?} {mean}");
            assert!((batch.variance - variance).abs() < 1e-7);
            assert_eq!(batch.mean, model.mean(other.row(i)));
        }
        // Leave-one-out with the trend estimated anew, against brute force.
        let loo = model.leave_one_out();
        for i in [0, 17, 39] {
            let rest = sample.without(i);
            let dense = DenseKriging::with_trend(model.kernel(), &rest, model.parameters());
            let (mean, _) = dense.predict(sample.row(i));
            assert!((loo.residuals[i] - (sample.y[i] - mean)).abs() < 1e-7);
        }
        let again = read(&written(model.clone())).unwrap();
        assert_eq!(again.mean(&[0.3, 0.4, 2.0]), model.mean(&[0.3, 0.4, 2.0]));
        assert_eq!(again.parameters(), model.parameters());
        assert!((again.predict(other.row(0)).variance - many[0].variance).abs() < 1e-12);
    }
}

#[test]
fn a_hidden_nugget_is_found() {
    // Noise of variance 0.01 is known, noise of 0.05 is not.
    let mut sample = Sample::smooth(250, 2, 0.0);
    let mut rng = stream(9, Purpose::Test, 0, 0);
    sample.noise.fill(0.01);
    for y in &mut sample.y {
        *y += (12.0 * 0.06_f64).sqrt() * (rng.random::<f64>() - 0.5);
    }
    let options = FitOptions {
        nugget: Nugget::Estimated,
        ..FitOptions::default()
    };
    let model = fit(&sample.data(), &options).unwrap();
    let without = fit(&sample.data(), &FitOptions::default()).unwrap();
    // The standard error of a variance from 250 residuals of uniform noise is 0.06 √(0.8/250) = 0.0034; the tolerance
    // is three of them, and a margin for the noise that the process explains.
    let nugget = model.parameters().nugget;
    assert!((nugget - 0.05).abs() < 0.012, "{nugget}");
    assert!(model.negative_log_likelihood() < without.negative_log_likelihood() - 10.0);

    // When all noise is known, hardly any is added.
    let honest = Sample::smooth(250, 2, 0.05);
    let nugget = fit(&honest.data(), &options).unwrap().parameters().nugget;
    assert!(nugget < 0.012, "{nugget}");
}

#[test]
fn calibration_covers_what_maximum_likelihood_does_not() {
    // A sharp ridge in a smooth bowl: no stationary process.
    let ridge = |x: &[f64]| {
        (x[0] - 0.3).powi(2) + x[1] * x[1] + 0.8 * (-((x[0] + x[1] - 1.0) / 0.05).powi(2)).exp()
    };
    let place = |n: usize, seed: u64| -> Vec<f64> {
        let mut rng = stream(seed, Purpose::Test, 1, 0);
        (0..2 * n).map(|_| rng.random()).collect()
    };
    let x = place(150, 1);
    let sample = Sample {
        y: x.chunks(2).map(ridge).collect(),
        x,
        d: 2,
        noise: vec![1e-4; 150],
    };
    let model = fit(
        &sample.data(),
        &FitOptions {
            calibrate: true,
            ..FitOptions::default()
        },
    )
    .unwrap();
    let plain = fit(&sample.data(), &FitOptions::default()).unwrap();
    let test = place(1000, 2);
    let coverage = |model: &Model| {
        let inside = test.chunks(2).filter(|x| {
            let p = model.predict(x);
            (ridge(x) - p.mean).abs() <= 1.6449 * p.variance.sqrt()
        });
        inside.count() as f64 / 1000.0
    };
    assert_eq!(plain.calibration(), 1.0);
    assert!(model.calibration() != 1.0);
    assert_eq!(plain.mean(&[0.4, 0.4]), model.mean(&[0.4, 0.4]));
    let (before, after) = (coverage(&plain), coverage(&model));
    // Binomial standard error: 0.01 for the 1000 points, 0.025 for the 150 residuals of the calibration.
    assert!((after - 0.9).abs() < 0.06, "{before} {after}");
    let calibrated = model.leave_one_out().coverage90;
    assert!((calibrated - 0.9).abs() < 0.02, "{calibrated}");
    let again = read(&written(model.clone())).unwrap();
    assert_eq!(again.calibration(), model.calibration());
}

#[test]
fn calibration_does_not_narrow_the_intervals_of_few_points() {
    let options = FitOptions {
        calibrate: true,
        ..FitOptions::default()
    };
    let mut wider = 0;
    for n in (10..44).step_by(3) {
        let sample = Sample::smooth(n, 2, 0.02);
        let model = fit(&sample.data(), &options).unwrap();
        let plain = fit(&sample.data(), &FitOptions::default()).unwrap();
        let x = [0.35, 0.65];
        let ratio = model.predict(&x).variance / plain.predict(&x).variance;
        assert!(ratio >= 1.0 - 1e-12, "{n}: {ratio}");
        assert!((ratio / model.calibration() - 1.0).abs() < 1e-9);
        wider += usize::from(ratio > 1.0);
    }
    // A factor above 1 needs no such confidence.
    assert!(wider > 0);
}

/// 40 points in 20 dimensions.
#[test]
fn the_posterior_mode_is_better_for_few_points() {
    let tests = Sample::welch(500, 1000);
    let median_rmse = |estimator: Estimator| {
        let of_seed = |seed| {
            let options = FitOptions {
                estimator,
                ..FitOptions::default()
            };
            let model = fit(&Sample::welch(40, seed).data(), &options).unwrap();
            let means = model.means(&tests.x).unwrap();
            let squares = means.iter().zip(&tests.y).map(|(m, y)| (m - y).powi(2));
            (squares.sum::<f64>() / 500.0).sqrt()
        };
        let mut all: Vec<f64> = (0..9).map(of_seed).collect();
        all.sort_by(f64::total_cmp);
        all[4]
    };
    let [likelihood, mode] = [Estimator::Likelihood, Estimator::PosteriorMode].map(median_rmse);
    assert!(mode < 0.97 * likelihood, "{mode} {likelihood}");
}
