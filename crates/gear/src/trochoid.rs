//! The trochoid that a rack corner leaves in the transverse section: fillet, or undercut.
//!
//! The corner is a circle in the normal section, and so an ellipse in the transverse one. A point of the
//! trochoid is named by γ, the inclination of the corner's normal in the normal section: γ = 0 at the root
//! circle, γ = π/2 − α_n where the rack's flank begins. The tooth axis is y, half thickness x.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::input::{Member, PairInput};
use crate::involute::{inv_of_tangent, tangent_length};
use crate::root::root;

/// The trochoid of one gear.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Trochoid {
    r: f64,
    /// Depth of the corner's centre below the rolling line.
    h_c: f64,
    rho: f64,
    /// Distance of the corner's centre from the tooth axis along the rolling line.
    x_c: f64,
    cos_beta: f64,
    /// γ where the rack's flank begins.
    pub(crate) gamma_end: f64,
}

impl Trochoid {
    /// The trochoid of a gear with the normal module `m` and the reference radius `r`, mm.
    pub(crate) fn new(input: &PairInput, m: f64, r: f64, member: Member) -> Self {
        let i = member.index();
        let cos_beta = input.helix_angle.cos();
        let rho = input.root_radius[i];
        Self {
            r,
            h_c: m * (input.tool_addendum[i] - input.profile_shift[i]) - rho,
            rho,
            x_c: (FRAC_PI_2 * m - rack_corner_room(input, m, member)) / cos_beta,
            cos_beta,
            gamma_end: FRAC_PI_2 - input.pressure_angle,
        }
    }

    /// The angle from the tooth axis at which the trochoid leaves the root circle.
    pub(crate) fn root_angle(&self) -> f64 {
        self.x_c / self.r
    }

    /// The point γ.
    pub(crate) fn point(&self, gamma: f64) -> [f64; 2] {
        let (sin, cos) = gamma.sin_cos();
        let depth = self.h_c + self.rho * cos;
        let x = -depth * self.cos_beta * sin / cos;
        let theta = (x + self.rho * sin / self.cos_beta - self.x_c) / self.r;
        let (st, ct) = theta.sin_cos();
        let y = self.r - depth;
        [x * ct - y * st, x * st + y * ct]
    }

    /// γ and the tangent length at which an undercutting trochoid crosses the involute with the half-angle
    /// `psi_b` at the base circle `r_b`: the flank's involute starts there.
    pub(crate) fn crossing(&self, r_b: f64, psi_b: f64) -> (f64, f64) {
        let point = |gamma| self.point(gamma).into();
        crossing(point, self.gamma_end, r_b, psi_b)
    }
}

/// γ and the tangent length at which an undercutting trochoid with the points (x, y) at γ from 0 to `end`
/// crosses the involute with the half-angle `psi_b` at the base circle `r_b`.
///
/// The trochoid passes the base circle inside the tooth and ends on the involute's mirror branch outside
/// it, so the crossing is bracketed. Where it is not, the undercut is smaller than rounding and the
/// trochoid is followed to its end.
pub(crate) fn crossing(
    point: impl Fn(f64) -> (f64, f64),
    end: f64,
    r_b: f64,
    psi_b: f64,
) -> (f64, f64) {
    let radius = |gamma: f64| {
        let (x, y) = point(gamma);
        x.hypot(y)
    };
    let start = if radius(0.0) >= r_b || radius(end) <= r_b {
        end
    } else {
        let base = root(0.0, end, |gamma| radius(gamma) - r_b);
        root(base, end, |gamma| {
            let (x, y) = point(gamma);
            let tau = tangent_length(x.hypot(y), r_b);
            x.atan2(y) - (psi_b - inv_of_tangent(tau / r_b))
        })
    };
    (start, tangent_length(radius(start), r_b))
}

/// Distance between the rack tooth's axis and the centre of its corner, mm, for the normal module `m`;
/// negative if the corner does not fit.
pub(crate) fn rack_corner_room(input: &PairInput, m: f64, member: Member) -> f64 {
    let i = member.index();
    let (rho, alpha) = (input.root_radius[i], input.pressure_angle);
    PI * m / 4.0 - (input.tool_addendum[i] * m - rho) * alpha.tan() - rho / alpha.cos()
}

#[cfg(test)]
mod tests {
    use crate::{Discretisation, Geometry, Infeasibility, Pair, PairInput, Size};

    /// A spur pair of module 1 whose pinion has z teeth, the shift x and a tool of these dimensions.
    fn pair(z: u32, addendum: f64, rho: f64, x: f64) -> PairInput {
        let mut input = crate::general::plain();
        input.size = Size::NormalModule(1.0);
        (input.pressure_angle, input.helix_angle) = (20_f64.to_radians(), 0.0);
        (input.teeth, input.profile_shift) = ([z, 60], [x, 0.3]);
        (input.tool_addendum, input.tool_dedendum) = ([addendum, 1.25], [1.0, 0.6]);
        (input.tip_radius, input.root_radius) = ([0.0; 2], [rho, 0.38]);
        input
    }

    /// The tangent lengths come from rolling a rack cutter over the gear step by step and asking which points of
    /// the involute fall into the cutter's tooth: no formula of a trochoid is used.
    #[test]
    fn undercut_ends_where_a_rolling_rack_leaves_the_involute() {
        for (z, addendum, rho, x, expected) in [
            (14, 1.25, 0.38, 0.0, 0.247_091),
            (12, 1.25, 0.38, 0.0, 0.385_964),
            (12, 1.4, 0.38, 0.0, 0.552_958),
            (10, 1.25, 0.38, 0.0, 0.505_728),
            (12, 1.4, 0.2, -0.1, 0.771_282),
            (16, 1.25, 0.38, -0.3, 0.474_730),
        ] {
            let geometry = Geometry::new(&pair(z, addendum, rho, x)).unwrap();
            assert!(geometry.undercut[0]);
            let found = geometry.involute_start[0];
            assert!(
                (found - expected).abs() < 2e-5,
                "{z} {addendum}: {found} {expected}"
            );
            // The margin counts from there, and the path of contact ends there.
            let margin = geometry.interference().flank_margin[0];
            assert!((margin - (geometry.s_in - found)).abs() < 1e-12);
            let lost = (found - geometry.s_in).max(0.0) / geometry.base_pitch;
            let left = geometry.eps_alpha_left();
            assert!(
                (geometry.eps_alpha - left - lost).abs() < 1e-12,
                "{z}: {left}"
            );
        }
        let sound = Geometry::new(&pair(18, 1.25, 0.38, 0.0)).unwrap();
        assert_eq!(
            (sound.undercut[0], sound.eps_alpha_left()),
            (false, sound.eps_alpha)
        );
        assert!((sound.involute_start[0] - sound.t_form[0]).abs() < 1e-12);
    }

    /// In the limit of no helix, and with one: the drawing's trochoid and involute meet where the margin counts
    /// from.
    #[test]
    fn a_helix_changes_the_cut_steadily() {
        let at = |degrees: f64| {
            let mut input = pair(12, 1.4, 0.38, 0.0);
            input.helix_angle = degrees.to_radians();
            Geometry::new(&input).unwrap().involute_start[0]
        };
        assert!((at(0.01) - at(0.0)).abs() < 1e-6);
        // A helix makes the virtual gear larger, so less is cut.
        assert!(at(20.0) < at(10.0) && at(10.0) < at(0.0) && at(20.0) > 0.0);
    }

    /// The pair of 47 and 50 teeth, module 2.5, at 122 mm. The working pressure angle is that of the base circles'
    /// common tangent; the backlash is the pitch less both thicknesses at the working circles.
    #[test]
    fn module_and_centre_distance_leave_a_backlash() {
        let mut input = pair(47, 1.25, 0.95, 0.1);
        (input.teeth, input.profile_shift) = ([47, 50], [0.1; 2]);
        (input.tool_addendum, input.tool_dedendum) = ([1.25; 2], [1.0; 2]);
        input.root_radius = [0.95; 2];
        let sized = |centre_distance: f64| {
            let size = Size::Both {
                normal_module: 2.5,
                centre_distance,
            };
            PairInput {
                size,
                ..input.clone()
            }
        };
        let found = Geometry::new(&sized(122.0)).unwrap();
        assert!((found.alpha_wt.to_degrees() - 20.946_312).abs() < 1e-6);
        assert!(
            (found.backlash - 0.195_667).abs() < 1e-6,
            "{}",
            found.backlash
        );
        assert!((found.path_length - 43.614_145).abs() < 1e-6);
        assert_eq!((found.normal_module, found.centre_distance), (2.5, 122.0));
        assert!(Pair::new(&sized(122.0), &Discretisation::default()).is_ok());

        // At its own distance the pair is the one without backlash; a little closer, it jams.
        let alone = PairInput {
            size: Size::NormalModule(2.5),
            ..input.clone()
        };
        let alone = Geometry::new(&alone).unwrap();
        let same = Geometry::new(&sized(alone.centre_distance)).unwrap();
        assert!(same.backlash < 1e-9 && (same.s_in - alone.s_in).abs() < 1e-6);
        match Geometry::new(&sized(alone.centre_distance - 0.1)) {
            Err(Infeasibility::Jammed {
                without_backlash,
                overlap,
                ..
            }) => {
                assert!((without_backlash - alone.centre_distance).abs() < 1e-9);
                // The overlap is nearly 2 tan α_w times the difference in the centre distance.
                assert!(
                    (overlap / 0.1 - 2.0 * found.alpha_wt.tan()).abs() < 0.05,
                    "{overlap}"
                );
            }
            other => panic!("{other:?}"),
        }
    }
}
