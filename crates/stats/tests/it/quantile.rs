use rand::RngExt as _;
use rand_distr::{Distribution, Exp1, StandardNormal};
use statrs::function::beta::beta_reg;
use stats::streams::{Purpose, stream};
use stats::{
    ChoiceRule, Error, HarrellDavisVariance, Method, NormalOptions, VarianceFormula, choose,
    exact_bootstrap_variance, harrell_davis, harrell_davis_min_samples, harrell_davis_p90,
    percentile_p90,
};

/// Integral of the beta density from `low` to `high` by Simpson's rule, up to its constant.
fn beta_integral(a: f64, b: f64, low: f64, high: f64) -> f64 {
    let steps = 4000;
    let h = (high - low) / f64::from(steps);
    let density = |t: f64| t.powf(a - 1.0) * (1.0 - t).powf(b - 1.0);
    (0..steps)
        .map(|i| {
            let t = low + h * f64::from(i);
            h / 6.0 * (density(t) + 4.0 * density(t + 0.5 * h) + density(t + h))
        })
        .sum()
}

#[test]
fn harrell_davis_weights_are_integrals_of_the_beta_density() {
    // n = 19: parameters 18 and 2, so that the density is smooth up to 1.
    let samples: Vec<f64> = (0..19).map(|i| f64::from(i * i)).collect();
    let total = beta_integral(18.0, 2.0, 0.0, 1.0);
    let expected: f64 = (0..19)
        .map(|j| {
            let (low, high) = (f64::from(j) / 19.0, f64::from(j + 1) / 19.0);
            samples[j as usize] * beta_integral(18.0, 2.0, low, high) / total
        })
        .sum();
    let ours = harrell_davis_p90(&samples).unwrap();
    // Simpson's error is far below the incomplete beta function's, 1e-12.
    assert!(
        (ours.value - expected).abs() < 1e-9 * expected,
        "{ours:?} {expected}"
    );
}

/// On exponential samples each estimator's bias follows from its definition.
#[test]
fn order_statistics_serve_where_samples_are_skewed() {
    let (truth, repeats, n) = (10.0_f64.ln(), 4000, 100);
    let mut sums = [0.0; 2];
    let (mut squares, mut promised) = (0.0, 0.0);
    for i in 0..repeats {
        let mut rng = stream(32, Purpose::Test, 0, i);
        let sample: Vec<f64> = Distribution::<f64>::sample_iter(Exp1, &mut rng)
            .take(n)
            .collect();
        let davis = harrell_davis_p90(&sample).unwrap();
        sums[0] += percentile_p90(&sample).unwrap().p90;
        sums[1] += davis.value;
        squares += (davis.value - truth).powi(2);
        promised += davis.variance;
    }
    let bias = sums.map(|sum| sum / repeats as f64 - truth);
    // The standard deviation of a P90 here is 0.3, that of a mean of 4000 of them 0.005. Harrell
    // and Davis's estimator averages over ranks worth about 1/(0.1 n) = 0.1. The normal estimator
    // keeps the bias 1 + 1.28 − ln 10 = −0.02 for any number of samples.
    assert!((bias[0] - (2.28 - truth)).abs() < 0.025, "{bias:?}");
    assert!(bias[1].abs() < 0.08, "{bias:?}");
    // The jackknife is known to be conservative, by a tenth or so.
    let ratio = promised / squares;
    assert!((0.85..1.3).contains(&ratio), "{ratio}");
}

/// Compares the bootstrap variance of Harrell and Davis's estimator with actual resampling.
#[test]
fn harrell_and_daviss_bootstrap_variance_is_that_of_resampling() {
    let n = 30;
    let mut rng = stream(34, Purpose::Test, 0, 0);
    let sample: Vec<f64> = Distribution::<f64>::sample_iter(Exp1, &mut rng)
        .take(n)
        .collect();
    let exact = harrell_davis(&sample, 0.9, HarrellDavisVariance::Bootstrap).unwrap();
    let jackknife = harrell_davis_p90(&sample).unwrap();
    assert_eq!(exact.value, jackknife.value);
    assert_ne!(exact.variance, jackknife.variance);
    let (mut sum, mut squares, repeats) = (0.0, 0.0, 20_000);
    for _ in 0..repeats {
        let again: Vec<f64> = (0..n).map(|_| sample[rng.random_range(0..n)]).collect();
        let deviation = harrell_davis_p90(&again).unwrap().value - exact.value;
        sum += deviation;
        squares += deviation * deviation;
    }
    let count = f64::from(repeats);
    let variance = squares / count - (sum / count).powi(2);
    // Five relative standard errors of the simulated variance, each about √(2/20 000) = 1 %.
    assert!(
        (variance / exact.variance - 1.0).abs() < 0.05,
        "{variance} {}",
        exact.variance
    );
}

/// The bootstrap variance of one order statistic also follows from the incomplete beta function
/// alone.
#[test]
fn one_order_statistic_has_the_same_bootstrap_variance_both_ways() {
    for n in [10_usize, 37, 200, 1000] {
        let mut rng = stream(35, Purpose::Test, n as u64, 0);
        let sample: Vec<f64> = Distribution::<f64>::sample_iter(Exp1, &mut rng)
            .take(n)
            .collect();
        let mut weights = vec![0.0; n];
        weights[(9 * n).div_ceil(10) - 1] = 1.0;
        // Resampling puts X₍ⱼ₎ in place r with the probability I(j/n) − I((j − 1)/n), where I is the distribution
        // function of a beta distribution with the parameters r and n − r + 1.
        let (rank, count) = ((9 * n).div_ceil(10) as f64, n as f64);
        let below = |j: usize| beta_reg(rank, count - rank + 1.0, j as f64 / count);
        let mut sorted = sample.clone();
        sorted.sort_by(f64::total_cmp);
        let moment = |power: i32| -> f64 {
            let values = sorted.iter().enumerate();
            values
                .map(|(j, x)| (below(j + 1) - below(j)) * x.powi(power))
                .sum()
        };
        let expected = moment(2) - moment(1).powi(2);
        let found = exact_bootstrap_variance(&sample, &weights).unwrap();
        // The incomplete beta function is good to some 1e-12.
        assert!(
            (found / expected - 1.0).abs() < 1e-9,
            "{n}: {found} {expected}"
        );
    }
}

/// Compares the bootstrap variance with the scatter of the estimate over independent samples.
#[test]
fn the_bootstrap_variance_is_near_the_true_one() {
    let (repeats, n) = (2000, 60);
    let (mut sum, mut squares, mut promised) = (0.0, 0.0, 0.0);
    for i in 0..repeats {
        let mut rng = stream(36, Purpose::Test, 0, i);
        let sample: Vec<f64> = Distribution::<f64>::sample_iter(StandardNormal, &mut rng)
            .take(n)
            .collect();
        let found = harrell_davis(&sample, 0.9, HarrellDavisVariance::Bootstrap).unwrap();
        sum += found.value;
        squares += found.value * found.value;
        promised += found.variance;
    }
    let count = repeats as f64;
    let variance = squares / count - (sum / count).powi(2);
    let ratio = promised / count / variance;
    // Both sides are known to about 3 %; the bootstrap of a quantile is known to err by a tenth.
    assert!((0.85..1.2).contains(&ratio), "{ratio}");
}

#[test]
fn the_rule_follows_normality() {
    let rule = ChoiceRule::default();
    let (mut rejected, repeats) = (0, 1000);
    for i in 0..repeats {
        let mut rng = stream(33, Purpose::Test, 0, i);
        let sample: Vec<f64> = Distribution::<f64>::sample_iter(StandardNormal, &mut rng)
            .take(30)
            .collect();
        let choice = choose(&sample, &rule).unwrap();
        assert_eq!(choice.normal, percentile_p90(&sample).unwrap());
        if choice.chosen.method == Method::Normal {
            assert_eq!(choice.chosen.value, choice.normal.p90);
        } else {
            rejected += 1;
        }
    }
    // Binomial: 50 ± 7, with a tolerance of four standard deviations.
    assert!((22..78).contains(&rejected), "{rejected}");

    let mut rng = stream(34, Purpose::Test, 0, 0);
    let skewed: Vec<f64> = Distribution::<f64>::sample_iter(Exp1, &mut rng)
        .take(100)
        .collect();
    let choice = choose(&skewed, &rule).unwrap();
    assert_eq!(choice.chosen, harrell_davis_p90(&skewed).unwrap());
    assert!(choice.p_value.unwrap() < 0.01);

    let odd = ChoiceRule {
        significance: 1.5,
        ..rule
    };
    assert!(matches!(
        choose(&skewed, &odd),
        Err(Error::OutOfRange { .. })
    ));
    assert!(harrell_davis_p90(&[f64::NAN; 12]).is_err());
}

/// Estimates at other levels, of normal and exponential samples, lie near the truth and scatter by
/// their stated variance.
#[test]
fn every_level_has_its_percentile_and_its_variance() {
    let (repeats, n) = (2000, 120);
    for level in [0.5, 0.75, 0.95, 0.99] {
        let z = stats::normal_quantile(level);
        let options = NormalOptions {
            z,
            variance: VarianceFormula::Exact,
            unbiased: true,
        };
        let of_normal = |sample: &[f64]| {
            let found = stats::normal_p90(sample, &options).unwrap();
            [found.p90, found.variance]
        };
        let of_order = |sample: &[f64]| {
            let found = harrell_davis(sample, level, HarrellDavisVariance::Jackknife).unwrap();
            [found.value, found.variance]
        };
        let mut rows = [[0.0; 3]; 2];
        for i in 0..repeats {
            let mut rng = stream(33, Purpose::Test, 0, i);
            let normal: Vec<f64> = Distribution::<f64>::sample_iter(StandardNormal, &mut rng)
                .take(n)
                .collect();
            let skewed: Vec<f64> = Distribution::<f64>::sample_iter(Exp1, &mut rng)
                .take(n)
                .collect();
            for (row, [value, variance]) in
                rows.iter_mut().zip([of_normal(&normal), of_order(&skewed)])
            {
                row[0] += value / repeats as f64;
                row[1] += value * value / repeats as f64;
                row[2] += variance / repeats as f64;
            }
        }
        let truth = [z, -(1.0 - level).ln()];
        for ([mean, square, stated], truth) in rows.into_iter().zip(truth) {
            let scatter = square - mean * mean;
            // Bootstrap means are biased outwards in a skewed tail, by less than half of their own
            // scatter.
            let bias = (mean - truth).abs() / scatter.sqrt();
            assert!(bias < 0.5, "{level}: {mean} for {truth}");
            // The jackknife overestimates the variance of a far order statistic.
            let ratio = stated / scatter;
            assert!((0.8..1.7).contains(&ratio), "{level}: {ratio}");
        }
    }
    // The level decides from how many samples on there is an order statistic beyond it.
    assert_eq!(
        [0.5, 0.9, 0.95, 0.99].map(harrell_davis_min_samples),
        [3, 10, 20, 100]
    );
    let error = harrell_davis(&[0.0; 19], 0.95, HarrellDavisVariance::Jackknife).unwrap_err();
    assert!(
        matches!(error, Error::TooFewSamples { needed: 20, .. }),
        "{error:?}"
    );
}
