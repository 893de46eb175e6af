//! Runs the stages of a campaign to the end.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::Context as _;
use ledger::{StreamId, Unit};
use problem::formulation::Problem;
use problem::optimise::RunResult;
use problem::task::{Inputs, Run, Source, samples_not_asked};
use problem::{Campaign, Design};
use stages::derived;
use stages::plan::{self, LocalStep, Next};
use stages::searching::{Searches, Turn};
use stages::state::{OpenDesign, State, VerifyPoint};
use stages::verification::Sizes;
use stages::wanted::{self, Requests};
use stages::{names, references, snapshot};
use store::{Batch, DerivedResult, OptimiserRunRow, Store};
use tokio_util::sync::CancellationToken;
use tracing::info;

use crate::coordinator::board::Board;
use crate::coordinator::repeats::Repeats;
use crate::coordinator::steps::Steps;
use crate::coordinator::stopwatch::Stopwatch;

/// The engine of a campaign.
pub struct Engine {
    /// The campaign's problem.
    pub problem: Arc<Problem>,
    pub store: Store,
    /// The missing jobs, and the workers that compute them.
    pub board: Arc<Board>,
    inputs: Inputs,
    steps: Steps,
}

/// How a campaign ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignEnd {
    /// The names of the quarantined streams.
    pub quarantined: Vec<String>,
}

impl Engine {
    /// Creates the engine of a campaign.
    #[must_use]
    pub fn new(
        problem: Arc<Problem>,
        model_digest: Option<&str>,
        store: Store,
        board: Arc<Board>,
    ) -> Self {
        Self {
            inputs: Inputs::new(problem.campaign(), model_digest),
            steps: Steps::new(Arc::clone(&problem), store.clone()),
            problem,
            store,
            board,
        }
    }

    /// Runs all stages until nothing is missing. Returns none if `shutdown` or a drain came first.
    pub async fn run(&self, shutdown: &CancellationToken) -> anyhow::Result<Option<CampaignEnd>> {
        self.advance(shutdown, true).await
    }

    /// Runs until only workers can continue; their jobs are on the board then. Returns [`CampaignEnd`] if
    /// nothing is missing.
    pub async fn run_to_jobs(
        &self,
        shutdown: &CancellationToken,
    ) -> anyhow::Result<Option<CampaignEnd>> {
        self.advance(shutdown, false).await
    }

    async fn advance(
        &self,
        shutdown: &CancellationToken,
        waits_for_workers: bool,
    ) -> anyhow::Result<Option<CampaignEnd>> {
        let mut watch = Stopwatch::new(&self.store).await?;
        let ended = self.stages(shutdown, waits_for_workers, &mut watch).await;
        let stopped = watch.stop().await;
        let ended = ended?;
        stopped?;
        Ok(ended)
    }

    async fn stages(
        &self,
        shutdown: &CancellationToken,
        waits_for_workers: bool,
        watch: &mut Stopwatch,
    ) -> anyhow::Result<Option<CampaignEnd>> {
        let references: &[VerifyPoint] = &references::points(&self.problem);
        let searches = &mut Searches::default();
        let sizes = &mut Sizes::default();
        let mut has_control = !self.campaign().is_external();
        let more = &mut snapshot::wants_more(&self.store, &self.problem).await?;
        let repeats = &mut Repeats::default();
        loop {
            if shutdown.is_cancelled() || self.board.is_drained() {
                return Ok(None);
            }
            // Subscribed before the state is read, so that no stream settles unnoticed in between.
            let settled = self.board.watch();
            let quarantined = self.board.quarantined();
            let (store, problem) = (&self.store, &self.problem);
            let read = snapshot::load(store, problem, &self.inputs, references, more, sizes);
            let state = State {
                quarantined,
                ..read.await?
            };
            let base = state.base(problem);
            let next = plan::next(problem, &self.inputs, &state);
            repeats.see(&state.quarantined, more);
            if !next.outdated.is_empty() {
                let outdated: Vec<String> = next.outdated.iter().map(DerivedResult::name).collect();
                let outdated = outdated.join(", ");
                let step = format!("the removal of {outdated}");
                repeats.count(&step, &format!("{:?}", state.derivations), store.path())?;
                info!(%outdated, "inputs have changed: to be computed again");
                // The board must forget them, too; their late results are refused.
                let is_gone = |stream| {
                    let mut gone = next.outdated.iter();
                    gone.any(|result| derived::is_of_stream(result, stream))
                };
                self.board.forget(is_gone);
                store.remove(&next.outdated).await?;
                if next.outdated.contains(&DerivedResult::Samples) {
                    more.clear();
                }
                continue;
            }
            self.board.forget(|stream| !next.needs(stream));
            if !has_control && let Some(base) = &base {
                self.name_control(base).await?;
                has_control = true;
            }
            if !self.post(&next, &state.open, searches).await? {
                continue;
            }
            self.board.open();
            watch.enter(next.stage()).await?;
            if let Some(step) = next.local {
                repeats.count(step.name(), &next.inputs, store.path())?;
                let step = self.do_step(step, &next.inputs, base.as_ref(), more);
                tokio::select! {
                    done = step => done?,
                    error = watch.keep() => return Err(error.into()),
                    // The step's results are lost: it stores them only at its end.
                    () = shutdown.cancelled() => return Ok(None),
                }
                continue;
            }
            if next.is_finished() {
                // The board has forgotten the streams that are no longer needed.
                let quarantined = self.board.quarantined().into_iter();
                let quarantined = quarantined.map(names::stream_name);
                return Ok(Some(CampaignEnd {
                    quarantined: quarantined.collect(),
                }));
            }
            if !waits_for_workers {
                return Ok(None);
            }
            tokio::select! {
                () = settled => repeats.forget(),
                error = watch.keep() => return Err(error.into()),
                () = self.board.drained() => return Ok(None),
                () = shutdown.cancelled() => return Ok(None),
            }
        }
    }

    fn campaign(&self) -> &Campaign {
        self.problem.campaign()
    }

    /// Gives the board a stored sample as a control for workers whose jobs fail: one that the program can give again,
    /// which a failed sample is not, nor one beyond limits that were added to the campaign later.
    async fn name_control(&self, base: &Design) -> anyhow::Result<()> {
        let counts = self.store.sampled_counts().await?;
        let designs = self.store.designs().await?;
        // Both are ordered by design.
        for (row, (design, samples)) in designs.iter().zip(counts) {
            // Known samples do not test a worker's simulator.
            let first = samples_not_asked(&self.problem, design);
            let (Ok(number), true) = (u32::try_from(design), samples > u64::from(first)) else {
                continue;
            };
            let stream = StreamId::design(number);
            let responses = self.problem.sampled().len();
            let stored = self.store.first_samples_of(stream, responses).await?;
            let is_sound = |values: &[f64]| {
                !self.problem.is_failed_sample(values) && self.problem.check_sample(values).is_ok()
            };
            if stored.get(first as usize).is_some_and(is_sound) {
                let source = Source::Design(self.problem.design(&row.x, base));
                let unit = Unit {
                    stream,
                    generation: self.inputs.generation(stream, &source),
                    samples: first..first + 1,
                };
                self.board.set_control(unit, Arc::new(source));
                return Ok(());
            }
        }
        Ok(())
    }

    /// Records the missing jobs in the store and on the board. Returns false if a run has ended
    /// meanwhile, which changes what is missing.
    async fn post(
        &self,
        next: &Next,
        open: &[OpenDesign],
        searches: &mut Searches,
    ) -> anyhow::Result<bool> {
        let mut requests = wanted::requests(&self.problem, &self.inputs, next, open);
        if self.campaign().is_external() {
            for run in &next.runs {
                if !self.search(run, searches, &mut requests).await? {
                    return Ok(false);
                }
            }
            self.board.show_searches(searches.progress().collect());
        }
        let Requests {
            streams,
            mut generations,
        } = requests;
        // The store first: results of a job on the board may arrive at once.
        if let Some(samples) = &next.samples {
            self.store.put_derivation(samples).await?;
        }
        if !generations.is_empty() {
            let held = self.store.generations().await?;
            generations.retain(|(stream, generation)| held.get(stream) != Some(generation));
        }
        if !generations.is_empty() {
            self.store.put_generations(&generations).await?;
        }
        self.board.want(streams);
        Ok(true)
    }

    /// Adds the next candidates of a run on an external simulator to `requests`. Returns false if the
    /// run has ended.
    async fn search(
        &self,
        run: &Run,
        searches: &mut Searches,
        requests: &mut Requests,
    ) -> anyhow::Result<bool> {
        let stream = run.stream();
        loop {
            let turn = searches.turn(&self.store, &self.problem, &self.inputs, run);
            match turn.await.with_context(|| names::stream_name(stream))? {
                Turn::Asks(wanted) => {
                    requests.add(wanted);
                    return Ok(true);
                }
                Turn::Finished(result) => {
                    self.finish(run, &result).await?;
                    return Ok(false);
                }
                Turn::Foreign => {
                    info!(run = %names::stream_name(stream), "stored evaluations do not match; restarting the run");
                    self.store.clear_evaluations(stream).await?;
                }
            }
        }
    }

    /// Stores the result of a run on an external simulator.
    async fn finish(&self, run: &Run, result: &RunResult) -> anyhow::Result<()> {
        let times = self.store.job_times().await?;
        let of_run = times.iter().filter(|time| time.stream == run.stream());
        let row = OptimiserRunRow {
            stream: run.stream(),
            result_json: serde_json::to_string(result)?,
            simulator_calls: result.simulator_calls,
            cpu_seconds: of_run.map(|time| time.cpu_seconds).sum(),
        };
        let inputs = derived::run_inputs(&self.inputs, run);
        let batch = Batch {
            derivations: vec![derived::of_run(inputs, &row)],
            runs: vec![row],
            ..Batch::default()
        };
        self.store.writer()?.submit(batch).await?;
        Ok(())
    }

    /// Does a step; `inputs` is the digest of the inputs of its result.
    async fn do_step(
        &self,
        step: LocalStep,
        inputs: &str,
        base: Option<&Design>,
        more: &mut BTreeMap<u64, u64>,
    ) -> anyhow::Result<()> {
        let steps = &self.steps;
        let doing = step.name();
        match step {
            LocalStep::Doe => steps.make_doe().await.context(doing),
            LocalStep::Statistics => {
                let quarantined = self.board.quarantined();
                let wanting = steps.compute_responses(base, &quarantined, inputs).await;
                if let Some(wanting) = wanting.context(doing)? {
                    *more = wanting;
                }
                Ok(())
            }
            LocalStep::Fit => {
                let fitted = steps.fit(base, inputs).await;
                fitted.context(doing)
            }
            LocalStep::Enrich => {
                let base = base.context("the base variables are not known")?;
                let decided = steps.decide_round(base.clone(), inputs).await;
                decided.context(doing)
            }
            LocalStep::Choose(approach) => steps
                .choose(approach, base, inputs)
                .await
                .with_context(|| format!("{doing} of {}", approach.name())),
        }
    }
}
