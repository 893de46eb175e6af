//! What a pair is held against: the limits of its file, and the defaults where it gives none.

use campaign::PairFile;
use campaign::formulation::Constraint;
use serde::{Serialize, Serializer};

use super::Figures;

/// A constraint as programs read it.
#[derive(Serialize)]
struct Row<'a> {
    name: &'a str,
    value: f64,
    /// Empty for a ratio.
    unit: &'a str,
    limit: f64,
    holds: bool,
}

pub(super) fn serialize<S: Serializer>(all: &[Constraint], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(all.iter().map(|constraint| Row {
        name: &constraint.name,
        value: constraint.value,
        unit: constraint.unit.trim_start(),
        limit: constraint.limit,
        holds: constraint.holds(),
    }))
}

/// Every constraint of a pair with these figures.
pub(super) fn of(file: &PairFile, figures: &Figures) -> Vec<Constraint> {
    let limits = file.limits();
    let material = &file.material;
    let module = figures.normal_module_mm;
    let mut all = Vec::new();
    let contact = figures.contact_ratio;
    for (name, value, limit) in [
        ("contact ratio", contact.total, limits.contact_ratio_min),
        (
            "transverse contact ratio",
            contact.transverse,
            limits.transverse_contact_ratio_min,
        ),
    ] {
        all.extend(limit.map(|limit| Constraint::above(name, "", value, limit)));
    }
    let sliding = figures.specific_sliding.max;
    let limit = limits.specific_sliding_max;
    all.extend(limit.map(|limit| Constraint::below("specific sliding", "", sliding, limit)));
    all.push(Constraint::below(
        "contact pressure",
        " MPa",
        figures.hertz_pressure_mpa,
        limits
            .hertz_pressure_max_mpa
            .unwrap_or(material.hertz_limit_mpa),
    ));
    let stress = limits.root_stress_max_mpa.unwrap_or(material.yield_mpa);
    let names = ["pinion root stress", "mate root stress"];
    for (name, value) in names.into_iter().zip(figures.root_stress_mpa) {
        all.push(Constraint::below(name, " MPa", value, stress));
    }
    let (root, flank) = (figures.iso_6336.root_safety, figures.iso_6336.flank_safety);
    for (names, unit, values, limit) in [
        (
            ["pinion tip clearance", "mate tip clearance"],
            " mm",
            figures.clearance_mm,
            Some(module * limits.tip_clearance_min_modules.unwrap_or_default()),
        ),
        (
            ["pinion tip land", "mate tip land"],
            " mm",
            figures.tip_land_mm,
            limits.tip_land_min_modules.map(|land| module * land),
        ),
        (
            ["pinion flank margin", "mate flank margin"],
            " mm",
            figures.flank_margin_mm,
            Some(limits.flank_margin_min_mm.unwrap_or_default()),
        ),
        (
            ["pinion root safety S_F", "mate root safety S_F"],
            "",
            root,
            limits.root_safety_min,
        ),
        (
            ["pinion flank safety S_H", "mate flank safety S_H"],
            "",
            flank,
            limits.flank_safety_min,
        ),
    ] {
        let Some(limit) = limit else { continue };
        let each = names.into_iter().zip(values);
        all.extend(each.map(|(name, value)| Constraint::at_least(name, unit, value, limit)));
    }
    all
}
