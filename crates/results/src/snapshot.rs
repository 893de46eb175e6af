//! What the store holds of a campaign, read as of one moment.

use std::collections::BTreeMap;

use campaign::Campaign;
use campaign::formulation::Problem;
use gear::paper::printed::Place;
use kriging::Surrogate;
use ledger::StreamId;
use stages::fitting::{ModelSummary, latest_model};
use store::{
    CampaignRow, CriteriaRow, DesignRow, FailureRow, InfillRow, OptimiserRunRow, ResponseRow,
    RoundRow, Store,
};

use crate::costs::{StageCost, Times};
use crate::doubts;
use crate::optima::Optima;

/// What the store holds of a campaign.
pub struct Snapshot {
    /// The campaign.
    pub campaign: CampaignRow,
    /// Its problem.
    pub problem: Problem,
    /// The designs of the DoE.
    pub designs: Vec<DesignRow>,
    /// What is known of the designs from the simulator.
    pub criteria: Vec<CriteriaRow>,
    /// The responses of the designs that have a percentile.
    pub responses: Vec<ResponseRow>,
    /// Number of samples of the DoE.
    pub samples: u64,
    /// The digest of all samples of the DoE.
    pub samples_digest: String,
    /// The optima, verified and ranked.
    pub optima: Optima,
    /// The finished runs of optimisers.
    pub runs: Vec<OptimiserRunRow>,
    /// The summary of the kriging model, and the model.
    pub model: Option<(ModelSummary, Surrogate)>,
    /// The infill points.
    pub infill: Vec<InfillRow>,
    /// The rounds of the enrichment.
    pub rounds: Vec<RoundRow>,
    /// The verification samples of the paper's printed designs.
    pub printed: BTreeMap<Place, Vec<f64>>,
    /// All failures.
    pub failures: Vec<FailureRow>,
    /// Wall and CPU time of each stage.
    pub costs: Vec<StageCost>,
    /// What makes the results doubtful, in sentences.
    pub doubts: Vec<String>,
}

impl Snapshot {
    /// Reads the campaign in `store`.
    ///
    /// # Errors
    ///
    /// The store cannot be read, or holds what this version cannot read.
    pub async fn read(store: &Store) -> anyhow::Result<Self> {
        let store = &store.snapshot().await?;
        let problem = problem(store).await?;
        let mut printed = BTreeMap::new();
        if problem.campaign().compares_with_paper() {
            for place in Place::all() {
                let stream = StreamId::point(place.number());
                printed.insert(place, store.values_of(stream).await?);
            }
        }
        let mut responses = store.responses().await?;
        // The others have no percentile.
        responses.retain(|row| row.percentile.is_finite());
        let model = match latest_model(store).await? {
            Some(row) => Some((
                serde_json::from_str(&row.summary_json)?,
                Surrogate::from_json(&row.json)?,
            )),
            None => None,
        };
        Ok(Self {
            campaign: store.campaign().await?,
            designs: store.designs().await?,
            criteria: store.criteria().await?,
            responses,
            infill: store.infill().await?,
            rounds: store.rounds().await?,
            samples: store.progress().await?.samples,
            samples_digest: store.samples_digest().await?,
            optima: Optima::read(store, &problem).await?,
            runs: store.optimiser_runs().await?,
            model,
            printed,
            failures: store.failures().await?,
            costs: Times::read(store, &problem).await?.stages(),
            doubts: doubts::of(store, &problem).await?,
            problem,
        })
    }
}

/// The problem of the campaign in `store`.
///
/// # Errors
///
/// The store cannot be read, or its campaign file cannot.
pub async fn problem(store: &Store) -> anyhow::Result<Problem> {
    let row = store.campaign().await?;
    let campaign = Campaign::parse("the store's campaign file", &row.file_text)?;
    Ok(Problem::new(campaign))
}
