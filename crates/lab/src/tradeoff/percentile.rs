//! The cost of estimators of the percentile, and their errors.
//!
//! The truth is the empirical percentile of many independent samples of a design. At each design,
//! every method estimates the percentile repeatedly, from separate samples.

use anyhow::{Context as _, bail};
use problem::accuracy::{ESTIMATORS, Estimator};
use problem::file::{ControlVariate, EstimatorRule, Sampling, WearCoefficients};
use problem::formulation::Problem;
use stages::responses::{ControlledSamples, response_of};
use stats::Control;
use stats::streams::{Purpose, stream};

use crate::summary::{median, quantile, root_mean_square};
use crate::tradeoff::data::{self, TRIES};
use crate::tradeoff::front::Rule;
use crate::tradeoff::size::Size;
use crate::tradeoff::table::{Row, Table};
use crate::tradeoff::view::{self, Reading};

pub(crate) const LEAD: &str = "Error of the percentile of ΔSTE estimated from few samples, against the empirical percentile of 100 000 samples \
     (20 000 with --quick), at random designs that keep the constraints or nearly do. Every second design is the least \
     normal of twelve. Errors are root mean squares over designs and repetitions, in standard deviations of the \
     design's ΔSTE. Methods have the names of the keys of [sampling]. A design counts as normal if m + z s of all its \
     samples is within 0.05 standard deviations of the empirical percentile. The linearised control takes two further \
     calls for each coefficient of the wear.";

const COLUMNS: [&str; 6] = [
    "simulator calls",
    "RMSE (standard deviations)",
    "RMSE (µm)",
    "bias, root mean square (standard deviations)",
    "bias, mean (µm)",
    "variance stated / variance found, median",
];

/// The relative error of the paper's 30 samples of a normal response: √(1/30 + z²/58) = 0.25.
const TOLERANCE: f64 = 0.25;

pub(crate) const PAIRS: &[view::Pair] = &[view::Pair {
    cost: 0,
    error: 1,
    reading: Reading::Choice(Rule::Within(TOLERANCE)),
}];

/// Numbers of samples.
const COUNTS: [usize; 8] = [5, 10, 20, 32, 64, 125, 250, 500];
const GROUP: u32 = 8;
/// Difference of m + z s from the truth above which a design is not normal, in standard deviations.
const NOT_NORMAL: f64 = 0.05;
/// Every second design is the least normal of [`SCREENED`] random ones, screened with [`SCREENING`]
/// samples each.
const SCREENED: usize = 12;
const SCREENING: u64 = 2_000;

/// The estimator of Harrell and Davis, which `[accuracy]` does not choose.
const HARRELL_DAVIS: Estimator = Estimator {
    name: "Harrell–Davis",
    rule: EstimatorRule::DistributionFree,
    control: ControlVariate::None,
    coefficients: WearCoefficients::Independent,
};

/// The estimators that `[accuracy]` chooses from, and Harrell–Davis.
fn methods() -> impl Iterator<Item = Estimator> {
    ESTIMATORS.into_iter().chain([HARRELL_DAVIS])
}

/// The samples of one repetition, and the control variate's values.
struct Draws {
    values: Vec<f64>,
    controls: Vec<f64>,
}

/// The samples of a design for each kind of coefficients, with the design's statistics.
struct DesignDraws {
    truth: f64,
    sd: f64,
    is_normal: bool,
    control: Control,
    modes: usize,
    /// The draws of each kind, in the order of [`DRAWN`].
    draws: [Vec<Draws>; 3],
}

/// The kinds of coefficients, drawn again for each repetition.
const DRAWN: [WearCoefficients; 3] = [
    WearCoefficients::Independent,
    WearCoefficients::Antithetic,
    WearCoefficients::QuasiRandom,
];

/// The errors of one estimator at one design.
#[derive(Debug, Clone, Copy)]
struct Errors {
    rmse: f64,
    bias: f64,
    /// Mean of the variance stated by the estimator, divided by the variance of its estimates.
    stated: f64,
}

pub(crate) fn run(
    problem: &Problem,
    size: Size,
    progress: &mut dyn FnMut(&str),
) -> anyhow::Result<Table> {
    let count = size.designs(60, 16);
    let mut rng = stream(problem.campaign().seed, Purpose::Test, 1, 0);
    let own = &problem.campaign().sampling;
    let own_count = own.samples_per_design as usize;
    let mut counts = COUNTS.to_vec();
    if own_count <= COUNTS[COUNTS.len() - 1] {
        counts.push(own_count);
        counts.sort_unstable();
        counts.dedup();
    }
    let mut rows = [Vec::new(), Vec::new()];
    let mut found = [0, 0];
    // One design at a time: the draws of all designs would take a gigabyte.
    let mut errors: Vec<(usize, usize, bool, f64, f64, Errors)> = Vec::new();
    for number in 0..count as u64 {
        let sampled = draw_design(problem, number, size, &mut rng)?;
        found[usize::from(!sampled.is_normal)] += 1;
        for (method, estimator) in methods().enumerate() {
            let settings = with(own, &estimator);
            for &samples in &counts {
                let samples = whole(&settings, samples);
                if samples < fewest(&settings) {
                    continue;
                }
                let draws = &sampled.draws[drawn(&settings)];
                let known = (sampled.truth, sampled.control);
                let measured = errors_of(draws, samples, &settings, known)?;
                let calls = calls(&settings, samples, sampled.modes);
                errors.push((
                    method,
                    samples,
                    sampled.is_normal,
                    calls,
                    sampled.sd,
                    measured,
                ));
            }
        }
        if (number + 1).is_multiple_of(10) {
            progress(&format!("percentile: {} of {count} designs", number + 1));
        }
    }
    for (method, estimator) in methods().enumerate() {
        let settings = with(own, &estimator);
        let mut own_counts: Vec<usize> = counts.clone();
        own_counts
            .iter_mut()
            .for_each(|samples| *samples = whole(&settings, *samples));
        own_counts.dedup();
        for samples in own_counts {
            for (panel, is_normal) in [(0, true), (1, false)] {
                let here = errors
                    .iter()
                    .filter(|(m, k, normal, ..)| (*m, *k, *normal) == (method, samples, is_normal));
                let here: Vec<_> = here
                    .map(|(.., calls, sd, errors)| (*calls, *sd, *errors))
                    .collect();
                if here.is_empty() {
                    continue;
                }
                let each = |value: &dyn Fn(&(f64, f64, Errors)) -> f64| -> Vec<f64> {
                    here.iter().map(value).collect()
                };
                let bias = each(&|(_, _, errors)| errors.bias);
                rows[panel].push(Row {
                    panel: String::new(),
                    method: estimator.name.to_owned(),
                    setting: format!("{samples} samples"),
                    is_campaign: is_of(&estimator, own) && samples == own_count,
                    values: vec![
                        median(&each(&|(calls, ..)| *calls)),
                        root_mean_square(&each(&|(_, sd, errors)| errors.rmse / sd)),
                        root_mean_square(&each(&|(_, _, errors)| errors.rmse)),
                        root_mean_square(&each(&|(_, sd, errors)| errors.bias / sd)),
                        bias.iter().sum::<f64>() / bias.len() as f64,
                        median(&each(&|(_, _, errors)| errors.stated)),
                    ],
                });
            }
        }
    }
    let mut table = Table::new(&COLUMNS);
    let names = ["normal designs", "designs that are not normal"];
    for ((rows, name), found) in rows.into_iter().zip(names).zip(found) {
        table.rows.extend(rows.into_iter().map(|row| Row {
            panel: format!("{name} ({found})"),
            ..row
        }));
    }
    Ok(table)
}

/// Draws the next nearly feasible random design, with its true percentile and its samples.
fn draw_design(
    problem: &Problem,
    number: u64,
    size: Size,
    rng: &mut impl rand::Rng,
) -> anyhow::Result<DesignDraws> {
    let gears = problem.gears().context("the campaign designs no gears")?;
    let settings = &problem.campaign().sampling;
    // Few designs are far from normal. The screening makes them up to half of all designs.
    let seed = problem.campaign().seed;
    let level = settings.objective.level();
    let level =
        level.context("the study is of percentiles, and [objective] has another measure")?;
    let mut best: Option<(f64, gear::Pair)> = None;
    let screened = if number.is_multiple_of(2) {
        1
    } else {
        SCREENED
    };
    for pair in data::nearly_feasible(problem, rng)?.take(screened) {
        let mut sampler = gears.sampler(&pair);
        let draws: Vec<f64> = (0..SCREENING)
            .map(|sample| sampler.draw(&mut stream(seed, Purpose::Test, 3, sample)))
            .collect();
        let (mean, sd) = stats::mean_sd(&draws)?;
        let normal = mean + stats::normal_quantile(level) * sd;
        let off = (normal - quantile(&draws, level)).abs() / sd;
        if best.as_ref().is_none_or(|(most, _)| off > *most) {
            best = Some((off, pair));
        }
    }
    let Some((_, pair)) = best else {
        bail!("none of {TRIES} random designs is nearly feasible");
    };
    let mut sampler = gears.sampler(&pair);
    let modes = sampler.modes();
    let slopes = sampler.slopes();
    let of_truth: Vec<f64> = (0..size.pick(100_000, 20_000, 5_000))
        .map(|sample| sampler.draw(&mut stream(seed, Purpose::Test, 4 + number, sample)))
        .collect();
    let (mean, sd) = stats::mean_sd(&of_truth)?;
    let truth = quantile(&of_truth, level);
    let normal = mean + stats::normal_quantile(level) * sd;
    let most = COUNTS[COUNTS.len() - 1] as u64;
    let mut repetition = |coefficients: stats::Sampling, repetition: u64| {
        let (mut values, mut controls) = (Vec::new(), Vec::new());
        for sample in 0..most {
            let name = (number << 32) + repetition;
            let drawn = stats::normal_coefficients(
                coefficients,
                seed + 1,
                Purpose::Test,
                name,
                sample,
                modes,
            )?;
            values.push(sampler.at(&drawn));
            controls.push(slopes.iter().zip(&drawn).map(|(a, b)| a * b).sum());
        }
        Ok(Draws { values, controls })
    };
    let mut draws = [Vec::new(), Vec::new(), Vec::new()];
    for (coefficients, draws) in DRAWN.into_iter().zip(&mut draws) {
        let estimator = Estimator {
            name: "normal",
            rule: EstimatorRule::Normal,
            control: ControlVariate::None,
            coefficients,
        };
        let coefficients = with(settings, &estimator);
        for number in 0..size.pick(200, 60, 10) {
            let drawn: anyhow::Result<Draws> = repetition(coefficients.coefficients(), number);
            draws.push(drawn?);
        }
    }
    Ok(DesignDraws {
        truth,
        sd,
        is_normal: (normal - truth).abs() <= NOT_NORMAL * sd,
        control: Control {
            mean: 0.0,
            sd: slopes.iter().map(|slope| slope * slope).sum::<f64>().sqrt(),
        },
        modes,
        draws,
    })
}

/// Returns the section `[sampling]` with this estimator.
fn with(own: &Sampling, estimator: &Estimator) -> Sampling {
    let Estimator {
        rule,
        control,
        coefficients,
        ..
    } = *estimator;
    Sampling {
        estimator: Some(rule),
        control,
        coefficients,
        group: (coefficients == WearCoefficients::QuasiRandom).then_some(GROUP),
        precision: None,
        samples_max: None,
        ..own.clone()
    }
}

/// Whether this is the estimator of a campaign with this section. [`EstimatorRule::Chosen`]
/// and [`EstimatorRule::ChosenBootstrap`] differ in the variance alone.
fn is_of(estimator: &Estimator, own: &Sampling) -> bool {
    let rule = match own.estimator_rule() {
        EstimatorRule::ChosenBootstrap => EstimatorRule::Chosen,
        other => other,
    };
    (estimator.rule, estimator.control, estimator.coefficients)
        == (rule, own.control, own.coefficients)
}

/// The index in [`DRAWN`] of the draws that are taken.
fn drawn(settings: &Sampling) -> usize {
    let mut kinds = DRAWN.iter();
    kinds
        .position(|kind| *kind == settings.coefficients)
        .unwrap_or(0)
}

/// The largest number of samples in whole groups.
fn whole(settings: &Sampling, samples: usize) -> usize {
    let group = settings.coefficients().group();
    samples / group * group
}

fn fewest(settings: &Sampling) -> usize {
    match (
        settings.estimator_rule(),
        settings.control,
        settings.coefficients,
    ) {
        (EstimatorRule::DistributionFree, ..) => settings.measure().free_min_samples(),
        (_, ControlVariate::Linearised, _) => stats::CONTROL_MIN_SAMPLES,
        (_, _, WearCoefficients::Independent) => stats::PERCENTILE_MIN_SAMPLES,
        _ => stats::GROUPED_MIN_GROUPS * settings.coefficients().group(),
    }
}

fn calls(settings: &Sampling, samples: usize, modes: usize) -> f64 {
    let linear = match settings.control {
        ControlVariate::Linearised => 2 * modes,
        ControlVariate::None => 0,
    };
    (samples + linear) as f64
}

/// Computes the errors of estimates from the first `count` samples of each repetition.
fn errors_of(
    draws: &[Draws],
    count: usize,
    settings: &Sampling,
    (truth, control): (f64, Control),
) -> anyhow::Result<Errors> {
    let (mut estimates, mut stated) = (Vec::new(), 0.0);
    for draw in draws {
        let values = &draw.values[..count];
        let is_controlled = settings.control == ControlVariate::Linearised;
        let samples = ControlledSamples {
            values,
            control: is_controlled.then(|| (&draw.controls[..count], control)),
        };
        let row = response_of(0, samples, settings)?;
        let (percentile, variance) = (row.measure, row.measure_variance);
        estimates.push(percentile);
        stated += variance / draws.len() as f64;
    }
    let (mean, sd) = stats::mean_sd(&estimates)?;
    let off: Vec<f64> = estimates.iter().map(|estimate| estimate - truth).collect();
    Ok(Errors {
        rmse: root_mean_square(&off),
        bias: mean - truth,
        stated: stated / (sd * sd),
    })
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    fn paper() -> Problem {
        Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap())
    }

    /// The standard error of m + z s is σ √(1/k + z²/(2 (k − 1))) for normal samples, except for
    /// terms in 1/k².
    #[test]
    fn errors_of_a_normal_percentile_shrink_like_the_root_of_the_samples() {
        let normal = stats::Sampling::Independent;
        let draws: Vec<Draws> = (0..600)
            .map(|repetition| {
                let drawn = (0..400).map(|sample| {
                    stats::normal_coefficients(normal, 1, Purpose::Test, repetition, sample, 1)
                        .unwrap()[0]
                });
                Draws {
                    values: drawn.collect(),
                    controls: Vec::new(),
                }
            })
            .collect();
        let settings = with(&paper().campaign().sampling, &ESTIMATORS[1]);
        let known = (stats::EXACT_Z90, Control { mean: 0.0, sd: 0.0 });
        let rmse = |count| {
            let errors = errors_of(&draws, count, &settings, known).unwrap();
            assert!((errors.stated - 1.0).abs() < 0.15, "{errors:?}");
            assert!(errors.bias.abs() < 4.0 * errors.rmse / 600_f64.sqrt());
            errors.rmse
        };
        for count in [25, 100] {
            // The standard error of a standard deviation from 600 repetitions is 3 %.
            let ratio = rmse(count) / rmse(4 * count);
            assert!((ratio - 2.0).abs() < 0.25, "{count}: {ratio}");
        }
        let expected = (1.0 / 100.0 + stats::EXACT_Z90.powi(2) / (2.0 * 99.0)).sqrt();
        assert!((rmse(100) / expected - 1.0).abs() < 0.12);
    }

    #[test]
    fn every_method_is_measured_with_at_least_its_fewest_samples() {
        let table = run(&paper(), Size::Designs(2), &mut |_| {}).unwrap();
        let has = |method: &str, setting: &str| {
            let mut rows = table.rows.iter();
            rows.any(|row| row.method == method && row.setting == setting)
        };
        for Estimator { name, .. } in methods() {
            assert!(
                has(name, "500 samples") || has(name, "496 samples"),
                "{name}"
            );
        }
        assert!(!has("quasi-random", "24 samples") && has("quasi-random", "32 samples"));
        assert!(!has("Harrell–Davis", "5 samples") && has("paper", "5 samples"));
        let own: Vec<_> = table.rows.iter().filter(|row| row.is_campaign).collect();
        assert!(
            own.iter()
                .all(|row| row.method == "paper" && row.setting == "30 samples")
        );
        assert!((1..=2).contains(&own.len()));
    }
}
