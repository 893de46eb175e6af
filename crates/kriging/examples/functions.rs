//! The estimators of the covariance parameters on functions of the literature.
//!
//! `cargo run --release -p kriging --example functions -- [SEEDS]` (5 by default)
//!
//! Borehole (8 variables), OTL circuit (6), piston (7), robot arm (8) and wing weight (10), with the formulas
//! and ranges of S. Surjanovic and D. Bingham, *Virtual Library of Simulation Experiments*, and the function
//! of 20 variables of W. J. Welch et al., *Screening, predicting, and computer experiments*, Technometrics
//! 34 (1992) 15–25. Designs of n = 2 d (Welch's only), 3 d, 10 d and 30 d points, without noise and with noise
//! of a known standard deviation of a tenth of the function's. Medians over the seeds of: RMSE over the function's
//! standard deviation at 1000 other points, coverage of the 90 % intervals there, and leave-one-out RMSE.

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

use std::error::Error;
use std::f64::consts::{PI, TAU};

use kriging::{Data, Estimator, FitOptions, fit};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

struct Function {
    name: &'static str,
    d: usize,
    /// The function's value at a point of the unit cube.
    value: fn(&[f64]) -> f64,
}

const FUNCTIONS: [Function; 6] = [
    Function {
        name: "OTL circuit",
        d: 6,
        value: otl,
    },
    Function {
        name: "piston",
        d: 7,
        value: piston,
    },
    Function {
        name: "borehole",
        d: 8,
        value: borehole,
    },
    Function {
        name: "robot arm",
        d: 8,
        value: robot_arm,
    },
    Function {
        name: "wing weight",
        d: 10,
        value: wing_weight,
    },
    Function {
        name: "Welch",
        d: 20,
        value: welch,
    },
];

fn scaled<const D: usize>(u: &[f64], ranges: [(f64, f64); D]) -> [f64; D] {
    std::array::from_fn(|j| ranges[j].0 + u[j] * (ranges[j].1 - ranges[j].0))
}

fn otl(u: &[f64]) -> f64 {
    let ranges = [
        (50.0, 150.0),
        (25.0, 70.0),
        (0.5, 3.0),
        (1.2, 2.5),
        (0.25, 1.2),
        (50.0, 300.0),
    ];
    let [rb1, rb2, rf, rc1, rc2, beta] = scaled(u, ranges);
    let vb1 = 12.0 * rb2 / (rb1 + rb2);
    let b = beta * (rc2 + 9.0);
    (vb1 + 0.74) * b / (b + rf) + 11.35 * rf / (b + rf) + 0.74 * rf * b / ((b + rf) * rc1)
}

fn piston(u: &[f64]) -> f64 {
    let ranges = [
        (30.0, 60.0),
        (0.005, 0.020),
        (0.002, 0.010),
        (1000.0, 5000.0),
        (90_000.0, 110_000.0),
        (290.0, 296.0),
        (340.0, 360.0),
    ];
    let [m, s, v0, k, p0, ta, t0] = scaled(u, ranges);
    let a = p0 * s + 19.62 * m - k * v0 / s;
    let v = s / (2.0 * k) * ((a * a + 4.0 * k * p0 * v0 / t0 * ta).sqrt() - a);
    TAU * (m / (k + s * s * p0 * v0 / t0 * ta / (v * v))).sqrt()
}

fn borehole(u: &[f64]) -> f64 {
    let ranges = [
        (0.05, 0.15),
        (100.0, 50_000.0),
        (63_070.0, 115_600.0),
        (990.0, 1110.0),
        (63.1, 116.0),
        (700.0, 820.0),
        (1120.0, 1680.0),
        (9855.0, 12_045.0),
    ];
    let [rw, r, tu, hu, tl, hl, l, kw] = scaled(u, ranges);
    let ln = (r / rw).ln();
    TAU * tu * (hu - hl) / (ln * (1.0 + 2.0 * l * tu / (ln * rw * rw * kw) + tu / tl))
}

fn robot_arm(u: &[f64]) -> f64 {
    let (mut x, mut y, mut angle) = (0.0, 0.0, 0.0);
    for i in 0..4 {
        angle += TAU * u[i];
        x += u[4 + i] * angle.cos();
        y += u[4 + i] * angle.sin();
    }
    f64::hypot(x, y)
}

fn wing_weight(u: &[f64]) -> f64 {
    let ranges = [
        (150.0, 200.0),
        (220.0, 300.0),
        (6.0, 10.0),
        (-10.0, 10.0),
        (16.0, 45.0),
        (0.5, 1.0),
        (0.08, 0.18),
        (2.5, 6.0),
        (1700.0, 2500.0),
        (0.025, 0.08),
    ];
    let [sw, wfw, a, sweep, q, taper, tc, nz, wdg, wp] = scaled(u, ranges);
    let cos = (sweep * PI / 180.0).cos();
    0.036
        * sw.powf(0.758)
        * wfw.powf(0.0035)
        * (a / (cos * cos)).powf(0.6)
        * q.powf(0.006)
        * taper.powf(0.04)
        * (100.0 * tc / cos).powf(-0.3)
        * (nz * wdg).powf(0.49)
        + sw * wp
}

fn welch(u: &[f64]) -> f64 {
    let x = |i: usize| u[i - 1] - 0.5;
    5.0 * x(12) / (1.0 + x(1)) + 5.0 * (x(4) - x(20)).powi(2) + x(5) + 40.0 * x(19).powi(3)
        - 5.0 * x(19)
        + 0.05 * x(2)
        + 0.08 * x(3)
        - 0.03 * x(6)
        + 0.03 * x(7)
        - 0.09 * x(9)
        - 0.01 * x(10)
        - 0.07 * x(11)
        + 0.25 * x(13).powi(2)
        - 0.04 * x(14)
        + 0.06 * x(15)
        - 0.01 * x(17)
        - 0.03 * x(18)
}

const ESTIMATORS: [Estimator; 2] = [Estimator::Likelihood, Estimator::PosteriorMode];

fn main() -> Result<(), Box<dyn Error>> {
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(5), |text| text.parse())?;
    println!("                              likelihood               posterior mode");
    println!("function       n  noise    rmse   cover  loo       rmse   cover  loo");
    for function in &FUNCTIONS {
        for per_dimension in [2, 3, 10, 30] {
            if per_dimension == 2 && function.d < 20 {
                continue;
            }
            for noise in [0.0, 0.1] {
                let n = per_dimension * function.d;
                print!("{:12} {n:4}  {noise:5}", function.name);
                for estimator in ESTIMATORS {
                    let scores: Result<Vec<[f64; 3]>, _> = (0..seeds)
                        .map(|seed| score(function, n, noise, estimator, seed))
                        .collect();
                    let scores = scores?;
                    let [rmse, coverage, loo] = [0, 1, 2].map(|i| {
                        let mut all: Vec<f64> = scores.iter().map(|s| s[i]).collect();
                        all.sort_by(f64::total_cmp);
                        all[all.len() / 2]
                    });
                    print!("  {rmse:7.4}  {coverage:5.3}  {loo:6.4}");
                }
                println!();
            }
        }
    }
    Ok(())
}

/// Relative RMSE, coverage and relative leave-one-out RMSE of one fit.
fn score(
    function: &Function,
    n: usize,
    noise: f64,
    estimator: Estimator,
    seed: u64,
) -> Result<[f64; 3], Box<dyn Error>> {
    let d = function.d;
    let mut rng = stream(seed, Purpose::Test, n as u64, 5);
    let tests: Vec<f64> = (0..1000 * d).map(|_| rng.random()).collect();
    let truth: Vec<f64> = tests.chunks(d).map(function.value).collect();
    let centre = truth.iter().sum::<f64>() / 1000.0;
    let sd = (truth.iter().map(|t| (t - centre).powi(2)).sum::<f64>() / 1000.0).sqrt();
    let design = doe::random_lhs(n, d, seed)?;
    let x: Vec<f64> = (0..n).flat_map(|i| design.point(i).to_vec()).collect();
    let mut normal = || {
        let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
        radius * (TAU * rng.random::<f64>()).cos()
    };
    let y: Vec<f64> = x
        .chunks(d)
        .map(|x| (function.value)(x) + noise * sd * normal())
        .collect();
    let data = Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &vec![(noise * sd).powi(2); n],
    };
    let options = FitOptions {
        estimator,
        ..FitOptions::default()
    };
    let model = fit(&data, &options)?;
    let (mut squares, mut covered) = (0.0, 0.0);
    for (p, t) in model.predict_many(&tests)?.iter().zip(&truth) {
        squares += (p.mean - t).powi(2);
        covered += f64::from(u8::from((p.mean - t).abs() <= 1.645 * p.variance.sqrt()));
    }
    let rmse = (squares / 1000.0).sqrt() / sd;
    Ok([rmse, covered / 1000.0, model.leave_one_out().rmse / sd])
}
