//! One tooth in the virtual normal section: its outline, its elastic compliance, and its critical root
//! section.
//!
//! A helical tooth bends in its normal section, where the rack corner is a true circle. The
//! virtual spur gear of that section has z_n = Z/(cos²β_b cos β) teeth, module m and reference
//! radius r_n = m z_n/2; a point at transverse radius r is at ρ = r_n + (r − r_ref) there. The
//! tooth axis is y, half thickness x(y).
//!
//! The fillet is the trochoid of the rack corner (`fillet`). An undercut tooth changes over where
//! trochoid and involute cross.
//!
//! The integrals of bending, shear and compression along the axis are taken by adaptive quadrature
//! (`quadrature`), from the root circle to the tip, with the joint of trochoid and involute as a fixed
//! break. A tooth for which its tolerance is not reached is refused
//! ([`Infeasibility::ComplianceUnresolved`]).
//!
//! **Undercut** teeth follow the trochoid up to its crossing with the involute; a tooth that is
//! undercut from both sides to nothing is refused. **Pointed** tips end in the apex; a load closer
//! to it than a thickness of [`THIN_TIP`] modules is counted as acting there.
//!
//! References: C. Weber, K. Banaschek, *Formänderung und Profilrücknahme bei gerad- und
//! schrägverzahnten Rädern*, Vieweg 1953; ISO 6336-3:2006 (30° tangent section, notch factor).
//! Left out: coupling between neighbouring slices of the face, thin rims and shafts.

use crate::error::Infeasibility;
use crate::fillet::Fillet;
use crate::geometry::Geometry;
use crate::input::{Member, PairInput, ToothModel};
use crate::involute::{inv_of_tangent, tangent_length, tangent_of_inv};
use crate::quadrature::{Failure, Point, ToothIntegrals};
use crate::root::root;
use crate::station::{Station, influence};
use crate::trochoid::crossing;
use crate::trochoid::rack_corner_room;

#[cfg(test)]
mod tests;

/// Half thickness, in modules, at which a thin tip ends for the purpose of compliance. A beam that
/// ends in a knife edge is infinitely soft there, by the logarithm of the distance; a load beyond
/// this thickness is counted as acting at it.
const THIN_TIP: f64 = 0.01;

/// Panels that the adaptive quadrature starts with on the fillet and on the involute.
const PANELS: [usize; 2] = [2, 2];
/// Places along the fillet at which it is searched for a cusp.
const CUSP_SEARCH: usize = 32;
/// Half thickness, in modules, at which a tooth counts as severed. No tooth stands on a millionth of
/// its module, and on a tenth of that the rounding of the coordinates shows in 1/x³.
const SEVERED: f64 = 1e-6;

/// A curve of points (x, y).
#[cfg(test)]
pub(crate) type OutlineOf<'a> = Box<dyn Fn(f64) -> (f64, f64) + 'a>;

/// The place and the direction of a load on the tooth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Load {
    pub(crate) cos_alpha_f: f64,
    tan_alpha_f: f64,
    /// Height at which the load line crosses the tooth axis.
    pub(crate) y_l: f64,
    /// Distance from the contact point to the tooth axis along the load line.
    pub(crate) half_thickness: f64,
}

/// The critical root section.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CriticalSection {
    /// Chord s_F.
    pub(crate) chord: f64,
    /// Height of the section on the tooth axis.
    pub(crate) y: f64,
    /// Radius of curvature of the fillet there; infinite or negative where it is not a notch.
    pub(crate) fillet_radius: f64,
}

/// One tooth of the virtual normal section.
#[derive(Debug, Clone)]
pub(crate) struct Tooth {
    fillet: Fillet,
    r_b: f64,
    /// Half-angle at the base circle.
    psi_b: f64,
    /// ρ − r, the shift from transverse to virtual radii.
    offset: f64,
    /// Tangent length at which the involute takes over from the trochoid.
    tau_start: f64,
    /// Largest tangent length at which the tooth still has the thickness to carry load.
    tau_tip: f64,
    /// γ at which the involute takes over from the trochoid.
    gamma_top: f64,
    /// Tangent length at which both flanks would meet.
    tau_apex: f64,
    /// Half thickness and height of the root circle's end.
    root: (f64, f64),
    /// Thickness at the reference circle.
    thickness: f64,
    integrals: ToothIntegrals,
    model: ToothModel,
    youngs: f64,
    poisson: f64,
}

/// A point of the involute; α_F is the inclination of its tangent against the tooth axis.
struct FlankPoint {
    x: f64,
    y: f64,
    sin_alpha_f: f64,
    cos_alpha_f: f64,
}

impl Tooth {
    /// Builds the outline and integrates along it.
    ///
    /// # Errors
    /// [`Infeasibility::FilletCusp`], [`Infeasibility::NoInvoluteFlank`], [`Infeasibility::ToothSevered`] or
    /// [`Infeasibility::ComplianceUnresolved`].
    pub(crate) fn new(
        input: &PairInput,
        geometry: &Geometry,
        member: Member,
    ) -> Result<Self, Infeasibility> {
        let i = member.index();
        let (m, alpha) = (geometry.normal_module, geometry.alpha_n);
        let cos_bb = geometry.beta_b.cos();
        let z_n = f64::from(geometry.teeth[i]) / (cos_bb * cos_bb * geometry.beta.cos());
        let r_n = m * z_n / 2.0;
        let r_b = r_n * alpha.cos();
        // Thickness at the reference circle, in modules.
        let s_n = std::f64::consts::FRAC_PI_2 + 2.0 * input.profile_shift[i] * alpha.tan();
        let psi_b = s_n / z_n + inv_of_tangent(alpha.tan());
        let rho = input.root_radius[i];
        let fillet = Fillet {
            r_n,
            h_c: m * (input.tool_addendum[i] - input.profile_shift[i]) - rho,
            rho,
            x_c: std::f64::consts::FRAC_PI_2 * m - rack_corner_room(input, m, member),
        };
        let offset = r_n - geometry.r[i];
        if psi_b <= 0.0 {
            return Err(Infeasibility::ToothWithoutThickness {
                member,
                half_angle: psi_b,
            });
        }
        let reach = tangent_length(offset + geometry.r_a[i], r_b);
        let thickness = m * s_n;
        if input.tooth_model == ToothModel::PrismaticBeam && thickness <= 0.0 {
            return Err(Infeasibility::BeamWithoutThickness { member, thickness });
        }
        let mut tooth = Self {
            fillet,
            r_b,
            psi_b,
            offset,
            tau_start: r_n * alpha.sin() - (fillet.h_c + rho * alpha.sin()) / alpha.sin(),
            tau_tip: reach,
            gamma_top: std::f64::consts::FRAC_PI_2 - alpha,
            tau_apex: r_b * tangent_of_inv(psi_b),
            root: fillet.point(0.0),
            thickness,
            integrals: ToothIntegrals::default(),
            model: input.tooth_model,
            youngs: input.material[member.index()].youngs_modulus_mpa,
            poisson: input.material[member.index()].poisson_ratio,
        };
        if (0..=CUSP_SEARCH)
            .map(|k| tooth.gamma_top * k as f64 / CUSP_SEARCH as f64)
            .any(|gamma| fillet.speed(gamma.cos()) <= 0.0)
        {
            return Err(Infeasibility::FilletCusp {
                member,
                height: -fillet.h_c,
            });
        }
        if tooth.tau_start < 0.0 {
            (tooth.gamma_top, tooth.tau_start) =
                crossing(|gamma| fillet.point(gamma), tooth.gamma_top, r_b, psi_b);
        }
        // The apex of the virtual section differs slightly from the transverse one, so even a tip
        // with a land in the one may be pointed in the other.
        let apex = tooth.tau_apex;
        let thin = |tau: f64| tooth.involute_point(tau).x - THIN_TIP * m;
        if reach >= apex || thin(reach) < 0.0 {
            // The end stays short of the apex, where the piece's parameter is infinite. That matters for a
            // tooth that is thin all along.
            let end = root(tooth.tau_start.min(apex), reach.min(apex), thin);
            tooth.tau_tip = end.min(apex * (1.0 - 1e-12));
        }
        if tooth.tau_start >= tooth.tau_tip {
            return Err(Infeasibility::NoInvoluteFlank {
                member,
                start: tooth.tau_start,
                end: tooth.tau_tip,
            });
        }
        let failed = |failure| match failure {
            Failure::Severed(half_thickness) => Infeasibility::ToothSevered {
                member,
                half_thickness,
            },
            Failure::Unresolved(error) => Infeasibility::ComplianceUnresolved { member, error },
        };
        tooth.integrate(SEVERED * m).map_err(failed)?;
        Ok(tooth)
    }

    /// Point of the involute at the tangent length τ, where the tangent is inclined by α_F = τ/r_b − ψ_b.
    fn involute_point(&self, tau: f64) -> FlankPoint {
        let t = tau / self.r_b;
        let (sin, cos) = (t - self.psi_b).sin_cos();
        FlankPoint {
            x: self.r_b * (t * cos - sin),
            y: self.r_b * (cos + t * sin),
            sin_alpha_f: sin,
            cos_alpha_f: cos,
        }
    }

    /// Integrates along fillet and involute.
    fn integrate(&mut self, least: f64) -> Result<(), Failure> {
        let mut integrals = ToothIntegrals::default();
        let fillet = [0.0, Fillet::parameter(self.gamma_top)];
        integrals.add_piece(fillet, PANELS[0], least, |w| self.fillet.along(w))?;
        // v = −ln(1 − τ/τ_apex) spreads the growth of 1/x³ towards the apex evenly.
        let parameter = |tau: f64| -(-tau / self.tau_apex).ln_1p();
        let on_involute = |v: f64| {
            let left = (-v).exp();
            let tau = self.tau_apex * (1.0 - left);
            let point = self.involute_point(tau);
            // dl = (τ/r_b) dτ along the involute, inclined by α_F against the axis.
            let rate = tau / self.r_b * point.cos_alpha_f * self.tau_apex * left;
            Point {
                x: point.x,
                y: point.y,
                rate,
            }
        };
        let involute = [parameter(self.tau_start), parameter(self.tau_tip)];
        integrals.add_piece(involute, PANELS[1], least, on_involute)?;
        self.integrals = integrals;
        Ok(())
    }

    /// Half the outline by its plain parameters, γ on the fillet and τ on the involute, with their
    /// ranges: for tests.
    #[cfg(test)]
    pub(crate) fn pieces(&self) -> [(OutlineOf<'_>, [f64; 2]); 2] {
        let involute = |tau: f64| {
            let point = self.involute_point(tau);
            (point.x, point.y)
        };
        [
            (
                Box::new(|gamma| self.fillet.point(gamma)),
                [0.0, self.gamma_top],
            ),
            (Box::new(involute), [self.tau_start, self.tau_tip]),
        ]
    }

    /// Transverse radii between which the load point moves with the radius of contact: where the
    /// flank leaves the virtual base circle, and where it becomes too thin.
    pub(crate) fn load_range(&self) -> (f64, f64) {
        (
            self.r_b - self.offset,
            self.r_b.hypot(self.tau_tip) - self.offset,
        )
    }

    /// The load that touches at the transverse radius `r`, mm.
    pub(crate) fn load_at_radius(&self, r: f64) -> Load {
        self.load_below_tip(r, 0.0)
    }

    /// The load that touches `back` mm of tangent length before the transverse radius `r`.
    pub(crate) fn load_below_tip(&self, r: f64, back: f64) -> Load {
        let tau = (tangent_length(self.offset + r, self.r_b) - back).clamp(0.0, self.tau_tip);
        let point = self.involute_point(tau);
        let (sin, cos) = (point.sin_alpha_f, point.cos_alpha_f);
        Load {
            cos_alpha_f: cos,
            tan_alpha_f: sin / cos,
            y_l: self.r_b / cos,
            half_thickness: point.x / cos,
        }
    }

    /// M2 and ∫ dy/(2x) for a load line that crosses the axis at the height `y`.
    #[cfg(test)]
    pub(crate) fn integrals(&self, y: f64) -> (f64, f64) {
        let [_, m2, n0] = self.integrals.moments(y);
        (m2, n0)
    }

    /// Compliance of the tooth and its foundation under each of `loads`, mm per N/mm; contact excluded.
    pub(crate) fn compliances(&self, loads: &[Load]) -> Vec<f64> {
        let nu = self.poisson;
        let of_beam = |(load, m2): (&Load, f64)| {
            let bending = 12.0 * (1.0 - nu * nu) * m2;
            load.cos_alpha_f * load.cos_alpha_f * bending / self.youngs
        };
        let loaded = loads.iter();
        match self.model {
            ToothModel::HertzBeam | ToothModel::WholeFaceBeam => {
                let heights: Vec<f64> = loads.iter().map(|load| load.y_l).collect();
                let moments = self.integrals.second_moments(&heights);
                loaded.zip(moments).map(of_beam).collect()
            }
            ToothModel::PrismaticBeam => {
                let moment = |load: &Load| {
                    let arm = (load.y_l - self.root.1).max(0.0);
                    (arm / self.thickness).powi(3) / 3.0
                };
                loaded.map(|load| of_beam((load, moment(load)))).collect()
            }
            ToothModel::WeberBanaschek | ToothModel::Coupled => {
                let of_tooth = |load: &Load| {
                    let station = self.station(load);
                    let [bending, rest] = influence(&station, &station, nu);
                    (bending + rest) / self.youngs
                };
                loaded.map(of_tooth).collect()
            }
        }
    }

    /// The station of `load`.
    pub(crate) fn station(&self, load: &Load) -> Station {
        let [m1, m2, n0] = self.integrals.moments(load.y_l);
        let (root_x, root_y) = self.root;
        Station {
            cos_alpha_f: load.cos_alpha_f,
            tan_alpha_f: load.tan_alpha_f,
            y: load.y_l,
            u: ((load.y_l - root_y) / (2.0 * root_x)).max(0.0),
            m1,
            m2,
            n0,
        }
    }

    /// The section whose fillet tangent is inclined by 30° against the tooth axis; the end of the
    /// fillet nearest to it where the fillet has no such tangent.
    pub(crate) fn critical_section(&self) -> CriticalSection {
        let target = std::f64::consts::FRAC_PI_3;
        let excess = |gamma: f64| self.fillet.inclination(gamma) - target;
        let gamma = if excess(0.0) >= 0.0 {
            0.0
        } else if excess(self.gamma_top) <= 0.0 {
            self.gamma_top
        } else {
            root(0.0, self.gamma_top, excess)
        };
        let (x, y) = self.fillet.point(gamma);
        CriticalSection {
            chord: 2.0 * x,
            y,
            fillet_radius: self.fillet.curvature_radius(gamma),
        }
    }
}
