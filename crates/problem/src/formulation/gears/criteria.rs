//! The criteria of a gear pair and their representation in the store.

use gear::{inspection, rating};
use serde::{Deserialize, Serialize};

use super::super::{Analysis, Criteria, Quantity, State};
use crate::file::Load;

/// The criteria, in the order of the fields of [`GearCriteria`].
static CRITERIA: [Quantity; GearCriteria::COUNT] = [
    Quantity::of("contact_ratio", ""),
    Quantity::of("specific_sliding", ""),
    Quantity::of("hertz_pressure_mpa", "MPa"),
    Quantity::of("root_stress_mpa", "MPa"),
    Quantity::of("clearance_p_mm", "mm"),
    Quantity::of("clearance_r_mm", "mm"),
    Quantity::of("flank_margin_p_mm", "mm"),
    Quantity::of("flank_margin_r_mm", "mm"),
    Quantity::of("normal_module_mm", "mm"),
];

/// The deterministic responses of a pair, by name and unit.
static RESPONSES: [Quantity; 11] = [
    Quantity::of("contact_ratio", ""),
    Quantity::of("specific_sliding", ""),
    Quantity::of("hertz_pressure_mpa", "MPa"),
    Quantity::of("hertz_pressure_worn_mpa", "MPa"),
    Quantity::of("root_stress_mpa", "MPa"),
    Quantity::of("clearance_p_mm", "mm"),
    Quantity::of("clearance_r_mm", "mm"),
    Quantity::of("flank_margin_p_mm", "mm"),
    Quantity::of("flank_margin_r_mm", "mm"),
    Quantity::of("delta_ste_um", "µm"),
    Quantity::of("delta_ste_archard_um", "µm"),
];

/// Additional criteria and responses of campaigns that limit any of them, in the order of the
/// fields of [`GearDetails`].
static DETAILS: [Quantity; GearDetails::COUNT] = [
    Quantity::of("transverse_contact_ratio", ""),
    Quantity::of("pure_involute_mm", "mm"),
    Quantity::of("tip_land_p_mm", "mm"),
    Quantity::of("tip_land_r_mm", "mm"),
    Quantity::of("iso_root_stress_p_mpa", "MPa"),
    Quantity::of("iso_root_stress_r_mpa", "MPa"),
    Quantity::of("iso_flank_stress_p_mpa", "MPa"),
    Quantity::of("iso_flank_stress_r_mpa", "MPa"),
    Quantity::of("centre_distance_mm", "mm"),
];

/// The criteria of pairs, with or without details.
pub(in super::super) fn criteria(detailed: bool) -> Vec<Quantity> {
    with_details(&CRITERIA, detailed)
}

/// The responses of pairs, with or without details.
pub(in super::super) fn responses(detailed: bool) -> Vec<Quantity> {
    with_details(&RESPONSES, detailed)
}

fn with_details(quantities: &[Quantity], detailed: bool) -> Vec<Quantity> {
    let details = DETAILS.iter().filter(|_| detailed);
    quantities.iter().chain(details).cloned().collect()
}

/// The response that is measured: ΔSTE, combined over the cases of a load that has any.
pub(in super::super) const SAMPLED: Quantity = Quantity::of("delta_ste_um", "µm");

/// The responses of a sample: ΔSTE in each case.
pub(in super::super) fn sampled(load: &Load) -> Vec<Quantity> {
    if load.cases.is_empty() {
        return vec![SAMPLED];
    }
    let names = load.case_names().into_iter();
    names
        .map(|name| Quantity::new(&format!("delta_ste_{name}_um"), "µm"))
        .collect()
}

/// Largest plausible ΔSTE in µm: one metre. A larger number would distort every model that is fitted to it.
const MAX_DELTA_STE_UM: f64 = 1e6;

/// The criteria of a gear pair besides ΔSTE. Two-element arrays are pinion, mate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GearCriteria {
    /// ε_γ = ε_α + ε_β.
    pub contact_ratio: f64,
    /// ζ, the largest absolute specific sliding.
    pub specific_sliding: f64,
    /// p_H, the largest contact pressure, MPa.
    pub hertz_pressure_mpa: f64,
    /// σ_vm, the larger of the two root stresses, MPa.
    pub root_stress_mpa: f64,
    /// Clearance between tip and mating root, mm; negative if the tip penetrates the root.
    pub clearance_mm: [f64; 2],
    /// Distance of the end of the active flank from the fillet, in mm along the path of contact;
    /// negative if the mate's tip reaches into the fillet.
    pub flank_margin_mm: [f64; 2],
    /// Normal module, mm.
    pub normal_module_mm: f64,
    /// Additional criteria, if the campaign limits any of them.
    #[serde(skip)]
    pub details: Option<GearDetails>,
}

/// Criteria that few campaigns limit. Two-element arrays are pinion, mate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GearDetails {
    /// ε_α, the transverse contact ratio.
    pub transverse_contact_ratio: f64,
    /// Length of the path of contact without relief, mm; negative where reliefs are longer than the path.
    pub pure_involute_mm: f64,
    /// Thickness at the tip circle in the normal section, mm, as if the tip were not rounded.
    pub tip_land_mm: [f64; 2],
    /// σ_F, the root stress of ISO 6336-3 with the factors of `[strength]`, MPa.
    pub iso_root_stress_mpa: [f64; 2],
    /// σ_H, the contact stress of ISO 6336-2 with the factors of `[strength]`, MPa.
    pub iso_flank_stress_mpa: [f64; 2],
    /// Centre distance, mm.
    pub centre_distance_mm: f64,
}

impl GearCriteria {
    /// The number of criteria without details.
    const COUNT: usize = 9;

    /// The criteria of a pair, with the contact pressure of the relevant analysis in MPa. Its details are rated with
    /// `factors`, and left out without them.
    #[must_use]
    pub fn of_pair(
        pair: &gear::UnloadedPair,
        hertz_pressure_mpa: f64,
        factors: Option<&rating::Factors>,
    ) -> Self {
        let geometry = pair.geometry();
        let interference = pair.interference();
        let roots = pair.root_stress();
        Self {
            contact_ratio: geometry.eps_alpha_left() + geometry.eps_beta,
            specific_sliding: pair.sliding().max,
            hertz_pressure_mpa,
            root_stress_mpa: roots[0].stress_mpa.max(roots[1].stress_mpa),
            clearance_mm: interference.clearance,
            flank_margin_mm: interference.flank_margin,
            normal_module_mm: geometry.normal_module,
            details: factors.map(|factors| GearDetails::of_pair(pair, factors)),
        }
    }

    /// The criteria with these values, in the order of the fields; `None` if their number fits
    /// neither form. Bounds of limited measures may follow the details.
    #[must_use]
    pub fn of_values(values: &[f64]) -> Option<Self> {
        let (first, details) = values.split_at_checked(Self::COUNT)?;
        let &[a, b, c, d, e, f, g, h, normal_module_mm] = first else {
            return None;
        };
        Some(Self {
            contact_ratio: a,
            specific_sliding: b,
            hertz_pressure_mpa: c,
            root_stress_mpa: d,
            clearance_mm: [e, f],
            flank_margin_mm: [g, h],
            normal_module_mm,
            details: GearDetails::of_values(&details[..details.len().min(GearDetails::COUNT)])?,
        })
    }

    /// All values, in the order of the fields.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let mut values = vec![
            self.contact_ratio,
            self.specific_sliding,
            self.hertz_pressure_mpa,
            self.root_stress_mpa,
            self.clearance_mm[0],
            self.clearance_mm[1],
            self.flank_margin_mm[0],
            self.flank_margin_mm[1],
            self.normal_module_mm,
        ];
        values.extend(self.details.iter().flat_map(GearDetails::values));
        values
    }
}

impl GearDetails {
    const COUNT: usize = 9;

    fn of_pair(pair: &gear::UnloadedPair, factors: &rating::Factors) -> Self {
        let geometry = pair.geometry();
        let rating = rating::rate(pair, 1.0, factors);
        Self {
            transverse_contact_ratio: geometry.eps_alpha_left(),
            pure_involute_mm: pair.corrections().pure_involute(geometry),
            tip_land_mm: inspection::tip_land(geometry),
            iso_root_stress_mpa: rating.root_stress_mpa,
            iso_flank_stress_mpa: rating.flank_stress_mpa,
            centre_distance_mm: geometry.centre_distance,
        }
    }

    /// The details with these values, in the order of the fields; `Some(None)` for an empty list.
    fn of_values(values: &[f64]) -> Option<Option<Self>> {
        match *values {
            [] => Some(None),
            [a, pure_involute_mm, b, c, d, e, f, g, centre_distance_mm] => Some(Some(Self {
                transverse_contact_ratio: a,
                pure_involute_mm,
                tip_land_mm: [b, c],
                iso_root_stress_mpa: [d, e],
                iso_flank_stress_mpa: [f, g],
                centre_distance_mm,
            })),
            _ => None,
        }
    }

    fn values(&self) -> [f64; Self::COUNT] {
        let land = self.tip_land_mm;
        let (root, flank) = (self.iso_root_stress_mpa, self.iso_flank_stress_mpa);
        [
            self.transverse_contact_ratio,
            self.pure_involute_mm,
            land[0],
            land[1],
            root[0],
            root[1],
            flank[0],
            flank[1],
            self.centre_distance_mm,
        ]
    }
}

/// Whether a response belongs to the analysis in this state.
pub(in super::super) fn belongs_to(response: &str, state: State) -> bool {
    let of_the_other = match state {
        State::Nominal => ["hertz_pressure_worn_mpa", "delta_ste_archard_um"],
        State::Baseline => ["hertz_pressure_mpa", "delta_ste_um"],
    };
    !of_the_other.contains(&response)
}

/// The responses of a pair, from its analyses without wear and with Archard's wear.
pub(in super::super) fn responses_of(unworn: &Analysis, worn: &Analysis) -> Vec<f64> {
    let criteria = unworn.criteria.gears();
    let mut responses = vec![
        criteria.contact_ratio,
        criteria.specific_sliding,
        criteria.hertz_pressure_mpa,
        worn.criteria.gears().hertz_pressure_mpa,
        criteria.root_stress_mpa,
        criteria.clearance_mm[0],
        criteria.clearance_mm[1],
        criteria.flank_margin_mm[0],
        criteria.flank_margin_mm[1],
        unworn.value,
        worn.value,
    ];
    responses.extend(criteria.details.iter().flat_map(GearDetails::values));
    responses
}

/// Checks that the ΔSTE of both states are plausible.
pub(in super::super) fn check(response: impl Fn(&str) -> Option<f64>) -> Result<(), String> {
    for (name, state) in [
        ("delta_ste_um", "unworn"),
        ("delta_ste_archard_um", "with Archard's wear"),
    ] {
        let value = response(name).unwrap_or(f64::NAN);
        check_delta_ste(value).map_err(|why| format!("ΔSTE {state} {why}"))?;
    }
    Ok(())
}

/// Checks that a ΔSTE is plausible: as the difference of a largest and a smallest error it cannot
/// be negative.
///
/// # Errors
///
/// A sentence without its subject: the value and the valid range.
pub(in super::super) fn check_delta_ste(delta_ste_um: f64) -> Result<(), String> {
    if (0.0..=MAX_DELTA_STE_UM).contains(&delta_ste_um) {
        return Ok(());
    }
    Err(format!(
        "is {delta_ste_um:e} µm, but a ΔSTE lies between 0 and {MAX_DELTA_STE_UM:e} µm"
    ))
}

/// The analysis in the responses of a pair with this module.
pub(in super::super) fn analysis(
    responses: &[f64],
    state: State,
    normal_module_mm: f64,
) -> Option<Analysis> {
    let (first, details) = responses.split_at_checked(RESPONSES.len())?;
    let &[
        contact_ratio,
        specific_sliding,
        unworn_mpa,
        worn_mpa,
        root_stress_mpa,
        clearance_p,
        clearance_r,
        margin_p,
        margin_r,
        delta_ste_um,
        delta_ste_archard_um,
    ] = first
    else {
        return None;
    };
    let (hertz_pressure_mpa, value) = match state {
        State::Nominal => (unworn_mpa, delta_ste_um),
        State::Baseline => (worn_mpa, delta_ste_archard_um),
    };
    let criteria = GearCriteria {
        contact_ratio,
        specific_sliding,
        hertz_pressure_mpa,
        root_stress_mpa,
        clearance_mm: [clearance_p, clearance_r],
        flank_margin_mm: [margin_p, margin_r],
        normal_module_mm,
        details: GearDetails::of_values(details)?,
    };
    Some(Analysis {
        value,
        criteria: Criteria::from(criteria),
    })
}

impl Criteria {
    /// The criteria of a gear pair.
    ///
    /// # Panics
    ///
    /// The criteria are not those of a gear problem.
    #[must_use]
    pub fn gears(&self) -> GearCriteria {
        GearCriteria::of_values(self.values())
            .expect("a gear pair has nine criteria, or with details eighteen")
    }
}

impl From<GearCriteria> for Criteria {
    fn from(criteria: GearCriteria) -> Self {
        Self::new(criteria.values().to_vec())
    }
}
