use rand::Rng as _;
use rand_distr::{Distribution, Exp1, StandardNormal};
use stats::streams::{Purpose, StreamRng, stream};
use stats::{Error, lilliefors};

fn rejections(design: u64, n: usize, level: f64, draw: impl Fn(&mut StreamRng) -> f64) -> f64 {
    let repeats = 20_000;
    let rejected = (0..repeats)
        .filter(|&i| {
            let mut rng = stream(2009, Purpose::Test, design, i);
            let sample: Vec<f64> = (0..n).map(|_| draw(&mut rng)).collect();
            lilliefors(&sample).unwrap().p_value <= level
        })
        .count();
    rejected as f64 / repeats as f64
}

fn normal(rng: &mut StreamRng) -> f64 {
    3.0 + 0.2 * Distribution::<f64>::sample(&StandardNormal, rng)
}

#[test]
fn normal_samples_are_rejected_at_the_nominal_rate() {
    for (n, level) in [
        (4, 0.05),
        (5, 0.05),
        (30, 0.01),
        (30, 0.05),
        (30, 0.10),
        (30, 0.5),
        (500, 0.05),
    ] {
        let rate = rejections(10 + n as u64, n, level, normal);
        // Three simulation errors, plus 3 % for the approximation of the p-value.
        let tolerance = 3.0 * (level * (1.0 - level) / 20_000.0).sqrt() + 0.03 * level;
        assert!(
            (rate - level).abs() < tolerance,
            "n {n} level {level}: {rate}"
        );
    }
}

#[test]
fn other_distributions_are_found_out() {
    // The test is known for its power against skewed data and its weakness against symmetric data
    // with short tails.
    let exponential = rejections(20, 30, 0.05, |rng| Distribution::<f64>::sample(&Exp1, rng));
    assert!(exponential > 0.7, "{exponential}");
    let uniform = rejections(21, 30, 0.05, |rng| (rng.next_u64() >> 11) as f64);
    assert!(uniform > 0.1 && uniform < exponential, "{uniform}");
}

#[test]
fn the_statistic_is_the_largest_distance() {
    // 1…5: z = ∓1.264911, ∓0.632456, 0. The largest gap is at the second point, 2/5 − Φ(−0.632456),
    // Φ(−0.632456) = 0.263545 (tables), against 1/5 − Φ(−1.264911) = 0.2 − 0.102951.
    let outcome = lilliefors(&[5.0, 3.0, 1.0, 2.0, 4.0]).unwrap();
    assert!(
        (outcome.statistic - 0.136455).abs() < 2e-6,
        "{}",
        outcome.statistic
    );
    assert!(outcome.p_value > 0.9);
}

#[test]
fn units_and_order_do_not_matter() {
    let mut rng = stream(1, Purpose::Test, 0, 0);
    let sample: Vec<f64> = (0..30).map(|_| normal(&mut rng)).collect();
    let outcome = lilliefors(&sample).unwrap();
    let other: Vec<f64> = sample.iter().rev().map(|x| -1e6 * x + 17.0).collect();
    assert!((lilliefors(&other).unwrap().statistic - outcome.statistic).abs() < 1e-12);
}

#[test]
fn a_sample_that_is_nan_is_refused() {
    assert!(matches!(
        lilliefors(&[1.0, 2.0, 3.0, 4.0, f64::NAN]),
        Err(Error::NonFinite { index: 4, .. })
    ));
}
