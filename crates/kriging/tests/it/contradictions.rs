//! Observations of one place that differ by more than their noise permits, and the nugget that
//! explains them.

use kriging::{Error, FitOptions, Model, Warning, fit};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::common::{DenseKriging, Sample};

fn with_nugget() -> FitOptions {
    FitOptions {
        nugget: kriging::Nugget::Estimated,
        ..FitOptions::default()
    }
}

/// A sample with one more observation, `away` from observation 7 in both coordinates and `off` in y.
fn doubled(noise: f64, away: f64, off: f64) -> Sample {
    let mut indices: Vec<usize> = (0..40).collect();
    indices.push(7);
    let mut sample = Sample::smooth(40, 2, noise).pick(&indices);
    sample.x[80] += away;
    sample.x[81] += away;
    sample.y[40] += off;
    sample
}

fn contradictory(model: &Model) -> Option<(usize, f64)> {
    model.warnings().iter().find_map(|w| match w {
        Warning::ContradictoryDuplicates { points, sd } => Some((*points, *sd)),
        _ => None,
    })
}

#[test]
fn the_worst_of_several_contradictions_is_named_whatever_the_order() {
    let mut sample = doubled(0.0, 1e-11, 0.7);
    sample.x.extend([sample.x[6] + 1e-11, sample.x[7]]);
    sample.y.push(sample.y[3] - 2.0);
    sample.noise.push(0.0);
    let pair = |sample: &Sample| match fit(&sample.data(), &FitOptions::default()) {
        Err(Error::Contradiction { first, second, .. }) => [first, second],
        other => panic!("{other:?}"),
    };
    assert_eq!(pair(&sample), [3, 41]);
    let reversed: Vec<usize> = (0..42).rev().collect();
    assert_eq!(pair(&sample.pick(&reversed)), [0, 38]);
}

#[test]
fn what_noise_distance_or_size_explains_is_no_contradiction() {
    // Noise that permits the difference; a difference that jitter absorbs.
    for (noise, off) in [(0.1, 1.0), (0.0, 1e-4)] {
        let model = fit(&doubled(noise, 1e-10, off).data(), &FitOptions::default()).unwrap();
        let base = Sample::smooth(40, 2, noise);
        let base = fit(&base.data(), &FitOptions::default()).unwrap();
        let p = base.predict(&[0.6, 0.4]);
        let tolerance = 0.05 + p.variance.sqrt();
        assert!(
            (model.mean(&[0.6, 0.4]) - p.mean).abs() < tolerance,
            "{off}"
        );
    }
    // A larger distance explains it, too: the steep function between the points is interpolated.
    let steep = doubled(0.0, 1e-3, 0.05);
    let model = fit(&steep.data(), &FitOptions::default()).unwrap();
    for i in [7, 40] {
        assert!((model.mean(steep.row(i)) - steep.y[i]).abs() < 1e-5);
    }
}

#[test]
fn an_estimated_nugget_explains_contradictions() {
    // Each of 30 places is observed twice, 1e-10 apart or at the very same point, with noise of
    // variance 0.09 that the data do not state.
    let mut rng = stream(31, Purpose::Test, 0, 0);
    for away in [1e-10, 0.0] {
        let once = Sample::smooth(60, 2, 0.0);
        let indices: Vec<usize> = (0..60).chain(0..60).collect();
        let mut sample = once.pick(&indices);
        for y in &mut sample.y {
            *y += 0.3 * 12.0_f64.sqrt() * (rng.random::<f64>() - 0.5);
        }
        sample.x[120..].iter_mut().for_each(|x| *x += away);
        let model = fit(&sample.data(), &with_nugget()).unwrap();
        let nugget = model.parameters().nugget;
        // The standard error of a variance from 60 differences of uniform numbers is 15 %.
        assert!((nugget - 0.09).abs() < 0.04, "{away}: {nugget}");
        assert_eq!(contradictory(&model), None);
        let squares: f64 = (0..60)
            .map(|i| (model.mean(once.row(i)) - once.y[i]).powi(2))
            .sum();
        // The mean of two observations has a standard deviation of 0.21.
        assert!((squares / 60.0).sqrt() < 0.25, "{squares}");
    }
}

#[test]
fn the_scatter_of_repeated_observations_informs_the_nugget() {
    // Unequal known noise, repeated points: the dense formulas do not merge.
    let mut indices: Vec<usize> = (0..25).collect();
    indices.extend([4, 4, 9, 9, 9, 13]);
    let mut sample = Sample::smooth(25, 2, 0.05).pick(&indices);
    for (i, off) in [0.7, -0.9, 0.4, 1.0, -0.3, 0.5].into_iter().enumerate() {
        sample.y[25 + i] += off;
        sample.noise[25 + i] *= 1.0 + 0.3 * off;
    }
    let model = fit(&sample.data(), &with_nugget()).unwrap();
    let parameters = model.parameters();
    assert!(parameters.nugget > 0.01, "{parameters:?}");
    let dense = DenseKriging::new(model.kernel(), &sample, parameters);
    let error = model.negative_log_likelihood() - dense.negative_log_likelihood();
    assert!(error.abs() < 1e-8, "{error}");
    let (mean, variance) = dense.predict(&[0.5, 0.5]);
    let p = model.predict(&[0.5, 0.5]);
    assert!((p.mean - mean).abs() < 1e-8 && (p.variance - variance).abs() < 1e-8);

    // The nugget is at its optimum: twice and half as much are less likely.
    for factor in [0.5, 2.0] {
        let mut other = parameters.clone();
        other.nugget *= factor;
        let there = DenseKriging::new(model.kernel(), &sample, &other).negative_log_likelihood();
        assert!(there > model.negative_log_likelihood(), "{factor}");
    }

    // More observations of the same points stay apart, too.
    let first: Vec<usize> = (0..28).collect();
    let rest: Vec<usize> = (28..31).collect();
    let part = fit(&sample.pick(&first).data(), &with_nugget()).unwrap();
    let whole = part.with_points(&sample.pick(&rest).data()).unwrap();
    let dense = DenseKriging::new(whole.kernel(), &sample, whole.parameters());
    let error = whole.negative_log_likelihood() - dense.negative_log_likelihood();
    assert!(error.abs() < 1e-8, "{error}");
}

#[test]
fn a_row_given_twice_does_not_tell_that_there_is_no_nugget() {
    let mut rng = stream(32, Purpose::Test, 0, 0);
    let mut sample = Sample::smooth(100, 2, 0.0);
    for y in &mut sample.y {
        *y += 0.3 * 12.0_f64.sqrt() * (rng.random::<f64>() - 0.5);
    }
    let once = fit(&sample.data(), &with_nugget()).unwrap();
    let indices: Vec<usize> = (0..100).chain([3, 50]).collect();
    let twice = fit(&sample.pick(&indices).data(), &with_nugget()).unwrap();
    assert_eq!(once.parameters(), twice.parameters());
    assert!((once.parameters().nugget - 0.09).abs() < 0.04);
}

#[test]
fn duplicates_whose_tiny_noise_cannot_explain_them_are_named() {
    // A noise of 1e-12 against a difference of 0.6.
    let sample = doubled(1e-12, 0.0, 0.6);
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    let (points, sd) = contradictory(&model).unwrap();
    // Two values 0.6 apart: variance 0.18.
    assert_eq!(points, 1);
    assert!((sd - 0.18_f64.sqrt()).abs() < 1e-3, "{sd}");
    // The point's mean counts with half of that variance.
    let mut merged = Sample::smooth(40, 2, 1e-12);
    merged.y[7] += 0.3;
    merged.noise[7] = 0.09;
    let same = fit(&merged.data(), &FitOptions::default()).unwrap();
    for x in [[0.5, 0.5], [0.2, 0.8]] {
        assert!((model.mean(&x) - same.mean(&x)).abs() < 1e-4);
    }
    // A difference that the noise permits gives no warning.
    let honest = doubled(0.04, 0.0, 0.6);
    let model = fit(&honest.data(), &FitOptions::default()).unwrap();
    assert_eq!(contradictory(&model), None);
}

/// A noise-free observation replaces the noisy ones of its point only if they agree with it.
#[test]
fn noisy_observations_may_contradict_an_exact_one() {
    for (off, contradicts) in [(0.3, false), (3.0, true)] {
        let mut sample = doubled(0.0, 0.0, off);
        sample.noise[40] = 0.01;
        let model = fit(&sample.data(), &FitOptions::default()).unwrap();
        assert_eq!(contradictory(&model).is_some(), contradicts, "{off}");
        let at = model.mean(sample.row(7)) - sample.y[7];
        // The exact observation is reproduced, or the model lies between the two.
        assert_eq!(at.abs() < 1e-6, !contradicts, "{off}: {at}");
    }
}

#[test]
fn further_observations_may_contradict_the_model() {
    let sample = Sample::smooth(40, 2, 0.0);
    let model = fit(&sample.data(), &FitOptions::default()).unwrap();
    let twin = |off: f64| {
        let mut twin = sample.pick(&[7]);
        twin.x[0] += 1e-11;
        twin.y[0] += off;
        model.with_points(&twin.data())
    };
    assert!(twin(0.0).is_ok());
    assert!(matches!(
        twin(1.5),
        Err(Error::Contradiction {
            first: 7,
            second: 40,
            ..
        })
    ));
}
