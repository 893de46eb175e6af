//! Compliance of a pair of teeth per length of contact line: both teeth, and their contact.
//!
//! With `weber-banaschek` the contact's approach depends on the load w,
//! q_H(w) = 2 (1 − ν²)/(π E) [ln(4 t1 t2/a_H²) − ν/(1 − ν)], a_H² = 8 w R (1 − ν²)/(π E), with t_i the
//! half thicknesses along the load line and R the relative radius. That is for equal materials; otherwise each
//! gear adds its half with its own E, ν and t. The other models take a constant.
use crate::coupled::body::Body;
use crate::input::{Member, ToothModel};
use crate::path::Place;
use crate::station::Station;
use crate::tooth::Load;
use crate::unloaded::UnloadedPair;

/// Least value of Weber's bracket ln(4 t1 t2/a_H²) − ν/(1 − ν). Near a pointed tip or under an
/// absurd load the contact width exceeds the tooth and the bracket would turn negative.
const WEBER_FLOOR: f64 = 1.0;
/// Greatest value of Weber's bracket, which grows without bound as the load vanishes.
const WEBER_CEILING: f64 = 100.0;

/// The properties of a place of contact that the approach of the flanks depends on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ContactPlace {
    s: f64,
    /// Product of the half thicknesses along the load line, mm².
    thickness: f64,
}

/// The parts of the compliance at a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeCompliance {
    pub(crate) touching: ContactPlace,
    /// Both teeth with their foundations, mm per N/mm.
    pub(crate) teeth: f64,
    /// The place on both teeth; used by coupled cells only.
    pub(crate) stations: [Station; 2],
}

impl NodeCompliance {
    /// The compliance at a place between nodes.
    pub(crate) fn between(nodes: &[Self], place: Place) -> Self {
        let (a, b) = (&nodes[place.cell], &nodes[place.cell + 1]);
        let mix = |a: f64, b: f64| a + place.u * (b - a);
        Self {
            touching: ContactPlace {
                s: place.s,
                thickness: mix(a.touching.thickness, b.touching.thickness),
            },
            teeth: mix(a.teeth, b.teeth),
            stations: [0, 1].map(|i| a.stations[i].zip(&b.stations[i], |&a, &b| mix(a, b))),
        }
    }
}

impl UnloadedPair {
    /// The constants of the bodies under the teeth, for the model `coupled`.
    pub(crate) fn bodies(&self) -> [Body; 2] {
        Member::BOTH.map(|member| Body::new(self.input(), self.geometry(), member))
    }

    /// The compliance at each of the places `s` under a load that is even along the face, without that of the
    /// contact.
    pub(crate) fn nodes(&self, s: &[f64]) -> Vec<NodeCompliance> {
        let (input, geometry) = (self.input(), self.geometry());
        let bodies = (input.tooth_model == ToothModel::Coupled).then(|| self.bodies());
        let of_gear = |member: Member| -> Vec<(f64, f64, Station)> {
            let i = member.index();
            let tooth = &self.teeth[i];
            let radius = |&s: &f64| geometry.r_b[i].hypot(geometry.tangent_length(member, s));
            let loads: Vec<Load> = s.iter().map(|s| tooth.load_at_radius(radius(s))).collect();
            let compliances = tooth.compliances(&loads);
            let parts = loads.iter().zip(compliances).map(|(load, mut compliance)| {
                let mut station = Station::default();
                if let Some(bodies) = &bodies {
                    station = tooth.station(load);
                    let own = bodies[i].own(station.u, station.u);
                    compliance += own / input.material[i].youngs_modulus_mpa;
                }
                (compliance, load.half_thickness, station)
            });
            parts.collect()
        };
        // Each gear's approach counts by its share of the surfaces' compliance, which is a half for equal materials.
        let surface = input.surface_compliance();
        let share = [0, 1].map(|i| 2.0 * surface[i] / (surface[0] + surface[1]));
        let weigh = |depth: f64, i: usize| match share[i] {
            1.0 => depth,
            share => depth.powf(share),
        };
        let [pinion, gear] = Member::BOTH.map(of_gear);
        let of_both = s.iter().zip(pinion.into_iter().zip(gear));
        of_both
            .map(|(&s, (pinion, gear))| NodeCompliance {
                touching: ContactPlace {
                    s,
                    thickness: weigh(pinion.1, 0) * weigh(gear.1, 1),
                },
                teeth: pinion.0 + gear.0,
                stations: [pinion.2, gear.2],
            })
            .collect()
    }

    /// Compliance of the contact under the line load `w`, N/mm; mm per N/mm.
    pub(crate) fn contact(&self, at: &ContactPlace, w: f64) -> f64 {
        let input = self.input();
        let surface = input.surface_compliance();
        let unit = surface[0] + surface[1];
        match self.input().tooth_model {
            ToothModel::HertzBeam | ToothModel::WholeFaceBeam | ToothModel::PrismaticBeam => {
                2.0 * unit
            }
            ToothModel::WeberBanaschek | ToothModel::Coupled => {
                let half_width_squared = 4.0 * unit * w * self.geometry().relative_radius(at.s);
                let bracket = if half_width_squared > 0.0 {
                    let lateral = [0, 1].map(|i| {
                        let nu = input.material[i].poisson_ratio;
                        surface[i] / unit * (nu / (1.0 - nu))
                    });
                    (4.0 * at.thickness / half_width_squared).ln() - (lateral[0] + lateral[1])
                } else {
                    f64::INFINITY
                };
                unit * bracket.clamp(WEBER_FLOOR, WEBER_CEILING)
            }
        }
    }
}
