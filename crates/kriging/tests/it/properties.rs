//! Properties that hold for every data set: variances, shifts, permutations, further points.

use kriging::{FitOptions, Kernel, Model, Nugget, Trend, fit};
use proptest::prelude::*;
use stats::streams::{Purpose, stream};

use crate::common::Sample;

/// Random points, smooth values, noise variances spread over `spread` powers of ten.
fn random_sample(seed: u64, n: usize, d: usize, spread: f64) -> Sample {
    let mut rng = stream(seed, Purpose::Test, n as u64, d as u64);
    let x: Vec<f64> = (0..n * d).map(|_| rng.random()).collect();
    let noise: Vec<f64> = (0..n)
        .map(|_| 10.0_f64.powf(-1.0 - spread * rng.random::<f64>()))
        .collect();
    let y = x
        .chunks(d)
        .zip(&noise)
        .map(|(x, v)| {
            let smooth = x.iter().map(|x| (4.0 * x).sin()).sum::<f64>();
            smooth + (12.0 * v).sqrt() * (rng.random::<f64>() - 0.5)
        })
        .collect();
    Sample { x, d, y, noise }
}

fn options(kernel: Kernel, linear: bool) -> FitOptions {
    FitOptions {
        kernel,
        trend: if linear {
            Trend::Linear
        } else {
            Trend::Constant
        },
        starts: 2,
        ..FitOptions::default()
    }
}

fn kernels() -> impl Strategy<Value = Kernel> {
    prop::sample::select(Kernel::ALL.to_vec())
}

/// σ² and the uncertainty of the constant trend: the variance of the prediction far from all data.
fn prior(model: &Model, d: usize) -> f64 {
    model.predict(&vec![1e9; d]).variance
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn variances_lie_between_zero_and_the_prior(
        seed in 0..1000_u64, n in 8..40_usize, d in 1..4_usize, spread in 0.0..8.0_f64,
        kernel in kernels(), at in prop::array::uniform3(-0.5..1.5_f64),
    ) {
        let sample = random_sample(seed, n, d, spread);
        let model = fit(&sample.data(), &options(kernel, false)).unwrap();
        let p = model.predict(&at[..d]);
        prop_assert!(p.mean.is_finite());
        prop_assert!(p.variance >= 0.0);
        prop_assert!(p.variance <= prior(&model, d) * (1.0 + 1e-9));
    }

    #[test]
    fn a_further_point_never_raises_the_variance(
        seed in 0..1000_u64, n in 10..40_usize, spread in 0.0..8.0_f64, kernel in kernels(),
        linear in any::<bool>(), at in prop::array::uniform2(-0.5..1.5_f64),
        new in prop::array::uniform2(-0.2..1.2_f64), y in -5.0..5.0_f64, noise in 0.0..1.0_f64,
    ) {
        let sample = random_sample(seed, n, 2, spread);
        let model = fit(&sample.data(), &options(kernel, linear)).unwrap();
        let data = kriging::Data { x: &new, d: 2, y: &[y], noise_variance: &[noise] };
        let longer = model.with_points(&data).unwrap();
        let (before, after) = (model.predict(&at).variance, longer.predict(&at).variance);
        // Rounding is relative to the process variance; a jitter that had to grow adds itself.
        let sigma2 = model.parameters().sigma2;
        let jitter = |model: &Model| model.warnings().iter().find_map(|w| match w {
            kriging::Warning::Jitter { relative } => Some(*relative),
            _ => None,
        }).unwrap_or(0.0);
        let tolerance = sigma2 * (1e-8 + 10.0 * (jitter(&longer) - jitter(&model)));
        prop_assert!(after <= before + tolerance, "{before} {after}");
    }

    #[test]
    fn shifts_of_y_shift_the_means_alone(
        seed in 0..1000_u64, n in 8..30_usize, shift in -1e4..1e4_f64, kernel in kernels(),
        linear in any::<bool>(),
    ) {
        let sample = random_sample(seed, n, 2, 3.0);
        let mut shifted = sample.clone();
        shifted.y.iter_mut().for_each(|y| *y += shift);
        let model = fit(&sample.data(), &options(kernel, linear)).unwrap();
        let other = fit(&shifted.data(), &options(kernel, linear)).unwrap();
        for x in [[0.5, 0.5], [0.1, 0.8]] {
            let (a, b) = (model.predict(&x), other.predict(&x));
            // The shift costs four digits of y; flat likelihoods let the ranges follow that.
            let tolerance = 1e-2 * a.variance.sqrt() + 1e-6;
            prop_assert!((b.mean - shift - a.mean).abs() < tolerance, "{} {}", a.mean, b.mean - shift);
        }
    }

    #[test]
    fn the_mean_interpolates_as_the_noise_vanishes(
        seed in 0..1000_u64, n in 8..30_usize, kernel in kernels(), linear in any::<bool>(),
    ) {
        let mut sample = random_sample(seed, n, 2, 3.0);
        sample.y = sample.x.chunks(2).map(|x| (4.0 * x[0]).sin() + (4.0 * x[1]).sin()).collect();
        let miss = |noise: f64| {
            let sample = Sample { noise: vec![noise; n], ..sample.clone() };
            let model = fit(&sample.data(), &options(kernel, linear)).unwrap();
            (0..n)
                .map(|i| (model.mean(sample.row(i)) - sample.y[i]).abs())
                .fold(0.0, f64::max)
        };
        // No residual is beyond a few standard deviations of the noise; a jitter of the smoothest
        // kernel adds 1e-8 of a process variance that may be a hundred times the data's.
        prop_assert!(miss(1e-4) < 0.05);
        prop_assert!(miss(1e-8) < 2e-3);
        prop_assert!(miss(0.0) < 1e-3);
    }

    #[test]
    fn permutations_do_not_change_a_bit(
        seed in 0..1000_u64, n in 8..40_usize, step in 1..40_usize, kernel in kernels(),
        linear in any::<bool>(), has_nugget in any::<bool>(),
    ) {
        // A step that is coprime with n visits every point once.
        let coprime = (step..).find(|s| (2..=n).all(|f| n % f != 0 || s % f != 0)).unwrap();
        let order: Vec<usize> = (0..n).map(|i| (i * coprime) % n).collect();
        let sample = random_sample(seed, n, 2, 3.0);
        let nugget = if has_nugget { Nugget::Estimated } else { Nugget::Known };
        let options = FitOptions { nugget, ..options(kernel, linear) };
        let model = fit(&sample.data(), &options).unwrap();
        let other = fit(&sample.pick(&order).data(), &options).unwrap();
        prop_assert_eq!(model.parameters(), other.parameters());
        let x = [0.3, 0.6];
        prop_assert_eq!(model.predict(&x), other.predict(&x));
    }
}
