//! Warnings of a fit about its parameters.

use kriging::{FitOptions, Model, Surrogate, VecchiaOptions, Warning, fit, fit_vecchia};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::common::{Sample, written};

fn few(warnings: &[Warning]) -> Option<(usize, usize)> {
    warnings.iter().find_map(|w| match w {
        Warning::FewPoints {
            distinct,
            parameters,
        } => Some((*distinct, *parameters)),
        _ => None,
    })
}

#[test]
fn fewer_than_two_points_per_parameter_are_few() {
    // d ranges, σ² and μ; twice that is enough.
    for (d, n, expected) in [
        (20, 25, Some((25, 22))),
        (1, 5, Some((5, 3))),
        (1, 6, None),
        (2, 7, Some((7, 4))),
        (2, 8, None),
        // One range for all.
        (6, 5, Some((5, 3))),
    ] {
        let sample = Sample::smooth(n, d, 0.01);
        let exact = fit(&sample.data(), &FitOptions::default()).unwrap();
        assert_eq!(few(exact.warnings()), expected, "{d} {n}");
        let near = fit_vecchia(&sample.data(), &VecchiaOptions::default()).unwrap();
        assert_eq!(few(near.warnings()), expected, "{d} {n}");
    }
    // A nugget is one more, and repeated observations are no further points.
    let indices: Vec<usize> = (0..9).chain(0..9).collect();
    let sample = Sample::smooth(9, 2, 0.01).pick(&indices);
    let options = FitOptions {
        nugget: kriging::Nugget::Estimated,
        ..FitOptions::default()
    };
    let model = fit(&sample.data(), &options).unwrap();
    assert_eq!(few(model.warnings()), Some((9, 5)));
}

fn pure_noise() -> Sample {
    let mut sample = Sample::smooth(80, 3, 0.0);
    let mut rng = stream(5, Purpose::Test, 0, 0);
    sample.y.iter_mut().for_each(|y| *y = rng.random::<f64>());
    sample.noise.fill(1.0 / 12.0);
    sample
}

#[test]
fn variances_at_their_bounds_are_reported() {
    // Uniform numbers scatter less than the noise variance stated for them.
    let mut sample = pure_noise();
    sample.noise.fill(1.0);
    let has = |model: &Model, wanted: &Warning| model.warnings().contains(wanted);
    let lower = Warning::ProcessVarianceAtBound { upper: false };
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    assert!(has(&model, &lower), "{:?}", model.warnings());
    // Exact observations of a smooth function leave nothing for a nugget.
    let with_nugget = FitOptions {
        nugget: kriging::Nugget::Estimated,
        ..FitOptions::default()
    };
    let smooth = Sample::smooth(80, 2, 0.0);
    let model = fit(&smooth.data(), &with_nugget).unwrap();
    let lower = Warning::NuggetAtBound { upper: false };
    assert!(has(&model, &lower), "{:?}", model.parameters());
    // Ordinary data give no warning.
    let model = fit(&Sample::smooth(80, 2, 0.05).data(), &FitOptions::default()).unwrap();
    assert_eq!(model.warnings(), []);
}

#[test]
fn nearest_neighbours_warn_as_the_exact_model_does() {
    let sparse = VecchiaOptions {
        ..VecchiaOptions::default()
    };
    let mut repeated: Vec<usize> = (0..80).collect();
    repeated.push(3);
    // Pure noise; a coordinate without influence; a cluster that makes the matrix singular.
    let mut idle = Sample::smooth(120, 3, 0.01);
    for i in 0..120 {
        idle.y[i] = (4.0 * idle.x[3 * i]).sin() + idle.x[3 * i + 1].powi(2);
    }
    let mut cluster = Sample::smooth(60, 2, 0.0);
    for i in 0..30 {
        cluster.x[2 * i] = 0.4 + 1e-9 * i as f64;
        cluster.x[2 * i + 1] = 0.4;
        cluster.y[i] = cluster.y[59];
    }
    for (sample, options) in [
        (pure_noise(), VecchiaOptions::default()),
        (pure_noise(), sparse.clone()),
        (pure_noise().pick(&repeated), sparse.clone()),
        (idle.clone(), VecchiaOptions::default()),
        (idle, sparse.clone()),
        (cluster.clone(), VecchiaOptions::default()),
        (cluster, sparse),
    ] {
        let exact = fit(&sample.data(), &FitOptions::default()).unwrap();
        let model = fit_vecchia(&sample.data(), &options).unwrap();
        assert!(!exact.warnings().is_empty());
        for warning in exact.warnings() {
            let kind = std::mem::discriminant(warning);
            assert!(
                model
                    .warnings()
                    .iter()
                    .any(|w| std::mem::discriminant(w) == kind),
                "{warning:?} is missing in {:?}",
                model.warnings()
            );
        }
        let again = Surrogate::from_json(&written(model.clone())).unwrap();
        assert_eq!(again.warnings(), model.warnings());
    }
}
