//! Objectives that are themselves random.

use super::{cube, options, rng};
use cmaes::{CmaEs, Error, UncertaintyHandling};
use rand::RngExt as _;
use stats::streams::StreamRng;

const SAMPLES: usize = 30_000;

fn sphere(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum()
}

/// The sphere with noise of standard deviation 1, the mean of `samples` draws.
fn noisy(x: &[f64], samples: usize, rng: &mut StreamRng) -> f64 {
    // A uniform distribution of variance 1; the mean of several is nearly normal.
    let half = 3.0_f64.sqrt();
    let noise: f64 = (0..samples).map(|_| rng.random_range(-half..half)).sum();
    sphere(x) + noise / samples as f64
}

/// The true value at the mean after 30 000 samples.
fn plain(seed: u64) -> f64 {
    let mut search = CmaEs::new(&[3.0; 6], options(cube(-5.0, 5.0, 6))).unwrap();
    let (mut rng, mut noise) = (rng(seed), rng(1000 + seed));
    for _ in 0..SAMPLES / 10 {
        let candidates = search.ask(&mut rng);
        let values: Vec<f64> = candidates.iter().map(|x| noisy(x, 1, &mut noise)).collect();
        search.tell(&values).unwrap();
    }
    sphere(&search.mean())
}

fn handled(seed: u64) -> (f64, usize) {
    let mut search = CmaEs::new(&[3.0; 6], options(cube(-5.0, 5.0, 6))).unwrap();
    let mut handling = UncertaintyHandling::new(200);
    let (mut rng, mut noise) = (rng(seed), rng(1000 + seed));
    let (mut spent, mut most) = (0, 0);
    while spent < SAMPLES {
        let candidates = search.ask(&mut rng);
        let samples = handling.samples();
        most = most.max(samples);
        let mut evaluate = |x: &Vec<f64>| {
            spent += samples;
            noisy(x, samples, &mut noise)
        };
        let values: Vec<f64> = candidates.iter().map(&mut evaluate).collect();
        let again = UncertaintyHandling::reevaluations(candidates.len());
        let again: Vec<f64> = candidates[..again].iter().map(&mut evaluate).collect();
        search.tell_twice(&values, &again, &mut handling).unwrap();
    }
    (sphere(&search.mean()), most)
}

/// The same number of samples, the same noise; the median over 11 seeds.
#[test]
fn uncertainty_handling_ends_nearer_to_the_optimum_than_the_plain_search() {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let without = median((0..11).map(plain).collect());
    let with = median((0..11).map(|seed| handled(seed).0).collect());
    assert!(with < 0.5 * without, "{with} with, {without} without");
    assert!((0..11).all(|seed| handled(seed).1 > 10));
}

#[test]
fn without_noise_nothing_is_repeated_and_nothing_slows_down() {
    let mut search = CmaEs::new(&[3.0; 6], options(cube(-5.0, 5.0, 6))).unwrap();
    let mut handling = UncertaintyHandling::new(200);
    let mut rng = rng(1);
    while search.stop().is_none() && search.evaluations() < 5000 {
        let values: Vec<f64> = search.ask(&mut rng).iter().map(|x| sphere(x)).collect();
        search
            .tell_twice(&values, &values[..2], &mut handling)
            .unwrap();
        assert_eq!(handling.samples(), 1);
        assert!(handling.measure() <= 0.0);
    }
    assert!(search.best().unwrap().1.value < 1e-9);
}

#[test]
fn second_evaluations_must_be_of_candidates() {
    let mut search = CmaEs::new(&[3.0; 6], options(cube(-5.0, 5.0, 6))).unwrap();
    let mut handling = UncertaintyHandling::new(4);
    search.ask(&mut rng(1));
    for got in [0, 11] {
        let error = search.tell_twice(&[1.0; 10], &vec![1.0; got], &mut handling);
        assert_eq!(error, Err(Error::Reevaluations { expected: 10, got }));
    }
    search
        .tell_twice(&[1.0; 10], &[1.0; 2], &mut handling)
        .unwrap();
}
