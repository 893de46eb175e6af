//! Helpers that the entries of gear pairs share.

use campaign::Campaign;
use campaign::file::GearLimits;
use campaign::formulation::gears::{GearCriteria, constraints};
use gear::{Discretisation, Error, Pair, PairInput, Size, TipRule, ToothModel, paper::MATERIAL};

use crate::stability::outcome::{Failed, Outcome};

/// A plain helical pair of module 2.
pub(super) fn plain() -> PairInput {
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
        tip_diameter: [None; 2],
        tooth_model: ToothModel::HertzBeam,
        tip_rule: TipRule::AsCut,
        pinion_torque: 100e3,
        material: MATERIAL,
    }
}

/// Records a refusal under its code, and asserts that it is the `expected` one.
pub(super) fn refused(found: &mut Outcome, result: Result<Pair, Error>, expected: &str) {
    let code = match &result {
        Err(Error::Infeasible(reason)) => {
            found.detected(reason.code(), reason);
            reason.code()
        }
        Err(Error::Input(error)) => {
            found.detected(error.field, error);
            error.field
        }
        Ok(_) => "not at all",
    };
    found.holds(&format!("it is refused as {expected}"), code == expected);
}

pub(super) fn pair(input: &PairInput) -> Result<Pair, Error> {
    Pair::new(input, &Discretisation::default())
}

/// The largest change from a point to the next, over the whole span of the values.
pub(super) fn largest_jump(points: &[[f64; 2]]) -> f64 {
    let values = || points.iter().map(|p| p[1]);
    let span = values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min);
    let steps = points.windows(2).map(|w| (w[1][1] - w[0][1]).abs());
    steps.fold(0.0, f64::max) / span
}

/// Thickness of the pinion's tooth at its tip circle over the module.
pub(super) fn tip_land(pair: &Pair) -> Option<f64> {
    let criteria = GearCriteria::of_pair(pair, 0.0, true);
    Some(criteria.details?.tip_land_mm[0] / criteria.normal_module_mm)
}

/// Records the constraints that a pair breaks under the paper's limits, with a tip land of 0.2 modules, and
/// asserts that the `expected` one is among them.
pub(super) fn broken(found: &mut Outcome, pair: &Pair, expected: &str) -> Result<(), Failed> {
    let paper = Campaign::parse("paper.toml", Campaign::PAPER)?;
    let sections = paper.gears().ok_or("the paper’s campaign has gears")?;
    let limits = GearLimits {
        tip_land_min_modules: Some(0.2),
        ..sections.constraints
    };
    let criteria = GearCriteria::of_pair(pair, pair.unworn().hertz_pressure_mpa, true);
    let mut is_broken = false;
    for constraint in constraints(&limits, &sections.material, &criteria) {
        if !constraint.holds() {
            is_broken |= constraint.name == expected;
            found.detected(constraint.name.to_string(), &constraint);
        }
    }
    found.holds(&format!("the constraint {expected} is broken"), is_broken);
    Ok(())
}

pub(super) fn all_finite(curve: &[[f64; 2]]) -> bool {
    !curve.is_empty() && curve.iter().all(|p| p[1].is_finite() && p[1] >= 0.0)
}
