//! Rounds as a caller sees them, on cheap functions with known optima. The stability atlas of the crate `lab` has
//! the responses on which a round can hardly decide.

mod convergence;
mod refusals;
mod stopping;

use cmaes::Bounds;
use enrich::{Decision, Infill, Options, RoundRecord, SampledDesign, State, decide};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use stats::streams::{Purpose, stream};

/// A problem to enrich: response without noise, noise of one sample, exact violation.
struct Problem {
    bounds: Bounds,
    response: fn(&[f64]) -> f64,
    noise: f64,
    violation: fn(&[f64]) -> Option<f64>,
}

/// The mean of `samples` noisy observations of design `number`.
fn observe(problem: &Problem, x: &[f64], number: usize, samples: u32) -> (f64, f64) {
    let mut rng = stream(5, Purpose::Test, number as u64, 0);
    let noise: f64 = (0..samples)
        .map(|_| {
            let z: f64 = StandardNormal.sample(&mut rng);
            z
        })
        .sum();
    let k = f64::from(samples);
    let response = (problem.response)(x) + problem.noise * noise / k;
    (response, problem.noise * problem.noise / k)
}

/// A state of `n` random designs with `samples` each.
fn sampled(problem: &Problem, n: usize, samples: u32) -> State {
    let mut rng = stream(6, Purpose::Test, n as u64, 0);
    let mut state = State::default();
    for number in 0..n {
        let intervals = problem.bounds.intervals().iter();
        let x: Vec<f64> = intervals
            .map(|(low, high)| low + (high - low) * rng.random::<f64>())
            .collect();
        add(problem, &mut state, x, number, samples);
    }
    state
}

fn add(problem: &Problem, state: &mut State, x: Vec<f64>, number: usize, samples: u32) {
    let (response, variance) = observe(problem, &x, number, samples);
    state.sampled.push(SampledDesign {
        violation: (problem.violation)(&x).unwrap_or(f64::INFINITY),
        x,
        samples,
        response,
        variance,
        baseline: 0.0,
    });
}

/// Carries out the observations that a round asks for.
fn carry_out(problem: &Problem, state: &mut State, decision: &Decision) {
    for infill in &decision.infill {
        match infill {
            Infill::New { x, samples, .. } => {
                let number = state.sampled.len();
                add(problem, state, x.clone(), number, *samples);
            }
            Infill::More {
                design, samples, ..
            } => {
                let total = state.sampled[*design].samples + samples;
                let x = state.sampled[*design].x.clone();
                let (response, variance) = observe(problem, &x, *design, total);
                let row = &mut state.sampled[*design];
                row.samples = total;
                row.response = response;
                row.variance = variance;
            }
        }
    }
    state.rounds.push(RoundRecord {
        expected_improvement: decision.expected_improvement,
        asked: decision.infill.len() as u32,
        failed: 0,
    });
}

/// Runs rounds until the enrichment stops or `most` are done.
fn enrich(problem: &Problem, state: &mut State, options: &Options, most: usize) -> Decision {
    loop {
        let decision = decide(state, options, &problem.violation).unwrap();
        if decision.stop.is_some() || state.rounds.len() >= most {
            return decision;
        }
        carry_out(problem, state, &decision);
    }
}

fn options(problem: &Problem) -> Options {
    Options {
        batch: 6,
        fit_starts: 3,
        search_evaluations: 200,
        ..Options::new(problem.bounds.clone())
    }
}

fn unit(d: usize) -> Bounds {
    Bounds::unit(d).unwrap()
}
