//! CMA-ES at the edge of what is feasible or can be evaluated; the static penalty.

use campaign::formulation::Problem;
use campaign::optimise;
use campaign::task::Run as CampaignRun;
use campaign::{Approach, Campaign};
use cmaes::{Bounds, CmaEs, Evaluation, Options, RunOptions, minimise_run};
use results::report::Scale;

use super::search_scene::{FROM_BEST, median, rng, run, sphere, stops};
use crate::stability::outcome::{Failed, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 5] = [
    Entry {
        id: "search-edge",
        title: "An optimum on the edge of what is feasible",
        input: "The sphere around 0 of which only x₁ ≥ 1 is feasible, 6 variables, 11 seeds",
        instead: "Feasible candidates rank first, so no penalty weight is needed; the best feasible one is kept.",
        check: edge,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-thin-feasible",
        title: "A feasible set that is thin",
        input: "The sphere around (0.7, …) in 4 variables, feasible only where |x₁ − x₂| is below 1e-2, 1e-4, 1e-6",
        instead: "The search first minimises the violation and then creeps along the band; the thinner the band, the \
                  further it ends from the optimum.",
        check: thin,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-nothing-feasible",
        title: "Nothing is feasible",
        input: "A violation of at least 0.5 everywhere in 3 variables",
        instead: "The design of the least violation is returned with that violation, so that it cannot pass for \
                  feasible.",
        check: nothing_feasible,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-penalty",
        title: "A static penalty that ends infeasible",
        input: "The paper’s campaign with a penalty weight of 1e-3, 400 evaluations of the approach with Archard’s \
                wear",
        instead: "A run whose penalised winner breaks a constraint goes on with feasibility-first ranking, without a \
                  weight, until it ends on a design that breaks none.",
        check: penalty,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-failures",
        title: "Designs that cannot be evaluated",
        input: "NaN in every second stripe of the box, and NaN everywhere",
        instead: "A failed candidate ranks last. Where all fail, the run ends with an error after its budget.",
        check: failures,
        ..Entry::blank(Method::Search)
    },
];

fn edge(found: &mut Outcome) -> Result<(), Failed> {
    let bounds = Bounds::new(vec![(-5.0, 5.0); 6])?;
    let (mut errors, mut curve) = (Vec::new(), Vec::new());
    for seed in 0..11 {
        let options = RunOptions {
            search: Options::new(bounds.clone()),
            evaluations: 4000,
            restarts: FROM_BEST,
            restart_at: None,
        };
        let run = minimise_run(&[4.0; 6], options, &mut rng(seed), &mut |x: &[f64]| {
            Evaluation {
                value: sphere(x, 0.0),
                violation: (1.0 - x[0]).max(0.0),
            }
        })?;
        found.holds("every seed ends feasible", run.violation <= 0.0);
        if seed == 0 {
            let feasible = run.history.iter().filter(|(_, e)| e.is_feasible());
            curve = feasible
                .map(|(at, e)| [*at as f64, e.value - 1.0])
                .collect();
        }
        errors.push(run.value - 1.0);
    }
    let worst = errors.iter().copied().fold(0.0, f64::max);
    found.at_most(
        "largest distance to the minimum of 11 seeds",
        worst,
        "",
        1e-9,
    );
    found.figure("median distance to the minimum", median(errors), "");
    found.chart(
        "Best feasible value at the edge",
        ("evaluations", Scale::Linear),
        ("distance to the minimum", Scale::Log),
        vec![("one seed", curve)],
    );
    Ok(())
}

fn thin(found: &mut Outcome) -> Result<(), Failed> {
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
        found.at_least(
            &format!("seeds that end feasible, band of {width:e}"),
            f64::from(feasible),
            "of 11",
            11.0,
        );
        found.at_most(
            &format!("median distance to the minimum, band of {width:e}"),
            median(values),
            "",
            limit,
        );
    }
    Ok(())
}

fn nothing_feasible(found: &mut Outcome) -> Result<(), Failed> {
    let run = run(3, 1500, FROM_BEST, 0, |x| Evaluation {
        value: -x[0],
        violation: 0.5 + sphere(x, 0.4),
    })?;
    stops(found, &run, &["ValueTolerance"]);
    found.at_most(
        "violation above the least one",
        run.violation - 0.5,
        "",
        1e-9,
    );
    found.holds(
        "the outcome carries a violation above 0",
        run.violation > 0.0,
    );
    Ok(())
}

fn penalty(found: &mut Outcome) -> Result<(), Failed> {
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
        model: None,
        from: None,
    };
    let result = optimise::run(&problem, &run)?;
    let printed = result.printed.ok_or("the penalised part found nothing")?;
    found.holds(
        "the penalised winner breaks a constraint",
        !printed.feasible,
    );
    for constraint in problem.constraints(&printed.criteria) {
        if !constraint.holds() {
            found.detected(constraint.name.to_string(), &constraint);
        }
    }
    found.figure("criterion of the penalised winner", printed.criterion, "µm");
    found.at_least("continuations", f64::from(result.continuations), "", 1.0);
    let best = result.best.ok_or("the run found no feasible design")?;
    found.at_most(
        "violation of the final design",
        problem.violation(&best.criteria),
        "",
        0.0,
    );
    found.figure("criterion of the final design", best.criterion, "µm");
    found.figure(
        "evaluations, continuations included",
        result.evaluations as f64,
        "",
    );
    Ok(())
}

fn failures(found: &mut Outcome) -> Result<(), Failed> {
    let striped = run(3, 3000, FROM_BEST, 0, |x| {
        if (10.0 * x[0]) as u32 % 2 == 1 {
            f64::NAN
        } else {
            sphere(x, 0.25)
        }
    })?;
    found.at_most("value reached among the stripes", striped.value, "", 1e-9);
    let all = run(3, 3000, FROM_BEST, 0, |_| f64::NAN);
    found.refused(all, "NothingUsable");
    let mut search = CmaEs::new(&[0.5; 3], Options::new(Bounds::unit(3)?))?;
    let mut random = rng(1);
    while search.stop().is_none() && search.generation() < 1000 {
        let count = search.ask(&mut random).len();
        search.tell(&vec![f64::NAN; count])?;
    }
    found.warned(&search.stop(), &["AllFailed"]);
    Ok(())
}
