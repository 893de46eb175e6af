//! The spread of randomly worn pairs against a calculation that shares only the compliance and the
//! mean wear with the crate: a dense Cholesky factor of the covariance on the nodes, and a sum over
//! phases and slices.

use gear::paper::design;
use gear::{Kernel, Pair, PairInput, Wear};
use rand::RngExt as _;
use stats::streams::{Purpose, StreamRng, stream};

use crate::support::{FIGURE_8, WEAR, figure_7, pair};

const PHASES: usize = 64;
const SLICES: usize = 120;
const DENSE: u64 = 1500;
const OURS: u64 = 12_000;

/// Lower factor of the covariance of Θ at the angles, row by row.
fn dense_cholesky(theta: &[f64], correlation: impl Fn(f64) -> f64, variance: f64) -> Vec<Vec<f64>> {
    let mut l: Vec<Vec<f64>> = Vec::new();
    for (i, a) in theta.iter().enumerate() {
        let mut row = vec![0.0; i + 1];
        for j in 0..=i {
            let sum: f64 = (0..j)
                .map(|k| row[k] * if j == i { row[k] } else { l[j][k] })
                .sum();
            let k = variance * correlation((a - theta[j]).abs());
            row[j] = if j == i {
                // A smooth kernel's matrix is singular to rounding: a millionth of the variance
                // keeps the factor real.
                (k * (1.0 + 1e-6) - sum).sqrt()
            } else {
                (k - sum) / l[j][j]
            };
        }
        l.push(row);
    }
    l
}

/// Box and Muller's transformation, one of its two numbers.
fn normal(rng: &mut StreamRng) -> f64 {
    let u: f64 = 1.0 - rng.random::<f64>();
    let angle = std::f64::consts::TAU * rng.random::<f64>();
    (-2.0 * u.ln()).sqrt() * angle.cos()
}

/// (cell, fraction, stiffness) of every slice in contact, phase by phase.
fn slices(pair: &Pair, nodes: &[f64]) -> Vec<Vec<(usize, f64, f64)>> {
    let g = pair.geometry();
    let dz = g.face_width / SLICES as f64;
    (0..PHASES)
        .map(|k| {
            let mut list = Vec::new();
            for i in 0..SLICES {
                let z = (i as f64 + 0.5) * dz;
                let mut s = g.s_in + g.base_pitch * k as f64 / PHASES as f64 - z * g.beta_b.tan();
                while s < g.s_out {
                    if s > g.s_in {
                        let cell = nodes.partition_point(|&x| x <= s) - 1;
                        let u = (s - nodes[cell]) / (nodes[cell + 1] - nodes[cell]);
                        list.push((cell, u, dz / pair.compliance(s)));
                    }
                    s += g.base_pitch;
                }
            }
            list
        })
        .collect()
}

fn delta_ste(pair: &Pair, slices: &[Vec<(usize, f64, f64)>], gap: &[f64]) -> f64 {
    let (mut least, mut most) = (f64::MAX, f64::MIN);
    for list in slices {
        let mut delta = f64::INFINITY;
        for _ in 0..50 {
            let (mut force, mut rate) = (pair.base_force(), 0.0);
            for &(cell, u, c) in list {
                let g = gap[cell] + u * (gap[cell + 1] - gap[cell]);
                if g < delta {
                    force += c * g;
                    rate += c;
                }
            }
            let next = force / rate;
            if next == delta {
                break;
            }
            delta = next;
        }
        least = least.min(delta);
        most = most.max(delta);
    }
    1e3 * (most - least) / pair.geometry().beta_b.cos()
}

fn mean_and_sd(draws: &[f64]) -> (f64, f64) {
    let n = draws.len() as f64;
    let mean = draws.iter().sum::<f64>() / n;
    let var = draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, var.sqrt())
}

fn compare(input: &PairInput, wear: &Wear, correlation: impl Fn(f64) -> f64 + Copy) {
    let pair = pair(input);
    let g = pair.geometry();
    let worn = pair.archard(wear);
    let slices = slices(&pair, &worn.s);
    let angles = [0, 1].map(|i| -> Vec<f64> {
        let length = |s: f64| if i == 0 { s } else { g.path_length - s };
        worn.s.iter().map(|&s| length(s) / g.r_b[i]).collect()
    });
    let factors = angles.map(|theta| dense_cholesky(&theta, correlation, wear.variance));
    let mut rng = stream(6, Purpose::Test, 0, 0);
    let dense: Vec<f64> = (0..DENSE)
        .map(|_| {
            let mut gap = vec![0.0; worn.s.len()];
            for (l, depth) in factors.iter().zip(&worn.depth) {
                let z: Vec<f64> = l.iter().map(|_| normal(&mut rng)).collect();
                for ((gap, row), depth) in gap.iter_mut().zip(l).zip(depth) {
                    let theta: f64 = 1.0 + row.iter().zip(&z).map(|(a, b)| a * b).sum::<f64>();
                    *gap += depth * theta.max(0.0);
                }
            }
            delta_ste(&pair, &slices, &gap)
        })
        .collect();
    let mut sampler = pair.sampler(wear);
    let ours: Vec<f64> = (0..OURS)
        .map(|k| sampler.draw(&mut stream(7, Purpose::Test, 0, k)))
        .collect();
    let ((m0, s0), (m1, s1)) = (mean_and_sd(&dense), mean_and_sd(&ours));
    // Four standard errors of the difference, and 0.5 % for the slices.
    let error = (s0 * s0 / DENSE as f64 + s1 * s1 / OURS as f64).sqrt();
    assert!(
        (m1 - m0).abs() < 4.0 * error + 5e-3 * m0,
        "{input:?}: mean {m1} against {m0}"
    );
    // The relative standard error of a standard deviation of N nearly normal numbers is 1/√(2N).
    let error = (0.5 / DENSE as f64 + 0.5 / OURS as f64).sqrt();
    assert!(
        (s1 / s0 - 1.0).abs() < 4.0 * error + 5e-3,
        "{input:?}: standard deviation {s1} against {s0}"
    );
}

#[test]
fn smooth_wear_spreads_as_a_dense_calculation_says() {
    let correlation = |h: f64| (-(h / 0.2) * (h / 0.2)).exp();
    compare(&figure_7(), &WEAR, correlation);
    compare(&design(FIGURE_8), &WEAR, correlation);
}

/// The kernel that loses most by truncation.
#[test]
fn rough_wear_spreads_as_a_dense_calculation_says() {
    let wear = Wear {
        kernel: Kernel::Spherical,
        range: 0.3,
        ..WEAR
    };
    compare(&figure_7(), &wear, |h| {
        let h = h / 0.3;
        if h < 1.0 {
            1.0 - 1.5 * h + 0.5 * h * h * h
        } else {
            0.0
        }
    });
}
