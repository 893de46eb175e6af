use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;

use ledger::{Generation, Kind, StreamId, Unit};
use stats::streams::stream;

use super::*;
use crate::Campaign;
use crate::formulation::{Approach, Problem};
use crate::simulator::{Analysis, NoAnswer, PreparedDesign, Simulator, State};

const X: [f64; 6] = [0.25, 1.37, 1.37, 0.85, 1.31, 0.80];

fn problem() -> Problem {
    Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap())
}

fn asked() -> Design {
    let problem = problem();
    problem.design(&X, problem.base())
}

fn unit(stream: StreamId, samples: std::ops::Range<u32>) -> Unit {
    Unit {
        stream,
        generation: Generation(1),
        samples,
    }
}

fn design(samples: std::ops::Range<u32>) -> Unit {
    unit(StreamId::design(3), samples)
}

fn drawn(output: Option<Output>) -> Vec<f64> {
    match output {
        Some(Output::Design { samples, .. } | Output::Samples(samples)) => samples.into_values(),
        other => panic!("no samples: {other:?}"),
    }
}

fn analysis(problem: &Problem, pair: &gear::Pair, analysis: &gear::Analysis) -> Analysis {
    let pressure = analysis.hertz_pressure_mpa;
    Analysis {
        value: analysis.delta_ste_um,
        criteria: problem
            .gears()
            .unwrap()
            .pair_criteria(pair, pressure)
            .into(),
    }
}

/// A flank class does not change the deterministic analyses, and samples deviate as the gear
/// model's do.
#[test]
fn a_flank_class_changes_the_samples_alone() {
    let perfect = problem();
    let mut campaign = perfect.campaign().clone();
    let flank_class = gear::FlankClass::new(6).unwrap();
    campaign.gears_mut().unwrap().manufacture = Some(crate::file::Manufacture {
        flank_class: Some(flank_class),
        ..Default::default()
    });
    let problem = Problem::new(campaign);
    let source = Source::Design(asked());
    let parts = |problem: &Problem| match compute(problem, &design(2..7), &source).unwrap() {
        Output::Design {
            responses, samples, ..
        } => (responses, samples.into_values()),
        other => panic!("{other:?}"),
    };
    let (with, without) = (parts(&problem), parts(&perfect));
    assert_eq!(with.0, without.0);
    assert!(with.1.iter().zip(&without.1).all(|(a, b)| a != b));
    let gears = problem.gears().unwrap();
    let pair = gears.pair(&asked()).unwrap();
    let mut sampler = pair.sampler_with(gears.wear(), gears.scatter());
    let seed = problem.campaign().seed;
    let drawn = (2..7).map(|index| sampler.draw(&mut stream(seed, Purpose::Wear, 3, index)));
    assert_eq!(with.1, drawn.collect::<Vec<f64>>());
}

/// A worker's numbers equal those of the gear model to the last bit.
#[test]
fn units_ask_the_built_in_model_and_nothing_else() {
    let problem = problem();
    let asked = asked();
    let gears = problem.gears().unwrap();
    let pair = gears.pair(&asked).unwrap();
    let unworn = pair.unworn();
    let worn = pair.archard(gears.wear()).analysis;
    let mut sampler = gears.sampler(&pair);
    let seed = problem.campaign().seed;
    let samples = (2..7)
        .map(|index| sampler.draw(&mut stream(seed, Purpose::Wear, 3, index)))
        .collect();
    let source = Source::Design(asked.clone());
    assert_eq!(
        compute(&problem, &design(2..7), &source).unwrap(),
        Output::Design {
            responses: problem.responses_of(
                &analysis(&problem, &pair, &unworn),
                &analysis(&problem, &pair, &worn)
            ),
            ruled_out: None,
            samples,
        }
    );
    assert_eq!(
        gears.normal_module(&asked).unwrap(),
        pair.geometry().normal_module
    );
    // With x_p + x_r = −2 the involute equation has no solution.
    let refused = [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0];
    let refused = problem.design(&refused, problem.base());
    let output = compute(&problem, &design(0..3), &Source::Design(refused)).unwrap();
    assert!(
        matches!(&output, Output::Refused(reason) if reason.starts_with("no-involute-solution: ")),
        "{output:?}"
    );
}

#[test]
fn a_design_that_its_constraints_rule_out_gets_no_samples() {
    let output = |skip_violation| {
        let mut campaign = problem().campaign().clone();
        campaign.sampling.skip_violation = skip_violation;
        let problem = Problem::new(campaign);
        match compute(&problem, &design(0..5), &Source::Design(asked())) {
            Ok(Output::Design {
                responses,
                ruled_out,
                samples,
            }) => {
                let worn = problem.analysis(&asked(), &responses, State::Baseline);
                let violation = problem.violation(&worn.unwrap().criteria);
                (violation, samples.len(), ruled_out)
            }
            other => panic!("{other:?}"),
        }
    };
    let (violation, samples, reason) = output(Some(0.0));
    assert!(violation > 0.1, "this design has interference");
    assert_eq!(samples, 0);
    let reason = reason.unwrap();
    assert!(reason.starts_with("ruled-out: "), "{reason}");
    assert!(reason.contains("mate flank margin = -"), "{reason}");
    assert_eq!(output(Some(0.99 * violation)).1, 0);
    // The violation is below the limit, or there is no limit.
    assert_eq!(output(Some(1.01 * violation)), (violation, 5, None));
    assert_eq!(output(None), (violation, 5, None));
}

#[test]
fn a_sample_does_not_depend_on_who_draws_its_neighbours() {
    let problem = problem();
    for source in [Source::Design(asked()), Source::Point(asked())] {
        let stream = match source {
            Source::Point(_) => StreamId::point(2),
            _ => StreamId::design(3),
        };
        let of = |samples| drawn(compute(&problem, &unit(stream, samples), &source).ok());
        assert_eq!(of(0..8)[5..], of(5..8));
    }
}

#[test]
fn what_is_stopped_gives_what_is_done() {
    let problem = problem();
    for (source, whole, asked_before) in [
        // Calls of `keep_going` before the first sample: one before the analyses of a design.
        (Source::Design(asked()), design(4..8), 1),
        (Source::Point(asked()), unit(StreamId::point(2), 4..8), 0),
    ] {
        let all = drawn(compute(&problem, &whole, &source).ok());
        for answers in 0..=6_u32 {
            let left = Cell::new(answers);
            let so_far_last = RefCell::new(None);
            let keep_going = |so_far: &dyn Fn() -> Option<Output>| {
                let going = left.get() > 0;
                left.set(left.get().saturating_sub(1));
                so_far_last.replace(so_far());
                going
            };
            let part = compute_until(&problem, &whole, &source, &keep_going).output;
            let expected = (answers.saturating_sub(asked_before) as usize).min(all.len());
            if expected < all.len() {
                assert_eq!(so_far_last.take(), part, "what was kept is what came of it");
            }
            if expected == 0 {
                assert_eq!(part, None);
            } else {
                assert_eq!(drawn(part), all[..expected]);
            }
        }
    }
}

/// A function that makes up a sample.
type SampleFunction = fn() -> Result<f64, NoAnswer>;

/// A simulator whose designs can be analysed and whose samples are made up.
struct Fake {
    problem: Problem,
    analysed_um: f64,
    sample: SampleFunction,
}

impl Simulator for Fake {
    fn problem(&self) -> &Problem {
        &self.problem
    }

    fn prepare<'a>(&'a self, design: &Design) -> Result<Box<dyn PreparedDesign + 'a>, NoAnswer> {
        assert!(design.values()[0] < 0.9, "no such tooth");
        Ok(Box::new(FakeDesign(self)))
    }
}

struct FakeDesign<'a>(&'a Fake);

impl PreparedDesign for FakeDesign<'_> {
    fn analyse(&mut self, _: State) -> Result<Analysis, NoAnswer> {
        let gears = self.0.problem.gears().unwrap();
        let pair = gears.pair(&asked()).unwrap();
        Ok(Analysis {
            value: self.0.analysed_um,
            criteria: gears.pair_criteria(&pair, 900.0).into(),
        })
    }

    fn sample(&mut self, _: &mut stats::streams::StreamRng) -> Result<Vec<f64>, NoAnswer> {
        Ok(vec![(self.0.sample)()?])
    }
}

/// Whether a design is simulable must not depend on which of its samples are drawn together.
#[test]
fn analyses_refuse_a_design_and_samples_fail() {
    let of = |analysed_um: f64, sample: SampleFunction, x_p: f64| {
        let fake = Fake {
            problem: problem(),
            analysed_um,
            sample,
        };
        let x = [x_p, X[1], X[2], X[3], X[4], X[5]];
        let wanted = problem().design(&x, problem().base());
        compute(&fake, &design(4..6), &Source::Design(wanted))
    };
    let good: SampleFunction = || Ok(1.0);
    assert!(matches!(of(1.0, good, 0.2), Ok(Output::Design { .. })));
    for (output, reason) in [
        (of(1.0, good, 0.95), "simulator-panic: no such tooth"),
        (of(f64::NAN, good, 0.2), "not-a-number: "),
    ] {
        assert!(
            matches!(&output, Ok(Output::Refused(text)) if text.starts_with(reason)),
            "{output:?}"
        );
    }
    let failures: [(SampleFunction, &str); 6] = [
        (|| panic!("out of teeth"), "simulator-panic: out of teeth"),
        (|| Ok(f64::NAN), "delta_ste_um is NaN"),
        (|| Ok(f64::INFINITY), "delta_ste_um is inf"),
        (|| Ok(-5.0), "delta_ste_um is -5e0 µm"),
        (
            || Ok(1e308),
            "delta_ste_um is 1e308 µm, but a ΔSTE lies between 0 and 1e6 µm",
        ),
        (|| Err(NoAnswer::Failed("licence".to_owned())), "licence"),
    ];
    for (sample, expected) in failures {
        let error = of(1.0, sample, 0.2).unwrap_err();
        let expected = format!("design-3, sample 4: {expected}");
        assert!(error.starts_with(&expected), "{error}");
    }
    let error = of(-5.0, good, 0.2).unwrap_err();
    assert!(
        error.starts_with("design-3: ΔSTE unworn is -5e0 µm"),
        "{error}"
    );
}

/// Known responses are an answer without an analysis, which would fail here.
#[test]
fn known_responses_take_the_place_of_the_analyses() {
    let fake = Fake {
        problem: problem(),
        analysed_um: f64::NAN,
        sample: || Ok(1.0),
    };
    let Ok(Output::Design { responses, .. }) =
        compute(&fake.problem, &design(0..1), &Source::Design(asked()))
    else {
        panic!("the design is simulable");
    };
    let source = Source::Analysed {
        design: asked(),
        responses: responses.clone(),
    };
    let expected = Output::Design {
        responses,
        ruled_out: None,
        samples: Samples::new(1, vec![1.0; 2]).unwrap(),
    };
    assert_eq!(compute(&fake, &design(4..6), &source), Ok(expected));
    // The numbers of a stream do not depend on what is known about it.
    let inputs = Inputs::new(fake.problem.campaign(), None);
    let generation = |source: &Source| inputs.generation(StreamId::design(3), source);
    assert_eq!(generation(&source), generation(&Source::Design(asked())));
}

#[test]
fn samples_of_the_campaign_file_take_the_place_of_the_programs_first_ones() {
    let mut campaign = problem().campaign().clone();
    campaign.doe.samples = vec![vec![], vec![], vec![], vec![vec![7.0]; 5]];
    let fake = Fake {
        problem: Problem::new(campaign),
        analysed_um: 1.0,
        sample: || Ok(1.0),
    };
    let of = |unit: &Unit, source| drawn(compute(&fake, unit, &source).ok());
    let own = of(&design(3..7), Source::Design(asked()));
    assert_eq!(own, [7.0, 7.0, 1.0, 1.0]);
    let verified = of(&unit(StreamId::point(3), 0..2), Source::Point(asked()));
    assert_eq!(verified, [1.0, 1.0]);
}

#[test]
fn responses_of_the_campaign_file_take_the_place_of_the_programs_analysis() {
    let text = include_str!("../../../../campaigns/cantilever/campaign.toml");
    let own = "points = [[0.5, 1.0], [0.8, 4.0]]\nresponses = [[1.0, 9.0], [40.0, 0.1]]";
    let text = text.replacen("[doe]\n", &format!("[doe]\n{own}\n"), 1);
    let text = text.replacen("low = 1.0", "low = 0.5", 1);
    let text = text.replacen("[sampling]\n", "[sampling]\nskip_violation = 0.5\n", 1);
    let fake = Fake {
        problem: Problem::new(crate::Campaign::parse("beam.toml", &text).unwrap()),
        analysed_um: f64::NAN,
        sample: || Ok(1.0),
    };
    let of = |index: u32, x: &[f64]| {
        let source = Source::Design(fake.problem.design(x, fake.problem.base()));
        let unit = unit(StreamId::design(index), 0..2);
        match compute(&fake, &unit, &source).unwrap() {
            Output::Design {
                responses,
                ruled_out,
                samples,
            } => (responses, ruled_out.is_some(), samples.len()),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(of(0, &[0.5, 1.0]), (vec![1.0, 9.0], false, 2));
    assert_eq!(of(1, &[0.8, 4.0]), (vec![40.0, 0.1], true, 0));
    assert_eq!(samples_not_asked(&fake.problem, 0), 0);
    assert_eq!(samples_not_asked(&fake.problem, 1), u32::MAX);
    assert_eq!(samples_not_asked(&fake.problem, 2), 0);
}

/// The failure of a machine names no design, and no failed sample stands for it.
#[test]
fn a_machine_that_cannot_simulate_is_told_from_a_design_that_fails() {
    let fake = |sample| Fake {
        problem: problem(),
        analysed_um: 1.0,
        sample,
    };
    let failure = |sample| {
        let unit = design(4..6);
        let computed = compute_until(&fake(sample), &unit, &Source::Design(asked()), &|_| true);
        computed
            .failure
            .map(|failure| (failure.by_machine, failure.error))
    };
    let machine = failure(|| Err(NoAnswer::Machine("the disk is full".to_owned())));
    assert_eq!(machine, Some((true, "the disk is full".to_owned())));
    let program = failure(|| Err(NoAnswer::Failed("licence".to_owned())));
    let of_design = "design-3, sample 4: licence".to_owned();
    assert_eq!(program, Some((false, of_design)));
}

/// Every input that values depend on changes the generation, and no other does.
#[test]
fn a_generation_is_the_digest_of_what_values_depend_on() {
    let campaign = problem().campaign().clone();
    let inputs = Inputs::new(&campaign, Some("abc"));
    let source = Source::Point(asked());
    let stream = StreamId::point(2);
    let mut larger = campaign.clone();
    larger.doe.designs += 1;
    larger.verify.half_width = Some(1e-3);
    larger.sampling.samples_per_design += 1;
    assert_eq!(Inputs::new(&larger, Some("abc")), inputs);
    let mut seeded = campaign.clone();
    seeded.seed += 1;
    let mut moved = asked().values().to_vec();
    moved[9] += 1e-9;
    let moved = Design::new(moved);
    let run = |start, model: &str| Run {
        approach: Approach::Kriging,
        start,
        base: problem().base().clone(),
        models: vec![model.into()],
        from: None,
    };
    let of_run = |run: Run| inputs.generation(run.stream(), &Source::Run(run));
    let generations = [
        inputs.generation(stream, &source),
        inputs.generation(StreamId::point(3), &source),
        inputs.generation(StreamId::design(2), &source),
        inputs.generation(stream, &Source::Point(moved)),
        Inputs::new(&campaign, Some("abd")).generation(stream, &source),
        Inputs::new(&seeded, Some("abc")).generation(stream, &source),
        of_run(run(0, "a")),
        of_run(run(1, "a")),
        of_run(run(0, "b")),
    ];
    let distinct: BTreeSet<Generation> = generations.into_iter().collect();
    assert_eq!(distinct.len(), generations.len());
    assert_eq!(run(7, "a").stream().kind, Kind::Run);
    assert_eq!(run(7, "a").stream().run_parts(), (3, 7));
}
