//! `coordinator pareto`: P90 of ΔSTE against the contact pressure or the root stress.
//!
//! The designs are those of a finished campaign, with the samples that it has: no new ones are
//! needed for the front of its DoE. As the least of many estimates is low by chance, the designs of
//! the front get fresh samples, beside the optima, which have them already; and more designs can be
//! searched directly under a tighter and tighter limit of the second objective (the ε-constraint
//! method).

use std::path::Path;

use anyhow::Context as _;
use campaign::direct::{self, Corrected, Space};
use campaign::formulation::{Problem, VARIABLE_NAMES};
use campaign::{Criteria, Frozen, Variables};
use rayon::prelude::*;
use report::{Percentile, PercentileSeries};
use store::{CriteriaRow, Store};

use super::finished::Optimum;
use super::{NOTHING, Table, exact, maybe_exact, with_interval, write};
use crate::reporting::percentile;
use crate::steps::worn_criteria;

/// Random streams of refined designs and of the DoE's; corrections have the numbers below.
const REFINED: u64 = 1000;
const OF_DOE: u64 = 1 << 32;

/// How far below the best design's value the tightest limit of a search lies, as a share of it.
const REACH: f64 = 0.15;

/// The second objective.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Against {
    /// F, the largest contact pressure with Archard's wear
    Pressure,
    /// σ_vm, the larger root stress
    RootStress,
}

impl Against {
    /// The name of its constraint, as [`campaign::formulation::Constraint`] has it.
    const fn constraint(self) -> &'static str {
        match self {
            Self::Pressure => "F",
            Self::RootStress => "σ_vm",
        }
    }

    const fn label(self) -> &'static str {
        match self {
            Self::Pressure => "contact pressure F (MPa)",
            Self::RootStress => "root stress σ_vm (MPa)",
        }
    }

    const fn of(self, criteria: &Criteria) -> f64 {
        match self {
            Self::Pressure => criteria.hertz_pressure_mpa,
            Self::RootStress => criteria.root_stress_mpa,
        }
    }

    /// The campaign's limit, MPa.
    fn limit(self, problem: &Problem) -> f64 {
        let material = &problem.campaign().material;
        match self {
            Self::Pressure => material.hertz_limit_mpa,
            Self::RootStress => material.yield_mpa,
        }
    }

    /// The same problem with another limit. A limit is no input of the simulator.
    fn limited(self, problem: &Problem, limit: f64) -> Problem {
        let mut campaign = problem.campaign().clone();
        match self {
            Self::Pressure => campaign.material.hertz_limit_mpa = limit,
            Self::RootStress => campaign.material.yield_mpa = limit,
        }
        Problem::new(campaign)
    }
}

/// Where a design comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Design of the DoE with this index.
    Doe(u64),
    /// The optimum of the approach of this name.
    Optimum(&'static str),
    /// A direct search under a limit.
    Refined,
}

impl Source {
    fn name(self) -> String {
        match self {
            Self::Doe(index) => format!("design {index} of the DoE"),
            Self::Optimum(approach) => format!("optimum of {approach}"),
            Self::Refined => "direct search".to_owned(),
        }
    }
}

/// A design with both objectives.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Where it comes from.
    pub source: Source,
    /// The design.
    pub variables: Variables,
    /// Its criteria.
    pub criteria: Criteria,
    /// P90 from the samples of the campaign, or of the search that found it.
    pub p90: Percentile,
    /// P90 from fresh samples; none where there are none.
    pub fresh: Option<Percentile>,
    /// Whether no other design is at least as good in both objectives, by fresh samples where there
    /// are any.
    pub on_front: bool,
}

impl Point {
    fn judged_um(&self) -> f64 {
        self.fresh.unwrap_or(self.p90).value_um
    }
}

/// The designs of a finished campaign's DoE that satisfy every constraint, that on the second
/// objective aside.
///
/// # Errors
///
/// The store cannot be read.
pub async fn of_doe(
    store: &Store,
    problem: &Problem,
    frozen: &Frozen,
    against: Against,
) -> anyhow::Result<Vec<Point>> {
    let designs = store.designs().await?;
    let criteria = store.criteria().await?;
    let counts: std::collections::BTreeMap<u64, u64> =
        store.sampled_counts().await?.into_iter().collect();
    let row_of = |design: u64| -> Option<&CriteriaRow> {
        let at = criteria
            .binary_search_by_key(&design, |row| row.design)
            .ok()?;
        criteria.get(at)
    };
    let mut points = Vec::new();
    for response in store.responses().await? {
        let Some(design) = designs.get(response.design as usize) else {
            continue;
        };
        let variables = Variables::robust(&design.point(), frozen);
        let found = row_of(response.design).and_then(|row| worn_criteria(problem, &variables, row));
        let Some(criteria) = found else { continue };
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
            mean: response.mean_um,
            sd: response.sd_um,
            p90: response.p90_um,
            variance: response.p90_variance_um2,
        };
        let (low_um, high_um) =
            stats::p90_interval(&estimate, 0.95).unwrap_or((f64::NAN, f64::NAN));
        points.push(Point {
            source: Source::Doe(response.design),
            variables,
            criteria,
            p90: Percentile {
                value_um: response.p90_um,
                low_um,
                high_um,
                samples,
            },
            fresh: None,
            on_front: false,
        });
    }
    Ok(points)
}

/// The optima of a finished campaign.
#[must_use]
pub fn of_optima(optima: &[Optimum]) -> Vec<Point> {
    optima
        .iter()
        .map(|optimum| {
            let p90 = percentile(&optimum.fresh);
            Point {
                source: Source::Optimum(optimum.approach.name()),
                variables: optimum.variables,
                criteria: optimum.criteria,
                p90,
                fresh: Some(p90),
                on_front: false,
            }
        })
        .filter(|point| point.p90.value_um.is_finite())
        .collect()
}

/// The non-dominated points, by `p90` and the second objective, in ascending order of the latter.
fn front_of(points: &[Point], against: Against, p90: fn(&Point) -> f64) -> Vec<usize> {
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

/// The front of the DoE by its own samples, with fresh samples for each of its designs if the
/// built-in model is the campaign's simulator.
///
/// # Errors
///
/// A design cannot be simulated again; none for a store of this version.
pub fn front_of_doe(
    problem: &Problem,
    points: &[Point],
    against: Against,
) -> anyhow::Result<Vec<Point>> {
    let front = front_of(points, against, |point| point.p90.value_um);
    let mut front: Vec<Point> = front.into_iter().map(|i| points[i].clone()).collect();
    if !problem.campaign().is_external() {
        front.par_iter_mut().try_for_each(|point| {
            let Source::Doe(index) = point.source else {
                return Ok(());
            };
            verify(problem, point, OF_DOE + index)
        })?;
    }
    Ok(front)
}

fn verify(problem: &Problem, point: &mut Point, number: u64) -> anyhow::Result<()> {
    let design = Corrected {
        variables: point.variables,
        corrections: gear::Corrections::default(),
    };
    let fresh = direct::verify(problem, &design, number)
        .with_context(|| format!("{} was simulated before", point.source.name()))?;
    point.fresh = Some(percentile(&fresh));
    Ok(())
}

/// Direct searches under `count` limits of the second objective: the campaign's own, then tighter
/// and tighter ones down to 15 % below the best known design, each from the best known design
/// within its limit. A search under a limit that nothing satisfies finds nothing.
///
/// # Errors
///
/// None for a validated campaign.
pub fn refine(
    problem: &Problem,
    frozen: &Frozen,
    known: &[Point],
    against: Against,
    count: u32,
) -> anyhow::Result<Vec<Point>> {
    // The optimum without wear has a helix angle and radii of its own, out of these searches' reach.
    let known: Vec<Point> = known
        .iter()
        .filter(|point| point.variables.frozen_part() == *frozen)
        .cloned()
        .collect();
    let front = front_of(&known, against, Point::judged_um);
    let best = front.last().map(|&i| against.of(&known[i].criteria));
    let found: Vec<Option<Point>> = (0..count)
        .into_par_iter()
        .map(|number| -> anyhow::Result<Option<Point>> {
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
                .map(|&i| problem.unit_point(&known[i].variables.robust_part()));
            let limited = against.limited(problem, limit);
            let number = REFINED + u64::from(number);
            let origin = within.as_ref().map(|unit| &unit[..]);
            let search = direct::search(&limited, frozen, &Space::plain(), number, 0, origin)
                .map_err(anyhow::Error::msg)?;
            let Some(found) = search.found else {
                return Ok(None);
            };
            let mut point = Point {
                source: Source::Refined,
                variables: found.design.variables,
                criteria: found.criteria,
                p90: Percentile {
                    value_um: found.p90_um,
                    low_um: f64::NAN,
                    high_um: f64::NAN,
                    samples: problem.campaign().sampling.samples_per_design as usize,
                },
                fresh: None,
                on_front: false,
            };
            verify(problem, &mut point, number)?;
            Ok(Some(point))
        })
        .collect::<anyhow::Result<_>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// Says of each point whether it is on the front of them all, and sorts by the second objective.
pub fn mark(points: &mut [Point], against: Against) {
    for i in front_of(points, against, Point::judged_um) {
        points[i].on_front = true;
    }
    points.sort_by(|a, b| {
        against
            .of(&a.criteria)
            .total_cmp(&against.of(&b.criteria))
            .then(a.judged_um().total_cmp(&b.judged_um()))
    });
}

/// Writes `pareto.csv`, `pareto.md` and `pareto.svg` into `out`; returns the Markdown. `all` are the
/// designs behind the front of the DoE, `marked` what [`mark`] has seen, after so many `searches`.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(
    out: &Path,
    problem: &Problem,
    against: Against,
    all: &[Point],
    marked: &[Point],
    searches: u32,
) -> anyhow::Result<String> {
    write(out, "pareto.csv", all_figures(marked).csv()?)?;
    let mut page = format!(
        "# {}: P90 of ΔSTE against the {}\n\n\
         {} designs of the DoE satisfy the constraints, that on {} (below {} MPa) aside. Below are \
         those that no other is better than by the samples of the campaign, the optima, and what \
         searches found; intervals are of 95 %. A design is on the front if no other one is better \
         by fresh samples.\n\n{}",
        problem.campaign().name,
        against.label(),
        all.len(),
        against.constraint(),
        against.limit(problem),
        summary(problem, against, marked).markdown()
    );
    if searches > 0 {
        let found = marked
            .iter()
            .filter(|point| point.source == Source::Refined);
        page += &format!(
            "\n{} of {searches} direct searches found a design within their limit.\n",
            found.count()
        );
    }
    match chart(problem, against, all, marked) {
        Ok(svg) => {
            write(out, "pareto.svg", svg)?;
            page += "\n![The front](pareto.svg)\n";
        }
        Err(why) => page += &format!("\n{why}\n"),
    }
    write(out, "pareto.md", &page)?;
    Ok(page)
}

fn summary(problem: &Problem, against: Against, points: &[Point]) -> Table {
    let mut table = Table::new([
        "design",
        against.label(),
        "P90 of its samples, µm",
        "P90 of fresh samples, µm",
        "on the front",
    ]);
    for point in points {
        let value = against.of(&point.criteria);
        let beyond = if value < against.limit(problem) {
            ""
        } else {
            " (beyond the limit)"
        };
        table.rows.push(vec![
            point.source.name(),
            format!("{value:.0}{beyond}"),
            with_interval(&point.p90),
            point
                .fresh
                .as_ref()
                .map_or(NOTHING.to_owned(), with_interval),
            if point.on_front { "yes" } else { "no" }.to_owned(),
        ]);
    }
    table
}

fn all_figures(points: &[Point]) -> Table {
    let mut header = vec!["source"];
    header.extend(VARIABLE_NAMES);
    header.extend([
        "contact_ratio",
        "specific_sliding",
        "hertz_pressure_mpa",
        "root_stress_mpa",
        "p90_um",
        "p90_low_um",
        "p90_high_um",
        "fresh_p90_um",
        "fresh_p90_low_um",
        "fresh_p90_high_um",
        "on_front",
    ]);
    let mut table = Table::new(header);
    for point in points {
        let mut line = vec![point.source.name()];
        line.extend(point.variables.values().map(exact));
        let criteria = &point.criteria;
        line.extend(
            [
                criteria.contact_ratio,
                criteria.specific_sliding,
                criteria.hertz_pressure_mpa,
                criteria.root_stress_mpa,
            ]
            .map(exact),
        );
        for p90 in [Some(point.p90), point.fresh] {
            let finite = |value: f64| value.is_finite().then_some(value);
            line.push(maybe_exact(p90.map(|p90| p90.value_um)));
            line.push(maybe_exact(p90.and_then(|p90| finite(p90.low_um))));
            line.push(maybe_exact(p90.and_then(|p90| finite(p90.high_um))));
        }
        line.push(u8::from(point.on_front).to_string());
        table.rows.push(line);
    }
    table
}

fn chart(
    problem: &Problem,
    against: Against,
    all: &[Point],
    marked: &[Point],
) -> Result<String, report::Error> {
    let at = |point: &Point| against.of(&point.criteria);
    let series = |name: &str, of: &dyn Fn(&Source) -> bool| PercentileSeries {
        name: name.to_owned(),
        points: marked
            .iter()
            .filter(|point| of(&point.source))
            .map(|point| (at(point), point.fresh.unwrap_or(point.p90)))
            .collect(),
    };
    let dots: Vec<[f64; 2]> = all
        .iter()
        .map(|point| [at(point), point.p90.value_um])
        .collect();
    let front: Vec<[f64; 2]> = marked
        .iter()
        .filter(|point| point.on_front)
        .map(|point| [at(point), point.judged_um()])
        .collect();
    report::chart_front(
        against.label(),
        against.limit(problem),
        &dots,
        &front,
        &[
            series("front of the DoE", &|s| matches!(s, Source::Doe(_))),
            series("optima", &|s| matches!(s, Source::Optimum(_))),
            series("direct searches", &|s| matches!(s, Source::Refined)),
        ],
    )
}

#[cfg(test)]
mod tests {
    use campaign::Campaign;

    use super::*;

    fn point(source: Source, pressure: f64, p90_um: f64, fresh_um: Option<f64>) -> Point {
        let problem = Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap());
        let variables = crate::references::variables(gear::paper::printed::Place::Figure(9));
        let percentile = |value_um: f64| Percentile {
            value_um,
            low_um: value_um - 0.1,
            high_um: value_um + 0.1,
            samples: 30,
        };
        Point {
            source,
            variables,
            criteria: problem.criteria(&problem.pair(&variables).unwrap(), pressure),
            p90: percentile(p90_um),
            fresh: fresh_um.map(percentile),
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
        let front = front_of(&points, Against::Pressure, |point| point.p90.value_um);
        assert_eq!(front, [1, 3, 5]);
        // The root stress of all is the same: one is best.
        let front = front_of(&points, Against::RootStress, |point| point.p90.value_um);
        assert_eq!(front, [5]);
    }

    #[test]
    fn fresh_samples_decide_over_those_that_a_design_was_chosen_by() {
        let mut points = [
            point(Source::Doe(0), 1000.0, 2.0, Some(3.0)),
            point(Source::Doe(1), 1400.0, 1.5, Some(3.1)),
            point(Source::Optimum("kriging"), 1300.0, 2.0, Some(2.0)),
        ];
        mark(&mut points, Against::Pressure);
        let marks = points.clone().map(|point| (point.source, point.on_front));
        assert_eq!(
            marks,
            [
                (Source::Doe(0), true),
                (Source::Optimum("kriging"), true),
                (Source::Doe(1), false)
            ]
        );
        let problem = Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap());
        assert!(all_figures(&points).csv().is_ok(), "every row is complete");
        let svg = chart(&problem, Against::Pressure, &points, &points).unwrap();
        assert!(svg.contains("front of the DoE") && !svg.contains("direct searches"));
    }

    #[test]
    fn searches_under_a_limit_stay_below_it() {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.optimise.evaluations = 400;
        campaign.optimise.restart_at = 200;
        campaign.sampling.samples_per_design = 8;
        campaign.verify.samples = 50;
        let problem = Problem::new(campaign);
        let known = [
            point(Source::Doe(0), 1150.0, 4.0, None),
            point(Source::Doe(1), 1500.0, 3.0, None),
        ];
        let refine = || {
            let frozen = problem.printed_frozen();
            refine(&problem, &frozen, &known, Against::Pressure, 2).unwrap()
        };
        let found = refine();
        // By their text: what an interval is not known of is no number, and no number equals itself.
        assert_eq!(format!("{found:?}"), format!("{:?}", refine()));
        assert_eq!(found.len(), 2);
        // The campaign's own limit, then half of 15 % below the best known design's 1500 MPa.
        for (point, limit) in found.iter().zip([1550.0, 1387.5]) {
            assert!(point.criteria.hertz_pressure_mpa < limit);
            assert!(problem.is_feasible(&point.criteria));
            assert_eq!(point.fresh.unwrap().samples, 50);
        }
    }
}
