//! What choosing an estimator of P90 by design changes.

use anyhow::Context as _;
use campaign::file::Sampling;
use stages::responses::{SIGNIFICANCE, Sampled, sampled};
use store::{ResponseRow, Store};

/// What the choice changes in a campaign.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Effect {
    /// How far each design's P90 that is Harrell and Davis's lies from what the rule's normal
    /// percentile would be, µm; in ascending order.
    pub(super) moved_um: Vec<f64>,
}

impl Effect {
    /// The median of what P90 is moved by, µm; zero where nothing is.
    pub(super) fn median_um(&self) -> f64 {
        let moved = &self.moved_um;
        moved.get(moved.len() / 2).copied().unwrap_or(0.0)
    }
}

/// The effect of the choice, if the campaign makes one.
pub(super) async fn effect(
    store: &Store,
    sampling: &Sampling,
    responses: &[ResponseRow],
) -> anyhow::Result<Option<Effect>> {
    if sampling.percentile.harrell_davis().is_none() {
        return Ok(None);
    }
    let mut moved_um = Vec::new();
    for row in responses {
        if row.lilliefors_p.is_none_or(|p| p >= SIGNIFICANCE) {
            continue;
        }
        // Those beyond a hole are in no response.
        let samples: Vec<f64> = store
            .samples_of(row.design)
            .await?
            .into_iter()
            .enumerate()
            .take_while(|(index, (sample, _))| *sample == *index as u64)
            .map(|(_, (_, value))| value)
            .collect();
        moved_um.extend(
            moved(row, &samples, sampling)
                .with_context(|| format!("the samples of design {}", row.design))?,
        );
    }
    moved_um.sort_by(f64::total_cmp);
    Ok(Some(Effect { moved_um }))
}

/// How far a response lies from the normal percentile of the samples that it is made of, by the
/// formula of the designs whose normality is not rejected; none where it is that percentile, since
/// there are too few samples for another.
fn moved(
    row: &ResponseRow,
    samples: &[f64],
    sampling: &Sampling,
) -> Result<Option<f64>, stats::Error> {
    let count = match sampled(samples, sampling)? {
        Sampled::Enough(count) => count,
        Sampled::Wants { at_least, .. } => at_least,
    };
    if count < stats::harrell_davis_min_samples(sampling.level()) {
        return Ok(None);
    }
    let normal = stats::normal_p90(&samples[..count], &sampling.normal())?;
    Ok(Some((row.p90_um - normal.p90).abs()))
}

#[cfg(test)]
mod tests {
    use campaign::Campaign;
    use campaign::file::PercentileRule;
    use stages::responses::{Samples, response};

    use super::*;

    /// The other estimator is the one without bias, z s/c₄, and of the samples that the response rests
    /// on, not of all there are.
    #[test]
    fn the_effect_is_the_distance_from_the_percentile_that_would_be_used_instead() {
        let mut sampling = Campaign::parse("paper.toml", Campaign::PAPER)
            .unwrap()
            .sampling;
        sampling.percentile = PercentileRule::Chosen;
        sampling.samples_per_design = 12;
        let samples: Vec<f64> = (0..40).map(|index| f64::from(index).powi(6)).collect();
        let row = response(0, Samples::plain(&samples[..12]), &sampling).unwrap();
        assert!(row.lilliefors_p.unwrap() < SIGNIFICANCE);
        let c4 = stats::c4(12).unwrap();
        let normal = row.mean_um + stats::EXACT_Z90 * row.sd_um / c4;
        let found = moved(&row, &samples, &sampling).unwrap().unwrap();
        assert!(
            (found - (row.p90_um - normal).abs()).abs() < 1e-9 * normal,
            "{found}"
        );
        let with_bias = row.mean_um + stats::EXACT_Z90 * row.sd_um;
        assert!((found - (row.p90_um - with_bias).abs()).abs() > 1e-3 * normal);

        // With fewer samples the percentile is the normal one whatever the test says.
        sampling.samples_per_design = 9;
        let row = response(0, Samples::plain(&samples[..9]), &sampling).unwrap();
        assert_eq!(moved(&row, &samples, &sampling), Ok(None));
    }
}
