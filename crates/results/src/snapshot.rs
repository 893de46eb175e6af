//! The rows of a campaign, read as of one moment.

use std::collections::BTreeMap;

use gear::paper::printed::Place;
use kriging::Surrogate;
use ledger::StreamId;
use problem::Campaign;
use problem::formulation::Problem;
use stages::calls;
use stages::fitting::{ModelSummary, latest_model};
use stages::stage::Stage;
use stats::Samples;
use store::{
    CampaignRow, CriteriaRow, DesignRow, FailureRow, InfillRow, OptimiserRunRow, ResponseRow,
    RoundRow, Store,
};

use crate::costs::{StageCost, Times};
use crate::doubts;
use crate::optima::{Optima, VerifiedOptimum};

/// The rows of a campaign, as of one moment.
pub struct Snapshot {
    pub campaign: CampaignRow,
    pub problem: Problem,
    pub designs: Vec<DesignRow>,
    /// Simulability and deterministic responses of the designs.
    pub criteria: Vec<CriteriaRow>,
    /// The responses of the designs that have a measure.
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
    pub infill: Vec<InfillRow>,
    pub rounds: Vec<RoundRow>,
    /// The verification samples of the paper's printed designs.
    pub printed: BTreeMap<Place, Vec<f64>>,
    pub failures: Vec<FailureRow>,
    /// Wall and CPU time of each stage.
    pub costs: Vec<StageCost>,
    /// Reasons to doubt the results, in sentences.
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
                let samples = store.first_samples_of(stream, problem.sampled().len());
                printed.insert(place, problem.objective().values(&samples.await?));
            }
        }
        let mut responses = store.responses().await?;
        // A measure is infinite if too many samples failed.
        responses.retain(|row| row.measure.is_finite());
        let model = match latest_model(store).await? {
            Some(row) => Some((
                serde_json::from_str(&row.summary_json)?,
                Surrogate::from_json(&row.json)?,
            )),
            None => None,
        };
        let optima = Optima::read(store, &problem).await?;
        let mut doubts = doubts::campaign::of(store, &problem).await?;
        doubts.extend(optima.doubts(&problem));
        Ok(Self {
            campaign: store.campaign().await?,
            designs: store.designs().await?,
            criteria: store.criteria().await?,
            responses,
            infill: store.infill().await?,
            rounds: store.rounds().await?,
            samples: store.progress().await?.samples,
            samples_digest: store.samples_digest().await?,
            optima,
            runs: store.optimiser_runs().await?,
            model,
            printed,
            failures: store.failures().await?,
            costs: Times::read(store, &problem).await?.stages(),
            doubts,
            problem,
        })
    }

    /// The measure's name: P90.
    #[must_use]
    pub fn measure_name(&self) -> String {
        self.problem.measured().name.to_string()
    }

    /// Number of designs that the simulator gives numbers for.
    #[must_use]
    pub fn simulable(&self) -> u64 {
        self.criteria.iter().filter(|row| row.simulable).count() as u64
    }

    /// The codes of the reasons why designs are not simulable, with the number of designs, the most frequent first.
    #[must_use]
    pub fn refusals(&self) -> Vec<(String, u64)> {
        let mut reasons: BTreeMap<&str, u64> = BTreeMap::new();
        let refused = self.criteria.iter().filter(|row| !row.simulable);
        for reason in refused.filter_map(|row| row.reason.as_deref()) {
            let code = reason.split(':').next().unwrap_or(reason);
            *reasons.entry(code).or_default() += 1;
        }
        let reasons = reasons.into_iter();
        let mut reasons: Vec<_> = reasons
            .map(|(reason, count)| (reason.to_owned(), count))
            .collect();
        reasons.sort_by(|(a, m), (b, n)| n.cmp(m).then(a.cmp(b)));
        reasons
    }

    /// Calls of the simulator in the whole campaign.
    #[must_use]
    pub fn simulator_calls(&self) -> u64 {
        Stage::WORK.into_iter().map(|stage| self.calls(stage)).sum()
    }

    /// Calls of the simulator in a stage.
    #[must_use]
    pub fn calls(&self, stage: Stage) -> u64 {
        match stage {
            Stage::Sample => calls::sampling(&self.problem, &self.criteria, self.samples),
            // Calls of the DoE count in the stage of sampling only, not again for the approaches that use the DoE.
            Stage::Optimise => self.runs.iter().map(|run| run.simulator_calls).sum(),
            Stage::Enrich => calls::infill(&self.problem, &self.rounds, &self.infill),
            Stage::Verify => {
                let verified = self.optima.iter().filter_map(VerifiedOptimum::samples);
                let printed = self.printed.values().map(Vec::len);
                let samples: usize = verified.map(Samples::len).chain(printed).sum();
                samples as u64
            }
            Stage::Doe | Stage::Fit | Stage::Done => 0,
        }
    }
}

/// The problem of the campaign in `store`.
///
/// # Errors
///
/// The store cannot be read, or its campaign file cannot.
pub async fn problem(store: &Store) -> anyhow::Result<Problem> {
    let row = store.campaign().await?;
    let campaign = Campaign::stored(&row.file_text)?;
    Ok(Problem::new(campaign))
}
