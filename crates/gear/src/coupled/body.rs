//! The compliance that the body under the teeth adds to the loaded tooth and to its neighbours.
//!
//! Weber and Banaschek's teeth stand on an elastic half-plane. A gear's body ends at its hub, is as
//! wide as the face, and carries further teeth, which move with the loaded one. The terms here are
//! the difference, fitted to finite elements; u is a place on the flank, its height above the root
//! in thicknesses of the root.

use std::f64::consts::PI;

use crate::geometry::Geometry;
use crate::input::{Member, PairInput};

/// Depth of the hub below the root circle, in modules, where the input gives no hub radius.
pub(crate) const HUB_DEPTH: f64 = 3.5;
/// Least hub radius in root radii: a small gear has no room for the usual depth.
const LEAST_HUB: f64 = 0.25;

/// The hub radius of a gear, mm: where its body is clamped.
pub(crate) fn hub_radius(input: &PairInput, geometry: &Geometry, member: Member) -> f64 {
    let i = member.index();
    let usual = geometry.r_f[i] - HUB_DEPTH * geometry.normal_module;
    input.hub_radius[i].unwrap_or_else(|| usual.max(LEAST_HUB * geometry.r_f[i]))
}

/// The constants of a gear's body, times Young's modulus.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Body {
    /// Twist of the body up to the hub: the same for all teeth.
    pub(crate) twist: f64,
    constant: f64,
    linear: f64,
    product: f64,
    curved: f64,
    /// The next tooth and the one after it.
    pub(crate) neighbours: [Neighbour; 2],
}

/// The constants of a neighbouring tooth. "Lead" is the place on the flank of the tooth that is ahead
/// for the pinion (behind for the gear), "trail" that of the other one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Neighbour {
    constant: f64,
    lead: f64,
    trail: f64,
    pub(crate) product: f64,
    tilt: f64,
    tilt_product: f64,
    slope: f64,
    slope_lead: f64,
    slope_trail: f64,
}

/// Displacement of a tooth further away than the second neighbour, beyond the twist, times Young's modulus.
pub(crate) const FAR: f64 = 0.078;

impl Body {
    pub(crate) fn new(input: &PairInput, geometry: &Geometry, member: Member) -> Self {
        let i = member.index();
        let nu = input.material[i].poisson_ratio;
        let z = f64::from(geometry.teeth[i]);
        let s2 = geometry.beta.sin().powi(2);
        let t = geometry.beta.tan();
        let width = geometry.face_width / geometry.normal_module;
        let (q1, q2) = (s2 / width, s2 / (width * width));
        let r_b = geometry.r_b[i];
        let squared = |r: f64| (r_b / r).powi(2);
        let twist = (1.0 + nu) / (2.0 * PI)
            * (squared(hub_radius(input, geometry, member)) - squared(geometry.r_f[i]))
            * geometry.beta_b.cos().powi(2);
        Self {
            twist,
            constant: twist - 0.125 + 10.34 * q1 + 15.1 * q2,
            linear: -0.033 - 7.4 * q1 + 32.5 * q2 + 0.168 * s2,
            product: -0.81 + 14.6 / z + 133.6 * q2 + 3.42 / width + 11.24 * q1,
            curved: 0.01 + 5.87 * q2,
            neighbours: [
                Neighbour {
                    constant: 0.327 + 8.58 / z + 0.68 * q1 + 11.75 * q2,
                    lead: 0.024 - 0.68 / z + 2.17 * q1 + 18.2 * q2,
                    trail: -0.073 - 2.35 / z - 1.78 * q1 + 7.0 * q2,
                    product: -0.722 + 4.0 / z - 2.57 * q1 + 16.0 * q2,
                    tilt: 4.0 * t / (width * width + 1.0),
                    tilt_product: -0.13 * t,
                    slope: 0.13 * t,
                    slope_lead: 1.35 * t / width,
                    slope_trail: t * (-0.22 + 0.009 * width).min(-0.1),
                },
                Neighbour {
                    constant: 0.146 + 3.3 / z - 0.25 * q1 + 1.6 * q2,
                    lead: 1.32 / z - 0.22 * q1 + 6.5 * q2,
                    trail: 0.038 - 2.6 / z - 0.62 * q1 + 0.7 * q2,
                    product: -0.027 - 0.87 / z,
                    tilt: 0.8 * t / (width + 0.8),
                    tilt_product: 0.0,
                    slope: 0.03 * t,
                    slope_lead: 0.45 * t / width,
                    slope_trail: -0.08 * t,
                },
            ],
        }
    }

    /// Displacement that the body adds to the loaded tooth at the place `u` for a load at `v`, per line load that is
    /// even along the face and times Young's modulus.
    pub(crate) fn own(&self, u: f64, v: f64) -> f64 {
        let curve = |u: f64| 6.25 * u * (0.8 - u);
        self.constant
            + self.linear * (u + v)
            + self.product * u * v
            + self.curved * (curve(u) + curve(v))
    }
}

impl Neighbour {
    /// Factor of the shifted kernel.
    pub(crate) fn even(&self, lead: f64, trail: f64) -> f64 {
        self.constant + self.lead * lead + self.trail * trail
    }

    /// Factor of the antisymmetric tilt, for the tooth ahead.
    pub(crate) fn antisymmetric(&self, product: f64) -> f64 {
        self.tilt + self.tilt_product * product
    }

    /// Factor of the symmetric tilt, for the pinion.
    pub(crate) fn symmetric(&self, lead: f64, trail: f64) -> f64 {
        self.slope + self.slope_lead * lead + self.slope_trail * trail
    }
}
