use std::cell::{Cell, RefCell};

use super::*;
use crate::Campaign;
use crate::formulation::Problem;

fn problem() -> Problem {
    Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap())
}

fn request(count: u32) -> Task {
    Task::Sample {
        frozen: problem().printed_frozen(),
        designs: vec![
            SampleRequest {
                design: 3,
                x: [0.25, 1.37, 1.37, 0.85, 1.31, 0.80],
                samples: SampleRange { first: 0, count },
            },
            // x_p + x_r = −2 leaves the involute equation without a solution.
            SampleRequest {
                design: 4,
                x: [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0],
                samples: SampleRange { first: 0, count },
            },
        ],
    }
}

#[test]
fn a_panic_is_recorded_against_its_design() {
    let outcome = guarded(|| panic!("no such tooth"));
    assert_eq!(
        outcome,
        Ok(Some(DesignOutcome::Refused {
            reason: "simulator-panic: no such tooth".to_owned()
        }))
    );
}

#[test]
fn tasks_and_results_survive_json_bit_for_bit() {
    let problem = problem();
    let task = request(6);
    let json = serde_json::to_string(&task).unwrap();
    assert_eq!(serde_json::from_str::<Task>(&json).unwrap(), task);
    let result = execute(&problem, &task).unwrap();
    let json = serde_json::to_string(&result).unwrap();
    assert_eq!(serde_json::from_str::<TaskResult>(&json).unwrap(), result);
    let TaskResult::Sample { designs } = result else {
        panic!("a sampling result")
    };
    assert!(matches!(&designs[0].outcome,
        DesignOutcome::Simulated { samples_um, .. } if samples_um.len() == 6));
    assert!(matches!(&designs[1].outcome,
        DesignOutcome::Refused { reason } if reason.starts_with("no-involute-solution: ")));
}

fn samples(result: &TaskResult) -> Vec<(u32, Vec<f64>)> {
    let TaskResult::Sample { designs } = result else {
        panic!("a sampling result")
    };
    designs
        .iter()
        .filter_map(|design| match &design.outcome {
            DesignOutcome::Simulated { samples_um, .. } => {
                Some((design.design, samples_um.clone()))
            }
            DesignOutcome::Refused { .. } => None,
        })
        .collect()
}

fn of_one_design(samples: SampleRange) -> Task {
    let Task::Sample { frozen, designs } = request(0) else {
        unreachable!("the request is one for samples")
    };
    let designs = vec![SampleRequest {
        samples,
        ..designs[0]
    }];
    Task::Sample { frozen, designs }
}

/// What workers compute is what the gear model computes, to the last bit.
#[test]
fn tasks_ask_the_built_in_model_and_nothing_else() {
    let problem = problem();
    let variables = Variables::robust(
        &[0.25, 1.37, 1.37, 0.85, 1.31, 0.80],
        &problem.printed_frozen(),
    );
    let pair = problem.pair(&variables).unwrap();
    let unworn = pair.unworn();
    let worn = pair.archard(problem.wear()).analysis;
    let mut sampler = pair.sampler(problem.wear());
    let seed = problem.campaign().seed;
    let drawn = (2..7)
        .map(|index| sampler.draw(&mut stream(seed, Purpose::Wear, 3, index)))
        .collect();
    let task = of_one_design(SampleRange { first: 2, count: 5 });
    let TaskResult::Sample { designs } = execute(&problem, &task).unwrap() else {
        panic!("a sampling result")
    };
    assert_eq!(
        designs[0].outcome,
        DesignOutcome::Simulated {
            criteria: problem.criteria(&pair, unworn.hertz_pressure_mpa),
            hertz_pressure_worn_mpa: worn.hertz_pressure_mpa,
            delta_ste_um: unworn.delta_ste_um,
            delta_ste_archard_um: worn.delta_ste_um,
            first: 2,
            samples_um: drawn,
            ruled_out: None,
        }
    );
    assert_eq!(
        problem.normal_module(&variables).unwrap(),
        pair.geometry().normal_module
    );
}

#[test]
fn a_design_that_its_constraints_rule_out_gets_no_samples() {
    let outcome = |skip_violation| {
        let mut campaign = problem().campaign().clone();
        campaign.sampling.skip_violation = skip_violation;
        let problem = Problem::new(campaign);
        let task = of_one_design(SampleRange { first: 0, count: 5 });
        let TaskResult::Sample { designs } = execute(&problem, &task).unwrap() else {
            panic!("a sampling result")
        };
        match &designs[0].outcome {
            DesignOutcome::Simulated {
                criteria,
                hertz_pressure_worn_mpa,
                samples_um,
                ruled_out,
                ..
            } => {
                let worn = Criteria {
                    hertz_pressure_mpa: *hertz_pressure_worn_mpa,
                    ..*criteria
                };
                let violation = problem.violation(&worn);
                (violation, samples_um.len(), ruled_out.clone())
            }
            DesignOutcome::Refused { reason } => panic!("{reason}"),
        }
    };
    let (violation, samples, reason) = outcome(Some(0.0));
    assert!(violation > 0.1, "this design has interference");
    assert_eq!(samples, 0);
    let reason = reason.unwrap();
    assert!(reason.starts_with("ruled-out: "), "{reason}");
    assert!(reason.contains("mate flank margin = -"), "{reason}");
    assert_eq!(outcome(Some(0.99 * violation)).1, 0);
    // It breaks the constraints by less than the limit, or nobody asked.
    assert_eq!(outcome(Some(1.01 * violation)), (violation, 5, None));
    assert_eq!(outcome(None), (violation, 5, None));
}

#[test]
fn a_sample_does_not_depend_on_who_draws_its_neighbours() {
    let problem = problem();
    let drawn = |first, count| {
        let task = of_one_design(SampleRange { first, count });
        samples(&execute(&problem, &task).unwrap())[0].1.clone()
    };
    assert_eq!(drawn(0, 8)[5..], drawn(5, 3));
}

#[test]
fn a_stopped_task_gives_what_is_done() {
    let problem = problem();
    let Task::Sample { frozen, designs } = request(4) else {
        unreachable!("the request is one for samples")
    };
    let later = SampleRequest {
        design: 5,
        ..designs[0]
    };
    let task = Task::Sample {
        frozen,
        designs: vec![designs[0], designs[1], later],
    };
    let whole = samples(&execute(&problem, &task).unwrap());
    let stopped_after = |questions: u32| {
        let left = Cell::new(questions);
        let so_far_last = RefCell::new(None);
        let keep_going = |so_far: &dyn Fn() -> TaskResult| {
            let going = left.get() > 0;
            left.set(left.get().saturating_sub(1));
            so_far_last.replace(Some(so_far()));
            going
        };
        let part = execute_until(&problem, &task, &keep_going).unwrap();
        if left.get() == 0 && questions < 11 {
            // What could be had when the last question was asked is what came of it.
            assert_eq!(so_far_last.take().as_ref(), Some(&part), "{questions}");
        }
        assert_eq!(part.is_empty(), samples(&part).is_empty());
        part
    };
    // Asked before each design and each sample: 1 + 4, 1 (refused), 1 + 4.
    for (questions, designs, of_last) in [
        (0, 0, 0),
        (1, 0, 0),
        (2, 1, 1),
        (4, 1, 3),
        (5, 1, 4),
        (6, 2, 4),
        (7, 2, 4),
        (9, 3, 2),
        (11, 3, 4),
    ] {
        let part = stopped_after(questions);
        let TaskResult::Sample { designs: done } = &part else {
            panic!("a sampling result")
        };
        assert_eq!(done.len(), designs, "after {questions} questions");
        let part = samples(&part);
        assert_eq!(part.last().map_or(0, |last| last.1.len()), of_last);
        for ((design, part), (same, whole)) in part.iter().zip(&whole) {
            assert_eq!((design, part.as_slice()), (same, &whole[..part.len()]));
        }
    }
}

#[test]
fn a_stopped_verification_gives_fewer_samples() {
    let problem = problem();
    let task = Task::Verify {
        point: "archard".to_owned(),
        number: 2,
        variables: Variables::robust(
            &[0.25, 1.37, 1.37, 0.85, 1.31, 0.80],
            &problem.printed_frozen(),
        ),
        samples: SampleRange {
            first: 10,
            count: 5,
        },
    };
    let left = Cell::new(3);
    let keep_going = |_: &dyn Fn() -> TaskResult| left.replace(left.get() - 1) > 0;
    let (
        Ok(TaskResult::Verify {
            samples_um: whole, ..
        }),
        Ok(TaskResult::Verify {
            first, samples_um, ..
        }),
    ) = (
        execute(&problem, &task),
        execute_until(&problem, &task, &keep_going),
    )
    else {
        panic!("two verifying results")
    };
    assert_eq!((first, samples_um.as_slice()), (10, &whole[..3]));
}
