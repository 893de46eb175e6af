//! General pairs for the tests of the crate's inner parts and for those of its surface.

use gear::paper::MATERIAL;
use gear::{PairInput, Size, TipRule, ToothModel};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// A plain helical pair of module 2.
pub(crate) fn plain() -> PairInput {
    PairInput {
        teeth: [23, 37],
        size: Size::NormalModule(2.0),
        pressure_angle: 20_f64.to_radians(),
        helix_angle: 15_f64.to_radians(),
        face_width: [25.0; 2],
        profile_shift: [0.2, 0.1],
        tool_addendum: [1.25; 2],
        tool_dedendum: [1.0; 2],
        tip_radius: [0.1; 2],
        root_radius: [0.6; 2],
        tip_diameter: [None, None],
        hub_radius: [None; 2],
        tooth_model: ToothModel::HertzBeam,
        tip_rule: TipRule::AsCut,
        pinion_torque: 100e3,
        material: [MATERIAL; 2],
    }
}

/// Workshop gears: most are feasible.
pub(crate) fn pairs() -> impl Strategy<Value = PairInput> {
    (
        (
            14_u32..60,
            14_u32..60,
            1.0..6.0_f64,
            17.0..25.0_f64,
            4.0..32.0_f64,
            4.0..20.0_f64,
        ),
        (
            -0.2..0.6_f64,
            -0.2..0.6_f64,
            1.1..1.4_f64,
            1.1..1.4_f64,
            0.85..1.1_f64,
            0.85..1.1_f64,
        ),
        (
            0.0..0.1_f64,
            0.0..0.1_f64,
            0.1..0.3_f64,
            0.1..0.3_f64,
            0.2..20.0_f64,
        ),
    )
        .prop_map(
            |((z1, z2, m, alpha, beta, width), (x1, x2, a1, a2, d1, d2), rest)| {
                let (t1, t2, r1, r2, load) = rest;
                PairInput {
                    teeth: [z1, z2],
                    size: Size::NormalModule(m),
                    pressure_angle: alpha.to_radians(),
                    helix_angle: beta.to_radians(),
                    face_width: [width * m; 2],
                    profile_shift: [x1, x2],
                    tool_addendum: [a1, a2],
                    tool_dedendum: [d1, d2],
                    tip_radius: [t1 * m, t2 * m],
                    root_radius: [r1 * m, r2 * m],
                    pinion_torque: load * m * m * m * f64::from(z1) * 100.0,
                    ..plain()
                }
            },
        )
}

/// A number of cases that is the same at every run.
pub(crate) fn config(cases: u32, seed: u64) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// The pair, or the test case is skipped where the random input is infeasible.
macro_rules! feasible {
    ($input:expr) => {
        match gear::Pair::new($input, &gear::Discretisation::default()) {
            Ok(pair) => pair,
            Err(gear::Error::Infeasible(_)) => return Err(TestCaseError::reject("infeasible")),
            Err(error) => return Err(TestCaseError::fail(error.to_string())),
        }
    };
}

pub(crate) use feasible;
