//! What a reader ought to know of how a campaign's numbers came about.

use campaign::file::{ControlVariate, PercentileRule, Wear};
use stages::designs;
use stages::responses::SIGNIFICANCE;
use stats::HarrellDavisVariance;

use super::sources::Sources;

/// (label, value) pairs.
pub(super) fn facts(sources: &Sources) -> Vec<(String, String)> {
    let campaign = sources.problem.campaign();
    let mut facts = Vec::new();
    if campaign.is_external() {
        facts.push(("simulator".to_owned(), "an external program".to_owned()));
    }
    if let Some(sections) = campaign.gears() {
        if !campaign.is_external() {
            let model = sections.pair.tooth_model.clone();
            facts.push(("tooth model".to_owned(), model));
        }
        if sections.accuracy.is_some() {
            let grid = sections.grid();
            let grid = format!("{} cells, {} phases", grid.cells, grid.phases);
            facts.push(("grid".to_owned(), grid));
        }
        facts.push(("wear".to_owned(), wear(&sections.wear)));
        if let Some(manufacture) = &sections.manufacture {
            facts.push(("manufacture".to_owned(), manufacture.describe()));
        }
    }
    if let Some(evenness) = designs::evenness(&sources.problem, &sources.designs) {
        facts.push(("design of experiments".to_owned(), evenness));
    }
    facts.extend(ruled_out(sources));
    facts.extend(precision(sources));
    facts.extend(percentiles(sources));
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
    let percentile = campaign.sampling.percentile_name();
    facts.push((
        "coefficients of the wear".to_owned(),
        format!("{coefficients}; {percentile} is m + z s, with the jackknife variance over them"),
    ));
    facts
}

/// The law of wear with its depth or coefficient.
fn wear(wear: &Wear) -> String {
    match (wear.max_depth_um, wear.coefficient_per_mpa) {
        (_, Some(coefficient)) => {
            format!("signed law, {coefficient:e} per MPa: adds material beyond the pitch point")
        }
        (depth, None) => {
            let depth = depth.unwrap_or_default();
            format!("Archard's law, {depth} µm per flank at the deepest point")
        }
    }
}

/// How many designs got no samples because of their constraints.
fn ruled_out(sources: &Sources) -> Option<(String, String)> {
    let limit = sources.problem.campaign().sampling.skip_violation()?;
    let count = sources
        .criteria
        .iter()
        .filter(|row| row.feasible && row.reason.is_some())
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

/// What sampling to a precision came to.
fn precision(sources: &Sources) -> Option<(String, String)> {
    let sampling = &sources.problem.campaign().sampling;
    let precision = sampling.precision_um?;
    let reached = |row: &&store::ResponseRow| row.p90_variance_um2.sqrt() <= precision;
    let reached = sources.responses.iter().filter(reached).count();
    Some((
        format!("precision of {}", sampling.percentile_name()),
        format!(
            "{precision} µm, reached by {reached} of {} designs with {} samples (at most {} each)",
            sources.responses.len(),
            sources.samples,
            sampling.samples_max()
        ),
    ))
}

/// How P90 is estimated, and what the choice of an estimator changed.
fn percentiles(sources: &Sources) -> Option<(String, String)> {
    let rule = sources.problem.campaign().sampling.percentile;
    // s/c₄ has no bias, z is exact: the formula that both rules use.
    let normal = "m + z s/c₄ (s without bias)";
    let text = match (rule, rule.harrell_davis(), &sources.choice) {
        (PercentileRule::Paper, ..) => return None,
        // Said with the coefficients.
        _ if sources.problem.campaign().sampling.coefficients() != stats::Sampling::Independent => {
            return None;
        }
        (_, Some(variance), Some(effect)) => format!(
            "{normal}; Harrell–Davis ({}) for the {} of {} designs where normality is rejected at \
             {:.0} %, which moves {} by {:.3} µm from m + z s/c₄ in the median",
            match variance {
                HarrellDavisVariance::Jackknife => "jackknife variance",
                HarrellDavisVariance::Bootstrap => "exact bootstrap variance",
            },
            effect.moved_um.len(),
            sources.responses.len(),
            100.0 * SIGNIFICANCE,
            sources.problem.campaign().sampling.percentile_name(),
            effect.median_um(),
        ),
        _ => normal.to_owned(),
    };
    Some(("percentile".to_owned(), text))
}
