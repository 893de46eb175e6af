//! The number of samples that a design needs, and its response.

use std::collections::BTreeMap;

use problem::file::Sampling;
use problem::formulation::{Design, Problem, ResponseMeasure};
use rayon::prelude::*;
use stats::streams::{Purpose, stream};
use stats::{Samples, VarianceFormula};
use store::{DesignRow, ResponseRow};

use crate::linear::LinearResponse;

/// The values of a design's samples, with their control variate if there is one.
#[derive(Debug, Clone, Copy)]
pub struct ControlledSamples<'a> {
    /// The values of the samples from the first on, without a hole: for a gear pair ΔSTE, µm.
    pub values: &'a [f64],
    /// The control variate's value for each sample, and its moments.
    pub control: Option<(&'a [f64], stats::Control)>,
}

/// Whether a design has enough samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sufficiency {
    /// The design has enough samples; its response is computed from this many of them.
    Enough(usize),
    /// The design needs more samples.
    Wants {
        /// Number of samples needed.
        samples: usize,
        /// Number of its present samples from which a response can be computed in the meantime.
        at_least: usize,
    },
}

/// Whether a design has enough samples. `samples` are those from the first on, without a gap. The size of a batch
/// depends only on the batches before it, so additional samples change nothing.
pub fn sufficiency(samples: &[f64], sampling: &Sampling) -> Result<Sufficiency, stats::Error> {
    let (held, first) = (samples.len(), sampling.samples_per_design as usize);
    let mut count = first.min(held);
    let Some(rule) = sampling.rule() else {
        return Ok(Sufficiency::Enough(count));
    };
    if held < first {
        // Some samples were discarded.
        return Ok(Sufficiency::Wants {
            samples: first,
            at_least: held,
        });
    }
    loop {
        let row = response(0, ControlledSamples::plain(&samples[..count]), sampling)?;
        let of_normal = match rule.variance {
            VarianceFormula::Taylor => stats::percentile_variance,
            VarianceFormula::Exact => stats::exact_percentile_variance,
        };
        let normal = of_normal(row.standard_deviation.powi(2), count, rule.z)?;
        // The standard deviation of normal samples whose percentile would be as uncertain as this estimate.
        let sd = if normal > 0.0 {
            row.standard_deviation * (row.measure_variance / normal).sqrt()
        } else {
            row.standard_deviation
        };
        let more = stats::samples_needed(count, sd, &rule)?;
        if more == 0 {
            return Ok(Sufficiency::Enough(count));
        }
        if count + more > held {
            return Ok(Sufficiency::Wants {
                samples: count + more,
                at_least: count,
            });
        }
        count += more;
    }
}

/// All measures of a design from its samples, that of the objective first. A control variate belongs to the objective
/// alone.
pub fn measures(
    problem: &Problem,
    design: u64,
    samples: &Samples,
    control: Option<(&[f64], stats::Control)>,
) -> Result<Vec<ResponseRow>, stats::Error> {
    let row = |(number, measure): (u64, &ResponseMeasure)| {
        let values = measure.values(samples);
        let samples = ControlledSamples {
            values: &values,
            control: control.filter(|_| number == 0),
        };
        let row = response_of(design, samples, measure.sampling())?;
        Ok(ResponseRow { number, ..row })
    };
    (0..).zip(problem.measures()).map(row).collect()
}

/// The response of one design of the DoE from its samples, by the campaign's settings.
///
/// Samples whose coefficients depend on each other make m + z σ̂ with the jackknife variance over
/// their groups, [`stats::grouped_p90`]. They have no p-value: Lilliefors' test takes independent
/// samples.
pub fn response_of(
    design: u64,
    samples: ControlledSamples<'_>,
    settings: &Sampling,
) -> Result<ResponseRow, stats::Error> {
    let group = match settings.coefficients() {
        stats::Sampling::Independent => return response(design, samples, settings),
        even => even.group(),
    };
    let estimate = stats::grouped_p90(samples.values, group, settings.normal().z)?;
    Ok(ResponseRow {
        design,
        number: 0,
        mean: estimate.mean,
        standard_deviation: estimate.sd,
        measure: estimate.p90,
        measure_variance: estimate.variance,
        lilliefors_p: None,
    })
}

/// The response of one design from independent samples.
pub fn response(
    design: u64,
    samples: ControlledSamples<'_>,
    settings: &Sampling,
) -> Result<ResponseRow, stats::Error> {
    let ControlledSamples { values, control } = samples;
    // Without random wear the control is constant, and of no use.
    if let Some((controls, known)) = control
        && known.sd > 0.0
    {
        let estimate = stats::control_variate_p90(values, controls, known, settings.normal().z)?;
        return Ok(ResponseRow {
            design,
            number: 0,
            mean: estimate.mean,
            standard_deviation: estimate.sd,
            measure: estimate.p90,
            measure_variance: estimate.variance,
            lilliefors_p: stats::lilliefors(values).ok().map(|test| test.p_value),
        });
    }
    let choice = settings.estimate(values)?;
    Ok(ResponseRow {
        design,
        number: 0,
        mean: choice.normal.mean,
        standard_deviation: choice.normal.sd,
        measure: choice.chosen.value,
        measure_variance: choice.chosen.variance,
        // Identical samples have no distribution to test; the row then has no p-value.
        lilliefors_p: choice.p_value,
    })
}

impl<'a> ControlledSamples<'a> {
    /// Samples without a control variate.
    #[must_use]
    pub const fn plain(values: &'a [f64]) -> Self {
        Self {
            values,
            control: None,
        }
    }
}

/// The linear responses of designs, which serve as control variates. Designs that cannot be
/// simulated have none.
#[must_use]
pub fn linearise(
    problem: &Problem,
    base: &Design,
    designs: &[DesignRow],
) -> BTreeMap<u64, LinearResponse> {
    designs
        .par_iter()
        .filter_map(|row| {
            let design = problem.design(&row.x, base);
            Some((
                row.design,
                LinearResponse::of(problem.gears()?, &design).ok()?,
            ))
        })
        .collect()
}

/// The control's values for the first `count` samples of a design of the DoE ([`Purpose::Wear`]) or
/// of a point ([`Purpose::Verify`]).
#[must_use]
pub fn controls(
    problem: &Problem,
    (purpose, number): (Purpose, u64),
    linear: &LinearResponse,
    count: usize,
) -> Vec<f64> {
    let seed = problem.campaign().seed;
    (0..count as u64)
        .map(|sample| linear.of_sample(&mut stream(seed, purpose, number, sample)))
        .collect()
}

#[cfg(test)]
mod tests {
    use problem::file::{EstimatorRule, SIGNIFICANCE};

    use super::*;

    fn sampling(precision: Option<f64>) -> Sampling {
        Sampling {
            samples_per_design: 10,
            precision,
            samples_max: precision.map(|_| 60),
            skip_violation: None,
            estimator: Some(EstimatorRule::Normal),
            control: problem::file::ControlVariate::None,
            coefficients: problem::file::WearCoefficients::Independent,
            group: None,
            failed: problem::file::FailedSamples::Worst,
            objective: problem::file::Objective::percentile(0.9),
        }
    }

    /// Alternating around 1 with a standard deviation of about `sd`.
    fn samples(count: usize, sd: f64) -> Vec<f64> {
        (0..count)
            .map(|index| if index % 2 == 0 { 1.0 - sd } else { 1.0 + sd })
            .collect()
    }

    #[test]
    fn without_a_precision_every_design_gets_the_same() {
        let found = sufficiency(&samples(25, 9.0), &sampling(None));
        assert_eq!(found, Ok(Sufficiency::Enough(10)));
    }

    #[test]
    fn a_design_gets_samples_until_its_standard_error_is_below_the_precision() {
        let precise = sampling(Some(0.1));
        // A standard deviation of 0.1 takes about 1.8 · (0.1/0.1)² samples, one of 0.35 takes 25.
        assert_eq!(
            sufficiency(&samples(10, 0.1), &precise),
            Ok(Sufficiency::Enough(10))
        );
        // Never more than twice as many at a time, since the deviation is an estimate.
        let wants = |samples, at_least| Ok(Sufficiency::Wants { samples, at_least });
        assert_eq!(sufficiency(&[], &precise), wants(10, 0));
        assert_eq!(sufficiency(&samples(10, 0.35), &precise), wants(20, 10));
        assert_eq!(sufficiency(&samples(20, 0.35), &precise), wants(30, 20));
        let enough = 30;
        assert_eq!(
            sufficiency(&samples(enough, 0.35), &precise),
            Ok(Sufficiency::Enough(enough))
        );
        let row = response(
            0,
            ControlledSamples::plain(&samples(enough, 0.35)),
            &sampling(None),
        )
        .unwrap();
        assert!(row.measure_variance.sqrt() <= 0.1, "{row:?}");
        // Samples that came early change nothing.
        assert_eq!(
            sufficiency(&samples(60, 0.35), &precise),
            Ok(Sufficiency::Enough(enough))
        );
        // A noisy design ends at the largest number of samples allowed.
        assert_eq!(
            sufficiency(&samples(60, 40.0), &precise),
            Ok(Sufficiency::Enough(60))
        );
    }

    #[test]
    fn the_rule_decides_between_estimators() {
        let skewed: Vec<f64> = (0..40).map(|index| f64::from(index).powi(6)).collect();
        let of = |percentile| {
            let settings = Sampling {
                estimator: Some(percentile),
                ..sampling(None)
            };
            response(3, ControlledSamples::plain(&skewed), &settings).unwrap()
        };
        let (paper, normal, chosen) = (
            of(EstimatorRule::Paper),
            of(EstimatorRule::Normal),
            of(EstimatorRule::Chosen),
        );
        assert!(chosen.lilliefors_p.unwrap() < SIGNIFICANCE);
        let expected = stats::harrell_davis_p90(&skewed).unwrap();
        assert_eq!(chosen.measure, expected.value);
        assert_eq!(chosen.measure_variance, expected.variance);
        let bootstrap = of(EstimatorRule::ChosenBootstrap);
        assert_eq!(bootstrap.measure, chosen.measure);
        let expected = stats::HarrellDavisVariance::Bootstrap;
        let expected = stats::harrell_davis(&skewed, 0.9, expected).unwrap();
        assert_eq!(bootstrap.measure_variance, expected.variance);
        assert_ne!(bootstrap.measure_variance, chosen.measure_variance);
        let plain = stats::percentile_p90(&skewed).unwrap();
        assert_eq!(
            (paper.measure, paper.measure_variance),
            (plain.p90, plain.variance)
        );
        // Exact z and an unbiased s both raise it.
        assert!(normal.measure > paper.measure);
    }

    /// Compares the scatter of the P90 of one pair over independent streams, as workers and
    /// coordinator compute it, with the variance that the responses state, which kriging takes as
    /// its noise.
    #[test]
    fn every_kind_of_coefficients_states_the_variance_it_has() {
        use ledger::{Generation, StreamId, Unit};
        use problem::file::WearCoefficients;
        use problem::task::{self, Output, Source};

        let mut campaign =
            problem::Campaign::parse("paper.toml", problem::Campaign::PAPER).unwrap();
        let (samples, replications) = (64, 400);
        campaign.sampling.samples_per_design = samples;
        campaign.sampling.estimator = Some(EstimatorRule::Normal);
        let mut of_mean = Vec::new();
        let mut of_p90 = Vec::new();
        for coefficients in [
            WearCoefficients::Independent,
            WearCoefficients::Antithetic,
            WearCoefficients::QuasiRandom,
        ] {
            campaign.sampling.coefficients = coefficients;
            let problem = Problem::new(campaign.clone());
            // The paper's Figure 7.
            let x = [0.49, 0.49, 1.20, 1.11, 1.00, 1.09];
            let source = Source::Design(problem.design(&x, problem.base()));
            let rows: Vec<ResponseRow> = (0..replications)
                .map(|design| {
                    let unit = Unit {
                        stream: StreamId::design(design),
                        generation: Generation::default(),
                        samples: 0..samples,
                    };
                    let output = task::compute(&problem, &unit, &source);
                    let Ok(Output::Design { samples, .. }) = &output else {
                        panic!("the paper's design can be simulated")
                    };
                    let samples = ControlledSamples::plain(samples.values());
                    response_of(0, samples, &campaign.sampling).unwrap()
                })
                .collect();
            let scatter = |value: fn(&ResponseRow) -> f64| {
                let values: Vec<f64> = rows.iter().map(value).collect();
                stats::mean_sd(&values).unwrap().1.powi(2)
            };
            let p90 = scatter(|row| row.measure);
            let stated =
                rows.iter().map(|row| row.measure_variance).sum::<f64>() / f64::from(replications);
            // A variance of 400 is known to 7 %; the jackknife over 8 groups is too large by an
            // eighth.
            let ratio = stated / p90;
            assert!((0.8..1.35).contains(&ratio), "{coefficients:?}: {ratio}");
            of_mean.push(scatter(|row| row.mean));
            of_p90.push(p90);
        }
        // ΔSTE is nearly linear in the coefficients, so that the mean gains most; an estimate of the
        // spread gains from an even sequence, not from signs.
        assert!(of_mean[1] < 0.3 * of_mean[0], "{of_mean:?}");
        assert!(of_mean[2] < 0.5 * of_mean[0], "{of_mean:?}");
        assert!(of_p90[2] < 0.8 * of_p90[0], "{of_p90:?}");
    }

    #[test]
    fn the_linear_response_makes_few_samples_as_good_as_thousands() {
        let campaign = problem::Campaign::parse("paper.toml", problem::Campaign::PAPER).unwrap();
        let problem = Problem::new(campaign);
        let base = problem.base().clone();
        // The paper's Figure 7.
        let design = DesignRow {
            design: 7,
            x: vec![0.49, 0.49, 1.20, 1.11, 1.00, 1.09],
        };
        let linear = &linearise(&problem, &base, std::slice::from_ref(&design))[&7];
        let gears = problem.gears().unwrap();
        let pair = gears.pair(&problem.design(&design.x, &base)).unwrap();
        let mut sampler = gears.sampler(&pair);
        let seed = problem.campaign().seed;
        let values: Vec<f64> = (0..20_000)
            .map(|sample| sampler.draw(&mut stream(seed, Purpose::Wear, 7, sample)))
            .collect();
        let controls = controls(&problem, (Purpose::Wear, 7), linear, values.len());
        let of = |count: usize, control: bool| {
            let samples = ControlledSamples {
                values: &values[..count],
                control: control.then_some((&controls[..count], linear.moments())),
            };
            response(7, samples, &sampling(None)).unwrap()
        };
        let (all, plain, controlled) = (of(20_000, false), of(30, false), of(30, true));
        assert!(
            controlled.measure_variance < 0.01 * plain.measure_variance,
            "{controlled:?} beside {plain:?}"
        );
        let error = (all.measure_variance + controlled.measure_variance).sqrt();
        assert!(
            (controlled.measure - all.measure).abs() < 4.0 * error,
            "{controlled:?} beside {all:?}"
        );
    }

    /// ΔSTE is neither linear nor normal over slope deviations. The control keeps the percentile's mean;
    /// the variance of the normal formula is too small, that of the chosen estimator is right.
    #[test]
    fn percentiles_over_slope_deviations() {
        let mut campaign = problem::Campaign::parse("pair.toml", problem::Campaign::PAIR).unwrap();
        for (class, normal_states) in [(3, 0.7..0.9), (6, 0.5..0.7), (9, 0.55..0.75)] {
            let sections = campaign.gears_mut().unwrap();
            let flank_class = gear::FlankClass::new(class).unwrap();
            sections.manufacture = Some(problem::file::Manufacture {
                flank_class: Some(flank_class),
                ..Default::default()
            });
            let problem = Problem::new(campaign.clone());
            let base = problem.base().clone();
            let design = DesignRow {
                design: 7,
                x: problem.free_point(&vec![0.6; problem.dimension()]),
            };
            let linear = &linearise(&problem, &base, std::slice::from_ref(&design))[&7];
            let gears = problem.gears().unwrap();
            let pair = gears.pair(&problem.design(&design.x, &base)).unwrap();
            let mut sampler = gears.sampler(&pair);
            assert_eq!(linear.analyses(), 2 * sampler.modes() as u64);
            let (count, replications) = (64, 400);
            let seed = problem.campaign().seed;
            let values: Vec<f64> = (0..count * replications)
                .map(|sample| sampler.draw(&mut stream(seed, Purpose::Wear, 7, sample as u64)))
                .collect();
            let controls = controls(&problem, (Purpose::Wear, 7), linear, values.len());
            // The mean percentile with its standard error, and the ratio of its stated to its
            // actual scatter.
            let of = |percentile, controlled: bool| {
                let settings = Sampling {
                    estimator: Some(percentile),
                    ..sampling(None)
                };
                let rows = values.chunks(count).zip(controls.chunks(count));
                let rows: Vec<ResponseRow> = rows
                    .map(|(values, controls)| {
                        let control = controlled.then_some((controls, linear.moments()));
                        response(7, ControlledSamples { values, control }, &settings).unwrap()
                    })
                    .collect();
                let found: Vec<f64> = rows.iter().map(|row| row.measure).collect();
                let (mean, scatter) = stats::mean_sd(&found).unwrap();
                let stated = rows.iter().map(|row| row.measure_variance).sum::<f64>();
                let stated = (stated / replications as f64).sqrt() / scatter;
                (mean, scatter / (replications as f64).sqrt(), stated)
            };
            let (mean, sd) = stats::mean_sd(&values).unwrap();
            let expected = mean + sampling(None).normal().z * sd;
            let (controlled, error, _) = of(EstimatorRule::Normal, true);
            // The regression has a bias of order 1/n, as ΔSTE is not linear.
            assert!(
                (controlled - expected).abs() < sd / count as f64 + 4.0 * error,
                "class {class}: {controlled} against {expected}"
            );
            let (.., stated) = of(EstimatorRule::Normal, false);
            assert!(normal_states.contains(&stated), "class {class}: {stated}");
            let (.., stated) = of(EstimatorRule::Chosen, false);
            assert!((0.85..1.15).contains(&stated), "class {class}: {stated}");
        }
    }
}
