//! CMA-ES at the edge of what is feasible or can be evaluated; the static penalty.

use cmaes::{Bounds, Cause, Evaluation, RunOptions, Stop, minimise_run};
use problem::formulation::Problem;
use problem::optimise;
use problem::task::Run as CampaignRun;
use problem::{Approach, Campaign};
use rand::RngExt as _;
use results::report::Scale;

use super::search_scene::{FROM_BEST, Search, rng, run, sphere, stops, ten_candidates};
use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};
use crate::summary::median;

pub(super) const ENTRIES: [Entry; 5] = [
    Entry {
        id: "search-edge",
        title: "An optimum on a constraint",
        input: "The sphere around 0 in 6 and 11 variables, feasible only where x₁ ≥ 1, from 11 random starts",
        instead: "Feasible candidates rank before all others, so no penalty weight is needed.",
        check: edge,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-thin-feasible",
        title: "A thin feasible set",
        input: "The sphere around (0.7, …) in 4 variables, feasible only where |x₁ − x₂| is below 1e-2, 1e-4, 1e-6",
        instead: "The search minimises the violation first and then moves slowly along the band. The thinner the band, the \
                  further from the optimum it ends.",
        check: thin,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-nothing-feasible",
        title: "No feasible design",
        input: "A violation of at least 0.5 everywhere in 3 variables",
        instead: "The design of least violation is returned together with its violation, which marks it as infeasible.",
        check: nothing_feasible,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-penalty",
        title: "A penalty weight that is too small",
        input: "The paper’s campaign with a penalty weight of 1e-3, 400 evaluations of the approach with Archard’s \
                wear",
        instead: "When the penalised optimum breaks a constraint, the run continues with feasible designs ranked first, \
                  without a weight, until its best design is feasible.",
        check: penalty,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-failures",
        title: "Designs that cannot be evaluated",
        input: "NaN in every second stripe of the box; NaN or ∞ in the third of the box next to the optimum, everywhere, \
                and everywhere outside a small basin far from the start",
        instead: "A failed candidate ranks last. A search stops when all candidates of a window of generations failed, and \
                  the next one starts from a random point. If every evaluation of the budget fails, the run ends with an \
                  error.",
        check: failures,
        ..Entry::blank(Method::Search)
    },
];

fn edge(outcome: &mut Outcome) -> Result<(), EntryError> {
    for (name, d, budget) in [("6 variables", 6, 4000), ("11 variables", 11, 9000)] {
        let bounds = Bounds::new(vec![(-5.0, 5.0); d])?;
        let mut needed = Vec::new();
        for seed in 0..11 {
            let mut random = rng(100 + seed);
            let start: Vec<f64> = (0..d).map(|_| random.random_range(-5.0..5.0)).collect();
            let half_space = |x: &[f64]| Evaluation {
                value: sphere(x, 0.0),
                violation: (1.0 - x[0]).max(0.0),
            };
            let options = ten_candidates(bounds.clone());
            let search = Search::run(&start, options, budget, seed, half_space)?;
            needed.push(search.evaluations_to(1.0 + 1e-9));
            outcome.holds("every search ends feasible", search.best().is_feasible());
            if seed == 0 && d == 6 {
                let feasible = search.history.iter().filter(|(_, best)| best.is_feasible());
                let curve = feasible.map(|(at, best)| [*at as f64, best.value - 1.0]);
                outcome.chart(
                    "Best feasible value at the edge",
                    ("evaluations", Scale::Linear),
                    ("distance to the minimum", Scale::Log),
                    vec![("one seed", curve.collect())],
                );
            }
        }
        let most = needed.iter().copied().fold(0.0, f64::max);
        outcome.at_most(
            &format!("evaluations to 1e-9 from the minimum, {name}, worst seed"),
            most,
            "",
            budget as f64,
        );
        outcome.figure(&format!("median of these, {name}"), median(&needed), "");
    }
    Ok(())
}

fn thin(outcome: &mut Outcome) -> Result<(), EntryError> {
    // On the band x₁ = x₂ = t the least of 2 (t − 0.55)² + …; far from the start.
    for (width, limit) in [(1e-2, 1e-3), (1e-4, 0.1), (1e-6, 0.2)] {
        let mut values = Vec::new();
        let mut feasible = 0;
        for seed in 0..11 {
            let run = run(4, 8000, FROM_BEST, seed, |x| {
                let apart = (x[0] - x[1]).abs();
                Evaluation {
                    value: sphere(x, 0.3),
                    violation: (apart - width).max(0.0),
                }
            })?;
            feasible += u32::from(run.violation <= 0.0);
            values.push(run.value);
        }
        outcome.at_least(
            &format!("seeds that end feasible, band of {width:e}"),
            f64::from(feasible),
            "of 11",
            11.0,
        );
        outcome.at_most(
            &format!("median distance to the minimum, band of {width:e}"),
            median(&values),
            "",
            limit,
        );
    }
    Ok(())
}

fn nothing_feasible(outcome: &mut Outcome) -> Result<(), EntryError> {
    let run = run(3, 1500, FROM_BEST, 0, |x| Evaluation {
        value: -x[0],
        violation: 0.5 + sphere(x, 0.4),
    })?;
    stops(outcome, &run, &["ValueTolerance"]);
    outcome.at_most(
        "violation above the least one",
        run.violation - 0.5,
        "",
        1e-9,
    );
    outcome.holds(
        "the design is returned with its violation",
        run.violation > 0.0,
    );
    Ok(())
}

fn penalty(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER)?;
    campaign.optimise.evaluations = 400;
    campaign.optimise.restart_at = Some(200);
    let gears = campaign
        .gears_mut()
        .ok_or("the paper’s campaign has gears")?;
    gears.penalty.weight = 1e-3;
    let problem = Problem::new(campaign);
    let run = CampaignRun {
        approach: Approach::Baseline,
        start: 0,
        base: problem.base().clone(),
        models: Vec::new(),
        from: None,
    };
    let result = optimise::run(&problem, &run)?;
    let printed = result.printed.ok_or("the penalised part found nothing")?;
    outcome.holds(
        "the penalised winner breaks a constraint",
        !printed.feasible,
    );
    for constraint in problem.constraints(&printed.criteria) {
        if !constraint.holds() {
            outcome.detected(constraint.name.to_string(), &constraint);
        }
    }
    outcome.figure("criterion of the penalised winner", printed.criterion, "µm");
    outcome.at_least("continuations", f64::from(result.continuations), "", 1.0);
    let best = result.best.ok_or("the run found no feasible design")?;
    outcome.at_most(
        "violation of the final design",
        problem.violation(&best.criteria),
        "",
        0.0,
    );
    outcome.figure("criterion of the final design", best.criterion, "µm");
    outcome.figure(
        "evaluations, continuations included",
        result.evaluations as f64,
        "",
    );
    Ok(())
}

fn failures(outcome: &mut Outcome) -> Result<(), EntryError> {
    let striped = run(3, 3000, FROM_BEST, 0, |x| {
        if (10.0 * x[0]) as u32 % 2 == 1 {
            f64::NAN
        } else {
            sphere(x, 0.25)
        }
    })?;
    outcome.at_most("value reached among the stripes", striped.value, "", 1e-9);
    for failure in [f64::NAN, f64::INFINITY] {
        let beside = |x: &[f64]| {
            if x[0] < 1.0 / 3.0 {
                failure
            } else {
                sphere(x, 0.0)
            }
        };
        let options = ten_candidates(Bounds::unit(6)?);
        let search = Search::run(&[0.9; 6], options.clone(), 6000, 1, beside)?;
        outcome.at_most(
            &format!("distance to the best value beside {failure}"),
            (search.best().value - 1.0 / 9.0).abs(),
            "",
            1e-6,
        );
        let search = Search::run(&[0.3; 6], options, 10_000, 1, |_| failure)?.cma_es;
        outcome.warned(&search.stop(), &["AllFailed"]);
        // 10 + 30 d/λ generations.
        let is_in_time = search.stop() == Some(Stop::AllFailed { generations: 28 });
        outcome.holds(
            "a search of 10 candidates stops after 28 generations",
            is_in_time,
        );
        let is_unchanged = search.mean() == [0.3; 6] && search.step() == 0.3;
        outcome.holds("its mean and step are unchanged", is_unchanged);
        outcome.holds("it returns no design", search.best().is_none());
    }
    let nowhere = run(3, 3000, FROM_BEST, 0, |_| f64::NAN);
    outcome.refused_with(nowhere, "NothingUsable", "all 3000 designs");
    let options = RunOptions {
        search: ten_candidates(Bounds::unit(2)?),
        evaluations: 12_000,
        tolerance: 0.0,
        restarts: FROM_BEST,
        restart_at: Some(6000),
    };
    let mut island = |x: &[f64]| {
        let distance = sphere(x, 0.95).sqrt();
        if distance < 0.04 { distance } else { f64::NAN }
    };
    let reached = minimise_run(&[0.0; 2], options, &mut rng(1), &mut island)?;
    outcome.at_most("value reached in the small basin", reached.value, "", 1e-6);
    let first = reached.restarts[0];
    outcome.holds(
        "the search from the start finds nothing",
        matches!(first.cause, Cause::Stopped(Stop::AllFailed { .. })) && first.best.is_none(),
    );
    Ok(())
}
