//! Wall and CPU time of the stages.

use std::collections::{BTreeMap, BTreeSet};

use ledger::Kind::{Design, Point, Run};
use problem::formulation::Problem;
use stages::cost::infill_seconds;
use stages::fitting::ModelSummary;
use stages::stage::Stage;
use store::{JobTimeRow, ModelRow, StageTimeRow, Store};

/// Wall and CPU time of a stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageCost {
    pub stage: Stage,
    /// Time that the campaign waited for the stage, s; NaN if unknown.
    pub wall_seconds: f64,
    /// CPU time, s, summed over the workers; NaN if unknown.
    pub cpu_seconds: f64,
}

/// The times in a store.
pub(crate) struct Times {
    /// CPU time by unit.
    pub(crate) jobs: Vec<JobTimeRow>,
    /// Wall time by stage.
    pub(crate) stages: Vec<StageTimeRow>,
    /// CPU time of the fit, s.
    pub(crate) fit: f64,
    /// CPU time of the decisions of infill rounds, s, and the numbers of the infill points; `None` without an
    /// enrichment.
    pub(crate) enrichment: Option<(f64, BTreeSet<u64>)>,
}

impl Times {
    /// Reads the times of the campaign in `store`.
    pub(crate) async fn read(store: &Store, problem: &Problem) -> anyhow::Result<Self> {
        let model = store.model(ModelRow::DOE).await?;
        let summary = model.map(|row| serde_json::from_str::<ModelSummary>(&row.summary_json));
        let enrichment = match problem.campaign().enrichment {
            Some(_) => {
                let rounds = store.rounds().await?;
                let deciding = rounds.iter().map(|round| round.cpu_seconds).sum();
                let infill = store.infill().await?;
                Some((deciding, infill.iter().map(|row| row.number).collect()))
            }
            None => None,
        };
        Ok(Self {
            jobs: store.job_times().await?,
            stages: store.stage_times().await?,
            fit: summary.transpose()?.map_or(0.0, |fit| fit.cpu_seconds),
            enrichment,
        })
    }

    /// Wall and CPU time of each stage, in their order.
    pub(crate) fn stages(&self) -> Vec<StageCost> {
        let mut kinds: BTreeMap<_, f64> = BTreeMap::new();
        for time in &self.jobs {
            *kinds.entry(time.stream.kind).or_default() += time.cpu_seconds;
        }
        let seconds = |kind| kinds.get(&kind).copied().unwrap_or(0.0);
        let (deciding, infill) = match &self.enrichment {
            Some((deciding, numbers)) => (*deciding, infill_seconds(&self.jobs, numbers)),
            None => (0.0, 0.0),
        };
        let all = [
            (Stage::Doe, f64::NAN),
            (Stage::Sample, seconds(Design)),
            (Stage::Fit, self.fit),
            (Stage::Optimise, seconds(Run)),
            (Stage::Enrich, infill + deciding),
            (Stage::Verify, seconds(Point) - infill),
        ];
        all.into_iter()
            .filter(|(stage, _)| self.enrichment.is_some() || *stage != Stage::Enrich)
            .map(|(stage, cpu_seconds)| StageCost {
                stage,
                wall_seconds: wall_seconds(&self.stages, stage).unwrap_or(f64::NAN),
                cpu_seconds,
            })
            .collect()
    }
}

/// Wall time of a stage, s; `None` before it began.
pub(crate) fn wall_seconds(times: &[StageTimeRow], stage: Stage) -> Option<f64> {
    let time = times.iter().find(|time| time.stage == stage.to_string());
    time.map(|time| time.wall_seconds)
}

#[cfg(test)]
mod tests {
    use ledger::StreamId;

    use super::*;

    #[test]
    fn infill_points_count_for_the_enrichment() {
        let job = |stream, cpu_seconds| JobTimeRow {
            stream,
            part: 0,
            cpu_seconds,
        };
        let mut times = Times {
            jobs: vec![
                job(StreamId::design(0), 1.0),
                job(StreamId::design(1), 2.0),
                job(StreamId::point(4), 4.0),
                job(StreamId::point(5), 8.0),
                job(StreamId::run(3, 0), 16.0),
            ],
            stages: vec![StageTimeRow {
                stage: "sample".to_owned(),
                wall_seconds: 1.5,
            }],
            fit: 0.25,
            enrichment: Some((0.5, BTreeSet::from([5]))),
        };
        let of = |times: &Times| -> Vec<(Stage, f64)> {
            let stages = times.stages().into_iter();
            let known = stages.filter(|stage| stage.cpu_seconds.is_finite());
            known.map(|s| (s.stage, s.cpu_seconds)).collect()
        };
        let expected = [
            (Stage::Sample, 3.0),
            (Stage::Fit, 0.25),
            (Stage::Optimise, 16.0),
            (Stage::Enrich, 8.5),
            (Stage::Verify, 4.0),
        ];
        assert_eq!(of(&times), expected);
        assert_eq!(times.stages()[1].wall_seconds, 1.5);
        assert!(times.stages()[2].wall_seconds.is_nan());
        times.enrichment = None;
        assert_eq!(of(&times).last(), Some(&(Stage::Verify, 12.0)));
    }
}
