//! Percentiles of verification samples, and the differences between them.

use rand_distr::{Distribution as _, StandardNormal};
use results::report::Scale;
use stats::reference::Reference;
use stats::streams::{Purpose, stream};
use stats::{OrderStatistic, order_interval_min_samples, order_statistic, paired_difference};

use crate::stability::outcome::{Failed, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 3] = [
    Entry {
        id: "verified-coverage",
        title: "The interval of a verified percentile under any distribution",
        input: "Normal, exponential, log-normal and bimodal samples and ones with a rare jump; levels 0.1 to 0.999; \
                as many samples as an interval takes and up to eight times as many; 2000 times each",
        instead: "The limits are order statistics whose ranks are exact for any continuous distribution, \
                  interpolated between two of them. With the fewest possible samples the upper limit is the \
                  largest sample, which covers more often than it promises.",
        check: coverage,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "verified-too-few",
        title: "Too few verification samples for an interval",
        input: "35 samples at level 0.9, 367 at 0.99, one sample",
        instead: "There is a percentile and no interval: the largest sample lies below the true percentile too \
                  often. `check` says before anything runs how many samples it takes.",
        check: too_few,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "verified-difference",
        title: "Two percentiles of the same random numbers",
        input: "400 samples of an exponential response and of one that is 10 % smaller, with a little noise of \
                its own; two responses of the same distribution; 2000 times each",
        instead: "The interval of the difference counts what the two share. Responses that do not differ are told \
                  apart in 5 % of the cases or fewer.",
        check: difference,
        ..Entry::blank(Method::Statistics)
    },
];

const CONFIDENCE: f64 = 0.95;
const TIMES: u64 = 2000;

fn covers(found: &OrderStatistic, truth: f64) -> bool {
    let covers = |(low, high): (f64, f64)| low <= truth && truth <= high;
    found.interval.is_some_and(covers)
}

fn share(count: u32) -> f64 {
    100.0 * f64::from(count) / TIMES as f64
}

fn coverage(found: &mut Outcome) -> Result<(), Failed> {
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
        // Of 2000 intervals, 95 % have a standard error of 0.5 %.
        let name = format!("least coverage at level {level}");
        found.at_least(&name, all().fold(100.0, f64::min), "%", 93.0);
        let name = format!("greatest coverage at level {level}");
        found.figure(&name, all().fold(0.0, f64::max), "%");
        found.chart(
            &format!("Coverage of the 95 % interval of a verified percentile at level {level}"),
            ("samples", Scale::Log),
            ("coverage (%)", Scale::Linear),
            curves,
        );
    }
    Ok(())
}

fn too_few(found: &mut Outcome) -> Result<(), Failed> {
    for (n, level) in [(35, 0.9), (367, 0.99), (1, 0.9)] {
        let samples: Vec<f64> = (0..n).map(|i| f64::from(i).sin()).collect();
        let verified = order_statistic(&samples, level, CONFIDENCE)?;
        let sentence = format!("{n} samples at level {level} have a percentile and no interval");
        found.holds(
            &sentence,
            verified.value.is_finite() && verified.interval.is_none(),
        );
    }
    found.refused(order_statistic(&[], 0.9, CONFIDENCE), "TooFewSamples");
    Ok(())
}

fn difference(found: &mut Outcome) -> Result<(), Failed> {
    const LEVEL: f64 = 0.9;
    let law = Reference::Exponential;
    let truth = 0.1 * law.quantile(LEVEL);
    let (mut covered, mut told_apart) = (0, 0);
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
        let width = |one: &OrderStatistic| one.interval.map_or(f64::NAN, |(low, high)| high - low);
        paired += width(&apart);
        let alone = order_statistic(&first, LEVEL, CONFIDENCE)?;
        separate += std::f64::consts::SQRT_2 * width(&alone);
        let alike = paired_difference(&third, &fourth, LEVEL, CONFIDENCE)?;
        let alike = alike.ok_or("400 samples have an interval at level 0.9")?;
        told_apart += u32::from(!covers(&alike, 0.0));
    }
    found.at_least("coverage of a difference", share(covered), "%", 93.0);
    found.at_most(
        "width of the interval beside that of separate samples",
        100.0 * paired / separate,
        "%",
        60.0,
    );
    found.at_most("equal responses told apart", share(told_apart), "%", 7.0);
    Ok(())
}
