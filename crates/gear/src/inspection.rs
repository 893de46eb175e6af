//! Dimensions for drawing and inspection of a gear: form circles, thicknesses, span and balls.
//!
//! The simulation does not depend on this module. Dimensions are nominal: teeth have the thickness that follows from
//! the profile shift. [`Limits`] adds the allowances.
//!
//! Reference: ISO 21771:2007.

use std::f64::consts::PI;

use crate::geometry::Geometry;
use crate::input::Member;
use crate::involute::{inv_of_tangent, tangent_length, tangent_of_inv};
use crate::unloaded::UnloadedPair;

mod limits;
mod sheet;

pub use limits::{Allowances, Limits};
pub use sheet::{Sheet, relief_length};

/// Common diameters of measuring balls, mm.
const BALLS: [f64; 48] = [
    1.0, 1.1, 1.25, 1.4, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.25, 3.5, 3.75, 4.0, 4.25, 4.5,
    5.0, 5.25, 5.5, 6.0, 6.5, 7.0, 7.5, 8.0, 9.0, 10.0, 10.5, 11.0, 12.0, 14.0, 15.0, 16.0, 18.0,
    20.0, 22.0, 25.0, 28.0, 30.0, 35.0, 40.0, 45.0, 50.0, 60.0, 70.0, 80.0, 95.0, 110.0,
];

/// The part of the path of contact that form circles leave; lengths in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActivePath {
    /// Start of contact.
    pub s_in: f64,
    /// End of contact.
    pub s_out: f64,
    /// Active root radii r_Nf.
    pub r_nf: [f64; 2],
    /// Active tip radii r_Na.
    pub r_na: [f64; 2],
    /// Length of the path of contact g_α.
    pub length: f64,
    /// Transverse contact ratio ε_α.
    pub eps_alpha: f64,
    /// Specific sliding at the active roots ζ_f.
    pub root_sliding: [f64; 2],
}

/// Shortens the path of contact to where both flanks are involutes: contact starts no lower than the root form circles,
/// and each tip is active only as far as it meets the mate above the mate's root form circle (ISO 21771, 5.4).
/// `form_radius` are r_Ff in mm; a circle inside the base circle limits nothing.
///
/// The simulator itself keeps the whole path and reports the interference instead.
#[must_use]
pub fn active_path(geometry: &Geometry, form_radius: [f64; 2]) -> ActivePath {
    let g = geometry;
    let form = [0, 1].map(|i| tangent_length(form_radius[i], g.r_b[i]));
    let (s_in, s_out) = (g.s_in.max(form[0]), g.s_out.min(g.path_length - form[1]));
    let roots = [s_in, g.path_length - s_out];
    let tips = [s_out, g.path_length - s_in];
    ActivePath {
        s_in,
        s_out,
        r_nf: [0, 1].map(|i| g.r_b[i].hypot(roots[i])),
        r_na: [0, 1].map(|i| g.r_b[i].hypot(tips[i])),
        length: s_out - s_in,
        eps_alpha: (s_out - s_in) / g.base_pitch,
        root_sliding: [
            g.specific_sliding(Member::Pinion, s_in),
            g.specific_sliding(Member::Gear, s_out),
        ],
    }
}

/// Angles and thicknesses of a tooth at one radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlankPoint {
    /// Transverse profile angle α_yt, rad.
    pub profile_angle: f64,
    /// Helix angle β_y, rad.
    pub helix_angle: f64,
    /// Transverse tooth thickness s_yt as an arc, mm.
    pub transverse_thickness: f64,
    /// Normal tooth thickness s_yn = s_yt cos β_y, mm.
    pub normal_thickness: f64,
    /// Radius of curvature of the transverse profile ρ_y, mm.
    pub curvature_radius: f64,
}

/// Thicknesses at the tip circles in the normal section, mm, as if the tips were not rounded; zero for a
/// pointed tooth.
#[must_use]
pub fn tip_land(geometry: &Geometry) -> [f64; 2] {
    Member::BOTH.map(|member| {
        let tip = flank(geometry, member, geometry.r_a[member.index()]);
        // A pointed tooth has no land, and rounding may make it negative.
        tip.normal_thickness.max(0.0)
    })
}

/// The flank at the transverse radius `r` mm, at least the base radius (ISO 21771, 4.3 to 4.5).
#[must_use]
pub fn flank(geometry: &Geometry, member: Member, r: f64) -> FlankPoint {
    let i = member.index();
    let tau = tangent_length(r, geometry.r_b[i]);
    let tangent = tau / geometry.r_b[i];
    let helix_angle = (geometry.beta.tan() * r / geometry.r[i]).atan();
    let transverse_thickness = 2.0 * r * (geometry.psi_b[i] - inv_of_tangent(tangent));
    FlankPoint {
        profile_angle: tangent.atan(),
        helix_angle,
        transverse_thickness,
        normal_thickness: transverse_thickness * helix_angle.cos(),
        curvature_radius: tau,
    }
}

/// Base tangent length W_k over `teeth` teeth, mm: (k − 1) normal base pitches and one normal base
/// thickness (ISO 21771, 6.3).
#[must_use]
pub fn base_tangent_length(geometry: &Geometry, member: Member, teeth: u32) -> f64 {
    let i = member.index();
    let cos_bb = geometry.beta_b.cos();
    let thickness = 2.0 * geometry.r_b[i] * geometry.psi_b[i];
    cos_bb * (f64::from(teeth.saturating_sub(1)) * geometry.base_pitch + thickness)
}

/// Dimension over two balls of `diameter` mm, M_dK, in mm (ISO 21771, 6.4). Zero where such a ball
/// falls through to the base circle.
#[must_use]
pub fn over_balls(geometry: &Geometry, member: Member, diameter: f64) -> f64 {
    let i = member.index();
    let z = f64::from(geometry.teeth[i]);
    let inv = ball_involute(geometry, member, diameter);
    if inv <= 0.0 {
        return 0.0;
    }
    let centre = geometry.r_b[i] * tangent_of_inv(inv).hypot(1.0);
    // An odd gear's balls lie half a pitch off the diameter.
    let lever = if geometry.teeth[i].is_multiple_of(2) {
        1.0
    } else {
        (PI / (2.0 * z)).cos()
    };
    2.0 * centre * lever + diameter
}

/// Involute of the transverse pressure angle at the centre of a ball of `diameter` mm in a space. The ball touches both
/// flanks where the space, widened by the diameter along the base helix's normal, closes.
fn ball_involute(geometry: &Geometry, member: Member, diameter: f64) -> f64 {
    let i = member.index();
    diameter / (2.0 * geometry.r_b[i] * geometry.beta_b.cos()) + geometry.psi_b[i]
        - PI / f64::from(geometry.teeth[i])
}

/// A base tangent length and the number of teeth that it spans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Number of teeth spanned k.
    pub teeth: u32,
    /// Base tangent length W_k, mm.
    pub length: f64,
    /// Diameter at which the anvils touch, mm.
    pub contact_diameter: f64,
}

/// The span whose anvils touch nearest the circle d + 2 x m_n, in the middle of the teeth. `None` where no span
/// touches between the form circles, or where the face is too narrow for it, b < W_k sin β_b.
#[must_use]
pub fn span(pair: &UnloadedPair, member: Member) -> Option<Span> {
    let g = pair.geometry();
    let i = member.index();
    let middle = middle_radius(pair, member);
    let at = |teeth: u32| {
        let length = base_tangent_length(g, member, teeth);
        let contact = g.r_b[i].hypot(0.5 * length * g.beta_b.cos());
        Span {
            teeth,
            length,
            contact_diameter: 2.0 * contact,
        }
    };
    let (low, high) = (2.0 * form_radii(g)[i], 2.0 * g.r_na[i]);
    let distance = |span: &Span| (0.5 * span.contact_diameter - middle).abs();
    (2..=g.teeth[i])
        .map(at)
        .filter(|span| (low..=high).contains(&span.contact_diameter))
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .filter(|span| span.length * g.beta_b.sin() <= g.face_width)
}

/// A dimension over two balls and their diameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OverBalls {
    /// Diameter of the balls D_M, mm.
    pub ball: f64,
    /// Dimension over the balls M_dK, mm.
    pub dimension: f64,
}

/// The dimension over the smallest common balls that touch the flanks on the circle d + 2 x m_n, in the middle of the
/// teeth, or above it. `None` unless such a ball is a common one, touches below the tip form circle and stands out over
/// the tips.
#[must_use]
pub fn common_balls(pair: &UnloadedPair, member: Member) -> Option<OverBalls> {
    let g = pair.geometry();
    let i = member.index();
    let r_b = g.r_b[i];
    // Tangent lengths of the centre and, nearer to the base circle along the flank's normal, of the contact.
    let contact = |ball: f64| {
        let centre = r_b * tangent_of_inv(ball_involute(g, member, ball).max(1e-12));
        centre - 0.5 * ball * g.beta_b.cos()
    };
    let middle = tangent_length(middle_radius(pair, member), r_b);
    let ball = BALLS.into_iter().find(|ball| contact(*ball) >= middle)?;
    let dimension = over_balls(g, member, ball);
    let touches = contact(ball) <= tangent_length(g.r_na[i], r_b);
    (touches && dimension > 2.0 * g.r_a[i]).then_some(OverBalls { ball, dimension })
}

/// Radii of the root form circles r_Ff, at which the involutes start, mm.
#[must_use]
pub fn form_radii(geometry: &Geometry) -> [f64; 2] {
    [0, 1].map(|i| geometry.r_b[i].hypot(geometry.involute_start[i]))
}

/// Radius of the circle d + 2 x m_n, within the flank, mm.
fn middle_radius(pair: &UnloadedPair, member: Member) -> f64 {
    let (g, i) = (pair.geometry(), member.index());
    let middle = g.r[i] + pair.input().profile_shift[i] * g.normal_module;
    middle.clamp(form_radii(g)[i], g.r_na[i])
}
