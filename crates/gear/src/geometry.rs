//! Mesh geometry of an involute pair: circles, path of contact, contact ratios,
//! sliding and interference.
//!
//! Everything is in the transverse section unless a name says otherwise. A point of the path of
//! contact is named by `s`, its distance in mm from the pinion's base tangent point along the line
//! of action; the gear's base tangent point is at `path_length`.
//!
//! References: ISO 21771:2007 (formulas and symbols), with the rack tool given by its own
//! addendum (which cuts the root) and dedendum (which forms the tip).

use std::f64::consts::PI;

use crate::error::Infeasibility;
use crate::input::{Member, PairInput, Size, TipRule};
use crate::involute::{inv_of_tangent, tangent_length, tangent_of_inv};
use crate::trochoid::{Trochoid, rack_corner_room};

/// The circles, the path of contact and the ratios of an unloaded pair. Arrays are [pinion, gear];
/// lengths in mm, angles in radians.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Numbers of teeth.
    pub teeth: [u32; 2],
    /// Normal module m.
    pub normal_module: f64,
    /// Centre distance a.
    pub centre_distance: f64,
    /// Rack pressure angle in the normal section α_n.
    pub alpha_n: f64,
    /// Transverse pressure angle α_t.
    pub alpha_t: f64,
    /// Transverse working pressure angle α_wt.
    pub alpha_wt: f64,
    /// Helix angle at the reference cylinder, without its sign.
    pub beta: f64,
    /// Helix angle at the base cylinder β_b, without its sign.
    pub beta_b: f64,
    /// Face width b.
    pub face_width: f64,
    /// Reference radii.
    pub r: [f64; 2],
    /// Base radii.
    pub r_b: [f64; 2],
    /// Tip radii, after the cut at the apex and the tip rule.
    pub r_a: [f64; 2],
    /// Root radii.
    pub r_f: [f64; 2],
    /// Radii of the last flank points in contact, below the tip rounding.
    pub r_na: [f64; 2],
    /// Tooth half-angles at the base circles.
    pub psi_b: [f64; 2],
    /// Tangent lengths at which the involute starts above the fillet; negative means undercut.
    pub t_form: [f64; 2],
    /// Tangent lengths at which the flanks' involutes start: above the fillet, or where the undercut cuts
    /// them.
    pub involute_start: [f64; 2],
    /// Backlash along the working pitch circles in the transverse section; zero unless module and
    /// centre distance are both given.
    pub backlash: f64,
    /// Transverse base pitch p_bt.
    pub base_pitch: f64,
    /// Distance between the base tangent points L = a sin α_wt.
    pub path_length: f64,
    /// Start of contact: the gear's tip on the pinion's root.
    pub s_in: f64,
    /// End of contact: the pinion's tip on the gear's root.
    pub s_out: f64,
    /// Pitch point.
    pub s_pitch: f64,
    /// Profile (transverse) contact ratio ε_α.
    pub eps_alpha: f64,
    /// Overlap ratio ε_β.
    pub eps_beta: f64,
    /// Total contact ratio ε_γ = ε_α + ε_β.
    pub contact_ratio: f64,
    /// Tip-to-root clearance of the pinion's tip and of the gear's tip; negative where it presses.
    pub clearance: [f64; 2],
    /// Whether the rack undercuts the flank.
    pub undercut: [bool; 2],
    /// Whether the tooth ends in the apex where its two flanks meet, below the tip that its tool
    /// would cut.
    pub pointed: [bool; 2],
}

/// Specific sliding at the ends of a path: 1 − v_mate/v_own, with v the velocities along the
/// profile. Roots are negative, tips positive for the usual path that contains the pitch point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sliding {
    /// Pinion at the start of contact.
    pub pinion_root: f64,
    /// Pinion at the end of contact.
    pub pinion_tip: f64,
    /// Gear at the end of contact.
    pub gear_root: f64,
    /// Gear at the start of contact.
    pub gear_tip: f64,
    /// ζ, the largest magnitude of the four.
    pub max: f64,
}

/// The four quantities of "no teeth interference", mm; a negative one is violated by that much.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interference {
    /// Clearance of the pinion's tip above the gear's root, and of the gear's above the pinion's.
    pub clearance: [f64; 2],
    /// Height of the active flank's start above the start of the involute, which is the end of the fillet or of
    /// the undercut, measured along the line of action.
    pub flank_margin: [f64; 2],
}

impl Interference {
    /// Whether none of the four is violated.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        self.worst_violation() <= 0.0
    }

    /// The largest violation in mm, zero when the teeth are clear of each other.
    #[must_use]
    pub fn worst_violation(&self) -> f64 {
        self.clearance
            .iter()
            .chain(&self.flank_margin)
            .fold(0.0, |worst, &v| worst.max(-v))
    }
}

/// Involute of the working pressure angle at zero backlash.
fn working_involute(
    teeth: [u32; 2],
    pressure_angle: f64,
    helix_angle: f64,
    sum_profile_shift: f64,
) -> f64 {
    let tan_alpha_t = pressure_angle.tan() / helix_angle.cos();
    let sum_teeth = f64::from(teeth[0]) + f64::from(teeth[1]);
    inv_of_tangent(tan_alpha_t) + 2.0 * sum_profile_shift * pressure_angle.tan() / sum_teeth
}

/// Tangent of the angle with this involute.
fn working_tangent(inv_alpha_wt: f64) -> Result<f64, Infeasibility> {
    if inv_alpha_wt > 0.0 && inv_alpha_wt.is_finite() {
        Ok(tangent_of_inv(inv_alpha_wt))
    } else {
        Err(Infeasibility::NoInvoluteSolution { inv_alpha_wt })
    }
}

/// cos of the angle whose tangent is `t`.
fn cos_of_tangent(t: f64) -> f64 {
    1.0 / t.hypot(1.0)
}

/// Normal module in mm of the pair of the given size, without backlash unless the size gives both dimensions.
///
/// `pressure_angle` and `helix_angle` in radians; `sum_profile_shift` is x1 + x2. For a given
/// centre distance a, m = 2 a cos β cos α_wt / ((Z1 + Z2) cos α_t) with
/// inv α_wt = inv α_t + 2 (x1 + x2) tan α_n / (Z1 + Z2).
///
/// # Errors
/// [`Infeasibility::NoInvoluteSolution`] when the involute of α_wt would not be positive.
pub fn normal_module(
    teeth: [u32; 2],
    size: Size,
    pressure_angle: f64,
    helix_angle: f64,
    sum_profile_shift: f64,
) -> Result<f64, Infeasibility> {
    let inv_alpha_wt = working_involute(teeth, pressure_angle, helix_angle, sum_profile_shift);
    Ok(match size {
        Size::Both { normal_module, .. } => normal_module,
        Size::NormalModule(m) => working_tangent(inv_alpha_wt).map(|_| m)?,
        Size::CentreDistance(a) => {
            let tan_alpha_wt = working_tangent(inv_alpha_wt)?;
            let tan_alpha_t = pressure_angle.tan() / helix_angle.cos();
            let sum_teeth = f64::from(teeth[0]) + f64::from(teeth[1]);
            2.0 * a * helix_angle.cos() * cos_of_tangent(tan_alpha_wt)
                / (sum_teeth * cos_of_tangent(tan_alpha_t))
        }
    })
}

/// x1 + x2 of the zero-backlash pair with this normal module and centre distance, both in mm; angles in
/// radians. With cos α_wt = (Z1 + Z2) m cos α_t / (2 a cos β),
/// x1 + x2 = (Z1 + Z2) (inv α_wt − inv α_t) / (2 tan α_n).
///
/// Where the base circles would overlap, the sum is a module below the least of any pair, so that
/// [`normal_module`] refuses it.
#[must_use]
pub fn sum_profile_shift(
    teeth: [u32; 2],
    normal_module: f64,
    centre_distance: f64,
    pressure_angle: f64,
    helix_angle: f64,
) -> f64 {
    let tan_alpha_t = pressure_angle.tan() / helix_angle.cos();
    let sum_teeth = f64::from(teeth[0]) + f64::from(teeth[1]);
    let reference = sum_teeth * normal_module / (2.0 * helix_angle.cos());
    let cos_alpha_wt = reference * cos_of_tangent(tan_alpha_t) / centre_distance;
    let sum_at = |inv_alpha_wt: f64| {
        sum_teeth * (inv_alpha_wt - inv_of_tangent(tan_alpha_t)) / (2.0 * pressure_angle.tan())
    };
    if cos_alpha_wt < 1.0 {
        sum_at(inv_of_tangent(cos_alpha_wt.acos().tan()))
    } else {
        sum_at(0.0) - 1.0
    }
}

impl Geometry {
    /// Computes the geometry of a validated input.
    ///
    /// # Errors
    /// The first reason found why the pair does not exist.
    pub fn new(input: &PairInput) -> Result<Self, Infeasibility> {
        let z = input.teeth.map(f64::from);
        let (alpha_n, beta) = (input.pressure_angle, input.helix_angle.abs());
        let tan_n = alpha_n.tan();
        let sum_shift = input.profile_shift[0] + input.profile_shift[1];
        let m = normal_module(input.teeth, input.size, alpha_n, beta, sum_shift)?;
        let inv_without_backlash = working_involute(input.teeth, alpha_n, beta, sum_shift);
        let tan_t = tan_n / beta.cos();
        let cos_t = cos_of_tangent(tan_t);
        let m_t = m / beta.cos();
        let base_radii = m_t * (z[0] + z[1]) * cos_t / 2.0;
        let (centre_distance, tan_wt, backlash) = match input.size {
            Size::CentreDistance(a) => (a, working_tangent(inv_without_backlash)?, 0.0),
            Size::NormalModule(_) => {
                let tan_wt = working_tangent(inv_without_backlash)?;
                (base_radii / cos_of_tangent(tan_wt), tan_wt, 0.0)
            }
            Size::Both {
                centre_distance, ..
            } => {
                let tan_wt = (base_radii / centre_distance).min(1.0).acos().tan();
                // The circular pitch less both thicknesses at the working pitch circles.
                let excess = inv_of_tangent(tan_wt) - inv_without_backlash;
                let backlash = 2.0 * centre_distance * excess;
                // A slightly negative backlash is rounding: a centre distance without backlash may be given with 12
                // digits.
                if excess < -1e-11 {
                    let without = working_tangent(inv_without_backlash)?;
                    return Err(Infeasibility::Jammed {
                        centre_distance,
                        overlap: -backlash,
                        without_backlash: base_radii / cos_of_tangent(without),
                    });
                }
                if tan_wt <= 0.0 {
                    // The base circles touch or overlap.
                    return Err(Infeasibility::NoInvoluteSolution { inv_alpha_wt: 0.0 });
                }
                (centre_distance, tan_wt, backlash.max(0.0))
            }
        };
        let cos_wt = cos_of_tangent(tan_wt);

        let r = z.map(|z| m_t * z / 2.0);
        let r_b = r.map(|r| r * cos_t);
        let shift = input.profile_shift;
        let r_f = [0, 1].map(|i| r[i] + m * (shift[i] - input.tool_addendum[i]));
        let psi_b =
            [0, 1].map(|i| (PI / 2.0 + 2.0 * shift[i] * tan_n) / z[i] + inv_of_tangent(tan_t));
        let mut r_a = [0, 1].map(|i| {
            input.tip_diameter[i]
                .map_or(r[i] + m * (shift[i] + input.tool_dedendum[i]), |d| d / 2.0)
        });
        let mut pointed = [false; 2];
        for member in Member::BOTH {
            let i = member.index();
            if r_f[i] <= 0.0 {
                return Err(Infeasibility::RootCircleVanishes {
                    member,
                    root_radius: r_f[i],
                });
            }
            if psi_b[i] <= 0.0 {
                return Err(Infeasibility::ToothWithoutThickness {
                    member,
                    half_angle: psi_b[i],
                });
            }
            let apex = r_b[i] * tangent_of_inv(psi_b[i]).hypot(1.0);
            if r_a[i] > apex {
                r_a[i] = apex;
                pointed[i] = true;
            }
        }
        if input.tip_rule == TipRule::ClearRoot {
            for i in 0..2 {
                let clear = centre_distance - r_f[1 - i];
                if r_a[i] > clear {
                    r_a[i] = clear;
                    pointed[i] = false;
                }
            }
        }

        let mut r_na = [0.0; 2];
        let mut t_form = [0.0; 2];
        for member in Member::BOTH {
            let i = member.index();
            if r_a[i] <= r_b[i] {
                return Err(Infeasibility::TipBelowBase {
                    member,
                    tip_radius: r_a[i],
                    base_radius: r_b[i],
                });
            }
            if r_a[i] <= r_f[i] {
                return Err(Infeasibility::TipBelowRoot {
                    member,
                    tip_radius: r_a[i],
                    root_radius: r_f[i],
                });
            }
            let centre_radius = r_a[i] - input.tip_radius[i];
            if centre_radius < r_b[i] {
                return Err(Infeasibility::TipRoundingTooLarge {
                    member,
                    tip_rounding: input.tip_radius[i],
                    centre_radius,
                    base_radius: r_b[i],
                });
            }
            let overlap = -rack_corner_room(input, m, member);
            if overlap > 0.0 {
                return Err(Infeasibility::RackCornerDoesNotFit {
                    member,
                    root_rounding: input.root_radius[i],
                    overlap,
                });
            }
            let t_centre = tangent_length(centre_radius, r_b[i]);
            r_na[i] = r_b[i].hypot(t_centre + input.tip_radius[i]).min(r_a[i]);
            let sin_t = tan_t * cos_t;
            t_form[i] = r[i] * sin_t
                - (m * (input.tool_addendum[i] - shift[i])
                    - input.root_radius[i] * (1.0 - alpha_n.sin()))
                    / sin_t;
        }

        let involute_start = Member::BOTH.map(|member| {
            let i = member.index();
            if t_form[i] >= 0.0 {
                return t_form[i];
            }
            let trochoid = Trochoid::new(input, m, r[i], member);
            trochoid.crossing(r_b[i], psi_b[i]).1
        });
        let path_length = centre_distance * tan_wt * cos_wt;
        let reach = [0, 1].map(|i| tangent_length(r_na[i], r_b[i]));
        for member in Member::BOTH {
            let i = member.index();
            if involute_start[i] >= reach[i] {
                return Err(Infeasibility::NoInvoluteFlank {
                    member,
                    start: involute_start[i],
                    end: reach[i],
                });
            }
            // The mate's tip must touch above this gear's base circle.
            if reach[1 - i] >= path_length {
                return Err(Infeasibility::ContactBeyondBase {
                    member,
                    reach: reach[1 - i],
                    available: path_length,
                });
            }
        }
        let (s_in, s_out) = (path_length - reach[1], reach[0]);
        let base_pitch = PI * m_t * cos_t;
        let eps_alpha = (s_out - s_in) / base_pitch;
        let face_width = input.face_width[0].min(input.face_width[1]);
        let eps_beta = face_width * beta.sin() / (PI * m);
        Ok(Self {
            teeth: input.teeth,
            normal_module: m,
            centre_distance,
            alpha_n,
            alpha_t: tan_t.atan(),
            alpha_wt: tan_wt.atan(),
            beta,
            beta_b: (beta.sin() * alpha_n.cos()).asin(),
            face_width,
            r,
            r_b,
            r_a,
            r_f,
            r_na,
            psi_b,
            t_form,
            involute_start,
            backlash,
            base_pitch,
            path_length,
            s_in,
            s_out,
            s_pitch: path_length * z[0] / (z[0] + z[1]),
            eps_alpha,
            eps_beta,
            contact_ratio: eps_alpha + eps_beta,
            clearance: [0, 1].map(|i| centre_distance - r_a[i] - r_f[1 - i]),
            undercut: t_form.map(|t| t < 0.0),
            pointed,
        })
    }

    /// Specific sliding ζ of the given gear's flank at `s`: 1 − v_mate/v_own. Its magnitude is the sliding
    /// distance per length of the own profile that passes through the contact.
    #[must_use]
    pub fn specific_sliding(&self, member: Member, s: f64) -> f64 {
        let ratio = f64::from(self.teeth[0]) / f64::from(self.teeth[1]);
        let (v1, v2) = (s, (self.path_length - s) * ratio);
        match member {
            Member::Pinion => 1.0 - v2 / v1,
            Member::Gear => 1.0 - v1 / v2,
        }
    }

    /// Specific sliding at both ends of the [path that undercut leaves](Self::path_left).
    #[must_use]
    pub fn sliding(&self) -> Sliding {
        self.sliding_between(self.path_left())
    }

    /// Specific sliding at the start and the end of a path of contact.
    #[must_use]
    pub fn sliding_between(&self, [start, end]: [f64; 2]) -> Sliding {
        let [pinion_root, gear_tip] = Member::BOTH.map(|of| self.specific_sliding(of, start));
        let [pinion_tip, gear_root] = Member::BOTH.map(|of| self.specific_sliding(of, end));
        let max = [pinion_root, pinion_tip, gear_root, gear_tip]
            .into_iter()
            .fold(0.0, |max: f64, v| max.max(v.abs()));
        Sliding {
            pinion_root,
            pinion_tip,
            gear_root,
            gear_tip,
            max,
        }
    }

    /// The four quantities of "no teeth interference".
    #[must_use]
    pub fn interference(&self) -> Interference {
        Interference {
            clearance: self.clearance,
            flank_margin: [
                self.s_in - self.involute_start[0],
                self.path_length - self.s_out - self.involute_start[1],
            ],
        }
    }

    /// Start and end of the path of contact on the flanks that undercut leaves: the path ends where the flank is cut
    /// away. A path into a fillet is not shortened, because the teeth interfere there, see [`Geometry::interference`].
    /// The start lies beyond the end if undercut leaves no path.
    #[must_use]
    pub fn path_left(&self) -> [f64; 2] {
        let cut = |i: usize| {
            if self.undercut[i] {
                self.involute_start[i]
            } else {
                0.0
            }
        };
        [
            self.s_in.max(cut(0)),
            self.s_out.min(self.path_length - cut(1)),
        ]
    }

    /// The transverse contact ratio ε_α of the [path that undercut leaves](Self::path_left).
    #[must_use]
    pub fn eps_alpha_left(&self) -> f64 {
        let [start, end] = self.path_left();
        (end - start) / self.base_pitch
    }

    /// Tangent length of the point `s` on the given gear: s on the pinion, L − s on the gear.
    #[must_use]
    pub fn tangent_length(&self, member: Member, s: f64) -> f64 {
        match member {
            Member::Pinion => s,
            Member::Gear => self.path_length - s,
        }
    }

    /// Roll angle in radians at which the given gear touches at `s`.
    #[must_use]
    pub fn roll_angle(&self, member: Member, s: f64) -> f64 {
        self.tangent_length(member, s) / self.r_b[member.index()]
    }

    /// Radius of relative curvature of the flanks at `s`, normal to the contact line, mm.
    #[must_use]
    pub fn relative_radius(&self, s: f64) -> f64 {
        s * (self.path_length - s) / (self.path_length * self.beta_b.cos())
    }
}
