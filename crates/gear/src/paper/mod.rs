//! The pair and the wear that the simulator was validated on, those of *Gears Design with Shape
//! Uncertainties using Monte Carlo Simulations and Kriging*, 2009: the example of this crate's
//! tests, benches and examples, and a start for a first calculation.

pub mod printed;
pub mod readings;

use crate::input::{Kernel, Material, PairInput, Size, TipRule, ToothModel, Wear, WearLaw};

/// The paper's steel, 20 NC 6.
pub const MATERIAL: Material = Material {
    youngs_modulus_mpa: 200e3,
    poisson_ratio: 0.29,
};

/// Depth of [`WEAR`] at its deepest place, µm on each flank.
pub const MAX_DEPTH_UM: f64 = 3.5;

/// The paper's random field on Archard's law. The depth is not printed clearly; of the values
/// tried, 3.5 µm on each flank fits the tables.
pub const WEAR: Wear = Wear {
    law: WearLaw::Archard {
        max_depth_um: MAX_DEPTH_UM,
    },
    kernel: Kernel::SquaredExponential,
    range: 0.2,
    variance: 0.01,
    life: None,
};

/// The wear that the paper computed: the signed law, with the coefficient that fits its tables best
/// (see [`readings`]).
pub const SIGNED_WEAR: Wear = Wear {
    law: WearLaw::Signed {
        coefficient: 3.5e-7,
    },
    ..WEAR
};

/// The optimum without wear (Figure 7), as an argument of [`design`].
pub const FIGURE_7: [f64; 6] = [0.49, 0.49, 1.20, 1.11, 1.00, 1.09];

/// Lower and upper bounds of the six variables of [`design`].
pub const BOX: [[f64; 2]; 6] = [
    [-1.0, 2.0],
    [-1.0, 2.0],
    [0.8, 1.7],
    [0.8, 1.7],
    [0.8, 1.7],
    [0.8, 1.7],
];

/// A design of the paper's robust problem: 20 and 22 teeth, 110 mm between the axes, a 10 mm face,
/// β = 30°, 200 N·m, with `hertz-beam` and tips as cut.
///
/// `variables` are x1, x2, ha0_1, ha0_2, hf0_1, hf0_2 in normal modules: profile shifts, tool
/// addenda, tool dedenda. Roundings and helix angle are frozen at the optimum without wear.
#[must_use]
pub const fn design(variables: [f64; 6]) -> PairInput {
    full_design(printed::with_frozen(variables))
}

/// A design of the paper's problem without wear, as [`design`] but with all eleven variables: those
/// six, ρa_1, ρa_2, ρf_1, ρf_2 in mm and β in degrees.
#[must_use]
pub const fn full_design(variables: [f64; 11]) -> PairInput {
    let [
        x1,
        x2,
        ha0_1,
        ha0_2,
        hf0_1,
        hf0_2,
        tip_1,
        tip_2,
        root_1,
        root_2,
        beta,
    ] = variables;
    PairInput {
        teeth: [20, 22],
        size: Size::CentreDistance(110.0),
        pressure_angle: 18_f64.to_radians(),
        helix_angle: beta.to_radians(),
        face_width: [10.0; 2],
        profile_shift: [x1, x2],
        tool_addendum: [ha0_1, ha0_2],
        tool_dedendum: [hf0_1, hf0_2],
        tip_radius: [tip_1, tip_2],
        root_radius: [root_1, root_2],
        tip_diameter: [None, None],
        hub_radius: [None; 2],
        tooth_model: ToothModel::HertzBeam,
        tip_rule: TipRule::AsCut,
        pinion_torque: 200e3,
        material: [MATERIAL; 2],
    }
}
