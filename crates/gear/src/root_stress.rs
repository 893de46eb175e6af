//! Bending stress at the roots, by the nominal stress and notch factor of ISO 6336-3.

use crate::unloaded::UnloadedPair;

/// Highest bending stress at the root of one gear, for the whole load on one tooth's tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RootStress {
    /// Nominal stress times notch factor, MPa.
    pub stress_mpa: f64,
    /// Nominal bending stress in the 30° section, MPa.
    pub nominal_mpa: f64,
    /// Notch factor Y_S, at least 1.
    pub notch_factor: f64,
    /// Notch parameter q_s = s_F/(2 ρ_F).
    pub notch_parameter: f64,
    /// Whether q_s lies in the range 1 … 8 for which the notch factor was fitted.
    pub in_range: bool,
    /// Root chord s_F, mm.
    pub chord: f64,
    /// Bending arm h_F, mm.
    pub arm: f64,
    /// Fillet radius ρ_F in the 30° section, mm.
    pub fillet_radius: f64,
}

impl UnloadedPair {
    /// Root stress of the pinion and of the gear; the criterion σ_vm is the greater one.
    ///
    /// The whole transverse base force acts on one tooth, spread over the face width, at the tip.
    /// Nominal bending stress 6 F cos α_F h_F/(b s_F²) in the section whose fillet tangent is
    /// inclined by 30° (ISO 6336-3), times Y_S = (1.2 + 0.13 l) q_s^(1/(1.21 + 2.3/l)), l = s_F/h_F.
    #[must_use]
    pub fn root_stress(&self) -> [RootStress; 2] {
        [0, 1].map(|i| {
            let tooth = &self.teeth[i];
            let section = tooth.critical_section();
            let load = tooth.load_at_radius(self.geometry().r_na[i]);
            let chord = section.chord;
            // A load line through or below the section does not bend it; the floor keeps the
            // ratio s_F/h_F finite.
            let arm = (load.y_l - section.y).max(1e-6 * chord);
            let nominal = 6.0 * self.base_force() * load.cos_alpha_f * arm
                / (self.geometry().face_width * chord * chord);
            // A fillet bent the other way is no notch.
            let notch = if section.fillet_radius > 0.0 {
                chord / (2.0 * section.fillet_radius)
            } else {
                0.0
            };
            let factor = stress_correction(chord, arm, section.fillet_radius);
            RootStress {
                stress_mpa: nominal * factor,
                nominal_mpa: nominal,
                notch_factor: factor,
                notch_parameter: notch,
                in_range: (1.0..=8.0).contains(&notch),
                chord,
                arm,
                fillet_radius: section.fillet_radius,
            }
        })
    }
}

/// Y_S of ISO 6336-3 (2006), at least 1; 1 where the fillet is bent the other way and is no notch.
pub(crate) fn stress_correction(chord: f64, arm: f64, fillet_radius: f64) -> f64 {
    let notch = if fillet_radius > 0.0 {
        chord / (2.0 * fillet_radius)
    } else {
        0.0
    };
    let l = chord / arm;
    ((1.2 + 0.13 * l) * notch.powf(1.0 / (1.21 + 2.3 / l))).max(1.0)
}
