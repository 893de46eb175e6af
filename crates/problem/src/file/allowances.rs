//! `[allowances]`: how far tooth thicknesses and the centre distance may differ from the nominal ones.

use gear::inspection;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// The largest allowance, µm.
const MOST_UM: f64 = 10_000.0;

/// `[allowances]`, optional, for the data sheet: thicknesses, their measures and the backlash get limits. ΔSTE is that of
/// the nominal gears.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Allowances {
    /// Upper and lower allowances E_sns and E_sni of the normal tooth thickness, µm.
    pub tooth_thickness_um: ThicknessAllowances,
    /// Tolerance ± of the centre distance, µm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_distance_um: Option<f64>,
}

/// Upper and lower allowances of both gears, µm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThicknessAllowances {
    /// `[upper, lower]` of the pinion.
    pub pinion: [f64; 2],
    /// `[upper, lower]` of the mate.
    pub mate: [f64; 2],
}

impl Allowances {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let thickness = &self.tooth_thickness_um;
        for (gear, [upper, lower]) in [("pinion", thickness.pinion), ("mate", thickness.mate)] {
            let key = "allowances.tooth_thickness_um";
            source.within(key, upper, -MOST_UM, MOST_UM, "µm")?;
            source.within(key, lower, -MOST_UM, MOST_UM, "µm")?;
            let expected = format!("[upper, lower] with lower ≤ upper for the {gear}");
            source.require(lower <= upper, key, [upper, lower], &expected)?;
        }
        self.centre_distance_um.map_or(Ok(()), |um| {
            source.within("allowances.centre_distance_um", um, 0.0, MOST_UM, "µm")
        })
    }

    /// The allowances in mm.
    #[must_use]
    pub fn to_gear(&self) -> inspection::Allowances {
        let thickness = &self.tooth_thickness_um;
        inspection::Allowances {
            tooth_thickness: [thickness.pinion, thickness.mate].map(|um| um.map(|um| 1e-3 * um)),
            centre_distance: 1e-3 * self.centre_distance_um.unwrap_or_default(),
        }
    }
}
