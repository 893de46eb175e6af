//! Outlines and placements for drawings of a pair in its transverse section.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::input::Member;
use crate::involute::{inv_of_tangent, tangent_length, tangent_of_inv};
use crate::pair::Pair;
use crate::trochoid::Trochoid;

/// The place of a gear's outline in a drawing: a rotation about the axis, then a translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Axis of the gear, mm.
    pub centre: [f64; 2],
    /// Rotation about the axis, rad, anticlockwise.
    pub rotation: f64,
}

impl Placement {
    /// Moves a point of the outline to its place in the drawing.
    #[must_use]
    pub fn apply(&self, point: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.rotation.sin_cos();
        [
            self.centre[0] + point[0] * cos - point[1] * sin,
            self.centre[1] + point[0] * sin + point[1] * cos,
        ]
    }
}

/// Places pinion and gear in mesh: pinion axis at the origin, gear axis at (a, 0).
///
/// `phase` turns the pair by that many base pitches (both flanks stay in touch at any value);
/// at zero a pinion tooth points at the gear's axis.
#[must_use]
pub fn mesh_placement(pair: &Pair, phase: f64) -> [Placement; 2] {
    let geometry = pair.geometry();
    let [z1, z2] = geometry.teeth.map(f64::from);
    // Without backlash the working thickness of a pinion tooth fills the gear's space, so a tooth
    // axis and a space axis meet on the centre line. Outlines have a tooth along +y.
    [
        Placement {
            centre: [0.0, 0.0],
            rotation: -FRAC_PI_2 + phase * TAU / z1,
        },
        Placement {
            centre: [geometry.centre_distance, 0.0],
            rotation: FRAC_PI_2 + PI / z2 - phase * TAU / z2,
        },
    ]
}

/// Closed transverse outline of a gear about its own axis, mm, anticlockwise, one tooth along +y.
/// The first point is not repeated at the end.
///
/// Each flank is drawn with `points` points (at least 2) on the involute and as many on the
/// fillet; the fillet is the envelope of the rack corner, an ellipse in this section. Tip rounding
/// and tip and root arcs are included.
#[must_use]
pub fn gear_outline(pair: &Pair, member: Member, points: usize) -> Vec<[f64; 2]> {
    let points = points.max(2);
    let flank = right_flank(pair, member, points);
    let teeth = pair.geometry().teeth[member.index()];
    let mut outline = Vec::with_capacity(2 * flank.len() * teeth as usize);
    for k in 0..teeth {
        let (sin, cos) = (TAU * f64::from(k) / f64::from(teeth)).sin_cos();
        let turned = |[x, y]: [f64; 2]| [x * cos - y * sin, x * sin + y * cos];
        outline.extend(flank.iter().map(|&p| turned(p)));
        outline.extend(flank.iter().rev().map(|&[x, y]| turned([-x, y])));
    }
    outline
}

/// A point of a tooth's transverse profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfilePoint {
    /// As the tool leaves it, mm about the gear's axis, the tooth along +y.
    pub nominal: [f64; 2],
    /// With the tip relief, mm.
    pub modified: [f64; 2],
    /// Radius of the nominal point, mm.
    pub radius: f64,
    /// Roll angle on the involute, rad; absent on the fillet, the tip rounding and the arcs.
    pub roll_angle: Option<f64>,
    /// Depth of the tip relief normal to the flank, mm.
    pub depth: f64,
}

/// The transverse profile of one tooth in the middle of the face, from the middle of the space on its right over the
/// tip to that on its left. `points` are those of [`gear_outline`]. Crowning and helix slopes are not part of a
/// profile.
#[must_use]
pub fn tooth_profile(pair: &Pair, member: Member, points: usize) -> Vec<ProfilePoint> {
    let geometry = pair.geometry();
    let i = member.index();
    let r_b = geometry.r_b[i];
    let ends = [
        geometry.involute_start[i],
        tangent_length(geometry.r_na[i], r_b),
    ];
    let relief = pair.corrections().tip_relief[i];
    let right = right_flank(pair, member, points.max(2));
    let right = right.into_iter().map(|nominal @ [x, y]: [f64; 2]| {
        let radius = x.hypot(y);
        let tau = tangent_length(radius, r_b);
        let slack = 1e-9 * geometry.normal_module;
        let on_involute = tau >= ends[0] - slack && tau <= ends[1] + slack;
        let depth = relief
            .filter(|_| on_involute)
            .map_or(0.0, |relief| relief.depth(ends[1] - tau));
        // The normal of the flank is a tangent of the base circle. The amount is normal to the flank, the section
        // transverse.
        let away = x.atan2(y) - (tau / r_b).atan() + FRAC_PI_2;
        let inwards = depth / geometry.beta_b.cos();
        ProfilePoint {
            nominal,
            modified: [x - inwards * away.sin(), y - inwards * away.cos()],
            radius,
            roll_angle: on_involute.then_some(tau / r_b),
            depth,
        }
    });
    let mut profile: Vec<ProfilePoint> = right.collect();
    let mirrored = |point: &ProfilePoint| ProfilePoint {
        nominal: [-point.nominal[0], point.nominal[1]],
        modified: [-point.modified[0], point.modified[1]],
        ..*point
    };
    let left: Vec<ProfilePoint> = profile.iter().rev().map(mirrored).collect();
    profile.extend(left);
    profile
}

/// Half a tooth, from the middle of the space on its right over root arc, fillet, involute and tip
/// rounding to the tooth axis.
fn right_flank(pair: &Pair, member: Member, points: usize) -> Vec<[f64; 2]> {
    let (geometry, input) = (pair.geometry(), pair.input());
    let i = member.index();
    let (r, r_b, r_a, r_na) = (
        geometry.r[i],
        geometry.r_b[i],
        geometry.r_a[i],
        geometry.r_na[i],
    );
    let polar = |radius: f64, angle: f64| [radius * angle.sin(), radius * angle.cos()];
    let fraction = |k: usize| k as f64 / (points - 1) as f64;
    let half_angle = |tau: f64| geometry.psi_b[i] - inv_of_tangent(tau / r_b);

    let trochoid = Trochoid::new(input, geometry.normal_module, r, member);
    let mut flank = Vec::with_capacity(4 * points);
    let root_angle = trochoid.root_angle();
    let space = PI / f64::from(geometry.teeth[i]);
    flank.extend(
        (0..points).map(|k| polar(geometry.r_f[i], space + (root_angle - space) * fraction(k))),
    );
    // An undercutting trochoid is followed to where it crosses the involute.
    let (gamma_end, tau_start) = if geometry.undercut[i] {
        trochoid.crossing(r_b, geometry.psi_b[i])
    } else {
        (trochoid.gamma_end, geometry.t_form[i])
    };
    flank.extend((1..points).map(|k| trochoid.point(gamma_end * fraction(k))));

    // The flank may end at its apex before the tip rounding starts.
    let tau_end = tangent_length(r_na, r_b).min(r_b * tangent_of_inv(geometry.psi_b[i]));
    flank.extend((0..points).map(|k| {
        let tau = tau_start + (tau_end - tau_start) * fraction(k);
        polar(r_b.hypot(tau), half_angle(tau))
    }));

    // Rounding: its centre lies inside the tooth on the flank's normal; it ends on the tip circle,
    // or on the tooth axis where the roundings of both flanks meet first.
    let rho_a = input.tip_radius[i];
    let centre_radius = r_a - rho_a;
    let t_centre = tangent_length(centre_radius, r_b);
    // Flank point and centre lie on one tangent of the base circle, τ and τ − ρa from its foot.
    let contact_angle = half_angle(tau_end);
    let centre_angle = contact_angle - (tau_end / r_b).atan() + (t_centre / r_b).atan();
    let [cx, cy] = polar(centre_radius, centre_angle);
    let [px, py] = polar(r_b.hypot(tau_end), contact_angle);
    let start = (px - cx).atan2(py - cy);
    let tip = if cx > 0.0 {
        centre_angle
    } else {
        (-cx / rho_a).clamp(-1.0, 1.0).asin()
    };
    if rho_a > 0.0 && start > tip {
        flank.extend((1..points).map(|k| {
            let [dx, dy] = polar(rho_a, start + (tip - start) * fraction(k));
            [cx + dx, cy + dy]
        }));
    }
    let end_angle = if cx > 0.0 { centre_angle } else { 0.0 };
    if end_angle > 0.0 {
        flank.extend((1..points).map(|k| polar(r_a, end_angle * (1.0 - fraction(k)))));
    }
    flank
}
