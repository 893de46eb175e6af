//! The text of a pair file with values from REXS.

use std::fmt::{Debug, Write as _};

use problem::PairFile;
use problem::file::FaceWidth;

/// Lengths that differ by less are equal, mm.
pub(super) const SAME_MM: f64 = 1e-6;

/// The corrections of a pair file.
#[derive(Default)]
pub(super) struct Corrections {
    pub(super) relief_um: [f64; 2],
    pub(super) relief_length_mm: [f64; 2],
    pub(super) relief_shapes: Vec<String>,
    pub(super) crowning_um: f64,
    pub(super) slope_um: f64,
    pub(super) misalignment_um: f64,
}

/// The values of a pair file; lengths in mm, angles in degrees.
pub(super) struct Pair {
    pub(super) teeth: [u32; 2],
    pub(super) module: f64,
    pub(super) distance: Option<f64>,
    pub(super) pressure_angle: f64,
    pub(super) helix_angle: f64,
    pub(super) face_width: FaceWidth,
    pub(super) shift: [f64; 2],
    /// Addendum, dedendum and tip radius, modules.
    pub(super) tools: [[f64; 3]; 2],
    pub(super) tip_radius: [f64; 2],
    pub(super) tip_diameter: Option<[f64; 2]>,
    pub(super) hub_diameter: Option<[f64; 2]>,
    pub(super) tooth_model: Option<String>,
    pub(super) torque_nm: f64,
    /// The tables of the materials.
    pub(super) materials: String,
    pub(super) class: Option<f64>,
    pub(super) corrections: Corrections,
}

/// Sizes that a pair file states only if they do not follow from the others, mm.
#[derive(Default)]
pub(super) struct Sizes {
    distance: Option<f64>,
    tip_diameter: Option<[f64; 2]>,
}

/// Adds a line with a key. Writing to a string does not fail.
pub(super) fn line(section: &mut String, key: &str, value: &dyn Debug) {
    let _ = writeln!(section, "{key} = {value:?}");
}

impl Pair {
    /// The sizes that do not follow from the others; `parsed` is the pair without them.
    pub(super) fn sizes(&self, parsed: &PairFile) -> Sizes {
        // A pair that is not simulable keeps all sizes of the file.
        let follows = gear::Geometry::new(&parsed.to_gear()).ok();
        let differs = |given: f64, of: fn(&gear::Geometry) -> f64| {
            let follows = follows.as_ref().map(of);
            follows.is_none_or(|follows| (given - follows).abs() > SAME_MM)
        };
        let tips = self.tip_diameter.filter(|&[pinion, mate]| {
            differs(pinion, |g| 2.0 * g.r_a[0]) || differs(mate, |g| 2.0 * g.r_a[1])
        });
        Sizes {
            distance: self.distance.filter(|a| differs(*a, |g| g.centre_distance)),
            tip_diameter: tips,
        }
    }

    /// The text of the pair file with these sizes.
    pub(super) fn text(&self, sizes: Sizes) -> String {
        let mut text = "[pair]\n".to_owned();
        let [addendum, dedendum, radius] = [0, 1, 2].map(|place| self.tools.map(|one| one[place]));
        line(&mut text, "teeth", &self.teeth);
        line(&mut text, "normal_module_mm", &self.module);
        if let Some(distance) = sizes.distance {
            line(&mut text, "centre_distance_mm", &distance);
        }
        line(&mut text, "pressure_angle_deg", &self.pressure_angle);
        line(&mut text, "helix_angle_deg", &self.helix_angle);
        match self.face_width {
            FaceWidth::Both(width) => line(&mut text, "face_width_mm", &width),
            FaceWidth::Each(widths) => line(&mut text, "face_width_mm", &widths),
        }
        line(&mut text, "profile_shift", &self.shift);
        line(&mut text, "tool_addendum", &addendum);
        line(&mut text, "tool_dedendum", &dedendum);
        line(&mut text, "tip_radius_mm", &self.tip_radius);
        line(
            &mut text,
            "root_radius_mm",
            &radius.map(|one| one * self.module),
        );
        if let Some(diameters) = sizes.tip_diameter {
            line(&mut text, "tip_diameter_mm", &diameters);
        }
        if let Some(model) = &self.tooth_model {
            line(&mut text, "tooth_model", model);
        }
        if let Some(diameters) = self.hub_diameter {
            line(&mut text, "hub_radius_mm", &diameters.map(|one| 0.5 * one));
        }
        text += "[load]\n";
        line(&mut text, "pinion_torque_nm", &self.torque_nm);
        text += &self.materials;
        if let Some(class) = self.class {
            text += "[manufacture]\n";
            line(&mut text, "flank_class", &(class as i64));
        }
        let corrections = &self.corrections;
        let mut section = String::new();
        if let Some(shape) = corrections.relief_shapes.first() {
            line(&mut section, "tip_relief_um", &corrections.relief_um);
            line(
                &mut section,
                "tip_relief_length_mm",
                &corrections.relief_length_mm,
            );
            line(&mut section, "tip_relief_shape", shape);
        }
        for (key, um) in [
            ("crowning_um", corrections.crowning_um),
            ("helix_slope_um", corrections.slope_um),
            ("misalignment_um", corrections.misalignment_um),
        ] {
            if um != 0.0 {
                line(&mut section, key, &um);
            }
        }
        if !section.is_empty() {
            text = text + "[corrections]\n" + &section;
        }
        text
    }
}
