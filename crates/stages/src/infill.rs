//! Infill points: their numbers and names, their constraints and baseline, which take no samples,
//! and the settings of a round.
//!
//! [`enrich::decide`] makes the decisions themselves.

use cmaes::Bounds;
use enrich::{ExactCriteria, Options};
use problem::file::Enrichment;
use problem::formulation::{Criteria, Design, GearCriteria, Problem};
use problem::simulator::{Analysis, State};
use problem::task::{FIRST_INFILL, infill_mark};
use sha2::{Digest as _, Sha256};

/// The constraint violation above which designs of the DoE do not enter the model: so far out they
/// carry little information about the response within the constraints.
pub const REACH: f64 = 1.0;

/// Evaluations in the search for one infill point of a gear campaign, fewer than usual because each of them analyses a
/// pair. More of them do not lead to better pairs, either (`docs/enrichment.md`).
pub const SEARCH_EVALUATIONS: usize = 200;

/// Starts of each fit in a gear campaign, fewer than usual because every round fits all models again. More of them do
/// not lead to better pairs.
pub const FIT_STARTS: usize = 2;

/// [`InfillRow::reason`](store::InfillRow::reason) of more samples at a sampled design.
pub const MORE: &str = "more";

/// A design's variables as a key.
#[must_use]
pub(crate) fn bits(x: &[f64]) -> Vec<u64> {
    // 0 and −0 are the same place.
    x.iter().map(|x| (x + 0.0).to_bits()).collect()
}

/// Whether a point is one of the enrichment.
#[must_use]
pub const fn is_infill(number: u64) -> bool {
    number >= FIRST_INFILL
}

/// The number of the `index`-th infill point of a campaign, which lies at `x`; it names its random
/// streams.
///
/// The number is a hash of index and place. A point that lies elsewhere after its campaign has been
/// given more samples has another number, so that late results for the old point cannot be mistaken
/// for its own. `taken` holds the numbers of the points before it.
#[must_use]
pub fn point_number(index: u64, x: &[f64], taken: &[u64]) -> u64 {
    let mut hash = Sha256::new();
    hash.update(index.to_le_bytes());
    for value in x {
        hash.update(value.to_le_bytes());
    }
    let digest = hash.finalize();
    let mut drawn = u64::from(u32::from_le_bytes([
        digest[0], digest[1], digest[2], digest[3],
    ])) % FIRST_INFILL;
    while taken.contains(&(FIRST_INFILL + drawn)) {
        drawn = (drawn + 1) % FIRST_INFILL;
    }
    FIRST_INFILL + drawn
}

/// The name of an infill point in the store.
#[must_use]
pub fn point_name(index: u64, number: u64) -> String {
    format!("infill-{index:04}-{}", infill_mark(number))
}

/// The constraint violation of a design, from its criteria with the pressure under Archard's wear:
/// 0 if it is feasible. If the geometry breaks a constraint, the pressure does not count.
#[must_use]
pub fn violation(problem: &Problem, criteria: &Criteria) -> f64 {
    if problem.gears().is_some() {
        let geometry = geometric_violation(problem, &criteria.gears());
        if geometry > 0.0 {
            return geometry;
        }
    }
    if problem.is_feasible(criteria) {
        0.0
    } else {
        // On the edge itself the violation is zero, but the inequalities are strict.
        problem.violation(criteria).max(f64::MIN_POSITIVE)
    }
}

fn geometric_violation(problem: &Problem, criteria: &GearCriteria) -> f64 {
    let unloaded = GearCriteria {
        hertz_pressure_mpa: 0.0,
        ..*criteria
    };
    problem.violation(&unloaded.into())
}

/// The constraint violation and the baseline of a design by the built-in simulator, and the number
/// of analyses they took; `None` if the design cannot be simulated. The baseline is ΔSTE with
/// Archard's wear, around which the random wear scatters. The contact of a design whose geometry breaks a
/// constraint is not solved.
#[must_use]
pub fn known(problem: &Problem, design: &Design) -> Option<(ExactCriteria, u64)> {
    let Some(gears) = problem.gears() else {
        // There are no constraints, and no baseline that the coordinator could compute.
        let known = ExactCriteria {
            violation: 0.0,
            baseline: 0.0,
            holds: 1.0,
        };
        return Some((known, 0));
    };
    let pair = gears.unloaded(design).ok()?;
    let unloaded = gears.pair_criteria(&pair, 0.0);
    let geometry = geometric_violation(problem, &unloaded);
    if geometry > 0.0 {
        return Some((ExactCriteria::from(geometry), 0));
    }
    let cases = gears.cases_of(pair.load().ok()?, gears.wear()).ok()?;
    let worn = gears.analyse(&cases, State::Baseline);
    let known = ExactCriteria {
        violation: violation(problem, &worn.criteria),
        baseline: worn.value,
        holds: 1.0,
    };
    // Archard's wear rests on the unworn analysis.
    Some((known, 2))
}

/// The baseline that a model of the response adds to, from an analysis with the mean wear, µm; 0 where
/// [`known`] has none.
#[must_use]
pub fn baseline(problem: &Problem, worn: &Analysis) -> f64 {
    if problem.gears().is_some() {
        worn.value
    } else {
        0.0
    }
}

/// [`baseline`] of a design; `None` if it cannot be simulated.
#[must_use]
pub fn baseline_at_um(problem: &Problem, design: &Design) -> Option<f64> {
    let Some(gears) = problem.gears() else {
        return Some(0.0);
    };
    let cases = gears.loaded(design).ok()?;
    Some(gears.analyse(&cases, State::Baseline).value)
}

/// The settings of a round, with `samples_left` samples left for infill.
pub fn options(
    problem: &Problem,
    section: &Enrichment,
    samples_left: u32,
) -> Result<Options, cmaes::Error> {
    let ranges = problem.free_ranges().map(|[low, high]| (low, high));
    let standard = Options::new(Bounds::new(ranges.collect::<Vec<_>>())?);
    Ok(Options {
        values: problem
            .coordinates()
            .iter()
            .map(|one| one.values.clone())
            .collect(),
        seed: problem.campaign().seed,
        criterion: section.criterion,
        kernel: problem.campaign().kriging.kernel,
        noise: problem.campaign().kriging.noise.unwrap_or(standard.noise),
        batch: section.points_per_round as usize,
        samples_new: section.samples_per_point,
        samples_more: section.samples_per_point,
        samples_left,
        rounds: section.rounds as usize,
        delta_um: section.tolerance,
        search_evaluations: match problem.gears() {
            Some(_) => SEARCH_EVALUATIONS,
            None => standard.search_evaluations,
        },
        fit_starts: match problem.gears() {
            Some(_) => FIT_STARTS,
            None => standard.fit_starts,
        },
        ..standard
    })
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    #[test]
    fn numbers_follow_place_and_turn_and_never_repeat() {
        let x = [0.25, 1.37, 1.37, 0.85, 1.31, 0.80];
        let number = point_number(17, &x, &[]);
        assert_eq!(number, point_number(17, &x, &[]));
        assert!(is_infill(number) && number < 1 << 28);
        assert_ne!(number, point_number(18, &x, &[]));
        assert_ne!(number, point_number(17, &[0.5; 6], &[]));
        // If two numbers coincide, the later point takes the next one.
        let next = point_number(17, &x, &[number]);
        assert!(next == number + 1 || next == FIRST_INFILL);
        assert_eq!(
            point_name(17, number),
            format!("infill-0017-{:07x}", number - FIRST_INFILL)
        );
    }

    #[test]
    fn violations_from_stored_criteria_are_those_of_the_simulator() {
        let problem = Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap());
        let (base, gears) = (problem.base().clone(), problem.gears().unwrap());
        let (mut feasible, mut pressed, mut geometric) = (0, 0, 0);
        for i in 0..400_u32 {
            // A sequence that fills the cube evenly enough.
            let unit: [f64; 6] = std::array::from_fn(|j| {
                (f64::from(i + 1) * [2.0_f64, 3.0, 5.0, 7.0, 11.0, 13.0][j].sqrt()).fract()
            });
            let variables = problem.design(&problem.free_point(&unit), &base);
            let Some((found, calls)) = known(&problem, &variables) else {
                assert!(gears.pair(&variables).is_err());
                continue;
            };
            let pair = gears.pair(&variables).unwrap();
            let worn = pair.archard(gears.wear()).analysis;
            let exact = found.violation;
            let expected = if calls > 0 { worn.delta_ste_um } else { 0.0 };
            assert_eq!(found.baseline, expected);
            let criteria = gears.pair_criteria(&pair, worn.hertz_pressure_mpa).into();
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
}
