//! The stages as a pure decision: the content of the store decides the next step.
//!
//! [`next`] looks at a [`State`] and names every result that is [outdated](crate::derived), every job whose
//! inputs exist and whose result is missing, and at most one local step. It keeps no memory, so a coordinator
//! that was killed anywhere and started again decides as the first one would have.
//!
//! ```text
//! doe ─────────────┐
//! runs without wear ┤► base ─► sample ─► statistics ─► fit ─► runs on kriging ─► choose ─► verify
//!                   │         └► runs with Archard's wear ───────────────────────►   ┘         └► report
//!                                                         └► round ⇄ its points ─►   ┘
//! ```

use std::collections::BTreeSet;

use ledger::{Kind, StreamId};
use problem::Campaign;
use problem::formulation::{Approach, Design, Problem};
use problem::task::{Inputs, Run};
use store::{Derivation, DerivedResult};

use crate::derived::Dependencies;
use crate::infill;
use crate::stage::Stage;
use crate::state::{State, VerifyPoint};

/// A step that only the coordinator does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LocalStep {
    /// Make the DoE, or its missing designs.
    Doe,
    /// Compute the responses of all designs from their samples.
    Statistics,
    /// Fit the kriging model.
    Fit,
    /// Decide the next round of infill points, or to stop.
    Enrich,
    /// Choose the best design that the runs of an approach (or the DoE, or the last round) found.
    Choose(Approach),
}

impl LocalStep {
    /// The step as a phrase for messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Doe => "making the DoE",
            Self::Statistics => "computing responses",
            Self::Fit => "fitting the kriging model",
            Self::Enrich => "deciding the next infill points",
            Self::Choose(_) => "choosing the optimum",
        }
    }
}

/// The next requests to workers, and the next local step.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Next {
    /// Stored results that no longer follow from what the store holds. They are removed before anything
    /// else; nothing else is planned beside them.
    pub outdated: Vec<DerivedResult>,
    /// The derivation of the samples of the DoE, to be stored before there are any samples.
    pub samples: Option<Derivation>,
    /// Runs of optimisers whose inputs exist and whose results are missing.
    pub runs: Vec<Run>,
    /// The variables that all designs share, when designs lack samples.
    pub sampling: Option<Design>,
    /// The points that lack samples.
    pub points: Vec<VerifyPoint>,
    /// A step of the coordinator's own.
    pub local: Option<LocalStep>,
    /// The digest of the inputs of that step's result.
    pub inputs: String,
    /// The runs and points that may be on the board.
    streams: BTreeSet<StreamId>,
    /// Whether designs may be on the board.
    has_base: bool,
    /// Whether verification samples are missing, quarantined ones included.
    is_unverified: bool,
}

impl Next {
    /// The stage that waits for these requests. Jobs that are computed meanwhile for a later stage do not count.
    #[must_use]
    pub fn stage(&self) -> Stage {
        let is_infill = |point: &VerifyPoint| infill::is_infill(point.number);
        match self.local {
            Some(LocalStep::Doe) => Stage::Doe,
            Some(LocalStep::Statistics) => Stage::Sample,
            _ if self.sampling.is_some() => Stage::Sample,
            Some(LocalStep::Fit) => Stage::Fit,
            Some(LocalStep::Enrich) => Stage::Enrich,
            Some(LocalStep::Choose(_)) => Stage::Optimise,
            None if !self.runs.is_empty() => Stage::Optimise,
            None if self.points.iter().any(is_infill) => Stage::Enrich,
            None if !self.points.is_empty() || self.is_unverified => Stage::Verify,
            None => Stage::Done,
        }
    }

    /// Whether a stream may still be computed. The inputs of other streams no longer exist.
    #[must_use]
    pub fn needs(&self, stream: StreamId) -> bool {
        match stream.kind {
            Kind::Design => self.has_base,
            Kind::Run | Kind::Point => self.streams.contains(&stream),
        }
    }

    /// Whether nothing is left to do but the report.
    #[must_use]
    pub const fn is_finished(&self) -> bool {
        self.outdated.is_empty()
            && self.runs.is_empty()
            && self.sampling.is_none()
            && self.points.is_empty()
            && self.local.is_none()
    }
}

/// Decides the next step.
#[must_use]
pub fn next(problem: &Problem, inputs: &Inputs, state: &State) -> Next {
    let dependencies = Dependencies::new(problem, inputs, state);
    let outdated = dependencies.outdated();
    if !outdated.is_empty() {
        return Next {
            outdated,
            ..Next::default()
        };
    }
    let campaign = problem.campaign();
    let wanted = optimised(problem).flat_map(|approach| {
        let dependencies = &dependencies;
        (0..campaign.optimise.starts).filter_map(move |start| dependencies.run(approach, start))
    });
    let wanted: Vec<Run> = wanted.collect();
    let mut streams: BTreeSet<StreamId> = wanted.iter().map(Run::stream).collect();
    streams.extend(points_to_keep(problem, state));
    let is_open = |run: &Run| !state.is_settled(run.approach, run.start);
    let runs = wanted.into_iter().filter(is_open).collect();
    let mut points = verify_points(campaign, state);
    points.retain(|point| !point.is_complete());
    let is_unverified = !points.is_empty();
    // This includes points whose last samples came while the state was read: the next pass sees them settled.
    points.extend(state.enrichment.points.iter().cloned());
    points.retain(|point| !state.quarantined.contains(&StreamId::point(point.number)));
    let (local, inputs) = local_step(problem, state, &dependencies).unzip();
    let sampling = dependencies.base.clone().filter(|_| state.lacks_samples());
    let is_noted = state
        .derivations
        .contains_key(&DerivedResult::Samples.name());
    let samples = sampling.as_ref().and(dependencies.samples_inputs());
    Next {
        outdated,
        samples: samples
            .filter(|_| !is_noted)
            .map(|inputs| Derivation::new(&DerivedResult::Samples, inputs)),
        runs,
        sampling,
        points,
        local,
        inputs: inputs.unwrap_or_default(),
        streams,
        has_base: dependencies.base.is_some(),
        is_unverified,
    }
}

/// The points that may be on the board. When an optimum is about to be chosen again, its samples continue, since the
/// same design is usually chosen.
fn points_to_keep<'a>(
    problem: &'a Problem,
    state: &'a State,
) -> impl Iterator<Item = StreamId> + 'a {
    let optima = problem.approaches().filter(|approach| {
        let stream = StreamId::point(approach.number());
        match state.optima.get(approach) {
            Some(chosen) => chosen.is_some(),
            None => !state.quarantined.contains(&stream),
        }
    });
    optima
        .map(Approach::number)
        .chain(state.reference_points.iter().map(|point| point.number))
        .chain(state.enrichment.numbers.iter().copied())
        .map(StreamId::point)
}

/// The campaign's approaches that run an optimiser.
fn optimised(problem: &Problem) -> impl Iterator<Item = Approach> {
    let runs = |approach: &Approach| Approach::OPTIMISED.contains(approach);
    problem.approaches().filter(runs)
}

/// Every point that gets verification samples, those of the known optima included.
#[must_use]
pub fn verify_points(campaign: &Campaign, state: &State) -> Vec<VerifyPoint> {
    let optima = state.optima.iter().filter_map(|(approach, design)| {
        let none = || (campaign.verify.first(), Default::default());
        let (wanted, stored) = state.verified.get(approach).cloned().unwrap_or_else(none);
        Some(VerifyPoint {
            number: approach.number(),
            design: design.clone()?,
            wanted,
            stored,
            asks_criteria: false,
        })
    });
    optima
        .chain(state.reference_points.iter().cloned())
        .collect()
}

/// The next step of the coordinator's own, with the digest of its inputs.
fn local_step(
    problem: &Problem,
    state: &State,
    dependencies: &Dependencies<'_>,
) -> Option<(LocalStep, String)> {
    let campaign = problem.campaign();
    if state.designs < campaign.doe.designs as usize {
        return Some((LocalStep::Doe, String::new()));
    }
    let to_choose = |approach: &Approach| {
        !state.optima.contains_key(approach) && dependencies.is_settled(*approach)
    };
    if let Some(approach) = problem.approaches().find(to_choose) {
        let inputs = dependencies.optimum_inputs(approach);
        return Some((LocalStep::Choose(approach), inputs));
    }
    if !dependencies.is_sampled() {
        return None;
    }
    if !dependencies.has_responses() {
        return Some((LocalStep::Statistics, dependencies.responses_inputs()));
    }
    if dependencies.model().is_none() {
        return Some((LocalStep::Fit, dependencies.model_inputs()?));
    }
    let goes_on = campaign.enrichment.is_some() && !state.enrichment.is_stopped;
    (goes_on && state.has_settled_infill())
        .then(|| (LocalStep::Enrich, dependencies.round_inputs()))
}

#[cfg(test)]
mod tests;
