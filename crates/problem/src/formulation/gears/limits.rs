//! The constraints on a gear pair: the limits in a file, and the defaults of absent ones.

use gear::rating;

use super::super::Bound::{Above, AtLeast, AtMost, Below};
use super::super::Constraint;
use super::{GearCriteria, GearDetails};
use crate::file::GearLimits;

/// All constraints on a pair with these criteria. Without limits, the contact pressure
/// must stay below the material's, and clearances and margins must be at least 0. Limits on quantities that
/// only [`GearDetails`] have need criteria with details.
#[must_use]
pub fn constraints(
    limits: &GearLimits,
    strength: &rating::Strength,
    criteria: &GearCriteria,
) -> Vec<Constraint> {
    let module = criteria.normal_module_mm;
    let mut all = Vec::new();
    let contact = criteria.contact_ratio;
    let limit = limits.contact_ratio_min;
    all.extend(limit.map(|limit| Constraint::new("contact ratio", "", contact, Above, limit)));
    let sliding = criteria.specific_sliding;
    let limit = limits.specific_sliding_max;
    all.extend(limit.map(|limit| Constraint::new("specific sliding", "", sliding, Below, limit)));
    let limit = limits.root_stress_max_mpa;
    let stress = criteria.root_stress_mpa;
    all.extend(limit.map(|limit| Constraint::new("root stress", "MPa", stress, Below, limit)));
    let [pinion, mate] = strength.contact_limit_mpa;
    let limit = limits.hertz_pressure_max(pinion.min(mate));
    let pressure = criteria.hertz_pressure_mpa;
    all.push(Constraint::new(
        "contact pressure",
        "MPa",
        pressure,
        Below,
        limit,
    ));
    let clearance = module * limits.tip_clearance_min_modules.unwrap_or_default();
    for (names, values, limit) in [
        (
            ["pinion tip clearance", "mate tip clearance"],
            criteria.clearance_mm,
            clearance,
        ),
        (
            ["pinion flank margin", "mate flank margin"],
            criteria.flank_margin_mm,
            limits.flank_margin_min_mm.unwrap_or_default(),
        ),
    ] {
        all.extend(
            names
                .into_iter()
                .zip(values)
                .map(|(name, value)| Constraint {
                    scale: module,
                    ..Constraint::new(name, "mm", value, AtLeast, limit)
                }),
        );
    }
    let (least, most) = (limits.normal_module_min_mm, limits.normal_module_max_mm);
    all.extend(least.map(|limit| Constraint::new("normal module", "mm", module, AtLeast, limit)));
    all.extend(most.map(|limit| Constraint::new("normal module", "mm", module, AtMost, limit)));
    if let Some(details) = &criteria.details {
        all.extend(of_details(limits, module, strength, details));
    }
    all
}

fn of_details(
    limits: &GearLimits,
    module: f64,
    strength: &rating::Strength,
    details: &GearDetails,
) -> Vec<Constraint> {
    let mut all = Vec::new();
    let transverse = details.transverse_contact_ratio;
    let limit = limits.transverse_contact_ratio_min;
    all.extend(
        limit
            .map(|limit| Constraint::new("transverse contact ratio", "", transverse, Above, limit)),
    );
    let limit = limits.pure_involute_min_mm;
    all.extend(limit.map(|limit| Constraint {
        scale: module,
        ..Constraint::new(
            "pure involute",
            "mm",
            details.pure_involute_mm,
            AtLeast,
            limit,
        )
    }));
    let root_safety = strength.root_safety(details.iso_root_stress_mpa);
    for (names, unit, values, limit) in [
        (
            ["pinion tip land", "mate tip land"],
            "mm",
            details.tip_land_mm,
            limits.tip_land_min_modules.map(|land| module * land),
        ),
        (
            ["pinion root safety S_F", "mate root safety S_F"],
            "",
            // A file that limits the safety gives the allowable stress.
            root_safety.map(|safety| safety.unwrap_or(f64::NAN)),
            limits.root_safety_min,
        ),
        (
            ["pinion flank safety S_H", "mate flank safety S_H"],
            "",
            strength.flank_safety(details.iso_flank_stress_mpa),
            limits.flank_safety_min,
        ),
    ] {
        let Some(limit) = limit else { continue };
        let scale = if unit.is_empty() { limit } else { module };
        let each = names.into_iter().zip(values);
        all.extend(each.map(|(name, value)| Constraint {
            scale,
            ..Constraint::new(name, unit, value, AtLeast, limit)
        }));
    }
    let distance = details.centre_distance_mm;
    let (least, most) = (limits.centre_distance_min_mm, limits.centre_distance_max_mm);
    let name = "centre distance";
    all.extend(least.map(|limit| Constraint::new(name, "mm", distance, AtLeast, limit)));
    all.extend(most.map(|limit| Constraint::new(name, "mm", distance, AtMost, limit)));
    all
}
