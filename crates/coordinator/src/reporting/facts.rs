//! What a reader ought to know of how a campaign's numbers came about.

use campaign::file::{ControlVariate, PercentileRule};

use super::Sources;
use crate::sampling::SIGNIFICANCE;

/// (label, value) pairs.
pub(super) fn facts(sources: &Sources) -> Vec<(String, String)> {
    let campaign = sources.problem.campaign();
    let mut facts = vec![
        if campaign.is_external() {
            ("simulator".to_owned(), "an external program".to_owned())
        } else {
            ("tooth model".to_owned(), campaign.pair.tooth_model.clone())
        },
        (
            "wear".to_owned(),
            format!(
                "{} µm per flank at the deepest point",
                campaign.wear.max_depth_um
            ),
        ),
    ];
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
    facts
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
        "precision of P90".to_owned(),
        format!(
            "{precision} µm, reached by {reached} of {} designs with {} samples (at most {} each)",
            sources.responses.len(),
            sources.samples,
            sampling.samples_max()
        ),
    ))
}

/// What the choice of an estimator changed.
fn percentiles(sources: &Sources) -> Option<(String, String)> {
    let rule = sources.problem.campaign().sampling.percentile;
    let (label, z) = ("percentile".to_owned(), stats::EXACT_Z90);
    match rule {
        PercentileRule::Paper => None,
        PercentileRule::Normal => Some((label, "m + z s, unbiased".to_owned())),
        PercentileRule::Chosen => {
            let rejected =
                |row: &&store::ResponseRow| row.lilliefors_p.is_some_and(|p| p < SIGNIFICANCE);
            let mut moved: Vec<f64> = sources
                .responses
                .iter()
                .filter(rejected)
                .map(|row| (row.p90_um - (row.mean_um + z * row.sd_um)).abs())
                .collect();
            moved.sort_by(f64::total_cmp);
            let median = moved.get(moved.len() / 2).copied().unwrap_or(0.0);
            Some((
                label,
                format!(
                    "m + z s; Harrell–Davis for the {} of {} designs where normality is rejected \
                     at {:.0} %, which moves it by {median:.3} µm in the median",
                    moved.len(),
                    sources.responses.len(),
                    100.0 * SIGNIFICANCE
                ),
            ))
        }
    }
}
