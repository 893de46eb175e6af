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
//! ```

use std::collections::{BTreeMap, BTreeSet};

use crate::file::{Campaign, FrozenFrom};
use crate::formulation::{Approach, Frozen, ROBUST_VARIABLES, Variables};
use crate::task::{SampleRange, SampleRequest, Task};

/// About how many samples a sampling job holds: tens of milliseconds of work, so that losing a
/// worker loses little and the round trips still vanish in it.
const SAMPLES_PER_JOB: u32 = 750;

/// The most designs of a sampling job: with few samples each, their criteria are the work.
const DESIGNS_PER_JOB_MAX: u32 = 50;

/// Samples of a verification job.
pub const VERIFY_SAMPLES_PER_JOB: u32 = 250;

/// A point that gets fresh samples.
#[derive(Debug, Clone, PartialEq)]
pub struct VerifyPoint {
    /// Its name in the store.
    pub name: String,
    /// The number that names its random streams.
    pub number: u64,
    /// The design.
    pub variables: Variables,
    /// How many of its samples are stored.
    pub stored: BTreeSet<u32>,
}

/// A design of the DoE and what is stored of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DesignState {
    /// Its six variables.
    pub x: [f64; ROBUST_VARIABLES],
    /// Whether its criteria are stored.
    pub has_criteria: bool,
    /// Whether it could be simulated; meaningless without criteria.
    pub simulated: bool,
    /// How many samples are stored, always the first ones.
    pub samples: u32,
}

impl DesignState {
    /// Whether nothing is missing.
    #[must_use]
    pub const fn is_done(&self, samples_per_design: u32) -> bool {
        self.has_criteria && (!self.simulated || self.samples >= samples_per_design)
    }
}

/// What the store holds, as far as decisions need it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// The DoE with what is stored of each design; empty before it is made.
    pub designs: Vec<DesignState>,
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
    /// Jobs that were given up.
    pub quarantined: BTreeSet<u64>,
}

/// Something that only the coordinator does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LocalStep {
    /// Make the DoE.
    Doe,
    /// Compute the responses of all designs from their samples.
    Statistics,
    /// Fit the kriging model.
    Fit,
    /// Choose the best design that the runs of an approach (or the DoE) found.
    Choose(Approach),
}

/// What comes next.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Next {
    /// Jobs whose inputs exist and whose results are missing, with their stable numbers.
    pub jobs: Vec<(u64, Task)>,
    /// A step of the coordinator's own.
    pub local: Option<LocalStep>,
}

impl Next {
    /// Whether nothing is left to do but the report.
    #[must_use]
    pub const fn is_finished(&self) -> bool {
        self.jobs.is_empty() && self.local.is_none()
    }
}

/// The kind of a job, in the top byte of its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum JobKind {
    /// Samples of the DoE; the rest is the chunk.
    Sample,
    /// A run of an optimiser; the rest is approach and start.
    Optimise,
    /// Fresh samples; the rest is point and chunk.
    Verify,
}

impl JobKind {
    const fn tag(self) -> u64 {
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

    const fn number(self, major: u64, minor: u64) -> u64 {
        (self.tag() << 56) | (major << 28) | minor
    }
}

/// The number of the job that runs start `start` of `approach`.
#[must_use]
pub const fn run_job(approach: Approach, start: u32) -> u64 {
    JobKind::Optimise.number(approach.number(), start as u64)
}

/// How many designs a sampling job holds.
#[must_use]
pub fn designs_per_job(campaign: &Campaign) -> u32 {
    (SAMPLES_PER_JOB / campaign.sampling.samples_per_design).clamp(1, DESIGNS_PER_JOB_MAX)
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
    let mut jobs = Vec::new();
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
                jobs.push((run_job(approach, start), task));
            }
        }
    }
    if let Some(frozen) = frozen {
        sampling_jobs(campaign, frozen, state, &mut jobs);
    }
    for point in verify_points(state) {
        verify_jobs(campaign.verify.samples, &point, &mut jobs);
    }
    jobs.retain(|(job, _)| !state.quarantined.contains(job));
    Next {
        jobs,
        local: local_step(campaign, state),
    }
}

fn sampling_jobs(campaign: &Campaign, frozen: Frozen, state: &State, jobs: &mut Vec<(u64, Task)>) {
    let wanted = campaign.sampling.samples_per_design;
    let chunk_size = designs_per_job(campaign) as usize;
    // Chunks have fixed borders, so that a job keeps its number after a restart.
    for (chunk, designs) in state.designs.chunks(chunk_size).enumerate() {
        let missing: Vec<SampleRequest> = designs
            .iter()
            .enumerate()
            .filter(|(_, design)| !design.is_done(wanted))
            .map(|(offset, design)| SampleRequest {
                design: (chunk * chunk_size + offset) as u32,
                x: design.x,
                samples: SampleRange {
                    first: design.samples,
                    count: wanted - design.samples,
                },
            })
            .collect();
        if !missing.is_empty() {
            let job = JobKind::Sample.number(0, chunk as u64);
            jobs.push((
                job,
                Task::Sample {
                    frozen,
                    designs: missing,
                },
            ));
        }
    }
}

/// Every point that gets fresh samples, those of the known optima included.
#[must_use]
pub fn verify_points(state: &State) -> Vec<VerifyPoint> {
    let optima = state.optima.iter().filter_map(|(approach, variables)| {
        Some(VerifyPoint {
            name: approach.name().to_owned(),
            number: approach.number(),
            variables: (*variables)?,
            stored: state.verified.get(approach).cloned().unwrap_or_default(),
        })
    });
    optima
        .chain(state.reference_points.iter().cloned())
        .collect()
}

fn verify_jobs(wanted: u32, point: &VerifyPoint, jobs: &mut Vec<(u64, Task)>) {
    let mut first = 0;
    while first < wanted {
        let end = wanted.min(first + VERIFY_SAMPLES_PER_JOB);
        if (first..end).any(|sample| !point.stored.contains(&sample)) {
            let chunk = first / VERIFY_SAMPLES_PER_JOB;
            let task = Task::Verify {
                point: point.name.clone(),
                number: point.number,
                variables: point.variables,
                samples: SampleRange {
                    first,
                    count: end - first,
                },
            };
            jobs.push((JobKind::Verify.number(point.number, u64::from(chunk)), task));
        }
        first = end;
    }
}

fn local_step(campaign: &Campaign, state: &State) -> Option<LocalStep> {
    if state.designs.is_empty() {
        return Some(LocalStep::Doe);
    }
    let chosen = |approach| state.optima.contains_key(&approach);
    let starts = campaign.optimise.starts;
    let settled = |approach| {
        (0..starts).all(|start| {
            let key = (approach, start);
            state.runs.contains(&key)
                || state.failed_runs.contains(&key)
                || state.quarantined.contains(&run_job(approach, start))
        })
    };
    for approach in Approach::OPTIMISED {
        let left_out = approach == Approach::Kriging && state.fit_failed;
        if !chosen(approach) && (settled(approach) || left_out) {
            return Some(LocalStep::Choose(approach));
        }
    }
    let wanted = campaign.sampling.samples_per_design;
    let chunk_size = designs_per_job(campaign) as usize;
    let sampled = state.designs.iter().enumerate().all(|(index, design)| {
        let job = JobKind::Sample.number(0, (index / chunk_size) as u64);
        design.is_done(wanted) || state.quarantined.contains(&job)
    });
    if !sampled {
        return None;
    }
    if !state.has_responses {
        return Some(LocalStep::Statistics);
    }
    if !chosen(Approach::BestOfDoe) {
        return Some(LocalStep::Choose(Approach::BestOfDoe));
    }
    (state.model.is_none() && !state.fit_failed).then_some(LocalStep::Fit)
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

    fn designs(done: usize) -> Vec<DesignState> {
        (0..60)
            .map(|index| DesignState {
                x: [0.5; ROBUST_VARIABLES],
                has_criteria: index < done,
                simulated: index < done,
                samples: if index < done { 30 } else { 0 },
            })
            .collect()
    }

    fn kinds(next: &Next) -> Vec<JobKind> {
        next.jobs
            .iter()
            .map(|(job, _)| JobKind::of(*job).unwrap())
            .collect()
    }

    #[test]
    fn an_empty_store_makes_the_doe_while_runs_without_samples_start() {
        let campaign = campaign();
        let next = next(&campaign, printed(&campaign), &State::default());
        assert_eq!(next.local, Some(LocalStep::Doe));
        assert_eq!(kinds(&next), vec![JobKind::Optimise; 6]);
    }

    #[test]
    fn frozen_values_of_the_own_optimum_are_waited_for() {
        let mut campaign = campaign();
        campaign.frozen.from = FrozenFrom::Deterministic;
        let state = State {
            designs: designs(0),
            ..State::default()
        };
        let first = next(&campaign, printed(&campaign), &state);
        assert_eq!(kinds(&first), vec![JobKind::Optimise; 3]);
        let state = State {
            optima: BTreeMap::from([(Approach::NoWear, None)]),
            ..state
        };
        let then = next(&campaign, printed(&campaign), &state);
        assert!(kinds(&then).contains(&JobKind::Sample));
    }

    #[test]
    fn a_restart_asks_only_for_what_is_missing_under_the_same_numbers() {
        let campaign = campaign();
        let fresh = State {
            designs: designs(0),
            ..State::default()
        };
        let resumed = State {
            designs: designs(30),
            ..State::default()
        };
        let all = next(&campaign, printed(&campaign), &fresh).jobs;
        let rest = next(&campaign, printed(&campaign), &resumed).jobs;
        let sampling = |jobs: &[(u64, Task)]| -> Vec<(u64, usize)> {
            jobs.iter()
                .filter_map(|(job, task)| match task {
                    Task::Sample { designs, .. } => Some((*job, designs.len())),
                    _ => None,
                })
                .collect()
        };
        assert_eq!(
            sampling(&all)
                .iter()
                .map(|(_, count)| count)
                .collect::<Vec<_>>(),
            [&25, &25, &10]
        );
        let rest = sampling(&rest);
        assert_eq!(
            rest,
            vec![(sampling(&all)[1].0, 20), (sampling(&all)[2].0, 10)]
        );
    }

    #[test]
    fn the_stages_follow_each_other_to_the_end() {
        let campaign = campaign();
        let printed = printed(&campaign);
        let mut state = State {
            designs: designs(60),
            ..State::default()
        };
        for approach in [Approach::NoWear, Approach::Archard] {
            for start in 0..3 {
                state.runs.insert((approach, start));
            }
        }
        let design = Variables::robust(&[0.5; 6], &printed);
        let mut steps = Vec::new();
        for _ in 0..20 {
            let next = next(&campaign, printed, &state);
            for (_, task) in &next.jobs {
                match task {
                    Task::Optimise {
                        approach, start, ..
                    } => {
                        state.runs.insert((*approach, *start));
                    }
                    Task::Verify {
                        number, samples, ..
                    } => {
                        let approach = *Approach::ALL
                            .iter()
                            .find(|a| a.number() == *number)
                            .unwrap();
                        let stored = state.verified.entry(approach).or_default();
                        stored.extend(samples.first..samples.first + samples.count);
                    }
                    Task::Sample { .. } => panic!("all samples are stored"),
                }
            }
            match next.local {
                None if next.jobs.is_empty() => break,
                None => {}
                Some(step) => {
                    steps.push(step);
                    match step {
                        LocalStep::Doe => panic!("the DoE is stored"),
                        LocalStep::Statistics => state.has_responses = true,
                        LocalStep::Fit => state.model = Some("model".to_owned()),
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
    fn a_quarantined_job_does_not_hold_up_the_campaign() {
        let campaign = campaign();
        let printed = printed(&campaign);
        let mut state = State {
            designs: designs(50),
            ..State::default()
        };
        let waiting = next(&campaign, printed, &state);
        let (job, _) = waiting
            .jobs
            .iter()
            .find(|(job, _)| JobKind::of(*job) == Some(JobKind::Sample))
            .unwrap();
        assert_eq!(waiting.local, None);
        state.quarantined.insert(*job);
        let going_on = next(&campaign, printed, &state);
        assert_eq!(going_on.local, Some(LocalStep::Statistics));
        assert!(!kinds(&going_on).contains(&JobKind::Sample));
    }

    #[test]
    fn approach_three_is_left_out_when_nothing_can_be_learned() {
        let campaign = campaign();
        let state = State {
            designs: designs(60),
            has_responses: true,
            fit_failed: true,
            optima: BTreeMap::from([(Approach::BestOfDoe, None)]),
            ..State::default()
        };
        let next = next(&campaign, printed(&campaign), &state);
        assert_eq!(next.local, Some(LocalStep::Choose(Approach::Kriging)));
    }
}
