//! Enrichment on responses that are flat, cliff-edged, noise, or never feasible.

use cmaes::Bounds;
use enrich::{
    Decision, Infill, Note, Options, Reason, RoundRecord, SampledDesign, State, Stop, decide,
};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use stats::streams::{Purpose, stream};

use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 8] = [
    Entry {
        id: "enrichment-flat",
        title: "A flat response",
        input: "20 designs in 3 variables whose responses are all 100 µm",
        instead: "The round fills space and recommends nothing.",
        check: flat,
        ..Entry::blank(Method::Enrichment)
    },
    Entry {
        id: "enrichment-cliff",
        title: "A cliff beside the optimum",
        input: "1 + x₁ + x₂ above x₁ = 0.3 and 10 µm more below it, 40 designs in 2 variables, up to 8 rounds",
        instead: "A model of the nearest designs replaces the global one where it predicts better. The recommended design \
                  is a sampled one, never a prediction across the cliff.",
        check: cliff,
        ..Entry::blank(Method::Enrichment)
    },
    Entry {
        id: "enrichment-noise-only",
        title: "Noise without a signal",
        input: "A response of 10 µm everywhere, 30 samples of standard deviation 5 µm at each of 40 designs, two \
                rounds",
        instead: "The round continues with a nearly constant model, whose interval covers the truth.",
        check: noise_only,
        ..Entry::blank(Method::Enrichment)
    },
    Entry {
        id: "enrichment-nothing-feasible",
        title: "No feasible design",
        input: "Exact constraints that no design of the box satisfies",
        instead: "The enrichment ends.",
        check: nothing_feasible,
        ..Entry::blank(Method::Enrichment)
    },
    Entry {
        id: "enrichment-not-numbers",
        title: "Responses that are NaN",
        input: "30 designs of which one has NaN, and 20 designs that all have NaN",
        instead: "NaN counts as a failure: new designs keep a distance of 1 % of a range. Without any number, the round \
                  fills space.",
        check: not_numbers,
        ..Entry::blank(Method::Enrichment)
    },
    Entry {
        id: "enrichment-only-failures",
        title: "Rounds in which everything fails",
        input: "Two rounds in a row whose infill points all failed",
        instead: "The enrichment ends and recommends a design sampled earlier.",
        check: only_failures,
        ..Entry::blank(Method::Enrichment)
    },
    Entry {
        id: "enrichment-small-budget",
        title: "A budget below the cost of a new design",
        input: "20 samples left when a new design takes 30; a flat response with 50 samples left when a new design takes \
                100",
        instead: "The enrichment ends because of its budget, and says neither that it converged nor that nothing is \
                  feasible.",
        check: small_budget,
        ..Entry::blank(Method::Enrichment)
    },
    Entry {
        id: "enrichment-repeated",
        title: "Infill that repeats a design",
        input: "A feasible set of one design, which is sampled already; entries with the same variables as others",
        instead: "The design gets more samples. Entries with the same variables are merged.",
        check: repeated,
        ..Entry::blank(Method::Enrichment)
    },
];

/// A problem to enrich.
struct Scene {
    d: usize,
    /// The response without noise.
    response: fn(&[f64]) -> f64,
    /// Standard deviation of the noise of one sample.
    noise: f64,
    violation: fn(&[f64]) -> f64,
}

const FLAT: Scene = Scene {
    d: 3,
    response: |_| 100.0,
    noise: 0.0,
    violation: |_| 0.0,
};

const SLOPE: Scene = Scene {
    response: |x| 1.0 + x[0],
    noise: 0.1,
    ..FLAT
};

impl Scene {
    fn options(&self) -> Result<Options, cmaes::Error> {
        Ok(Options {
            batch: 6,
            fit_starts: 3,
            search_evaluations: 200,
            ..Options::new(Bounds::unit(self.d)?)
        })
    }

    /// `designs` random designs with 30 samples each.
    fn state(&self, designs: usize) -> State {
        let mut rng = stream(24, Purpose::Test, designs as u64, 0);
        let mut state = State::default();
        for _ in 0..designs {
            let x = (0..self.d).map(|_| rng.random()).collect();
            self.add(&mut state, x, 30);
        }
        state
    }

    fn add(&self, state: &mut State, x: Vec<f64>, samples: u32) {
        let number = state.sampled.len();
        let (response, variance) = self.observe(&x, number, samples);
        state.sampled.push(SampledDesign {
            violation: (self.violation)(&x),
            x,
            samples,
            response,
            variance,
            baseline: 0.0,
        });
    }

    /// The mean of `samples` noisy observations of design `number`, and its variance.
    fn observe(&self, x: &[f64], number: usize, samples: u32) -> (f64, f64) {
        let mut rng = stream(24, Purpose::Test, number as u64, 1);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let k = f64::from(samples);
        let sum: f64 = (0..samples).map(|_| normal()).sum();
        (
            (self.response)(x) + self.noise * sum / k,
            self.noise * self.noise / k,
        )
    }

    fn decide(&self, state: &State, options: &Options) -> Result<Decision, enrich::Error> {
        decide(state, options, &|x: &[f64]| Some((self.violation)(x)))
    }

    /// Makes the observations that a round requests.
    fn carry_out(&self, state: &mut State, decision: &Decision) {
        for infill in &decision.infill {
            match infill {
                Infill::New { x, samples, .. } => self.add(state, x.clone(), *samples),
                Infill::More {
                    design, samples, ..
                } => {
                    let total = state.sampled[*design].samples + samples;
                    let x = state.sampled[*design].x.clone();
                    let (response, variance) = self.observe(&x, *design, total);
                    let row = &mut state.sampled[*design];
                    (row.samples, row.response, row.variance) = (total, response, variance);
                }
            }
        }
        state.rounds.push(RoundRecord {
            expected_improvement: decision.expected_improvement,
            asked: decision.infill.len() as u32,
            failed: 0,
        });
    }
}

/// The new designs of a round.
fn new_designs(decision: &Decision) -> impl Iterator<Item = (&[f64], Reason)> {
    decision.infill.iter().filter_map(|infill| match infill {
        Infill::New { x, reason, .. } => Some((x.as_slice(), *reason)),
        Infill::More { .. } => None,
    })
}

fn fills_space(decision: &Decision) -> bool {
    let mut reasons = new_designs(decision).map(|(_, reason)| reason);
    !decision.infill.is_empty() && reasons.all(|reason| reason == Reason::SpaceFilling)
}

fn flat(outcome: &mut Outcome) -> Result<(), EntryError> {
    let decision = FLAT.decide(&FLAT.state(20), &FLAT.options()?)?;
    outcome.warned(&decision.notes, &["Plateau"]);
    let is_whole = decision.infill.len() == FLAT.options()?.batch;
    outcome.holds(
        "a whole batch of new designs fills space",
        is_whole && fills_space(&decision),
    );
    outcome.holds("nothing is recommended", decision.recommendation.is_none());
    let improvement = decision.expected_improvement;
    outcome.holds("no improvement is expected", improvement.is_none());
    Ok(())
}

fn cliff(outcome: &mut Outcome) -> Result<(), EntryError> {
    let scene = Scene {
        d: 2,
        response: |x| 1.0 + x[0] + x[1] + if x[0] < 0.3 { 10.0 } else { 0.0 },
        ..SLOPE
    };
    let mut state = scene.state(40);
    let options = scene.options()?;
    let mut last = scene.decide(&state, &options)?;
    for _ in 0..8 {
        if last.stop.is_some() {
            break;
        }
        scene.carry_out(&mut state, &last);
        last = scene.decide(&state, &options)?;
    }
    outcome.warned(&last.notes, &[]);
    outcome.warned(&last.stop, &[]);
    let best = last.recommendation.ok_or("nothing is recommended")?;
    let truth = (scene.response)(&best.x);
    // The least response is 1.3 µm, on the edge.
    outcome.at_most(
        "response of the recommended design above the least",
        truth - 1.3,
        "µm",
        0.2,
    );
    let error = (best.predicted - truth).abs();
    outcome.at_most(
        "error of its prediction in half-widths",
        error / best.half_width(),
        "",
        2.0,
    );
    outcome.figure(
        "samples taken",
        state.sampled.iter().map(|s| f64::from(s.samples)).sum(),
        "",
    );
    Ok(())
}

fn noise_only(outcome: &mut Outcome) -> Result<(), EntryError> {
    let scene = Scene {
        response: |_| 10.0,
        noise: 5.0,
        ..FLAT
    };
    let mut state = scene.state(40);
    let options = scene.options()?;
    let first = scene.decide(&state, &options)?;
    outcome.warned(&first.notes, &["NoStructure"]);
    scene.carry_out(&mut state, &first);
    let second = scene.decide(&state, &options)?;
    let best = second.recommendation.ok_or("nothing is recommended")?;
    let error = (best.predicted - 10.0).abs();
    outcome.at_most(
        "error of the recommended prediction in half-widths",
        error / best.half_width(),
        "",
        2.0,
    );
    outcome.figure("half-width of its interval", best.half_width(), "µm");
    outcome.holds("two rounds of noise do not converge", second.stop.is_none());
    Ok(())
}

fn nothing_feasible(outcome: &mut Outcome) -> Result<(), EntryError> {
    let scene = Scene {
        violation: |x| 1.0 + x[1],
        ..SLOPE
    };
    let decision = scene.decide(&scene.state(30), &scene.options()?)?;
    outcome.warned(&decision.notes, &["NoFeasibleDesign"]);
    outcome.warned(&decision.stop, &["NothingFeasible"]);
    outcome.holds("nothing is recommended", decision.recommendation.is_none());
    Ok(())
}

fn not_numbers(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut state = SLOPE.state(30);
    state.sampled[3].response = f64::NAN;
    let bad = state.sampled[3].x.clone();
    let decision = SLOPE.decide(&state, &SLOPE.options()?)?;
    outcome.warned(&decision.notes, &["NotNumbers"]);
    outcome.holds(
        "one NaN does not prevent a recommendation",
        decision.recommendation.is_some(),
    );
    let nearest = new_designs(&decision)
        .map(|(x, _)| {
            x.iter()
                .zip(&bad)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max)
        })
        .fold(1.0, f64::min);
    outcome.at_least(
        "distance of new designs from the failure",
        nearest,
        "ranges",
        0.01,
    );
    let nothing = Scene {
        response: |_| f64::NAN,
        ..FLAT
    };
    let decision = nothing.decide(&nothing.state(20), &nothing.options()?)?;
    outcome.warned(&decision.notes, &["NoModel"]);
    let counts_all = decision.notes.contains(&Note::NotNumbers { entries: 20 });
    outcome.holds("all 20 entries are counted", counts_all);
    outcome.holds(
        "without any number, every new design fills space",
        fills_space(&decision),
    );
    Ok(())
}

fn only_failures(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut state = SLOPE.state(30);
    let options = SLOPE.options()?;
    for rounds in 1..=2 {
        let round = SLOPE.decide(&state, &options)?;
        let failed: Vec<Vec<f64>> = new_designs(&round).map(|(x, _)| x.to_vec()).collect();
        state.failed.extend(failed);
        state.rounds.push(RoundRecord {
            expected_improvement: Some(0.5),
            asked: 6,
            failed: 6,
        });
        let decision = SLOPE.decide(&state, &options)?;
        outcome.warned(&decision.notes, &["RoundFailed"]);
        outcome.warned(&decision.stop, &[]);
        let (sentence, stop) = match rounds {
            1 => ("the enrichment continues after the first round", None),
            _ => (
                "the enrichment ends after the second round",
                Some(Stop::OnlyFailures),
            ),
        };
        let asks = !decision.infill.is_empty();
        outcome.holds(sentence, decision.stop == stop && asks == stop.is_none());
        outcome.holds(
            "a design is still recommended",
            decision.recommendation.is_some(),
        );
    }
    Ok(())
}

fn small_budget(outcome: &mut Outcome) -> Result<(), EntryError> {
    let options = Options {
        samples_left: 20,
        ..SLOPE.options()?
    };
    let decision = SLOPE.decide(&SLOPE.state(30), &options)?;
    outcome.warned(&decision.stop, &["Budget"]);
    outcome.holds("a design is recommended", decision.recommendation.is_some());
    outcome.holds("no observation is requested", decision.infill.is_empty());
    let options = Options {
        samples_new: 100,
        samples_more: 10,
        samples_left: 50,
        ..FLAT.options()?
    };
    let decision = FLAT.decide(&FLAT.state(20), &options)?;
    let is_spent = decision.stop == Some(Stop::Budget { samples: 50 });
    outcome.holds("a flat response ends for the budget, too", is_spent);
    Ok(())
}

fn repeated(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut doubled = SLOPE.state(30);
    let copies = doubled.sampled[..5].to_vec();
    doubled.sampled.extend(copies);
    let decision = SLOPE.decide(&doubled, &SLOPE.options()?)?;
    outcome.warned(&decision.notes, &["Merged"]);
    let counts_all = decision.notes.contains(&Note::Merged { entries: 5 });
    outcome.holds("all five copies are merged", counts_all);
    let is_original = |design| design < 30;
    let recommended = decision.recommendation.map(|best| best.design);
    outcome.holds(
        "no copy is recommended",
        recommended.is_some_and(is_original),
    );

    let scene = Scene {
        d: 2,
        response: |x| 1.0 + x[0] + x[1],
        noise: 0.3,
        violation: |x| {
            let off = (x[0] - 0.25).abs().max((x[1] - 0.5).abs());
            if off < 1e-9 { 0.0 } else { off }
        },
    };
    let mut state = scene.state(20);
    scene.add(&mut state, vec![0.25, 0.5], 4);
    let options = Options {
        delta_um: 0.001,
        ..scene.options()?
    };
    for _ in 0..2 {
        let decision = scene.decide(&state, &options)?;
        let is_more = |infill: &Infill| matches!(infill, Infill::More { design: 20, .. });
        outcome.holds(
            "two rounds request samples of the one feasible design only",
            !decision.infill.is_empty() && decision.infill.iter().all(is_more),
        );
        scene.carry_out(&mut state, &decision);
    }
    Ok(())
}
