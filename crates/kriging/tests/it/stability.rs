//! The inputs of `tests/data/stability` and their relatives: a model of stated accuracy, or an
//! error that says what to do.

use kriging::{Error, FitOptions, Kernel, Model, Nugget, Warning, fit};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::common::Sample;

fn rows(text: &str) -> impl Iterator<Item = Vec<f64>> {
    text.lines()
        .map(|line| line.split(',').map(|v| v.parse().unwrap()).collect())
}

fn train(text: &str) -> Sample {
    let (mut x, mut y, mut noise, mut d) = (vec![], vec![], vec![], 0);
    for row in rows(text) {
        d = row.len() - 2;
        x.extend(&row[..d]);
        y.push(row[d]);
        noise.push(row[d + 1]);
    }
    Sample { x, d, y, noise }
}

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

/// 1 − mean square error over the variance of the truth.
fn q2(model: &Model, text: &str) -> f64 {
    let points: Vec<Vec<f64>> = rows(text).collect();
    let truths = || points.iter().map(|row| row[row.len() - 1]);
    let mean = truths().sum::<f64>() / points.len() as f64;
    let variance = truths().map(|t| (t - mean).powi(2)).sum::<f64>() / points.len() as f64;
    1.0 - score(model, &points).0.powi(2) / variance
}

fn warned(model: &Model, wanted: impl Fn(&Warning) -> bool) -> bool {
    model.warnings().iter().any(wanted)
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
fn k1_duplicates_without_noise() {
    let sample = train(include_str!(
        "../data/stability/K1_dup_zero_noise_train.csv"
    ));
    let test = include_str!("../data/stability/K1_dup_zero_noise_test.csv");
    for kernel in [
        Kernel::Matern52,
        Kernel::SquaredExponential,
        Kernel::RadialMatern52,
    ] {
        let model = fitted(&sample, kernel);
        assert!(warned(&model, |w| *w
            == Warning::MergedDuplicates {
                observations: 75,
                distinct: 60
            }));
        // 60 points of Hartmann's function in six variables explain half of its variance: 0.46 to
        // 0.49 were seen.
        let q2 = q2(&model, test);
        assert!(q2 > 0.43, "{kernel}: {q2}");
        let miss = (0..75).map(|i| (model.mean(sample.row(i)) - sample.y[i]).abs());
        assert!(miss.fold(0.0, f64::max) < 1e-6, "{kernel}");
    }
}

#[test]
fn k1b_contradicting_duplicates_without_noise() {
    let sample = train(include_str!(
        "../data/stability/K1b_dup_diff_y_zero_noise_train.csv"
    ));
    let test = include_str!("../data/stability/K1b_dup_diff_y_zero_noise_test.csv");
    for kernel in [Kernel::Matern52, Kernel::SquaredExponential] {
        let model = fitted(&sample, kernel);
        assert!(warned(&model, |w| matches!(
            w,
            Warning::ContradictoryDuplicates { points: 15, .. }
        )));
        // As much as without the contradiction.
        let q2 = q2(&model, test);
        assert!(q2 > 0.43, "{kernel}: {q2}");
    }
}

#[test]
fn k2_a_cluster_1e_6_wide() {
    let sample = train(include_str!("../data/stability/K2_cluster_1e-6_train.csv"));
    let test = include_str!("../data/stability/K2_cluster_1e-6_test.csv");
    for kernel in [Kernel::Matern52, Kernel::SquaredExponential] {
        let model = fitted(&sample, kernel);
        assert!(warned(
            &model,
            |w| matches!(w, Warning::Jitter { relative } if *relative <= 1e-8)
        ));
        let q2 = q2(&model, test);
        assert!(q2 > 0.47, "{kernel}: {q2}");
    }
}

#[test]
fn k3_an_analytic_function_on_a_dense_grid() {
    let sample = train(include_str!(
        "../data/stability/K3_se_dense_grid_900_train.csv"
    ));
    let points: Vec<Vec<f64>> = rows(include_str!(
        "../data/stability/K3_se_dense_grid_900_test.csv"
    ))
    .collect();
    // The jitter of 1e-12 limits an interpolation to about its root times the function's size, 1; on
    // average over the grid it is better by more than ten times.
    let model = fitted(&sample, Kernel::SquaredExponential);
    assert!(warned(&model, |w| matches!(w, Warning::Jitter { .. })));
    let (rmse, _) = score(&model, &points);
    assert!(rmse < 1e-7, "{rmse}");
}

#[test]
fn k5_constant_responses() {
    for (train_text, test, value) in [
        (
            include_str!("../data/stability/K5_constant_y_noise_train.csv"),
            include_str!("../data/stability/K5_constant_y_noise_test.csv"),
            7.0,
        ),
        (
            include_str!("../data/stability/K5b_all_infeasible_100_train.csv"),
            include_str!("../data/stability/K5b_all_infeasible_100_test.csv"),
            100.0,
        ),
    ] {
        let model = fitted(&train(train_text), Kernel::Matern52);
        assert!(warned(&model, |w| *w == Warning::ConstantResponse));
        let points: Vec<Vec<f64>> = rows(test).collect();
        assert!(points.iter().all(|row| row[6] == value));
        let (rmse, coverage) = score(&model, &points);
        assert!(rmse <= 1e-12 * value);
        assert_eq!(coverage, 1.0);
    }
}

#[test]
fn k7_one_two_and_three_points() {
    let one = train(include_str!("../data/stability/K7_n1_train.csv"));
    let error = fit(&one.data(), &FitOptions::default()).unwrap_err();
    assert!(matches!(error, Error::TooFewPoints { distinct: 1 }));
    for (text, test, n) in [
        (
            include_str!("../data/stability/K7_n2_train.csv"),
            include_str!("../data/stability/K7_n2_test.csv"),
            2,
        ),
        (
            include_str!("../data/stability/K7_n3_train.csv"),
            include_str!("../data/stability/K7_n3_test.csv"),
            3,
        ),
    ] {
        let sample = train(text);
        let model = fitted(&sample, Kernel::Matern52);
        assert!(warned(
            &model,
            |w| matches!(w, Warning::FewPoints { distinct, .. } if *distinct == n)
        ));
        // Nothing can be learnt: the mean must stay near the observations and be no worse than a
        // constant among them.
        let (low, high) = sample
            .y
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
        for row in rows(test) {
            let mean = model.mean(&row[..6]);
            assert!(mean > low - 0.5 && mean < high + 0.5, "{n}: {mean}");
        }
    }
}

#[test]
fn k9_a_nan_is_refused_by_its_index() {
    let sample = train(include_str!("../data/stability/K9_nan_y_train.csv"));
    let error = fit(&sample.data(), &FitOptions::default()).unwrap_err();
    assert!(matches!(
        error,
        Error::NonFinite {
            what: "y",
            index: 17,
            ..
        }
    ));
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
fn one_gross_outlier() {
    let mut rng = stream(23, Purpose::Test, 0, 0);
    let x = cube(120, 2, 3);
    let y: Vec<f64> = x
        .chunks(2)
        .map(|x| noisy(wave(x), 0.01, &mut rng))
        .collect();
    let mut sample = Sample {
        x,
        d: 2,
        y,
        noise: vec![0.01; 120],
    };
    assert!(
        fitted(&sample, Kernel::Matern52)
            .leave_one_out()
            .outliers()
            .is_empty()
    );
    sample.y[57] += 50.0;
    let constant = {
        let points = truths(2);
        let mean = points.iter().map(|row| row[2]).sum::<f64>() / points.len() as f64;
        let squares: f64 = points.iter().map(|row| (row[2] - mean).powi(2)).sum();
        (squares / points.len() as f64).sqrt()
    };
    // With a nugget the error is taken for noise, and the model is no worse than a constant, apart
    // from the error's share in the mean, 50/120 = 0.4. Without one the model passes through the
    // error, and the likelihood is highest for a model that follows it along a strip: a hundredth
    // of the area, off by up to 50, is 50 √0.01 = 5 at most.
    for (nugget, limit, most) in [
        (Nugget::Known, 5.0, 2),
        (Nugget::Estimated, constant + 0.4, 1),
    ] {
        let options = FitOptions {
            nugget,
            ..FitOptions::default()
        };
        let model = fit(&sample.data(), &options).unwrap();
        // The error is reported. A model that passes through it may report one point beside it,
        // too.
        let outliers = model.leave_one_out().outliers();
        assert!(outliers.contains(&57), "{outliers:?}");
        assert!(outliers.len() <= most, "{outliers:?}");
        // The warning names it, the worst first.
        let warning = model
            .warnings()
            .iter()
            .find_map(|warning| match warning {
                Warning::Outliers { worst, .. } => Some((worst[0].observation, warning)),
                _ => None,
            })
            .unwrap();
        assert_eq!(warning.0, 57);
        assert!(warning.1.to_string().contains("observation 57 lies"));
        let (with, _) = score(&model, &truths(2));
        assert!(with < limit, "{nugget:?}: {with} {limit}");
    }
    let (without, _) = score(&fitted(&sample.without(57), Kernel::Matern52), &truths(2));
    assert!(without < 0.05, "{without}");
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
fn mostly_infeasible_at_a_penalty() {
    // 100 where x₀ > 0.2, as a campaign marks designs that break a constraint: a cliff.
    let x = cube(150, 2, 5);
    let value = |x: &[f64]| if x[0] > 0.2 { 100.0 } else { wave(x) };
    let sample = Sample {
        y: x.chunks(2).map(value).collect(),
        x,
        d: 2,
        noise: vec![0.0; 150],
    };
    let model = fitted(&sample, Kernel::Matern52);
    let points: Vec<Vec<f64>> = cube(300, 2, 6)
        .chunks(2)
        .map(|x| [x, &[value(x)]].concat())
        .collect();
    let (rmse, _) = score(&model, &points);
    // The cliff of 100 lies within 0.02 of some 4 % of the points: 100 √0.04/2 is 10.
    assert!(rmse < 10.0, "{rmse}");
    let far: Vec<Vec<f64>> = points.into_iter().filter(|row| row[0] > 0.5).collect();
    // Away from the cliff, only its effect on the ranges remains.
    assert!(score(&model, &far).0 < 4.0);
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
