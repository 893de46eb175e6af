//! Enrichment on a noisy test function whose optimum is known.
//!
//! `cargo run --release -p enrich --example branin -- [--seeds 1..=10] [--criterion NAME] [--batch 12] [--fails 0.4]`
//!
//! The response is the 90th percentile of Y = f(x) + s(x) Z with Z standard normal, estimated from 36
//! samples a design. f is Branin's function, a standard of kriging-based optimisation under noise
//! (V. Picheny, T. Wagner, D. Ginsbourger, *A benchmark of kriging-based infill criteria for noisy
//! optimization*, Structural and Multidisciplinary Optimization 48 (2013) 607–626), whose three minima
//! are equal, 0.397887. The noise distinguishes them: s rises from 0.5 at the minimum (π, 2.275) towards
//! 2.5 far from it. So f and s are both least there, and so is the percentile: its minimum is
//! 0.397887 + 0.5 z with z = 1.281552, 1.038663, while at the two other minima of f it is 3.6.
//!
//! With `--fails` the simulation fails in that share of the box, at one side of which the optimum lies: to
//! the right of x = 4 at 0.4, and there below y = 3 at 0.08. Whether a design fails is known only when it
//! was asked for. The designs before the first round may fail, too.
//!
//! One row per seed goes to standard output: how far the recommended design lies above the optimum,
//! the prediction with its 95 % interval, samples, rounds and the reason to stop.

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

use std::f64::consts::PI;

use cmaes::Bounds;
use enrich::{
    Criterion, Decision, Infill, Options, RoundRecord, SampledDesign, State, Stop, decide,
};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use stats::streams::{Purpose, stream};

/// Number of designs before the first round.
const DESIGNS: usize = 20;
/// Samples of a design.
const SAMPLES: u32 = 36;
/// Samples in all.
const BUDGET: u32 = 6000;
/// Deviate of the 90th percentile.
const Z90: f64 = 1.281_551_565_544_600_4;
/// The minimum at which the noise is least.
const OPTIMUM: [f64; 2] = [PI, 2.275];
/// The value of f at [`OPTIMUM`].
const LEAST: f64 = 0.397_887_357_729_739;

fn branin(x: &[f64]) -> f64 {
    let valley = x[1] - 5.1 / (4.0 * PI * PI) * x[0] * x[0] + 5.0 / PI * x[0] - 6.0;
    valley * valley + 10.0 * (1.0 - 1.0 / (8.0 * PI)) * x[0].cos() + 10.0
}

/// Standard deviation of a sample.
fn noise(x: &[f64]) -> f64 {
    let squares = (x[0] - OPTIMUM[0]).powi(2) + (x[1] - OPTIMUM[1]).powi(2);
    0.5 + 2.0 * (1.0 - (-squares / 8.0).exp())
}

fn truth(x: &[f64]) -> f64 {
    branin(x) + Z90 * noise(x)
}

/// Percentile and variance from the first `samples` samples of design `number`.
fn response(seed: u64, number: usize, x: &[f64], samples: u32) -> (f64, f64) {
    let mut rng = stream(seed, Purpose::Test, number as u64, 1);
    let values: Vec<f64> = (0..samples)
        .map(|_| {
            let z: f64 = StandardNormal.sample(&mut rng);
            branin(x) + noise(x) * z
        })
        .collect();
    let percentile = stats::percentile_p90(&values).expect("36 finite samples");
    (percentile.p90, percentile.variance)
}

/// Whether the simulation of a design fails, in this share of the box.
fn fails(share: f64, x: &[f64]) -> bool {
    let width = 6.0;
    // The height of the box at a share of 0.4.
    let height = share * 15.0 * 15.0 / width;
    x[0] > 10.0 - width && x[1] < height
}

fn sample(seed: u64, state: &mut State, number: usize, samples: u32) {
    let row = &mut state.sampled[number];
    row.samples += samples;
    (row.response, row.variance) = response(seed, number, &row.x, row.samples);
}

fn add(seed: u64, state: &mut State, x: Vec<f64>) {
    state.sampled.push(SampledDesign {
        x,
        samples: 0,
        response: f64::NAN,
        variance: 0.0,
        violation: 0.0,
        baseline: 0.0,
    });
    sample(seed, state, state.sampled.len() - 1, SAMPLES);
}

/// Runs rounds until the enrichment stops. Returns the last decision, the samples taken and the number
/// of infill points that failed.
fn enriched(seed: u64, criterion: Criterion, batch: usize, share: f64) -> (Decision, u32, u32) {
    let bounds = Bounds::new(vec![(-5.0, 10.0), (0.0, 15.0)]).expect("a proper box");
    let mut state = State::default();
    let mut rng = stream(seed, Purpose::Test, 0, 0);
    for _ in 0..DESIGNS {
        let intervals = bounds.intervals().iter();
        let x = intervals.map(|(low, high)| low + (high - low) * rng.random::<f64>());
        let x: Vec<f64> = x.collect();
        if fails(share, &x) {
            state.failed.push(x);
        } else {
            add(seed, &mut state, x);
        }
    }
    let mut all_failed = 0;
    loop {
        let taken: u32 = state.sampled.iter().map(|row| row.samples).sum();
        let options = Options {
            seed,
            criterion,
            batch,
            samples_new: SAMPLES,
            samples_more: SAMPLES,
            samples_left: BUDGET.saturating_sub(taken),
            delta_um: 0.05,
            ..Options::new(bounds.clone())
        };
        let decision = decide(&state, &options, &|_: &[f64]| Some(0.0)).expect("sound rows");
        if decision.stop.is_some() {
            return (decision, taken, all_failed);
        }
        let mut failed = 0;
        for infill in &decision.infill {
            match infill {
                Infill::New { x, .. } if fails(share, x) => {
                    failed += 1;
                    state.failed.push(x.clone());
                }
                Infill::New { x, .. } => add(seed, &mut state, x.clone()),
                Infill::More {
                    design, samples, ..
                } => sample(seed, &mut state, *design, *samples),
            }
        }
        state.rounds.push(RoundRecord {
            expected_improvement: decision.expected_improvement,
            asked: decision.infill.len() as u32,
            failed,
        });
        all_failed += failed;
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).cloned()
    };
    let seeds = value("--seeds").unwrap_or_else(|| "1..=10".to_owned());
    let (first, last) = seeds.split_once("..=").unwrap_or((&seeds, &seeds));
    let number = |text: &str| -> u64 { text.parse().expect("--seeds takes FIRST..=LAST") };
    let criterion = value("--criterion").map_or(Criterion::default(), |name| {
        let mut all = Criterion::ALL.into_iter();
        all.find(|c| c.to_string() == name)
            .expect("--criterion takes the name of one")
    });
    let batch = value("--batch").map_or(12, |text| text.parse().expect("--batch takes a number"));

    let share = value("--fails").map_or(0.0, |text| text.parse().expect("--fails takes a share"));

    let optimum = LEAST + Z90 * noise(&OPTIMUM);
    println!(
        "| seed | above the optimum | predicted − true | 95 % half-width | samples | failed | rounds | end |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---|");
    let mut above = Vec::new();
    let (mut covered, mut all_failed) = (0, 0);
    for seed in number(first)..=number(last) {
        let (decision, samples, failed) = enriched(seed, criterion, batch, share);
        all_failed += failed;
        let best = decision.recommendation.expect("every design is feasible");
        let (regret, error) = (truth(&best.x) - optimum, best.predicted - truth(&best.x));
        let (low, high) = best.interval;
        covered += usize::from((low..=high).contains(&truth(&best.x)));
        above.push(regret);
        let end = match decision.stop {
            Some(Stop::Converged { .. }) => "converged",
            _ => "budget",
        };
        println!(
            "| {seed} | {regret:.4} | {error:+.4} | {:.4} | {samples} | {failed} | {} | {end} |",
            best.half_width(),
            decision.round,
        );
    }
    above.sort_by(f64::total_cmp);
    println!(
        "\n{}: {:.4} above the optimum in the median and {:.4} at most; the 95 % interval holds the true value \
         with {covered} of {} seeds. {all_failed} infill points failed.",
        criterion,
        above[above.len() / 2],
        above[above.len() - 1],
        above.len(),
    );
}
