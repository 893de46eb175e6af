//! Which stored results are outdated.
//!
//! The store keeps with each derived result the digest of its inputs ([`store::Derivation`]). `Dependencies`
//! computes the digests of the current inputs from a state; a result whose digest differs is outdated. Outdated
//! results are removed, so [`next`](crate::plan::next) treats them as missing.
//!
//! ```text
//! samples ─► responses ─► model ─► runs on it ─► optimum
//!                │          └► round ─► its points ─► next round ─► … ─► optimum
//!                └► optimum (best of the DoE)
//! ```
//!
//! Results that cost simulations stay while a job that they could have used is tried again, and are removed
//! only when the job has delivered: a job that always fails must not cost them at each restart. An optimum is
//! cheap to choose and is what a user reads, so it is removed as soon as one of its inputs is open.

use ledger::{Generation, Kind, StreamId};
use problem::formulation::{Approach, Design, Problem};
use problem::task::{Inputs, Run, Source};
use serde::Serialize;
use sha2::{Digest as _, Sha256};
use store::{Derivation, DerivedResult, OptimiserRunRow, ResponseRow};

use crate::names;
use crate::plausibility::Plausibility;
use crate::state::State;

/// The derivation of responses, with the plausibility of the samples of an external program.
#[must_use]
pub fn of_responses(inputs: String, rows: &[ResponseRow], found: &Plausibility) -> Derivation {
    let found = (*found != Plausibility::default())
        .then(|| serde_json::to_string(found).expect("plain numbers serialise"));
    Derivation {
        output: Some(Digest::new("responses").with(&format!("{rows:?}")).hex()),
        failure: found,
        ..Derivation::new(&DerivedResult::Responses, inputs)
    }
}

/// The derivation of a run with this result.
#[must_use]
pub fn of_run(inputs: String, row: &OptimiserRunRow) -> Derivation {
    let result = DerivedResult::Run(row.stream);
    Derivation {
        output: Some(Digest::new("run").with(&row.result_json).hex()),
        ..Derivation::new(&result, inputs)
    }
}

/// The digest of a run's inputs.
#[must_use]
pub fn run_inputs(inputs: &Inputs, run: &Run) -> String {
    generation_inputs(inputs.generation(run.stream(), &Source::Run(run.clone())))
}

/// The digest of the inputs of a run with this generation.
#[must_use]
pub fn generation_inputs(generation: Generation) -> String {
    format!("{:016x}", generation.0)
}

/// Whether workers computed a result in this stream.
#[must_use]
pub fn is_of_stream(result: &DerivedResult, stream: StreamId) -> bool {
    match result {
        DerivedResult::Samples => stream.kind == Kind::Design,
        DerivedResult::Run(of) | DerivedResult::Verification(of) => *of == stream,
        _ => false,
    }
}

/// A SHA-256 of texts, each with its length.
struct Digest(Sha256);

impl Digest {
    fn new(of: &str) -> Self {
        Self(Sha256::new()).with(of)
    }

    fn with(mut self, text: &str) -> Self {
        self.0.update((text.len() as u64).to_le_bytes());
        self.0.update(text);
        self
    }

    /// Adds settings of the campaign.
    fn with_settings(self, settings: &impl Serialize) -> Self {
        self.with(&serde_json::to_string(settings).expect("plain numbers and names serialise"))
    }

    /// Adds the number of samples, their estimator and their measures.
    fn with_sampling(self, problem: &Problem) -> Self {
        let sampling = self.with_settings(problem.objective().sampling());
        problem.measures().iter().fold(sampling, |digest, measure| {
            let objective = &measure.sampling().objective;
            digest.with_settings(&(objective, measure.limit()))
        })
    }

    fn with_base(mut self, base: Option<&Design>) -> Self {
        for value in base.map_or(&[][..], Design::values) {
            self.0.update(value.to_bits().to_le_bytes());
        }
        self
    }

    fn hex(self) -> String {
        hex::encode(self.0.finalize())
    }
}

/// The current inputs of all derived results.
pub(crate) struct Dependencies<'a> {
    problem: &'a Problem,
    inputs: &'a Inputs,
    state: &'a State,
    /// The values of the variables that the DoE does not move, once they are known.
    pub(crate) base: Option<Design>,
}

impl<'a> Dependencies<'a> {
    pub(crate) fn new(problem: &'a Problem, inputs: &'a Inputs, state: &'a State) -> Self {
        Self {
            problem,
            inputs,
            state,
            base: state.base(problem),
        }
    }

    fn derivation(&self, of: &DerivedResult) -> Option<&'a Derivation> {
        self.state.derivations.get(&of.name())
    }

    /// Whether no result is stored, or one from other inputs.
    fn differs(&self, of: &DerivedResult, inputs: &str) -> bool {
        self.derivation(of).is_none_or(|held| held.inputs != inputs)
    }

    /// Whether no sample of the DoE is missing.
    pub(crate) fn is_sampled(&self) -> bool {
        let designs = self.problem.campaign().doe.designs as usize;
        self.base.is_some() && self.state.designs >= designs && !self.state.lacks_samples()
    }

    /// Whether the stored responses are those of the stored samples.
    pub(crate) fn has_responses(&self) -> bool {
        !self.differs(&DerivedResult::Responses, &self.responses_inputs())
    }

    /// Whether results that depend on the samples of the DoE are compared with their inputs. They are not compared
    /// while samples are missing and responses exist, nor before the responses are computed from all samples.
    fn is_known(&self) -> bool {
        if self.is_sampled() {
            self.has_responses()
        } else {
            self.base.is_some() && self.responses().is_none()
        }
    }

    /// The current model, or the fit that has failed.
    pub(crate) fn model(&self) -> Option<&'a Derivation> {
        let inputs = self.model_inputs()?;
        let held = self.derivation(&DerivedResult::Model)?;
        let is_held = held.failure.is_some() || !self.state.models.is_empty();
        (is_held && (!self.is_known() || held.inputs == inputs)).then_some(held)
    }

    /// A run of an optimiser, once its inputs are known.
    pub(crate) fn run(&self, approach: Approach, start: u32) -> Option<Run> {
        let (base, models) = match approach {
            Approach::Nominal => (self.problem.base().clone(), Vec::new()),
            Approach::Baseline | Approach::Direct => (self.base.clone()?, Vec::new()),
            _ => {
                let fitted = self.model().filter(|model| model.failure.is_none());
                let models = fitted.map(|_| self.state.models.clone())?;
                (self.base.clone()?, models)
            }
        };
        // The first search on the model begins at the DoE's best design under it.
        let is_first = approach == Approach::Kriging && start == 0;
        let best = self.state.best_of_doe.as_ref().filter(|_| is_first);
        let from = best.map(|x| self.problem.design(x, &base));
        Some(Run {
            approach,
            start,
            base,
            models,
            from,
        })
    }

    /// Whether everything is settled that the optimum of an approach is chosen from.
    pub(crate) fn is_settled(&self, approach: Approach) -> bool {
        let starts = self.problem.campaign().optimise.starts;
        let runs = || (0..starts).all(|start| self.state.is_settled(approach, start));
        let is_learned = || self.is_sampled() && self.has_responses();
        match approach {
            Approach::Nominal => runs(),
            Approach::Baseline | Approach::Direct => self.base.is_some() && runs(),
            Approach::BestOfDoe => is_learned(),
            Approach::Kriging => {
                let model = self.model();
                is_learned() && model.is_some_and(|model| model.failure.is_some() || runs())
            }
            Approach::EnrichedKriging => {
                let enrichment = &self.state.enrichment;
                is_learned() && enrichment.is_stopped && self.state.has_settled_infill()
            }
        }
    }

    /// The stored results whose inputs have changed, to be removed in this order.
    pub(crate) fn outdated(&self) -> Vec<DerivedResult> {
        let mut outdated = Vec::new();
        let samples = DerivedResult::Samples;
        if self.derivation(&samples).is_some()
            && let Some(inputs) = self.samples_inputs()
            && self.differs(&samples, &inputs)
        {
            outdated.push(samples);
        }
        let is_known = self.is_known();
        let has_model =
            !self.state.models.is_empty() || self.derivation(&DerivedResult::Model).is_some();
        if is_known && has_model && self.model().is_none() {
            outdated.push(DerivedResult::Model);
        }
        for &(approach, start) in &self.state.runs {
            let result = DerivedResult::Run(names::run(approach, start));
            let is_outdated = match self.run(approach, start) {
                Some(run) => self.differs(&result, &run_inputs(self.inputs, &run)),
                None => approach == Approach::Kriging && is_known,
            };
            if is_outdated {
                outdated.push(result);
            }
        }
        for &approach in self.state.optima.keys() {
            let result = DerivedResult::Optimum(names::verification(approach));
            if !self.is_settled(approach) || self.differs(&result, &self.optimum_inputs(approach)) {
                outdated.push(result);
            } else if self.state.stale.contains(&approach) {
                outdated.push(DerivedResult::Verification(names::verification(approach)));
            }
        }
        if is_known {
            let rounds = (0..).zip(self.rounds_inputs());
            let rounds = rounds.take(self.state.enrichment.rounds.len());
            let stands = |(round, inputs): &(u64, String)| {
                self.derivation(&DerivedResult::Responses).is_some()
                    && !self.differs(&DerivedResult::Round(*round), inputs)
            };
            let gone = rounds
                .skip_while(stands)
                .map(|(round, _)| DerivedResult::Round(round));
            outdated.extend(gone.collect::<Vec<_>>().into_iter().rev());
        }
        outdated
    }

    /// The inputs of the samples of the DoE that can change: the variables that all designs share, if the
    /// campaign itself finds them.
    pub(crate) fn samples_inputs(&self) -> Option<String> {
        self.problem.base_from()?;
        let base = self.base.as_ref()?;
        Some(Digest::new("samples").with_base(Some(base)).hex())
    }

    pub(crate) fn responses_inputs(&self) -> String {
        Digest::new("responses")
            .with(&self.state.samples)
            .with_sampling(self.problem)
            .with_base(self.base.as_ref())
            .hex()
    }

    /// The inputs of the model, once there are responses.
    pub(crate) fn model_inputs(&self) -> Option<String> {
        let campaign = self.problem.campaign();
        let digest = Digest::new("model")
            .with(self.responses()?)
            .with(&self.state.criteria)
            .with_base(self.base.as_ref())
            .with_settings(&campaign.kriging)
            .with_sampling(self.problem);
        Some(digest.hex())
    }

    /// The digest of the stored responses.
    fn responses(&self) -> Option<&'a str> {
        self.derivation(&DerivedResult::Responses)?
            .output
            .as_deref()
    }

    pub(crate) fn optimum_inputs(&self, approach: Approach) -> String {
        let mut digest = Digest::new("optimum").with(approach.name());
        for start in 0..self.problem.campaign().optimise.starts {
            let run = self.derivation(&DerivedResult::Run(names::run(approach, start)));
            digest = digest.with(run.and_then(|run| run.output.as_deref()).unwrap_or(""));
        }
        if matches!(
            approach,
            Approach::Nominal | Approach::Baseline | Approach::Direct
        ) {
            return digest.hex();
        }
        // The samples and the criteria are part of its cost.
        digest = digest
            .with(self.responses().unwrap_or(""))
            .with(&self.state.samples)
            .with(&self.state.criteria)
            .with_base(self.base.as_ref());
        match approach {
            Approach::Kriging => digest.with(self.model().map_or("", |model| &model.inputs)),
            Approach::EnrichedKriging => digest.with(&self.round_inputs()),
            _ => digest,
        }
        .hex()
    }

    /// The inputs of the round that comes next.
    pub(crate) fn round_inputs(&self) -> String {
        self.rounds_inputs().pop().unwrap_or_default()
    }

    /// The inputs of every round, and of one more: each follows from those of the round before and the
    /// results of that round's points.
    fn rounds_inputs(&self) -> Vec<String> {
        let campaign = self.problem.campaign();
        let first = Digest::new("round")
            .with(self.responses().unwrap_or(""))
            .with(&self.state.criteria)
            .with_settings(&campaign.enrichment)
            .with_settings(&campaign.kriging)
            .with_sampling(self.problem)
            .with_base(self.base.as_ref());
        let mut all = vec![first.hex()];
        for results in &self.state.enrichment.rounds {
            let before = all.last().map_or("", String::as_str);
            let next = Digest::new("round").with(before).with(results);
            all.push(next.hex());
        }
        all
    }
}
