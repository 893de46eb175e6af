use std::cell::Cell;

use ledger::Generation;

use super::*;
use crate::Campaign;
use crate::file::{OfGears, Restarts, Written};
use crate::formulation::Problem;

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
        model: model.map(Into::into),
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

/// Where no design can be simulated, a search ends on a plateau after some hundred evaluations.
#[test]
fn the_kinds_of_restarts_give_different_runs_that_are_reproducible() {
    let restarts = |restarts, restart_at| {
        let problem = problem(|campaign| {
            campaign.gears_mut().unwrap().bounds.profile_shift =
                OfGears::Both(Written::Free([-9.0, -8.0]));
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

fn unit(run: &Run) -> Unit {
    Unit {
        stream: run.stream(),
        generation: Generation(0xabcd),
        samples: 0..1,
    }
}

/// What comes of a run that is stopped after so many generations.
fn stopped_after(problem: &Problem, run: &Run, saved: Option<Saved>, generations: u32) -> Output {
    let asked = Cell::new(0);
    let keep_going = |_: &dyn Fn() -> Option<Output>| {
        asked.set(asked.get() + 1);
        asked.get() <= generations
    };
    let output = run_until(problem, &unit(run), run, saved, &keep_going);
    output.unwrap().expect("a generation was evaluated")
}

/// A weight that is too small makes the run continue, so that it is stopped there, too.
#[test]
fn a_run_that_is_stopped_again_and_again_ends_as_one_that_is_not() {
    for restarts in [Restarts::FromBest, Restarts::Ipop, Restarts::Bipop] {
        let problem = problem(|campaign| {
            campaign.gears_mut().unwrap().penalty.weight = 1e-3;
            campaign.optimise.evaluations = 2000;
            campaign.optimise.restarts = restarts;
            campaign.optimise.restart_at = (restarts == Restarts::FromBest).then_some(1000);
        });
        let run = of(&problem, Approach::Baseline, 0, None);
        let mut saved = None;
        let mut evaluations = Vec::new();
        let result = loop {
            match stopped_after(&problem, &run, saved, 23) {
                Output::Unfinished(checkpoint) => {
                    let read = Saved::read(&checkpoint.state, &unit(&run)).unwrap();
                    assert_eq!(read.evaluations(), checkpoint.evaluations);
                    evaluations.push(checkpoint.evaluations);
                    saved = Some(read);
                }
                Output::Run(result) => break *result,
                other => panic!("{other:?}"),
            }
        };
        assert!(evaluations.is_sorted() && evaluations.len() > 5);
        assert!(evaluations.iter().any(|at| *at > 2000), "{evaluations:?}");
        let whole = super::run(&problem, &run).unwrap();
        assert_eq!(result, whole);
        let json = |result: &RunResult| serde_json::to_string(result).unwrap();
        assert_eq!(json(&result), json(&whole), "to the bit");
    }
}

#[test]
fn a_state_that_is_damaged_or_of_another_run_is_refused() {
    let problem = problem(|_| {});
    let run = of(&problem, Approach::Baseline, 0, None);
    let Output::Unfinished(checkpoint) = stopped_after(&problem, &run, None, 3) else {
        panic!("the run cannot have ended");
    };
    let good = checkpoint.state;
    let refusal = |state: &[u8], unit: &Unit| Saved::read(state, unit).unwrap_err();
    for place in [0, 31, 32, good.len() / 2, good.len() - 1] {
        let mut flipped = good.clone();
        flipped[place] ^= 1;
        assert!(refusal(&flipped, &unit(&run)).contains("damaged"));
    }
    for length in [0, 31, good.len() - 1] {
        assert!(refusal(&good[..length], &unit(&run)).contains("damaged"));
    }
    let other = Unit {
        generation: Generation(0xabce),
        ..unit(&run)
    };
    let error = refusal(&good, &other);
    assert!(
        error.contains("is of run-2-0, generation 000000000000abcd"),
        "{error}"
    );
    let other = of(&problem, Approach::Baseline, 1, None);
    assert!(refusal(&good, &unit(&other)).contains("and not of run-2-1"));
}

#[test]
fn nothing_is_saved_before_the_first_generation() {
    let problem = problem(|_| {});
    let run = of(&problem, Approach::Baseline, 0, None);
    let output = run_until(&problem, &unit(&run), &run, None, &|_| false);
    assert_eq!(output, Ok(None));
}
