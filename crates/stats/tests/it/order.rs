//! Percentiles from order statistics: the definition, and the coverage of the intervals.

use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use stats::reference::Reference;
use stats::streams::{Purpose, stream};
use stats::{Error, order_interval_min_samples, order_statistic, paired_difference};

/// The confidence of all intervals here.
const CONFIDENCE: f64 = 0.95;

/// Definition 8 of Hyndman and Fan by hand: of 1 … 10 at 0.9 the rank is 31/3 · 0.9 + 1/3 = 9.6333.
#[test]
fn the_percentile_is_hyndman_and_fans_eighth_definition() {
    let samples: Vec<f64> = (1..=10).rev().map(f64::from).collect();
    let found = order_statistic(&samples, 0.9, CONFIDENCE).unwrap();
    assert!((found.value - (9.3 + 1.0 / 3.0)).abs() < 1e-12, "{found:?}");
    let median = order_statistic(&samples, 0.5, CONFIDENCE).unwrap();
    assert!((median.value - 5.5).abs() < 1e-12);
}

/// P(B ≤ 0) with B binomial (n, 0.1) falls below 2.5 % at n = 36: ln 0.025 / ln 0.9 = 35.01.
#[test]
fn an_interval_that_no_order_statistic_reaches_is_not_given() {
    for (level, needed) in [(0.9, 36), (0.1, 36), (0.5, 6), (0.99, 368), (0.999, 3688)] {
        assert_eq!(order_interval_min_samples(level, CONFIDENCE), needed);
        for n in [needed - 1, needed] {
            let samples: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).sin()).collect();
            let found = order_statistic(&samples, level, CONFIDENCE).unwrap();
            assert_eq!(found.interval.is_some(), n == needed, "{level} {n}");
        }
    }
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

/// The binomial standard error of a coverage of 95 % from 4000 repetitions is 0.34 %.
#[test]
fn intervals_cover_what_they_promise_whatever_the_distribution() {
    for law in Reference::ALL {
        for (level, n) in [(0.9, 40), (0.9, 500), (0.1, 60), (0.5, 15), (0.99, 500)] {
            let truth = law.quantile(level);
            let repeats = 4000;
            let covered = (0..repeats).filter(|repeat| {
                let mut rng = stream(7, Purpose::Test, n as u64, *repeat);
                let samples: Vec<f64> = (0..n).map(|_| law.draw(&mut rng)).collect();
                let found = order_statistic(&samples, level, CONFIDENCE).unwrap();
                let (low, high) = found.interval.unwrap();
                low <= truth && truth <= high
            });
            let coverage = covered.count() as f64 / repeats as f64;
            let name = law.name();
            assert!(
                (0.937..0.97).contains(&coverage),
                "{name} {level} {n}: {coverage}"
            );
        }
    }
}

/// Two responses of one random number, of which the second is less spread: the difference of their
/// percentiles is known, and its interval is narrower than one from separate samples.
#[test]
fn a_difference_from_shared_random_numbers_has_its_own_interval() {
    let (level, n, repeats) = (0.9, 400, 2000);
    let law = Reference::Exponential;
    let truth = 0.1 * law.quantile(level);
    let (mut covered, mut paired, mut separate) = (0, 0.0, 0.0);
    for repeat in 0..repeats {
        let mut rng = stream(8, Purpose::Test, 0, repeat);
        let (mut first, mut second) = (Vec::new(), Vec::new());
        for _ in 0..n {
            let shared = law.draw(&mut rng);
            let own: f64 = StandardNormal.sample(&mut rng);
            first.push(shared);
            second.push(0.9 * shared + 0.05 * own);
        }
        // The second response's own noise raises its percentile by about 0.05²/2 of its density's slope.
        let found = paired_difference(&first, &second, level, CONFIDENCE).unwrap();
        let (low, high) = found.unwrap().interval.unwrap();
        covered += u32::from(low <= truth && truth <= high);
        let alone = order_statistic(&first, level, CONFIDENCE).unwrap();
        let alone = alone.interval.unwrap();
        paired += high - low;
        separate += alone.1 - alone.0;
    }
    let coverage = f64::from(covered) / repeats as f64;
    assert!((0.93..0.99).contains(&coverage), "{coverage}");
    // Separate samples would make the interval √2 times as wide as that of one percentile.
    assert!(paired < 0.7 * separate, "{paired} {separate}");
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
