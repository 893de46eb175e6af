//! What variance reduction gains on the gear model, and whether its own variances are right.
//!
//! `cargo run --release -p campaign --example variance_reduction -- [designs] [replications]`
//!
//! At designs of the paper's box that satisfy the constraints, or nearly, the 90 % percentile of ΔSTE
//! is estimated again and again from 32 samples, in every way that `stats` offers. For each way, over
//! the designs, median and quartiles of:
//!
//! - variance: that of the estimates, relative to the plain way's at the same design;
//! - stated: the mean of the variances that the way states, relative to that of its estimates. The
//!   nugget of kriging is right where this is 1;
//! - bias: of the estimates, in their standard deviations, against m + z s of 200 000 samples.
//!
//! The analyses are the simulator's calls behind one estimate.

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

use campaign::Campaign;
use campaign::formulation::Problem;
use rand::RngExt as _;
use stats::streams::{Purpose, stream};
use stats::{Control, EXACT_Z90, NormalOptions, Sampling, VarianceFormula};

const SAMPLES: u64 = 32;
const REFERENCE: u64 = 200_000;

/// A way to estimate.
struct Way {
    name: &'static str,
    sampling: Sampling,
    linearised: bool,
}

const WAYS: [Way; 5] = [
    Way {
        name: "independent",
        sampling: Sampling::Independent,
        linearised: false,
    },
    Way {
        name: "antithetic",
        sampling: Sampling::Antithetic,
        linearised: false,
    },
    Way {
        name: "quasi-random, groups of 4",
        sampling: Sampling::Quasi { group: 4 },
        linearised: false,
    },
    Way {
        name: "quasi-random, groups of 8",
        sampling: Sampling::Quasi { group: 8 },
        linearised: false,
    },
    Way {
        name: "linearised ΔSTE as control",
        sampling: Sampling::Independent,
        linearised: true,
    },
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let (designs, replications) = (number(60)?, number(400)?);
    let problem = Problem::new(Campaign::parse("paper.toml", Campaign::PAPER)?);
    let gears = problem.gears().expect("the paper designs gears");
    let mut found: Vec<Vec<[f64; 3]>> = WAYS.iter().map(|_| Vec::new()).collect();
    let mut analyses = [0; WAYS.len()];
    let mut rng = stream(1, Purpose::Test, 0, 0);
    let mut design = 0;
    while design < designs as u64 {
        let unit: [f64; 6] = std::array::from_fn(|_| rng.random());
        let x = problem.free_point(&unit);
        let Ok(pair) = gears.pair(&problem.design(&x, problem.base())) else {
            continue;
        };
        if problem.violation(&gears.pair_criteria(&pair, 0.0).into()) > 0.5 {
            continue;
        }
        design += 1;
        let mut sampler = gears.sampler(&pair);
        let modes = sampler.modes();
        let draws: Vec<f64> = (0..REFERENCE)
            .map(|sample| sampler.draw(&mut stream(2, Purpose::Test, design, sample)))
            .collect();
        let (mean, sd) = stats::mean_sd(&draws)?;
        let reference = mean + EXACT_Z90 * sd;
        let slopes = sampler.slopes();
        let control = Control {
            mean: 0.0,
            sd: slopes.iter().map(|slope| slope * slope).sum::<f64>().sqrt(),
        };
        let mut plain = f64::NAN;
        for ((way, found), analyses) in WAYS.iter().zip(&mut found).zip(&mut analyses) {
            *analyses = SAMPLES as usize + if way.linearised { 2 * modes } else { 0 };
            let mut estimates = Vec::new();
            let mut stated = 0.0;
            for replication in 0..replications as u64 {
                let (mut y, mut c) = (Vec::new(), Vec::new());
                for sample in 0..SAMPLES {
                    let name = design * 1_000_000 + replication;
                    let coefficients = stats::normal_coefficients(
                        way.sampling,
                        3,
                        Purpose::Test,
                        name,
                        sample,
                        modes,
                    )?;
                    y.push(sampler.at(&coefficients));
                    let linear = slopes.iter().zip(&coefficients).map(|(a, b)| a * b);
                    c.push(linear.sum::<f64>());
                }
                let (p90, variance) = if way.linearised {
                    let estimate = stats::control_variate_p90(&y, &c, control, EXACT_Z90)?;
                    (estimate.p90, estimate.variance)
                } else if way.sampling.group() > 1 {
                    let estimate = stats::grouped_p90(&y, way.sampling.group(), EXACT_Z90)?;
                    (estimate.p90, estimate.variance)
                } else {
                    let options = NormalOptions {
                        z: EXACT_Z90,
                        variance: VarianceFormula::Exact,
                        unbiased: true,
                    };
                    let estimate = stats::normal_p90(&y, &options)?;
                    (estimate.p90, estimate.variance)
                };
                estimates.push(p90);
                stated += variance / replications as f64;
            }
            let (mean, sd) = stats::mean_sd(&estimates)?;
            if plain.is_nan() {
                plain = sd * sd;
            }
            found.push([sd * sd / plain, stated / (sd * sd), (mean - reference) / sd]);
        }
    }
    println!("| way | analyses | variance | stated | bias |");
    println!("|---|---:|---|---|---|");
    for ((way, found), analyses) in WAYS.iter().zip(&found).zip(analyses) {
        let quartiles = |index: usize| {
            let mut values: Vec<f64> = found.iter().map(|row| row[index]).collect();
            values.sort_by(f64::total_cmp);
            let at = |part: usize| values[(values.len() - 1) * part / 4];
            format!("{:.3} [{:.3}, {:.3}]", at(2), at(1), at(3))
        };
        println!(
            "| {} | {analyses} | {} | {} | {} |",
            way.name,
            quartiles(0),
            quartiles(1),
            quartiles(2)
        );
    }
    Ok(())
}
