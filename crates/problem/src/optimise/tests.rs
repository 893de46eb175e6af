use cmaes::Restarts;

use super::*;
use crate::Campaign;
use crate::file::{OfGears, Setting};
use crate::formulation::{Criteria, Design};

fn problem(change: impl FnOnce(&mut Campaign)) -> Problem {
    let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
    campaign.optimise.evaluations = 400;
    campaign.optimise.restart_at = Some(200);
    change(&mut campaign);
    Problem::new(campaign)
}

fn of(problem: &Problem, approach: Approach, start: u32, model: Option<&str>) -> Run {
    Run {
        approach,
        start,
        base: problem.base().clone(),
        models: model.map(Into::into).into_iter().collect(),
        from: None,
    }
}

fn archard(problem: &Problem) -> RunResult {
    run(problem, &of(problem, Approach::Baseline, 0, None)).unwrap()
}

#[test]
fn a_run_is_a_function_of_campaign_approach_and_start() {
    let problem = problem(|_| {});
    let first = archard(&problem);
    assert_eq!(first, archard(&problem));
    let other = run(&problem, &of(&problem, Approach::Baseline, 1, None)).unwrap();
    assert_ne!(first.best, other.best);
    let json = serde_json::to_string(&first).unwrap();
    assert_eq!(serde_json::from_str::<RunResult>(&json).unwrap(), first);
}

#[test]
fn searches_of_the_baseline_begin_at_own_designs() {
    let unit = [0.25; 6];
    let problem = problem(|campaign| {
        let x = Problem::new(campaign.clone()).free_point(&unit);
        campaign.doe.points = vec![x];
        campaign.optimise.step = 1e-3;
    });
    let is_near = |start| {
        let run = of(&problem, Approach::Baseline, start, None);
        let asked = Search::new(&problem, &run).unwrap().ask(&problem);
        asked.iter().all(|candidate| {
            let x = problem.free_values(candidate.design.as_ref().expect("it can be simulated"));
            let mut pairs = problem.unit_point(&x).into_iter().zip(unit);
            pairs.all(|(found, own)| (found - own).abs() < 0.02)
        })
    };
    assert!(is_near(0) && !is_near(1));
}

/// If no design is simulable, a search ends on a plateau after some hundred evaluations.
#[test]
fn the_kinds_of_restarts_give_different_runs_that_are_reproducible() {
    let restarts = |restarts, restart_at| {
        let problem = problem(|campaign| {
            campaign.gears_mut().unwrap().bounds.profile_shift =
                OfGears::Both(Setting::Free([-9.0, -8.0]));
            campaign.optimise.evaluations = 4000;
            campaign.optimise.restarts = restarts;
            campaign.optimise.restart_at = restart_at;
        });
        let run = archard(&problem);
        assert_eq!(run, archard(&problem), "{restarts:?}");
        run.restarts
    };
    let from_best = restarts(Restarts::FromBest, Some(2000));
    let ipop = restarts(Restarts::Ipop, None);
    let bipop = restarts(Restarts::Bipop, None);
    assert!(from_best.len() > ipop.len(), "{from_best:?} {ipop:?}");
    assert!(ipop.len() > 3 && ipop != bipop, "{ipop:?} {bipop:?}");
    let share = |(_, cause): &(u64, String)| cause == "a small search used up its share";
    assert!(
        bipop.iter().any(share) && !ipop.iter().any(share),
        "{bipop:?}"
    );
}

#[test]
fn a_weight_that_is_too_small_is_said_and_made_up_for() {
    let problem = problem(|campaign| campaign.gears_mut().unwrap().penalty.weight = 1e-3);
    let result = archard(&problem);
    let printed = result.printed.unwrap();
    assert!(!printed.feasible, "the weight was meant to be too small");
    assert!(result.continuations > 0);
    assert!(result.evaluations > 400);
    let best = result
        .best
        .expect("the run goes on until it finds a feasible design");
    assert!(best.feasible && problem.is_feasible(&best.criteria));
    assert_eq!(problem.violation(&best.criteria), 0.0);
}

#[test]
fn constraints_that_nothing_satisfies_end_without_an_optimum() {
    let problem = problem(|campaign| {
        campaign.gears_mut().unwrap().constraints.contact_ratio_min = Some(50.0);
        campaign.optimise.evaluations = 60;
        campaign.optimise.restart_at = Some(30);
    });
    let result = archard(&problem);
    assert_eq!(result.best, None);
    assert_eq!(result.continuations, CONTINUATIONS);
    assert!(result.printed.is_some_and(|found| !found.feasible));
}

#[test]
fn calls_are_counted_as_the_paper_does() {
    let problem = problem(|_| {});
    let unworn = run(&problem, &of(&problem, Approach::Nominal, 0, None)).unwrap();
    assert!(
        unworn.simulator_calls <= unworn.evaluations,
        "one call per analysis at most"
    );
    let worn = archard(&problem);
    assert!(
        worn.simulator_calls > worn.evaluations,
        "two calls per analysis"
    );
    assert!(worn.simulator_calls <= 2 * worn.evaluations);
}

#[test]
fn a_kriging_run_needs_a_model_that_can_be_read() {
    let problem = problem(|_| {});
    let kriging = |model| run(&problem, &of(&problem, Approach::Kriging, 0, model));
    assert!(kriging(None).is_err());
    let error = kriging(Some("{}")).unwrap_err();
    assert!(error.contains("cannot be read"), "{error}");
}

/// A run whose generations are answered in reverse order, as parallel workers may.
fn by_generations(problem: &Problem, of: &Run) -> RunResult {
    let mut search = Search::new(problem, of).unwrap();
    loop {
        let candidates = search.ask(problem);
        let ask = |one: &Candidate| {
            let design = one.design.as_ref().filter(|_| one.is_asked)?;
            answer(problem, of.approach, design, one.may_improve).ok()
        };
        let mut answers: Vec<_> = candidates.iter().rev().map(ask).collect();
        answers.reverse();
        if !search.answered(problem, &candidates, answers).unwrap() {
            return search.result();
        }
    }
}

/// This includes a weight that is too small, so that the run continues, and a space where most
/// designs are not simulable.
#[test]
fn a_run_by_generations_ends_as_one_that_a_worker_computes() {
    let problem = problem(|campaign| {
        campaign.gears_mut().unwrap().penalty.weight = 1e-3;
        campaign.optimise.direct = true;
        campaign.sampling.samples_per_design = 10;
    });
    for approach in [Approach::Nominal, Approach::Baseline, Approach::Direct] {
        let wanted = of(&problem, approach, 0, None);
        let result = by_generations(&problem, &wanted);
        assert_eq!(result, run(&problem, &wanted).unwrap(), "{approach:?}");
        assert!(result.continuations > 0 || approach != Approach::Baseline);
    }
}

#[test]
fn a_direct_search_minimises_the_percentile_of_designs_that_keep_the_constraints() {
    let problem = problem(|campaign| {
        campaign.optimise.direct = true;
        campaign.optimise.evaluations = 800;
        campaign.sampling.samples_per_design = 12;
    });
    let result = run(&problem, &of(&problem, Approach::Direct, 0, None)).unwrap();
    let best = result.best.expect("800 designs reach the feasible region");
    assert!(problem.is_feasible(&best.criteria));
    let again = answer(&problem, Approach::Direct, &best.design, true).unwrap();
    let samples = again.samples.unwrap();
    assert_eq!(samples.len(), 12);
    let percentile = stats::percentile_p90(samples.values()).unwrap();
    assert_eq!(percentile.p90, best.criterion);
    // Two analyses per design, and samples only of feasible designs.
    let most = 14 * result.evaluations;
    assert!((2 * result.evaluations..most).contains(&result.simulator_calls));
    let values = result.history.iter().map(|(_, value)| *value);
    let met = values.filter(|value| *value > best.criterion).count();
    assert!(met > 3, "it improved again and again: {:?}", result.history);
}

/// Branin's function with 60 designs: a search from a random point, with few evaluations, may end in a worse basin
/// than the one of the DoE's best design.
#[test]
fn a_search_on_a_model_begins_at_the_best_design_and_never_ends_worse() {
    let text = "kind = \"external\"\nformat = 1\nname = \"branin\"\nseed = 1\n\
        [[variables]]\nname = \"a\"\nlow = -5.0\nhigh = 10.0\n\
        [[variables]]\nname = \"b\"\nlow = 0.0\nhigh = 15.0\n\
        [[responses]]\nname = \"y\"\n[doe]\ndesigns = 60\n[sampling]\nsamples_per_design = 30\n";
    let branin = |a: f64, b: f64| {
        let pi = std::f64::consts::PI;
        let bowl = b - 5.1 / (4.0 * pi * pi) * a * a + 5.0 / pi * a - 6.0;
        bowl * bowl + 10.0 * (1.0 - 1.0 / (8.0 * pi)) * a.cos() + 10.0
    };
    let mut worse_from_random = 0;
    for seed in 1..=6 {
        let mut campaign = Campaign::parse("branin.toml", text).unwrap();
        campaign.seed = seed;
        (campaign.optimise.evaluations, campaign.optimise.restart_at) = (30, None);
        let problem = Problem::new(campaign);
        let mut rng = stream(seed, Purpose::Test, 0, 0);
        let x: Vec<f64> = (0..60)
            .flat_map(|_| {
                [
                    -5.0 + 15.0 * rng.random::<f64>(),
                    15.0 * rng.random::<f64>(),
                ]
            })
            .collect();
        let y: Vec<f64> = x.chunks(2).map(|x| branin(x[0], x[1])).collect();
        let data = kriging::Data {
            x: &x,
            d: 2,
            y: &y,
            noise_variance: &[0.01; 60],
        };
        let model =
            kriging::Surrogate::from(kriging::fit(&data, &kriging::FitOptions::default()).unwrap());
        let means = x.chunks(2).map(|x| (model.mean(x), x));
        let (least, best) = means.min_by(|(a, _), (b, _)| a.total_cmp(b)).unwrap();
        let found = |from: Option<Design>| {
            let json = model.to_json().unwrap();
            let run = Run {
                from,
                ..of(&problem, Approach::Kriging, 0, Some(&json))
            };
            let mut search = Search::new(&problem, &run).unwrap();
            loop {
                let candidates = search.ask(&problem);
                // The program's only answer is that the designs can be simulated.
                let answers = candidates.iter().map(|candidate| {
                    candidate.is_asked.then(|| Answer {
                        analysis: crate::simulator::Analysis {
                            value: 0.0,
                            criteria: Criteria::new(Vec::new()),
                        },
                        worn: None,
                        samples: None,
                    })
                });
                let answers = answers.collect();
                if !search.answered(&problem, &candidates, answers).unwrap() {
                    return search.result();
                }
            }
        };
        let result = found(Some(problem.design(best, problem.base())));
        let rounding = 1e-9 * least.abs();
        let ended = result.best.unwrap().criterion;
        assert!(ended <= least + rounding, "{seed}: {ended} {least}");
        assert_eq!(result.evaluations, 30);
        let random = found(None).best.unwrap().criterion;
        worse_from_random += u32::from(random > least + rounding);
    }
    assert!(worse_from_random > 0, "the budget was to be small");
}
