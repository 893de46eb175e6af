//! The data sheet of a pair.

use std::f64::consts::{PI, TAU};

use super::{OverBalls, Span, active_path, common_balls, flank, form_radii, span, tip_land};
use crate::geometry::Geometry;
use crate::input::Member;
use crate::involute::tangent_length;
use crate::unloaded::UnloadedPair;

/// The quantities of a gear pair's data sheet that are neither in its [`Geometry`](crate::Geometry) nor in its
/// [`PairInput`](crate::PairInput). Arrays are [pinion, mate]; lengths in mm, nominal and without allowances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheet {
    /// Transverse module m_t.
    pub transverse_module: f64,
    /// Transverse pitch at the reference circles p_t.
    pub transverse_pitch: f64,
    /// Normal base pitch p_bn.
    pub normal_base_pitch: f64,
    /// Leads p_z; absent for spur gears.
    pub lead: Option<[f64; 2]>,
    /// Reference centre distance a_d, half the sum of the reference diameters.
    pub reference_centre_distance: f64,
    /// Tip alteration coefficients k, with which d_a = d + 2 m_n (x + h_aP* + k).
    pub tip_alteration: [f64; 2],
    /// Root fillet radii of the basic rack ρ_fP*, in modules.
    pub root_radius_factor: [f64; 2],
    /// Working pitch diameters d_w.
    pub working_diameter: [f64; 2],
    /// Tip form diameters d_Fa: the last flank points below the tip rounding.
    pub tip_form_diameter: [f64; 2],
    /// Root form diameters d_Ff, at which the involutes start above the fillet or the undercut.
    pub root_form_diameter: [f64; 2],
    /// Active tip diameters d_Na.
    pub active_tip_diameter: [f64; 2],
    /// Active root diameters d_Nf.
    pub active_root_diameter: [f64; 2],
    /// Normal tooth thicknesses at the reference circles s_n, as arcs.
    pub tooth_thickness: [f64; 2],
    /// Normal tooth thicknesses at the tip circles s_an, as if the tips were not rounded.
    pub tip_land: [f64; 2],
    /// Base tangent lengths W_k; absent where no span can be measured.
    pub span: [Option<Span>; 2],
    /// Dimensions over balls M_dK; absent where no common ball touches the flanks.
    pub over_balls: [Option<OverBalls>; 2],
    /// Normal backlash j_bn.
    pub normal_backlash: f64,
    /// Diameters d_Ca at which tip reliefs start; absent without a tip relief.
    pub relief_diameter: [Option<f64>; 2],
    /// Diameters d_Cf at which a root relief of this gear would end if it replaced the mate's tip relief with the same
    /// gap; absent without a tip relief of the mate.
    pub root_relief_diameter: [Option<f64>; 2],
}

impl Sheet {
    /// The data sheet of a pair.
    #[must_use]
    pub fn new(pair: &UnloadedPair) -> Self {
        let (g, input) = (pair.geometry(), pair.input());
        let m = g.normal_module;
        let transverse_module = m / g.beta.cos();
        let active = active_path(g, form_radii(g));
        let sum_of_teeth = f64::from(g.teeth[0] + g.teeth[1]);
        let thickness = |member: Member| flank(g, member, g.r[member.index()]).normal_thickness;
        Self {
            transverse_module,
            transverse_pitch: PI * transverse_module,
            normal_base_pitch: PI * m * g.alpha_n.cos(),
            lead: (g.beta > 0.0).then(|| g.r.map(|r| TAU * r / g.beta.tan())),
            reference_centre_distance: g.r[0] + g.r[1],
            tip_alteration: [0, 1]
                .map(|i| (g.r_a[i] - g.r[i]) / m - input.profile_shift[i] - input.tool_dedendum[i]),
            root_radius_factor: input.root_radius.map(|radius| radius / m),
            working_diameter: g
                .teeth
                .map(|z| 2.0 * g.centre_distance * f64::from(z) / sum_of_teeth),
            tip_form_diameter: g.r_na.map(|r| 2.0 * r),
            root_form_diameter: form_radii(g).map(|r| 2.0 * r),
            active_tip_diameter: active.r_na.map(|r| 2.0 * r),
            active_root_diameter: active.r_nf.map(|r| 2.0 * r),
            tooth_thickness: Member::BOTH.map(thickness),
            tip_land: tip_land(g),
            span: Member::BOTH.map(|member| span(pair, member)),
            over_balls: Member::BOTH.map(|member| common_balls(pair, member)),
            normal_backlash: g.backlash * g.alpha_wt.cos() * g.beta_b.cos(),
            relief_diameter: Member::BOTH
                .map(|member| relief_start(pair, member).map(|s| diameter_at(g, member, s))),
            root_relief_diameter: [
                (Member::Pinion, Member::Gear),
                (Member::Gear, Member::Pinion),
            ]
            .map(|(member, mate)| relief_start(pair, mate).map(|s| diameter_at(g, member, s))),
        }
    }
}

/// The place on the path of contact at which the tip relief of one gear starts, mm; `None` without any.
fn relief_start(pair: &UnloadedPair, member: Member) -> Option<f64> {
    let g = pair.geometry();
    let relief = pair.corrections().tip_relief[member.index()];
    let length = relief.filter(|relief| relief.amount > 0.0)?.length;
    // The pinion's tip touches at the end of the path, the mate's at its start.
    Some(match member {
        Member::Pinion => g.s_out - length,
        Member::Gear => g.s_in + length,
    })
}

/// The diameter at which a gear touches at the place `s` on the path of contact, mm.
fn diameter_at(geometry: &Geometry, member: Member, s: f64) -> f64 {
    let r_b = geometry.r_b[member.index()];
    2.0 * r_b.hypot(geometry.tangent_length(member, s))
}

/// The length in mm along the path of contact of a tip relief that starts at `diameter` mm, at least the base diameter;
/// not positive at the tip and beyond.
#[must_use]
pub fn relief_length(geometry: &Geometry, member: Member, diameter: f64) -> f64 {
    let tangent = tangent_length(0.5 * diameter, geometry.r_b[member.index()]);
    match member {
        Member::Pinion => geometry.s_out - tangent,
        Member::Gear => geometry.path_length - tangent - geometry.s_in,
    }
}
