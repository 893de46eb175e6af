//! Runs the stages of a campaign to the end.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context as _;
use campaign::file::ControlVariate;
use campaign::formulation::Problem;
use campaign::plan::{self, LocalStep, Next, OpenDesign, VerifyPoint};
use campaign::task::{Inputs, Source};
use campaign::{Approach, Campaign, Frozen, LinearResponse, Variables};
use ledger::{Kind, StreamId, Vanished};
use rustix::time::{ClockId, clock_gettime};
use stats::streams::Purpose;
use store::{Batch, FailureKind, FailureRow, OptimumRow, Store, Writer};
use tokio::sync::{Mutex, MutexGuard};
use tokio::time::{Instant, MissedTickBehavior};
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};

use crate::board::Board;
use crate::sampling::{self, Sampled, Samples};
use crate::snapshot::{self, P90_MODEL};
use crate::steps::{self, Cost, ModelSummary};
use crate::{enrichment, ingest, references};

/// How often leases are looked over.
const EXPIRY_PERIOD: Duration = Duration::from_millis(200);

/// The approaches that learn from the samples of the DoE.
const SAMPLED: [Approach; 3] = [
    Approach::Kriging,
    Approach::BestOfDoe,
    Approach::EnrichedKriging,
];

/// Their names.
pub const SAMPLED_APPROACHES: [&str; 3] = [SAMPLED[0].name(), SAMPLED[1].name(), SAMPLED[2].name()];

/// What the engine works with.
pub struct Engine {
    /// The campaign's problem.
    pub problem: Arc<Problem>,
    /// The store.
    pub store: Store,
    /// The store's writer.
    pub writer: Writer,
    /// What is missing and who computes it.
    pub board: Arc<Board>,
    inputs: Inputs,
    /// The linear responses of designs, once they were needed.
    linear: Mutex<BTreeMap<u64, LinearResponse>>,
}

/// How a campaign ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ended {
    /// The names of what was given up.
    pub given_up: Vec<String>,
}

impl Engine {
    /// An engine for a campaign.
    #[must_use]
    pub fn new(
        problem: Arc<Problem>,
        model_digest: Option<&str>,
        store: Store,
        writer: Writer,
        board: Arc<Board>,
    ) -> Self {
        Self {
            inputs: Inputs::new(problem.campaign(), model_digest),
            problem,
            store,
            writer,
            board,
            linear: Mutex::default(),
        }
    }

    /// Runs all stages until nothing is missing.
    ///
    /// # Errors
    ///
    /// The store fails, or a local step does.
    pub async fn run(&self, shutdown: &CancellationToken) -> anyhow::Result<Option<Ended>> {
        let references: &[VerifyPoint] = &references::points(&self.problem);
        let fit_failed = &mut None;
        let more = &mut self.wants_more().await?;
        loop {
            if shutdown.is_cancelled() || self.board.is_drained() {
                return Ok(None);
            }
            // Before the state is read: what is settled in between must not be slept through.
            let settled = self.board.watch();
            let mut state = snapshot::load(&self.store, self.campaign(), references, more).await?;
            state.given_up = self.board.given_up();
            state.fit_failed = fit_failed.is_some();
            let printed = self.problem.printed_frozen();
            let frozen = plan::frozen(self.campaign(), printed, &state);
            if let (Some(frozen), Some(_)) = (&frozen, &self.campaign().enrichment) {
                state.enrichment = enrichment::progress(&self.store, frozen).await?;
            }
            let next = plan::next(self.campaign(), printed, &state);
            self.post(&next, &state.open).await?;
            self.board.open();
            if let Some(step) = next.local {
                let step = self.do_step(step, frozen, fit_failed, more);
                tokio::select! {
                    done = step => done?,
                    // What it computes is lost; nothing of it is stored before it is whole.
                    () = shutdown.cancelled() => return Ok(None),
                }
                continue;
            }
            if next.is_finished() {
                let given_up = state.given_up.iter().map(|id| ingest::stream_name(*id));
                return Ok(Some(Ended {
                    given_up: given_up.collect(),
                }));
            }
            tokio::select! {
                () = settled => {}
                () = self.board.drained() => return Ok(None),
                () = shutdown.cancelled() => return Ok(None),
            }
        }
    }

    /// Takes back the jobs of silent workers, for as long as the campaign runs.
    ///
    /// # Errors
    ///
    /// The store fails.
    pub async fn watch_leases(&self) -> anyhow::Result<()> {
        let mut period = tokio::time::interval(EXPIRY_PERIOD);
        period.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut last = Instant::now();
        let mut patient_until = last;
        loop {
            period.tick().await;
            let now = Instant::now();
            let half_a_lease = self.board.lease_time() / 2;
            if now.duration_since(last) > half_a_lease {
                // It was this process that slept: the heartbeats of the meantime are still to be
                // read.
                patient_until = now + half_a_lease;
            }
            last = now;
            if now < patient_until {
                continue;
            }
            for vanished in self.board.expire() {
                let Vanished {
                    lease,
                    worker,
                    stream,
                    is_split,
                    given_up,
                } = vanished;
                let name = if is_split {
                    format!("{} and others", ingest::stream_name(stream))
                } else {
                    ingest::stream_name(stream)
                };
                let (kind, error) = if given_up {
                    error!(stream = %name, %worker, "too many workers vanished: given up");
                    (
                        FailureKind::Quarantine,
                        "its workers vanished while they computed it",
                    )
                } else {
                    warn!(stream = %name, %worker, "a worker vanished while it computed");
                    (
                        FailureKind::Crash,
                        "its worker vanished while it computed it",
                    )
                };
                let row = FailureRow {
                    job: name,
                    attempt: u32::try_from(lease.number).unwrap_or(u32::MAX),
                    worker: worker.to_string(),
                    serial: None,
                    kind,
                    error: error.to_owned(),
                    at_unix_ms: None,
                };
                let batch = Batch {
                    failures: vec![row],
                    ..Batch::default()
                };
                self.writer.submit(batch).await?;
            }
        }
    }

    /// Tells store and board what is missing.
    async fn post(&self, next: &Next, open: &[OpenDesign]) -> anyhow::Result<()> {
        let mut wanted = Vec::new();
        let mut named = Vec::new();
        let mut want = |stream: StreamId, source: Source, missing, name: Option<String>| {
            let new = self.inputs.wanted(stream, source, missing);
            named.extend(name.map(|name| (name, new.generation.0)));
            wanted.push(new);
        };
        for run in &next.runs {
            let name = ingest::run_name(run.approach, run.start);
            let missing = std::iter::once(0..1).collect();
            want(run.stream(), Source::Run(run.clone()), missing, Some(name));
        }
        if let Some(frozen) = &next.sampling {
            for design in open {
                let variables = Variables::robust(&design.x, frozen);
                let stream = StreamId::design(design.design);
                // Its criteria tell whether it needs samples, so there always are some to ask for.
                want(
                    stream,
                    Source::Design(variables),
                    design.missing.clone(),
                    None,
                );
            }
        }
        for point in &next.points {
            self.board.name_point(point.number, &point.name);
            let missing = ledger::gaps(&point.stored, point.wanted);
            let source = Source::Point(point.variables);
            want(
                StreamId::point(point.number),
                source,
                missing,
                Some(point.name.clone()),
            );
        }
        // The store first: what is wanted on the board may come back at once.
        if !named.is_empty() {
            let held = self.store.generations().await?;
            named.retain(|(name, generation)| held.get(name) != Some(generation));
        }
        if !named.is_empty() {
            self.store.put_generations(&named).await?;
        }
        self.board.want(wanted);
        Ok(())
    }

    /// Forgets what was learned from the samples of the DoE, and everything that rests on it: runs,
    /// optima with their fresh samples, infill.
    async fn forget_derived(&self) -> anyhow::Result<()> {
        let is_sampled = |number: u64| SAMPLED.iter().any(|approach| approach.number() == number);
        let is_derived = |stream: StreamId| match stream.kind {
            Kind::Run => is_sampled(stream.run_parts().0.into()),
            Kind::Design => false,
            Kind::Point => {
                is_sampled(stream.index) || campaign::enrichment::is_infill(stream.index)
            }
        };
        self.board.forget(is_derived);
        self.store.clear_derived(&SAMPLED_APPROACHES).await?;
        Ok(())
    }

    /// The designs that want more samples than others: after a restart, too, of a campaign that went
    /// on without those of designs that were given up.
    async fn wants_more(&self) -> anyhow::Result<BTreeMap<u64, u64>> {
        let settings = self.campaign().sampling;
        let mut more = BTreeMap::new();
        if settings.rule().is_none() {
            return Ok(more);
        }
        for row in self.store.responses().await? {
            let samples = self.store.samples_of(row.design).await?;
            let held = samples
                .iter()
                .zip(0..)
                .take_while(|((sample, _), i)| sample == i);
            let held: Vec<f64> = held.map(|((_, value), _)| *value).collect();
            if let Sampled::Wants { samples, .. } = sampling::sampled(&held, &settings)? {
                more.insert(row.design, samples as u64);
            }
        }
        Ok(more)
    }

    fn campaign(&self) -> &Campaign {
        self.problem.campaign()
    }

    async fn do_step(
        &self,
        step: LocalStep,
        frozen: Option<Frozen>,
        fit_failed: &mut Option<String>,
        more: &mut BTreeMap<u64, u64>,
    ) -> anyhow::Result<()> {
        match step {
            LocalStep::Doe => self.make_doe().await.context("making the DoE"),
            LocalStep::Statistics => self
                .compute_responses(frozen, more)
                .await
                .context("computing responses"),
            LocalStep::Fit => match self.fit().await.context("fitting the kriging model")? {
                Ok(()) => Ok(()),
                Err(reason) => {
                    warn!(%reason, "the kriging model cannot be fitted; approach 3 is left out");
                    *fit_failed = Some(reason);
                    Ok(())
                }
            },
            LocalStep::Enrich => {
                let frozen = frozen.context("the frozen variables are not known")?;
                let decided = self.enrich(frozen).await;
                decided.context("deciding the next infill points")
            }
            LocalStep::Choose(Approach::EnrichedKriging) => {
                let frozen = frozen.context("the frozen variables are not known")?;
                let row = self.choose_enriched(&frozen).await?;
                self.put_optimum(row).await
            }
            LocalStep::Choose(approach) => self
                .choose(approach, frozen, fit_failed.as_deref())
                .await
                .with_context(|| format!("choosing the optimum of {}", approach.name())),
        }
    }

    async fn make_doe(&self) -> anyhow::Result<()> {
        let problem = Arc::clone(&self.problem);
        let existing = self.store.designs().await?;
        info!(
            designs = self.campaign().doe.designs,
            existing = existing.len(),
            method = %self.campaign().doe.method,
            "making the design of experiments"
        );
        let rows = blocking(move || steps::doe(&problem, &existing)).await?.0?;
        self.store.put_designs(&rows).await?;
        info!("sampling");
        Ok(())
    }

    /// Computes the responses once every design has enough samples; until then, `more` learns which
    /// want more.
    async fn compute_responses(
        &self,
        frozen: Option<Frozen>,
        more: &mut BTreeMap<u64, u64>,
    ) -> anyhow::Result<()> {
        if !self.store.responses().await?.is_empty() {
            // Samples came after the model was fitted, as of jobs that got another chance: what
            // was learned without them is learned again.
            self.forget_derived().await?;
        }
        let settings = self.campaign().sampling;
        let (first, most) = (
            settings.samples_per_design as usize,
            settings.samples_max() as usize,
        );
        let linear = self.linear_responses(frozen).await?;
        let given_up = self.board.given_up();
        let is_given_up = |design| {
            u32::try_from(design).is_ok_and(|design| given_up.contains(&StreamId::design(design)))
        };
        let mut rows = Vec::new();
        let mut wanting = BTreeMap::new();
        let mut current: Option<u64> = None;
        let mut samples: Vec<f64> = Vec::with_capacity(first);
        let mut close = |design: Option<u64>, samples: &mut Vec<f64>| -> anyhow::Result<()> {
            if let Some(design) = design
                && samples.len() >= first
            {
                let context = || format!("the samples of design {design}");
                let control = linear.get(&design).map(|linear| {
                    let values = sampling::controls(
                        &self.problem,
                        (Purpose::Wear, design),
                        linear,
                        samples.len(),
                    );
                    (values, linear.moments())
                });
                let with_control = Samples {
                    values: samples,
                    control: control
                        .as_ref()
                        .map(|(values, known)| (&values[..], *known)),
                };
                let found = sampling::sampled(samples, &settings).with_context(context)?;
                let count = match found {
                    Sampled::Enough(count) => count,
                    Sampled::Wants { samples, at_least } => {
                        if !is_given_up(design) {
                            wanting.insert(design, samples as u64);
                        }
                        at_least
                    }
                };
                let row = sampling::response_of(design, with_control.first(count), &settings)
                    .with_context(context)?;
                rows.push(row);
            }
            samples.clear();
            Ok(())
        };
        self.store
            .visit_samples(|row| -> anyhow::Result<()> {
                if current != Some(row.design) {
                    close(current, &mut samples)?;
                    current = Some(row.design);
                }
                // Those beyond a hole wait until it is filled.
                if samples.len() < most && row.sample == samples.len() as u64 {
                    samples.push(row.delta_ste_um);
                }
                Ok(())
            })
            .await?;
        close(current, &mut samples)?;
        if !wanting.is_empty() {
            info!(
                designs = wanting.len(),
                "more samples, for a standard error below the precision"
            );
            *more = wanting;
            return Ok(());
        }
        info!(feasible = rows.len(), "responses computed");
        self.store.put_responses(&rows).await?;
        Ok(())
    }

    /// The linear responses of the sampled designs, where the campaign asks for them as control
    /// variates.
    async fn linear_responses(
        &self,
        frozen: Option<Frozen>,
    ) -> anyhow::Result<MutexGuard<'_, BTreeMap<u64, LinearResponse>>> {
        let mut linear = self.linear.lock().await;
        if self.campaign().sampling.control == ControlVariate::None {
            return Ok(linear);
        }
        let counts = self.store.sampled_counts().await?;
        let new: BTreeSet<u64> = counts
            .into_iter()
            .filter(|(design, samples)| *samples > 0 && !linear.contains_key(design))
            .map(|(design, _)| design)
            .collect();
        if !new.is_empty() {
            let frozen =
                frozen.context("the DoE was sampled before its frozen variables were known")?;
            let mut designs = self.store.designs().await?;
            designs.retain(|row| new.contains(&row.design));
            info!(designs = designs.len(), "linearising ΔSTE");
            let problem = Arc::clone(&self.problem);
            let made = blocking(move || sampling::linearise(&problem, &frozen, &designs)).await?;
            linear.extend(made.0);
        }
        Ok(linear)
    }

    /// The inner error says why the data cannot be fitted.
    async fn fit(&self) -> anyhow::Result<Result<(), String>> {
        let designs = self.store.designs().await?;
        let responses = self.store.responses().await?;
        let campaign = self.campaign().clone();
        info!(points = responses.len(), "fitting the kriging model");
        let (fitted, cpu_seconds) =
            blocking(move || steps::fit(&campaign, &designs, &responses)).await?;
        let (model, summary) = match fitted {
            Ok((model, summary)) => (
                model,
                ModelSummary {
                    cpu_seconds,
                    ..summary
                },
            ),
            Err(error) => return Ok(Err(format!("{error:#}"))),
        };
        for warning in &summary.warnings {
            warn!(%warning, "kriging");
        }
        info!(
            q2 = summary.q2,
            rmse_um = summary.rmse_um,
            cpu_seconds,
            "kriging model fitted"
        );
        self.store
            .put_model(&steps::model_row(&model, &summary)?)
            .await?;
        Ok(Ok(()))
    }

    async fn choose(
        &self,
        approach: Approach,
        frozen: Option<Frozen>,
        fit_failed: Option<&str>,
    ) -> anyhow::Result<()> {
        let row = match (approach, fit_failed) {
            (Approach::Kriging, Some(reason)) => {
                steps::left_out(approach, format!("There is no kriging model: {reason}."))?
            }
            (Approach::BestOfDoe, _) => {
                let cost = self.sampling_cost(frozen).await?;
                let frozen =
                    frozen.context("the DoE was sampled before its frozen variables were known")?;
                let designs = self.store.designs().await?;
                let criteria = self.store.criteria().await?;
                let responses = self.store.responses().await?;
                steps::choose_of_doe(
                    &self.problem,
                    &frozen,
                    &designs,
                    &criteria,
                    &responses,
                    cost,
                )?
            }
            _ => {
                let runs = self.store.optimiser_runs().await?;
                let extra = if approach == Approach::Kriging {
                    let sampling = self.sampling_cost(frozen).await?;
                    let fit = self.store.model(P90_MODEL).await?.map_or(0.0, |row| {
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
                steps::choose_run(&self.problem, approach, &runs, extra)?
            }
        };
        self.put_optimum(row).await
    }

    async fn put_optimum(&self, row: OptimumRow) -> anyhow::Result<()> {
        let approach = &row.approach;
        if row.feasible {
            info!(
                %approach,
                criterion_um = row.criterion_um,
                "optimum chosen"
            );
        } else {
            warn!(%approach, note = %row.note, "no feasible optimum");
        }
        if !row.note.is_empty() && row.feasible {
            info!(%approach, "{}", row.note);
        }
        self.store.put_optimum(&row).await?;
        Ok(())
    }

    pub(crate) async fn sampling_cost(&self, frozen: Option<Frozen>) -> anyhow::Result<Cost> {
        let criteria = self.store.criteria().await?;
        let samples = self.store.progress().await?.samples;
        let linear = self.linear_responses(frozen).await?;
        let control: u64 = linear.values().map(LinearResponse::analyses).sum();
        let times = self.store.job_times().await?;
        Ok(Cost {
            simulator_calls: steps::sampling_calls(&criteria, samples) + control,
            cpu_seconds: times
                .iter()
                .filter(|row| matches!(ingest::timed(row.job), Some((Kind::Design, _))))
                .map(|row| row.cpu_seconds)
                .sum(),
        })
    }
}

/// Runs `work` on compute threads of its own, one per processor; returns their CPU time, too, in
/// seconds.
pub(crate) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> anyhow::Result<(T, f64)> {
    let timed = move || -> anyhow::Result<(T, f64)> {
        let pool = rayon::ThreadPoolBuilder::new().build()?;
        let result = pool.install(work);
        let times = pool.broadcast(|_| {
            let time = clock_gettime(ClockId::ThreadCPUTime);
            time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
        });
        Ok((result, times.iter().sum()))
    };
    tokio::task::spawn_blocking(timed).await?
}
