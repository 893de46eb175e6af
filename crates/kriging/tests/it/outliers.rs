//! Gross errors among the observations are named, clean data are not suspected.

use kriging::{FitOptions, Outlier, VecchiaOptions, Warning, fit, fit_vecchia};
use rand::RngExt as _;
use stats::streams::{Purpose, StreamRng, stream};

use crate::common::{Sample, read, written};

fn normal(rng: &mut StreamRng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}

/// A smooth function with normal noise of variance 0.01.
fn clean(n: usize, seed: u64) -> Sample {
    let mut rng = stream(seed, Purpose::Test, n as u64, 40);
    let x: Vec<f64> = (0..2 * n).map(|_| rng.random()).collect();
    let wave = |x: &[f64]| 2.0 * (3.0 * x[0]).sin() + (2.0 * x[1]).cos();
    Sample {
        y: x.chunks(2)
            .map(|x| wave(x) + 0.1 * normal(&mut rng))
            .collect(),
        x,
        d: 2,
        noise: vec![0.01; n],
    }
}

fn named(warnings: &[Warning]) -> Option<(usize, &[Outlier])> {
    warnings.iter().find_map(|w| match w {
        Warning::Outliers { count, worst } => Some((*count, worst.as_slice())),
        _ => None,
    })
}

#[test]
fn clean_data_raise_no_alarm() {
    for seed in 0..25 {
        let sample = clean(60, seed);
        let model = fit(&sample.data(), &FitOptions::default()).unwrap();
        assert_eq!(named(model.warnings()), None, "{seed}");
        let model = fit_vecchia(&sample.data(), &VecchiaOptions::default()).unwrap();
        assert_eq!(named(model.warnings()), None, "{seed}");
    }
}

#[test]
fn gross_errors_are_named_the_worst_first() {
    let mut sample = clean(120, 100);
    sample.y[57] += 50.0;
    sample.y[3] -= 30.0;
    let sparse = VecchiaOptions {
        ..VecchiaOptions::default()
    };
    let models = [
        fit(&sample.data(), &FitOptions::default())
            .unwrap()
            .warnings()
            .to_vec(),
        fit_vecchia(&sample.data(), &VecchiaOptions::default())
            .unwrap()
            .warnings()
            .to_vec(),
        fit_vecchia(&sample.data(), &sparse)
            .unwrap()
            .warnings()
            .to_vec(),
    ];
    for warnings in models {
        let (count, worst) = named(&warnings).unwrap();
        assert_eq!((count, worst.len()), (2, 2));
        assert_eq!((worst[0].observation, worst[1].observation), (57, 3));
        assert!(worst[0].standardised > 5.0 && worst[1].standardised < -4.5);
        let text = warnings
            .iter()
            .find(|w| matches!(w, Warning::Outliers { .. }))
            .unwrap()
            .to_string();
        assert!(
            text.contains("observation 57") && text.contains("observation 3"),
            "{text}"
        );
    }
}

#[test]
fn no_more_than_ten_are_listed() {
    let mut sample = clean(400, 7);
    for i in 0..12 {
        sample.y[20 * i] += 40.0;
    }
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    let (count, worst) = named(model.warnings()).unwrap();
    assert_eq!((count, worst.len()), (12, 10));
    let text = model
        .warnings()
        .iter()
        .map(ToString::to_string)
        .collect::<String>();
    assert!(text.contains("and 2 more"), "{text}");
    assert_eq!(model.leave_one_out().outliers().len(), 12);
    // The warning is stored with the model.
    let again = read(&written(model.clone())).unwrap();
    assert_eq!(again.warnings(), model.warnings());
}
