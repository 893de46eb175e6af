//! Facts about simulator and sampling, for the tiles of the report.

use gear::{Discretisation, LocalAmount, Wear, WearLaw};
use problem::file::{ControlVariate, EstimatorRule, SIGNIFICANCE};
use stages::designs;
use stats::{HarrellDavisVariance, Measure};

use crate::snapshot::Snapshot;

/// (label, value) pairs.
pub(super) fn facts(snapshot: &Snapshot) -> Vec<(String, String)> {
    let campaign = snapshot.problem.campaign();
    let mut facts = Vec::new();
    if campaign.is_external() {
        facts.push(("simulator".to_owned(), "an external program".to_owned()));
    }
    if let Some(sections) = campaign.gears() {
        if !campaign.is_external() {
            let model = sections.pair.tooth_model;
            facts.push(("tooth model".to_owned(), model.to_string()));
            let error = gear::model_error(model).to_owned();
            facts.push(("the model's own error".to_owned(), error));
            for warning in campaign.warnings() {
                facts.push(("warning".to_owned(), warning));
            }
        }
        let grid = sections.grid;
        if grid != Discretisation::of(sections.pair.tooth_model) {
            let grid = format!("{} cells, {} phases", grid.cells, grid.phases);
            facts.push(("grid".to_owned(), grid));
        }
        facts.push(("wear".to_owned(), wear(&sections.wear)));
        if let Some(manufacture) = &sections.manufacture {
            facts.push(("manufacture".to_owned(), manufacture.describe()));
        }
    }
    if let Some(evenness) = designs::evenness(&snapshot.problem, &snapshot.designs) {
        facts.push(("design of experiments".to_owned(), evenness));
    }
    facts.extend(ruled_out(snapshot));
    facts.extend(precision(snapshot));
    facts.extend(estimator(snapshot));
    if campaign.sampling.control == ControlVariate::Linearised {
        facts.push((
            "control variate".to_owned(),
            "ΔSTE linearised in the wear, for two more analyses per coefficient and design"
                .to_owned(),
        ));
    }
    let coefficients = match campaign.sampling.coefficients() {
        stats::Sampling::Independent => return facts,
        stats::Sampling::Antithetic => "in pairs of opposite signs".to_owned(),
        stats::Sampling::Quasi { group } => {
            format!("quasi-random, in scrambled Sobol sequences of {group} samples")
        }
    };
    let measure = campaign.measure_name();
    facts.push((
        "coefficients of the wear".to_owned(),
        format!("{coefficients}; {measure} is m + z s, with the jackknife variance over them"),
    ));
    facts
}

/// The law of wear with its depth or coefficient.
fn wear(wear: &Wear) -> String {
    match wear.law {
        WearLaw::Archard { max_depth_um } => {
            format!("Archard's law, {max_depth_um} µm per flank at the deepest point")
        }
        WearLaw::Signed { coefficient } => {
            format!("signed law, {coefficient:e} per MPa: adds material beyond the pitch point")
        }
        WearLaw::LocalArchard { amount } => {
            let amount = match amount {
                LocalAmount::MaxDepth { max_depth_um } => {
                    format!("{max_depth_um} µm at the deepest point of both flanks")
                }
                LocalAmount::Cycles {
                    coefficient,
                    pinion_cycles,
                } => format!("{coefficient:e} mm²/N over {pinion_cycles:e} cycles of the pinion"),
            };
            format!("Archard's law with the sliding of each flank, {amount}")
        }
    }
}

/// The number of designs without samples because of their constraints.
fn ruled_out(snapshot: &Snapshot) -> Option<(String, String)> {
    let limit = snapshot.problem.campaign().sampling.skip_violation()?;
    let count = snapshot
        .criteria
        .iter()
        .filter(|row| row.simulable && row.reason.is_some())
        .count();
    let by = if limit > 0.0 {
        format!(" (a violation above {limit})")
    } else {
        String::new()
    };
    Some((
        "ruled out by constraints".to_owned(),
        format!("{count} designs, without samples{by}"),
    ))
}

/// The number of designs whose sampling reached the precision.
fn precision(snapshot: &Snapshot) -> Option<(String, String)> {
    let sampling = &snapshot.problem.campaign().sampling;
    let precision = sampling.precision?;
    let unit = match &*snapshot.problem.measured().unit {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    let reached = |row: &&store::ResponseRow| row.measure_variance.sqrt() <= precision;
    let reached = snapshot.responses.iter().filter(reached).count();
    Some((
        format!("precision of {}", snapshot.measure_name()),
        format!(
            "{precision}{unit}, reached by {reached} of {} designs with {} samples (at most {} each)",
            snapshot.responses.len(),
            snapshot.samples,
            sampling.samples_max()
        ),
    ))
}

/// The estimator of the measure, and the number of designs whose samples are not normal.
fn estimator(snapshot: &Snapshot) -> Option<(String, String)> {
    let sampling = &snapshot.problem.campaign().sampling;
    // The fact about the coefficients names the estimator.
    if sampling.coefficients() != stats::Sampling::Independent {
        return None;
    }
    let rejected = |row: &&store::ResponseRow| row.lilliefors_p.is_some_and(|p| p < SIGNIFICANCE);
    let rejected = snapshot.responses.iter().filter(rejected).count();
    let of_them = format!(
        "{rejected} of {} designs where normality is rejected at {:.0} %",
        snapshot.responses.len(),
        100.0 * SIGNIFICANCE
    );
    let rule = sampling.estimator_rule();
    let needed = sampling.measure().free_min_samples();
    let is_served = sampling.samples_per_design as usize >= needed;
    let variance = match rule.harrell_davis() {
        Some(HarrellDavisVariance::Bootstrap) => "exact bootstrap variance",
        _ => "jackknife variance",
    };
    let measure = sampling.measure();
    let normal = match (rule, measure) {
        (_, Measure::Mean) => "m",
        (_, Measure::Exceedance { .. }) => "that of a normal response",
        (EstimatorRule::Paper, _) => "m + z s",
        // s/c₄ has no bias, z is exact.
        _ => "m + z s/c₄ (s without bias)",
    };
    let free = match measure {
        Measure::Percentile { .. } => format!("Harrell–Davis ({variance})"),
        _ => "without a distribution".to_owned(),
    };
    let text = match rule {
        EstimatorRule::DistributionFree if is_served => {
            format!("{free} for all designs; {of_them}")
        }
        EstimatorRule::Chosen | EstimatorRule::ChosenBootstrap if is_served => {
            format!("{normal}; {free} for the {of_them}")
        }
        EstimatorRule::Paper | EstimatorRule::Normal => {
            format!("{normal} for all designs, also for the {of_them}")
        }
        _ => format!(
            "{normal} for all designs, also for the {of_them}: {} of samples that are not normal takes \
             {needed} samples a design",
            snapshot.measure_name()
        ),
    };
    Some(("estimator".to_owned(), text))
}
