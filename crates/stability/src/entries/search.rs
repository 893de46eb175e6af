//! CMA-ES on plateaus, in corners, at the edge of what is feasible; the static penalty.

use campaign::formulation::Problem;
use campaign::optimise;
use campaign::task::Run as CampaignRun;
use campaign::{Approach, Campaign};
use cmaes::{
    Bounds, Cause, CmaEs, Error, Evaluation, Options, Outcome as Found, Restarts, RunOptions, Stop,
    minimise_run,
};
use rand_distr::{Distribution as _, StandardNormal};
use report::Scale;
use stats::streams::{Purpose, StreamRng, stream};

use crate::outcome::{Failed, Outcome};
use crate::{Entry, Method};

pub(super) const ENTRIES: [Entry; 13] = [
    Entry {
        id: "search-plateau",
        title: "A plateau everywhere",
        input: "An objective of 1 everywhere in 6 variables, 3000 evaluations",
        instead: "Each search ends when a whole window of generations is equal, and a new one starts from the \
                  first design. The budget is spent and a design returned.",
        check: plateau,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-needle",
        title: "A plateau with a small basin",
        input: "A sphere within 0.15 of a point in 4 variables and 1 everywhere else, 4000 evaluations with each \
                kind of restart, 20 seeds",
        instead: "No ranks lead there: the basin is a 400th of the box, and a search finds it by chance. IPOP and BIPOP \
                  find it less often than restarts from the best design, as they spend the budget on larger \
                  populations.",
        check: needle,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-corner",
        title: "An optimum in a corner",
        input: "Σ xᵢ in the unit box of 2, 6 and 11 variables: the minimum is at all lower bounds",
        instead: "Candidates out of the box are drawn again up to 100 times, then set onto the bound, so that the \
                  corner is approached without stalling. Nothing is to be detected.",
        check: corner,
        ..Entry::blank(Method::Search)
    },
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
    Entry {
        id: "search-ill-conditioned",
        title: "A valley far longer than wide",
        input: "Σ 10^(p i/5) xᵢ² in 6 variables around an inner point, p from 0 to 18: condition numbers up to 10¹⁸; \
                30 000 evaluations, 5 seeds",
        instead: "The search stops where its covariance matrix has a condition number above 10¹⁴ and starts again \
                  from the best design. Up to 10¹⁴ the minimum is found; beyond it the run ends in the valley, short of \
                  the minimum.",
        check: ill_conditioned,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-noise",
        title: "A noisy objective",
        input: "A sphere plus normal noise of 0.1 in 4 variables, 6000 evaluations",
        instead: "Nothing is detected: the best value seen is a lucky one. Where noise matters, the campaigns use the \
                  same random numbers at every design, which makes the objective a function again.",
        check: noise,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-many-minima",
        title: "Many local minima",
        input: "Rastrigin’s function in 5 variables, 20 000 evaluations, 11 seeds",
        instead: "Restarts from the best design stay in its basin. IPOP and BIPOP start anew with other populations; \
                  `optimise.restarts` chooses them.",
        check: many_minima,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-minus-infinity",
        title: "An objective of −∞",
        input: "−∞ below x₁ = 0.2",
        instead: "It ranks as the best value there is, and the run ends on it; differences of infinities do not turn \
                  into NaN.",
        check: minus_infinity,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-unusable",
        title: "Inputs that make no search",
        input: "Bounds of equal ends, a start outside, a population of 1, no evaluations, fewer evaluations than a \
                generation has",
        instead: "Each is refused with its value, but for the last: the first candidates of the generation are \
                  evaluated, and the best of them returned.",
        check: unusable,
        ..Entry::blank(Method::Search)
    },
];

fn rng(number: u64) -> StreamRng {
    stream(23, Purpose::Test, number, 0)
}

/// A run in the unit box of `d` variables from its point (0.8, …).
fn run<E: Into<Evaluation>>(
    d: usize,
    evaluations: usize,
    restarts: Restarts,
    seed: u64,
    mut objective: impl FnMut(&[f64]) -> E,
) -> Result<Found, Error> {
    let options = RunOptions {
        search: Options::new(Bounds::unit(d)?),
        evaluations,
        restarts,
    };
    minimise_run(&vec![0.8; d], options, &mut rng(seed), &mut objective)
}

const FROM_BEST: Restarts = Restarts::FromBest { planned: 0 };

/// Records why searches of a run stopped.
fn stops(found: &mut Outcome, run: &Found, expected: &[&str]) {
    let stops: Vec<Stop> = run
        .restarts
        .iter()
        .filter_map(|restart| match restart.cause {
            Cause::Stopped(stop) => Some(stop),
            _ => None,
        })
        .take(1)
        .collect();
    found.warned(&stops, expected);
}

fn sphere(x: &[f64], centre: f64) -> f64 {
    x.iter().map(|x| (x - centre).powi(2)).sum()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn plateau(found: &mut Outcome) -> Result<(), Failed> {
    let run = run(6, 3000, FROM_BEST, 0, |_| 1.0)?;
    stops(found, &run, &["Plateau"]);
    found.at_most("evaluations until the first restart", run.restarts[0].evaluations as f64, "", 400.0);
    found.figure("restarts", run.restarts.len() as f64, "");
    found.holds("a design is returned with its value 1", run.value == 1.0);
    found.holds("the whole budget is used", run.evaluations == 3000);
    Ok(())
}

fn needle(found: &mut Outcome) -> Result<(), Failed> {
    let objective = |x: &[f64]| {
        let distance = sphere(x, 0.25).sqrt();
        if distance < 0.15 { distance } else { 1.0 }
    };
    let mut shares = Vec::new();
    for (name, restarts) in [
        ("from the best design", FROM_BEST),
        ("IPOP", Restarts::Ipop),
        ("BIPOP", Restarts::Bipop),
    ] {
        let mut hits = 0;
        for seed in 0..20 {
            let run = run(4, 4000, restarts, seed, objective)?;
            hits += u32::from(run.value < 1e-6);
            if seed == 0 && restarts == FROM_BEST {
                stops(found, &run, &["Plateau"]);
            }
        }
        let share = 100.0 * f64::from(hits) / 20.0;
        found.figure(&format!("seeds that find it, restarts {name}"), share, "%");
        shares.push(share);
    }
    let least = shares.iter().copied().fold(100.0, f64::min);
    found.at_least("seeds that find it, the worst kind", least, "%", 30.0);
    Ok(())
}

fn corner(found: &mut Outcome) -> Result<(), Failed> {
    let mut curves = Vec::new();
    for (name, d) in [("2 variables", 2), ("6 variables", 6), ("11 variables", 11)] {
        let run = run(d, 1000 * d, FROM_BEST, d as u64, |x| x.iter().sum::<f64>())?;
        found.at_most(&format!("value reached in {name}"), run.value, "", 1e-9);
        let needed = run.history.iter().find(|(_, e)| e.value <= 1e-9);
        let needed = needed.map_or(f64::NAN, |(at, _)| *at as f64);
        found.figure(&format!("evaluations to 1e-9 in {name}"), needed, "");
        // Zero has no place on a logarithmic axis.
        let points = run.history.iter().map(|(at, e)| [*at as f64, e.value.max(1e-16)]);
        curves.push((name, points.collect()));
    }
    found.chart(
        "Best value in a corner",
        ("evaluations", Scale::Linear),
        ("distance to the minimum", Scale::Log),
        curves,
    );
    Ok(())
}

fn edge(found: &mut Outcome) -> Result<(), Failed> {
    let bounds = Bounds::new(vec![(-5.0, 5.0); 6])?;
    let (mut errors, mut curve) = (Vec::new(), Vec::new());
    for seed in 0..11 {
        let options = RunOptions {
            search: Options::new(bounds.clone()),
            evaluations: 4000,
            restarts: FROM_BEST,
        };
        let run = minimise_run(&[4.0; 6], options, &mut rng(seed), &mut |x: &[f64]| Evaluation {
            value: sphere(x, 0.0),
            violation: (1.0 - x[0]).max(0.0),
        })?;
        found.holds(&format!("seed {seed} ends feasible"), run.violation <= 0.0);
        if seed == 0 {
            let feasible = run.history.iter().filter(|(_, e)| e.is_feasible());
            curve = feasible.map(|(at, e)| [*at as f64, e.value - 1.0]).collect();
        }
        errors.push(run.value - 1.0);
    }
    let worst = errors.iter().copied().fold(0.0, f64::max);
    found.at_most("largest distance to the minimum of 11 seeds", worst, "", 1e-9);
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
        found.at_least(&format!("seeds that end feasible, band of {width:e}"), f64::from(feasible), "of 11", 11.0);
        found.at_most(&format!("median distance to the minimum, band of {width:e}"), median(values), "", limit);
    }
    Ok(())
}

fn nothing_feasible(found: &mut Outcome) -> Result<(), Failed> {
    let run = run(3, 1500, FROM_BEST, 0, |x| Evaluation {
        value: -x[0],
        violation: 0.5 + sphere(x, 0.4),
    })?;
    stops(found, &run, &["ValueTolerance"]);
    found.at_most("violation above the least one", run.violation - 0.5, "", 1e-9);
    found.holds("the outcome carries a violation above 0", run.violation > 0.0);
    Ok(())
}

fn penalty(found: &mut Outcome) -> Result<(), Failed> {
    let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER)?;
    campaign.optimise.evaluations = 400;
    campaign.optimise.restart_at = Some(200);
    let gears = campaign.gears_mut().ok_or("the paper’s campaign has gears")?;
    gears.penalty.weight = 1e-3;
    let problem = Problem::new(campaign);
    let run = CampaignRun {
        approach: Approach::Baseline,
        start: 0,
        base: problem.base().clone(),
        model: None,
    };
    let result = optimise::run(&problem, &run)?;
    let printed = result.printed.ok_or("the penalised part found nothing")?;
    found.holds("the penalised winner breaks a constraint", !printed.feasible);
    for constraint in problem.constraints(&printed.criteria) {
        if !constraint.holds() {
            found.detected(constraint.name.to_string(), &constraint);
        }
    }
    found.figure("criterion of the penalised winner", printed.criterion_um, "µm");
    found.at_least("continuations", f64::from(result.continuations), "", 1.0);
    let best = result.best.ok_or("the run found no feasible design")?;
    found.at_most("violation of the final design", problem.violation(&best.criteria), "", 0.0);
    found.figure("criterion of the final design", best.criterion_um, "µm");
    found.figure("evaluations, continuations included", result.evaluations as f64, "");
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

fn ill_conditioned(found: &mut Outcome) -> Result<(), Failed> {
    let mut curve = Vec::new();
    for power in (0..=18).step_by(2) {
        let mut values = Vec::new();
        for seed in 0..5 {
            let run = run(6, 30_000, FROM_BEST, seed, |x| {
                let terms = (0..).zip(x);
                let weight = |i: i32| 10_f64.powf(f64::from(power * i) / 5.0);
                terms.map(|(i, x)| weight(i) * (x - 0.4).powi(2)).sum::<f64>()
            })?;
            if power == 18 && seed == 0 {
                let is_ill = |cause: &Cause| matches!(cause, Cause::Stopped(Stop::IllConditioned { .. }));
                let ill = run.restarts.iter().map(|restart| restart.cause).find(is_ill);
                found.holds("a search stops for its condition number", ill.is_some());
                if let Some(Cause::Stopped(stop)) = ill {
                    found.warned(&[stop], &["IllConditioned"]);
                }
            }
            values.push(run.value);
        }
        // Zero has no place on a logarithmic axis.
        curve.push([10_f64.powi(power), median(values).max(1e-30)]);
    }
    let upto = |limit: f64| {
        let some = curve.iter().filter(|p| p[0] <= limit);
        some.map(|p| p[1]).fold(0.0, f64::max)
    };
    found.at_most("largest median value up to a condition of 10¹²", upto(1.1e12), "", 1e-9);
    found.at_most("median value at a condition of 10¹⁸", curve[9][1], "", 2.0);
    found.chart(
        "Value reached in a long valley",
        ("condition number", Scale::Log),
        ("median value reached", Scale::Log),
        vec![("30 000 evaluations", curve)],
    );
    Ok(())
}

fn noise(found: &mut Outcome) -> Result<(), Failed> {
    let mut random = rng(77);
    let run = run(4, 6000, FROM_BEST, 0, |x| {
        let z: f64 = StandardNormal.sample(&mut random);
        sphere(x, 0.3) + 0.1 * z
    })?;
    let truth = sphere(&run.x, 0.3);
    found.at_most("value without noise of the design returned", truth, "", 0.3);
    found.figure("value that the run reports", run.value, "");
    found.at_least("optimism: true value less reported one", truth - run.value, "", 0.1);
    Ok(())
}

fn many_minima(found: &mut Outcome) -> Result<(), Failed> {
    let rastrigin = |x: &[f64]| -> f64 {
        x.iter()
            .map(|x| 10.24 * (x - 0.45))
            .map(|v| v * v + 10.0 * (1.0 - (std::f64::consts::TAU * v).cos()))
            .sum()
    };
    let mut medians = Vec::new();
    for (name, restarts) in [
        ("from the best design", FROM_BEST),
        ("IPOP", Restarts::Ipop),
        ("BIPOP", Restarts::Bipop),
    ] {
        let values: Result<Vec<f64>, Error> = (0..11)
            .map(|seed| Ok(run(5, 20_000, restarts, seed, rastrigin)?.value))
            .collect();
        let value = median(values?);
        found.figure(&format!("median value reached, restarts {name}"), value, "");
        medians.push(value);
    }
    found.holds("IPOP finds the minimum", medians[1] < 1e-8);
    found.holds("restarts from the best design do not", medians[0] > 0.5);
    Ok(())
}

fn minus_infinity(found: &mut Outcome) -> Result<(), Failed> {
    let run = run(2, 1000, FROM_BEST, 0, |x| {
        if x[0] < 0.2 { f64::NEG_INFINITY } else { x[0] }
    })?;
    stops(found, &run, &["Plateau"]);
    found.holds("the run ends on −∞", run.value == f64::NEG_INFINITY && run.x[0] < 0.2);
    found.at_least("restarts", run.restarts.len() as f64, "", 1.0);
    Ok(())
}

fn unusable(found: &mut Outcome) -> Result<(), Failed> {
    found.refused(Bounds::new([(0.0, 1.0), (2.0, 2.0)]), "Bounds");
    let options = || Ok::<_, Error>(Options::new(Bounds::unit(2)?));
    found.refused(CmaEs::new(&[0.5, 1.5], options()?), "StartOutside");
    let population = 1;
    found.refused(CmaEs::new(&[0.5; 2], Options { population, ..options()? }), "Population");
    found.refused(run(2, 0, FROM_BEST, 0, |_| 1.0), "NoBudget");
    let three = run(2, 3, FROM_BEST, 0, |x| x[0])?;
    found.holds("of three evaluations the best is returned", three.evaluations == 3);
    Ok(())
}
