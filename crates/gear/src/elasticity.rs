//! Compliance of a pair of teeth per length of contact line: both teeth, and their contact.
//!
//! With `weber-banaschek` the contact's approach depends on the load w,
//! q_H(w) = 2 (1 − ν²)/(π E) [ln(4 t1 t2/a_H²) − ν/(1 − ν)], a_H² = 8 w R (1 − ν²)/(π E), with t_i the
//! half thicknesses along the load line and R the relative radius. The other models take a constant.

use std::f64::consts::PI;

use crate::geometry::Geometry;
use crate::input::{Member, PairInput, ToothModel};
use crate::tooth::Tooth;

/// Least value of Weber's bracket ln(4 t1 t2/a_H²) − ν/(1 − ν). Near a pointed tip or under an
/// absurd load the contact width exceeds the tooth and the bracket would turn negative.
const WEBER_FLOOR: f64 = 1.0;
/// Greatest value of Weber's bracket, which grows without bound as the load vanishes.
const WEBER_CEILING: f64 = 100.0;

/// The parts of the compliance at a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeCompliance {
    s: f64,
    /// Both teeth with their foundations, mm per N/mm.
    pub(crate) teeth: f64,
    /// Product of the half thicknesses along the load line, mm².
    thickness: f64,
}

/// The parts of a pair that its compliance follows from.
pub(crate) struct Elasticity<'a> {
    pub(crate) input: &'a PairInput,
    pub(crate) geometry: &'a Geometry,
    pub(crate) teeth: &'a [Tooth; 2],
}

impl Elasticity<'_> {
    /// The compliance at the place `s`, without that of the contact.
    pub(crate) fn node(&self, s: f64) -> NodeCompliance {
        let [pinion, gear] = Member::BOTH.map(|member| {
            let i = member.index();
            let r = self.geometry.r_b[i].hypot(self.geometry.tangent_length(member, s));
            let load = self.teeth[i].load_at_radius(r);
            (self.teeth[i].compliance(&load), load.half_thickness)
        });
        NodeCompliance {
            s,
            teeth: pinion.0 + gear.0,
            thickness: pinion.1 * gear.1,
        }
    }

    /// Compliance of the contact under the line load `w`, N/mm; mm per N/mm.
    pub(crate) fn contact(&self, node: &NodeCompliance, w: f64) -> f64 {
        let material = &self.input.material;
        let nu = material.poisson_ratio;
        let unit = 2.0 * (1.0 - nu * nu) / (PI * material.youngs_modulus_mpa);
        match self.input.tooth_model {
            ToothModel::HertzBeam | ToothModel::WholeFaceBeam | ToothModel::PrismaticBeam => {
                2.0 * unit
            }
            ToothModel::WeberBanaschek => {
                let half_width_squared = 4.0 * unit * w * self.geometry.relative_radius(node.s);
                let bracket = if half_width_squared > 0.0 {
                    (4.0 * node.thickness / half_width_squared).ln() - nu / (1.0 - nu)
                } else {
                    f64::INFINITY
                };
                unit * bracket.clamp(WEBER_FLOOR, WEBER_CEILING)
            }
        }
    }
}
