//! Gradients of the prediction against differences.

use kriging::{FitOptions, Kernel, Trend, fit};

use crate::common::Sample;

#[test]
fn gradients_agree_with_differences() {
    let sample = Sample::smooth(60, 3, 0.02);
    for kernel in Kernel::ALL {
        for (trend, calibrate) in [(Trend::Constant, false), (Trend::Linear, true)] {
            let options = FitOptions {
                kernel,
                trend,
                calibrate,
                starts: 3,
                ..FitOptions::default()
            };
            let model = fit(&sample.data(), &options).unwrap();
            for x in [[0.31, 0.52, 0.77], [1.3, -0.2, 0.05]] {
                let gradient = model.predict_gradient(&x);
                assert_eq!(gradient.prediction, model.predict(&x));
                let (mean, slopes) = model.mean_gradient(&x);
                assert_eq!((mean, &slopes), (gradient.prediction.mean, &gradient.mean));
                for j in 0..3 {
                    // Fourth-order differences: rounding 1e-12/h, truncation h⁴ times a fifth
                    // derivative of at most some 1e4.
                    let h = 1e-4;
                    let at = |step: f64| {
                        let mut x = x;
                        x[j] += step * h;
                        model.predict(&x)
                    };
                    let [a, b, c, d] = [at(1.0), at(-1.0), at(2.0), at(-2.0)];
                    let difference = |f: fn(&kriging::Prediction) -> f64| {
                        (8.0 * (f(&a) - f(&b)) - f(&c) + f(&d)) / (12.0 * h)
                    };
                    let of_mean = difference(|p| p.mean) - gradient.mean[j];
                    let of_variance = difference(|p| p.variance) - gradient.variance[j];
                    assert!(of_mean.abs() < 1e-6, "{kernel} {trend:?} {j}: {of_mean}");
                    assert!(
                        of_variance.abs() < 1e-6,
                        "{kernel} {trend:?} {j}: {of_variance}"
                    );
                }
            }
        }
    }
}

#[test]
fn at_an_observation_the_gradient_is_finite() {
    let sample = Sample::smooth(30, 2, 0.0);
    for kernel in Kernel::ALL {
        let options = FitOptions {
            kernel,
            ..FitOptions::default()
        };
        let model = fit(&sample.data(), &options).unwrap();
        let gradient = model.predict_gradient(sample.row(3));
        let numbers = gradient.mean.iter().chain(&gradient.variance);
        assert!(numbers.clone().all(|v| v.is_finite()), "{kernel}");
    }
}
