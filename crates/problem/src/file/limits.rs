//! `[constraints]` on gear pairs, in campaign and pair files.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::Source;
use super::{FileError, Materials};

/// `[constraints]`: limits of a gear pair. Every key is optional. A criterion without a limit is
/// not constrained, unless a default is given here.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GearLimits {
    /// Lower limit of the total contact ratio ε_α + ε_β, exclusive.
    pub contact_ratio_min: Option<f64>,
    /// Lower limit of the transverse contact ratio ε_α, exclusive.
    pub transverse_contact_ratio_min: Option<f64>,
    /// Upper limit of the largest absolute specific sliding, exclusive.
    pub specific_sliding_max: Option<f64>,
    /// Upper limit of the largest contact pressure in MPa, exclusive. The material's
    /// `contact_limit_mpa` if absent.
    pub hertz_pressure_max_mpa: Option<f64>,
    /// Upper limit of the 2009 paper's root stresses in MPa, exclusive: the whole load on the tip of one tooth. For the
    /// strength by ISO 6336 see `root_safety_min`.
    pub root_stress_max_mpa: Option<f64>,
    /// Smallest clearance between a tip and the mate's root, in normal modules. Zero if absent.
    pub tip_clearance_min_modules: Option<f64>,
    /// Smallest thickness of a tooth at its tip circle in the normal section, in normal modules.
    pub tip_land_min_modules: Option<f64>,
    /// Smallest length of involute between the fillet and the active flank, in mm along the path of
    /// contact. Zero if absent.
    pub flank_margin_min_mm: Option<f64>,
    /// Smallest length of the path of contact on which no tip relief takes material off, mm. Zero for pairs with tip
    /// relief if absent: what is relieved must not be longer than the path.
    pub pure_involute_min_mm: Option<f64>,
    /// Smallest safety of the roots S_F by ISO 6336-3, with the factors of `[strength]`.
    pub root_safety_min: Option<f64>,
    /// Smallest safety of the flanks S_H by ISO 6336-2, with the factors of `[strength]`.
    pub flank_safety_min: Option<f64>,
    /// Smallest normal module, mm.
    pub normal_module_min_mm: Option<f64>,
    /// Largest normal module, mm.
    pub normal_module_max_mm: Option<f64>,
    /// Smallest centre distance, mm.
    pub centre_distance_min_mm: Option<f64>,
    /// Largest centre distance, mm.
    pub centre_distance_max_mm: Option<f64>,
}

impl GearLimits {
    /// Whether any limit is on a quantity that only
    /// [`GearDetails`](crate::formulation::gears::GearDetails) have.
    pub(crate) fn need_details(&self) -> bool {
        [
            self.transverse_contact_ratio_min,
            self.tip_land_min_modules,
            self.pure_involute_min_mm,
            self.root_safety_min,
            self.flank_safety_min,
            self.centre_distance_min_mm,
            self.centre_distance_max_mm,
        ]
        .iter()
        .any(Option::is_some)
    }

    /// The limits with the default of `pure_involute_min_mm`: zero for pairs with tip relief, none for others.
    pub(crate) fn of_relieved(self, is_relieved: bool) -> Self {
        let least = is_relieved.then_some(0.0);
        Self {
            pure_involute_min_mm: self.pure_involute_min_mm.or(least),
            ..self
        }
    }

    /// The upper limit of the contact pressure of a material with this σ_Hlim, in MPa.
    #[must_use]
    pub fn hertz_pressure_max(&self, contact_limit_mpa: f64) -> f64 {
        self.hertz_pressure_max_mpa.unwrap_or(contact_limit_mpa)
    }

    /// Whether anything limits the stress of the roots.
    #[must_use]
    pub const fn limit_roots(&self) -> bool {
        self.root_safety_min.is_some() || self.root_stress_max_mpa.is_some()
    }

    /// Requires the material's numbers that the limits are compared with.
    pub(super) fn needs_of(
        &self,
        material: &Materials,
        source: Source<'_>,
    ) -> Result<(), FileError> {
        if self.root_safety_min.is_none() {
            return Ok(());
        }
        material.tables().try_for_each(|(place, one)| match one.bending_limit_mpa {
            Some(_) => Ok(()),
            None => Err(source.missing(
                &format!("{place}.bending_limit_mpa"),
                "given (σ_FE of ISO 6336-5), because constraints.root_safety_min compares the roots with it",
            )),
        })
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        for (key, limit) in [
            ("constraints.contact_ratio_min", self.contact_ratio_min),
            (
                "constraints.transverse_contact_ratio_min",
                self.transverse_contact_ratio_min,
            ),
            (
                "constraints.specific_sliding_max",
                self.specific_sliding_max,
            ),
            (
                "constraints.hertz_pressure_max_mpa",
                self.hertz_pressure_max_mpa,
            ),
            ("constraints.root_stress_max_mpa", self.root_stress_max_mpa),
            ("constraints.root_safety_min", self.root_safety_min),
            ("constraints.flank_safety_min", self.flank_safety_min),
            (
                "constraints.normal_module_min_mm",
                self.normal_module_min_mm,
            ),
            (
                "constraints.normal_module_max_mm",
                self.normal_module_max_mm,
            ),
            (
                "constraints.centre_distance_min_mm",
                self.centre_distance_min_mm,
            ),
            (
                "constraints.centre_distance_max_mm",
                self.centre_distance_max_mm,
            ),
        ] {
            limit.map_or(Ok(()), |limit| source.positive(key, limit))?;
        }
        for (key, limit) in [
            (
                "constraints.tip_clearance_min_modules",
                self.tip_clearance_min_modules,
            ),
            (
                "constraints.tip_land_min_modules",
                self.tip_land_min_modules,
            ),
            ("constraints.flank_margin_min_mm", self.flank_margin_min_mm),
            (
                "constraints.pure_involute_min_mm",
                self.pure_involute_min_mm,
            ),
        ] {
            limit.map_or(Ok(()), |limit| source.not_negative(key, limit))?;
        }
        Ok(())
    }
}
