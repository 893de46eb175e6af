//! Sections common to the campaign file and the pair file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::{InvalidValue, Source};

/// `[load]`
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Torque on the pinion, N·m.
    pub pinion_torque_nm: f64,
}

/// `[manufacture]`, optional. Without it flanks are as designed and shafts parallel.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Manufacture {
    /// Flank tolerance class of both gears by ISO 1328-1, from 1, the finest, to 11.
    pub flank_class: Option<gear::FlankClass>,
    /// Tolerance ± of the misalignment of the shafts over the face width, µm in the plane of action; three
    /// standard deviations. The tooth model `whole-face-beam` does not know of it.
    pub misalignment_um: Option<f64>,
}

impl Load {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        source.between("load.pinion_torque_nm", self.pinion_torque_nm, 0.0, 1e12)
    }
}

impl Manufacture {
    /// The random effects besides the wear, and the neglected ones, in words.
    #[must_use]
    pub fn describe(&self) -> String {
        let class = self.flank_class.map(|class| {
            format!(
                "flank class {} of ISO 1328-1: profile slopes, and with all tooth models but \
                 whole-face-beam helix slopes, deviate at random, alike on all teeth of a gear",
                class.number()
            )
        });
        let misalignment = self
            .misalignment_um
            .map(|um| format!("shafts out of line by up to {um} µm over the face"));
        let known: Vec<String> = class.into_iter().chain(misalignment).collect();
        format!(
            "{}; no pitch or form deviations, no dynamics",
            known.join("; ")
        )
    }

    /// The scatter as the simulator's input.
    #[must_use]
    pub fn to_gear(&self) -> gear::Scatter {
        gear::Scatter {
            flank_class: self.flank_class,
            misalignment: 1e-3 * self.misalignment_um.unwrap_or_default(),
        }
    }

    pub(super) fn validate(
        &self,
        source: Source<'_>,
        model: gear::ToothModel,
    ) -> Result<(), FileError> {
        if self.flank_class.is_none() && self.misalignment_um.is_none() {
            return Err(source.error(InvalidValue::in_words(
                "manufacture",
                "empty",
                "a section with flank_class, misalignment_um or both",
            )));
        }
        self.misalignment_um.map_or(Ok(()), |um| {
            let key = "manufacture.misalignment_um";
            source.require(
                model.knows_the_face(),
                key,
                um,
                "absent when pair.tooth_model is \"whole-face-beam\"",
            )?;
            source.within(key, um, 0.0, 1000.0, "µm")
        })
    }
}
