//! The section about the samples of the recommended design.

use super::figure::{Figure, figure};
use crate::number::count;
use crate::report::charts;
use crate::report::error::Error;
use crate::report::quantity::{approach_name, response_name};
use crate::snapshot::Snapshot;

/// The verification samples of the recommended design.
pub(super) struct DistributionView {
    pub(super) histogram: Figure,
    pub(super) cumulative: Figure,
    pub(super) caption: String,
}

impl DistributionView {
    /// `None` unless a design is recommended.
    pub(super) fn new(snapshot: &Snapshot) -> Result<Option<Self>, Error> {
        let problem = &snapshot.problem;
        let Some(best) = snapshot.optima.recommended() else {
            return Ok(None);
        };
        let values = best.values(problem);
        let response = response_name(problem);
        let samples = charts::VerifiedSamples {
            response: &response,
            unit: &problem.objective().response.unit,
            values: &values,
            // A probability is not a value of the response.
            measure: best
                .measure
                .filter(|_| !problem.campaign().sampling.objective.is_probability())
                .map(|measure| (snapshot.measure_name(), measure.value)),
        };
        Ok(Some(Self {
            histogram: figure("distribution-histogram", charts::histogram(&samples))?,
            cumulative: figure("distribution-cumulative", charts::cumulative(&samples))?,
            caption: format!(
                "The {} verification samples of {response} at the recommended design ({}): how many lie in each interval, \
                 and the share of them that is no greater.",
                count(values.len() as u64),
                approach_name(problem, best.optimum.approach),
            ),
        }))
    }

    pub(super) fn figures(&self) -> impl Iterator<Item = &Figure> {
        [&self.histogram, &self.cumulative].into_iter()
    }
}
