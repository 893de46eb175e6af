//! CMA-ES on plateaus, in corners, in valleys, under noise.

use cmaes::{Bounds, Cause, CmaEs, Error, Evaluation, Options, Restarts, Stop};
use rand_distr::{Distribution as _, StandardNormal};
use results::report::Scale;

use super::search_scene::{FROM_BEST, Search, rng, run, sphere, stops, ten_candidates};
use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};
use crate::summary::median;

pub(super) const ENTRIES: [Entry; 8] = [
    Entry {
        id: "search-plateau",
        title: "A plateau everywhere",
        input: "An objective of 1 everywhere in 6 variables, 3000 evaluations; a constraint violation of 1 everywhere",
        instead: "Each search stops when all values of a window of generations are equal, and a new search starts from the \
                  first design. The whole budget is used and a design returned.",
        check: plateau,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-needle",
        title: "A plateau with a small basin",
        input: "A sphere within 0.15 of a point in 4 variables and 1 everywhere else, 4000 evaluations with each \
                kind of restart, 20 seeds",
        instead: "Ranks do not lead to the basin, which is a 400th of the box: a search finds it by chance. IPOP and BIPOP \
                  find it less often than restarts from the best design, because larger populations use up the budget.",
        check: needle,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-corner",
        title: "An optimum in a corner or on a face",
        input: "Σ (xᵢ + 1) in boxes of 1, 2, 6 and 11 unequal ranges, with the minimum at all lower bounds, 11 seeds; 11 \
                variables of which one has its optimum at a bound, 5 seeds",
        instead: "Candidates outside the box are drawn again up to 100 times and then moved to the bound. Without the move, \
                  a search stalls in a corner. Nothing needs to be detected.",
        check: corner,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-ill-conditioned",
        title: "A long narrow valley",
        input: "Σ 10^(p i/5) xᵢ² in 6 variables around an inner point, p from 0 to 18: condition numbers up to 10¹⁸; \
                30 000 evaluations, 5 seeds",
        instead: "The search stops when the condition number of its covariance matrix exceeds 10¹⁴, and starts again from \
                  the best design. Up to 10¹² the minimum is found to rounding; beyond, the run ends in the valley, short \
                  of the minimum.",
        check: ill_conditioned,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-noise",
        title: "A noisy objective",
        input: "A sphere plus normal noise of 0.1 in 4 variables, 6000 evaluations",
        instead: "Nothing is detected: the best value is too low by chance. Campaigns use the same random numbers at every \
                  design, which makes a noisy objective a function.",
        check: noise,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-many-minima",
        title: "Many local minima",
        input: "Rastrigin’s function in 6 variables, which has 11⁶ minima in the box; 60 000 evaluations, 5 seeds",
        instead: "Restarts from the best design stay in its basin. IPOP and BIPOP restart elsewhere with other populations; \
                  “optimise.restarts” chooses them.",
        check: many_minima,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-minus-infinity",
        title: "An objective of −∞",
        input: "−∞ below x₁ = 0.2",
        instead: "It ranks as the best value, and the run ends on it. Differences of infinities do not become NaN.",
        check: minus_infinity,
        ..Entry::blank(Method::Search)
    },
    Entry {
        id: "search-unusable",
        title: "Invalid options of a search",
        input: "Equal bounds, a start outside the box or of another dimension, a population of 1, 0 or 11 parents of 10 \
                candidates, steps of 0, −1 and ∞, a tolerance of NaN, no evaluations, fewer evaluations than one generation",
        instead: "Each is refused with its value, except the last: as many candidates of the first generation are evaluated \
                  as the budget allows, and the best one is returned.",
        check: unusable,
        ..Entry::blank(Method::Search)
    },
];

fn plateau(outcome: &mut Outcome) -> Result<(), EntryError> {
    let run = run(6, 3000, FROM_BEST, 0, |_| 1.0)?;
    stops(outcome, &run, &["Plateau"]);
    outcome.figure(
        "evaluations until the first restart",
        run.restarts[0].evaluations as f64,
        "",
    );
    outcome.figure("restarts", run.restarts.len() as f64, "");
    outcome.holds("a design is returned with its value 1", run.value == 1.0);
    outcome.holds("the whole budget is used", run.evaluations == 3000);
    for d in [1, 6] {
        let options = ten_candidates(Bounds::unit(d)?);
        let search = Search::run(&vec![0.3; d], options, 10_000, 1, |_| 4.2)?.cma_es;
        let is_plateau = matches!(search.stop(), Some(Stop::Plateau { .. }));
        outcome.holds(
            "a search of 10 candidates stops after 10 + 3 d generations",
            is_plateau && search.evaluations() == 10 * (10 + 3 * d),
        );
    }
    let violated = |x: &[f64]| Evaluation {
        value: x[0],
        violation: 1.0,
    };
    let options = ten_candidates(Bounds::unit(6)?);
    let level = Search::run(&[0.3; 6], options, 10_000, 1, violated)?;
    outcome.holds(
        "equal violations are a plateau, whatever the values",
        matches!(level.cma_es.stop(), Some(Stop::Plateau { .. })) && !level.best().is_feasible(),
    );
    Ok(())
}

fn needle(outcome: &mut Outcome) -> Result<(), EntryError> {
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
                stops(outcome, &run, &["Plateau"]);
            }
        }
        let share = 100.0 * f64::from(hits) / 20.0;
        outcome.figure(&format!("seeds that find it, restarts {name}"), share, "%");
        shares.push(share);
    }
    let least = shares.iter().copied().fold(100.0, f64::min);
    outcome.at_least("seeds that find it, the worst kind", least, "%", 30.0);
    Ok(())
}

fn corner(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut curves = Vec::new();
    let mut is_inside = true;
    for (name, d, limit) in [
        ("1 variable", 1, 2000),
        ("2 variables", 2, 3000),
        ("6 variables", 6, 5000),
        ("11 variables", 11, 9000),
    ] {
        let intervals: Vec<(f64, f64)> = (0..d).map(|i| (-1.0, 2.0 + f64::from(i))).collect();
        let start: Vec<f64> = intervals
            .iter()
            .map(|(low, high)| 0.5 * (low + high))
            .collect();
        let bounds = Bounds::new(intervals)?;
        let (mut worst, mut needed) = (0.0_f64, 0.0_f64);
        for seed in 0..11 {
            let options = ten_candidates(bounds.clone());
            let distance = |x: &[f64]| x.iter().map(|x| x + 1.0).sum::<f64>();
            let search = Search::run(&start, options, limit, seed, distance)?;
            worst = worst.max(search.best().value);
            needed = needed.max(search.evaluations_to(1e-9));
            is_inside &= bounds.contains(&search.cma_es.mean());
            is_inside &= search
                .cma_es
                .best()
                .is_some_and(|(x, _)| bounds.contains(x));
            if seed == 0 && d > 1 {
                // Zero has no place on a logarithmic axis.
                let points = search
                    .history
                    .iter()
                    .map(|(at, best)| [*at as f64, best.value.max(1e-16)]);
                curves.push((name, points.collect()));
            }
        }
        outcome.at_most(
            &format!("largest distance to the minimum, {name}"),
            worst,
            "",
            1e-9,
        );
        outcome.figure(&format!("evaluations to 1e-9, {name}"), needed, "");
    }
    outcome.holds("means and designs returned are in the box", is_inside);
    let mut worst = 0.0_f64;
    for seed in 0..5 {
        let options = ten_candidates(Bounds::unit(11)?);
        let face = |x: &[f64]| 1.0 - x[10] + sphere(&x[..10], 0.4);
        let search = Search::run(&[0.5; 11], options, 8000, seed, face)?;
        worst = worst.max(search.best().value);
    }
    outcome.at_most("largest distance to the minimum on a face", worst, "", 1e-9);
    outcome.chart(
        "Best value in a corner",
        ("evaluations", Scale::Linear),
        ("distance to the minimum", Scale::Log),
        curves,
    );
    Ok(())
}

fn ill_conditioned(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut curve = Vec::new();
    for power in (0..=18).step_by(2) {
        let mut values = Vec::new();
        for seed in 0..5 {
            let run = run(6, 30_000, FROM_BEST, seed, |x| {
                let terms = (0..).zip(x);
                let weight = |i: i32| 10_f64.powf(f64::from(power * i) / 5.0);
                terms
                    .map(|(i, x)| weight(i) * (x - 0.4).powi(2))
                    .sum::<f64>()
            })?;
            if power == 18 && seed == 0 {
                let is_ill = |cause: &Cause| match cause {
                    Cause::Stopped(Stop::IllConditioned { condition }) => *condition > 1e14,
                    _ => false,
                };
                let ill = run
                    .restarts
                    .iter()
                    .map(|restart| restart.cause)
                    .find(is_ill);
                outcome.holds(
                    "a search stops for a condition number above 10¹⁴",
                    ill.is_some(),
                );
                if let Some(Cause::Stopped(stop)) = ill {
                    outcome.warned(&[stop], &["IllConditioned"]);
                }
            }
            values.push(run.value);
        }
        // Zero has no place on a logarithmic axis.
        curve.push([10_f64.powi(power), median(&values).max(1e-30)]);
    }
    let upto = |limit: f64| {
        let some = curve.iter().filter(|p| p[0] <= limit);
        some.map(|p| p[1]).fold(0.0, f64::max)
    };
    outcome.at_most(
        "largest median value up to a condition of 10¹²",
        upto(1.1e12),
        "",
        1e-9,
    );
    outcome.at_most("median value at a condition of 10¹⁸", curve[9][1], "", 2.0);
    outcome.chart(
        "Value reached in a long valley",
        ("condition number", Scale::Log),
        ("median value reached", Scale::Log),
        vec![("30 000 evaluations", curve)],
    );
    Ok(())
}

fn noise(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut random = rng(77);
    let run = run(4, 6000, FROM_BEST, 0, |x| {
        let z: f64 = StandardNormal.sample(&mut random);
        sphere(x, 0.3) + 0.1 * z
    })?;
    let truth = sphere(&run.x, 0.3);
    outcome.at_most("value without noise of the design returned", truth, "", 0.3);
    outcome.figure("value that the run reports", run.value, "");
    outcome.at_least(
        "optimism: true value less reported one",
        truth - run.value,
        "",
        0.1,
    );
    Ok(())
}

fn many_minima(outcome: &mut Outcome) -> Result<(), EntryError> {
    let rastrigin = |x: &[f64]| -> f64 {
        x.iter()
            .map(|x| 10.24 * (x - 0.45))
            .map(|v| v * v + 10.0 * (1.0 - (std::f64::consts::TAU * v).cos()))
            .sum()
    };
    for (name, restarts) in [
        ("from the best design", FROM_BEST),
        ("IPOP", Restarts::Ipop),
        ("BIPOP", Restarts::Bipop),
    ] {
        let values: Result<Vec<f64>, Error> = (0..5)
            .map(|seed| Ok(run(6, 60_000, restarts, seed, rastrigin)?.value))
            .collect();
        let values = values?;
        outcome.figure(
            &format!("median value reached, restarts {name}"),
            median(&values),
            "",
        );
        if restarts == FROM_BEST {
            let is_stuck = values.iter().any(|value| *value > 0.5);
            outcome.holds(
                "restarts from the best design miss the minimum with some seeds",
                is_stuck,
            );
        } else {
            let hits = values.iter().filter(|value| **value < 1e-9).count();
            let name = format!("seeds that find the minimum, restarts {name}");
            outcome.at_least(&name, hits as f64, "of 5", 4.0);
        }
    }
    Ok(())
}

fn minus_infinity(outcome: &mut Outcome) -> Result<(), EntryError> {
    let run = run(2, 1000, FROM_BEST, 0, |x| {
        if x[0] < 0.2 { f64::NEG_INFINITY } else { x[0] }
    })?;
    stops(outcome, &run, &["Plateau"]);
    outcome.holds(
        "the run ends on −∞",
        run.value == f64::NEG_INFINITY && run.x[0] < 0.2,
    );
    outcome.at_least("restarts", run.restarts.len() as f64, "", 1.0);
    Ok(())
}

fn unusable(outcome: &mut Outcome) -> Result<(), EntryError> {
    let empty = Bounds::new([(0.0, 1.0), (2.0, 2.0)]);
    outcome.refused_with(empty, "Bounds", "variable 1 (counted from 0) are [2, 2]");
    let sound = ten_candidates(Bounds::unit(2)?);
    let start_at = |start: &[f64]| CmaEs::new(start, sound.clone());
    outcome.refused_with(start_at(&[0.5, 1.5]), "StartOutside", "1.5 in variable 1");
    outcome.refused_with(
        start_at(&[0.5; 3]),
        "Dimension",
        "3 variables, but the bounds have 2",
    );
    let with = |change: fn(&mut Options, f64), value: f64| {
        let mut options = sound.clone();
        change(&mut options, value);
        CmaEs::new(&[0.5; 2], options)
    };
    let alone = with(
        |options, _| (options.population, options.parents) = (1, 1),
        1.0,
    );
    outcome.refused_with(alone, "Population", "population is 1:");
    for parents in [0, 11] {
        let refusal = with(
            |options, parents| options.parents = parents as usize,
            f64::from(parents),
        );
        outcome.refused_with(refusal, "Parents", &format!("{parents} parents of 10"));
    }
    for step in [0.0, -1.0, f64::INFINITY] {
        let refusal = with(|options, step| options.step = step, step);
        outcome.refused_with(refusal, "Step", &format!("step size is {step} "));
    }
    let vague = with(
        |options, tolerance| options.value_tolerance = tolerance,
        f64::NAN,
    );
    outcome.refused_with(vague, "Tolerance", "value tolerance is NaN");
    outcome.refused(run(2, 0, FROM_BEST, 0, |_| 1.0), "NoBudget");
    let three = run(2, 3, FROM_BEST, 0, |x| x[0])?;
    outcome.holds(
        "a budget of 3 evaluations is used up",
        three.evaluations == 3,
    );
    Ok(())
}
