//! The pair file of a campaign's design.

use super::super::Design;
use crate::file::{GearSections, PairCorrections, PairFile, PairSection};

impl PairFile {
    /// The pair file of one design of a gear campaign, with the campaign's load, material, wear, flank
    /// class and limits.
    #[must_use]
    pub fn of_design(sections: &GearSections, design: &Design) -> Self {
        let pair = &sections.pair;
        let corrections = PairCorrections::of_gear(&sections.corrections_of(design));
        let design = design.gears();
        Self {
            pair: PairSection {
                teeth: pair.teeth(),
                // If the campaign gives both, the design's profile shifts already agree with them.
                centre_distance_mm: match pair.normal_module_mm {
                    Some(_) => None,
                    None => pair.centre_distance_mm,
                },
                normal_module_mm: pair.normal_module_mm,
                pressure_angle_deg: pair.pressure_angle_deg,
                helix_angle_deg: design.helix_angle_deg,
                face_width_mm: pair.face_width_mm,
                profile_shift: design.profile_shift,
                rack: None,
                tool_addendum: Some(design.tool_addendum),
                tool_dedendum: Some(design.tool_dedendum),
                tip_radius_mm: design.tip_radius_mm,
                root_radius_mm: Some(design.root_radius_mm),
                tip_diameter_mm: None,
                tooth_model: pair.tooth_model,
                tip_rule: pair.tip_rule,
                hub_radius_mm: pair.hub_radius_mm,
            },
            load: sections.load.clone(),
            material: sections.material,
            strength: sections.strength,
            wear: sections.wear,
            manufacture: sections.manufacture,
            allowances: sections.allowances,
            corrections,
            constraints: Some(sections.constraints),
        }
    }
}
