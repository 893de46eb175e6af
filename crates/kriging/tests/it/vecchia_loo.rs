//! Validation and calibration of nearest-neighbour models.

use kriging::{FitOptions, Surrogate, Vecchia, VecchiaOptions, fit, fit_vecchia};

use crate::common::{Sample, written};

fn sparse(neighbours: usize) -> VecchiaOptions {
    VecchiaOptions {
        prediction_neighbours: neighbours,
        ..VecchiaOptions::default()
    }
}

#[test]
fn residuals_are_those_of_predictions_without_the_point() {
    let sample = Sample::smooth(200, 2, 0.02);
    let model = fit_vecchia(&sample.data(), &sparse(60)).unwrap();
    let loo = model.leave_one_out();
    let text = written(model.clone());
    for i in [0, 17, 150] {
        // The same model without the point, made from its file: the observation gets so much noise
        // that it carries no information. It still takes one of the neighbours' places, hence 61.
        let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
        let firsts = value["model"]["first_observation"].as_array().unwrap();
        let place = firsts.iter().position(|f| *f == i).unwrap();
        value["model"]["noise_variance"][place] = 1e12.into();
        value["neighbours"] = 61.into();
        let without = Surrogate::from_json(&value.to_string()).unwrap();
        let p = without.vecchia().unwrap().predict(sample.row(i));
        assert!((loo.residuals[i] - (sample.y[i] - p.mean)).abs() < 1e-7);
        let standardised = loo.residuals[i] / (p.variance + sample.noise[i]).sqrt();
        assert!((loo.standardised[i] - standardised).abs() < 1e-6);
    }
}

#[test]
fn neighbours_validate_as_the_whole_model_does() {
    let sample = Sample::smooth(300, 2, 0.05);
    let exact = fit(&sample.data(), &FitOptions::default())
        .unwrap()
        .leave_one_out();
    let local = fit_vecchia(&sample.data(), &sparse(100)).unwrap();
    let loo = local.leave_one_out();
    assert!(
        (loo.q2 - exact.q2).abs() < 0.1 * (1.0 - exact.q2),
        "{}",
        loo.q2
    );
    assert!((loo.coverage90 - exact.coverage90).abs() < 0.02);
    assert_eq!(loo.residuals.len(), 300);
}

#[test]
fn calibration_widens_the_intervals_of_a_ridge() {
    let ridge = |x: &[f64]| {
        (x[0] - 0.3).powi(2) + x[1] * x[1] + 0.8 * (-((x[0] + x[1] - 1.0) / 0.05).powi(2)).exp()
    };
    let of = |n: usize| {
        let mut sample = Sample::smooth(n, 2, 0.0);
        sample.y = sample.x.chunks(2).map(ridge).collect();
        sample.noise.fill(1e-4);
        sample
    };
    let (train, test) = (of(150), of(1000));
    for options in [sparse(60), VecchiaOptions::default()] {
        let plain = fit_vecchia(&train.data(), &options).unwrap();
        let model = plain.clone().calibrated();
        let coverage = |model: &Vecchia| {
            let inside = (0..1000).filter(|&i| {
                let p = model.predict(test.row(i));
                (test.y[i] - p.mean).abs() <= 1.6449 * p.variance.sqrt()
            });
            inside.count() as f64 / 1000.0
        };
        assert_eq!(plain.calibration(), 1.0);
        assert!(model.calibration() > 1.0);
        let after = coverage(&model);
        // Binomial standard error: 0.01 for the points, 0.025 for the 150 residuals of the calibration.
        assert!((after - 0.9).abs() < 0.07, "{after} {}", coverage(&plain));
        assert!((model.leave_one_out().coverage90 - 0.9).abs() < 0.02);
        let again = Surrogate::from_json(&written(model.clone())).unwrap();
        assert_eq!(again.calibration(), model.calibration());
        assert_eq!(
            again.vecchia().unwrap().predict(&[0.4, 0.4]),
            model.predict(&[0.4, 0.4])
        );
    }
}
