//! The compared designs, and the front of the non-dominated ones.

use std::collections::BTreeMap;

use anyhow::Context as _;
use problem::formulation::Problem;
use problem::{Design, GearCriteria};
use rayon::prelude::*;
use results::optima::{Optima, VerifiedOptimum};
use stages::doe::Doe;
use stats::IntervalEstimate;
use store::Store;

use crate::direct::{self, Start};
use crate::samples;

/// The number of the first search; those of corrections have lower numbers.
const FIRST_SEARCH: u64 = 1000;

/// Share by which the tightest limit of a search lies below the best design's value.
const REACH: f64 = 0.15;

/// The second objective.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Objective {
    /// p_H, the largest contact pressure with Archard's wear
    Pressure,
    /// σ_vm, the larger root stress
    RootStress,
}

impl Objective {
    /// The name of its constraint, as [`problem::formulation::Constraint`] has it.
    pub(super) const fn constraint(self) -> &'static str {
        match self {
            Self::Pressure => "contact pressure",
            Self::RootStress => "root stress",
        }
    }

    pub(super) const fn label(self) -> &'static str {
        match self {
            Self::Pressure => "contact pressure p_H (MPa)",
            Self::RootStress => "root stress σ_vm (MPa)",
        }
    }

    pub(super) const fn of(self, criteria: &GearCriteria) -> f64 {
        match self {
            Self::Pressure => criteria.hertz_pressure_mpa,
            Self::RootStress => criteria.root_stress_mpa,
        }
    }

    /// The campaign's limit, MPa; infinite if it has none.
    #[must_use]
    pub fn limit(self, problem: &Problem) -> f64 {
        let Some(sections) = problem.campaign().gears() else {
            return f64::NAN;
        };
        let (limits, material) = (&sections.constraints, &sections.material);
        match self {
            Self::Pressure => limits.hertz_pressure_max(material.contact_limit_mpa()),
            Self::RootStress => limits.root_stress_max_mpa.unwrap_or(f64::INFINITY),
        }
    }

    /// The same problem with another limit, which is not an input of the simulator.
    fn limited(self, problem: &Problem, limit: f64) -> Problem {
        let mut campaign = problem.campaign().clone();
        if let Some(sections) = campaign.gears_mut() {
            match self {
                Self::Pressure => sections.constraints.hertz_pressure_max_mpa = Some(limit),
                Self::RootStress => sections.constraints.root_stress_max_mpa = Some(limit),
            }
        }
        Problem::new(campaign)
    }
}

/// The origin of a design.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Design of the DoE with this index.
    Doe(u64),
    /// The optimum of the approach of this name.
    Optimum(&'static str),
    /// A direct search under a limit.
    Search,
}

impl Source {
    pub(super) fn name(self) -> String {
        match self {
            Self::Doe(index) => format!("design {index} of the DoE"),
            Self::Optimum(approach) => format!("optimum of {approach}"),
            Self::Search => "direct search".to_owned(),
        }
    }
}

/// A design with both objectives.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The origin of the design.
    pub source: Source,
    /// The design.
    pub design: Design,
    pub criteria: GearCriteria,
    /// P90 from the samples of the campaign, or of the search that found it.
    pub p90: IntervalEstimate,
    /// P90 from verification samples; `None` if there are none.
    pub verified: Option<IntervalEstimate>,
    /// Whether no other design is at least as good in both objectives, by verification samples where there
    /// are any.
    pub on_front: bool,
}

impl Point {
    pub(super) fn judged(&self) -> f64 {
        self.verified.unwrap_or(self.p90).value
    }
}

/// The designs of a finished campaign's DoE that satisfy every constraint except that on the second
/// objective.
///
/// # Errors
///
/// The store cannot be read.
pub async fn of_doe(
    store: &Store,
    problem: &Problem,
    base: &Design,
    against: Objective,
) -> anyhow::Result<Vec<Point>> {
    let doe = Doe::read(store).await?;
    let counts: BTreeMap<u64, u64> = store.sampled_counts().await?.into_iter().collect();
    let mut judged = doe.judged(problem, base);
    let mut points = Vec::new();
    for response in &doe.responses {
        let Some((design, criteria)) = judged.remove(&response.design) else {
            continue;
        };
        let constraints = problem.constraints(&criteria);
        let mut others = constraints
            .iter()
            .filter(|constraint| constraint.name != against.constraint());
        if !others.all(|constraint| constraint.holds()) {
            continue;
        }
        let samples = counts.get(&response.design).copied().unwrap_or(0) as usize;
        let estimate = stats::Percentile {
            n: samples,
            mean: response.mean,
            sd: response.standard_deviation,
            p90: response.measure,
            variance: response.measure_variance,
        };
        points.push(Point {
            source: Source::Doe(response.design),
            design,
            criteria: criteria.gears(),
            p90: IntervalEstimate {
                n: samples,
                value: response.measure,
                interval: stats::percentile_interval(&estimate, 0.95).ok(),
            },
            verified: None,
            on_front: false,
        });
    }
    Ok(points)
}

/// The feasible optima of a finished campaign that keep every limit on samples, in the order of the approaches.
#[must_use]
pub fn of_optima(optima: &Optima) -> Vec<Point> {
    let point = |verified: &VerifiedOptimum| {
        let found = verified.optimum.feasible()?;
        if !verified.limits.iter().all(|limit| limit.holds) {
            return None;
        }
        let p90 = verified.measure.filter(|p90| p90.value.is_finite())?;
        Some(Point {
            source: Source::Optimum(verified.optimum.approach.name()),
            design: found.design.clone(),
            criteria: found.criteria.gears(),
            p90,
            verified: Some(p90),
            on_front: false,
        })
    };
    optima.iter().filter_map(point).collect()
}

/// The non-dominated points, by `p90` and the second objective, in ascending order of the latter.
fn front_of(points: &[Point], against: Objective, p90: fn(&Point) -> f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    let second = |i: usize| against.of(&points[i].criteria);
    order.sort_by(|&a, &b| {
        second(a)
            .total_cmp(&second(b))
            .then(p90(&points[a]).total_cmp(&p90(&points[b])))
    });
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let better = p90(&points[i]) < least;
        if better {
            least = p90(&points[i]);
        }
        better
    });
    order
}

/// The front of the DoE by its own samples, with verification samples of each of its designs unless
/// they take an external simulator.
///
/// # Errors
///
/// A design cannot be simulated again, which is not expected for a store of this version.
pub fn front_of_doe(
    problem: &Problem,
    points: &[Point],
    against: Objective,
) -> anyhow::Result<Vec<Point>> {
    let front = front_of(points, against, |point| point.p90.value);
    let front: Vec<Point> = front.into_iter().map(|i| points[i].clone()).collect();
    match problem.campaign().is_external() {
        true => Ok(front),
        false => verify(problem, front),
    }
}

/// Gives points the percentiles of verification samples.
fn verify(problem: &Problem, points: Vec<Point>) -> anyhow::Result<Vec<Point>> {
    let verified = |mut point: Point| {
        let samples = samples::verification(problem, &point.design)
            .with_context(|| format!("the {}", point.source.name()))?;
        point.verified = Some(problem.campaign().sampling.verified(&samples)?);
        Ok(point)
    };
    points.into_par_iter().map(verified).collect()
}

/// Direct searches under `count` limits of the second objective: the campaign's own, then tighter
/// and tighter ones down to 15 % below the best known design, each from the best known design
/// within its limit. A search under a limit that nothing satisfies finds nothing.
///
/// # Errors
///
/// A search fails.
pub fn refine(
    problem: &Problem,
    base: &Design,
    known: &[Point],
    against: Objective,
    count: u32,
) -> anyhow::Result<Vec<Point>> {
    // The optimum without wear has a helix angle and radii of its own, out of these searches' reach.
    let known: Vec<Point> = known
        .iter()
        .filter(|point| problem.base_of(&point.design) == *base)
        .cloned()
        .collect();
    let front = front_of(&known, against, Point::judged);
    let best = front.last().map(|&i| against.of(&known[i].criteria));
    let search = |number: u32| -> anyhow::Result<Option<Point>> {
        let own = against.limit(problem);
        let limit = match (number, best) {
            (1.., Some(best)) => {
                own.min(best * (1.0 - REACH * f64::from(number) / f64::from(count)))
            }
            _ => own,
        };
        let within = front
            .iter()
            .rev()
            .find(|&&i| against.of(&known[i].criteria) < limit)
            .map(|&i| known[i].design.clone());
        let limited = against.limited(problem, limit);
        let start = Start {
            number: FIRST_SEARCH + u64::from(number),
            start: 0,
            base,
            from: within.as_ref(),
        };
        let search = direct::search(&limited, start)?;
        Ok(search.best.map(|found| Point {
            source: Source::Search,
            design: found.design.clone(),
            criteria: found.criteria.gears(),
            p90: IntervalEstimate {
                n: problem.campaign().sampling.samples_per_design as usize,
                value: found.criterion,
                interval: None,
            },
            verified: None,
            on_front: false,
        }))
    };
    let found: anyhow::Result<Vec<Option<Point>>> =
        (0..count).into_par_iter().map(search).collect();
    verify(problem, found?.into_iter().flatten().collect())
}

/// Marks the points on the front of all of them, and sorts by the second objective.
pub fn mark(points: &mut [Point], against: Objective) {
    for i in front_of(points, against, Point::judged) {
        points[i].on_front = true;
    }
    points.sort_by(|a, b| {
        against
            .of(&a.criteria)
            .total_cmp(&against.of(&b.criteria))
            .then(a.judged().total_cmp(&b.judged()))
    });
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    fn point(source: Source, pressure: f64, p90_um: f64, verified_um: Option<f64>) -> Point {
        let problem = Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap());
        let design = stages::references::design(gear::paper::printed::Place::Figure(9));
        let measure = |value: f64| IntervalEstimate {
            n: 30,
            value,
            interval: Some((value - 0.1, value + 0.1)),
        };
        Point {
            source,
            design: design.clone(),
            criteria: {
                let gears = problem.gears().unwrap();
                gears.pair_criteria(&gears.pair(&design).unwrap(), pressure)
            },
            p90: measure(p90_um),
            verified: verified_um.map(measure),
            on_front: false,
        }
    }

    #[test]
    fn the_front_holds_what_nothing_is_better_than() {
        let doe = |i, pressure, p90| point(Source::Doe(i), pressure, p90, None);
        let points = [
            doe(0, 1000.0, 4.0),
            doe(1, 1000.0, 3.5),
            doe(2, 1100.0, 3.5),
            doe(3, 1200.0, 2.0),
            doe(4, 1300.0, 2.5),
            doe(5, 1400.0, 1.0),
        ];
        let front = front_of(&points, Objective::Pressure, |point| point.p90.value);
        assert_eq!(front, [1, 3, 5]);
        // The root stress is the same for all, so one point is best.
        let front = front_of(&points, Objective::RootStress, |point| point.p90.value);
        assert_eq!(front, [5]);
    }

    #[test]
    fn verification_samples_decide_over_those_that_a_design_was_chosen_by() {
        let mut points = [
            point(Source::Doe(0), 1000.0, 2.0, Some(3.0)),
            point(Source::Doe(1), 1400.0, 1.5, Some(3.1)),
            point(Source::Optimum("kriging"), 1300.0, 2.0, Some(2.0)),
        ];
        mark(&mut points, Objective::Pressure);
        let marks = points.clone().map(|point| (point.source, point.on_front));
        assert_eq!(
            marks,
            [
                (Source::Doe(0), true),
                (Source::Optimum("kriging"), true),
                (Source::Doe(1), false)
            ]
        );
    }

    #[test]
    fn searches_under_a_limit_stay_below_it() {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.optimise.evaluations = 400;
        campaign.optimise.restart_at = Some(200);
        campaign.sampling.samples_per_design = 8;
        campaign.verify.samples = Some(50);
        let problem = Problem::new(campaign);
        let known = [
            point(Source::Doe(0), 1150.0, 4.0, None),
            point(Source::Doe(1), 1500.0, 3.0, None),
        ];
        let refine = || {
            let base = problem.base().clone();
            refine(&problem, &base, &known, Objective::Pressure, 2).unwrap()
        };
        let found = refine();
        // Compared as text, because an unknown end of an interval is NaN, which does not equal
        // itself.
        assert_eq!(format!("{found:?}"), format!("{:?}", refine()));
        assert_eq!(found.len(), 2);
        // The campaign's own limit, then half of 15 % below the best known design's 1500 MPa.
        for (point, limit) in found.iter().zip([1550.0, 1387.5]) {
            assert!(point.criteria.hertz_pressure_mpa < limit);
            assert!(problem.is_feasible(&point.criteria.into()));
            assert_eq!(point.verified.unwrap().n, 50);
        }
    }
}
