use stats::{Error, mean_sd};

/// NIST Statistical Reference Datasets, univariate summary statistics, "NumAcc1" to "NumAcc4"
/// (<https://www.itl.nist.gov/div898/strd/univ/homepage.html>): certified mean and standard
/// deviation of data made to provoke cancellation.
#[test]
fn nist_numacc_datasets() {
    let alternating = |base: f64| {
        let mut x = vec![base + 0.2];
        for _ in 0..500 {
            x.push(base + 0.1);
            x.push(base + 0.3);
        }
        x
    };
    // Tolerances: the decimals of the input itself are off by half an ulp, 4e-10 at 10⁷.
    let cases = [
        (
            vec![10_000_001.0, 10_000_003.0, 10_000_002.0],
            10_000_002.0,
            1.0,
            1e-15,
        ),
        (alternating(1.0), 1.2, 0.1, 1e-14),
        (alternating(1_000_000.0), 1_000_000.2, 0.1, 1e-9),
        (alternating(10_000_000.0), 10_000_000.2, 0.1, 1e-8),
    ];
    for (x, mean, sd, tolerance) in cases {
        let (m, s) = mean_sd(&x).unwrap();
        assert!((m / mean - 1.0).abs() < 1e-15, "{m} against {mean}");
        assert!((s / sd - 1.0).abs() < tolerance, "{s} against {sd}");
    }
}

#[test]
fn refusals_name_the_sample() {
    assert_eq!(
        mean_sd(&[1.0, 2.0, f64::INFINITY]),
        Err(Error::NonFinite {
            index: 2,
            value: f64::INFINITY
        })
    );
    assert!(matches!(
        mean_sd(&[1.0, f64::NAN]),
        Err(Error::NonFinite { index: 1, .. })
    ));
    assert_eq!(mean_sd(&[1e300, -1e300]), Err(Error::Overflow { n: 2 }));
    assert_eq!(
        mean_sd(&[f64::MAX, f64::MIN]),
        Err(Error::Overflow { n: 2 })
    );
}
