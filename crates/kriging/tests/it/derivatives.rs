//! Gradients of the prediction against differences.

use kriging::{Error, FitOptions, Kernel, LogLikelihood, Trend, fit};

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

#[test]
fn the_likelihood_is_the_models_and_its_gradient_vanishes_there() {
    let sample = Sample::smooth(80, 3, 0.02);
    for (trend, nugget) in [(Trend::Constant, false), (Trend::Linear, true)] {
        let options = FitOptions {
            trend,
            nugget,
            ..FitOptions::default()
        };
        let model = fit(&sample.data(), &options).unwrap();
        let mut function = LogLikelihood::new(&sample.data(), options.kernel, trend).unwrap();
        let mut at = |parameters: &kriging::Parameters| function.evaluate(parameters).unwrap();
        let found = at(model.parameters());
        let nll = model.negative_log_likelihood();
        assert!((found.negative_log_likelihood - nll).abs() < 1e-9 * nll.abs());
        // The search ends when a step promises less than 1e-6; curvatures are of order 1 to 100. A
        // range at its upper bound has a slope towards longer ones.
        for (j, slope) in found.ln_ranges.iter().enumerate() {
            let bound = model.parameters().ranges[j] > 40.0;
            assert!(
                slope.abs() < 0.05 || (bound && *slope < 0.0),
                "{j}: {slope}"
            );
        }
        assert!(found.ln_sigma2.abs() < 0.05, "{}", found.ln_sigma2);

        // Elsewhere, against differences.
        let mut base = model.parameters().clone();
        base.ranges.iter_mut().for_each(|r| *r = r.min(2.0) * 1.3);
        if nugget {
            base.nugget = 0.03;
        }
        let exact = at(&base);
        let h = 1e-4_f64;
        let mut slope = |change: &dyn Fn(&mut kriging::Parameters, f64)| {
            let mut value = |step: f64| {
                let mut p = base.clone();
                change(&mut p, step.exp());
                at(&p).negative_log_likelihood
            };
            (value(h) - value(-h)) / (2.0 * h)
        };
        // Second-order differences: h² times a third derivative of order 100.
        let close = |a: f64, b: f64| (a - b).abs() < 1e-5 * (1.0 + b.abs());
        for j in 0..3 {
            let difference = slope(&|p, factor| p.ranges[j] *= factor);
            assert!(close(difference, exact.ln_ranges[j]), "{j}: {difference}");
        }
        assert!(close(slope(&|p, f| p.sigma2 *= f), exact.ln_sigma2));
        assert!(close(slope(&|p, f| p.nugget *= f), exact.ln_nugget));
    }
}

#[test]
fn impossible_parameters_of_a_likelihood_are_refused() {
    let sample = Sample::smooth(20, 2, 0.02);
    let parameters = kriging::Parameters {
        mu: 0.0,
        sigma2: 1.0,
        ranges: vec![0.5, 0.5],
        slopes: vec![],
        nugget: 0.0,
    };
    let refused = |change: &dyn Fn(&mut kriging::Parameters)| {
        let mut p = parameters.clone();
        change(&mut p);
        let data = sample.data();
        let function = LogLikelihood::new(&data, Kernel::Matern52, Trend::Constant);
        function.unwrap().evaluate(&p).unwrap_err()
    };
    assert!(matches!(
        refused(&|p| p.ranges.truncate(1)),
        Error::Shape { what: "ranges", .. }
    ));
    for (what, change) in [
        (
            "ranges",
            (|p| p.ranges[1] = 0.0) as fn(&mut kriging::Parameters),
        ),
        ("sigma2", |p| p.sigma2 = f64::NAN),
        ("nugget", |p| p.nugget = -1.0),
    ] {
        assert!(matches!(refused(&change), Error::OutOfRange { what: w, .. } if w == what));
    }
}
