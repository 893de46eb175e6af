//! Variance reduction: each estimator against the truth, and its own variance against the scatter of
//! many repetitions.

use rand_distr::{Distribution as _, StandardNormal};
use stats::streams::{Purpose, stream};
use stats::{
    Control, EXACT_Z90, Error, Sampling, control_variate_p90, grouped_p90, normal_coefficients,
    normal_p90,
};

/// Mean and variance.
fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, squares / (n - 1.0))
}

const REPEATS: usize = 20_000;
/// Relative standard error of a variance from [`REPEATS`] normal repetitions: √(2/20 000) = 1 %.
const OF_VARIANCE: f64 = 0.01;

#[test]
fn a_control_variate_is_unbiased_and_knows_its_variance() {
    // y = 3 + 2 c + ε, c ~ N(1, 0.5²), ε ~ N(0, σ_ε²): σ² = 1 + σ_ε².
    for (n, noise) in [(10, 0.3), (30, 0.3), (30, 1.5), (100, 0.1)] {
        let truth = (1.0_f64 + noise * noise).sqrt();
        let control = Control { mean: 1.0, sd: 0.5 };
        let (mut means, mut squares, mut p90s) = (vec![], vec![], vec![]);
        let (mut of_means, mut of_sds, mut of_p90s, mut plain) = (0.0, 0.0, 0.0, vec![]);
        let mut sds = vec![];
        for i in 0..REPEATS as u64 {
            let mut rng = stream(1, Purpose::Test, n as u64, i);
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let c: Vec<f64> = (0..n).map(|_| 1.0 + 0.5 * normal()).collect();
            let y: Vec<f64> = c.iter().map(|c| 3.0 + 2.0 * c + noise * normal()).collect();
            let e = control_variate_p90(&y, &c, control, EXACT_Z90).unwrap();
            means.push(e.mean);
            squares.push(e.sd * e.sd);
            sds.push(e.sd);
            p90s.push(e.p90);
            of_means += e.mean_variance / REPEATS as f64;
            of_sds += e.sd_variance / REPEATS as f64;
            of_p90s += e.variance / REPEATS as f64;
            let (mean, variance) = moments(&y);
            plain.push(mean + EXACT_Z90 * variance.sqrt());
        }
        let error = |variance: f64| 4.0 * (variance / REPEATS as f64).sqrt();
        let (mean, variance) = moments(&means);
        assert!((mean - 5.0).abs() < error(variance), "n {n}: mean {mean}");
        assert!(
            (of_means / variance - 1.0).abs() < 4.0 * OF_VARIANCE,
            "{of_means} {variance}"
        );
        let (square, spread) = moments(&squares);
        assert!(
            (square - truth * truth).abs() < error(spread),
            "n {n}: variance {square}"
        );
        // The root is linearised: an error of order 1/n.
        let linear = 4.0 * OF_VARIANCE + 1.0 / n as f64;
        let (_, variance) = moments(&sds);
        assert!(
            (of_sds / variance - 1.0).abs() < linear,
            "n {n}: {of_sds} {variance}"
        );
        let (p90, variance) = moments(&p90s);
        assert!(
            (of_p90s / variance - 1.0).abs() < linear,
            "n {n}: {of_p90s} {variance}"
        );
        // The stated bias of the root.
        let bias = -EXACT_Z90 * spread / (8.0 * truth.powi(3));
        let expected = 5.0 + EXACT_Z90 * truth + bias;
        let slack = error(variance) + 0.3 * bias.abs();
        assert!((p90 - expected).abs() < slack, "n {n}: {p90} {expected}");
        // The benefit, with ρ² = 0.92 at σ_ε = 0.3: less than a quarter of the variance.
        if noise == 0.3 && n == 30 {
            let (_, without) = moments(&plain);
            assert!(variance < 0.25 * without, "{variance} {without}");
        }
    }
}

/// Regression test: when y did not depend on c, σ̂² could be negative; the percentile was then the
/// mean, with the variance of a mean, and an enrichment took such designs for the best.
#[test]
fn a_negative_variance_gives_the_plain_percentile() {
    let control = Control { mean: 0.0, sd: 3.0 };
    let mut seen = 0;
    for i in 0..2000 {
        let mut rng = stream(3, Purpose::Test, 0, i);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let c: Vec<f64> = (0..10).map(|_| normal()).collect();
        let y: Vec<f64> = (0..10).map(|_| 5.0 + normal()).collect();
        let e = control_variate_p90(&y, &c, control, EXACT_Z90).unwrap();
        assert!(e.sd > 0.0 && e.sd_variance > 0.0);
        if e.slope == 0.0 {
            let (mean, variance) = moments(&y);
            assert!((e.p90 - mean - EXACT_Z90 * variance.sqrt()).abs() < 1e-12);
            assert!(e.variance > 0.5 * e.sd * e.sd / 10.0);
            seen += 1;
        }
    }
    assert!(seen > 20, "{seen}");
}

#[test]
fn controls_that_cannot_serve_are_refused() {
    let y = [1.0, 2.0, 3.0, 5.0];
    let control = Control { mean: 0.0, sd: 1.0 };
    let refused = |y: &[f64], c: &[f64], control: Control, z: f64| {
        control_variate_p90(y, c, control, z).unwrap_err()
    };
    assert!(matches!(
        refused(&y[..3], &y[..3], control, 1.28),
        Error::TooFewSamples { .. }
    ));
    assert!(matches!(
        refused(&y, &y[..3], control, 1.28),
        Error::OutOfRange { .. }
    ));
    assert!(matches!(
        refused(&y, &[1.0; 4], control, 1.28),
        Error::Constant { .. }
    ));
    assert!(matches!(
        refused(&y, &y, control, f64::NAN),
        Error::OutOfRange { .. }
    ));
    let flat = Control { mean: 0.0, sd: 0.0 };
    assert!(matches!(
        refused(&y, &y, flat, 1.28),
        Error::OutOfRange { .. }
    ));
    let nan = [1.0, f64::NAN, 2.0, 3.0];
    assert!(matches!(
        refused(&nan, &y, control, 1.28),
        Error::NonFinite { .. }
    ));
}

/// A response like that of wear: mostly linear in the coefficients, a little curved.
fn response(x: &[f64]) -> f64 {
    let linear = x[0] + 0.5 * x[1] - 0.3 * x[2] + 0.2 * x[3] + 0.1 * x[4];
    10.0 + linear + 0.15 * x[0] * x[0] + 0.1 * x[1] * x[2]
}

#[test]
fn grouped_coefficients_are_unbiased_and_know_their_variance() {
    // E y = 10.15; Var y = 1 + .25 + .09 + .04 + .01 + 2 · .15² + .1².
    let (mean, sd) = (10.15, 1.445_f64.sqrt());
    let k = 32;
    let repeats = 4000;
    let mut scatter = vec![];
    for sampling in [
        Sampling::Independent,
        Sampling::Antithetic,
        Sampling::Quasi { group: 4 },
        Sampling::Quasi { group: 8 },
    ] {
        let (mut means, mut squares, mut p90s, mut own) = (vec![], vec![], vec![], 0.0);
        for design in 0..repeats {
            let y: Vec<f64> = (0..k)
                .map(|i| normal_coefficients(sampling, 5, Purpose::Test, design, i, 5).unwrap())
                .map(|x| response(&x))
                .collect();
            let e = grouped_p90(&y, sampling.group(), EXACT_Z90).unwrap();
            means.push(e.mean);
            squares.push(e.sd * e.sd);
            p90s.push(e.p90);
            own += e.variance / repeats as f64;
        }
        let error = |variance: f64| 4.0 * (variance / repeats as f64).sqrt();
        let (m, of_mean) = moments(&means);
        assert!((m - mean).abs() < error(of_mean), "{sampling:?}: {m}");
        let (s2, of_square) = moments(&squares);
        assert!(
            (s2 - sd * sd).abs() < error(of_square),
            "{sampling:?}: {s2}"
        );
        let (p90, variance) = moments(&p90s);
        let bias = -EXACT_Z90 * of_square / (8.0 * sd.powi(3));
        let expected = mean + EXACT_Z90 * sd + bias;
        let slack = error(variance) + 0.5 * bias.abs();
        assert!(
            (p90 - expected).abs() < slack,
            "{sampling:?}: {p90} {expected}"
        );
        // The jackknife overestimates by about 1/R, and scatters by √(2/4000) = 2 %.
        let ratio = own / variance;
        let groups = k as f64 / sampling.group() as f64;
        assert!(
            ratio > 0.92 && ratio < 1.1 + 1.2 / groups,
            "{sampling:?}: {ratio}"
        );
        scatter.push((of_mean, variance));
    }
    // A mostly linear response: the mean gains most.
    assert!(scatter[1].0 < 0.1 * scatter[0].0, "{scatter:?}");
    assert!(scatter[3].0 < 0.35 * scatter[0].0, "{scatter:?}");
    assert!(
        scatter[1].1 < scatter[0].1 && scatter[3].1 < scatter[0].1,
        "{scatter:?}"
    );
}

#[test]
fn coefficients_are_standard_normal_and_named() {
    for sampling in [
        Sampling::Independent,
        Sampling::Antithetic,
        Sampling::Quasi { group: 16 },
    ] {
        let draw =
            |sample: u64| normal_coefficients(sampling, 9, Purpose::Test, 3, sample, 12).unwrap();
        let all: Vec<f64> = (0..4000).flat_map(draw).collect();
        let (mean, variance) = moments(&all);
        // 48 000 numbers; the dependence within a group only makes the error smaller.
        assert!(
            mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03,
            "{mean} {variance}"
        );
        assert_eq!(draw(17), draw(17));
        assert_ne!(draw(17), draw(18));
    }
    let pair =
        |sample| normal_coefficients(Sampling::Antithetic, 9, Purpose::Test, 3, sample, 3).unwrap();
    assert!(pair(6).iter().zip(&pair(7)).all(|(a, b)| *a == -*b));
    // A scrambled sequence of 16 has one coefficient in each sixteenth of the probability.
    let quasi = Sampling::Quasi { group: 16 };
    let mut column: Vec<f64> = (32..48)
        .map(|i| normal_coefficients(quasi, 9, Purpose::Test, 3, i, 12).unwrap()[7])
        .collect();
    column.sort_by(f64::total_cmp);
    // The quartiles ∓0.674490 and the median divide them evenly.
    for (count, quartile) in [(4, -0.674490), (8, 0.0), (12, 0.674490)] {
        assert_eq!(column.iter().filter(|x| **x < quartile).count(), count);
    }
    for (group, count) in [(1, 3), (1 << 17, 3), (8, 257)] {
        let quasi = Sampling::Quasi { group };
        assert!(normal_coefficients(quasi, 0, Purpose::Test, 0, 0, count).is_err());
    }
}

#[test]
fn groups_of_one_give_the_plain_percentile() {
    let y = [4.0, 1.0, 3.5, 2.0, 2.5, 6.0, 3.0, 2.2];
    let grouped = grouped_p90(&y, 1, 1.28).unwrap();
    let plain = normal_p90(&y, &Default::default()).unwrap();
    assert!((grouped.p90 - plain.p90).abs() < 1e-12);
    assert!((grouped.sd - plain.sd).abs() < 1e-12);
    // Far from zero no digit is lost.
    let far: Vec<f64> = y.iter().map(|y| y + 1e9).collect();
    assert!((grouped_p90(&far, 1, 1.28).unwrap().p90 - 1e9 - plain.p90).abs() < 1e-5);
    assert!(grouped_p90(&y, 0, 1.28).is_err());
    assert!(grouped_p90(&y, 3, 1.28).is_err());
    assert!(matches!(
        grouped_p90(&y, 4, 1.28),
        Err(Error::TooFewSamples { needed: 16, .. })
    ));
    assert!(grouped_p90(&y, 1, f64::INFINITY).is_err());
}
