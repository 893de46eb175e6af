use rand_distr::{Distribution, StandardNormal};
use stats::streams::{Purpose, stream};
use stats::{
    EXACT_Z90, Error, NormalOptions, PAPER_Z90, VarianceFormula, c4, exact_percentile_variance,
    normal_p90, percentile_p90, percentile_variance, sd_bias,
};

#[test]
fn c4_is_that_of_the_tables() {
    // Any table of control-chart constants, such as E. L. Grant, R. S. Leavenworth, "Statistical
    // Quality Control", table C (0.9213, 0.9400, 0.9515, 0.9727, …), with the digits of the gamma
    // functions; rounding in those leaves 1e-14.
    for (k, value) in [
        (4, 0.9213177319235613),
        (5, 0.9399856029866254),
        (6, 0.9515328619481445),
        (10, 0.9726592741215884),
        (41, 0.9937701371246289),
        (100, 0.9974779760712635),
    ] {
        assert!(
            (c4(k).unwrap() - value).abs() < 3e-14,
            "{k}: {}",
            c4(k).unwrap()
        );
    }
    // 1 − 1/(4k) − 7/(32k²) − 19/(128k³), to k⁻⁴.
    let k = 10_000.0_f64;
    let series = 1.0 - 0.25 / k - 7.0 / 32.0 / (k * k) - 19.0 / 128.0 / (k * k * k);
    assert!((c4(10_000).unwrap() - series).abs() < 1e-14);
    assert!(matches!(c4(3), Err(Error::TooFewSamples { got: 3, .. })));
}

#[test]
fn taylor_and_exact_variances_agree_for_many_samples() {
    for (k, tolerance) in [(4, 0.3), (30, 2e-2), (1000, 1e-3), (100_000, 1e-5)] {
        let taylor = percentile_variance(2.0, k, PAPER_Z90).unwrap();
        let exact = exact_percentile_variance(2.0, k, PAPER_Z90).unwrap();
        assert!(
            (taylor / exact - 1.0).abs() < tolerance,
            "{k}: {taylor} {exact}"
        );
    }
    assert!(exact_percentile_variance(-1.0, 10, 1.28).is_err());
    assert!(exact_percentile_variance(1.0, 10, f64::NAN).is_err());
}

#[test]
fn moments_agree_with_simulation() {
    let (k, repeats) = (6, 200_000);
    let estimate = |unbiased| NormalOptions {
        z: EXACT_Z90,
        variance: VarianceFormula::Exact,
        unbiased,
    };
    let (mut plain, mut corrected, mut squares, mut promised) = (0.0, 0.0, 0.0, 0.0);
    for i in 0..repeats {
        let mut rng = stream(2009, Purpose::Test, 2, i);
        let sample: Vec<f64> = Distribution::<f64>::sample_iter(StandardNormal, &mut rng)
            .take(k)
            .collect();
        let p = normal_p90(&sample, &estimate(false)).unwrap();
        plain += p.p90;
        squares += p.p90 * p.p90;
        promised += p.variance;
        corrected += normal_p90(&sample, &estimate(true)).unwrap().p90;
    }
    let count = repeats as f64;
    let variance = squares / count - (plain / count).powi(2);
    let exact = exact_percentile_variance(1.0, k, EXACT_Z90).unwrap();
    // Standard errors: of a mean √(0.32/200 000) = 0.0013, of a variance 0.32 √(2/200 000) = 0.001.
    // The tolerances are four of them.
    assert!((variance - exact).abs() < 0.004, "{variance} {exact}");
    assert!((promised / count - exact).abs() < 0.004);
    let bias = EXACT_Z90 * sd_bias(1.0, k).unwrap();
    assert!((plain / count - EXACT_Z90 - bias).abs() < 0.005);
    assert!((corrected / count - EXACT_Z90).abs() < 0.005);
    // Taylor's variance is off by more than that error here.
    assert!((percentile_variance(1.0, k, EXACT_Z90).unwrap() - exact).abs() > 0.01);
}

#[test]
fn the_default_is_the_papers_percentile() {
    let samples = [1.0, 2.5, 3.0, 4.0, 5.5, 2.2];
    let ours = normal_p90(&samples, &NormalOptions::default()).unwrap();
    assert_eq!(ours, percentile_p90(&samples).unwrap());
}
