//! Percentiles from order statistics: the definition and the limits. The stability atlas of the crate `lab` has the
//! coverage of the intervals.

use rand::RngExt as _;
use stats::streams::{Purpose, stream};
use stats::{Error, order_statistic, paired_difference};

/// The confidence of all intervals here.
const CONFIDENCE: f64 = 0.95;

/// Definition 8 of Hyndman and Fan by hand: the rank of the level 0.9 in 1 … 10 is 31/3 · 0.9 + 1/3 = 9.6333.
#[test]
fn the_percentile_is_hyndman_and_fans_eighth_definition() {
    let samples: Vec<f64> = (1..=10).rev().map(f64::from).collect();
    let found = order_statistic(&samples, 0.9, CONFIDENCE).unwrap();
    assert!((found.value - (9.3 + 1.0 / 3.0)).abs() < 1e-12, "{found:?}");
    let median = order_statistic(&samples, 0.5, CONFIDENCE).unwrap();
    assert!((median.value - 5.5).abs() < 1e-12);
}

/// The median of ten samples lies below X₍₂₎ with the probability 11/1024 and below X₍₃₎ with 56/1024. Nyblom's
/// weights for a tail of 0.025 between the two are worked out here for samples 1 … 10.
#[test]
fn limits_are_interpolated_between_exact_ranks() {
    let samples: Vec<f64> = (1..=10).map(f64::from).collect();
    let found = order_statistic(&samples, 0.5, CONFIDENCE).unwrap();
    let (low, high) = found.interval.unwrap();
    let share = (0.025 - 11.0 / 1024.0) / (45.0 / 1024.0);
    let expected = 2.0 + share * 8.0 / (share * 8.0 + (1.0 - share) * 2.0);
    assert!((low - expected).abs() < 1e-9, "{low} {expected}");
    assert!((low + high - 11.0).abs() < 1e-9, "{low} {high}");
}

#[test]
fn infinite_samples_count_as_the_largest() {
    let mut samples: Vec<f64> = (0..100).map(f64::from).collect();
    samples[3] = f64::INFINITY;
    let found = order_statistic(&samples, 0.9, CONFIDENCE).unwrap();
    assert!(
        found.value.is_finite() && found.interval.unwrap().1.is_finite(),
        "{found:?}"
    );
    samples[10..20].fill(f64::INFINITY);
    let found = order_statistic(&samples, 0.9, CONFIDENCE).unwrap();
    assert_eq!(found.interval.unwrap().1, f64::INFINITY);
    samples[0] = f64::NAN;
    assert!(matches!(
        order_statistic(&samples, 0.9, CONFIDENCE),
        Err(Error::NonFinite { index: 0, .. })
    ));
}

/// An interval without an upper end says so, and a difference from it has none either.
#[test]
fn open_intervals_have_no_finite_difference() {
    let mut failing: Vec<f64> = (0..100).map(f64::from).collect();
    failing[10..15].fill(f64::INFINITY);
    let sound: Vec<f64> = (0..100).map(|i| f64::from(i) + 0.5).collect();
    let open = order_statistic(&failing, 0.9, CONFIDENCE).unwrap();
    assert!(open.value.is_finite() && open.interval.unwrap().1 == f64::INFINITY);
    for (first, second, end) in [
        (&failing, &sound, f64::INFINITY),
        (&sound, &failing, f64::NEG_INFINITY),
    ] {
        let difference = paired_difference(first, second, 0.9, CONFIDENCE).unwrap();
        let (low, high) = difference.unwrap().interval.unwrap();
        assert!(low < 0.0 && high > 0.0, "{low} {high}");
        assert!([low, high].contains(&end), "{low} {high}");
    }
    // The same for small values.
    let negative: Vec<f64> = failing.iter().map(|sample| -sample).collect();
    let open = order_statistic(&negative, 0.1, CONFIDENCE).unwrap();
    assert_eq!(open.interval.unwrap().0, f64::NEG_INFINITY);
    // A percentile that is infinite itself is worse than any finite one below its interval.
    failing[10..60].fill(f64::INFINITY);
    let difference = paired_difference(&failing, &sound, 0.9, CONFIDENCE).unwrap();
    assert_eq!(
        difference.unwrap().interval,
        Some((f64::INFINITY, f64::INFINITY))
    );
}

/// A design against itself, and against one that is worse by the same in every sample.
#[test]
fn percentiles_of_samples_that_differ_by_a_constant_differ_by_it() {
    // Multiples of 2⁻¹⁰, so that differences are exact.
    let samples: Vec<f64> = (0..100).map(|i| f64::from(i * i) / 1024.0).collect();
    let worse: Vec<f64> = samples.iter().map(|sample| sample + 0.5).collect();
    for (second, expected) in [(&samples, 0.0), (&worse, -0.5)] {
        let difference = paired_difference(&samples, second, 0.9, CONFIDENCE).unwrap();
        assert_eq!(difference.unwrap().interval, Some((expected, expected)));
    }
}

/// Samples that are all equal have a percentile, and an interval of no width.
#[test]
fn equal_samples_have_an_interval_of_one_point() {
    let found = order_statistic(&[2.5; 50], 0.9, CONFIDENCE).unwrap();
    assert_eq!((found.value, found.interval), (2.5, Some((2.5, 2.5))));
    let mut rng = stream(9, Purpose::Test, 0, 0);
    let other: Vec<f64> = (0..50).map(|_| rng.random()).collect();
    let difference = paired_difference(&[2.5; 50], &other, 0.9, CONFIDENCE).unwrap();
    assert!(difference.unwrap().value > 1.5);
}
