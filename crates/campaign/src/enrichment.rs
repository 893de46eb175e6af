//! What the enrichment of a campaign is made of: its points and its settings.
//!
//! The decisions themselves are [`enrich::decide`]'s.

use cmaes::Bounds;
use enrich::{Known, Options};
use sha2::{Digest as _, Sha256};

use crate::file::Enrichment;
use crate::formulation::{Criteria, Problem, ROBUST_VARIABLES, Variables};
use crate::plan::VerifyPoint;
use ledger::StreamId;

/// The numbers of infill points begin here, above those of all other points.
const FIRST: u64 = 1 << 27;

/// Designs of the DoE that miss the constraints by more than this do not enter the model: what lies
/// that far out says little of the response within them.
pub const REACH: f64 = 1.0;

/// The enrichment as far as the store holds it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Progress {
    /// How many rounds were decided.
    pub rounds: u32,
    /// The points of the last one.
    pub points: Vec<VerifyPoint>,
    /// Whether the last one decided to stop.
    pub is_stopped: bool,
}

/// Whether a point is one of the enrichment.
#[must_use]
pub const fn is_infill(number: u64) -> bool {
    number >= FIRST
}

/// The number of the `index`-th infill point of a campaign, which lies at `x`; it names its random
/// streams.
///
/// It is drawn from index and place, so that a point that lies elsewhere after its campaign has
/// been given more samples has another number: what is brought late for the old one cannot be taken
/// for it. `taken` holds the numbers of the points before it.
#[must_use]
pub fn point_number(index: u64, x: &[f64; ROBUST_VARIABLES], taken: &[u64]) -> u64 {
    let mut hash = Sha256::new();
    hash.update(index.to_le_bytes());
    for value in x {
        hash.update(value.to_le_bytes());
    }
    let digest = hash.finalize();
    let mut drawn = u64::from(u32::from_le_bytes([
        digest[0], digest[1], digest[2], digest[3],
    ])) % FIRST;
    while taken.contains(&(FIRST + drawn)) {
        drawn = (drawn + 1) % FIRST;
    }
    FIRST + drawn
}

/// The name of an infill point in the store.
#[must_use]
pub fn point_name(index: u64, number: u64) -> String {
    format!("infill-{index:04}-{}", mark(number))
}

/// What is drawn in an infill point's number: the end of its name.
#[must_use]
pub fn mark(number: u64) -> String {
    format!("{:07x}", number % FIRST)
}

/// How far a design misses the constraints, from its criteria with the pressure under Archard's
/// wear: 0 if it is feasible. One whose geometry is out already is not asked for its pressure.
#[must_use]
pub fn violation(problem: &Problem, criteria: &Criteria) -> f64 {
    let geometry = geometric_violation(problem, criteria);
    if geometry > 0.0 {
        return geometry;
    }
    if problem.is_feasible(criteria) {
        0.0
    } else {
        // On the edge itself the violation is zero, but the inequalities are strict.
        problem.violation(criteria).max(f64::MIN_POSITIVE)
    }
}

fn geometric_violation(problem: &Problem, criteria: &Criteria) -> f64 {
    problem.violation(&Criteria {
        hertz_pressure_mpa: 0.0,
        ..*criteria
    })
}

/// What the built-in simulator knows of a design without sampling it, and how many analyses that
/// took; none if it cannot be simulated. The baseline is ΔSTE with Archard's wear, which the random
/// wear scatters around; a design whose geometry is out already is not asked for it.
#[must_use]
pub fn known(problem: &Problem, variables: &Variables) -> Option<(Known, u64)> {
    let pair = problem.pair(variables).ok()?;
    let unloaded = problem.criteria(&pair, 0.0);
    let geometry = geometric_violation(problem, &unloaded);
    if geometry > 0.0 {
        return Some((Known::from(geometry), 0));
    }
    let worn = pair.archard(problem.wear()).analysis;
    let criteria = Criteria {
        hertz_pressure_mpa: worn.hertz_pressure_mpa,
        ..unloaded
    };
    let known = Known {
        violation: violation(problem, &criteria),
        baseline_um: worn.delta_ste_um,
    };
    // Archard's wear rests on the unworn analysis.
    Some((known, 2))
}

/// The settings of a round, with so many samples left for infill.
///
/// # Errors
///
/// The campaign's bounds make no box; never for a validated campaign.
pub fn options(
    problem: &Problem,
    section: &Enrichment,
    samples_left: u32,
) -> Result<Options, cmaes::Error> {
    let [low, high] = [0.0, 1.0].map(|unit| problem.robust_point(&[unit; ROBUST_VARIABLES]));
    let bounds = Bounds::new(low.into_iter().zip(high).collect::<Vec<_>>())?;
    Ok(Options {
        seed: problem.campaign().seed,
        criterion: section.criterion,
        batch: section.points_per_round as usize,
        samples_new: section.samples_per_point,
        samples_more: section.samples_per_point,
        samples_left,
        rounds: section.rounds as usize,
        delta_um: section.tolerance_um,
        // What follows was chosen on the problem of campaigns/wear.toml, over ten seeds.
        quantile_z: 0.84,
        global_every: 6,
        basins: 3,
        local_points: 15 * ROBUST_VARIABLES,
        search_evaluations: 400,
        ..Options::new(bounds)
    })
}

impl Progress {
    /// Whether every point of the last round has its samples or was given up.
    #[must_use]
    pub fn is_settled(&self, is_given_up: impl Fn(StreamId) -> bool) -> bool {
        let settled =
            |point: &VerifyPoint| point.is_complete() || is_given_up(StreamId::point(point.number));
        self.points.iter().all(settled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{self, LocalStep, State};
    use crate::{Approach, Campaign, Frozen};

    #[test]
    fn numbers_follow_place_and_turn_and_never_repeat() {
        let x = [0.25, 1.37, 1.37, 0.85, 1.31, 0.80];
        let number = point_number(17, &x, &[]);
        assert_eq!(number, point_number(17, &x, &[]));
        assert!(is_infill(number) && number < 1 << 28);
        assert_ne!(number, point_number(18, &x, &[]));
        assert_ne!(number, point_number(17, &[0.5; 6], &[]));
        // Where two meet, the later one goes on to the next number.
        let next = point_number(17, &x, &[number]);
        assert!(next == number + 1 || next == FIRST);
        assert_eq!(
            point_name(17, number),
            format!("infill-0017-{:07x}", number - FIRST)
        );
    }

    #[test]
    fn violations_from_stored_criteria_are_those_of_the_simulator() {
        let problem = Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap());
        let frozen = problem.printed_frozen();
        let (mut feasible, mut pressed, mut geometric) = (0, 0, 0);
        for i in 0..400_u32 {
            // A sequence that fills the cube evenly enough.
            let unit: [f64; 6] = std::array::from_fn(|j| {
                (f64::from(i + 1) * [2.0_f64, 3.0, 5.0, 7.0, 11.0, 13.0][j].sqrt()).fract()
            });
            let variables = Variables::robust(&problem.robust_point(&unit), &frozen);
            let Some((found, calls)) = known(&problem, &variables) else {
                assert!(problem.pair(&variables).is_err());
                continue;
            };
            let pair = problem.pair(&variables).unwrap();
            let worn = pair.archard(problem.wear()).analysis;
            let exact = found.violation;
            let expected = if calls > 0 { worn.delta_ste_um } else { 0.0 };
            assert_eq!(found.baseline_um, expected);
            let criteria = problem.criteria(&pair, worn.hertz_pressure_mpa);
            assert_eq!(violation(&problem, &criteria), exact);
            assert_eq!(problem.is_feasible(&criteria), exact == 0.0);
            match (exact == 0.0, calls) {
                (true, _) => feasible += 1,
                (false, 0) => geometric += 1,
                _ => pressed += 1,
            }
        }
        assert!(
            feasible > 0 && geometric > 0,
            "{feasible} {pressed} {geometric}"
        );
    }

    fn enriched() -> Campaign {
        let text = include_str!("../../../campaigns/enriched.toml");
        Campaign::parse("enriched.toml", text).unwrap()
    }

    fn point(number: u64, stored: u32, frozen: &Frozen) -> VerifyPoint {
        VerifyPoint {
            name: point_name(0, number),
            number,
            variables: Variables::robust(&[0.5; 6], frozen),
            wanted: 30,
            stored: (0..stored).collect(),
        }
    }

    /// A campaign whose model has just been fitted.
    fn fitted(campaign: &Campaign) -> State {
        State {
            designs: campaign.doe.designs as usize,
            has_responses: true,
            model: Some("model".into()),
            optima: [
                Approach::NoWear,
                Approach::Archard,
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
        let frozen = Problem::new(campaign.clone()).printed_frozen();
        let step = |state: &State| plan::next(&campaign, frozen, state).local;
        let mut state = fitted(&campaign);
        assert_eq!(step(&state), Some(LocalStep::Enrich));
        // It does not wait for the runs on the model, nor for a model.
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
                point(numbers[0], 30, &frozen),
                point(numbers[1], 12, &frozen),
                point(numbers[2], 0, &frozen),
            ],
            is_stopped: false,
        };
        let next = plan::next(&campaign, frozen, &state);
        let open: Vec<u64> = next.points.iter().map(|point| point.number).collect();
        assert_eq!((open.as_slice(), next.local), (&numbers[1..], None));
        // One gets its samples, one fails: both are settled.
        state.enrichment.points[2] = point(numbers[2], 30, &frozen);
        assert_eq!(step(&state), None);
        state.given_up.insert(StreamId::point(numbers[1]));
        let next = plan::next(&campaign, frozen, &state);
        assert_eq!(next.local, Some(LocalStep::Enrich));
        assert_eq!(next.points, []);
    }

    #[test]
    fn the_round_that_stops_is_followed_by_its_recommendation_and_that_by_fresh_samples() {
        let campaign = enriched();
        let frozen = Problem::new(campaign.clone()).printed_frozen();
        let approach = Approach::EnrichedKriging;
        let mut state = fitted(&campaign);
        state.enrichment = Progress {
            rounds: 4,
            points: Vec::new(),
            is_stopped: true,
        };
        let next = plan::next(&campaign, frozen, &state);
        assert_eq!(next.local, Some(LocalStep::Choose(approach)));
        let variables = Variables::robust(&[0.5; 6], &frozen);
        state.optima.insert(approach, Some(variables));
        let next = plan::next(&campaign, frozen, &state);
        assert_eq!(next.local, None);
        let open: Vec<_> = next.points.iter().map(|p| (p.number, p.wanted)).collect();
        assert_eq!(open, [(5, campaign.verify.samples)]);
        let stored = (0..campaign.verify.samples).collect();
        state.verified.insert(approach, stored);
        assert!(plan::next(&campaign, frozen, &state).is_finished());
    }

    #[test]
    fn without_the_section_nothing_is_enriched() {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let frozen = Problem::new(campaign.clone()).printed_frozen();
        assert!(plan::next(&campaign, frozen, &fitted(&campaign)).is_finished());
        assert_eq!(Approach::of(&campaign).count(), 4);
        assert_eq!(Approach::of(&enriched()).count(), 5);
    }
}
