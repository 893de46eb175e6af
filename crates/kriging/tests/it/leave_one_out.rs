use kriging::{FitOptions, fit};

use crate::common::{DenseKriging, Sample};

#[test]
fn closed_form_equals_brute_force() {
    let sample = Sample::smooth(30, 2, 0.05);
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    let loo = model.leave_one_out();
    let mut squares = 0.0;
    for i in 0..30 {
        let rest = sample.without(i);
        let dense = DenseKriging::new(model.kernel(), &rest, model.parameters());
        let (mean, variance) = dense.predict(sample.row(i));
        let residual = sample.y[i] - mean;
        let standardised = residual / (variance + sample.noise[i]).sqrt();
        // Rounding times the condition of the matrix.
        assert!(
            (loo.residuals[i] - residual).abs() < 1e-8,
            "{i}: {residual}"
        );
        assert!(
            (loo.standardised[i] - standardised).abs() < 1e-7,
            "{i}: {standardised}"
        );
        squares += residual * residual;
    }
    assert!((loo.rmse - (squares / 30.0).sqrt()).abs() < 1e-8);
    let mean = sample.y.iter().sum::<f64>() / 30.0;
    let total: f64 = sample.y.iter().map(|y| (y - mean).powi(2)).sum();
    assert!((loo.q2 - (1.0 - squares / total)).abs() < 1e-9);
    let covered = loo.standardised.iter().filter(|z| z.abs() < 1.6449).count();
    assert_eq!(loo.coverage90, covered as f64 / 30.0);
}

#[test]
fn standardised_residuals_of_a_right_model_are_standard() {
    let sample = Sample::smooth(300, 2, 0.05);
    let loo = fit(&sample.data(), &FitOptions::default())
        .unwrap()
        .leave_one_out();
    let squares = loo.standardised.iter().map(|z| z * z).sum::<f64>() / 300.0;
    // χ² with 300 degrees of freedom has a relative deviation of 8 %; three of them.
    assert!((squares - 1.0).abs() < 0.25, "{squares}");
    assert!((loo.coverage90 - 0.9).abs() < 0.06, "{}", loo.coverage90);
}
