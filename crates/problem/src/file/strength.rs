//! `[strength]`: what a rating by ISO 6336 takes besides geometry, load and material.

use gear::rating;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::Source;
use super::{FileError, Material};

/// `[strength]`, optional: the factors of ISO 6336 that do not follow from the geometry. Two-element arrays are pinion,
/// mate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Strength {
    /// Edition of ISO 6336-3 by which the roots are rated, 2006 or 2019.
    pub edition: rating::Edition,
    /// Application factor K_A.
    pub application_factor: f64,
    /// Dynamic factor K_v.
    pub dynamic_factor: f64,
    /// Face load factor K_Hβ of the flanks, from which that of the roots follows.
    pub face_load_factor: f64,
    /// Transverse load factor K_Hα, for flanks and roots.
    pub transverse_load_factor: f64,
    /// Life factors of the roots Y_NT.
    pub root_life_factor: [f64; 2],
    /// Product of the other factors of the roots' strength, Y_δrelT Y_RrelT Y_X.
    pub root_factor: [f64; 2],
    /// Life factors of the flanks Z_NT.
    pub flank_life_factor: [f64; 2],
    /// Product of the other factors of the flanks' strength, Z_L Z_v Z_R Z_W Z_X: those of the lubricant and the surface.
    pub flank_factor: [f64; 2],
}

impl Default for Strength {
    fn default() -> Self {
        Self {
            edition: rating::Edition::default(),
            application_factor: 1.0,
            dynamic_factor: 1.0,
            face_load_factor: 1.0,
            transverse_load_factor: 1.0,
            root_life_factor: [1.0; 2],
            root_factor: [1.0; 2],
            flank_life_factor: [1.0; 2],
            flank_factor: [1.0; 2],
        }
    }
}

impl Strength {
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        for (key, factor) in [
            ("strength.application_factor", self.application_factor),
            ("strength.dynamic_factor", self.dynamic_factor),
            ("strength.face_load_factor", self.face_load_factor),
            (
                "strength.transverse_load_factor",
                self.transverse_load_factor,
            ),
        ] {
            source.within(key, factor, 0.1, 100.0, "")?;
        }
        for (key, factors) in [
            ("strength.root_life_factor", self.root_life_factor),
            ("strength.root_factor", self.root_factor),
            ("strength.flank_life_factor", self.flank_life_factor),
            ("strength.flank_factor", self.flank_factor),
        ] {
            for factor in factors {
                source.within(key, factor, 0.01, 100.0, "")?;
            }
        }
        Ok(())
    }

    /// The input of a rating, with the allowable stresses of a material.
    #[must_use]
    pub fn to_gear(&self, material: &Material) -> rating::Strength {
        let product = |a: [f64; 2], b: [f64; 2]| [a[0] * b[0], a[1] * b[1]];
        rating::Strength {
            edition: self.edition,
            application: self.application_factor,
            dynamic: self.dynamic_factor,
            face_load: self.face_load_factor,
            transverse_load: self.transverse_load_factor,
            root_factor: product(self.root_life_factor, self.root_factor),
            flank_factor: product(self.flank_life_factor, self.flank_factor),
            bending_limit_mpa: material.bending_limit_mpa,
            contact_limit_mpa: material.contact_limit_mpa,
        }
    }
}
