//! The line-of-action solver against a plain sum over slices of the face.
//!
//! This is the definition of the model taken literally: at a phase, every pair of teeth and every
//! slice of the face has a place on the path; each carries max(0, δ − g)/q, and δ is found by
//! bisection. Nothing is shared with the crate but the compliance q(s) and the gap g(s).

use gear::{Pair, PairInput, ToothModel};

use crate::support::{WEAR, figure_7, frozen, pair, plain};

const SLICES: usize = 6000;

fn linear(x: &[f64], y: &[f64], at: f64) -> f64 {
    let k = x.partition_point(|&v| v <= at).clamp(1, x.len() - 1);
    y[k - 1] + (y[k] - y[k - 1]) * (at - x[k - 1]) / (x[k] - x[k - 1])
}

/// δ in mm at the phase `phi` in mm, and the residual of the load balance.
fn deflection(pair: &Pair, gap: &dyn Fn(f64) -> f64, phi: f64) -> f64 {
    let g = pair.geometry();
    let tan = g.beta_b.tan();
    let dz = g.face_width / SLICES as f64;
    let mut slices = Vec::new();
    for j in 0..200 {
        for k in 0..SLICES {
            let z = (k as f64 + 0.5) * dz;
            let s = g.s_in + phi - z * tan + f64::from(j) * g.base_pitch;
            if (g.s_in..=g.s_out).contains(&s) {
                slices.push((gap(s), 1.0 / pair.compliance(s)));
            }
        }
    }
    assert!(!slices.is_empty());
    let force = |delta: f64| -> f64 {
        slices
            .iter()
            .map(|(gap, c)| (delta - gap).max(0.0) * c * dz)
            .sum()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if force(middle) < pair.base_force() {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

fn compare(input: &PairInput, worn: bool) {
    let pair = pair(input);
    let worn_pair = pair.archard(&WEAR);
    let analysis = if worn {
        worn_pair.analysis.clone()
    } else {
        pair.unworn()
    };
    let gap = |s: f64| {
        if worn {
            2.0 * linear(&worn_pair.s, &worn_pair.depth, s)
        } else {
            0.0
        }
    };
    let g = pair.geometry();
    let count = analysis.phases.len();
    for k in (0..count).step_by(7) {
        let phi = analysis.phases[k] * g.base_pitch;
        let expected = 1e3 * deflection(&pair, &gap, phi) / g.beta_b.cos();
        let ours = analysis.ste_um[k];
        // The slice sum has an end error of one slice in 6000 per window; 1/q between nodes of
        // the path is linear in the crate and exact here.
        assert!(
            (ours / expected - 1.0).abs() < 1e-3,
            "{worn}: phase {}: {ours} against {expected}",
            analysis.phases[k]
        );
    }
}

#[test]
fn unworn() {
    compare(&figure_7(), false);
    compare(&plain(), false);
}

#[test]
fn worn_with_separation() {
    compare(&figure_7(), true);
    compare(&frozen([0.20, 1.26, 1.44, 1.49, 1.27, 0.92]), true);
    compare(
        &PairInput {
            pinion_torque: 5e3,
            ..plain()
        },
        true,
    );
}

#[test]
fn wide_face_and_soft_teeth() {
    compare(
        &PairInput {
            face_width: 120.0,
            tooth_model: ToothModel::WeberBanaschek,
            ..plain()
        },
        true,
    );
}
