//! Helpers that the entries of gear pairs share.

use gear::{
    Discretisation, Error, Infeasibility, Pair, PairInput, Size, TipRule, ToothModel,
    paper::MATERIAL,
};
use problem::Campaign;
use problem::file::GearLimits;
use problem::formulation::gears::{GearCriteria, constraints};

use crate::stability::outcome::{EntryError, Outcome};

/// A plain helical pair of module 2.
pub(super) fn plain() -> PairInput {
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
        tip_diameter: [None; 2],
        hub_radius: [None; 2],
        tooth_model: ToothModel::HertzBeam,
        tip_rule: TipRule::AsCut,
        pinion_torque: 100e3,
        material: [MATERIAL; 2],
    }
}

/// Records a refusal under its code or field, with the promises that it is the `expected` one and that its message
/// has the value.
pub(super) fn refused(outcome: &mut Outcome, result: Result<Pair, Error>, expected: &str) {
    refused_with(outcome, result, expected, |_| true);
}

/// Like [`refused`], with the further promise that the reason carries the right values.
pub(super) fn refused_with(
    outcome: &mut Outcome,
    result: Result<Pair, Error>,
    expected: &str,
    carries_values: impl FnOnce(&Infeasibility) -> bool,
) {
    let (code, has_value) = match &result {
        Err(Error::Infeasible(reason)) => {
            outcome.detected(reason.code(), reason);
            outcome.holds(
                "every reason carries the values at fault",
                carries_values(reason),
            );
            let text = reason.to_string();
            (
                reason.code(),
                text.len() > 30 && !text.ends_with('.') && !text.contains("NaN"),
            )
        }
        Err(Error::Input(error)) => {
            outcome.detected(error.field, error);
            let start = format!("{} is {}, but must be ", error.field, error.value);
            (error.field, error.to_string().starts_with(&start))
        }
        Ok(_) => ("not at all", false),
    };
    outcome.holds(&format!("it is refused as {expected}"), code == expected);
    outcome.holds("every refusal is a clause with the value", has_value);
}

pub(super) fn pair(input: &PairInput) -> Result<Pair, Error> {
    Pair::new(input, &Discretisation::default())
}

/// The largest difference between neighbouring values, divided by the range of all values.
pub(super) fn largest_jump(points: &[[f64; 2]]) -> f64 {
    let values = || points.iter().map(|p| p[1]);
    let span = values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min);
    let steps = points.windows(2).map(|w| (w[1][1] - w[0][1]).abs());
    steps.fold(0.0, f64::max) / span
}

/// Thickness of the pinion's tooth at its tip circle, in modules.
pub(super) fn tip_land(pair: &Pair) -> f64 {
    let geometry = pair.geometry();
    gear::inspection::tip_land(geometry)[0] / geometry.normal_module
}

/// Records the constraints that a pair breaks under the paper's limits and a minimum tip land of 0.2 modules, with
/// the promise that the `expected` one is among them.
pub(super) fn broken(outcome: &mut Outcome, pair: &Pair, expected: &str) -> Result<(), EntryError> {
    let paper = Campaign::parse("paper.toml", Campaign::PAPER)?;
    let sections = paper.gears().ok_or("the paper’s campaign has gears")?;
    let limits = GearLimits {
        tip_land_min_modules: Some(0.2),
        ..sections.constraints
    };
    let strength = sections.material.strength(sections.strength);
    let pressure = pair.unworn().hertz_pressure_mpa;
    let criteria = GearCriteria::of_pair(pair, pressure, Some(&strength.factors));
    let mut is_broken = false;
    for constraint in constraints(&limits, &strength, &criteria) {
        if !constraint.holds() {
            is_broken |= constraint.name == expected;
            outcome.detected(constraint.name.to_string(), &constraint);
        }
    }
    outcome.holds(&format!("the constraint {expected} is broken"), is_broken);
    Ok(())
}

pub(super) fn all_finite(curve: &[[f64; 2]]) -> bool {
    !curve.is_empty() && curve.iter().all(|p| p[1].is_finite() && p[1] >= 0.0)
}
