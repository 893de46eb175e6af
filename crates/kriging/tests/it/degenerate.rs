//! Data on which kriging libraries break.

use kriging::{Data, Error, FitOptions, Kernel, Model, Warning, fit};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::common::{Dense, Sample};

fn fitted(sample: &Sample) -> Model {
    fit(&sample.data(), &FitOptions::default()).unwrap()
}

fn has(model: &Model, wanted: impl Fn(&Warning) -> bool) -> bool {
    model.warnings().iter().any(wanted)
}

#[test]
fn noisy_duplicates_count_one_by_one() {
    // Three observations at point 4, two at point 9, with unequal noise.
    let mut indices: Vec<usize> = (0..25).collect();
    indices.extend([4, 4, 9]);
    let mut sample = Sample::smooth(25, 2, 0.05).pick(&indices);
    for (i, (y, v)) in [(0.2, 2.0), (-0.1, 0.7), (0.15, 1.3)]
        .into_iter()
        .enumerate()
    {
        sample.y[25 + i] += y;
        sample.noise[25 + i] *= v;
    }
    let model = fitted(&sample);
    assert_eq!(
        model.warnings()[0],
        Warning::MergedDuplicates {
            observations: 28,
            distinct: 25
        }
    );
    // The dense formulas do not merge.
    let dense = Dense::new(model.kernel(), &sample, model.parameters());
    let error = model.negative_log_likelihood() - dense.negative_log_likelihood();
    assert!(error.abs() < 1e-8, "{error}");
    for x in [[0.5, 0.5], [0.1, 0.7]] {
        let (mean, variance) = dense.predict(&x);
        let ours = model.predict(&x);
        assert!((ours.mean - mean).abs() < 1e-8 && (ours.variance - variance).abs() < 1e-8);
    }
}

#[test]
fn noise_free_duplicates_agree_or_their_scatter_is_noise() {
    let exact = Sample::smooth(20, 2, 0.0);
    let indices: Vec<usize> = (0..20).chain([3, 3, 7]).collect();
    let repeated = exact.pick(&indices);
    let (once, merged) = (fitted(&exact), fitted(&repeated));
    assert_eq!(once.parameters(), merged.parameters());
    assert_eq!(once.mean(&[0.4, 0.4]), merged.mean(&[0.4, 0.4]));

    let mut contradictory = repeated;
    contradictory.y[20] += 0.3;
    contradictory.y[21] -= 0.3;
    let model = fitted(&contradictory);
    // Three observations at −0.3, 0, 0.3 around their mean: variance 0.09.
    assert!(has(&model, |w| matches!(
        w,
        Warning::ContradictoryDuplicates { points: 1, sd } if (sd - 0.3).abs() < 1e-12
    )));
    assert!((model.mean(exact.row(3)) - exact.y[3]).abs() < 0.3);
}

#[test]
fn equal_observations_give_a_constant() {
    for noise in [0.0, 0.02] {
        let mut sample = Sample::smooth(30, 3, noise);
        sample.y.fill(100.0);
        for kernel in Kernel::ALL {
            let model = fit(
                &sample.data(),
                &FitOptions {
                    kernel,
                    ..FitOptions::default()
                },
            )
            .unwrap();
            assert!(has(&model, |w| *w == Warning::ConstantResponse));
            let p = model.predict(&[0.2, 0.4, 2.0]);
            assert!((p.mean - 100.0).abs() < 1e-12);
            // The variance of the weighted mean.
            let expected = 1.0 / sample.noise.iter().map(|v| 1.0 / v).sum::<f64>();
            assert!(
                (p.variance - expected).abs() < 1e-6 * expected + 1e-300,
                "{p:?} {expected}"
            );
            let loo = model.leave_one_out();
            assert!(loo.residuals.iter().all(|r| r.abs() < 1e-12));
            assert_eq!((loo.q2, loo.coverage90), (0.0, 1.0));
            assert!(model.negative_log_likelihood().is_finite());
        }
    }
}

#[test]
fn pure_noise_is_called_by_its_name() {
    let mut sample = Sample::smooth(80, 3, 0.0);
    let mut rng = stream(5, Purpose::Test, 0, 0);
    sample.y.iter_mut().for_each(|y| *y = rng.random::<f64>());
    sample.noise.fill(1.0 / 12.0);
    assert!(has(&fitted(&sample), |w| matches!(
        w,
        Warning::NoStructure { .. }
    )));
    // The same scatter, wrongly declared exact.
    sample.noise.fill(0.0);
    assert!(has(&fitted(&sample), |w| matches!(
        w,
        Warning::NoStructure { .. }
    )));
    // A function is not mistaken for noise.
    assert!(!has(&fitted(&Sample::smooth(80, 3, 0.05)), |w| matches!(
        w,
        Warning::NoStructure { .. }
    )));
}

#[test]
fn unusable_numbers_are_refused_with_their_index() {
    let sample = Sample::smooth(10, 2, 0.01);
    let mut damaged = sample.clone();
    damaged.y[7] = f64::NAN;
    assert!(matches!(
        fit(&damaged.data(), &FitOptions::default()),
        Err(Error::NonFinite {
            what: "y",
            index: 7,
            ..
        })
    ));
    let mut damaged = sample.clone();
    damaged.x[13] = f64::INFINITY;
    assert!(matches!(
        fit(&damaged.data(), &FitOptions::default()),
        Err(Error::NonFinite {
            what: "x",
            index: 13,
            ..
        })
    ));
    let mut damaged = sample.clone();
    damaged.noise[2] = -1e-9;
    assert!(matches!(
        fit(&damaged.data(), &FitOptions::default()),
        Err(Error::NegativeNoise { index: 2, .. })
    ));
    let mut damaged = sample.clone();
    damaged.noise[3] = f64::NAN;
    assert!(fit(&damaged.data(), &FitOptions::default()).is_err());
    for (x, extent) in [(f64::MAX, "x"), (0.0, "y")] {
        let mut damaged = sample.clone();
        (damaged.x[0], damaged.x[2]) = (x, -x);
        if extent == "y" {
            damaged.y[0] = 1e200;
        }
        let error = fit(&damaged.data(), &FitOptions::default()).unwrap_err();
        assert!(
            matches!(error, Error::Extent { what } if what == extent),
            "{error}"
        );
    }
    let data = Data {
        x: &sample.x[1..],
        ..sample.data()
    };
    assert!(matches!(
        fit(&data, &FitOptions::default()),
        Err(Error::Shape {
            what: "x",
            expected: 20,
            got: 19
        })
    ));
    let data = Data {
        d: 0,
        ..sample.data()
    };
    assert!(fit(&data, &FitOptions::default()).is_err());
    assert!(matches!(
        fitted(&sample).predict_many(&[0.1, 0.2, 0.3]),
        Err(Error::Shape { what: "x", .. })
    ));
}

#[test]
fn one_two_and_three_points() {
    let sample = Sample::smooth(3, 6, 0.017);
    assert!(matches!(
        fit(&sample.pick(&[0]).data(), &FitOptions::default()),
        Err(Error::TooFewPoints { distinct: 1 })
    ));
    assert!(matches!(
        fit(&sample.pick(&[0, 0, 0]).data(), &FitOptions::default()),
        Err(Error::TooFewPoints { distinct: 1 })
    ));
    for n in [2, 3] {
        let indices: Vec<usize> = (0..n).collect();
        let few = sample.pick(&indices);
        let model = fitted(&few);
        // One range for all coordinates, σ² and the mean.
        assert!(has(&model, |w| *w
            == Warning::FewPoints {
                distinct: n,
                parameters: 3
            }));
        assert!(has(&model, |w| *w
            == Warning::SharedRange {
                distinct: n,
                dimensions: 6
            }));
        let (low, high) = few
            .y
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
        let p = model.predict(&[0.5; 6]);
        assert!(
            p.mean >= low - 1.0 && p.mean <= high + 1.0 && p.variance > 0.0,
            "{p:?}"
        );
        assert_eq!(model.leave_one_out().residuals.len(), n);
    }
}

#[test]
fn a_coordinate_without_variation_is_ignored() {
    let mut sample = Sample::smooth(30, 3, 0.01);
    sample.x.chunks_mut(3).for_each(|x| x[1] = 0.3);
    let model = fitted(&sample);
    assert!(has(&model, |w| *w
        == Warning::IgnoredCoordinate { coordinate: 1 }));
    assert_eq!(model.parameters().ranges[1], f64::INFINITY);
    assert_eq!(model.mean(&[0.2, 0.3, 0.4]), model.mean(&[0.2, 9.0, 0.4]));

    // Nothing varies at all.
    let same = Sample {
        x: vec![0.5; 30],
        d: 3,
        y: vec![1.0; 10],
        noise: vec![0.1; 10],
    };
    assert!(matches!(
        fit(&same.data(), &FitOptions::default()),
        Err(Error::TooFewPoints { distinct: 1 })
    ));
}

#[test]
fn a_cluster_1e_6_wide_is_fitted() {
    let mut sample = Sample::smooth(60, 2, 0.0);
    let smooth = |x: &[f64]| 10.0 + 3.0 * (5.0 * x[0]).sin() + x.iter().map(|x| x * x).sum::<f64>();
    let mut rng = stream(6, Purpose::Test, 0, 0);
    for x in sample.x.chunks_mut(2).take(30) {
        x.iter_mut()
            .for_each(|x| *x = 0.4 + 1e-6 * rng.random::<f64>());
    }
    sample.y = sample.x.chunks(2).map(smooth).collect();
    for kernel in Kernel::ALL {
        let model = fit(
            &sample.data(),
            &FitOptions {
                kernel,
                ..FitOptions::default()
            },
        )
        .unwrap();
        let rmse = (0..100)
            .map(|_| {
                let x = [rng.random::<f64>(), rng.random::<f64>()];
                (model.mean(&x) - smooth(&x)).powi(2)
            })
            .sum::<f64>()
            .sqrt()
            / 10.0;
        // The function spans about 8; the rough exponential kernel sets the tolerance.
        assert!(rmse < 0.8, "{kernel}: {rmse}");
    }
}

#[test]
fn the_squared_exponential_survives_a_dense_grid() {
    let points = (0..400).map(|i| [f64::from(i % 20) / 19.0, f64::from(i / 20) / 19.0]);
    let smooth = |x: &[f64]| (3.0 * x[0]).sin() + x[1] * x[1];
    let x: Vec<f64> = points.flatten().collect();
    let y: Vec<f64> = x.chunks(2).map(smooth).collect();
    let sample = Sample {
        x,
        d: 2,
        y,
        noise: vec![0.0; 400],
    };
    let kernel = Kernel::SquaredExponential;
    let model = fit(
        &sample.data(),
        &FitOptions {
            kernel,
            ..FitOptions::default()
        },
    )
    .unwrap();
    assert!(has(&model, |w| matches!(w, Warning::Jitter { .. })));
    let x = [0.512, 0.377];
    // Interpolation of an analytic function on a grid of 20 × 20; the jitter limits it to about
    // its square root, 1e-6.
    assert!((model.mean(&x) - smooth(&x)).abs() < 1e-6);
}
