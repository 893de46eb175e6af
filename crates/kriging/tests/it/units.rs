//! Numbers at the limits of an f64, and one noise variance far above all others.

use kriging::{Error, FitOptions, Model, VecchiaOptions, fit, fit_vecchia};

use crate::common::Sample;

fn scaled(sample: &Sample, of_x: f64, of_y: f64) -> Sample {
    let mut scaled = sample.clone();
    scaled.x.iter_mut().for_each(|x| *x *= of_x);
    scaled.y.iter_mut().for_each(|y| *y *= of_y);
    scaled.noise.iter_mut().for_each(|v| *v *= of_y * of_y);
    scaled
}

#[test]
fn units_at_the_ends_of_f64_give_the_right_model_or_an_error() {
    // Values below 1, so that the unit itself is what overflows.
    let sample = scaled(&Sample::smooth(40, 2, 0.01), 1.0, 0.05);
    let reference = fit(&sample.data(), &FitOptions::default()).unwrap();
    for unit in [
        1e308, 1e300, 1e160, 1e150, 1e100, 1e-100, 1e-150, 1e-160, 1e-310,
    ] {
        for (of_x, of_y) in [(unit, 1.0), (1.0, unit)] {
            let mut hard = scaled(&sample, of_x, of_y);
            // If the square of the unit overflows, the noise is left out; the fit is to refuse the
            // unit itself.
            if hard.noise.iter().any(|v| !v.is_finite()) {
                hard.noise.fill(0.0);
            }
            let result = fit(&hard.data(), &FitOptions::default());
            let approximate = fit_vecchia(&hard.data(), &VecchiaOptions::default());
            let model = match result {
                Ok(model) => model,
                Err(error) => {
                    let what_is = if of_x == 1.0 { "y" } else { "x" };
                    assert!(
                        matches!(error, Error::Extent { what } if what == what_is),
                        "{of_x} {of_y}: {error}"
                    );
                    assert!(matches!(approximate, Err(Error::Extent { .. })));
                    assert!(!(1e-100..=1e100).contains(&unit), "{unit}");
                    continue;
                }
            };
            let approximate = approximate.unwrap();
            for x in [[0.3, 0.3], [0.9, 0.1]] {
                let p = reference.predict(&x);
                let at = [x[0] * of_x, x[1] * of_x];
                let q = model.predict(&at);
                // The search ends within 1e-3 of a standard deviation of the same model.
                let tolerance = 1e-2 * p.variance.sqrt();
                assert!((q.mean / of_y - p.mean).abs() < tolerance, "{unit}: {q:?}");
                let ratio = q.variance / of_y / of_y / p.variance;
                assert!((ratio - 1.0).abs() < 1e-2, "{unit}: {ratio}");
                assert!((approximate.mean(&at) / of_y - p.mean).abs() < tolerance);
            }
        }
    }
}

/// Root mean square error against the function without noise.
fn error(model: &Model) -> f64 {
    let truth = Sample::smooth(200, 2, 0.0);
    let squares: f64 = (0..200)
        .map(|i| (model.mean(truth.row(i)) - truth.y[i]).powi(2))
        .sum();
    (squares / 200.0).sqrt()
}

#[test]
fn one_huge_noise_variance_among_small_ones_is_ignored() {
    let clean = Sample::smooth(60, 2, 1e-4);
    let without = fit(&clean.without(11).data(), &FitOptions::default()).unwrap();
    for off in [0.0, 1e6] {
        let mut sample = clean.clone();
        sample.noise[11] = 1e12;
        sample.y[11] += off;
        let model = fit(&sample.data(), &FitOptions::default()).unwrap();
        // That observation carries no information: the model is that of the others.
        let (with, best) = (error(&model), error(&without));
        assert!((with / best - 1.0).abs() < 1e-2, "{off}: {with} {best}");
        let sigma2 = model.parameters().sigma2 / without.parameters().sigma2;
        assert!((sigma2 - 1.0).abs() < 0.05, "{off}: {sigma2}");
        let p = model.predict(&[0.4, 0.6]);
        let q = without.predict(&[0.4, 0.6]);
        assert!((p.mean - q.mean).abs() < 0.05 * q.variance.sqrt());
        assert!((p.variance / q.variance - 1.0).abs() < 0.05);
    }
    // As one of few noisy observations among exact ones.
    let mut sample = Sample::smooth(60, 2, 0.0);
    sample.noise[11] = 1e12;
    sample.y[11] -= 1e6;
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    let exact = Sample::smooth(60, 2, 0.0).without(11);
    let best = error(&fit(&exact.data(), &FitOptions::default()).unwrap());
    assert!(error(&model) < 1.05 * best, "{} {best}", error(&model));
}
