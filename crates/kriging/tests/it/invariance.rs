use kriging::{Data, FitOptions, Kernel, fit};
use proptest::prelude::*;

use crate::common::{Sample, written};

#[test]
fn the_order_of_observations_does_not_change_a_bit() {
    // More points than the screening subset holds.
    let sample = Sample::smooth(320, 2, 0.05);
    let order: Vec<usize> = (0..320).map(|i| (i * 77 + 5) % 320).collect();
    let shuffled = sample.pick(&order);
    let options = FitOptions {
        starts: 4,
        ..FitOptions::default()
    };
    let model = fit(&sample.data(), &options).unwrap();
    let other = fit(&shuffled.data(), &options).unwrap();
    assert_eq!(model.parameters(), other.parameters());
    assert_eq!(model.predict(&[0.3, 0.6]), other.predict(&[0.3, 0.6]));
    // Leave-one-out results follow the observations.
    let (a, b) = (model.leave_one_out(), other.leave_one_out());
    for (i, &from) in order.iter().enumerate() {
        assert_eq!(b.residuals[i], a.residuals[from]);
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let sample = Sample::smooth(60, 3, 0.05);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| written(fit(&sample.data(), &FitOptions::default()).unwrap()))
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn seeds_lead_to_the_same_optimum() {
    let sample = Sample::smooth(350, 3, 0.05);
    let nll: Vec<f64> = (0..4)
        .map(|seed| {
            let options = FitOptions {
                seed,
                starts: 5,
                ..FitOptions::default()
            };
            fit(&sample.data(), &options)
                .unwrap()
                .negative_log_likelihood()
        })
        .collect();
    assert!(nll.iter().all(|v| (v - nll[0]).abs() < 1e-4), "{nll:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Affine changes of the units of x and y change the predictions accordingly and nothing else.
    #[test]
    fn units_do_not_matter(
        x_unit in -12.0..12.0_f64, x_shift in -100.0..100.0_f64,
        y_unit in -40.0..40.0_f64, y_shift in -1000.0..1000.0_f64,
        kernel in prop::sample::select(Kernel::ALL.to_vec()),
    ) {
        let (x_unit, y_unit) = (10.0_f64.powf(x_unit), 10.0_f64.powf(y_unit));
        let sample = Sample::smooth(25, 2, 0.05);
        let options = FitOptions { kernel, starts: 3, ..FitOptions::default() };
        let model = fit(&sample.data(), &options).unwrap();

        // Only the first coordinate changes its unit.
        let to = |x: &[f64]| [x_unit * (x[0] + x_shift), x[1]];
        let x: Vec<f64> = sample.x.chunks(2).flat_map(to).collect();
        let y: Vec<f64> = sample.y.iter().map(|y| y_unit * (y + y_shift)).collect();
        let noise: Vec<f64> = sample.noise.iter().map(|v| v * y_unit * y_unit).collect();
        let other = fit(&Data { x: &x, d: 2, y: &y, noise_variance: &noise }, &options).unwrap();

        // The search ends within 1e-6 of the optimum of the likelihood, from where predictions are
        // off by the square root of that at most.
        for point in [[0.5, 0.5], [0.1, 0.9], [1.2, -0.3]] {
            let ours = model.predict(&point);
            let theirs = other.predict(&to(&point));
            let sd = ours.variance.sqrt();
            prop_assert!((theirs.mean / y_unit - y_shift - ours.mean).abs() < 1e-2 * sd);
            let ratio = theirs.variance / (y_unit * y_unit * ours.variance);
            prop_assert!((ratio - 1.0).abs() < 1e-2, "{ratio}");
        }
        let shift = 25.0 * y_unit.ln();
        let error = other.negative_log_likelihood() - shift - model.negative_log_likelihood();
        prop_assert!(error.abs() < 1e-5, "{error}");
    }
}
