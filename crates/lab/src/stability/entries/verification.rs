//! Percentiles and other measures of verification samples, and the differences between them.

use rand_distr::{Distribution as _, Exp1, StandardNormal};
use results::report::Scale;
use stats::reference::Reference;
use stats::streams::{Purpose, stream};
use stats::{
    IntervalEstimate, Measure, order_interval_min_samples, order_statistic, paired_difference,
};

use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 4] = [
    Entry {
        id: "verified-coverage",
        title: "The interval of a verified percentile under any distribution",
        input: "Normal, exponential, log-normal and bimodal samples and samples with a rare jump; levels 0.1 to 0.999; \
                the smallest number of samples with an interval and up to eight times as many; 2000 times each",
        instead: "The limits are interpolated between order statistics whose ranks are exact for any continuous \
                  distribution. With the smallest number of samples one limit is the largest or smallest sample, so that \
                  the coverage exceeds 95 %.",
        check: coverage,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "measure-coverage",
        title: "The interval of a mean, of a mean plus standard deviations, and of a tail's mean",
        input: "Normal, exponential and log-normal samples with a coefficient of variation of 0.53 and of 1; 100, 300 and \
                1000 of them; 2000 times each",
        instead: "Student's t of the scores would miss too often on the side of the tail. Hall's transformation takes out \
                  most of their skewness. The intervals of means plus standard deviations cover least, 90 % with 100 \
                  log-normal samples with a coefficient of variation of 1.",
        check: measures,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "verified-too-few",
        title: "Too few verification samples for an interval",
        input: "5 samples at level 0.5, 35 at 0.1 and 0.9, 367 at 0.99, 3687 at 0.999, and one more each; one sample; none",
        instead: "The result is a percentile without an interval, because the largest sample lies below the true percentile \
                  too often. One more sample gives an interval. `coordinator check` prints the required number before \
                  anything runs.",
        check: too_few,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "verified-difference",
        title: "Two percentiles from the same random numbers",
        input: "400 samples of an exponential response and of a response that is 10 % smaller and has a little noise of \
                its own; two responses of the same distribution; 2000 times each",
        instead: "The interval of the difference takes the shared random numbers into account. Responses of the same \
                  distribution are found to differ in 5 % of the cases at most.",
        check: difference,
        ..Entry::blank(Method::Statistics)
    },
];

const CONFIDENCE: f64 = 0.95;
const TIMES: u64 = 2000;

fn covers(percentile: &IntervalEstimate, truth: f64) -> bool {
    let covers = |(low, high): (f64, f64)| low <= truth && truth <= high;
    percentile.interval.is_some_and(covers)
}

fn share(count: u32) -> f64 {
    100.0 * f64::from(count) / TIMES as f64
}

fn coverage(outcome: &mut Outcome) -> Result<(), EntryError> {
    for (level, factors) in [
        (0.1, &[1, 2, 4, 8][..]),
        (0.5, &[1, 2, 4, 8]),
        (0.9, &[1, 2, 4, 8]),
        (0.99, &[1, 2, 4, 8]),
        (0.999, &[1]),
    ] {
        let fewest = order_interval_min_samples(level, CONFIDENCE);
        let mut curves = Vec::new();
        for law in Reference::ALL {
            let truth = law.quantile(level);
            let mut curve = Vec::new();
            for n in factors.iter().map(|factor| factor * fewest) {
                let mut inside = 0;
                for repeat in 0..TIMES {
                    let mut rng = stream(23, Purpose::Test, n as u64, repeat);
                    let samples: Vec<f64> = (0..n).map(|_| law.draw(&mut rng)).collect();
                    let verified = order_statistic(&samples, level, CONFIDENCE)?;
                    inside += u32::from(covers(&verified, truth));
                }
                curve.push([n as f64, share(inside)]);
            }
            curves.push((law.name(), curve));
        }
        let all = || {
            curves
                .iter()
                .flat_map(|(_, curve)| curve)
                .map(|point| point[1])
        };
        // The coverage of 2000 intervals of 95 % has a standard error of 0.5 %.
        let name = format!("least coverage at level {level}");
        outcome.at_least(&name, all().fold(100.0, f64::min), "%", 93.0);
        let name = format!("greatest coverage at level {level}");
        outcome.figure(&name, all().fold(0.0, f64::max), "%");
        if factors.len() > 1 {
            let beyond = curves.iter().flat_map(|(_, curve)| &curve[1..]);
            let most = beyond.map(|point| point[1]).fold(0.0, f64::max);
            let name = format!("greatest coverage beyond the fewest samples at level {level}");
            outcome.at_most(&name, most, "%", 97.0);
        }
        outcome.chart(
            &format!("Coverage of the 95 % interval of a verified percentile at level {level}"),
            ("samples", Scale::Log),
            ("coverage (%)", Scale::Linear),
            curves,
        );
    }
    Ok(())
}

/// Measures that are means of scores, with their values for a standard normal, an exponential and two log-normal
/// responses, with σ = ½ and σ = √ln 2: φ(z)/0.1 with z = 1.281552 for the normal tail, 1 + ln 10 for the exponential
/// one, and exp(σ²/2) Φ(σ − z)/0.1 for the log-normal ones.
const MEASURES: [(&str, Measure, [f64; 4]); 5] = [
    (
        "mean",
        Measure::Mean,
        [0.0, 1.0, 1.133_148, std::f64::consts::SQRT_2],
    ),
    (
        "mean + 2 sd",
        Measure::MeanPlusSd { k: 2.0 },
        [2.0, 3.0, 2.340_951, 4.242_641],
    ),
    (
        "mean + 3 sd",
        Measure::MeanPlusSd { k: 3.0 },
        [3.0, 4.0, 2.944_850, 5.656_854],
    ),
    (
        "mean above P90",
        Measure::TailMean {
            level: 0.9,
            is_lower: false,
        },
        [1.754_983, 3.302_585, 2.463_948, 4.620_475],
    ),
    (
        "mean below P10",
        Measure::TailMean {
            level: 0.1,
            is_lower: true,
        },
        [-1.754_983, 0.051_754, 0.424_076, 0.243_996],
    ),
];

fn measures(outcome: &mut Outcome) -> Result<(), EntryError> {
    let laws = [
        "normal",
        "exponential",
        "log-normal, CV 0.53",
        "log-normal, CV 1",
    ];
    for (name, measure, truths) in MEASURES {
        let mut curves = Vec::new();
        for (law, (law_name, truth)) in laws.into_iter().zip(truths).enumerate() {
            let mut curve = Vec::new();
            for n in [100, 300, 1000] {
                let mut inside = 0;
                for repeat in 0..TIMES {
                    let mut rng = stream(25 + law as u64, Purpose::Test, n as u64, repeat);
                    let draw = |_| {
                        let normal: f64 = StandardNormal.sample(&mut rng);
                        match law {
                            0 => normal,
                            1 => Exp1.sample(&mut rng),
                            2 => (0.5 * normal).exp(),
                            _ => (std::f64::consts::LN_2.sqrt() * normal).exp(),
                        }
                    };
                    let samples: Vec<f64> = (0..n).map(draw).collect();
                    let verified = measure.verified(&samples, CONFIDENCE)?;
                    inside += u32::from(covers(&verified, truth));
                }
                curve.push([n as f64, share(inside)]);
            }
            curves.push((law_name, curve));
        }
        let all = || {
            curves
                .iter()
                .flat_map(|(_, curve)| curve.iter().map(|point| point[1]))
        };
        let least = format!("least coverage: {name}");
        outcome.at_least(&least, all().fold(100.0, f64::min), "%", 89.0);
        let most = format!("greatest coverage: {name}");
        outcome.at_most(&most, all().fold(0.0, f64::max), "%", 97.5);
        outcome.chart(
            &format!("Coverage of the 95 % interval: {name}"),
            ("samples", Scale::Log),
            ("coverage (%)", Scale::Linear),
            curves,
        );
    }
    Ok(())
}

fn too_few(outcome: &mut Outcome) -> Result<(), EntryError> {
    // P(B ≤ 0), with B binomial of n and 0.1, falls below 2.5 % at n = 36: ln 0.025 / ln 0.9 = 35.01.
    for (level, fewest) in [(0.5, 6), (0.1, 36), (0.9, 36), (0.99, 368), (0.999, 3688)] {
        let is_fewest = order_interval_min_samples(level, CONFIDENCE) == fewest;
        outcome.holds(&format!("level {level} needs {fewest} samples"), is_fewest);
        for n in [1, fewest - 1, fewest] {
            let samples: Vec<f64> = (0..n).map(|i| (0.7 * i as f64).sin()).collect();
            let verified = order_statistic(&samples, level, CONFIDENCE)?;
            outcome.holds(
                "fewer samples have a percentile and no interval",
                verified.value.is_finite() && verified.interval.is_some() == (n == fewest),
            );
        }
    }
    outcome.refused(order_statistic(&[], 0.9, CONFIDENCE), "TooFewSamples");
    Ok(())
}

fn difference(outcome: &mut Outcome) -> Result<(), EntryError> {
    const LEVEL: f64 = 0.9;
    let law = Reference::Exponential;
    let truth = 0.1 * law.quantile(LEVEL);
    let (mut covered, mut distinguished) = (0, 0);
    let (mut paired, mut separate) = (0.0, 0.0);
    for repeat in 0..TIMES {
        let mut rng = stream(24, Purpose::Test, 0, repeat);
        let (mut first, mut second) = (Vec::new(), Vec::new());
        let (mut third, mut fourth) = (Vec::new(), Vec::new());
        for _ in 0..400 {
            let shared = law.draw(&mut rng);
            let mut own = || -> f64 { StandardNormal.sample(&mut rng) };
            first.push(shared);
            second.push(0.9 * shared + 0.05 * own());
            third.push(shared + 0.3 * own());
            fourth.push(shared + 0.3 * own());
        }
        let apart = paired_difference(&first, &second, LEVEL, CONFIDENCE)?;
        let apart = apart.ok_or("400 samples have an interval at level 0.9")?;
        covered += u32::from(covers(&apart, truth));
        let width =
            |one: &IntervalEstimate| one.interval.map_or(f64::NAN, |(low, high)| high - low);
        paired += width(&apart);
        let alone = order_statistic(&first, LEVEL, CONFIDENCE)?;
        separate += std::f64::consts::SQRT_2 * width(&alone);
        let alike = paired_difference(&third, &fourth, LEVEL, CONFIDENCE)?;
        let alike = alike.ok_or("400 samples have an interval at level 0.9")?;
        distinguished += u32::from(!covers(&alike, 0.0));
    }
    outcome.between(
        "coverage of a difference",
        share(covered),
        "%",
        [93.0, 99.0],
    );
    outcome.at_most(
        "width of the interval, relative to separate samples",
        100.0 * paired / separate,
        "%",
        60.0,
    );
    let share = share(distinguished);
    outcome.at_most("equal responses that are found to differ", share, "%", 7.0);
    Ok(())
}
