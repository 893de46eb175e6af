//! The stages as a pure decision: what the store holds decides what comes next.
//!
//! [`next`] looks at a [`State`] and names every job whose inputs exist and whose result is missing,
//! and at most one local step. It keeps no memory, so a coordinator that was killed anywhere and
//! started again decides as the first one would have.
//!
//! ```text
//! doe ─────────────┐
//! runs without wear ┤► base ─► sample ─► statistics ─► fit ─► runs on kriging ─► choose ─► verify
//!                   │         └► runs with Archard's wear ───────────────────────►   ┘         └► report
//!                                                         └► round ⇄ its points ─►   ┘
//! ```

use campaign::Campaign;
use campaign::formulation::{Approach, Design, Problem};
use campaign::task::Run;
use ledger::StreamId;

use crate::infill;
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

/// The next requests to workers, and the next local step.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Next {
    /// Runs of optimisers whose inputs exist and whose results are missing.
    pub runs: Vec<Run>,
    /// The variables that all designs share, when designs lack samples.
    pub sampling: Option<Design>,
    /// The points that lack samples.
    pub points: Vec<VerifyPoint>,
    /// A step of the coordinator's own.
    pub local: Option<LocalStep>,
}

impl Next {
    /// The stage that waits for this: `doe`, `sample`, `fit`, `optimise`, `enrich` or `verify`; `None` when
    /// nothing is left. What is computed meanwhile for a later stage does not count.
    #[must_use]
    pub fn stage(&self) -> Option<&'static str> {
        let is_infill = |point: &VerifyPoint| infill::is_infill(point.number);
        Some(match self.local {
            Some(LocalStep::Doe) => "doe",
            Some(LocalStep::Statistics) => "sample",
            _ if self.sampling.is_some() => "sample",
            Some(LocalStep::Fit) => "fit",
            Some(LocalStep::Enrich) => "enrich",
            Some(LocalStep::Choose(_)) => "optimise",
            None if !self.runs.is_empty() => "optimise",
            None if self.points.iter().any(is_infill) => "enrich",
            None if !self.points.is_empty() => "verify",
            None => return None,
        })
    }

    /// Whether nothing is left to do but the report.
    #[must_use]
    pub const fn is_finished(&self) -> bool {
        self.runs.is_empty()
            && self.sampling.is_none()
            && self.points.is_empty()
            && self.local.is_none()
    }
}

/// The values of the variables that the DoE does not move, once they are known.
///
/// If approach 1 found no feasible design, there is nothing to freeze, and the printed values
/// serve.
#[must_use]
pub fn base(problem: &Problem, state: &State) -> Option<Design> {
    let printed = || problem.base().clone();
    let Some(approach) = problem.base_from() else {
        return Some(printed());
    };
    let optimum = state.optima.get(&approach)?.as_ref();
    Some(optimum.map_or_else(printed, |design| problem.base_of(design)))
}

/// The design at which the first search on the model begins: the DoE's best one under the model.
fn best_of_doe(problem: &Problem, state: &State, base: &Design) -> Option<Design> {
    state.best_of_doe.as_ref().map(|x| problem.design(x, base))
}

/// Decides what comes next.
#[must_use]
pub fn next(problem: &Problem, state: &State) -> Next {
    let campaign = problem.campaign();
    let mut runs = Vec::new();
    let base = base(problem, state);

    for approach in optimised(problem) {
        let inputs = match approach {
            Approach::Nominal => Some((problem.base().clone(), None)),
            Approach::Baseline | Approach::Direct => base.clone().map(|base| (base, None)),
            _ => base
                .clone()
                .zip(state.model.clone())
                .map(|(base, model)| (base, Some(model))),
        };
        let Some((base, model)) = inputs else {
            continue;
        };
        for start in 0..campaign.optimise.starts {
            if !state.is_settled(approach, start) {
                runs.push(Run {
                    approach,
                    start,
                    base: base.clone(),
                    model: model.clone(),
                    from: best_of_doe(problem, state, &base)
                        .filter(|_| approach == Approach::Kriging && start == 0),
                });
            }
        }
    }
    let lacks_samples = state.lacks_samples();
    let mut points = verify_points(campaign, state);
    points.extend(state.enrichment.points.iter().cloned());
    points.retain(|point| {
        !point.is_complete() && !state.quarantined.contains(&StreamId::point(point.number))
    });
    Next {
        runs,
        sampling: base.filter(|_| lacks_samples),
        points,
        local: local_step(problem, state),
    }
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
            name: approach.name().to_owned(),
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

fn local_step(problem: &Problem, state: &State) -> Option<LocalStep> {
    let campaign = problem.campaign();
    if state.designs < campaign.doe.designs as usize {
        return Some(LocalStep::Doe);
    }
    let chosen = |approach| state.optima.contains_key(&approach);
    let starts = campaign.optimise.starts;
    let settled = |approach: Approach| (0..starts).all(|start| state.is_settled(approach, start));
    for approach in optimised(problem) {
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
        .is_settled(|id| state.quarantined.contains(&id));
    settled.then_some(LocalStep::Enrich)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use campaign::file::FrozenFrom;

    use super::*;
    use campaign::task::FIRST_INFILL as FIRST;

    use crate::infill::point_name;
    use crate::state::{OpenDesign, Progress};

    fn campaign() -> Campaign {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.doe.designs = 60;
        campaign.verify.samples = Some(300);
        campaign.verify.half_width = None;
        campaign
    }

    fn next_of(campaign: &Campaign, state: &State) -> Next {
        super::next(&Problem::new(campaign.clone()), state)
    }

    /// The design in the middle of the tools' range.
    fn middle(campaign: &Campaign) -> Design {
        let problem = Problem::new(campaign.clone());
        problem.design(&[0.5; 6], problem.base())
    }

    fn printed(campaign: &Campaign) -> Design {
        Problem::new(campaign.clone()).base().clone()
    }

    /// The state of a campaign with all designs, the first `done` of which have their samples.
    fn sampled(done: u32) -> State {
        let open = |design| OpenDesign {
            design,
            x: vec![0.5; 6],
            samples: 30,
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
        let next = next_of(&campaign, &State::default());
        assert_eq!(
            (next.local, next.stage()),
            (Some(LocalStep::Doe), Some("doe"))
        );
        assert_eq!(next.runs.len(), 6);
    }

    #[test]
    fn frozen_values_of_the_own_optimum_are_waited_for() {
        let mut campaign = campaign();
        let frozen = &mut campaign.gears_mut().unwrap().frozen;
        frozen.as_mut().unwrap().from = FrozenFrom::Deterministic;
        let state = State { ..sampled(0) };
        let first = next_of(&campaign, &state);
        assert_eq!((first.runs.len(), first.sampling), (3, None));
        let state = State {
            optima: BTreeMap::from([(Approach::Nominal, None)]),
            ..state
        };
        let then = next_of(&campaign, &state);
        assert_eq!(then.sampling, Some(printed(&campaign)));
    }

    #[test]
    fn the_stages_follow_each_other_to_the_end() {
        let campaign = campaign();
        let mut state = State { ..sampled(60) };
        for approach in [Approach::Nominal, Approach::Baseline] {
            for start in 0..3 {
                state.runs.insert((approach, start));
            }
        }
        let design = middle(&campaign);
        let mut steps = Vec::new();
        let mut stages = Vec::new();
        for _ in 0..20 {
            let next = next_of(&campaign, &state);
            stages.extend(next.stage());
            let runs = next.runs.iter().map(|run| (run.approach, run.start));
            state.runs.extend(runs);
            assert_eq!(next.sampling, None, "all samples are stored");
            for point in &next.points {
                let approach = *Approach::ALL
                    .iter()
                    .find(|approach| approach.number() == point.number)
                    .unwrap();
                state.verified.insert(approach, (300, (0..300).collect()));
            }
            match next.local {
                None if next.is_finished() => break,
                None => {}
                Some(step) => {
                    steps.push(step);
                    match step {
                        LocalStep::Doe => panic!("the DoE is stored"),
                        LocalStep::Statistics => state.has_responses = true,
                        LocalStep::Fit => state.model = Some("model".into()),
                        LocalStep::Enrich => panic!("the campaign has no enrichment"),
                        LocalStep::Choose(approach) => {
                            state.optima.insert(approach, Some(design.clone()));
                        }
                    }
                }
            }
        }
        use LocalStep::{Choose, Fit, Statistics};
        assert_eq!(
            steps,
            vec![
                Choose(Approach::Nominal),
                Choose(Approach::Baseline),
                Statistics,
                Choose(Approach::BestOfDoe),
                Fit,
                Choose(Approach::Kriging),
            ]
        );
        let last = next_of(&campaign, &state);
        assert!(last.is_finished() && last.stage().is_none());
        assert_eq!(state.verified.len(), 4);
        // The best of the DoE is chosen between the samples and the fit.
        stages.dedup();
        let expected = [
            "optimise", "sample", "optimise", "fit", "optimise", "verify",
        ];
        assert_eq!(stages, expected);
    }

    #[test]
    fn designs_that_were_quarantined_do_not_hold_up_the_campaign() {
        let campaign = campaign();
        let printed = printed(&campaign);
        let mut state = State { ..sampled(50) };
        let waiting = next_of(&campaign, &state);
        assert_eq!(waiting.stage(), Some("sample"));
        assert_eq!((waiting.local, waiting.sampling), (None, Some(printed)));
        state.quarantined.extend((50..60).map(StreamId::design));
        let going_on = next_of(&campaign, &state);
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
        let next = next_of(&campaign, &state);
        assert_eq!(next.local, Some(LocalStep::Choose(Approach::Kriging)));
    }

    fn enriched() -> Campaign {
        let text = include_str!("../../../campaigns/enriched.toml");
        Campaign::parse("enriched.toml", text).unwrap()
    }

    fn point(number: u64, stored: u32, design: &Design) -> VerifyPoint {
        VerifyPoint {
            name: point_name(0, number),
            number,
            design: design.clone(),
            wanted: 30,
            stored: (0..stored).collect(),
            asks_criteria: false,
        }
    }

    /// A campaign whose model has just been fitted.
    fn fitted(campaign: &Campaign) -> State {
        State {
            designs: campaign.doe.designs as usize,
            has_responses: true,
            model: Some("model".into()),
            optima: [
                Approach::Nominal,
                Approach::Baseline,
                Approach::Kriging,
                Approach::BestOfDoe,
            ]
            .map(|approach| (approach, None))
            .into(),
            runs: Approach::OPTIMISED
                .into_iter()
                .flat_map(|approach| (0..3).map(move |start| (approach, start)))
                .collect(),
            ..State::default()
        }
    }

    #[test]
    fn a_round_is_decided_once_the_one_before_is_settled() {
        let campaign = enriched();
        let middle = middle(&campaign);
        let step = |state: &State| next_of(&campaign, state).local;
        let mut state = fitted(&campaign);
        assert_eq!(step(&state), Some(LocalStep::Enrich));
        // The step waits neither for the runs on the model nor for a model.
        state.runs.clear();
        assert_eq!(step(&state), Some(LocalStep::Enrich));
        (state.model, state.fit_failed) = (None, true);
        assert_eq!(step(&state), Some(LocalStep::Enrich));
        state = fitted(&campaign);

        // In the middle of a round, as after a restart: only what is missing is asked for.
        let numbers = [FIRST + 3, FIRST + 9, FIRST + 4];
        state.enrichment = Progress {
            rounds: 1,
            points: vec![
                point(numbers[0], 30, &middle),
                point(numbers[1], 12, &middle),
                point(numbers[2], 0, &middle),
            ],
            is_stopped: false,
        };
        let next = next_of(&campaign, &state);
        let open: Vec<u64> = next.points.iter().map(|point| point.number).collect();
        assert_eq!((open.as_slice(), next.local), (&numbers[1..], None));
        // One gets its samples, one fails: both are settled.
        state.enrichment.points[2] = point(numbers[2], 30, &middle);
        assert_eq!(step(&state), None);
        state.quarantined.insert(StreamId::point(numbers[1]));
        let next = next_of(&campaign, &state);
        assert_eq!(next.local, Some(LocalStep::Enrich));
        assert_eq!(next.points, []);
    }

    #[test]
    fn the_round_that_stops_is_followed_by_its_recommendation_and_that_by_verification_samples() {
        let campaign = enriched();
        let middle = middle(&campaign);
        let approach = Approach::EnrichedKriging;
        let mut state = fitted(&campaign);
        state.enrichment = Progress {
            rounds: 4,
            points: Vec::new(),
            is_stopped: true,
        };
        let next = next_of(&campaign, &state);
        assert_eq!(next.local, Some(LocalStep::Choose(approach)));
        state.optima.insert(approach, Some(middle));
        let next = next_of(&campaign, &state);
        assert_eq!(next.local, None);
        let open: Vec<_> = next.points.iter().map(|p| (p.number, p.wanted)).collect();
        assert_eq!(open, [(5, campaign.verify.first())]);
        let wanted = campaign.verify.first();
        let stored = (wanted, (0..wanted).collect());
        state.verified.insert(approach, stored);
        assert!(next_of(&campaign, &state).is_finished());
    }

    #[test]
    fn without_the_section_nothing_is_enriched() {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        assert!(next_of(&campaign, &fitted(&campaign)).is_finished());
        assert_eq!(Problem::new(campaign.clone()).approaches().count(), 4);
        assert_eq!(Problem::new(enriched()).approaches().count(), 5);
    }
}
