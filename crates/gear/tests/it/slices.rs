//! The line-of-action solver against a plain sum over slices of the face.
//!
//! This is the definition of the model taken literally: at a phase, every pair of teeth and every
//! slice of the face has a place on the path; each carries max(0, δ − g)/q, and δ is found by
//! bisection. Nothing is shared with the crate but the compliance q(s) and the gap g(s).

use gear::paper::design;
use gear::{Pair, PairInput, ToothModel};

use crate::support::{FIGURE_8, WEAR, balance, figure_7, linear, pair, plain};

const SLICES: usize = 6000;

/// δ in mm at the phase `phi` in mm.
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
                slices.push((gap(s), dz / pair.compliance(s)));
            }
        }
    }
    assert!(!slices.is_empty());
    balance(&slices, pair.base_force())
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
            2.0 * linear(&worn_pair.s, &worn_pair.depth[0], s)
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
    compare(&design(FIGURE_8), true);
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
            face_width: [120.0; 2],
            tooth_model: ToothModel::WeberBanaschek,
            ..plain()
        },
        true,
    );
}
