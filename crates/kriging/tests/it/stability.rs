//! The accuracy of models of data that are hard to fit.

use kriging::{FitOptions, Kernel, Model, fit};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::common::Sample;

fn fitted(sample: &Sample, kernel: Kernel) -> Model {
    let options = FitOptions {
        kernel,
        ..FitOptions::default()
    };
    fit(&sample.data(), &options).unwrap()
}

/// Root mean square error and coverage of the 90 % interval; every number must be finite.
fn score(model: &Model, points: &[Vec<f64>]) -> (f64, f64) {
    let (mut squares, mut covered) = (0.0, 0);
    for row in points {
        let (truth, x) = row.split_last().unwrap();
        let p = model.predict(x);
        assert!(p.mean.is_finite() && p.variance.is_finite() && p.variance >= 0.0);
        squares += (truth - p.mean).powi(2);
        covered += usize::from((truth - p.mean).abs() <= 1.6449 * p.variance.sqrt());
    }
    let count = points.len() as f64;
    ((squares / count).sqrt(), covered as f64 / count)
}

/// A smooth function of the unit cube, of variance about 1.
fn wave(x: &[f64]) -> f64 {
    2.0 * (3.0 * x[0]).sin() + (2.0 * x[1]).cos() + x.iter().map(|x| 0.3 * x).sum::<f64>()
}

fn cube(n: usize, d: usize, seed: u64) -> Vec<f64> {
    let mut rng = stream(seed, Purpose::Test, n as u64, d as u64);
    (0..n * d).map(|_| rng.random()).collect()
}

/// Adds uniform noise of the given variance; the distribution does not matter here.
fn noisy(value: f64, variance: f64, rng: &mut impl rand::Rng) -> f64 {
    value + (12.0 * variance).sqrt() * (rng.random::<f64>() - 0.5)
}

fn truths(d: usize) -> Vec<Vec<f64>> {
    let rows = cube(200, d, 99);
    rows.chunks(d).map(|x| [x, &[wave(x)]].concat()).collect()
}

#[test]
fn noise_variances_from_1e_minus_12_to_100() {
    let mut rng = stream(21, Purpose::Test, 0, 0);
    let x = cube(140, 2, 1);
    let noise: Vec<f64> = (0..140)
        .map(|i| 10.0_f64.powf(-12.0 + 14.0 * f64::from(i) / 139.0))
        .collect();
    let y = x
        .chunks(2)
        .zip(&noise)
        .map(|(x, v)| noisy(wave(x), *v, &mut rng))
        .collect();
    let sample = Sample { x, d: 2, y, noise };
    for kernel in [Kernel::Matern52, Kernel::SquaredExponential] {
        let model = fitted(&sample, kernel);
        // The 40 points of a noise SD below 1e-4 alone determine so smooth a function to a few times
        // that.
        let (rmse, coverage) = score(&model, &truths(2));
        assert!(rmse < 5e-4, "{kernel}: {rmse}");
        assert!(coverage > 0.9, "{kernel}: {coverage}");
        // The most exact observation is reproduced, the noisiest is not.
        assert!((model.mean(sample.row(0)) - sample.y[0]).abs() < 1e-4);
    }
}

#[test]
fn twenty_dimensions() {
    let mut rng = stream(22, Purpose::Test, 0, 0);
    let x = cube(200, 20, 2);
    let y = x
        .chunks(20)
        .map(|x| noisy(wave(x), 0.01, &mut rng))
        .collect();
    let sample = Sample {
        x,
        d: 20,
        y,
        noise: vec![0.01; 200],
    };
    let model = fitted(&sample, Kernel::Matern52);
    let (rmse, coverage) = score(&model, &truths(20));
    // The truth's standard deviation is 0.8, and the function is one of two coordinates but for a
    // plane: 200 observations with noise of SD 0.1 leave half of that noise.
    assert!(rmse < 0.07, "{rmse}");
    assert!(coverage > 0.85, "{coverage}");
}

#[test]
fn noisy_clusters() {
    // Twelve places with ten observations each, 1e-9 apart, as by repeated measurement.
    let mut rng = stream(24, Purpose::Test, 0, 0);
    let centres = cube(40, 2, 4);
    let x: Vec<f64> = centres
        .chunks(2)
        .flat_map(|c| std::iter::repeat_n(c, 8).flatten())
        .map(|c| c + 1e-9 * rng.random::<f64>())
        .collect();
    let y = x
        .chunks(2)
        .map(|x| noisy(wave(x), 0.04, &mut rng))
        .collect();
    let sample = Sample {
        x,
        d: 2,
        y,
        noise: vec![0.04; 320],
    };
    for kernel in [
        Kernel::Matern52,
        Kernel::SquaredExponential,
        Kernel::RadialMatern32,
    ] {
        let model = fitted(&sample, kernel);
        let (rmse, coverage) = score(&model, &truths(2));
        // The mean of a cluster has SD 0.07; between clusters the function is smooth.
        assert!(rmse < 0.09, "{kernel}: {rmse}");
        assert!(coverage > 0.7, "{kernel}: {coverage}");
    }
}

#[test]
fn scales_and_shifts_that_eat_digits() {
    let base = Sample::smooth(40, 2, 0.01);
    let reference = fitted(&base, Kernel::Matern52);
    for (unit, shift, lost) in [(1e12, 0.0, 1e-9), (1e-12, 0.0, 1e-9), (1.0, 1e9, 1e-5)] {
        let mut sample = base.clone();
        sample.y.iter_mut().for_each(|y| *y = unit * *y + shift);
        sample.noise.iter_mut().for_each(|v| *v *= unit * unit);
        let model = fitted(&sample, Kernel::Matern52);
        for x in [[0.3, 0.3], [0.9, 0.1]] {
            let mean = (model.mean(&x) - shift) / unit;
            // y + 1e9 keeps seven decimals; the search follows them to 1e-3 of a standard deviation.
            let tolerance = 1e-3 * reference.predict(&x).variance.sqrt() + lost;
            assert!(
                (mean - reference.mean(&x)).abs() < tolerance,
                "{unit} {shift}"
            );
        }
    }
}

/// Parameters found on a part of the points serve all of them: without noise, where all together need more jitter, and
/// with noise.
#[test]
fn parameters_of_a_subset_serve_all_points() {
    let x = cube(1000, 2, 7);
    let smooth: Vec<f64> = x.chunks(2).map(wave).collect();
    let mut rng = stream(22, Purpose::Test, 0, 0);
    for variance in [0.0, 0.01] {
        let y = smooth.iter().map(|y| noisy(*y, variance, &mut rng));
        let sample = Sample {
            x: x.clone(),
            d: 2,
            y: y.collect(),
            noise: vec![variance; smooth.len()],
        };
        let of = |subset| {
            let options = FitOptions {
                subset,
                ..FitOptions::default()
            };
            let model = fit(&sample.data(), &options).unwrap();
            assert_eq!(model.points(), smooth.len());
            (score(&model, &truths(2)), model)
        };
        let ((whole, _), best) = of(1000);
        let ((part, covered), model) = of(300);
        let loss = model.negative_log_likelihood() - best.negative_log_likelihood();
        // Without noise the likelihood of a smooth function says more with every point.
        assert!(variance == 0.0 || loss < 3.0, "{variance}: {loss}");
        assert!(covered > 0.8, "{variance}: {covered}");
        assert!(part < 2.0 * whole + 1e-7, "{variance}: {part} {whole}");
    }
}
