//! Percentiles of samples that are few, skewed or equal, or that have outliers.

use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use results::report::Scale;
use stats::streams::{Purpose, StreamRng, stream};
use stats::{
    ChoiceRule, Control, EXACT_Z90, Error, Method as Estimator, PAPER_Z90, Percentile,
    SensitivityPlan, SequentialRule, VarianceFormula, choose, control_variate_p90,
    harrell_davis_p90, lilliefors, mean_sd, percentile_interval, percentile_p90,
    percentile_variance, samples_needed,
};

use crate::stability::outcome::{EntryError, Outcome, variant};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 9] = [
    Entry {
        id: "percentile-skewed",
        title: "The interval of m + z s under skewed samples",
        input: "4 to 30 samples of a normal, an exponential and a log-normal distribution, 4000 times each",
        instead: "The interval has a coverage of 95 % for normal samples only. For skewed samples m + z s converges to \
                  another value, so that more samples do not help. “sampling.estimator = chosen” uses another estimator \
                  when the samples are not normal.",
        check: skewed,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "percentile-chosen",
        title: "The chosen estimator under skewed samples",
        input: "10 to 100 samples of a log-normal distribution, 2000 times each",
        instead: "The more samples, the more often Lilliefors’ test rejects normality, and Harrell and Davis’s estimator is \
                  used instead. Its interval, too, is too narrow for few samples of a heavy tail.",
        check: chosen,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "percentile-outlier",
        title: "An outlier of a million",
        input: "30 normal samples, one of them 10⁶",
        instead: "Normality is rejected. The outlier moves the percentile from order statistics by a quarter of its effect \
                  on m + z s, and the standard error shows it: it is as large as the percentile.",
        check: outlier,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "percentile-too-few",
        title: "Too few samples",
        input: "3 samples for m + z s and for a normality test, 9 for order statistics, 1 for a standard deviation",
        instead: "Each is refused with the required number.",
        check: too_few,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "percentile-equal",
        title: "All samples equal",
        input: "30 samples of 2.5",
        instead: "The percentile is the value and its variance is 0: the observation counts as exact. A normality \
                  test is refused.",
        check: equal,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "moments-cancellation",
        title: "Cancellation in a standard deviation",
        input: "1000 normal samples of standard deviation 1 around 10⁹",
        instead: "The standard deviation is computed in two passes with a correction term. The one-pass formula would have \
                  no correct digit.",
        check: cancellation,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "percentile-sequential",
        title: "Sampling to a precision",
        input: "Normal samples until m + z s has a standard error of 0.135, which takes 100 samples; first batches of 5, 10 \
                and 25, 20 000 times each",
        instead: "A design whose first standard deviation is too small by chance stops early, which biases the percentile \
                  downwards. Larger first batches limit the bias.",
        check: sequential,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "control-variate-useless",
        title: "A control variate without correlation",
        input: "30 normal samples with independent controls, 5000 times",
        instead: "The fitted coefficient is noise, which adds a little variance. The correlation is returned.",
        check: useless_control,
        ..Entry::blank(Method::Statistics)
    },
    Entry {
        id: "sensitivity-constant",
        title: "Sensitivity of an output that is constant or NaN",
        input: "Outputs that are all 1; outputs of which every second one is NaN, and all",
        instead: "A constant output is refused. Rows with a value that is not finite are left out, and too few remaining \
                  rows are refused.",
        check: constant_output,
        ..Entry::blank(Method::Statistics)
    },
];

fn rng(number: u64) -> StreamRng {
    stream(22, Purpose::Test, number, 0)
}

fn normal(rng: &mut StreamRng) -> f64 {
    StandardNormal.sample(rng)
}

fn exponential(rng: &mut StreamRng) -> f64 {
    -(1.0 - rng.random::<f64>()).ln()
}

fn log_normal(rng: &mut StreamRng) -> f64 {
    normal(rng).exp()
}

/// True 90 % quantiles: z₉₀, ln 10, exp z₉₀.
const TRUTHS: [f64; 3] = [EXACT_Z90, std::f64::consts::LN_10, 3.602_224_479];

fn covers((low, high): (f64, f64), truth: f64) -> bool {
    (low..=high).contains(&truth)
}

fn skewed(outcome: &mut Outcome) -> Result<(), EntryError> {
    type Draw = fn(&mut StreamRng) -> f64;
    let times = 4000;
    let draws: [(&str, Draw); 3] = [
        ("normal", normal),
        ("exponential", exponential),
        ("log-normal", log_normal),
    ];
    let mut coverage = Vec::new();
    let mut rejected = Vec::new();
    for (which, (name, draw)) in draws.into_iter().enumerate() {
        let (mut covered, mut seen) = (Vec::new(), Vec::new());
        for k in [4, 6, 8, 10, 15, 20, 30] {
            let mut rng = rng(100 * which as u64 + k as u64);
            let (mut inside, mut not_normal) = (0, 0);
            for _ in 0..times {
                let samples: Vec<f64> = (0..k).map(|_| draw(&mut rng)).collect();
                let interval = percentile_interval(&percentile_p90(&samples)?, 0.95)?;
                inside += u32::from(covers(interval, TRUTHS[which]));
                not_normal += u32::from(lilliefors(&samples)?.p_value < 0.05);
            }
            let share = |count: u32| 100.0 * f64::from(count) / f64::from(times);
            covered.push([k as f64, share(inside)]);
            seen.push([k as f64, share(not_normal)]);
        }
        coverage.push((name, covered));
        rejected.push((name, seen));
    }
    let at =
        |curve: &[[f64; 2]], k: f64| curve.iter().find(|p| p[0] == k).map_or(f64::NAN, |p| p[1]);
    let least = |curve: &[[f64; 2]]| curve.iter().map(|p| p[1]).fold(100.0, f64::min);
    // Of 4000 intervals, 95 % have a standard error of 0.35 %.
    outcome.at_least(
        "least coverage of normal samples, 4 to 30",
        least(&coverage[0].1),
        "%",
        93.0,
    );
    outcome.at_least(
        "coverage of exponential samples at 30",
        at(&coverage[1].1, 30.0),
        "%",
        65.0,
    );
    outcome.at_least(
        "coverage of log-normal samples at 30",
        at(&coverage[2].1, 30.0),
        "%",
        45.0,
    );
    outcome.figure(
        "coverage of log-normal samples at 4",
        at(&coverage[2].1, 4.0),
        "%",
    );
    outcome.at_least(
        "log-normal samples rejected as normal at 30",
        at(&rejected[2].1, 30.0),
        "%",
        90.0,
    );
    outcome.figure(
        "log-normal samples rejected as normal at 4",
        at(&rejected[2].1, 4.0),
        "%",
    );
    outcome.chart(
        "Coverage of the 95 % interval of m + z s",
        ("samples", Scale::Linear),
        ("coverage (%)", Scale::Linear),
        coverage,
    );
    outcome.chart(
        "Samples that Lilliefors’ test rejects at 5 %",
        ("samples", Scale::Linear),
        ("rejected (%)", Scale::Linear),
        rejected,
    );
    Ok(())
}

fn chosen(outcome: &mut Outcome) -> Result<(), EntryError> {
    let times = 2000;
    let (mut plain, mut chosen, mut switched) = (Vec::new(), Vec::new(), Vec::new());
    for k in [10, 15, 20, 30, 50, 100] {
        let mut rng = rng(1000 + k as u64);
        let (mut of_normal, mut of_chosen, mut changes) = (0, 0, 0);
        for _ in 0..times {
            let samples: Vec<f64> = (0..k).map(|_| log_normal(&mut rng)).collect();
            let estimate = percentile_p90(&samples)?;
            of_normal += u32::from(covers(percentile_interval(&estimate, 0.95)?, TRUTHS[2]));
            let choice = choose(&samples, &ChoiceRule::default())?.chosen;
            changes += u32::from(choice.method == Estimator::DistributionFree);
            let estimate = Percentile {
                p90: choice.value,
                variance: choice.variance,
                ..estimate
            };
            of_chosen += u32::from(covers(percentile_interval(&estimate, 0.95)?, TRUTHS[2]));
        }
        let share = |count: u32| [k as f64, 100.0 * f64::from(count) / f64::from(times)];
        plain.push(share(of_normal));
        chosen.push(share(of_chosen));
        switched.push(share(changes));
    }
    let last = |curve: &[[f64; 2]]| curve[curve.len() - 1][1];
    outcome.at_least(
        "coverage of the chosen estimator at 100",
        last(&chosen),
        "%",
        85.0,
    );
    outcome.figure("coverage of m + z s at 100", last(&plain), "%");
    outcome.figure("coverage of the chosen estimator at 10", chosen[0][1], "%");
    outcome.at_least(
        "share of Harrell and Davis’s estimator at 100",
        last(&switched),
        "%",
        99.0,
    );
    outcome.chart(
        "Coverage of the 95 % interval, log-normal samples",
        ("samples", Scale::Log),
        ("coverage (%)", Scale::Linear),
        vec![
            ("m + z s", plain),
            ("chosen", chosen),
            ("share of order statistics", switched),
        ],
    );
    Ok(())
}

fn outlier(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut rng = rng(2000);
    let mut samples: Vec<f64> = (0..29).map(|_| normal(&mut rng)).collect();
    samples.push(1e6);
    let test = lilliefors(&samples)?;
    let choice = choose(&samples, &ChoiceRule::default())?;
    let name = variant(&choice.chosen.method);
    outcome.named(name);
    outcome.at_most("p-value of normality", test.p_value, "", 1e-3);
    let order = choice.chosen;
    outcome.holds(
        "order statistics take over",
        order.method == Estimator::DistributionFree,
    );
    let normal = percentile_p90(&samples)?;
    outcome.at_most(
        "percentile of order statistics over m + z s",
        order.value / normal.p90,
        "",
        0.3,
    );
    outcome.figure("m + z s", normal.p90, "");
    outcome.figure("percentile of order statistics", order.value, "");
    outcome.at_least(
        "its standard error over it",
        order.variance.sqrt() / order.value,
        "",
        0.9,
    );
    Ok(())
}

fn too_few(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut lacks =
        |result: Result<(), Error>, values| outcome.refused_with(result, "TooFewSamples", values);
    let three = [1.0, 2.0, 4.0];
    let nine: Vec<f64> = (0..9).map(f64::from).collect();
    lacks(
        percentile_p90(&three).map(drop),
        "at least 4 samples, got 3",
    );
    lacks(
        percentile_variance(1.0, 3, PAPER_Z90).map(drop),
        "at least 4 samples, got 3",
    );
    lacks(lilliefors(&three).map(drop), "at least 4 samples, got 3");
    lacks(
        harrell_davis_p90(&nine).map(drop),
        "at least 10 samples, got 9",
    );
    lacks(mean_sd(&[1.0]).map(drop), "at least 2 samples, got 1");
    for samples in [&nine[..4], &nine] {
        let choice = choose(samples, &ChoiceRule::default())?.chosen;
        let is_normal = choice.method == Estimator::Normal;
        outcome.holds("for 4 and 9 samples m + z s is chosen", is_normal);
    }
    Ok(())
}

fn equal(outcome: &mut Outcome) -> Result<(), EntryError> {
    let samples = [2.5; 30];
    let percentile = percentile_p90(&samples)?;
    outcome.at_most(
        "error of the percentile",
        (percentile.p90 - 2.5).abs(),
        "",
        0.0,
    );
    outcome.at_most("variance", percentile.variance, "", 0.0);
    outcome.holds(
        "mean and standard deviation are exact",
        mean_sd(&[0.1; 30])? == (0.1, 0.0),
    );
    outcome.refused_with(lilliefors(&samples), "Constant", "all 30 values equal 2.5");
    let choice = choose(&samples, &ChoiceRule::default())?.chosen;
    outcome.holds("m + z s is chosen", choice.method == Estimator::Normal);
    Ok(())
}

fn cancellation(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut rng = rng(2100);
    let plain: Vec<f64> = (0..1000).map(|_| normal(&mut rng)).collect();
    // Rounded as the sum with 10⁹ rounds them, so that both have the same deviations.
    let far: Vec<f64> = plain.iter().map(|z| 1e9 + z).collect();
    let near: Vec<f64> = far.iter().map(|y| y - 1e9).collect();
    let (_, sd) = mean_sd(&far)?;
    let (_, expected) = mean_sd(&near)?;
    outcome.at_most(
        "relative error of the standard deviation",
        (sd / expected - 1.0).abs(),
        "",
        1e-12,
    );
    let n = far.len() as f64;
    let (sum, squares) = far.iter().fold((0.0, 0.0), |(s, q), y| (s + y, q + y * y));
    let textbook: f64 = ((squares - sum * sum / n) / (n - 1.0)).max(0.0);
    outcome.figure(
        "standard deviation by the textbook formula",
        textbook.sqrt(),
        "",
    );
    Ok(())
}

fn sequential(outcome: &mut Outcome) -> Result<(), EntryError> {
    let times = 20_000;
    for (batch, most_error, most_bias) in [(5, 1.15, 0.025), (10, 1.04, 0.025), (25, 1.02, 0.02)] {
        let rule = SequentialRule {
            precision: 0.135,
            batch,
            most: 1000,
            z: EXACT_Z90,
            variance: VarianceFormula::Exact,
        };
        let mut rng = rng(2200 + batch as u64);
        let (mut estimates, mut taken) = (Vec::new(), 0);
        for _ in 0..times {
            let mut samples = Vec::new();
            let mut sd = f64::NAN;
            loop {
                let more = samples_needed(samples.len(), sd, &rule)?;
                if more == 0 {
                    break;
                }
                samples.extend((0..more).map(|_| normal(&mut rng)));
                sd = mean_sd(&samples)?.1;
            }
            taken += samples.len();
            estimates.push(mean_sd(&samples)?.0 + EXACT_Z90 * sd);
        }
        let (mean, sd) = mean_sd(&estimates)?;
        let name = |what: &str| format!("{what}, first batch of {batch}");
        let error = sd / rule.precision;
        outcome.between(
            &name("standard error over the precision"),
            error,
            "",
            [0.9, most_error],
        );
        outcome.between(
            &name("bias downwards"),
            EXACT_Z90 - mean,
            "σ",
            [-0.003, most_bias],
        );
        let each = taken as f64 / f64::from(times);
        outcome.between(&name("samples taken"), each, "", [90.0, 125.0]);
    }
    Ok(())
}

fn useless_control(outcome: &mut Outcome) -> Result<(), EntryError> {
    let times = 5000;
    let mut rng = rng(2300);
    let control = Control { mean: 0.0, sd: 1.0 };
    let (mut plain, mut controlled) = (Vec::new(), Vec::new());
    let mut largest = 0.0_f64;
    for _ in 0..times {
        let samples: Vec<f64> = (0..30).map(|_| normal(&mut rng)).collect();
        let controls: Vec<f64> = (0..30).map(|_| normal(&mut rng)).collect();
        plain.push(percentile_p90(&samples)?.p90);
        let with = control_variate_p90(&samples, &controls, control, PAPER_Z90)?;
        controlled.push(with.p90);
        largest = largest.max(with.correlation.abs());
    }
    let ratio = (mean_sd(&controlled)?.1 / mean_sd(&plain)?.1).powi(2);
    outcome.at_most(
        // The coefficient takes one of 30 degrees of freedom.
        "variance with the control over that without",
        ratio,
        "",
        1.12,
    );
    outcome.figure("largest correlation by chance", largest, "");
    Ok(())
}

fn constant_output(outcome: &mut Outcome) -> Result<(), EntryError> {
    let plan = SensitivityPlan::new(2, 64, 0)?;
    let mut rng = rng(2400);
    let mut analyse = |outputs: &[f64]| plan.analyse(outputs, 100, &mut rng);
    let constant = vec![1.0; plan.len()];
    outcome.refused_with(analyse(&constant), "OutOfRange", "does not depend");
    let mut outputs: Vec<f64> = (0..plan.len()).map(|i| plan.point(i)[0]).collect();
    for output in outputs.iter_mut().step_by(2) {
        *output = f64::NAN;
    }
    outcome.refused(analyse(&outputs), "TooFewSamples");
    outputs.fill(f64::NAN);
    outcome.refused_with(analyse(&outputs), "TooFewSamples", "got 0");
    Ok(())
}
