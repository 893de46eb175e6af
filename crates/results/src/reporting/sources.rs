//! What a report is made of, read once.

use std::collections::BTreeMap;

use campaign::formulation::Problem;
use campaign::{Approach, Campaign};
use gear::paper::printed::Place;
use ledger::StreamId;
use stages::fitting::{ModelSummary, latest_model};
use stages::{names, references};
use store::{
    CampaignRow, CriteriaRow, DesignRow, InfillRow, OptimiserRunRow, OptimumRow, ResponseRow,
    RoundRow, Store,
};

use crate::doubts;

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
    /// What makes the results doubtful.
    pub(super) doubts: Vec<String>,
}

impl Sources {
    /// Reads them.
    pub(super) async fn read(store: &Store) -> anyhow::Result<Self> {
        let row = store.campaign().await?;
        let campaign = Campaign::parse("the store's campaign file", &row.file_text)?;
        let problem = Problem::new(campaign);
        let mut verified = BTreeMap::new();
        let optima = Approach::ALL
            .iter()
            .map(|approach| (approach.name().to_owned(), names::verification(*approach)));
        let printed =
            Place::all().map(|place| (references::name(place), StreamId::point(place.number())));
        for (name, stream) in optima.chain(printed) {
            verified.insert(name, store.values_of(stream).await?);
        }
        let mut responses = store.responses().await?;
        // The others have no percentile.
        responses.retain(|row| row.percentile.is_finite());
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
            doubts: doubts::of(store, &problem).await?,
            problem,
        })
    }
}
