//! What a report is made of, read once.

use std::collections::BTreeMap;

use campaign::file::Sampling;
use campaign::formulation::Problem;
use campaign::{Approach, Campaign};
use gear::paper::printed::Place;
use stages::fitting::{ModelSummary, latest_model};
use stages::names::run_name;
use stages::references;
use store::{
    CampaignRow, CriteriaRow, DesignRow, InfillRow, OptimiserRunRow, OptimumRow, ResponseRow,
    RoundRow, SampleRow, Store,
};

/// Everything a report needs, read once.
pub(super) struct Sources {
    pub(super) campaign: CampaignRow,
    pub(super) problem: Problem,
    pub(super) designs: Vec<DesignRow>,
    pub(super) criteria: Vec<CriteriaRow>,
    pub(super) responses: Vec<ResponseRow>,
    /// How many samples of the DoE are stored.
    pub(super) samples: u64,
    pub(super) optima: Vec<OptimumRow>,
    pub(super) runs: Vec<OptimiserRunRow>,
    pub(super) model: Option<ModelSummary>,
    /// The model itself, as JSON.
    pub(super) model_json: Option<String>,
    pub(super) infill: Vec<InfillRow>,
    pub(super) rounds: Vec<RoundRow>,
    /// Verification samples by point.
    pub(super) verified: BTreeMap<String, Vec<f64>>,
    /// What has failed in every attempt.
    pub(super) failed: Failed,
}

/// Failures that are results.
#[derive(Debug, Default)]
pub(super) struct Failed {
    /// Failed samples of the DoE.
    pub(super) samples: u64,
    /// Designs that have no percentile, because too many of their samples failed.
    pub(super) designs: usize,
    /// Failed verification samples.
    pub(super) verified: usize,
    /// Evaluations in the searches that failed.
    pub(super) evaluations: usize,
}

impl Failed {
    /// Counts them. `responses` loses the designs without a percentile.
    async fn count(
        store: &Store,
        problem: &Problem,
        responses: &mut Vec<ResponseRow>,
        verified: &BTreeMap<String, Vec<f64>>,
    ) -> Result<Self, store::Error> {
        let mut failed = Self::default();
        if !problem.campaign().is_external() {
            return Ok(failed);
        }
        let all = responses.len();
        responses.retain(|row| row.p90_um.is_finite());
        failed.designs = all - responses.len();
        failed.verified = verified
            .values()
            .map(|all| Sampling::count_failed(all))
            .sum();
        let count = |row: SampleRow| {
            failed.samples += u64::from(row.delta_ste_um.is_infinite());
            Ok::<(), store::Error>(())
        };
        store.visit_samples(count).await?;
        for approach in Approach::OPTIMISED {
            for start in 0..problem.campaign().optimise.starts {
                let rows = store.evaluations(&run_name(approach, start), 0).await?;
                let reasons = rows.iter().filter_map(|row| row.refused.as_deref());
                let is_failure = |reason: &&str| reason.starts_with(campaign::task::FAILED);
                failed.evaluations += reasons.filter(is_failure).count();
            }
        }
        Ok(failed)
    }
}

impl Sources {
    /// Reads them.
    pub(super) async fn read(store: &Store) -> anyhow::Result<Self> {
        let row = store.campaign().await?;
        let campaign = Campaign::parse("the store's campaign file", &row.file_text)?;
        let problem = Problem::new(campaign);
        let mut verified = BTreeMap::new();
        let names = Approach::ALL
            .iter()
            .map(|approach| approach.name().to_owned())
            .chain(Place::all().map(references::name));
        for name in names {
            let samples = store.verify_samples(&name).await?;
            verified.insert(
                name,
                samples.iter().map(|sample| sample.delta_ste_um).collect(),
            );
        }
        let mut responses = store.responses().await?;
        let failed = Failed::count(store, &problem, &mut responses, &verified).await?;
        let model = latest_model(store).await?;
        Ok(Self {
            campaign: row,
            designs: store.designs().await?,
            criteria: store.criteria().await?,
            responses,
            infill: store.infill().await?,
            rounds: store.rounds().await?,
            samples: store.progress().await?.samples,
            optima: store.optima().await?,
            runs: store.optimiser_runs().await?,
            model: match &model {
                Some(row) => Some(serde_json::from_str(&row.summary_json)?),
                None => None,
            },
            model_json: model.map(|row| row.json),
            verified,
            failed,
            problem,
        })
    }
}
