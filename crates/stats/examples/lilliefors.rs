//! Simulates the null distribution of Lilliefors' statistic.
//!
//! `cargo run --release -p stats --example lilliefors -- [check|fit] [SAMPLES]`
//!
//! `check` (100 000 samples a size) prints for sizes from 4 to 1000 the simulated critical values
//! beside the stored ones; `fit` prints what `src/normality.rs` stores: the quantiles of D√n for sizes
//! from 4 to 9, and for sizes from 10 to 1000 polynomials in 1/√n fitted to them.

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

use rand_distr::{Distribution as _, StandardNormal};
use stats::streams::{Purpose, stream};
use stats::{Error, lilliefors, lilliefors_critical_value};

const LEVELS: [f64; 21] = [
    0.999, 0.99, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1, 0.075, 0.05, 0.025,
    0.01, 0.005, 0.002, 0.001,
];
const SMALL: [usize; 6] = [4, 5, 6, 7, 8, 9];
const FITTED: [usize; 14] = [10, 11, 12, 14, 17, 20, 25, 30, 40, 60, 100, 200, 400, 1000];
/// Coefficients of a fitted polynomial.
const TERMS: usize = 3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let fit = arguments.next().is_some_and(|word| word == "fit");
    let samples: usize = arguments.next().map_or(Ok(100_000), |text| text.parse())?;
    if fit {
        for n in SMALL {
            let statistics = simulate(n, samples)?;
            let root = (n as f64).sqrt();
            let row = LEVELS.map(|level| root * upper_quantile(&statistics, level));
            println!("    {row:.4?}, // {n}");
        }
        let mut simulated = Vec::new();
        for n in FITTED {
            simulated.push((n, simulate(n, samples)?));
        }
        for level in LEVELS {
            let of_size = |(n, statistics): &(usize, Vec<f64>)| {
                let root = (*n as f64).sqrt();
                (1.0 / root, root * upper_quantile(statistics, level))
            };
            let points: Vec<(f64, f64)> = simulated.iter().map(of_size).collect();
            let c = polynomial(&points);
            let value = |u: f64| c.iter().rev().fold(0.0, |sum, c| sum * u + c);
            let misses = points.iter().map(|(u, q)| (value(*u) / q - 1.0).abs());
            let worst = misses.fold(0.0, f64::max);
            println!("    {c:.4?}, // {level}, off by {worst:.4}");
        }
        return Ok(());
    }
    println!("   n  level  simulated  stored   ratio");
    for n in [4, 5, 6, 7, 8, 10, 15, 20, 30, 40, 50, 70, 100, 1000] {
        let statistics = simulate(n, samples)?;
        for level in [0.2, 0.15, 0.1, 0.05, 0.01] {
            let ours = upper_quantile(&statistics, level);
            let stored = lilliefors_critical_value(n, level)?;
            println!(
                "{n:4}  {level:5}  {ours:9.4}  {stored:6.4}  {:6.4}",
                stored / ours
            );
        }
    }
    Ok(())
}

/// The statistics of normal samples of size `n`, sorted.
fn simulate(n: usize, samples: usize) -> Result<Vec<f64>, &'static str> {
    let mut sample = vec![0.0; n];
    let one = |i: usize, sample: &mut [f64]| -> Result<f64, Error> {
        let mut rng = stream(1967, Purpose::Test, n as u64, i as u64);
        sample.fill_with(|| StandardNormal.sample(&mut rng));
        Ok(lilliefors(sample)?.statistic)
    };
    let mut statistics = Vec::with_capacity(samples);
    for i in 0..samples {
        statistics.push(one(i, &mut sample).map_err(|_| "normal numbers are not constant")?);
    }
    statistics.sort_by(f64::total_cmp);
    Ok(statistics)
}

/// The value exceeded by the share `level` of the sorted statistics.
fn upper_quantile(sorted: &[f64], level: f64) -> f64 {
    let place = (1.0 - level) * sorted.len() as f64 - 0.5;
    let below = (place.max(0.0) as usize).min(sorted.len() - 2);
    let share = place - below as f64;
    sorted[below] + share * (sorted[below + 1] - sorted[below])
}

/// Least squares by the normal equations.
fn polynomial(points: &[(f64, f64)]) -> [f64; TERMS] {
    let mut matrix = [[0.0; TERMS + 1]; TERMS];
    for (u, q) in points {
        for (i, row) in matrix.iter_mut().enumerate() {
            for (j, entry) in row[..TERMS].iter_mut().enumerate() {
                *entry += u.powi((i + j) as i32);
            }
            row[TERMS] += q * u.powi(i as i32);
        }
    }
    for k in 0..TERMS {
        let pivot = matrix[k];
        for (i, row) in matrix.iter_mut().enumerate() {
            if i != k {
                let factor = row[k] / pivot[k];
                for (entry, p) in row.iter_mut().zip(pivot) {
                    *entry -= factor * p;
                }
            }
        }
    }
    std::array::from_fn(|k| matrix[k][TERMS] / matrix[k][k])
}
