//! CMA-ES on plateaus, in corners, in valleys, under noise.

use cmaes::{Bounds, Cause, CmaEs, Error, Options, Restarts, Stop};
use rand_distr::{Distribution as _, StandardNormal};
use results::report::Scale;

use super::search_scene::{FROM_BEST, median, rng, run, sphere, stops};
use crate::stability::outcome::{Failed, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 8] = [
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
        id: "search-ill-conditioned",
        title: "A valley far longer than wide",
        input: "Σ 10^(p i/5) xᵢ² in 6 variables around an inner point, p from 0 to 18: condition numbers up to 10¹⁸; \
                30 000 evaluations, 5 seeds",
        instead: "The search stops where its covariance matrix has a condition number above 10¹⁴ and starts again \
                  from the best design. Up to 10¹² the minimum is found to rounding; beyond it the run ends in the valley, short of \
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
                  “optimise.restarts” chooses them.",
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

fn plateau(found: &mut Outcome) -> Result<(), Failed> {
    let run = run(6, 3000, FROM_BEST, 0, |_| 1.0)?;
    stops(found, &run, &["Plateau"]);
    found.at_most(
        "evaluations until the first restart",
        run.restarts[0].evaluations as f64,
        "",
        400.0,
    );
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
        let points = run
            .history
            .iter()
            .map(|(at, e)| [*at as f64, e.value.max(1e-16)]);
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

fn ill_conditioned(found: &mut Outcome) -> Result<(), Failed> {
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
                let is_ill =
                    |cause: &Cause| matches!(cause, Cause::Stopped(Stop::IllConditioned { .. }));
                let ill = run
                    .restarts
                    .iter()
                    .map(|restart| restart.cause)
                    .find(is_ill);
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
    found.at_most(
        "largest median value up to a condition of 10¹²",
        upto(1.1e12),
        "",
        1e-9,
    );
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
    found.at_least(
        "optimism: true value less reported one",
        truth - run.value,
        "",
        0.1,
    );
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
    found.holds(
        "the run ends on −∞",
        run.value == f64::NEG_INFINITY && run.x[0] < 0.2,
    );
    found.at_least("restarts", run.restarts.len() as f64, "", 1.0);
    Ok(())
}

fn unusable(found: &mut Outcome) -> Result<(), Failed> {
    found.refused(Bounds::new([(0.0, 1.0), (2.0, 2.0)]), "Bounds");
    let options = || Ok::<_, Error>(Options::new(Bounds::unit(2)?));
    found.refused(CmaEs::new(&[0.5, 1.5], options()?), "StartOutside");
    let population = 1;
    found.refused(
        CmaEs::new(
            &[0.5; 2],
            Options {
                population,
                ..options()?
            },
        ),
        "Population",
    );
    found.refused(run(2, 0, FROM_BEST, 0, |_| 1.0), "NoBudget");
    let three = run(2, 3, FROM_BEST, 0, |x| x[0])?;
    found.holds(
        "of three evaluations the best is returned",
        three.evaluations == 3,
    );
    Ok(())
}
