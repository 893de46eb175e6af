//! The table of designs: the state of each, and why one without samples has none.

use std::collections::BTreeMap;
use std::io::Write;

use ledger::StreamId;
use problem::file::Sampling;
use problem::formulation::{Design, Problem};
use problem::simulator::State;
use stages::{names, optima};
use store::{CriteriaRow, FailureKind, ResponseRow, Store};

use super::{Destination, coordinates, numbers, quantity};
use crate::row;
use crate::table::Column;

pub(super) async fn write<W: Write + Send>(
    store: &Store,
    problem: &Problem,
    out: Destination<'_, W>,
) -> anyhow::Result<()> {
    let responses = problem.responses();
    let mut columns = vec![Column::whole("design")];
    columns.extend(coordinates(problem));
    columns.extend(["simulable", "feasible", "samples"].map(Column::whole));
    columns.push(Column::text("reason"));
    columns.extend(responses.iter().map(quantity));
    let mut out = out.table(columns)?;
    let records = DesignRecords::read(store, problem).await?;
    for design in store.designs().await? {
        let record = records.of(design.design);
        let criteria = record.criteria;
        let feasible =
            criteria.and_then(|criteria| records.is_feasible(problem, &design.x, criteria));
        let mut row = row![design.design].to_vec();
        row.extend(numbers(Some(&design.x), 0));
        row.extend(row![
            criteria.map(|criteria| criteria.simulable),
            feasible,
            record.samples,
            record.reason(&problem.campaign().sampling),
        ]);
        let values = criteria.and_then(|row| row.responses.as_deref());
        row.extend(numbers(values, responses.len()));
        out.write(&row)?;
    }
    out.finish()
}

/// The rows of all designs.
struct DesignRecords {
    /// The variables that all designs share, once they are known.
    base: Option<Design>,
    criteria: BTreeMap<u64, CriteriaRow>,
    responses: BTreeMap<u64, ResponseRow>,
    samples: BTreeMap<u64, u64>,
    /// The error with which a job was quarantined last.
    quarantined: BTreeMap<StreamId, String>,
}

/// The rows of one design.
struct DesignRecord<'a> {
    criteria: Option<&'a CriteriaRow>,
    response: Option<&'a ResponseRow>,
    samples: u64,
    quarantined: Option<&'a str>,
}

impl DesignRecords {
    async fn read(store: &Store, problem: &Problem) -> anyhow::Result<Self> {
        let criteria = store.criteria().await?;
        let responses = store.responses().await?;
        let failures = store.failures().await?.into_iter();
        let quarantined = failures.filter(|row| row.kind == FailureKind::Quarantine);
        Ok(Self {
            base: optima::base(problem, &optima::stored(store, problem).await?),
            criteria: criteria.into_iter().map(|row| (row.design, row)).collect(),
            responses: responses.into_iter().map(|row| (row.design, row)).collect(),
            samples: store.sampled_counts().await?.into_iter().collect(),
            quarantined: quarantined.map(|row| (row.stream, row.error)).collect(),
        })
    }

    fn of(&self, design: u64) -> DesignRecord<'_> {
        DesignRecord {
            criteria: self.criteria.get(&design),
            response: self.responses.get(&design),
            samples: self.samples.get(&design).copied().unwrap_or(0),
            quarantined: self
                .quarantined
                .get(&names::design(design))
                .map(String::as_str),
        }
    }

    /// Whether all constraints hold in the baseline state, by which the best of the DoE is chosen. `None` while
    /// the variables that all designs share are not known.
    fn is_feasible(&self, problem: &Problem, x: &[f64], row: &CriteriaRow) -> Option<bool> {
        let Some(responses) = row.responses.as_deref() else {
            return Some(false);
        };
        let design = problem.design(x, self.base.as_ref()?);
        let analysis = problem.analysis(&design, responses, State::Baseline)?;
        Some(problem.is_feasible(&analysis.criteria))
    }
}

impl DesignRecord<'_> {
    /// Why the design has no samples, or fewer than it should have; empty if it has them.
    fn reason(&self, sampling: &Sampling) -> String {
        if let Some(reason) = self.criteria.and_then(|row| row.reason.as_deref()) {
            return reason.to_owned();
        }
        let (samples, wanted) = (self.samples, u64::from(sampling.samples_per_design));
        // A design that was quarantined before it reached the precision has a response, computed from the samples
        // taken until then.
        let is_precise = sampling.precision.is_none_or(|precision| {
            samples >= u64::from(sampling.samples_max())
                || self
                    .response
                    .is_some_and(|row| row.measure_variance.sqrt() <= precision)
        });
        if self.criteria.is_some() && samples >= wanted && is_precise {
            return String::new();
        }
        if let Some(error) = self.quarantined {
            return format!("quarantined: {error}");
        }
        match (self.criteria, self.response) {
            (None, _) => "not simulated yet".to_owned(),
            (Some(_), None) if samples < wanted => {
                format!("not sampled yet: {samples} of {wanted} samples")
            }
            (Some(_), None) => {
                format!("not sampled to the precision yet: {samples} samples")
            }
            (Some(_), Some(_)) => String::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    fn sampling(precision: Option<f64>) -> Sampling {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.sampling.precision = precision;
        campaign.sampling
    }

    fn reason(
        sampling: &Sampling,
        criteria: Option<Option<&str>>,
        samples: u64,
        variance: Option<f64>,
        quarantined: Option<&str>,
    ) -> String {
        let criteria = criteria.map(|reason| CriteriaRow {
            simulable: true,
            reason: reason.map(str::to_owned),
            ..CriteriaRow::default()
        });
        let response = variance.map(|measure_variance| ResponseRow {
            design: 0,
            number: 0,
            mean: 1.0,
            standard_deviation: 1.0,
            measure: 2.0,
            measure_variance,
            lilliefors_p: None,
        });
        let record = DesignRecord {
            criteria: criteria.as_ref(),
            response: response.as_ref(),
            samples,
            quarantined,
        };
        record.reason(sampling)
    }

    #[test]
    fn whatever_is_not_sampled_says_why() {
        let plain = sampling(None);
        let (new, simulated) = (None, Some(None));
        assert_eq!(reason(&plain, new, 0, None, None), "not simulated yet");
        let failed = Some("no licence");
        assert_eq!(
            reason(&plain, new, 0, None, failed),
            "quarantined: no licence"
        );
        assert_eq!(
            reason(&plain, simulated, 12, None, None),
            "not sampled yet: 12 of 30 samples"
        );
        assert_eq!(
            reason(&plain, simulated, 12, None, failed),
            "quarantined: no licence"
        );
        assert_eq!(
            reason(&plain, Some(Some("undercut: deep")), 0, None, None),
            "undercut: deep"
        );
        // A failure is no reason after a successful retry.
        assert_eq!(reason(&plain, simulated, 30, Some(1.0), failed), "");
    }

    #[test]
    fn a_design_that_lacks_its_precision_says_why() {
        let precise = sampling(Some(0.1));
        let of =
            |samples, variance, failed| reason(&precise, Some(None), samples, variance, failed);
        assert_eq!(
            of(60, None, None),
            "not sampled to the precision yet: 60 samples"
        );
        assert_eq!(of(60, Some(0.01), Some("no licence")), "");
        assert_eq!(
            of(60, Some(0.04), Some("no licence")),
            "quarantined: no licence"
        );
        let most = u64::from(precise.samples_max());
        assert_eq!(of(most, Some(0.04), None), "");
    }
}
