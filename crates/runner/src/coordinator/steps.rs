//! The local steps of a campaign. Each reads the store, calls the stages, and stores the results at
//! its end. A step that is dropped has stored nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use anyhow::Context as _;
use ledger::StreamId;
use problem::file::ControlVariate;
use problem::formulation::Problem;
use problem::{Approach, Design};
use stages::cost::{self, Cost};
use stages::deciding::Rows;
use stages::doe::Doe;
use stages::fitting::{self, FittedModel, ModelSummary};
use stages::linear::LinearResponse;
use stages::optima::Optimum;
use stages::rounds::{self, Round};
use stages::statistics::{Collector, Outcome};
use stages::{choosing, constraints, derived, designs, names, responses};
use store::{Derivation, DerivedResult, InfillRow, ModelRow, Store};
use tokio::sync::{Mutex, MutexGuard};
use tracing::{debug, info, warn};

use crate::coordinator::compute::blocking;

/// The local steps of a campaign.
pub(crate) struct Steps {
    problem: Arc<Problem>,
    store: Store,
    /// The linear responses of designs, computed on first use.
    linear: Mutex<BTreeMap<u64, LinearResponse>>,
}

impl Steps {
    /// Creates the steps of a campaign.
    pub(crate) fn new(problem: Arc<Problem>, store: Store) -> Self {
        Self {
            problem,
            store,
            linear: Mutex::default(),
        }
    }

    /// Makes the missing designs of the DoE.
    pub(crate) async fn make_doe(&self) -> anyhow::Result<()> {
        let problem = Arc::clone(&self.problem);
        let existing = self.store.designs().await?;
        info!(
            designs = self.problem.campaign().doe.designs,
            existing = existing.len(),
            method = %self.problem.campaign().doe.method,
            "making the design of experiments"
        );
        let rows = blocking(move || designs::make(&problem, &existing))
            .await?
            .0?;
        self.store.put_designs(&rows).await?;
        info!("sampling");
        Ok(())
    }

    /// Computes the responses once every design has enough samples; until then, returns the designs
    /// that need more. A quarantined design gets a response only if it has the campaign's samples per design.
    pub(crate) async fn compute_responses(
        &self,
        base: Option<&Design>,
        quarantined: &BTreeSet<StreamId>,
        inputs: &str,
    ) -> anyhow::Result<Option<BTreeMap<u64, u64>>> {
        let computed = {
            let linear = self.linear_responses(base).await?;
            let mut collector = Collector::new(&self.problem, &linear, quarantined);
            self.store.visit_samples(|row| collector.push(row)).await?;
            collector.finish()?
        };
        match computed {
            Outcome::Wants(wanting) => {
                info!(
                    designs = wanting.len(),
                    "more samples, for a standard error below the precision"
                );
                Ok(Some(wanting))
            }
            Outcome::Responses(rows, found) => {
                let of_objective = rows.iter().filter(|row| row.number == 0);
                info!(designs = of_objective.count(), "responses computed");
                for sentence in found.sentences(&self.problem) {
                    warn!("{sentence}");
                }
                let derivation = derived::of_responses(inputs.to_owned(), &rows, &found);
                self.store.put_responses(&rows, &derivation).await?;
                Ok(None)
            }
        }
    }

    /// The linear responses of the sampled designs, if the campaign uses them as control variates.
    async fn linear_responses(
        &self,
        base: Option<&Design>,
    ) -> anyhow::Result<MutexGuard<'_, BTreeMap<u64, LinearResponse>>> {
        let mut linear = self.linear.lock().await;
        if self.problem.campaign().sampling.control == ControlVariate::None {
            return Ok(linear);
        }
        let counts = self.store.sampled_counts().await?;
        let new: BTreeSet<u64> = counts
            .into_iter()
            .filter(|(design, samples)| *samples > 0 && !linear.contains_key(design))
            .map(|(design, _)| design)
            .collect();
        if !new.is_empty() {
            let base = base.context("the DoE was sampled before its base variables were known")?;
            let mut designs = self.store.designs().await?;
            designs.retain(|row| new.contains(&row.design));
            info!(designs = designs.len(), "linearising ΔSTE");
            let (problem, base) = (Arc::clone(&self.problem), base.clone());
            let made = blocking(move || responses::linearise(&problem, &base, &designs)).await?;
            linear.extend(made.0);
        }
        Ok(linear)
    }

    /// Fits the kriging model and stores it, or stores the reason why the data cannot be fitted.
    pub(crate) async fn fit(&self, base: Option<&Design>, inputs: &str) -> anyhow::Result<()> {
        let base = base.context("the DoE was sampled before its base variables were known")?;
        let base = base.clone();
        let doe = Doe::read(&self.store).await?;
        let problem = Arc::clone(&self.problem);
        info!(points = doe.responses.len(), "fitting the kriging model");
        let (fitted, cpu_seconds) =
            blocking(move || fitting::fit_all(&problem, &base, &doe, ModelRow::DOE)).await?;
        let derivation = Derivation::new(&DerivedResult::Model, inputs);
        let models = match fitted {
            Ok(models) => models,
            Err(error) => {
                let reason = format!("{error:#}");
                warn!(%reason, "the kriging model cannot be fitted; the approach kriging is left out");
                let failed = Derivation {
                    failure: Some(reason),
                    ..derivation
                };
                self.store.put_models(&[], &failed).await?;
                return Ok(());
            }
        };
        let mut rows = Vec::new();
        for FittedModel {
            title: of,
            row,
            summary,
        } in models
        {
            for warning in &summary.warnings {
                warn!(%warning, %of, "kriging");
            }
            info!(
                %of,
                q2 = rounded(summary.q2),
                rmse = rounded(summary.rmse),
                cpu_seconds = rounded(cpu_seconds),
                "kriging model fitted"
            );
            // The time covers all models and is recorded with the objective.
            let summary = ModelSummary {
                cpu_seconds: if row.number == 0 { cpu_seconds } else { 0.0 },
                ..summary
            };
            let summary_json = serde_json::to_string(&summary)?;
            rows.push(ModelRow {
                summary_json,
                ..row
            });
        }
        self.store.put_models(&rows, &derivation).await?;
        Ok(())
    }

    /// Decides the next round of enrichment and stores it.
    pub(crate) async fn decide_round(&self, base: Design, inputs: &str) -> anyhow::Result<()> {
        let rows = Rows::read(&self.store, &self.problem).await?;
        for sentence in rows.absurd() {
            warn!("{sentence}");
        }
        let problem = Arc::clone(&self.problem);
        let decide = move || rows.decide(&problem, &base);
        let (decided, cpu_seconds) = blocking(decide).await?;
        let (mut new, decision) = decided?;
        new.row.cpu_seconds = cpu_seconds;
        for note in &decision.notes {
            debug!(round = new.row.round, "{note}");
        }
        let ruled_out = new.failed.iter().filter(|one| one.violation > 0.0).count();
        if ruled_out > 0 {
            info!(
                points = ruled_out,
                "infill points of the last round break a constraint and get no samples"
            );
        }
        if new.failed.len() > ruled_out {
            warn!(
                points = new.failed.len() - ruled_out,
                "infill points of the last round have failed"
            );
        }
        let best = decision.recommendation.as_ref();
        info!(
            round = new.row.round + 1,
            points = new.infill.len(),
            expected_improvement = decision.expected_improvement.map(rounded),
            predicted = best.map(|best| rounded(best.predicted)),
            half_width = best.map(|best| rounded(best.half_width())),
            cpu_seconds = rounded(cpu_seconds),
            "infill decided"
        );
        if let Some(stop) = &decision.stop {
            info!("{stop}");
        }
        let derivation = Derivation::new(&DerivedResult::Round(new.row.round), inputs);
        self.store.put_round(&new, &derivation).await?;
        Ok(())
    }

    /// Chooses the optimum of an approach.
    pub(crate) async fn choose(
        &self,
        approach: Approach,
        base: Option<&Design>,
        inputs: &str,
    ) -> anyhow::Result<()> {
        let optimum = match (approach, self.failed_fit().await?) {
            (Approach::Kriging, Some(reason)) => choosing::without_model(approach, reason),
            (Approach::BestOfDoe, _) => {
                let cost = self.sampling_cost(base).await?;
                let base =
                    base.context("the DoE was sampled before its base variables were known")?;
                let doe = Doe::read(&self.store).await?;
                choosing::choose_of_doe(&self.problem, base, &doe, cost)
            }
            (Approach::EnrichedKriging, _) => {
                let base = base.context("the base variables are not known")?;
                self.recommended(base).await?
            }
            _ => {
                let runs = self.store.optimiser_runs().await?;
                let extra = if approach == Approach::Kriging {
                    let sampling = self.sampling_cost(base).await?;
                    let fit = self.store.model(ModelRow::DOE).await?.map_or(0.0, |row| {
                        serde_json::from_str::<ModelSummary>(&row.summary_json)
                            .map_or(0.0, |summary| summary.cpu_seconds)
                    });
                    Cost {
                        cpu_seconds: sampling.cpu_seconds + fit,
                        ..sampling
                    }
                } else {
                    Cost::default()
                };
                choosing::choose_run(&self.problem, approach, &runs, extra)?
            }
        };
        self.put_optimum(&optimum, inputs).await
    }

    /// The reason why the fit failed; `None` if it did not.
    async fn failed_fit(&self) -> anyhow::Result<Option<String>> {
        let mut derivations = self.store.derivations().await?;
        let model = derivations.remove(&DerivedResult::Model.name());
        Ok(model.and_then(|model| model.failure))
    }

    /// The design that the last round recommends.
    async fn recommended(&self, base: &Design) -> anyhow::Result<Optimum> {
        let rounds = self.store.rounds().await?;
        let infill = self.store.infill().await?;
        let sampling = self.sampling_cost(Some(base)).await?;
        let control = self.control_analyses(base.clone(), &infill).await?;
        let times = self.store.job_times().await?;
        let cost = cost::enrichment(&self.problem, sampling, &rounds, &infill, control, &times);
        let last = rounds.into_iter().last().context("there is no round")?;
        let last = Round::read(last)?;
        let (evaluated, limited) = match &last.recommendation {
            Some(best) => {
                let (store, problem) = (&self.store, &self.problem);
                let evaluated = constraints::criteria_at(store, problem, base, &best.x).await?;
                (evaluated, self.limited_at(base, &best.x).await?)
            }
            None => (None, Vec::new()),
        };
        rounds::recommended(&self.problem, base, &last, evaluated, &limited, cost)
    }

    /// The values by which the constraints on samples are judged at a sampled design of the enrichment.
    async fn limited_at(&self, base: &Design, x: &[f64]) -> anyhow::Result<Vec<f64>> {
        if self.problem.limited().is_empty() {
            return Ok(Vec::new());
        }
        let rows = Rows::read(&self.store, &self.problem).await?;
        let (problem, base, x) = (Arc::clone(&self.problem), base.clone(), x.to_vec());
        Ok(blocking(move || rows.limited_at(&problem, &base, &x))
            .await?
            .0)
    }

    /// Number of analyses for the control variates of infill points.
    async fn control_analyses(&self, base: Design, infill: &[InfillRow]) -> anyhow::Result<u64> {
        if self.problem.campaign().sampling.control == ControlVariate::None {
            return Ok(0);
        }
        let (problem, infill) = (Arc::clone(&self.problem), infill.to_vec());
        let count = move || cost::control_analyses(&problem, &base, &infill);
        Ok(blocking(count).await?.0)
    }

    async fn put_optimum(&self, optimum: &Optimum, inputs: &str) -> anyhow::Result<()> {
        let approach = self.problem.approach_name(optimum.approach);
        let note = &optimum.note;
        match optimum.feasible() {
            Some(found) => {
                info!(
                    %approach,
                    criterion = rounded(found.criterion),
                    "optimum chosen"
                );
                if !note.is_empty() {
                    info!(%approach, "{note}");
                }
            }
            None => warn!(%approach, %note, "no feasible optimum"),
        }
        let of = DerivedResult::Optimum(names::verification(optimum.approach));
        let derivation = Derivation::new(&of, inputs);
        self.store.put_optimum(&optimum.row(), &derivation).await?;
        Ok(())
    }

    async fn sampling_cost(&self, base: Option<&Design>) -> anyhow::Result<Cost> {
        let criteria = self.store.criteria().await?;
        let samples = self.store.progress().await?.samples;
        let linear = self.linear_responses(base).await?;
        let control = linear.values().map(LinearResponse::analyses).sum();
        let times = self.store.job_times().await?;
        Ok(cost::sampling(
            &self.problem,
            &criteria,
            samples,
            control,
            &times,
        ))
    }
}

/// The value to four significant digits, for the log.
fn rounded(value: f64) -> f64 {
    results::number::rounded(value, 4)
}
