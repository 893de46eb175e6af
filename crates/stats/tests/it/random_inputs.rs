//! Distributions of random inputs: their quantiles against tables, their means against the mean of the quantiles, and
//! correlated scores.

use stats::streams::{Purpose, stream};
use stats::{Copula, Family, Marginal, main_effect, normal_quantile, normal_scores};

/// A family with parameters, and its mean, standard deviation and 90 % quantile, in closed form or, for the beta
/// distribution, by bisection.
const CASES: [(Family, &[f64], [f64; 3]); 8] = [
    (Family::Normal, &[10.0, 2.0], [10.0, 2.0, 12.563_103]),
    // exp(µ + 1.281552 s) with s² = ln 1.04 and µ = ln 10 − s²/2.
    (Family::Lognormal, &[10.0, 2.0], [10.0, 2.0, 12.638_858]),
    (Family::Uniform, &[2.0, 6.0], [4.0, 1.154_701, 5.6]),
    // 6 − √(0.1 · 4 · 3)
    (
        Family::Triangular,
        &[2.0, 3.0, 6.0],
        [3.666_667, 0.849_837, 4.904_555],
    ),
    // 3 √π/2, 3 √(1 − π/4), 3 √ln 10
    (
        Family::Weibull,
        &[2.0, 3.0],
        [2.658_681, 1.389_749, 4.552_281],
    ),
    // The quantile is the mode plus the scale times −ln(−ln 0.9).
    (Family::Gumbel, &[10.0, 2.0], [10.0, 2.0, 12.609_102]),
    // 2 + 4/3, 4 √(2/63), 2 + 4 x with 1 − (1 − x)⁵ − 5 x (1 − x)⁴ = 0.9
    (
        Family::Beta,
        &[2.0, 4.0, 2.0, 6.0],
        [3.333_333, 0.712697, 4.335561],
    ),
    (
        Family::TruncatedNormal,
        &[0.0, 1.0, 0.0, 2.0],
        [0.722790, 0.501315, 1.472262],
    ),
];

#[test]
fn quantiles_and_moments_are_those_of_the_tables() {
    let z90 = normal_quantile(0.9);
    for (family, parameters, [mean, sd, p90]) in CASES {
        let marginal = Marginal::new(family, parameters, &[]).unwrap();
        assert!(
            (marginal.mean() - mean).abs() < 2e-6,
            "{family:?} {}",
            marginal.mean()
        );
        let found = marginal.quantile(z90);
        assert!((found - p90).abs() < 2e-6 * p90, "{family:?} {found}");
        let n = 200_000;
        let values: Vec<f64> = (0..n)
            .map(|i| marginal.quantile(normal_quantile((f64::from(i) + 0.5) / f64::from(n))))
            .collect();
        let (of_mean, of_sd) = stats::mean_sd(&values).unwrap();
        assert!((of_mean - mean).abs() < 1e-4, "{family:?} {of_mean}");
        assert!((of_sd - sd).abs() < 2e-3, "{family:?} {of_sd}");
        for z in [-40.0, 40.0] {
            assert!(marginal.quantile(z).is_finite(), "{family:?} {z}");
        }
    }
}

/// Beyond 8 standard deviations Φ(x) has no digits left. The median of X given a < X < b is that of an
/// exponential variable beyond a, ln 2/a from it, less about ln 2/a³.
#[test]
fn a_normal_variable_cut_far_in_its_tail_stays_near_the_near_end() {
    for a in [9.0, 20.0, 29.0, 31.0, 60.0] {
        let far: f64 = 120.0;
        let [above, below] = [[0.0, 1.0, a, far], [0.0, 1.0, -far, -a]]
            .map(|parameters| Marginal::new(Family::TruncatedNormal, &parameters, &[]).unwrap());
        let distance = above.quantile(0.0) - a;
        assert!(
            (distance * a / 2.0_f64.ln() - 1.0).abs() < 2.0 / (a * a),
            "{a}: {distance}"
        );
        assert!(
            (above.mean() - a) * a > 0.97 && (above.mean() - a) * a < 1.0 + 1e-9,
            "{a}"
        );
        for z in [-3.0, -0.5, 0.0, 0.5, 3.0] {
            assert_eq!(above.quantile(z), -below.quantile(-z), "{a} {z}");
            assert!(
                above.quantile(z) > a && above.quantile(z) < a + 1.0,
                "{a} {z}"
            );
        }
        assert_eq!(above.mean(), -below.mean());
    }
    // The two formulas meet at 30.
    let at = |a: f64| {
        let cut = Marginal::new(Family::TruncatedNormal, &[0.0, 1.0, a, 40.0], &[]).unwrap();
        (cut.quantile(1.0) - a) * a
    };
    assert!((at(29.999) / at(30.001) - 1.0).abs() < 3e-3);
}

#[test]
fn a_table_gives_its_values_with_equal_probabilities() {
    let values = [1.0, 2.0, 2.0, 7.0];
    let table = Marginal::new(Family::Table, &[], &values).unwrap();
    let at = |u: f64| table.quantile(normal_quantile(u));
    assert_eq!([at(0.1), at(0.3), at(0.6), at(0.76)], [1.0, 2.0, 2.0, 7.0]);
    assert_eq!((table.mean(), table.quantile(9.0)), (3.0, 7.0));
}

#[test]
fn parameters_without_a_distribution_have_none() {
    for (family, parameters) in [
        (Family::Normal, &[1.0, -1.0][..]),
        (Family::Normal, &[f64::NAN, 1.0]),
        (Family::Lognormal, &[-1.0, 1.0]),
        (Family::Lognormal, &[1.0, -1.0]),
        (Family::Lognormal, &[0.0, 0.0]),
        (Family::Lognormal, &[-1.0, 0.0]),
        (Family::Uniform, &[2.0, 1.0]),
        (Family::Triangular, &[1.0, 5.0, 4.0]),
        (Family::Weibull, &[0.0, 1.0]),
        (Family::Gumbel, &[0.0, -1.0]),
        (Family::Beta, &[1.0, 1.0, 3.0, 2.0]),
        (Family::TruncatedNormal, &[0.0, 1.0, 2.0, 2.0]),
        (Family::Table, &[]),
    ] {
        assert!(
            Marginal::new(family, parameters, &[]).is_none(),
            "{family:?}"
        );
    }
    for values in [&[1.0][..], &[f64::NEG_INFINITY, 1.0], &[1.0, f64::NAN]] {
        assert!(
            Marginal::new(Family::Table, &[], values).is_none(),
            "{values:?}"
        );
    }
    // A standard deviation of zero, as of a tolerance of zero.
    for family in [Family::Normal, Family::Lognormal, Family::Gumbel] {
        let exact = Marginal::new(family, &[3.0, 0.0], &[]).unwrap();
        assert_eq!((exact.quantile(2.0), exact.mean()), (3.0, 3.0));
    }
}

#[test]
fn correlated_scores_have_their_correlations() {
    let matrix = [[1.0, 0.5, -0.3], [0.5, 1.0, 0.2], [-0.3, 0.2, 1.0]];
    let copula = Copula::new(3, |i, j| matrix[i][j]).unwrap();
    let n = 100_000_u32;
    let mut sums = [[0.0; 3]; 3];
    for sample in 0..n {
        let mut rng = stream(5, Purpose::Test, 0, sample.into());
        let z = copula.correlated(&normal_scores(&mut rng, 3));
        for i in 0..3 {
            for j in 0..3 {
                sums[i][j] += z[i] * z[j] / f64::from(n);
            }
        }
    }
    for i in 0..3 {
        for j in 0..3 {
            assert!((sums[i][j] - matrix[i][j]).abs() < 0.015, "{sums:?}");
        }
    }
    assert_eq!(Copula::new(2, |_, _| 1.0), None);
    let impossible = [[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]];
    assert_eq!(Copula::new(3, |i, j| impossible[i][j]), None);
}

/// y = 2 a + b² + noise: the variances are 4, 2 and 1.
#[test]
fn main_effects_are_first_order_sobol_indices() {
    for (n, tolerance) in [(400, 0.09), (10_000, 0.02)] {
        let mut columns = [const { Vec::new() }; 3];
        let mut output = Vec::new();
        for sample in 0..n {
            let z = normal_scores(&mut stream(6, Purpose::Test, 0, sample), 4);
            for (column, z) in columns.iter_mut().zip(&z) {
                column.push(*z);
            }
            output.push(2.0 * z[0] + z[1] * z[1] + z[3]);
        }
        let found = columns.map(|column| main_effect(&column, &output).unwrap());
        for (found, expected) in found.iter().zip([4.0 / 7.0, 2.0 / 7.0, 0.0]) {
            assert!((found - expected).abs() < tolerance, "{n}: {found:?}");
        }
    }
    assert_eq!(main_effect(&[1.0; 200], &[2.0; 200]), None);
    assert_eq!(main_effect(&[1.0; 50], &[2.0; 50]), None);
}
