//! The stages as a pure decision: what the store holds decides what comes next.
//!
//! [`next`] looks at a [`State`] and names every job whose inputs exist and whose result is missing,
//! and at most one local step. It keeps no memory, so a coordinator that was killed anywhere and
//! started again decides as the first one would have.
//!
//! ```text
//! doe ─────────────┐
//! runs without wear ┤► frozen ─► sample ─► statistics ─► fit ─► runs on kriging ─► choose ─► verify
//!                   │         └► runs with Archard's wear ───────────────────────►   ┘         └► report
//!                                                         └► round ⇄ its points ─►   ┘
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use sha2::{Digest as _, Sha256};

use crate::batches::StreamId;
use crate::enrichment::Progress;
use crate::file::{Campaign, FrozenFrom};
use crate::formulation::{Approach, Frozen, ROBUST_VARIABLES, Variables};
use crate::task::Task;

/// A point that gets fresh samples.
#[derive(Debug, Clone, PartialEq)]
pub struct VerifyPoint {
    /// Its name in the store.
    pub name: String,
    /// The number that names its random streams.
    pub number: u64,
    /// The design.
    pub variables: Variables,
    /// How many samples it gets.
    pub wanted: u32,
    /// Which of its samples are stored.
    pub stored: BTreeSet<u32>,
}

impl VerifyPoint {
    /// Whether no sample is missing.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        (0..self.wanted).all(|sample| self.stored.contains(&sample))
    }
}

/// A design of the DoE that lacks samples.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenDesign {
    /// Its index in the DoE.
    pub design: u32,
    /// Its six variables.
    pub x: [f64; ROBUST_VARIABLES],
    /// The samples that are missing, disjoint and ascending.
    pub missing: Vec<Range<u32>>,
}

/// What the store holds, as far as decisions need it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// How many designs of the DoE are made.
    pub designs: usize,
    /// Those of them that lack samples, ascending.
    pub open: Vec<OpenDesign>,
    /// Whether the responses of all designs are stored.
    pub has_responses: bool,
    /// The kriging model as JSON, once fitted.
    pub model: Option<String>,
    /// The fit failed for good; approach 3 is then left out.
    pub fit_failed: bool,
    /// Finished optimiser runs.
    pub runs: BTreeSet<(Approach, u32)>,
    /// Runs that were given up.
    pub failed_runs: BTreeSet<(Approach, u32)>,
    /// The chosen designs; `None` for an approach that found no feasible one.
    pub optima: BTreeMap<Approach, Option<Variables>>,
    /// Points that get fresh samples, without those of the optima.
    pub reference_points: Vec<VerifyPoint>,
    /// Stored fresh samples of the optima.
    pub verified: BTreeMap<Approach, BTreeSet<u32>>,
    /// The rounds of infill.
    pub enrichment: Progress,
    /// Designs and points whose samples were given up.
    pub given_up: BTreeSet<StreamId>,
}

/// Something that only the coordinator does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LocalStep {
    /// Make the DoE, or what is missing of it.
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

/// What comes next.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Next {
    /// Runs of optimisers whose inputs exist and whose results are missing, with their stable
    /// numbers.
    pub runs: Vec<(u64, Task)>,
    /// The variables that all designs share, when designs lack samples.
    pub sampling: Option<Frozen>,
    /// The points that lack samples.
    pub points: Vec<VerifyPoint>,
    /// A step of the coordinator's own.
    pub local: Option<LocalStep>,
}

impl Next {
    /// Whether nothing is left to do but the report.
    #[must_use]
    pub const fn is_finished(&self) -> bool {
        self.runs.is_empty()
            && self.sampling.is_none()
            && self.points.is_empty()
            && self.local.is_none()
    }
}

/// The kind of a job, in the top byte of its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum JobKind {
    /// Samples of the DoE; for the rest see [`crate::batches`].
    Sample,
    /// A run of an optimiser; the rest is approach, start and a digest of what it starts from.
    Optimise,
    /// Fresh samples; the rest is as for samples of the DoE.
    Verify,
}

impl JobKind {
    pub(crate) const fn tag(self) -> u64 {
        match self {
            Self::Optimise => 1,
            Self::Sample => 2,
            Self::Verify => 3,
        }
    }

    /// The kind of a job number.
    #[must_use]
    pub const fn of(job: u64) -> Option<Self> {
        match job >> 56 {
            1 => Some(Self::Optimise),
            2 => Some(Self::Sample),
            3 => Some(Self::Verify),
            _ => None,
        }
    }
}

/// The number of the job that runs start `start` of `approach`.
///
/// A run from other inputs (another kriging model, other frozen variables) is another job: what a
/// worker brings late cannot be taken for it.
#[must_use]
pub fn run_job(task: &Task) -> u64 {
    let Task::Optimise {
        approach, start, ..
    } = task
    else {
        return 0;
    };
    let json = serde_json::to_vec(task).expect("plain numbers and names serialise");
    let digest = Sha256::digest(&json);
    let stamp = u64::from(u32::from_be_bytes([
        digest[0], digest[1], digest[2], digest[3],
    ]));
    (JobKind::Optimise.tag() << 56) | (approach.number() << 48) | (u64::from(*start) << 32) | stamp
}

/// The approach and the start of a run's job number.
#[must_use]
pub const fn run_parts(job: u64) -> (u64, u32) {
    ((job >> 48) & 0xff, ((job >> 32) & 0xffff) as u32)
}

/// What a job has in common with others that fail for the same reason: the design, or the first of
/// the designs, or the point that it samples. A run of an optimiser stands alone.
#[must_use]
pub const fn kin(job: u64) -> u64 {
    match JobKind::of(job) {
        Some(JobKind::Sample | JobKind::Verify) => crate::batches::without_samples(job),
        _ => job,
    }
}

/// The frozen variables, once they are known.
///
/// An approach 1 that found no feasible design leaves nothing to freeze, so the printed values serve.
#[must_use]
pub fn frozen(campaign: &Campaign, printed: Frozen, state: &State) -> Option<Frozen> {
    match campaign.frozen.from {
        FrozenFrom::Printed => Some(printed),
        FrozenFrom::Deterministic => state
            .optima
            .get(&Approach::NoWear)
            .map(|optimum| optimum.map_or(printed, |variables| variables.frozen_part())),
    }
}

/// Decides what comes next.
#[must_use]
pub fn next(campaign: &Campaign, printed: Frozen, state: &State) -> Next {
    let mut runs = Vec::new();
    let frozen = frozen(campaign, printed, state);

    for approach in Approach::OPTIMISED {
        let inputs = match approach {
            Approach::NoWear => Some((printed, None)),
            Approach::Archard => frozen.map(|frozen| (frozen, None)),
            _ => frozen
                .zip(state.model.clone())
                .map(|(frozen, model)| (frozen, Some(model))),
        };
        let Some((frozen, model)) = inputs else {
            continue;
        };
        for start in 0..campaign.optimise.starts {
            let key = (approach, start);
            if !state.runs.contains(&key) && !state.failed_runs.contains(&key) {
                let model = model.clone();
                let task = Task::Optimise {
                    approach,
                    start,
                    frozen,
                    model,
                };
                runs.push((run_job(&task), task));
            }
        }
    }
    let lacks_samples = state.lacks_samples();
    let mut points = verify_points(campaign, state);
    points.extend(state.enrichment.points.iter().cloned());
    points.retain(|point| {
        !point.is_complete() && !state.given_up.contains(&StreamId::Point(point.number))
    });
    Next {
        runs,
        sampling: frozen.filter(|_| lacks_samples),
        points,
        local: local_step(campaign, state),
    }
}

impl State {
    /// Whether a design lacks samples that were not given up.
    fn lacks_samples(&self) -> bool {
        let is_wanted = |open: &OpenDesign| !self.given_up.contains(&StreamId::Design(open.design));
        self.open.iter().any(is_wanted)
    }
}

/// Every point that gets fresh samples, those of the known optima included.
#[must_use]
pub fn verify_points(campaign: &Campaign, state: &State) -> Vec<VerifyPoint> {
    let optima = state.optima.iter().filter_map(|(approach, variables)| {
        Some(VerifyPoint {
            name: approach.name().to_owned(),
            number: approach.number(),
            variables: (*variables)?,
            wanted: campaign.verify.samples,
            stored: state.verified.get(approach).cloned().unwrap_or_default(),
        })
    });
    optima
        .chain(state.reference_points.iter().cloned())
        .collect()
}

fn local_step(campaign: &Campaign, state: &State) -> Option<LocalStep> {
    if state.designs < campaign.doe.designs as usize {
        return Some(LocalStep::Doe);
    }
    let chosen = |approach| state.optima.contains_key(&approach);
    let starts = campaign.optimise.starts;
    let settled = |approach| {
        (0..starts).all(|start| {
            let key = (approach, start);
            state.runs.contains(&key) || state.failed_runs.contains(&key)
        })
    };
    for approach in Approach::OPTIMISED {
        let left_out = approach == Approach::Kriging && state.fit_failed;
        if !chosen(approach) && (settled(approach) || left_out) {
            return Some(LocalStep::Choose(approach));
        }
    }
    if state.lacks_samples() {
        return None;
    }
    if !state.has_responses {
        return Some(LocalStep::Statistics);
    }
    if !chosen(Approach::BestOfDoe) {
        return Some(LocalStep::Choose(Approach::BestOfDoe));
    }
    if state.model.is_none() && !state.fit_failed {
        return Some(LocalStep::Fit);
    }
    if campaign.enrichment.is_none() || chosen(Approach::EnrichedKriging) {
        return None;
    }
    if state.enrichment.is_stopped {
        return Some(LocalStep::Choose(Approach::EnrichedKriging));
    }
    let settled = state
        .enrichment
        .is_settled(|id| state.given_up.contains(&id));
    settled.then_some(LocalStep::Enrich)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign() -> Campaign {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.doe.designs = 60;
        campaign.verify.samples = 300;
        campaign
    }

    fn printed(campaign: &Campaign) -> Frozen {
        crate::formulation::Problem::new(campaign.clone()).printed_frozen()
    }

    /// The state of a campaign with all designs, the first `done` of which have their samples.
    fn sampled(done: u32) -> State {
        let open = |design| OpenDesign {
            design,
            x: [0.5; ROBUST_VARIABLES],
            missing: std::iter::once(0..30).collect(),
        };
        State {
            designs: 60,
            open: (done..60).map(open).collect(),
            ..State::default()
        }
    }

    #[test]
    fn an_empty_store_makes_the_doe_while_runs_without_samples_start() {
        let campaign = campaign();
        let next = next(&campaign, printed(&campaign), &State::default());
        assert_eq!(next.local, Some(LocalStep::Doe));
        assert_eq!(next.runs.len(), 6);
    }

    #[test]
    fn frozen_values_of_the_own_optimum_are_waited_for() {
        let mut campaign = campaign();
        campaign.frozen.from = FrozenFrom::Deterministic;
        let state = State { ..sampled(0) };
        let first = next(&campaign, printed(&campaign), &state);
        assert_eq!((first.runs.len(), first.sampling), (3, None));
        let state = State {
            optima: BTreeMap::from([(Approach::NoWear, None)]),
            ..state
        };
        let then = next(&campaign, printed(&campaign), &state);
        assert_eq!(then.sampling, Some(printed(&campaign)));
    }

    #[test]
    fn a_run_from_another_model_is_another_job() {
        let campaign = campaign();
        let run = |start, model: &str| {
            run_job(&Task::Optimise {
                approach: Approach::Kriging,
                start,
                frozen: printed(&campaign),
                model: Some(model.to_owned()),
            })
        };
        assert_eq!(run(1, "a"), run(1, "a"));
        assert_ne!(run(1, "a"), run(1, "b"));
        assert_eq!(run_parts(run(7, "a")), (3, 7));
        assert_eq!(JobKind::of(run(7, "a")), Some(JobKind::Optimise));
    }

    #[test]
    fn the_stages_follow_each_other_to_the_end() {
        let campaign = campaign();
        let printed = printed(&campaign);
        let mut state = State { ..sampled(60) };
        for approach in [Approach::NoWear, Approach::Archard] {
            for start in 0..3 {
                state.runs.insert((approach, start));
            }
        }
        let design = Variables::robust(&[0.5; 6], &printed);
        let mut steps = Vec::new();
        for _ in 0..20 {
            let next = next(&campaign, printed, &state);
            for (_, task) in &next.runs {
                match task {
                    Task::Optimise {
                        approach, start, ..
                    } => {
                        state.runs.insert((*approach, *start));
                    }
                    _ => panic!("only runs are named one by one"),
                }
            }
            assert_eq!(next.sampling, None, "all samples are stored");
            for point in &next.points {
                let approach = *Approach::ALL
                    .iter()
                    .find(|approach| approach.number() == point.number)
                    .unwrap();
                let stored = state.verified.entry(approach).or_default();
                stored.extend(0..campaign.verify.samples);
            }
            match next.local {
                None if next.is_finished() => break,
                None => {}
                Some(step) => {
                    steps.push(step);
                    match step {
                        LocalStep::Doe => panic!("the DoE is stored"),
                        LocalStep::Statistics => state.has_responses = true,
                        LocalStep::Fit => state.model = Some("model".to_owned()),
                        LocalStep::Enrich => panic!("the campaign has no enrichment"),
                        LocalStep::Choose(approach) => {
                            state.optima.insert(approach, Some(design));
                        }
                    }
                }
            }
        }
        use LocalStep::{Choose, Fit, Statistics};
        assert_eq!(
            steps,
            vec![
                Choose(Approach::NoWear),
                Choose(Approach::Archard),
                Statistics,
                Choose(Approach::BestOfDoe),
                Fit,
                Choose(Approach::Kriging),
            ]
        );
        assert!(next(&campaign, printed, &state).is_finished());
        assert_eq!(state.verified.len(), 4);
    }

    #[test]
    fn designs_that_were_given_up_do_not_hold_up_the_campaign() {
        let campaign = campaign();
        let printed = printed(&campaign);
        let mut state = State { ..sampled(50) };
        let waiting = next(&campaign, printed, &state);
        assert_eq!((waiting.local, waiting.sampling), (None, Some(printed)));
        state.given_up.extend((50..60).map(StreamId::Design));
        let going_on = next(&campaign, printed, &state);
        assert_eq!(going_on.local, Some(LocalStep::Statistics));
        assert_eq!(going_on.sampling, None);
    }

    #[test]
    fn approach_three_is_left_out_when_nothing_can_be_learned() {
        let campaign = campaign();
        let state = State {
            has_responses: true,
            fit_failed: true,
            optima: BTreeMap::from([(Approach::BestOfDoe, None)]),
            ..sampled(60)
        };
        let next = next(&campaign, printed(&campaign), &state);
        assert_eq!(next.local, Some(LocalStep::Choose(Approach::Kriging)));
    }
}
