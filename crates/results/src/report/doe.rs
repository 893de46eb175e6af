//! The responses of the designs of the DoE.

use std::collections::BTreeMap;

use super::paper;
use crate::snapshot::Snapshot;

/// The responses of one simulable design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoePoint {
    /// ΔSTE without wear, µm.
    pub delta_ste_um: f64,
    /// ΔSTE with Archard's wear, µm.
    pub delta_ste_archard_um: f64,
    /// Estimated measure of ΔSTE with random wear, µm.
    pub measure_um: f64,
}

/// The simulable designs, in their order.
pub(super) fn points(snapshot: &Snapshot) -> Vec<DoePoint> {
    let percentiles = snapshot.responses.iter();
    let percentiles: BTreeMap<u64, f64> =
        percentiles.map(|row| (row.design, row.measure)).collect();
    let simulable = snapshot.criteria.iter().filter(|row| row.simulable);
    simulable
        .map(|row| {
            let responses = row.responses.as_deref().unwrap_or_default();
            let named = |name| snapshot.problem.response(responses, name);
            DoePoint {
                delta_ste_um: named("delta_ste_um").unwrap_or(f64::NAN),
                delta_ste_archard_um: named("delta_ste_archard_um").unwrap_or(f64::NAN),
                measure_um: percentiles.get(&row.design).copied().unwrap_or(f64::NAN),
            }
        })
        .collect()
}

/// The three responses of a design.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Response {
    /// ΔSTE without wear.
    Unworn,
    /// ΔSTE with Archard's wear.
    Archard,
    /// Estimated measure of ΔSTE with random wear.
    Percentile,
}

impl Response {
    const ALL: [Self; 3] = [Self::Unworn, Self::Archard, Self::Percentile];

    /// The response of a design, µm.
    #[must_use]
    pub fn of(self, point: &DoePoint) -> f64 {
        match self {
            Self::Unworn => point.delta_ste_um,
            Self::Archard => point.delta_ste_archard_um,
            Self::Percentile => point.measure_um,
        }
    }

    /// The response's name; `measure` is the measure's.
    #[must_use]
    pub fn label(self, measure: &str) -> String {
        match self {
            Self::Unworn => "ΔSTE without wear".to_owned(),
            Self::Archard => "ΔSTE with Archard’s wear".to_owned(),
            Self::Percentile => format!("{measure} of ΔSTE with random wear"),
        }
    }
}

/// A row of Table 3: a response over the designs for which it is finite.
pub(crate) struct ResponseStatistics {
    pub(crate) response: Response,
    pub(crate) designs: u64,
    /// NaN without a design, as are the others.
    pub(crate) mean: f64,
    pub(crate) least: f64,
    pub(crate) greatest: f64,
    /// The paper's row.
    pub(crate) printed: &'static paper::ResponseRow,
}

/// Table 3.
pub(crate) fn statistics(points: &[DoePoint]) -> Vec<ResponseStatistics> {
    let rows = Response::ALL.into_iter().zip(&paper::RESPONSES);
    rows.map(|(response, printed)| {
        let values = points.iter().map(|point| response.of(point));
        let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        ResponseStatistics {
            response,
            designs: values.len() as u64,
            mean: values.iter().sum::<f64>() / values.len() as f64,
            least: values.iter().copied().fold(f64::NAN, f64::min),
            greatest: values.iter().copied().fold(f64::NAN, f64::max),
            printed,
        }
    })
    .collect()
}
