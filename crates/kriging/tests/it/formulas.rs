use kriging::{FitOptions, Kernel, Warning, fit};

use crate::common::{DenseKriging, Sample};

fn options(kernel: Kernel) -> FitOptions {
    FitOptions {
        kernel,
        ..FitOptions::default()
    }
}

#[test]
fn predictions_and_likelihood_are_those_of_the_dense_formulas() {
    for kernel in Kernel::ALL {
        let sample = Sample::smooth(40, 3, 0.02);
        let model = fit(&sample.data(), &options(kernel)).unwrap();
        let dense = DenseKriging::new(kernel, &sample, model.parameters());
        // Both are exact but for rounding times the condition of the matrix, below 1e6 here.
        assert!((model.parameters().mu - dense.mu).abs() < 1e-8, "{kernel}");
        let (ours, theirs) = (
            model.negative_log_likelihood(),
            dense.negative_log_likelihood(),
        );
        assert!((ours - theirs).abs() < 1e-8, "{kernel}: {ours} {theirs}");
        let other = Sample::smooth(150, 3, 0.02);
        let many = model.predict_many(&other.x).unwrap();
        for (i, batch) in many.iter().enumerate() {
            let x = other.row(i);
            let (mean, variance) = dense.predict(x);
            let one = model.predict(x);
            assert!((one.mean - mean).abs() < 1e-8, "{kernel}: {one:?} {mean}");
            assert!(
                (one.variance - variance).abs() < 1e-8,
                "{kernel}: {one:?} {variance}"
            );
            assert_eq!(one.mean, model.mean(x));
            assert_eq!(one.mean, batch.mean);
            assert!((one.variance - batch.variance).abs() < 1e-12);
        }
    }
}

#[test]
fn the_fit_is_a_maximum_of_the_likelihood() {
    for kernel in Kernel::ALL {
        let sample = Sample::smooth(40, 2, 0.02);
        let model = fit(&sample.data(), &options(kernel)).unwrap();
        let at_bound = |j: usize| {
            model.warnings().iter().any(|w| {
                matches!(w, Warning::RangesAtBound { coordinates, .. } if coordinates.contains(&j))
            })
        };
        let best = DenseKriging::new(kernel, &sample, model.parameters()).negative_log_likelihood();
        for factor in [0.99, 1.01] {
            let mut moved = model.parameters().clone();
            moved.sigma2 *= factor;
            let value = DenseKriging::new(kernel, &sample, &moved).negative_log_likelihood();
            assert!(value > best - 1e-8, "{kernel} σ²: {value} {best}");
            for j in (0..2).filter(|&j| !at_bound(j)) {
                let mut moved = model.parameters().clone();
                moved.ranges[j] *= factor;
                let value = DenseKriging::new(kernel, &sample, &moved).negative_log_likelihood();
                assert!(value > best - 1e-8, "{kernel} θ{j}: {value} {best}");
            }
        }
    }
}

#[test]
fn interpolates_as_the_noise_vanishes() {
    let exact = Sample::smooth(30, 2, 0.0);
    let mut previous = f64::INFINITY;
    for noise in [1e-2, 1e-4, 1e-6, 0.0] {
        let sample = Sample {
            noise: vec![noise; 30],
            ..exact.clone()
        };
        let model = fit(&sample.data(), &FitOptions::default()).unwrap();
        let miss = (0..30)
            .map(|i| (model.mean(sample.row(i)) - sample.y[i]).abs())
            .fold(0.0, f64::max);
        let spread = (0..30)
            .map(|i| model.predict(sample.row(i)).variance)
            .fold(0.0, f64::max);
        assert!(
            miss < previous && spread <= 1.01 * noise + 1e-10,
            "{noise}: {miss} {spread}"
        );
        previous = miss;
    }
    // Without noise only rounding is left, times a condition of up to 1e8.
    assert!(previous < 1e-7, "{previous}");
}

#[test]
fn far_from_the_data_the_mean_and_the_variance_are_those_of_the_process() {
    let sample = Sample::smooth(40, 2, 0.02);
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    let far = model.predict(&[1e6, -1e6]);
    assert_eq!(far.mean, model.parameters().mu);
    // σ² plus the variance of the estimated mean.
    assert!(far.variance > model.parameters().sigma2);
    assert!(far.variance < 2.0 * model.parameters().sigma2);
}

#[test]
fn ranges_that_the_data_do_not_determine_are_reported() {
    let mut sample = Sample::smooth(40, 2, 0.04);
    // The second coordinate moves the response by about as much as the noise does.
    sample.y = sample
        .x
        .chunks(2)
        .zip(&sample.y)
        .enumerate()
        .map(|(i, (x, _))| {
            let scatter = 0.2 * (1.7 * (i * i) as f64).sin();
            (5.0 * x[0]).sin() + 0.15 * (4.0 * x[1]).sin() + scatter
        })
        .collect();
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    let flat = Warning::FlatRanges {
        coordinates: vec![1],
    };
    assert_eq!(
        model.warnings(),
        [flat],
        "ranges {:?}",
        model.parameters().ranges
    );
}

#[test]
fn ranges_at_a_bound_are_reported_together() {
    let mut sample = Sample::smooth(60, 3, 0.01);
    // Nothing depends on the last two coordinates.
    sample.y = sample.x.chunks(3).map(|x| (5.0 * x[0]).sin()).collect();
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    assert!(model.parameters().ranges[0] < 5.0);
    let expected = Warning::RangesAtBound {
        coordinates: vec![1, 2],
        upper: true,
    };
    assert_eq!(model.warnings(), [expected]);
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
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    assert_eq!(
        model.warnings()[0],
        Warning::MergedDuplicates {
            observations: 28,
            distinct: 25
        }
    );
    // The dense formulas do not merge.
    let dense = DenseKriging::new(model.kernel(), &sample, model.parameters());
    let error = model.negative_log_likelihood() - dense.negative_log_likelihood();
    assert!(error.abs() < 1e-8, "{error}");
    for x in [[0.5, 0.5], [0.1, 0.7]] {
        let (mean, variance) = dense.predict(&x);
        let ours = model.predict(&x);
        assert!((ours.mean - mean).abs() < 1e-8 && (ours.variance - variance).abs() < 1e-8);
    }
}
