//! The loaded contact of an unworn pair, with the compliance that belongs to its load.
//!
//! With `weber-banaschek` the compliance q depends on the load (see `elasticity`). The load used at s is
//! the greatest one met there over the mesh period, so that q stays a function of s alone, and it is
//! the fixed point of
//!
//! w(s) = max over the phases in contact at s of max(0, δ(φ) − g(s)) / q(s, w(s)),
//!
//! with δ(φ) the deflection that q gives and g the tip relief. Rounds start from the mean load. A round
//! moves w by a factor of about q_H′ w/q, at most a tenth, so it contracts; rounds end when no place's
//! load changes by more than 2e-5, which leaves the compliance within about 1e-6 of its fixed point.
//! Wear does not change the compliance: it moves load, which enters by its logarithm only.

use crate::balance::Extremes;
use crate::coupled::SingularCompliance;
use crate::elasticity::NodeCompliance;
use crate::input::ToothModel;
use crate::mesh::{Mesh, Scratch};
use crate::path::Path;
use crate::unloaded::UnloadedPair;

/// Load rounds of the `weber-banaschek` model stop at this relative change of the load. The
/// compliance changes twenty times less than the load.
const LOAD_TOLERANCE: f64 = 2e-5;
/// Least load for which Weber's approach is evaluated, as a share of the mean load. A place that
/// tip relief keeps free of load would be infinitely soft, and stay so when wear loads it.
const LEAST_LOAD: f64 = 0.01;

/// The most load rounds. Five are usual; thin tips and absurd loads, where Weber's bracket is
/// clamped, may need more.
const LOAD_ROUNDS: usize = 12;

/// The mesh of an unworn pair, and its solution over the mesh period.
pub(crate) struct UnwornContact {
    pub(crate) mesh: Mesh,
    /// Load per length of contact line for which the compliance holds, N/mm, at all nodes.
    pub(crate) load: Vec<f64>,
    /// Extremes of δ, mm.
    pub(crate) extremes: Extremes,
    /// Working memory of the solution, with δ at the phases.
    pub(crate) scratch: Scratch,
}

impl UnwornContact {
    /// Solves the contact on `path` for the gap `relief` at its nodes, mm.
    ///
    /// # Errors
    /// [`SingularCompliance`], with coupled cells only.
    pub(crate) fn solve(
        pair: &UnloadedPair,
        path: Path,
        relief: &[f64],
    ) -> Result<Self, SingularCompliance> {
        let (geometry, tooth_model) = (pair.geometry(), pair.input().tooth_model);
        let (base_force, lead) = (pair.base_force(), pair.corrections().lead(geometry));
        if tooth_model == ToothModel::Coupled {
            let mesh = Mesh::coupled(pair, path, relief, !lead.is_even())?;
            let mut scratch = Scratch::default();
            let extremes = mesh.solve(relief, &mut scratch);
            let load = mesh.greatest_load(relief, &scratch, extremes.max, false);
            return Ok(Self {
                mesh,
                load,
                extremes,
                scratch,
            });
        }
        let nodes: Vec<NodeCompliance> = path.hold(pair.nodes(path.nodes()));
        // First guess of the line load: the force spread over the mean length of contact.
        let mean_load = base_force / (geometry.eps_alpha * geometry.face_width);
        let least_load = LEAST_LOAD * mean_load;
        let mut load = vec![mean_load; path.s.len()];
        let make = |path: Path, load: &[f64]| {
            let contact = |node: &NodeCompliance, &w: &f64| pair.contact(&node.touching, w);
            if tooth_model == ToothModel::WholeFaceBeam {
                let beams = nodes.iter().map(|node| 1.0 / node.teeth).collect();
                // A constant: it depends neither on the place nor on the load.
                let hertz = contact(&nodes[0], &mean_load);
                return Mesh::whole_face(path, beams, hertz, base_force / geometry.face_width);
            }
            let target = base_force * path.window / geometry.face_width;
            let stiffness = nodes
                .iter()
                .zip(load)
                .map(|(node, w)| 1.0 / (node.teeth + contact(node, w)));
            Mesh::slices(path, stiffness.collect(), target, lead)
        };
        let mut scratch = Scratch::default();
        let mut mesh = make(path, &load);
        let mut extremes = mesh.solve(relief, &mut scratch);
        let rounds = match tooth_model {
            ToothModel::WeberBanaschek => LOAD_ROUNDS,
            ToothModel::HertzBeam
            | ToothModel::PrismaticBeam
            | ToothModel::WholeFaceBeam
            | ToothModel::Coupled => 0,
        };
        for _ in 0..rounds {
            let carried = mesh.greatest_load(relief, &scratch, extremes.max, false);
            let carried = mesh.frame.path.hold(carried);
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
            extremes = mesh.solve(relief, &mut scratch);
        }
        Ok(Self {
            mesh,
            load,
            extremes,
            scratch,
        })
    }
}
