use rand_distr::{Distribution, StandardNormal};
use stats::streams::{Purpose, stream};
use stats::{PAPER_Z90, Percentile, percentile_interval, percentile_p90, percentile_variance};

/// Mean, SD and P90 of the paper's Table 1, and var(P90) for k = 30 of its Table 2.
const PAPER: [(f64, f64, f64, f64); 4] = [
    (5.82, 0.41, 6.34, 0.010),
    (6.22, 0.66, 7.06, 0.027),
    (7.30, 0.44, 7.87, 0.012),
    (6.66, 0.45, 7.24, 0.013),
];

#[test]
fn table_2_follows_from_table_1() {
    for (mean, sd, p90, variance) in PAPER {
        let ours = percentile_variance(sd * sd, 30, PAPER_Z90).unwrap();
        // Table 2 prints three decimals, rounded half up.
        assert!(
            (ours - variance).abs() <= 0.0005,
            "{ours} against {variance}"
        );
        // Table 1's mean, SD and P90 are each rounded to two decimals: ±0.005 (1 + 1.28 + 1).
        assert!(
            (mean + PAPER_Z90 * sd - p90).abs() < 0.0165,
            "{mean} {sd}: {p90}"
        );
    }
}

#[test]
fn the_estimate_is_mean_plus_z_sd() {
    let p = percentile_p90(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
    let sd = 2.5_f64.sqrt();
    assert_eq!(p.n, 5);
    assert!((p.mean - 3.0).abs() < 1e-15);
    assert!((p.sd - sd).abs() < 1e-15);
    assert!((p.p90 - (3.0 + 1.28 * sd)).abs() < 1e-15);
    // (14) as printed: 2.5 [1/5 + 0.8192 (1 − √(2/4))].
    assert!((p.variance - 2.5 * (0.2 + 0.8192 * (1.0 - 0.5_f64.sqrt()))).abs() < 1e-14);
}

/// Compares (14), a first-order expansion, with the variance of m + 1.28 s over many samples.
#[test]
fn variance_and_interval_agree_with_simulation() {
    let (k, repeats) = (30, 40_000);
    let (mut sum, mut squares, mut covered) = (0.0, 0.0, 0);
    let truth = PAPER_Z90;
    for i in 0..repeats {
        let mut rng = stream(2009, Purpose::Test, 1, i);
        let sample: Vec<f64> = Distribution::<f64>::sample_iter(StandardNormal, &mut rng)
            .take(k)
            .collect();
        let p = percentile_p90(&sample).unwrap();
        sum += p.p90;
        squares += p.p90 * p.p90;
        let (low, high) = percentile_interval(&p, 0.9).unwrap();
        covered += usize::from(low <= truth && truth <= high);
    }
    let count = repeats as f64;
    let variance = squares / count - (sum / count).powi(2);
    let formula = percentile_variance(1.0, k, PAPER_Z90).unwrap();
    // Three simulation errors of √(2/40000) = 0.7 %; the expansion itself is within 1 %.
    assert!(
        (variance / formula - 1.0).abs() < 0.03,
        "{variance} against {formula}"
    );
    // Three simulation errors of 0.15 %, plus the documented 0.1 % of missing coverage.
    let coverage = covered as f64 / count;
    assert!((coverage - 0.9).abs() < 0.006, "{coverage}");
}

#[test]
fn the_interval_uses_student_quantiles() {
    let p = Percentile {
        n: 30,
        mean: 0.0,
        sd: 1.0,
        p90: 10.0,
        variance: 4.0,
    };
    // t(0.975; 29) = 2.04523 in any table.
    let (low, high) = percentile_interval(&p, 0.95).unwrap();
    assert!((low - (10.0 - 2.0 * 2.04523)).abs() < 2e-5, "{low}");
    assert!((high - (10.0 + 2.0 * 2.04523)).abs() < 2e-5, "{high}");
}

#[test]
fn refusals() {
    assert!(percentile_variance(-1.0, 30, 1.28).is_err());
    assert!(percentile_variance(f64::NAN, 30, 1.28).is_err());
    assert!(percentile_variance(1.0, 30, f64::NAN).is_err());
    assert_eq!(
        percentile_p90(&[1.0, f64::NAN, 3.0, 4.0])
            .unwrap_err()
            .to_string(),
        "sample 1 is NaN, every sample must be a finite number"
    );
    let p = percentile_p90(&[1.0; 4]).unwrap();
    for confidence in [0.0, 1.0, -0.1, f64::NAN] {
        assert!(percentile_interval(&p, confidence).is_err());
    }
}
