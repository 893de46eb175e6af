//! One gear pair: geometry and compliance once, then as many wear states as wanted.
//!
//! # Load-dependent compliance
//! With `weber-banaschek` the contact's approach depends on the load,
//! q_H(w) = 2 (1 − ν²)/(π E) [ln(4 t1 t2/a_H²) − ν/(1 − ν)], a_H² = 8 w R (1 − ν²)/(π E), with t_i the
//! half thicknesses along the load line and R the relative radius. The load used at s is the greatest
//! one met there over the mesh period, so that q stays a function of s alone, and it is the fixed
//! point of
//!
//! w(s) = max over the phases in contact at s of max(0, δ(φ) − g(s)) / q(s, w(s)),
//!
//! δ(φ) the deflection that q gives, g the tip relief. Rounds start from the mean load. A round moves
//! w by a factor of about q_H′ w/q, at most a tenth, so it contracts; rounds end when no place's load
//! changes by more than 2e-5, which leaves the compliance within about 1e-6 of its fixed point. Wear does
//! not change it: the logarithm hardly notices the load that wear moves.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::balance::Extremes;
use crate::corrections::Corrections;
use crate::error::{Error, Infeasible, InputError};
use crate::geometry::{Geometry, Interference, Sliding, tangent_length};
use crate::input::{Discretisation, Member, PairInput, ToothModel, Wear, WearLaw};
use crate::manufacture::FlankClass;
use crate::mesh::{Mesh, Scratch};
use crate::path::{Path, Touch};
use crate::rating::stress_correction;
use crate::sampler::Sampler;
use crate::tooth::Tooth;

/// Micrometres in a millimetre.
const UM: f64 = 1e3;

/// Least value of Weber's bracket ln(4 t1 t2/a_H²) − ν/(1 − ν). Near a pointed tip or under an
/// absurd load the contact width exceeds the tooth and the bracket would turn negative.
const WEBER_FLOOR: f64 = 1.0;
/// Greatest value of Weber's bracket, which grows without bound as the load vanishes.
const WEBER_CEILING: f64 = 100.0;

/// A crowned pair's contact lines are integrated one by one, so their number is limited.
const MOST_CROWNED_PAIRS: f64 = 100.0;

/// Load rounds of the `weber-banaschek` model stop at this relative change of the load. The
/// compliance changes twenty times less than the load.
const LOAD_TOLERANCE: f64 = 2e-5;
/// Least load for which Weber's approach is evaluated, as a share of the mean load. A place that
/// tip relief keeps free of load would be infinitely soft, and stay so when wear loads it.
const LEAST_LOAD: f64 = 0.01;

/// The most load rounds. Five are usual; thin tips and absurd loads, where Weber's bracket is
/// clamped, may need more.
const LOAD_ROUNDS: usize = 12;

/// Static transmission error over one mesh period, and what goes with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// Mesh phases in base pitches, increasing, from 0 to below 1; not evenly spaced.
    pub phases: Vec<f64>,
    /// Transverse static transmission error at those phases, µm along the line of action.
    pub ste_um: Vec<f64>,
    /// ΔSTE = max − min over the period, µm. Extremes between the phases are included.
    pub delta_ste_um: f64,
    /// F, the highest Hertz pressure over the phases and the path, MPa.
    pub hertz_pressure_mpa: f64,
}

/// A pair worn by Archard's law.
#[derive(Debug, Clone, PartialEq)]
pub struct Worn {
    /// The analysis of the worn pair.
    pub analysis: Analysis,
    /// Places on the path of contact, mm from the pinion's base tangent point.
    pub s: Vec<f64>,
    /// Depth of wear W(s) on each flank, mm normal to it; negative where [`WearLaw::Signed`] adds
    /// material.
    pub depth: Vec<f64>,
    /// Greatest Hertz pressure over the mesh period at those places, MPa.
    pub pressure: Vec<f64>,
}

/// Highest bending stress at the root of one gear, for the whole load on one tooth's tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RootStress {
    /// Nominal stress times notch factor, MPa.
    pub stress_mpa: f64,
    /// Nominal bending stress in the 30° section, MPa.
    pub nominal_mpa: f64,
    /// Notch factor Y_S, at least 1.
    pub notch_factor: f64,
    /// Notch parameter q_s = s_F/(2 ρ_F).
    pub notch_parameter: f64,
    /// Whether q_s lies in the range 1 … 8 for which the notch factor was fitted.
    pub in_range: bool,
    /// Root chord s_F, mm.
    pub chord: f64,
    /// Bending arm h_F, mm.
    pub arm: f64,
    /// Fillet radius ρ_F in the 30° section, mm.
    pub fillet_radius: f64,
}

/// A gear pair whose geometry, compliance and unworn behaviour are known.
#[derive(Debug, Clone)]
pub struct Pair {
    input: PairInput,
    corrections: Corrections,
    geometry: Geometry,
    pub(crate) teeth: [Tooth; 2],
    pub(crate) mesh: Arc<Mesh>,
    base_force: f64,
    /// Load per length of contact line at the nodes for which the compliance holds.
    load: Vec<f64>,
    /// Gap of the tip relief at the nodes, mm.
    pub(crate) relief: Vec<f64>,
    unworn: Analysis,
    /// Greatest unworn Hertz pressure at the nodes, MPa.
    pressure: Vec<f64>,
}

impl Pair {
    /// Computes geometry, compliance and the unworn analysis of a pair without corrections.
    ///
    /// # Errors
    /// [`Error::Input`] when a number is not finite or out of its domain, [`Error::Infeasible`]
    /// when no such pair exists. Geometry is judged before anything costly is computed.
    pub fn new(input: &PairInput, disc: &Discretisation) -> Result<Self, Error> {
        Self::with_corrections(input, &Corrections::default(), disc)
    }

    /// As [`new`](Self::new) for flanks with tip relief and crowning, which are part of every
    /// analysis and every sample of the pair, "unworn" ones included. Tip relief costs nothing;
    /// crowning makes a new design about four times slower and a sample seventeen times.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`Error::Input`] when a correction is out of its domain or when
    /// more than 100 pairs of teeth of a crowned pair touch at a time.
    pub fn with_corrections(
        input: &PairInput,
        corrections: &Corrections,
        disc: &Discretisation,
    ) -> Result<Self, Error> {
        input.validate()?;
        disc.validate()?;
        corrections.validate()?;
        let geometry = Geometry::new(input)?;
        if corrections.crowning > 0.0 && geometry.contact_ratio > MOST_CROWNED_PAIRS {
            return Err(InputError {
                field: "crowning",
                value: corrections.crowning,
                expected: "zero for a pair whose contact ratio exceeds 100",
            }
            .into());
        }
        let whole_face = input.tooth_model == ToothModel::WholeFaceBeam;
        if corrections.crowning > 0.0 && whole_face {
            return Err(InputError {
                field: "crowning",
                value: corrections.crowning,
                expected: "zero with the tooth model whole-face-beam, which has one gap for the \
                           whole face",
            }
            .into());
        }
        // A spur pair may hand over exactly at ε_α = 1; a helical one has then lost contact. An
        // empty path (ε_α ≤ 0) carries nothing, however large the overlap.
        let least = if input.helix_angle == 0.0 {
            1.0
        } else {
            1.0 + 1e-9
        };
        if geometry.contact_ratio < least || geometry.eps_alpha <= 0.0 {
            return Err(Infeasible::ContactGap {
                eps_alpha: geometry.eps_alpha,
                eps_beta: geometry.eps_beta,
            }
            .into());
        }
        let teeth = [
            Tooth::new(input, &geometry, Member::Pinion)?,
            Tooth::new(input, &geometry, Member::Gear)?,
        ];
        let base_force = input.pinion_torque / geometry.r_b[0];
        let mut soft = Vec::with_capacity(4);
        for member in Member::BOTH {
            let (low, high) = teeth[member.index()].load_range();
            for r in [low, high] {
                let tau = tangent_length(r, geometry.r_b[member.index()]);
                // The distance from a base tangent point is measured the same way from both ends.
                soft.push(geometry.tangent_length(member, tau));
            }
        }
        let marks = corrections.relief_starts(&geometry);
        let touch = if whole_face {
            Touch::Middle
        } else {
            Touch::Everywhere
        };
        let path = Path::new(&geometry, disc, touch, &soft, &marks);
        let elastic = Elasticity {
            input,
            geometry: &geometry,
            teeth: &teeth,
        };
        let mut scratch = Scratch::default();

        let unloaded: Vec<NodeCompliance> = path.s.iter().map(|&s| elastic.node(s)).collect();
        // First guess of the line load: the force spread over the mean length of contact.
        let mean_load = base_force / (geometry.eps_alpha * geometry.face_width);
        let least_load = LEAST_LOAD * mean_load;
        let mut load = vec![mean_load; path.s.len()];
        let relief: Vec<f64> = path
            .s
            .iter()
            .map(|&s| corrections.relief_at(&geometry, s))
            .collect();
        let make = |path: Path, load: &[f64]| {
            let face_load = base_force / geometry.face_width;
            let contact = |node, &w: &f64| elastic.contact(node, w);
            if whole_face {
                let beams = unloaded.iter().map(|node| 1.0 / node.teeth).collect();
                // A constant, whatever the place and the load.
                let hertz = contact(&unloaded[0], &mean_load);
                return Mesh::whole_face(path, beams, hertz, face_load);
            }
            let target = base_force * path.window / geometry.face_width;
            let nodes = unloaded.iter().zip(load);
            let stiffness = nodes.map(|(node, w)| 1.0 / (node.teeth + contact(node, w)));
            Mesh::slices(path, stiffness.collect(), target, corrections.crowning)
        };
        let mut mesh = make(path, &load);
        let mut extremes = mesh.solve(&relief, &mut scratch);
        let rounds = match input.tooth_model {
            ToothModel::WeberBanaschek => LOAD_ROUNDS,
            ToothModel::HertzBeam | ToothModel::PrismaticBeam | ToothModel::WholeFaceBeam => 0,
        };
        for _ in 0..rounds {
            let carried = mesh.greatest_load(&relief, &scratch, extremes.max, false);
            let mut change = 0.0_f64;
            for (w, carried) in load.iter_mut().zip(carried) {
                let new = carried.max(least_load);
                change = change.max((new - *w).abs() / new.max(f64::MIN_POSITIVE));
                *w = new;
            }
            if change <= LOAD_TOLERANCE {
                break;
            }
            mesh = make(mesh.frame.path, &load);
            extremes = mesh.solve(&relief, &mut scratch);
        }
        let unworn = !corrections.has_relief();
        let carried = mesh.greatest_load(&relief, &scratch, extremes.max, unworn);
        let pressure = pressures(input, &geometry, &mesh.frame.path.s, &carried);
        let unworn = analysis(&geometry, &mesh, &scratch, extremes, 0.0, &pressure);
        Ok(Self {
            input: input.clone(),
            corrections: *corrections,
            geometry,
            teeth,
            mesh: Arc::new(mesh),
            base_force,
            load,
            relief,
            unworn,
            pressure,
        })
    }

    /// The input the pair was made from.
    #[must_use]
    pub const fn input(&self) -> &PairInput {
        &self.input
    }

    /// Tip relief and crowning.
    #[must_use]
    pub const fn corrections(&self) -> &Corrections {
        &self.corrections
    }

    /// Circles, path of contact and contact ratios.
    #[must_use]
    pub const fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Specific sliding at both ends of the path; its `max` is the criterion g_s.
    #[must_use]
    pub fn sliding(&self) -> Sliding {
        self.geometry.sliding()
    }

    /// The four quantities of "no teeth interference".
    #[must_use]
    pub fn interference(&self) -> Interference {
        self.geometry.interference()
    }

    /// Transverse base force F_bt = T1/r_b1, N.
    #[must_use]
    pub const fn base_force(&self) -> f64 {
        self.base_force
    }

    /// Root stress of the pinion and of the gear; the criterion σ_vm is the greater one.
    ///
    /// The whole transverse base force acts on one tooth, spread over the face width, at the tip.
    /// Nominal bending stress 6 F cos α_F h_F/(b s_F²) in the section whose fillet tangent is
    /// inclined by 30° (ISO 6336-3), times Y_S = (1.2 + 0.13 l) q_s^(1/(1.21 + 2.3/l)), l = s_F/h_F.
    #[must_use]
    pub fn root_stress(&self) -> [RootStress; 2] {
        [0, 1].map(|i| {
            let tooth = &self.teeth[i];
            let section = tooth.critical_section();
            let load = tooth.load_at_radius(self.geometry.r_na[i]);
            let chord = section.chord;
            // A load line through or below the section does not bend it; the floor keeps the
            // ratio s_F/h_F finite.
            let arm = (load.y_l - section.y).max(1e-6 * chord);
            let nominal = 6.0 * self.base_force * load.cos_alpha_f * arm
                / (self.geometry.face_width * chord * chord);
            // A fillet bent the other way is no notch.
            let notch = if section.fillet_radius > 0.0 {
                chord / (2.0 * section.fillet_radius)
            } else {
                0.0
            };
            let factor = stress_correction(chord, arm, section.fillet_radius);
            RootStress {
                stress_mpa: nominal * factor,
                nominal_mpa: nominal,
                notch_factor: factor,
                notch_parameter: notch,
                in_range: (1.0..=8.0).contains(&notch),
                chord,
                arm,
                fillet_radius: section.fillet_radius,
            }
        })
    }

    /// Single pair stiffness at the pitch point (or at the end of the path nearest to it), per mm
    /// of face and in the transverse section, N/(mm·µm).
    #[must_use]
    pub fn pitch_stiffness(&self) -> f64 {
        let s = self
            .geometry
            .s_pitch
            .clamp(self.geometry.s_in, self.geometry.s_out);
        self.geometry.beta_b.cos() / self.compliance(s) / UM
    }

    /// Compliance q of the pair per length of contact line at `s`, mm per N/mm, under the load
    /// that the unworn pair carries there. `s` is clamped to the path of contact.
    #[must_use]
    pub fn compliance(&self, s: f64) -> f64 {
        let s = s.clamp(self.geometry.s_in, self.geometry.s_out);
        let place = self.mesh.frame.path.place(s);
        let (w0, w1) = (self.load[place.cell], self.load[place.cell + 1]);
        self.compliance_under(s, w0 + place.u * (w1 - w0))
    }

    /// Compliance q of the pair per length of contact line at `s` under the line load `load`,
    /// N/mm; mm per N/mm. Only `weber-banaschek` depends on the load.
    #[must_use]
    pub fn compliance_under(&self, s: f64, load: f64) -> f64 {
        let elastic = Elasticity {
            input: &self.input,
            geometry: &self.geometry,
            teeth: &self.teeth,
        };
        let node = elastic.node(s.clamp(self.geometry.s_in, self.geometry.s_out));
        node.teeth + elastic.contact(&node, load)
    }

    /// Compliance of one gear's tooth and foundation, without contact, when it is touched at the
    /// transverse radius `r` mm of its flank; mm per N/mm. `r` is clamped to the flank.
    #[must_use]
    pub fn tooth_compliance(&self, member: Member, r: f64) -> f64 {
        let i = member.index();
        let tooth = &self.teeth[i];
        let r = r.clamp(self.geometry.r_b[i], self.geometry.r_a[i]);
        tooth.compliance(&tooth.load_at_radius(r))
    }

    /// Places on the path of contact, mm from the pinion's base tangent point, for which
    /// [`pressure`](Self::pressure) is known.
    #[must_use]
    pub fn path(&self) -> &[f64] {
        &self.mesh.frame.path.s
    }

    /// Greatest Hertz pressure over the mesh period of the unworn pair at each place of the
    /// [`path`](Self::path), MPa.
    #[must_use]
    pub fn pressure(&self) -> &[f64] {
        &self.pressure
    }

    /// The analysis of the unworn pair.
    #[must_use]
    pub fn unworn(&self) -> Analysis {
        self.unworn.clone()
    }

    /// Wears both flanks by the mean wear and analyses the worn pair.
    ///
    /// [`WearLaw`] has the depth on each flank; the random part of `wear` is not used. A wear that
    /// [`Wear::validate`] refuses gives NaN, never a panic.
    #[must_use]
    pub fn archard(&self, wear: &Wear) -> Worn {
        let depth = self.depth(wear);
        let (gap, lowest) = self.worn_gap(wear, &depth);
        let mut scratch = Scratch::default();
        let extremes = self.mesh.solve(&gap, &mut scratch);
        let carried = self.mesh.greatest_load(&gap, &scratch, extremes.max, false);
        let pressure = pressures(
            &self.input,
            &self.geometry,
            &self.mesh.frame.path.s,
            &carried,
        );
        Worn {
            analysis: analysis(
                &self.geometry,
                &self.mesh,
                &scratch,
                extremes,
                lowest,
                &pressure,
            ),
            s: self.path().to_vec(),
            depth,
            pressure,
        }
    }

    /// Hertz pressure on the flanks, MPa, with the mean wear or without any: for each place of the [`path`](Self::path) a row
    /// with the pressures when the line of contact passes it in the middles of `parts` even parts of the face.
    #[must_use]
    pub fn contact_pattern(&self, wear: Option<&Wear>, parts: usize) -> Vec<Vec<f64>> {
        let gap = match wear {
            Some(wear) => self.worn_gap(wear, &self.depth(wear)).0,
            None => self.relief.clone(),
        };
        let mut scratch = Scratch::default();
        self.mesh.solve(&gap, &mut scratch);
        let s = &self.mesh.frame.path.s;
        let columns: Vec<Vec<f64>> = (0..parts)
            .map(|part| {
                let across = (part as f64 + 0.5) / parts as f64;
                let carried = self.mesh.load_across(&gap, &scratch, across);
                pressures(&self.input, &self.geometry, s, &carried)
            })
            .collect();
        (0..s.len())
            .map(|row| columns.iter().map(|column| column[row]).collect())
            .collect()
    }

    /// Prepares the drawing of randomly worn pairs. A wear that [`Wear::validate`] refuses gives
    /// NaN samples, never a panic.
    #[must_use]
    pub fn sampler(&self, wear: &Wear) -> Sampler {
        self.sampler_of_class(wear, None)
    }

    /// As [`sampler`](Self::sampler), for gears whose profile slopes deviate at random within the
    /// tolerance of this [class](FlankClass); without one they do not deviate.
    #[must_use]
    pub fn sampler_of_class(&self, wear: &Wear, class: Option<FlankClass>) -> Sampler {
        Sampler::new(self, wear, class)
    }

    /// The gap at the nodes with wear of this depth on both flanks, and what was taken off it, mm.
    fn worn_gap(&self, wear: &Wear, depth: &[f64]) -> (Vec<f64>, f64) {
        let mut gap: Vec<f64> = depth
            .iter()
            .zip(&self.relief)
            .map(|(depth, relief)| relief + 2.0 * depth)
            .collect();
        let lowest = match wear.law {
            WearLaw::Archard { .. } => 0.0,
            WearLaw::Signed { .. } => take_lowest(&mut gap),
        };
        (gap, lowest)
    }

    /// Mean wear depth on each flank at the nodes, mm: [`WearLaw`].
    pub(crate) fn depth(&self, wear: &Wear) -> Vec<f64> {
        let places = self.mesh.frame.path.s.iter().zip(&self.pressure);
        let s_pitch = self.geometry.s_pitch;
        match wear.law {
            WearLaw::Archard { max_depth_um } => {
                let max_depth = max_depth_um * 1e-3;
                let mut depth: Vec<f64> = places.map(|(s, p)| p * (s - s_pitch).abs()).collect();
                let most = depth.iter().fold(0.0, |most: f64, &v| most.max(v));
                if most > 0.0 {
                    for v in &mut depth {
                        *v = max_depth * (*v / most);
                    }
                }
                depth
            }
            WearLaw::Signed { coefficient } => places
                .map(|(s, p)| coefficient * p * (s_pitch - s))
                .collect(),
        }
    }

    /// Transverse transmission error in µm for a normal deflection in mm.
    pub(crate) fn to_ste_um(&self, delta: f64) -> f64 {
        delta / self.geometry.beta_b.cos() * UM
    }
}

/// The parts of the compliance at a place.
#[derive(Debug, Clone, Copy)]
struct NodeCompliance {
    s: f64,
    /// Both teeth with their foundations.
    teeth: f64,
    /// Product of the half thicknesses along the load line.
    thickness: f64,
}

/// The elastic side of a pair.
struct Elasticity<'a> {
    input: &'a PairInput,
    geometry: &'a Geometry,
    teeth: &'a [Tooth; 2],
}

impl Elasticity<'_> {
    fn node(&self, s: f64) -> NodeCompliance {
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

    /// Compliance of the contact itself under the line load `w`, N/mm.
    fn contact(&self, node: &NodeCompliance, w: f64) -> f64 {
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

/// Subtracts the lowest gap from all of them and returns it. The deflection and the transmission
/// error fall by as much at every phase; loads and ΔSTE stay.
pub(crate) fn take_lowest(gap: &mut [f64]) -> f64 {
    let lowest = gap.iter().fold(f64::INFINITY, |least, &g| least.min(g));
    for g in gap {
        *g -= lowest;
    }
    lowest
}

/// Hertz pressure at each of the places `s` under the line load `carried`, MPa: √(w E*/(π R)) with
/// E* = E/(2 (1 − ν²)).
fn pressures(input: &PairInput, geometry: &Geometry, s: &[f64], carried: &[f64]) -> Vec<f64> {
    let nu = input.material.poisson_ratio;
    let modulus = input.material.youngs_modulus_mpa / (2.0 * (1.0 - nu * nu));
    s.iter()
        .zip(carried)
        .map(|(&s, w)| (w * modulus / (PI * geometry.relative_radius(s))).sqrt())
        .collect()
}

/// The analysis of a solution whose gaps were measured from the `lowest`, mm.
fn analysis(
    geometry: &Geometry,
    mesh: &Mesh,
    scratch: &Scratch,
    extremes: Extremes,
    lowest: f64,
    pressure: &[f64],
) -> Analysis {
    let scale = UM / geometry.beta_b.cos();
    Analysis {
        phases: mesh
            .frame
            .path
            .phases
            .iter()
            .map(|phi| phi / geometry.base_pitch)
            .collect(),
        ste_um: scratch
            .delta
            .iter()
            .map(|delta| (delta + lowest) * scale)
            .collect(),
        delta_ste_um: (extremes.max - extremes.min) * scale,
        hertz_pressure_mpa: pressure.iter().fold(0.0, |most: f64, &p| most.max(p)),
    }
}
