//! Measures against their closed forms, and their estimates among each other. The stability atlas of the crate `lab`
//! has the coverage of the intervals.

use rand_distr::{Distribution as _, Exp1, StandardNormal};
use stats::streams::{Purpose, StreamRng, stream};
use stats::{
    ChoiceRule, HarrellDavisVariance, Measure, Method, NormalOptions, VarianceFormula, choose,
};

const CONFIDENCE: f64 = 0.95;

/// Measures that are means of scores, with their values for a standard normal, an exponential and a log-normal response
/// with σ = ½: φ(z)/0.1 with z = 1.281552 for the normal tail, 1 + ln 10 for the exponential one, and
/// exp(σ²/2) Φ(σ − z)/0.1 for the log-normal one.
const CASES: [(Measure, [f64; 3]); 4] = [
    (Measure::Mean, [0.0, 1.0, 1.133_148]),
    (
        Measure::MeanPlusSd { k: 2.0 },
        [2.0, 3.0, 1.133_148 + 2.0 * 0.603_901],
    ),
    (
        Measure::TailMean {
            level: 0.9,
            is_lower: false,
        },
        [1.754_983, 3.302_585, 2.463_948],
    ),
    (
        Measure::TailMean {
            level: 0.1,
            is_lower: true,
        },
        [-1.754_983, 0.051_754, 0.424_076],
    ),
];

fn draw(response: usize, rng: &mut StreamRng) -> f64 {
    let normal: f64 = StandardNormal.sample(rng);
    match response {
        0 => normal,
        1 => Exp1.sample(rng),
        _ => (0.5 * normal).exp(),
    }
}

fn samples(response: usize, n: usize, repetition: u64) -> Vec<f64> {
    let mut rng = stream(17, Purpose::Test, response as u64, repetition);
    (0..n).map(|_| draw(response, &mut rng)).collect()
}

#[test]
fn measures_have_their_closed_forms() {
    for (measure, values) in CASES {
        for (response, value) in values.into_iter().enumerate() {
            let found = measure.verified(&samples(response, 400_000, 0), CONFIDENCE);
            let found = found.unwrap();
            let (low, high) = found.interval.unwrap();
            // The tolerance is twice the half-width, because twelve comparisons are made at once.
            let half = high - low;
            assert!((found.value - value).abs() < half, "{measure:?} {found:?}");
            assert!(half < 0.03, "{measure:?} {found:?}");
        }
        let z = measure.normal_factor().unwrap();
        assert!((z - values[0]).abs() < 1e-6, "{measure:?} {z}");
    }
}

/// The probability of exceeding 1, 2 or 3 standard deviations, and the exact interval of 3 of 20: scipy.stats.binomtest
/// and the tables of the F distribution give 0.0321 and 0.3789.
#[test]
fn probabilities_have_the_interval_of_clopper_and_pearson() {
    let few: Vec<f64> = (0..20).map(f64::from).collect();
    let found = Measure::Exceedance { limit: 16.5 }.verified(&few, CONFIDENCE);
    let found = found.unwrap();
    assert_eq!(found.value, 0.15);
    let (low, high) = found.interval.unwrap();
    assert!((low - 0.0321).abs() < 1e-4 && (high - 0.3789).abs() < 1e-4);
    // The upper limit for 0 of n is 1 − 0.025^(1/n).
    let none = Measure::Exceedance { limit: 20.0 };
    let none = none.verified(&few, CONFIDENCE).unwrap();
    let (low, high) = none.interval.unwrap();
    assert_eq!((none.value, low), (0.0, 0.0));
    assert!((high - (1.0 - 0.025_f64.powf(0.05))).abs() < 1e-9);
    // A failed sample is infinite and counts as one beyond the limit.
    let mut failed = few.clone();
    failed[0] = f64::INFINITY;
    let found = Measure::Exceedance { limit: 16.5 }.verified(&failed, CONFIDENCE);
    assert_eq!(found.unwrap().value, 0.2);
    let mean = Measure::Mean.verified(&failed, CONFIDENCE).unwrap();
    assert_eq!((mean.value, mean.interval), (f64::INFINITY, None));
}

/// Compares the bias of estimates from few samples, and their scatter with the stated variance, for both estimators.
#[test]
fn estimates_of_thirty_samples_scatter_as_they_state() {
    let of_normal = |measure: Measure| NormalOptions {
        z: measure.normal_factor().unwrap_or(0.0),
        variance: VarianceFormula::Exact,
        unbiased: true,
    };
    let (n, repetitions) = (30, 4000);
    let probability = Measure::Exceedance { limit: 1.0 };
    let cases = CASES.map(|(measure, values)| (measure, values[0]));
    for (measure, value) in cases.into_iter().chain([(probability, 0.158_655)]) {
        let rule = ChoiceRule {
            measure,
            normal: of_normal(measure),
            significance: 0.0,
            ..ChoiceRule::default()
        };
        for significance in [0.0, 1.0] {
            let rule = ChoiceRule {
                significance,
                ..rule
            };
            let (mut sum, mut squares, mut stated) = (0.0, 0.0, 0.0);
            for repetition in 0..repetitions {
                let found = choose(&samples(0, n, repetition), &rule).unwrap().chosen;
                assert_eq!(found.method == Method::Normal, significance == 0.0);
                sum += found.value - value;
                squares += (found.value - value).powi(2);
                stated += found.variance;
            }
            let of = repetitions as f64;
            let scatter = squares / of - (sum / of).powi(2);
            let (bias, ratio) = (sum / of, stated / of / scatter);
            // The estimate without a distribution has a tail of three samples: their mean is 0.08 too small, and its
            // stated variance a fifth too large. Its probability is biased by the half sample that it adds.
            let is_free = significance == 1.0;
            let (biased, most) = match measure {
                Measure::TailMean { .. } | Measure::Exceedance { .. } if is_free => (0.3, 1.3),
                _ => (0.1, 1.15),
            };
            assert!(
                bias.abs() < biased * scatter.sqrt() && 0.85 < ratio && ratio < most,
                "{measure:?} {significance}: bias {bias}, scatter {scatter}, ratio {ratio}"
            );
        }
    }
}

/// The difference of two designs with common random numbers, and its far narrower interval.
#[test]
fn differences_use_the_common_random_numbers() {
    let first = samples(2, 1000, 3);
    let second: Vec<f64> = first.iter().map(|y| 1.02 * y + 0.1).collect();
    for (measure, _) in CASES {
        let found = measure
            .difference(&second, &first, CONFIDENCE)
            .unwrap()
            .unwrap();
        let value = measure.verified(&first, CONFIDENCE).unwrap();
        let (low, high) = found.interval.unwrap();
        let expected = 0.02 * value.value + 0.1;
        assert!(
            (found.value - expected).abs() < 1e-3,
            "{measure:?} {found:?}"
        );
        let alone = value.interval.unwrap();
        assert!(
            high - low < 0.05 * (alone.1 - alone.0),
            "{measure:?} {found:?}"
        );
    }
    let limit = Measure::Exceedance { limit: 2.0 };
    let found = limit
        .difference(&second, &first, CONFIDENCE)
        .unwrap()
        .unwrap();
    assert!(found.value > 0.0 && found.interval.unwrap().0 > 0.0);
    // Too few samples, and a failed sample.
    let tail = CASES[2].0;
    assert_eq!(tail.difference(&first[..50], &second, CONFIDENCE), Ok(None));
    assert_eq!(
        Measure::Mean.difference(&[f64::INFINITY; 20], &first, CONFIDENCE),
        Ok(None)
    );
}

#[test]
fn equal_samples_have_measures_without_scatter() {
    let equal = [2.5; 200];
    for (measure, _) in CASES {
        let found = measure.verified(&equal, CONFIDENCE).unwrap();
        assert_eq!((found.value, found.interval), (2.5, Some((2.5, 2.5))));
        let free = measure.distribution_free(&equal, HarrellDavisVariance::Jackknife);
        assert_eq!(free.unwrap().variance, 0.0);
    }
    let rule = ChoiceRule {
        measure: Measure::Exceedance { limit: 2.0 },
        normal: NormalOptions {
            z: 0.0,
            ..NormalOptions::default()
        },
        ..ChoiceRule::default()
    };
    assert_eq!(choose(&equal, &rule).unwrap().chosen.value, 1.0);
}
