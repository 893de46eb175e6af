//! `[manufacture]`: the scatter of manufacture and assembly.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::{InvalidValue, Source};

/// `[manufacture]`, optional. Without it flanks are as designed and shafts parallel.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Manufacture {
    /// Flank tolerance class of both gears by ISO 1328-1, from 1, the finest, to 11.
    pub flank_class: Option<gear::FlankClass>,
    /// Tolerance ± of the misalignment of the shafts over the face width, µm in the plane of action; three
    /// standard deviations. Must be absent with the tooth model `whole-face-beam`.
    pub misalignment_um: Option<f64>,
    /// Tolerance ± of the amounts of tip relief, µm; three standard deviations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_relief_tolerance_um: Option<f64>,
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
            .map(|um| format!("misalignment of the shafts ±{um} µm over the face"));
        let relief = self
            .tip_relief_tolerance_um
            .map(|um| format!("amounts of tip relief ±{um} µm"));
        let known = class.into_iter().chain(misalignment).chain(relief);
        let known: Vec<String> = known.collect();
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
            tip_relief: 1e-3 * self.tip_relief_tolerance_um.unwrap_or_default(),
            ..gear::Scatter::default()
        }
    }

    pub(super) fn validate(
        &self,
        source: Source<'_>,
        model: gear::ToothModel,
    ) -> Result<(), FileError> {
        if *self == Self::default() {
            return Err(source.error(InvalidValue::in_words(
                "manufacture",
                "empty",
                "a section with flank_class, misalignment_um or tip_relief_tolerance_um",
            )));
        }
        if let Some(um) = self.tip_relief_tolerance_um {
            let key = "manufacture.tip_relief_tolerance_um";
            source.within(key, um, 0.0, 1000.0, "µm")?;
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
