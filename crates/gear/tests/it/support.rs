//! Builders shared by the tests.

use gear::{Discretisation, Kernel, Material, Pair, PairInput, Size, TipRule, ToothModel, Wear};
use rand::RngExt as _;
use stats::streams::{Purpose, StreamRng, stream};

/// The wear of the paper's campaign.
pub(crate) const WEAR: Wear = Wear {
    max_depth: 3.5e-3,
    kernel: Kernel::SquaredExponential,
    range: 0.2,
    variance: 0.01,
};

/// The paper's material.
pub(crate) const STEEL: Material = Material {
    youngs_modulus_mpa: 200e3,
    poisson_ratio: 0.29,
    yield_mpa: 980.0,
    hertz_limit_mpa: 1550.0,
};

pub(crate) fn rng(design: u64) -> StreamRng {
    stream(1, Purpose::Test, design, 0)
}

pub(crate) fn pair(input: &PairInput) -> Pair {
    Pair::new(input, &Discretisation::default()).expect("the test's design is feasible")
}

/// A design of the paper's 11-variable problem: x, ha0, hf0 of both gears.
pub(crate) fn paper_design(v: [f64; 6], tip: [f64; 2], root: [f64; 2], beta: f64) -> PairInput {
    PairInput {
        teeth: [20, 22],
        size: Size::CentreDistance(110.0),
        pressure_angle: 18_f64.to_radians(),
        helix_angle: beta.to_radians(),
        face_width: 10.0,
        profile_shift: [v[0], v[1]],
        tool_addendum: [v[2], v[3]],
        tool_dedendum: [v[4], v[5]],
        tip_radius: tip,
        root_radius: root,
        tip_diameter: [None, None],
        tooth_model: ToothModel::HertzBeam,
        tip_rule: TipRule::AsCut,
        pinion_torque: 200e3,
        material: STEEL,
    }
}

/// A design of the paper's 6-variable problem.
pub(crate) fn frozen(v: [f64; 6]) -> PairInput {
    paper_design(v, [0.0003, 0.19], [0.64, 0.23], 30.0)
}

/// The paper's optimum without wear, its Figure 7.
pub(crate) fn figure_7() -> PairInput {
    frozen([0.49, 0.49, 1.20, 1.11, 1.00, 1.09])
}

/// A plain helical pair of module 2.
pub(crate) fn plain() -> PairInput {
    PairInput {
        teeth: [23, 37],
        size: Size::NormalModule(2.0),
        pressure_angle: 20_f64.to_radians(),
        helix_angle: 15_f64.to_radians(),
        face_width: 25.0,
        profile_shift: [0.2, 0.1],
        tool_addendum: [1.25; 2],
        tool_dedendum: [1.0; 2],
        tip_radius: [0.1; 2],
        root_radius: [0.6; 2],
        tip_diameter: [None, None],
        tooth_model: ToothModel::HertzBeam,
        tip_rule: TipRule::AsCut,
        pinion_torque: 100e3,
        material: STEEL,
    }
}

/// A random point of the paper's 6-variable box.
pub(crate) fn in_the_box(rng: &mut StreamRng) -> PairInput {
    let mut v = [0.0; 6];
    for value in &mut v[..2] {
        *value = rng.random_range(-1.0..2.0);
    }
    for value in &mut v[2..] {
        *value = rng.random_range(0.8..1.7);
    }
    frozen(v)
}
