//! The gear pair: its variables and criteria by name, and how a design becomes a pair.

use gear::{Discretisation, PairInput};
use serde::{Deserialize, Serialize};

use super::{Constraint, Criteria, Design, Quantity, Variable};
use crate::file::{GearSections, gear_size};
use crate::simulator::{Analysis, State};

/// The number of variables of a gear pair.
pub const ALL_VARIABLES: usize = 11;

/// Those that the DoE moves, the first of [`VARIABLE_NAMES`].
const FREE: usize = 6;

/// What a pair is judged by, in the order of the fields of [`GearCriteria`].
pub(super) static CRITERIA: [Quantity; 9] = [
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

/// The names of all variables in their order, as in exported columns.
pub const VARIABLE_NAMES: [&str; ALL_VARIABLES] = [
    "x_p",
    "x_r",
    "ha0_p",
    "ha0_r",
    "hf0_p",
    "hf0_r",
    "rho_a_p_mm",
    "rho_a_r_mm",
    "rho_f_p_mm",
    "rho_f_r_mm",
    "beta_deg",
];

/// What is known of a pair without random wear: its responses, by name and unit.
pub(super) static RESPONSES: [Quantity; 11] = [
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

/// The response that is sampled.
pub(super) const SAMPLED: Quantity = Quantity::of("delta_ste_um", "µm");

/// The largest ΔSTE that is believed, µm: a metre. A number beyond it would make everything that is
/// learned from it worthless.
const MAX_DELTA_STE_UM: f64 = 1e6;

/// A gear pair's eleven variables, those of the paper's (1). Pairs are pinion, mate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GearVariables {
    /// Addendum modification coefficients.
    pub profile_shift: [f64; 2],
    /// Tool addendum, modules.
    pub tool_addendum: [f64; 2],
    /// Tool dedendum, modules.
    pub tool_dedendum: [f64; 2],
    /// Tip rounding radii, mm.
    pub tip_radius_mm: [f64; 2],
    /// Root fillet radii, mm.
    pub root_radius_mm: [f64; 2],
    /// Helix angle, degrees.
    pub helix_angle_deg: f64,
}

impl GearVariables {
    /// The variables with these values, in the order of [`VARIABLE_NAMES`].
    #[must_use]
    pub const fn of_values(values: [f64; ALL_VARIABLES]) -> Self {
        let [a, b, c, d, e, f, g, h, i, j, helix_angle_deg] = values;
        Self {
            profile_shift: [a, b],
            tool_addendum: [c, d],
            tool_dedendum: [e, f],
            tip_radius_mm: [g, h],
            root_radius_mm: [i, j],
            helix_angle_deg,
        }
    }

    /// All values, in the order of [`VARIABLE_NAMES`].
    #[must_use]
    pub const fn values(&self) -> [f64; ALL_VARIABLES] {
        let (x, addendum, dedendum) = (self.profile_shift, self.tool_addendum, self.tool_dedendum);
        let (tip, root) = (self.tip_radius_mm, self.root_radius_mm);
        [
            x[0],
            x[1],
            addendum[0],
            addendum[1],
            dedendum[0],
            dedendum[1],
            tip[0],
            tip[1],
            root[0],
            root[1],
            self.helix_angle_deg,
        ]
    }
}

/// What a gear pair is judged by besides ΔSTE. Pairs are pinion, mate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GearCriteria {
    /// r_c = ε_α + ε_β.
    pub contact_ratio: f64,
    /// g_s, the largest absolute specific sliding.
    pub specific_sliding: f64,
    /// F, the largest contact pressure, MPa.
    pub hertz_pressure_mpa: f64,
    /// σ_vm, the larger of the two root stresses, MPa.
    pub root_stress_mpa: f64,
    /// Clearance between tip and mating root, mm; negative when a tip is pressed in.
    pub clearance_mm: [f64; 2],
    /// How far the active flank ends above the fillet, mm along the path of contact; negative when
    /// the mate's tip runs into the fillet.
    pub flank_margin_mm: [f64; 2],
    /// Normal module, mm.
    pub normal_module_mm: f64,
}

impl GearCriteria {
    /// The criteria with these values, in the order of the fields.
    #[must_use]
    pub const fn of_values(values: [f64; 9]) -> Self {
        let [a, b, c, d, e, f, g, h, normal_module_mm] = values;
        Self {
            contact_ratio: a,
            specific_sliding: b,
            hertz_pressure_mpa: c,
            root_stress_mpa: d,
            clearance_mm: [e, f],
            flank_margin_mm: [g, h],
            normal_module_mm,
        }
    }

    /// All values, in the order of the fields.
    #[must_use]
    pub const fn values(&self) -> [f64; 9] {
        [
            self.contact_ratio,
            self.specific_sliding,
            self.hertz_pressure_mpa,
            self.root_stress_mpa,
            self.clearance_mm[0],
            self.clearance_mm[1],
            self.flank_margin_mm[0],
            self.flank_margin_mm[1],
            self.normal_module_mm,
        ]
    }
}

/// What a campaign's pairs share.
#[derive(Debug, Clone)]
pub struct Gears {
    sections: GearSections,
    template: PairInput,
    wear: gear::Wear,
    discretisation: Discretisation,
}

impl Gears {
    /// What the pairs of a validated campaign share.
    pub(super) fn new(sections: &GearSections) -> Self {
        let pair = &sections.pair;
        let template = PairInput {
            teeth: pair.teeth(),
            size: gear_size(pair.centre_distance_mm, pair.normal_module_mm),
            pressure_angle: pair.pressure_angle_deg.to_radians(),
            helix_angle: 0.0,
            face_width: pair.face_width_mm,
            profile_shift: [0.0; 2],
            tool_addendum: [1.0; 2],
            tool_dedendum: [1.0; 2],
            tip_radius: [0.0; 2],
            root_radius: [0.1; 2],
            tip_diameter: [None; 2],
            tooth_model: pair
                .tooth_model
                .parse()
                .expect("validation has parsed this name"),
            tip_rule: pair
                .tip_rule
                .parse()
                .expect("validation has parsed this name"),
            pinion_torque: sections.load.pinion_torque_nm * 1e3,
            material: sections.material.to_gear(),
        };
        Self {
            template,
            wear: sections.wear.to_gear(),
            discretisation: Discretisation::default(),
            sections: sections.clone(),
        }
    }

    /// The wear field.
    #[must_use]
    pub const fn wear(&self) -> &gear::Wear {
        &self.wear
    }

    /// The simulator's input for a design.
    #[must_use]
    pub fn pair_input(&self, design: &Design) -> PairInput {
        let variables = design.gears();
        PairInput {
            helix_angle: variables.helix_angle_deg.to_radians(),
            profile_shift: variables.profile_shift,
            tool_addendum: variables.tool_addendum,
            tool_dedendum: variables.tool_dedendum,
            tip_radius: variables.tip_radius_mm,
            root_radius: variables.root_radius_mm,
            ..self.template.clone()
        }
    }

    /// The normal module of a design in mm, which follows from the campaign's centre distance.
    ///
    /// # Errors
    ///
    /// The involute equation has no solution.
    pub fn normal_module(&self, design: &Design) -> Result<f64, gear::Infeasible> {
        let variables = design.gears();
        let [pinion, mate] = variables.profile_shift;
        self.module_of(variables.helix_angle_deg, pinion + mate)
    }

    fn module_of(&self, helix_angle_deg: f64, shift: f64) -> Result<f64, gear::Infeasible> {
        let template = &self.template;
        gear::normal_module(
            template.teeth,
            template.size,
            template.pressure_angle,
            helix_angle_deg.to_radians(),
            shift,
        )
    }

    /// How finely pairs are discretised.
    pub(crate) const fn discretisation(&self) -> &Discretisation {
        &self.discretisation
    }

    /// Geometry and compliance of a design.
    ///
    /// # Errors
    ///
    /// Why the design cannot be simulated.
    pub fn pair(&self, design: &Design) -> Result<gear::Pair, gear::Error> {
        gear::Pair::new(&self.pair_input(design), &self.discretisation)
    }

    /// The criteria of a pair, with the contact pressure of the analysis that matters, in MPa.
    #[must_use]
    pub fn pair_criteria(&self, pair: &gear::Pair, hertz_pressure_mpa: f64) -> GearCriteria {
        let geometry = pair.geometry();
        let interference = pair.interference();
        let roots = pair.root_stress();
        GearCriteria {
            contact_ratio: geometry.contact_ratio,
            specific_sliding: pair.sliding().max,
            hertz_pressure_mpa,
            root_stress_mpa: roots[0].stress_mpa.max(roots[1].stress_mpa),
            clearance_mm: interference.clearance,
            flank_margin_mm: interference.flank_margin,
            normal_module_mm: geometry.normal_module,
        }
    }

    /// The design at `unit` in the unit cube of all eleven variables.
    ///
    /// The radii's bounds are multiples of the design's own module (the paper's (3)), so the last
    /// step of the scaling solves for it.
    ///
    /// # Errors
    ///
    /// The involute equation has no solution, so there is no module.
    pub fn full_point(&self, unit: &[f64]) -> Result<Design, gear::Infeasible> {
        let bounds = &self.sections.bounds;
        let ranges = free_ranges(&self.sections).into_iter().zip(unit);
        let mut values: Vec<f64> = ranges
            .map(|(range, &unit)| super::scale(range, unit))
            .collect();
        let helix_angle_deg = super::scale(bounds.helix_angle_deg, unit[10]);
        let module = self.module_of(helix_angle_deg, values[0] + values[1])?;
        let (tip, root) = (bounds.tip_radius_modules, bounds.root_radius_modules);
        let radii = [tip, tip, root, root].into_iter().zip(&unit[FREE..]);
        values.extend(radii.map(|(range, &unit)| module * super::scale(range, unit)));
        values.push(helix_angle_deg);
        Ok(Design::new(values))
    }

    /// Every constraint of (3) or (7), with how far a pair is from breaking it.
    pub(super) fn constraints(&self, criteria: &GearCriteria) -> Vec<Constraint> {
        let limits = &self.sections.constraints;
        let material = &self.sections.material;
        let not_negative = |name: &'static str, value| Constraint {
            scale: criteria.normal_module_mm,
            ..Constraint::at_least(name, " mm", value, 0.0)
        };
        let (sliding, root) = (criteria.specific_sliding, criteria.root_stress_mpa);
        let pressure = criteria.hertz_pressure_mpa;
        vec![
            Constraint::above("r_c", "", criteria.contact_ratio, limits.contact_ratio_min),
            Constraint::below("g_s", "", sliding, limits.specific_sliding_max),
            Constraint::below("σ_vm", " MPa", root, material.yield_mpa),
            Constraint::below("F", " MPa", pressure, material.hertz_limit_mpa),
            not_negative("pinion tip clearance", criteria.clearance_mm[0]),
            not_negative("mate tip clearance", criteria.clearance_mm[1]),
            not_negative("pinion flank margin", criteria.flank_margin_mm[0]),
            not_negative("mate flank margin", criteria.flank_margin_mm[1]),
        ]
    }
}

/// A pair's variables; the DoE moves those with a range.
pub(super) fn variables(sections: &GearSections) -> Vec<Variable> {
    let ranges = free_ranges(sections);
    let variable = |(index, name): (usize, &&'static str)| Variable {
        name: (*name).into(),
        unit: "".into(),
        range: ranges.get(index).copied(),
    };
    VARIABLE_NAMES.iter().enumerate().map(variable).collect()
}

/// The ranges of the variables that the DoE moves.
fn free_ranges(sections: &GearSections) -> [[f64; 2]; FREE] {
    let bounds = &sections.bounds;
    let (shift, addendum) = (bounds.profile_shift, bounds.tool_addendum);
    let dedendum = bounds.tool_dedendum;
    [shift, shift, addendum, addendum, dedendum, dedendum]
}

/// The values that the campaign file gives to the variables that the DoE leaves alone.
pub(super) fn base(sections: &GearSections) -> Design {
    let frozen = &sections.frozen;
    let variables = GearVariables {
        profile_shift: [0.0; 2],
        tool_addendum: [0.0; 2],
        tool_dedendum: [0.0; 2],
        tip_radius_mm: frozen.tip_radius_mm,
        root_radius_mm: frozen.root_radius_mm,
        helix_angle_deg: frozen.helix_angle_deg,
    };
    variables.into()
}

/// Whether a response is one of a pair in this state.
pub(super) fn belongs_to(response: &str, state: State) -> bool {
    let of_the_other = match state {
        State::Nominal => ["hertz_pressure_worn_mpa", "delta_ste_archard_um"],
        State::Baseline => ["hertz_pressure_mpa", "delta_ste_um"],
    };
    !of_the_other.contains(&response)
}

/// The responses of a pair, from its analyses unworn and with Archard's wear.
pub(super) fn responses(unworn: &Analysis, worn: &Analysis) -> Vec<f64> {
    let criteria = unworn.criteria.gears();
    vec![
        criteria.contact_ratio,
        criteria.specific_sliding,
        criteria.hertz_pressure_mpa,
        worn.criteria.gears().hertz_pressure_mpa,
        criteria.root_stress_mpa,
        criteria.clearance_mm[0],
        criteria.clearance_mm[1],
        criteria.flank_margin_mm[0],
        criteria.flank_margin_mm[1],
        unworn.value_um,
        worn.value_um,
    ]
}

/// Whether the ΔSTE of both states can be one.
pub(super) fn check(response: impl Fn(&str) -> Option<f64>) -> Result<(), String> {
    for (name, state) in [
        ("delta_ste_um", "unworn"),
        ("delta_ste_archard_um", "with Archard's wear"),
    ] {
        let value_um = response(name).unwrap_or(f64::NAN);
        check_delta_ste(value_um).map_err(|why| format!("ΔSTE {state} {why}"))?;
    }
    Ok(())
}

/// Whether a ΔSTE can be one: the difference of a largest and a smallest error is not negative.
///
/// # Errors
///
/// A sentence without subject: what it is, and what it would have to be.
pub(super) fn check_delta_ste(delta_ste_um: f64) -> Result<(), String> {
    if (0.0..=MAX_DELTA_STE_UM).contains(&delta_ste_um) {
        return Ok(());
    }
    Err(format!(
        "is {delta_ste_um:e} µm, but a ΔSTE lies between 0 and {MAX_DELTA_STE_UM:e} µm"
    ))
}

/// The analysis that the responses hold, of a pair with this module.
pub(super) fn analysis(responses: &[f64], state: State, normal_module_mm: f64) -> Option<Analysis> {
    let [
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
    ] = *responses
    else {
        return None;
    };
    let (hertz_pressure_mpa, value_um) = match state {
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
    };
    Some(Analysis {
        value_um,
        criteria: Criteria::from(criteria),
    })
}
