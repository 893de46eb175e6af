//! Adding observations to a model.

use kriging::{Data, Error, FitOptions, Kernel, Model, Trend, fit};

use crate::common::{DenseKriging, Sample, read, written};

fn check(model: &Model, sample: &Sample) {
    let dense = match model.trend() {
        Trend::Linear => DenseKriging::with_trend(model.kernel(), sample, model.parameters()),
        _ => DenseKriging::new(model.kernel(), sample, model.parameters()),
    };
    let error = model.negative_log_likelihood() - dense.negative_log_likelihood();
    // Rounding times the condition of the matrix.
    assert!(error.abs() < 1e-7, "{error}");
    for x in Sample::smooth(20, 3, 0.1).x.chunks(3) {
        let (mean, variance) = dense.predict(x);
        let ours = model.predict(x);
        assert!((ours.mean - mean).abs() < 1e-8, "{ours:?} {mean}");
        assert!((ours.variance - variance).abs() < 1e-8);
    }
}

#[test]
fn an_updated_factor_is_that_of_all_points() {
    let all = Sample::smooth(60, 3, 0.02);
    let (old, new): (Vec<usize>, Vec<usize>) = (0..60).partition(|&i| i < 45);
    let (old, new) = (all.pick(&old), all.pick(&new));
    for kernel in Kernel::ALL {
        for trend in [Trend::Constant, Trend::Linear] {
            let options = FitOptions {
                kernel,
                trend,
                starts: 3,
                ..FitOptions::default()
            };
            let model = fit(&old.data(), &options).unwrap();
            let longer = model.with_points(&new.data()).unwrap();
            assert_eq!(longer.points(), 60);
            assert_eq!(longer.parameters().ranges, model.parameters().ranges);
            check(&longer, &all);
            // One by one, and after a detour through JSON.
            let mut stepwise = read(&written(model.clone())).unwrap();
            for i in 0..15 {
                stepwise = stepwise.with_points(&new.pick(&[i]).data()).unwrap();
            }
            check(&stepwise, &all);
            let (a, b) = (longer.leave_one_out(), stepwise.leave_one_out());
            for (a, b) in a.residuals.iter().zip(&b.residuals) {
                assert!((a - b).abs() < 1e-8);
            }
        }
    }
}

#[test]
fn a_repeated_point_is_merged() {
    let old = Sample::smooth(40, 3, 0.02);
    let model = fit(&old.data(), &FitOptions::default()).unwrap();
    let mut new = Sample::smooth(8, 3, 0.02);
    new.x[..3].copy_from_slice(old.row(7));
    new.x[3..6].copy_from_slice(old.row(7));
    // Within their noise, because contradictory observations are not merely averaged.
    (new.y[0], new.y[1]) = (old.y[7] + 0.1, old.y[7] - 0.15);
    let longer = model.with_points(&new.data()).unwrap();
    assert_eq!(longer.points(), 46);
    let all = Sample {
        x: [old.x.clone(), new.x.clone()].concat(),
        y: [old.y.clone(), new.y.clone()].concat(),
        noise: [old.noise.clone(), new.noise.clone()].concat(),
        d: 3,
    };
    check(&longer, &all);
    // Merged observations stay counted.
    let again = longer
        .with_points(&Sample::smooth(5, 3, 0.02).data())
        .unwrap();
    assert_eq!(again.points(), 51);
    let counted = kriging::Warning::MergedDuplicates {
        observations: 53,
        distinct: 51,
    };
    assert_eq!(again.warnings()[0], counted);
}

#[test]
fn points_that_cannot_be_added_are_refused() {
    let model = fit(&Sample::smooth(20, 3, 0.02).data(), &FitOptions::default()).unwrap();
    assert!(matches!(
        model.with_points(&Sample::smooth(5, 2, 0.02).data()),
        Err(Error::Shape { .. })
    ));
    let data = Data {
        x: &[0.1, 0.2, f64::NAN],
        d: 3,
        y: &[1.0],
        noise_variance: &[0.0],
    };
    assert!(matches!(
        model.with_points(&data),
        Err(Error::NonFinite { index: 2, .. })
    ));
    // Adding no points changes nothing.
    let none = Data {
        x: &[],
        d: 3,
        y: &[],
        noise_variance: &[],
    };
    let same = model.with_points(&none).unwrap();
    assert_eq!(same.mean(&[0.5; 3]), model.mean(&[0.5; 3]));
}

#[test]
fn a_point_beside_another_needs_no_care() {
    let sample = Sample::smooth(30, 2, 0.0);
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    let twin: Vec<f64> = sample.row(4).iter().map(|x| x + 1e-9).collect();
    let data = Data {
        x: &twin,
        d: 2,
        y: &[sample.y[4]],
        noise_variance: &[0.0],
    };
    let longer = model.with_points(&data).unwrap();
    // Interpolation error of the jitter that the twin needs, at most 1e-4 of a variance of 3.
    assert!((longer.mean(&[0.4, 0.6]) - model.mean(&[0.4, 0.6])).abs() < 1e-2);
}

#[test]
fn a_reinterpolated_model_passes_through_its_means() {
    let sample = Sample::smooth(40, 3, 0.05);
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    let smooth = model.reinterpolated().unwrap();
    for i in 0..40 {
        let p = smooth.predict(sample.row(i));
        assert!((p.mean - model.mean(sample.row(i))).abs() < 1e-6);
        assert!(p.variance < 1e-6 * model.parameters().sigma2);
    }
    // Between the points both means are the same: C⁻¹ of the noisy model's means is its weights.
    assert!((smooth.mean(&[0.3, 0.6, 0.2]) - model.mean(&[0.3, 0.6, 0.2])).abs() < 1e-6);
}
