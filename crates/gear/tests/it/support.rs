//! Builders shared by the tests.

use gear::paper::{BOX, FIGURE_7, design};
use gear::{Discretisation, Geometry, Pair, PairInput};
use rand::RngExt as _;
use stats::streams::{Purpose, StreamRng, stream};

pub(crate) use crate::general::plain;
pub(crate) use gear::paper::WEAR;

pub(crate) fn rng(design: u64) -> StreamRng {
    stream(1, Purpose::Test, design, 0)
}

pub(crate) fn pair(input: &PairInput) -> Pair {
    Pair::new(input, &Discretisation::default()).expect("the test's design is feasible")
}

/// The paper's optimum without wear, its Figure 7.
pub(crate) fn figure_7() -> PairInput {
    design(FIGURE_7)
}

/// The paper's other optima: robust by kriging, with Archard's wear, best of the design of experiments.
pub(crate) const FIGURE_8: [f64; 6] = [0.20, 1.26, 1.44, 1.49, 1.27, 0.92];
const FIGURE_9: [f64; 6] = [-0.028, 0.86, 1.26, 1.32, 1.20, 0.81];
const FIGURE_10: [f64; 6] = [-0.004, 0.37, 1.37, 1.51, 1.27, 0.87];

/// Figures 6 to 10 of the paper.
pub(crate) fn figures() -> [PairInput; 5] {
    [
        figure_6(),
        figure_7(),
        design(FIGURE_8),
        design(FIGURE_9),
        design(FIGURE_10),
    ]
}

/// The start of one of the paper's optimisation runs, its Figure 6.
fn figure_6() -> PairInput {
    PairInput {
        tip_radius: [0.2, 0.1],
        root_radius: [0.05, 0.1],
        helix_angle: 10_f64.to_radians(),
        ..design([-0.2, 0.2, 1.5, 1.4, 1.3, 1.17])
    }
}

/// A random point of the paper's 6-variable box.
pub(crate) fn in_the_box(rng: &mut StreamRng) -> PairInput {
    design(BOX.map(|[low, high]| rng.random_range(low..high)))
}

/// The piecewise linear function through (`x`, `y`).
pub(crate) fn linear(x: &[f64], y: &[f64], at: f64) -> f64 {
    let k = x.partition_point(|&v| v <= at).clamp(1, x.len() - 1);
    y[k - 1] + (y[k] - y[k - 1]) * (at - x[k - 1]) / (x[k] - x[k - 1])
}

/// Gap in mm of a tip corner `x` mm beyond an end of the path: the gear's before its start if `before`, else
/// the pinion's after its end. The line of action is the horizontal axis, with the first base tangent
/// point as origin.
pub(crate) fn tip_separation(g: &Geometry, before: bool, x: f64) -> f64 {
    let (own, mate, end) = if before {
        (1, 0, g.path_length - g.s_in)
    } else {
        (0, 1, g.s_out)
    };
    let turn = |[x, y]: [f64; 2], axis: [f64; 2], angle: f64| {
        let ((sin, cos), [x, y]) = (angle.sin_cos(), [x - axis[0], y - axis[1]]);
        [axis[0] + x * cos - y * sin, axis[1] + x * sin + y * cos]
    };
    // Both gears turn on until the corner has moved by x along its base circle.
    let corner = turn([end, 0.0], [0.0, -g.r_b[own]], -x / g.r_b[own]);
    let (axis, r_b) = ([g.path_length, g.r_b[mate]], g.r_b[mate]);
    let corner = turn(corner, axis, -x / r_b);
    // The point of the mate's flank that is as far from its axis, at the moment when the flank touched last.
    let radius = (corner[0] - axis[0]).hypot(corner[1] - axis[1]);
    let left = (radius * radius - r_b * r_b).max(0.0).sqrt();
    let touched = [g.path_length - left, 0.0];
    let flank = turn(touched, axis, (left - (g.path_length - end)) / r_b);
    let apart = (flank[0] - corner[0]).hypot(flank[1] - corner[1]);
    apart * r_b / radius * g.beta_b.cos()
}

/// δ in mm at which slices of the given gap (mm) and stiffness (N/mm) carry `force` together, by
/// bisection.
pub(crate) fn balance(slices: &[(f64, f64)], force: f64) -> f64 {
    let carried = |delta: f64| -> f64 {
        let each = slices.iter().map(|(gap, c)| (delta - gap).max(0.0) * c);
        each.sum()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if carried(middle) < force {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}
