//! Compares kriging with enrichment with the other approaches, in one process.
//!
//! `cargo run --release -p studies --example enrichment -- [--campaign campaigns/paper.toml] [--seeds 1..=10] [--teeth
//! 23,27] [--torque 300] [--tooth-model weber-banaschek] [--noise own|smoothed] [--criterion NAME] [--without
//! kriging,direct,…] [--trace]`
//!
//! For each seed, on the problem of the campaign file, whose numbers of teeth (pinion, mate), pinion torque in
//! Nm and tooth model the command line may replace:
//!
//! - the paper's four approaches, from the campaign's own functions: 3000 designs × 30 samples, three
//!   runs of 12 000 analyses each;
//! - kriging with enrichment: a Latin hypercube of 600 designs and rounds of infill, 36 samples at a
//!   time and at most 18 000 in all, which is 20 % of 3000 × 30. ΔSTE with Archard's wear, which the
//!   constraint of the pressure takes anyway, is the baseline that one of the models adds to;
//! - the direct search: CMA-ES on P90 from 30 samples with common random numbers, 36 000 analyses.
//!
//! Every winner gets 20 000 verification samples, all with the same random numbers. One JSON object per seed and method
//! goes to standard output, the table in Markdown after them.
//!
//! **Calls.** `worn` counts analyses with random wear, to which the 20 % refer. `plain` counts analyses without random
//! wear: one without wear, and one more with Archard's. The enrichment and the direct search spend them on the exact
//! constraint of the pressure, where the geometry alone does not rule a design out; the paper's approaches spend them
//! on every design they try. The table's last column is the cost of both at the paper's 2 s a call.

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

mod campaign;
mod table;

use std::sync::atomic::{AtomicU64, Ordering};

use cmaes::Bounds;
use enrich::{
    Criterion, Decision, ExactCriteria, Infill, Options, RoundRecord, SampledDesign, State, decide,
};
use kriging::{Data, Surrogate};
use problem::formulation::gears::Gears;
use problem::formulation::{Approach, Design, Problem};
use problem::optimise;
use problem::task::VERIFICATION;
use rustix::time::{ClockId, clock_gettime};
use stats::streams::{Purpose, stream};
use studies::direct::{self, Search, Start};

use campaign::campaign_of;
use table::table;

/// Number of designs of the DoE.
const DESIGNS: usize = 600;
/// Samples of each design.
const SAMPLES: u32 = 36;
/// Constraint violation above which a design is not sampled: so far out it carries little
/// information about the response within the constraints.
const REACH: f64 = 1.0;
/// Analyses with random wear in all.
const BUDGET: u32 = 18_000;
const VERIFY: u32 = 20_000;
/// CPU seconds of a call of the paper's simulator.
const PAPER_SECONDS: f64 = 2.0;

fn gears(problem: &Problem) -> &Gears {
    problem.gears().expect("a gear campaign")
}

/// One method's result for one seed.
struct Row {
    seed: u64,
    method: String,
    x: Vec<f64>,
    p90: f64,
    interval: (f64, f64),
    /// The model's prediction and its 95 % interval.
    predicted: Option<(f64, f64, f64)>,
    worn: u64,
    plain: u64,
    cpu: f64,
}

fn cpu_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// The first `count` samples of ΔSTE in µm, each from its own random stream.
fn draw(
    problem: &Problem,
    pair: &gear::Pair,
    purpose: Purpose,
    number: u64,
    count: u32,
) -> Vec<f64> {
    let seed = problem.campaign().seed;
    let mut sampler = gears(problem).sampler(pair);
    (0..count)
        .map(|index| sampler.draw(&mut stream(seed, purpose, number, u64::from(index))))
        .collect()
}

fn verify(problem: &Problem, design: &Design) -> (f64, (f64, f64)) {
    let pair = gears(problem)
        .pair(design)
        .expect("a winner can be simulated");
    let (purpose, number) = VERIFICATION;
    let samples = draw(problem, &pair, purpose, number, VERIFY);
    let sampling = &problem.campaign().sampling;
    let verified = sampling.verified(&samples).expect("finite samples");
    let interval = verified.interval.expect("samples enough for an interval");
    (verified.value, interval)
}

/// The exact constraints and baseline of a design; the analyses are added to `plain`.
fn exact(problem: &Problem, base: &Design, x: &[f64], plain: &AtomicU64) -> Option<ExactCriteria> {
    let (known, took) = stages::infill::known(problem, &problem.design(x, base))?;
    plain.fetch_add(took, Ordering::Relaxed);
    Some(known)
}

/// [`exact`] with Archard's analysis even if the geometry alone rules a design out.
fn sampled(
    problem: &Problem,
    base: &Design,
    x: &[f64],
    plain: &AtomicU64,
) -> Option<ExactCriteria> {
    let found = exact(problem, base, x, plain)?;
    if found.baseline > 0.0 {
        return Some(found);
    }
    let pair = gears(problem).pair(&problem.design(x, base)).ok()?;
    plain.fetch_add(2, Ordering::Relaxed);
    let baseline = pair.archard(gears(problem).wear()).analysis.delta_ste_um;
    Some(ExactCriteria { baseline, ..found })
}

/// Response and variance of the first `count` samples of the design with stream number `number`.
fn response(
    problem: &Problem,
    base: &Design,
    x: &[f64],
    number: u64,
    count: u32,
) -> Option<(f64, f64)> {
    let pair = gears(problem).pair(&problem.design(x, base)).ok()?;
    let samples = draw(problem, &pair, Purpose::Wear, number, count);
    let estimate = problem.campaign().sampling.estimate(&samples).ok()?.chosen;
    Some((estimate.value, estimate.variance))
}

/// The four approaches of the paper.
fn paper(problem: &Problem, seed: u64, without: &str, rows: &mut Vec<Row>) {
    let base = problem.base().clone();
    let campaign = problem.campaign();
    let begun = cpu_seconds();
    let n = campaign.doe.designs as usize;
    let options = doe::Options {
        seed,
        ..doe::Options::default()
    };
    let with_doe = !without.contains("kriging") || !without.contains("best-of-doe");
    let mut points: Vec<(Vec<f64>, f64, f64, f64)> = Vec::new();
    let mut worn = 0;
    if with_doe {
        let design = doe::maximin(n, problem.dimension(), &options).expect("a proper size");
        for i in 0..n {
            let x = problem.free_point(design.point(i));
            let count = campaign.sampling.samples_per_design;
            if let Some((p90, variance)) = response(problem, &base, &x, i as u64, count) {
                worn += u64::from(count);
                let known = exact(problem, &base, &x, &AtomicU64::new(0));
                let violation = known.map_or(f64::INFINITY, |known| known.violation);
                points.push((x, p90, variance, violation));
            }
        }
    }
    let doe_cpu = cpu_seconds() - begun;
    let doe_plain = (n + points.len()) as u64;
    let best = points
        .iter()
        .filter(|p| p.3 <= 0.0)
        .min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some(best) = best {
        let (p90, interval) = verify(problem, &problem.design(&best.0, &base));
        rows.push(Row {
            seed,
            method: "best-of-doe".to_owned(),
            x: best.0.clone(),
            p90,
            interval,
            predicted: None,
            worn,
            plain: doe_plain,
            cpu: doe_cpu,
        });
    }
    for approach in [Approach::Nominal, Approach::Baseline, Approach::Kriging] {
        if without.contains(approach.name()) {
            continue;
        }
        let begun = cpu_seconds();
        let model = (approach == Approach::Kriging).then(|| {
            let x: Vec<f64> = points.iter().flat_map(|p| p.0.iter().copied()).collect();
            let y: Vec<f64> = points.iter().map(|p| p.1).collect();
            let own: Vec<f64> = points.iter().map(|p| p.2).collect();
            let settings = campaign.kriging.settings(seed);
            let samples = vec![f64::from(campaign.sampling.samples_per_design); own.len()];
            let freedom = campaign.sampling.degrees_of_freedom();
            let d = problem.dimension();
            let noise = settings.noise;
            let noise_variance = noise.variances(&x, d, own, &samples, freedom, seed);
            let noise_variance = noise_variance.expect("some two thousand designs");
            let data = Data {
                x: &x,
                d,
                y: &y,
                noise_variance: &noise_variance,
            };
            Surrogate::fit(&data, &settings).expect("some two thousand designs")
        });
        let json = model
            .as_ref()
            .map(|model| model.to_json().expect("a finite model"));
        let mut plain = 0;
        let mut best: Option<(f64, Design)> = None;
        for start in 0..campaign.optimise.starts {
            let run = problem::task::Run {
                approach,
                start,
                base: base.clone(),
                models: json.as_deref().map(Into::into).into_iter().collect(),
                from: None,
            };
            let run = optimise::run(problem, &run).expect("a start that can be simulated");
            plain += run.simulator_calls;
            if let Some(found) = run.best
                && best
                    .as_ref()
                    .is_none_or(|(value, _)| found.criterion < *value)
            {
                best = Some((found.criterion, found.design));
            }
        }
        let is_kriging = approach == Approach::Kriging;
        let cpu = cpu_seconds() - begun + if is_kriging { doe_cpu } else { 0.0 };
        let Some((_, design)) = best else { continue };
        let x = problem.free_values(&design);
        let predicted = model.map(|model| {
            let p = model.predict_many(&x).expect("one point")[0];
            let half = 1.96 * p.variance.sqrt();
            (p.mean, p.mean - half, p.mean + half)
        });
        let (p90, interval) = verify(problem, &design);
        rows.push(Row {
            seed,
            method: approach.name().to_owned(),
            x,
            p90,
            interval,
            predicted,
            worn: if is_kriging { worn } else { 0 },
            plain: plain + if is_kriging { doe_plain } else { 0 },
            cpu,
        });
    }
}

/// Kriging with enrichment.
fn enriched(problem: &Problem, seed: u64, criterion: Criterion, trace: bool) -> Option<Row> {
    let base = problem.base().clone();
    let begun = cpu_seconds();
    let ranges = problem.free_ranges().map(|[low, high]| (low, high));
    let bounds = Bounds::new(ranges.collect::<Vec<_>>()).expect("the campaign's bounds are proper");
    let design = doe::maximin(
        DESIGNS,
        problem.dimension(),
        &doe::Options {
            seed,
            ..doe::Options::default()
        },
    )
    .expect("a proper size");
    let mut state = State::default();
    // The stream number of each sampled design; those of the infill follow those of the DoE.
    let mut numbers: Vec<u64> = Vec::new();
    let mut next = DESIGNS as u64;
    let mut worn = 0_u32;
    let plain = AtomicU64::new(0);
    for i in 0..DESIGNS {
        let x = problem.free_point(design.point(i));
        let Some(known) = sampled(problem, &base, &x, &plain) else {
            continue;
        };
        if known.violation > REACH {
            continue;
        }
        let number = i as u64;
        let found = response(problem, &base, &x, number, SAMPLES);
        let (p90, variance) = found.expect("it was simulated a moment ago");
        worn += SAMPLES;
        numbers.push(number);
        state.sampled.push(SampledDesign {
            x,
            samples: SAMPLES,
            response: p90,
            variance,
            violation: known.violation,
            baseline: known.baseline,
        });
    }
    let standard = Options::new(bounds.clone());
    let options = |left: u32| Options {
        seed,
        criterion,
        noise: problem.campaign().kriging.noise.unwrap_or(standard.noise),
        batch: 24,
        delta_um: 0.003,
        samples_left: left,
        search_evaluations: stages::infill::SEARCH_EVALUATIONS,
        fit_starts: stages::infill::FIT_STARTS,
        samples_new: SAMPLES,
        samples_more: SAMPLES,
        ..standard.clone()
    };
    let known = |x: &[f64]| exact(problem, &base, x, &plain);
    let decision: Decision = loop {
        let decision = decide(&state, &options(BUDGET - worn), &known).expect("sound rows");
        if trace {
            let best = decision.recommendation.as_ref();
            println!(
                "# seed {seed} round {} designs {} worn {worn} best {:?} expects {:.4?} cpu {:.1} {:?} {:?}",
                decision.round,
                state.sampled.len(),
                best.map(|b| (b.predicted, b.half_width(), state.sampled[b.design].samples)),
                decision.expected_improvement,
                cpu_seconds() - begun,
                decision.stop,
                decision.notes,
            );
        }
        if decision.stop.is_some() {
            break decision;
        }
        let mut failed = 0;
        for infill in &decision.infill {
            let (index, samples) = match infill {
                Infill::New { x, samples, .. } => {
                    let known = known(x).unwrap_or(ExactCriteria::from(f64::INFINITY));
                    numbers.push(next);
                    next += 1;
                    state.sampled.push(SampledDesign {
                        x: x.clone(),
                        samples: 0,
                        response: f64::NAN,
                        variance: 0.0,
                        violation: known.violation,
                        baseline: known.baseline,
                    });
                    (state.sampled.len() - 1, *samples)
                }
                Infill::More {
                    design, samples, ..
                } => (*design, *samples),
            };
            let count = state.sampled[index].samples + samples;
            worn += samples;
            let x = state.sampled[index].x.clone();
            match response(problem, &base, &x, numbers[index], count) {
                Some((p90, variance)) => {
                    let row = &mut state.sampled[index];
                    row.samples = count;
                    row.response = p90;
                    row.variance = variance;
                }
                None => failed += 1,
            }
        }
        state.rounds.push(RoundRecord {
            expected_improvement: decision.expected_improvement,
            asked: decision.infill.len() as u32,
            failed,
        });
    };
    let cpu = cpu_seconds() - begun;
    let best = decision.recommendation?;
    let x = best.x.clone();
    let (p90, interval) = verify(problem, &problem.design(&x, &base));
    Some(Row {
        seed,
        method: criterion.to_string(),
        x,
        p90,
        interval,
        predicted: Some((best.predicted, best.interval.0, best.interval.1)),
        worn: u64::from(worn),
        plain: plain.load(Ordering::Relaxed),
        cpu,
    })
}

/// CMA-ES on P90 from 30 samples, the same random numbers at every design.
fn searched(problem: &Problem, seed: u64) -> Option<Row> {
    let base = problem.base().clone();
    let begun = cpu_seconds();
    let runs: Vec<Search> = (0..problem.campaign().optimise.starts)
        .map(|start| {
            let start = Start {
                number: 0,
                start,
                base: &base,
                from: None,
            };
            direct::search(problem, start).expect("a validated campaign")
        })
        .collect();
    let cpu = cpu_seconds() - begun;
    let found = runs.iter().filter_map(|run| run.best.as_ref());
    let best = found.min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
    let design = &best.design;
    let (p90, interval) = verify(problem, design);
    Some(Row {
        seed,
        method: "direct".to_owned(),
        x: problem.free_values(design),
        p90,
        interval,
        predicted: None,
        worn: runs.iter().map(|run| run.worn_calls).sum(),
        plain: runs.iter().map(|run| run.plain_calls).sum(),
        cpu,
    })
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
    let without = value("--without").unwrap_or_default();
    let named = value("--criterion");
    let criterion = Criterion::ALL
        .into_iter()
        .find(|c| named.as_ref() == Some(&c.to_string()))
        .unwrap_or_default();
    let trace = arguments.iter().any(|a| a == "--trace");

    let file = value("--campaign").unwrap_or_else(|| "campaigns/paper.toml".to_owned());
    let campaign = campaign_of(&file, value);

    let mut rows = Vec::new();
    let mut printed = 0;
    for seed in number(first)..=number(last) {
        let mut campaign = campaign.clone();
        campaign.seed = seed;
        let problem = Problem::new(campaign);
        rows.extend(enriched(&problem, seed, criterion, trace));
        if !without.contains("direct") {
            rows.extend(searched(&problem, seed));
        }
        paper(&problem, seed, &without, &mut rows);
        for row in &rows[printed..] {
            let json = serde_json::json!({
                "seed": row.seed, "method": row.method, "x": row.x, "p90_um": row.p90,
                "interval_um": row.interval, "predicted_um": row.predicted,
                "worn": row.worn, "plain": row.plain, "cpu_seconds": row.cpu,
            });
            println!("{json}");
        }
        printed = rows.len();
    }
    table(&rows, &criterion.to_string());
}
