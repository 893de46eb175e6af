//! Runs under the worst conditions of the gear model: hardly any feasible designs, plateaus of
//! designs that are not simulable, NaN, optima in corners and on constraints. Each case has a
//! defined and reported result.
//!
//! The simulator consists of formulas in the six robust variables, scaled to [0, 1].

use problem::formulation::{Design, GearCriteria, Problem};
use problem::optimise::{self, RunResult};
use problem::simulator::{Analysis, NoAnswer, PreparedDesign, Simulator, State};
use problem::{Approach, Campaign};
use stats::streams::StreamRng;

/// The values of a formula at a point of the unit cube.
#[derive(Debug, Clone, Copy)]
struct Answer {
    /// ΔSTE, µm.
    delta_ste_um: f64,
    /// g_s, which must be below 2.
    sliding: f64,
}

/// A formula; `None` if the design is not simulable.
type Formula = fn(&[f64; 6]) -> Option<Answer>;

struct MadeUpSimulator {
    problem: Problem,
    formula: Formula,
}

struct MadeUpDesign(Answer);

impl PreparedDesign for MadeUpDesign {
    fn analyse(&mut self, _: State) -> Result<Analysis, NoAnswer> {
        let criteria = GearCriteria {
            contact_ratio: 1.5,
            specific_sliding: self.0.sliding,
            hertz_pressure_mpa: 1000.0,
            root_stress_mpa: 500.0,
            clearance_mm: [0.5; 2],
            flank_margin_mm: [0.1; 2],
            normal_module_mm: 4.0,
            details: None,
        };
        Ok(Analysis {
            value: self.0.delta_ste_um,
            criteria: criteria.into(),
        })
    }

    fn sample(&mut self, _rng: &mut StreamRng) -> Result<Vec<f64>, NoAnswer> {
        Ok(vec![self.0.delta_ste_um])
    }
}

impl Simulator for MadeUpSimulator {
    fn problem(&self) -> &Problem {
        &self.problem
    }

    fn prepare<'a>(&'a self, design: &Design) -> Result<Box<dyn PreparedDesign + 'a>, NoAnswer> {
        let unit = six(&self.problem, design);
        match (self.formula)(&unit) {
            Some(answer) => Ok(Box::new(MadeUpDesign(answer))),
            None => Err(NoAnswer::Refused(
                "made: there is no such design".to_owned(),
            )),
        }
    }
}

fn run(formula: Formula, evaluations: u32, start: u32) -> RunResult {
    let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
    campaign.optimise.evaluations = evaluations;
    campaign.optimise.restart_at = Some(evaluations / 2);
    let made = MadeUpSimulator {
        problem: Problem::new(campaign),
        formula,
    };
    let run = problem::task::Run {
        approach: Approach::Baseline,
        start,
        base: made.problem.base().clone(),
        models: Vec::new(),
        from: None,
    };
    optimise::run(&made, &run).unwrap()
}

fn unit(result: &RunResult) -> [f64; 6] {
    let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
    let best = result.best.as_ref().expect("a feasible design");
    six(&Problem::new(campaign), &best.design)
}

/// The coordinates of a design in the unit cube.
fn six(problem: &Problem, design: &Design) -> [f64; 6] {
    let unit = problem.unit_point(&problem.free_values(design));
    unit.try_into().expect("six variables are free")
}

fn squares(u: &[f64; 6], at: f64) -> f64 {
    u.iter().map(|u| (u - at).powi(2)).sum()
}

/// A ball of 0.1 % of the box: its volume π³/6 r⁶ is 0.001 at r = 0.240.
#[test]
fn a_feasible_region_of_a_thousandth_of_the_box_is_found() {
    const RADIUS: f64 = 0.240;
    let volume = std::f64::consts::PI.powi(3) / 6.0 * RADIUS.powi(6);
    assert!((volume / 1e-3 - 1.0).abs() < 0.02, "{volume}");
    let formula: Formula = |u| {
        Some(Answer {
            // The criterion decreases away from the ball.
            delta_ste_um: 1.0 + u.iter().sum::<f64>(),
            sliding: 1.999 + squares(u, 0.7).sqrt() - RADIUS,
        })
    };
    for start in 0..3 {
        let result = run(formula, 6000, start);
        let best = result.best.expect("the ball is found");
        assert!(best.feasible && best.criteria.gears().specific_sliding < 2.0);
        // The lowest point of the ball lies on its surface, where all coordinates are equal.
        let lowest = 1.0 + 6.0 * (0.7 - (RADIUS + 0.001) / 6f64.sqrt());
        // A tenth of a per cent: the error due to strict inequality and 6000 designs.
        assert!(
            (best.criterion / lowest - 1.0).abs() < 1e-3,
            "start {start}: {} against {lowest}",
            best.criterion
        );
    }
}

/// Most of the box is not simulable and has the constant value 100.
#[test]
fn a_run_gets_off_a_plateau_of_100s() {
    let formula: Formula = |u| {
        (u[0] < 0.5 && u[1] < 0.5).then(|| Answer {
            delta_ste_um: 1.0 + squares(u, 0.25),
            sliding: 1.0,
        })
    };
    for start in 0..3 {
        let result = run(formula, 4000, start);
        let best = result.best.expect("a quarter of the box can be simulated");
        assert!(
            best.criterion < 1.0 + 1e-6,
            "start {start}: {}",
            best.criterion
        );
        assert!(
            result.simulator_calls < 2 * result.evaluations,
            "refusals cost one call"
        );
    }
}

#[test]
fn plateaus_of_100s_everywhere_end_without_a_design_and_say_why_they_restarted() {
    let result = run(|_| None, 600, 0);
    assert_eq!((result.printed, result.best), (None, None));
    assert_eq!((result.evaluations, result.continuations), (600, 0));
    assert_eq!(result.history.first().map(|(_, value)| *value), Some(100.0));
    assert!(!result.restarts.is_empty(), "a plateau stops a search");
    for (_, reason) in &result.restarts {
        assert!(!reason.is_empty());
    }
}

/// A NaN criterion is a failure, never an optimum.
#[test]
fn a_criterion_that_is_no_number_is_a_failure() {
    let formula: Formula = |u| {
        Some(Answer {
            delta_ste_um: if u[2] > 0.3 {
                f64::NAN
            } else {
                1.0 + squares(u, 0.6)
            },
            sliding: 1.0,
        })
    };
    let result = run(formula, 4000, 0);
    let found = unit(&result);
    assert!(result.best.unwrap().criterion.is_finite());
    // The best of the other points lies at the edge of the region with NaN.
    assert!((found[2] - 0.3).abs() < 1e-3, "{found:?}");
    let nothing = run(
        |_| {
            Some(Answer {
                delta_ste_um: f64::NAN,
                sliding: 1.0,
            })
        },
        600,
        0,
    );
    assert_eq!((nothing.printed, nothing.best), (None, None));
}

/// A NaN constraint is not satisfied.
#[test]
fn a_constraint_that_is_no_number_makes_no_optimum() {
    let result = run(
        |u| {
            Some(Answer {
                delta_ste_um: 1.0 + squares(u, 0.5),
                sliding: if u[0] < 0.5 { f64::NAN } else { 1.0 },
            })
        },
        2000,
        0,
    );
    let found = unit(&result);
    assert!(found[0] >= 0.5, "{found:?}");
    assert!(
        result
            .best
            .unwrap()
            .criteria
            .gears()
            .specific_sliding
            .is_finite()
    );
}

#[test]
fn an_optimum_in_a_corner_is_reached() {
    let formula: Formula = |u| {
        Some(Answer {
            delta_ste_um: 1.0 + u.iter().sum::<f64>(),
            sliding: 1.0,
        })
    };
    for start in 0..3 {
        let result = run(formula, 4000, start);
        // The corner is reached within 1e-6 of each variable's range.
        let found = unit(&result);
        assert!(
            found.iter().all(|u| (0.0..1e-6).contains(u)),
            "start {start}: {found:?}"
        );
        assert_eq!(result.continuations, 0, "nothing was infeasible");
    }
}

/// The optimum lies on a constraint, and the printed weight is too small to keep the search there.
#[test]
fn an_optimum_on_a_constraint_is_approached_from_the_feasible_side() {
    let formula: Formula = |u| {
        Some(Answer {
            // One unit of the first variable gains more than the penalty with its weight of 10 · ½
            // costs.
            delta_ste_um: 20.0 - 10.0 * u[0] + squares(u, 0.5),
            sliding: 1.5 + u[0],
        })
    };
    for start in 0..3 {
        let result = run(formula, 3000, start);
        let printed = result
            .printed
            .as_ref()
            .expect("every design can be simulated");
        assert!(!printed.feasible, "the weight was meant to be too small");
        assert!(result.continuations > 0);
        let found = unit(&result);
        let best = result
            .best
            .as_ref()
            .expect("the run goes on until it is feasible");
        assert!(best.criteria.gears().specific_sliding < 2.0);
        // The error after one continuation of 1500 designs.
        assert!((0.5 - found[0]).abs() < 1e-3, "start {start}: {found:?}");
    }
}
