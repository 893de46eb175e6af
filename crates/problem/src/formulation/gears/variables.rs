//! The variables of a gear pair.

use serde::{Deserialize, Serialize};

use super::super::{Design, Quantity};
use crate::file::{CORRECTIONS, GearSections};

/// The number of variables of a gear pair.
pub const ALL_VARIABLES: usize = 11;

/// The names of the pair's variables in their order, as in exported columns.
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

/// The names of the corrections in their order, which follow those of the pair in campaigns with `[corrections]`.
const CORRECTION_NAMES: [&str; CORRECTIONS] = [
    "tip_relief_p_um",
    "tip_relief_r_um",
    "tip_relief_length_p_mm",
    "tip_relief_length_r_mm",
    "crowning_um",
    "helix_slope_um",
];

/// The names of all variables of a campaign's designs.
pub(super) fn variable_names(sections: &GearSections) -> impl Iterator<Item = &'static str> {
    let corrections = sections.corrections.iter().flat_map(|_| CORRECTION_NAMES);
    VARIABLE_NAMES.into_iter().chain(corrections)
}

/// All variables.
pub(in super::super) fn variables(sections: &GearSections) -> Vec<Quantity> {
    let names = variable_names(sections);
    names.map(|name| Quantity::of(name, "")).collect()
}

/// The eleven variables of a gear pair, as in the paper's (1). Two-element arrays are pinion, mate.
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

impl Design {
    /// The design as a gear pair, without its corrections.
    ///
    /// # Panics
    ///
    /// The design is not one of a gear problem.
    #[must_use]
    pub fn gears(&self) -> GearVariables {
        let values = self.values().first_chunk();
        GearVariables::of_values(*values.expect("a gear pair has eleven variables"))
    }
}

impl From<GearVariables> for Design {
    fn from(variables: GearVariables) -> Self {
        Self::new(variables.values().to_vec())
    }
}
