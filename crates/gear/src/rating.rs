//! The load capacity of ISO 6336, to set beside the tooth model's stresses and stiffness.
//!
//! The simulation does not depend on this module. It covers the stresses of roots and flanks with the factors that
//! follow from the geometry, the safeties S_F and S_H, and the mesh stiffness c′ and c_γ.
//! [`inspection`](crate::inspection) has the dimensions that a gear is measured by.
//!
//! Factors that do not follow from the geometry are inputs ([`Factors`]): application, dynamics, distribution of the
//! load, life, lubricant, roughness, size. Left out: rims (Y_B = 1), the deep-tooth factor (Y_DT = 1), and the factor
//! f_ZCa of the flank, which the edition of 2019 adds to Z_B and Z_D for helical gears without profile modification.
//!
//! References: ISO 6336-1:2006 (stiffness, method B), ISO 6336-2:2006 (contact), ISO 6336-3:2006
//! and 2019 (root, method B).

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::Geometry;
use crate::input::{InputError, Member};
use crate::root_stress::stress_correction;
use crate::unloaded::UnloadedPair;

/// Young's modulus of the steel for which ISO 6336-1's stiffness holds, MPa.
const STEEL: f64 = 206e3;
/// Line load F_t K_A/b, N/mm, below which ISO 6336-1 lets the stiffness fall with the fourth root of it.
const FULL_STIFFNESS_LOAD: f64 = 100.0;

/// The edition of ISO 6336-3 by which roots are rated, 2006 or 2019.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "u32", into = "u32")]
#[schemars(with = "u32", extend("enum" = [2006, 2019]))]
pub enum Edition {
    /// Helical teeth are loaded as spur teeth are.
    Of2006,
    /// The load of helical teeth is spread over several, and bends them along an inclined line: Y_F has the factor f_ε, and
    /// Y_β the factor 1/cos³ β.
    #[default]
    Of2019,
}

impl TryFrom<u32> for Edition {
    type Error = InputError;

    fn try_from(year: u32) -> Result<Self, InputError> {
        match year {
            2006 => Ok(Self::Of2006),
            2019 => Ok(Self::Of2019),
            _ => Err(InputError {
                field: "edition",
                value: f64::from(year),
                expected: "2006 or 2019",
            }),
        }
    }
}

impl From<Edition> for u32 {
    fn from(edition: Edition) -> Self {
        match edition {
            Edition::Of2006 => 2006,
            Edition::Of2019 => 2019,
        }
    }
}

/// `[strength]`, optional: the factors of ISO 6336 that do not follow from the geometry. Two-element arrays are pinion,
/// mate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Factors {
    /// Edition of ISO 6336-3 by which the roots are rated, 2006 or 2019.
    pub edition: Edition,
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

impl Default for Factors {
    /// All factors 1.
    fn default() -> Self {
        Self {
            edition: Edition::default(),
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

impl Factors {
    /// K_Fβ = K_Hβ^N_F with N_F = 1/(1 + h/b + (h/b)²) (ISO 6336-1, method C), where h is the greater tooth height and
    /// h/b at most 1/3.
    fn root_face_load(&self, geometry: &Geometry) -> f64 {
        let heights = [0, 1].map(|i| geometry.r_a[i] - geometry.r_f[i]);
        let slenderness = (heights[0].max(heights[1]) / geometry.face_width).min(1.0 / 3.0);
        let exponent = 1.0 / (1.0 + slenderness + slenderness * slenderness);
        self.face_load_factor.powf(exponent)
    }
}

/// The allowable stresses of a pair's roots and flanks, and the factors of both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strength {
    /// The factors of the stresses, and of the allowable ones.
    pub factors: Factors,
    /// Allowable stress numbers of the roots σ_FE = σ_Flim Y_ST, MPa, where they are known.
    pub bending_limit_mpa: [Option<f64>; 2],
    /// Allowable stress numbers of the flanks σ_Hlim, MPa.
    pub contact_limit_mpa: [f64; 2],
}

impl Strength {
    /// Safeties S_F = σ_FE Y_NT Y_δrelT Y_RrelT Y_X/σ_F of roots with these stresses σ_F, MPa; `None` where the
    /// allowable stress is not known.
    #[must_use]
    pub fn root_safety(&self, stress_mpa: [f64; 2]) -> [Option<f64>; 2] {
        let factors = &self.factors;
        [0, 1].map(|i| {
            let factor = factors.root_life_factor[i] * factors.root_factor[i];
            Some(self.bending_limit_mpa[i]? * factor / stress_mpa[i])
        })
    }

    /// Safeties S_H = σ_Hlim Z_NT Z_L Z_v Z_R Z_W Z_X/σ_H of flanks with these stresses σ_H, MPa.
    #[must_use]
    pub fn flank_safety(&self, stress_mpa: [f64; 2]) -> [f64; 2] {
        let factors = &self.factors;
        [0, 1].map(|i| {
            let factor = factors.flank_life_factor[i] * factors.flank_factor[i];
            self.contact_limit_mpa[i] * factor / stress_mpa[i]
        })
    }
}

/// Nominal root stress of one gear, load at the outer point of single pair tooth contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RootRating {
    /// Load direction angle α_Fen, rad.
    pub load_angle: f64,
    /// Bending arm h_Fe, mm.
    pub arm: f64,
    /// Root chord s_Fn, mm.
    pub chord: f64,
    /// Fillet radius ρ_F in the 30° section, mm.
    pub fillet_radius: f64,
    /// Form factor Y_F = (6 h_Fe/m) cos α_Fen / ((s_Fn/m)² cos α_n), in the edition of 2019 times f_ε.
    pub y_f: f64,
    /// Stress correction factor Y_S = (1.2 + 0.13 L) q_s^(1/(1.21 + 2.3/L)), L = s_Fn/h_Fe and
    /// q_s = s_Fn/(2 ρ_F); at least 1.
    pub y_s: f64,
    /// Helix angle factor Y_β = 1 − ε_β β/120°, in the edition of 2019 over cos³ β; with ε_β at most 1 and β at most 30°.
    pub y_beta: f64,
    /// Nominal root stress σ_F0 = F_t/(b m) Y_F Y_S Y_β, MPa, where b is the gear's own face width, as far as it is at
    /// most one module wider at each end than the mate's.
    pub stress_mpa: f64,
}

/// Mesh stiffness by method B; N/(mm·µm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshStiffness {
    /// Theoretical single stiffness c′_th = 1/q′.
    pub theoretical: f64,
    /// Single stiffness c′ = c′_th C_M C_R C_B cos β E/206 GPa with E = 2 E1 E2/(E1 + E2) and C_M = 0.8; for a line load
    /// w = F_t K_A/b below 100 N/mm times (w/100)^0.25.
    pub single: f64,
    /// Mesh stiffness c_γα = c′ (0.75 ε_α + 0.25).
    pub mesh_alpha: f64,
    /// Mesh stiffness c_γβ = 0.85 c_γα.
    pub mesh_beta: f64,
}

/// Nominal figures of a pair. Arrays are [pinion, gear].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rating {
    /// Nominal tangential force at the reference circle F_t, N.
    pub tangential_force: f64,
    /// Zone factor Z_H = √(2 cos β_b cos α_wt/(cos² α_t sin α_wt)).
    pub z_h: f64,
    /// Elasticity factor Z_E = √(E*/π), with 1/E* = (1 − ν1²)/E1 + (1 − ν2²)/E2, √MPa.
    pub z_e: f64,
    /// Contact ratio factor Z_ε.
    pub z_epsilon: f64,
    /// Helix angle factor Z_β = 1/√(cos β) (the edition of 1996 had √(cos β)).
    pub z_beta: f64,
    /// Single pair tooth contact factors Z_B and Z_D, at least 1.
    pub z_single: [f64; 2],
    /// Nominal contact stress at the pitch point σ_H0 = Z_H Z_E Z_ε Z_β √(F_t (u + 1)/(d_1 b u)),
    /// MPa, without Z_B and Z_D.
    pub contact_stress_mpa: f64,
    /// Root ratings.
    pub root: [RootRating; 2],
    /// Mesh stiffness.
    pub stiffness: MeshStiffness,
    /// Root stresses σ_F = σ_F0 K_A K_v K_Fβ K_Fα, MPa.
    pub root_stress_mpa: [f64; 2],
    /// Contact stresses σ_H = Z_B σ_H0 √(K_A K_v K_Hβ K_Hα), with Z_D for the gear, MPa.
    pub flank_stress_mpa: [f64; 2],
    /// Whether 1 ≤ ε_α < 2, for which these formulas are meant. Below, loads are taken at the tip and
    /// Z_B = Z_D = 1.
    pub in_range: bool,
}

/// Rates a pair. `blank_factor` is C_R of ISO 6336-1, 1 for a solid blank.
#[must_use]
pub fn rate(pair: &UnloadedPair, blank_factor: f64, factors: &Factors) -> Rating {
    let (geometry, input) = (pair.geometry(), pair.input());
    let g = geometry;
    let tangential_force = input.pinion_torque / g.r[0];
    let line_load = tangential_force / g.face_width;
    let ratio = f64::from(g.teeth[1]) / f64::from(g.teeth[0]);
    let (cos_bb, cos_t) = (g.beta_b.cos(), g.alpha_t.cos());
    let z_h = (2.0 * cos_bb * g.alpha_wt.cos() / (cos_t * cos_t * g.alpha_wt.sin())).sqrt();
    let z_e = (input.contact_modulus() / PI).sqrt();
    let z_beta = 1.0 / g.beta.cos().sqrt();
    let eps_alpha = g.eps_alpha.max(1.0);
    let spur = ((4.0 - eps_alpha) / 3.0).max(0.0);
    let overlap = g.eps_beta.min(1.0);
    let z_epsilon = (spur * (1.0 - overlap) + overlap / eps_alpha).sqrt();
    let contact_stress_mpa = z_h
        * z_e
        * z_epsilon
        * z_beta
        * (line_load / (2.0 * g.r[0]) * (ratio + 1.0) / ratio).sqrt();
    let z_single = single_pair_factors(g);
    let root = Member::BOTH.map(|member| {
        let width = input.face_width[member.index()].min(g.face_width + 2.0 * g.normal_module);
        root(pair, member, tangential_force / width, factors.edition)
    });
    let common =
        factors.application_factor * factors.dynamic_factor * factors.transverse_load_factor;
    let of_roots = common * factors.root_face_load(g);
    let of_flanks = (common * factors.face_load_factor).sqrt();
    Rating {
        tangential_force,
        z_h,
        z_e,
        z_epsilon,
        z_beta,
        z_single,
        contact_stress_mpa,
        root,
        root_stress_mpa: root.map(|root| root.stress_mpa * of_roots),
        flank_stress_mpa: z_single.map(|z| z * contact_stress_mpa * of_flanks),
        stiffness: stiffness(pair, blank_factor, line_load * factors.application_factor),
        in_range: (1.0..2.0).contains(&g.eps_alpha),
    }
}

/// Z_B and Z_D: the pressure at the inner points of single pair contact over that at the pitch
/// point, M = tan α_wt/√(tan α_B1 tan α_B2); a helical pair with ε_β < 1 lies between M and 1.
fn single_pair_factors(g: &Geometry) -> [f64; 2] {
    if g.eps_alpha < 1.0 {
        return [1.0; 2];
    }
    // B: one base pitch before the end of contact; D: one base pitch after its start.
    [g.s_out - g.base_pitch, g.s_in + g.base_pitch].map(|s| {
        let tangents = s * (g.path_length - s) / (g.r_b[0] * g.r_b[1]);
        let m = g.alpha_wt.tan() / tangents.sqrt();
        (m - g.eps_beta.min(1.0) * (m - 1.0)).max(1.0)
    })
}

fn root(pair: &UnloadedPair, member: Member, line_load: f64, edition: Edition) -> RootRating {
    let g = pair.geometry();
    let i = member.index();
    let tooth = &pair.teeth[i];
    let m = g.normal_module;
    let section = tooth.critical_section();
    let cos_bb = g.beta_b.cos();
    // In the virtual section the single pair region is ε_αn − 1 base pitches below the tip.
    let eps_alpha_n = g.eps_alpha / (cos_bb * cos_bb);
    let back = (eps_alpha_n - 1.0).max(0.0) * PI * m * g.alpha_n.cos();
    let load = tooth.load_below_tip(g.r_na[i], back);
    let chord = section.chord;
    // A load line through or below the section does not bend it.
    let arm = (load.y_l - section.y).max(1e-6 * chord);
    let overlap = g.eps_beta.min(1.0);
    let degrees = g.beta.to_degrees().min(30.0);
    let (f_epsilon, inclined) = match edition {
        Edition::Of2006 => (1.0, 1.0),
        Edition::Of2019 => {
            let inclined = degrees.to_radians().cos().powi(-3);
            (load_sharing(eps_alpha_n, overlap), inclined)
        }
    };
    let y_f = f_epsilon * 6.0 * arm / m * load.cos_alpha_f
        / ((chord / m) * (chord / m) * g.alpha_n.cos());
    let y_s = stress_correction(chord, arm, section.fillet_radius);
    let y_beta = (1.0 - overlap * degrees / 120.0) * inclined;
    RootRating {
        load_angle: load.cos_alpha_f.acos(),
        arm,
        chord,
        fillet_radius: section.fillet_radius,
        y_f,
        y_s,
        y_beta,
        stress_mpa: line_load / m * y_f * y_s * y_beta,
    }
}

/// The load distribution factor f_ε of ISO 6336-3:2019, for the contact ratio of the virtual spur gears and an overlap
/// ratio of at most 1.
fn load_sharing(eps_alpha_n: f64, overlap: f64) -> f64 {
    if eps_alpha_n < 1.0 {
        return 1.0;
    }
    match (overlap == 0.0, eps_alpha_n < 2.0) {
        (true, true) => 1.0,
        (true, false) => 0.7,
        (false, true) => (1.0 - overlap + overlap / eps_alpha_n).sqrt(),
        (false, false) => (0.5 * (1.0 - overlap) + overlap / eps_alpha_n).sqrt(),
    }
}

fn stiffness(pair: &UnloadedPair, blank_factor: f64, line_load: f64) -> MeshStiffness {
    let (g, input) = (pair.geometry(), pair.input());
    let cos_bb = g.beta_b.cos();
    let [z1, z2] = g
        .teeth
        .map(|z| f64::from(z) / (cos_bb * cos_bb * g.beta.cos()));
    // Index 1 of the formula is the gear of fewer teeth, whichever of the two drives.
    let ([z1, z2], [x1, x2]) = match (z1 <= z2, input.profile_shift) {
        (true, [x1, x2]) => ([z1, z2], [x1, x2]),
        (false, [x1, x2]) => ([z2, z1], [x2, x1]),
    };
    let q = 0.04723 + 0.15551 / z1 + 0.25791 / z2
        - 0.00635 * x1
        - 0.11654 * x1 / z1
        - 0.00193 * x2
        - 0.24188 * x2 / z2
        + 0.00529 * x1 * x1
        + 0.00182 * x2 * x2;
    let theoretical = 1.0 / q;
    let depth = 0.5 * (input.tool_addendum[0] + input.tool_addendum[1]);
    let rack = (1.0 + 0.5 * (1.2 - depth)) * (1.0 - 0.02 * (20.0 - g.alpha_n.to_degrees()));
    let single = theoretical
        * 0.8
        * blank_factor
        * rack
        * g.beta.cos()
        * (input.mean_modulus() / STEEL)
        * (line_load / FULL_STIFFNESS_LOAD).min(1.0).powf(0.25);
    let mesh_alpha = single * (0.75 * g.eps_alpha + 0.25);
    MeshStiffness {
        theoretical,
        single,
        mesh_alpha,
        mesh_beta: 0.85 * mesh_alpha,
    }
}

/// Coefficients L*, M*, P*, Q* of the compliance of a gear body, for a foundation that reaches over
/// `half_angle` rad on each side of the tooth and a ratio `radius_ratio` = r_f/r_bore.
///
/// Only the tooth model `coupled` has a gear body, with constants of its own. [`body_compliance`] gives the compliance
/// that this fit would add to the other models. The fit holds for 1.4 to 7 in the ratio and 0.01 to 0.12 rad.
/// Source: Sainsot, Velex and Duverger, "Contribution of gear body to tooth deflections", ASME
/// J. Mech. Des. 126 (2004), table 1.
#[must_use]
pub fn body_coefficients(half_angle: f64, radius_ratio: f64) -> [f64; 4] {
    const TABLE: [[f64; 6]; 4] = [
        [-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045],
        [60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086],
        [-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236],
        [
            -6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904,
        ],
    ];
    let (theta, h) = (half_angle, radius_ratio);
    TABLE.map(|[a, b, c, d, e, f]| {
        a / (theta * theta) + b * h * h + c * h / theta + d / theta + e * h + f
    })
}

/// Compliance that a gear body adds to a tooth, mm²/N per unit of face width:
/// cos²α/E {L*(u/s_F)² + M* u/s_F + P*(1 + Q* tan²α)}, with the arm over the root chord
/// `arm_ratio` = u/s_F, the load angle α in rad and E in MPa.
#[must_use]
pub fn body_compliance(
    coefficients: [f64; 4],
    arm_ratio: f64,
    load_angle: f64,
    youngs_modulus: f64,
) -> f64 {
    let [l, m, p, q] = coefficients;
    load_angle.cos().powi(2) / youngs_modulus
        * (l * arm_ratio * arm_ratio + m * arm_ratio + p * (1.0 + q * load_angle.tan().powi(2)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example that the public rotor library `ross` prints for its own table.
    #[test]
    fn body_coefficients_are_the_published_ones() {
        let expected = [6.93199, 1.25215, 4.93373, 0.40118];
        for (ours, theirs) in body_coefficients(0.0485937, 3.4).iter().zip(expected) {
            // Half a unit of the last printed digit.
            assert!((ours - theirs).abs() < 5e-6, "{ours} against {theirs}");
        }
    }

    #[test]
    fn a_body_adds_compliance_with_the_arm() {
        let coefficients = body_coefficients(0.05, 3.0);
        let at = |arm| body_compliance(coefficients, arm, 0.3, 206e3);
        assert!(at(0.2) > 0.0 && at(1.0) > at(0.5) && at(0.5) > at(0.2));
        let stiffer = body_compliance(coefficients, 0.5, 0.3, 412e3);
        assert!((2.0 * stiffer / at(0.5) - 1.0).abs() < 1e-14);
    }
}
