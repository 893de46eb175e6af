//! The cells of all phases and their elastic compliance: the part of the contact that wear does not change.

use crate::corrections::Lead;
use crate::elasticity::{ContactPlace, NodeCompliance};
use crate::path::Path;
use crate::station::{Station, influence};
use crate::unloaded::UnloadedPair;
use crate::vectors::with_vectors;

use super::body::{Body, FAR};
use super::face::Face;
use super::grid::{self, Cell, Strip};
use super::matrix::Matrix;

/// The cells of a pair.
#[derive(Debug)]
pub(super) struct Cells {
    /// Load on all contact lines, normal to the flanks, N.
    pub(super) load: f64,
    pub(super) strips: Vec<Strip>,
    /// Middles of the strips as shares of the face.
    pub(super) across: Vec<f64>,
    /// Gap of the corrections along the face.
    pub(super) lead: Lead,
    pub(super) phases: Vec<Phase>,
    /// For each strip the cells of all phases as (place, number of the cell), by place.
    pub(super) tracks: Vec<Vec<(f64, usize)>>,
}

/// The cells of one phase.
#[derive(Debug)]
pub(super) struct Phase {
    /// In base pitches.
    pub(super) phase: f64,
    pub(super) cells: Vec<Cell>,
    pub(super) touching: Vec<ContactPlace>,
    /// Compliance without the approach of the contact, mm/N.
    pub(super) compliance: Matrix,
}

impl Phase {
    /// Gaps of the cells, mm, for the gap `g` at the nodes of the path and `lead` at the strips.
    pub(super) fn gaps<'a>(
        &'a self,
        g: &'a [f64],
        lead: &'a [f64],
    ) -> impl Iterator<Item = f64> + 'a {
        self.cells
            .iter()
            .map(move |cell| cell.separation + cell.place.of(g) + lead[cell.strip])
    }
}

/// The parts of a pair from which the compliance of its cells follows.
struct Parts {
    bodies: [Body; 2],
    face: Face,
    /// 1/b: the kernel of a displacement that is the same all along the face.
    even: f64,
    /// cos β_b/E of each gear.
    scale: [f64; 2],
    poisson: [f64; 2],
}

impl Cells {
    /// The cells of a pair on `path`, with the compliance `nodes` at its nodes. `has_lead_gap`: gaps may
    /// vary along the face.
    pub(super) fn new(
        pair: &UnloadedPair,
        path: &Path,
        nodes: &[NodeCompliance],
        has_lead_gap: bool,
    ) -> Self {
        let geometry = pair.geometry();
        let b = geometry.face_width;
        let strips = grid::strips(geometry, path.even_phases, has_lead_gap);
        let middles: Vec<f64> = strips.iter().map(|strip| strip.middle).collect();
        let parts = Parts::new(pair, &middles, &nodes[nodes.len() / 2]);
        let beyond = pair.beyond();
        let phases: Vec<Phase> = path
            .phases
            .iter()
            .map(|&phi| {
                let cells = grid::cells(geometry, path, &beyond, &strips, phi);
                let nodes: Vec<NodeCompliance> = cells
                    .iter()
                    .map(|cell| NodeCompliance::between(nodes, cell.place))
                    .collect();
                Phase {
                    phase: phi / geometry.base_pitch,
                    touching: nodes.iter().map(|node| node.touching).collect(),
                    compliance: parts.compliance(&cells, &nodes),
                    cells,
                }
            })
            .collect();
        let mut tracks = vec![Vec::new(); strips.len()];
        let all = phases.iter().flat_map(|phase| &phase.cells);
        for (number, cell) in all.enumerate() {
            tracks[cell.strip].push((cell.s, number));
        }
        for track in &mut tracks {
            track.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        Self {
            load: pair.base_force() / geometry.beta_b.cos(),
            across: middles.iter().map(|z| z / b).collect(),
            lead: pair.corrections().lead(geometry),
            strips,
            phases,
            tracks,
        }
    }

    /// Gap along the face at the strips, with a further `slope`, mm.
    pub(super) fn lead_gaps(&self, slope: f64) -> impl Iterator<Item = f64> + '_ {
        let lead = self.lead.tilted(slope);
        self.across.iter().map(move |&z| lead.gap(z))
    }
}

impl Parts {
    /// The parts for strips with the middles `z`, mm; `middle` is the compliance in the middle of the path.
    fn new(pair: &UnloadedPair, z: &[f64], middle: &NodeCompliance) -> Self {
        let (geometry, material) = (pair.geometry(), pair.input().material);
        let bodies = pair.bodies();
        let end_gain = [0, 1].map(|i| {
            let station = &middle.stations[i];
            let [_, foundation] = influence(station, station, material[i].poisson_ratio);
            bodies[i].own(station.u, station.u) / foundation
        });
        Self {
            face: Face::new(geometry, z, end_gain),
            bodies,
            even: 1.0 / geometry.face_width,
            scale: material.map(|one| geometry.beta_b.cos() / one.youngs_modulus_mpa),
            poisson: material.map(|one| one.poisson_ratio),
        }
    }

    /// The compliance of cells with the compliance `nodes` at their places; see [`Phase::compliance`].
    fn compliance(&self, cells: &[Cell], nodes: &[NodeCompliance]) -> Matrix {
        let stations = [0, 1].map(|gear| {
            let mut lists = Station::<Vec<f64>>::default();
            for node in nodes {
                lists.push(&node.stations[gear]);
            }
            lists
        });
        with_vectors(
            #[inline(always)]
            || self.assemble(cells, &stations),
        )
    }

    /// The compliance of cells with these stations on each gear.
    #[inline(always)]
    fn assemble(&self, cells: &[Cell], stations: &[Station<Vec<f64>>; 2]) -> Matrix {
        let n = cells.len();
        let mut compliance = Matrix::zero(n);
        for a in 0..n {
            let row = compliance.row_mut(a);
            let mut start = 0;
            // Cells are in the order of lines, so those of another line belong to a tooth behind.
            for line in cells[..=a].chunk_by(|a, c| a.line == c.line) {
                let end = start + line.len();
                let places = [&cells[a], &line[0]];
                for (gear, stations) in stations.iter().enumerate() {
                    let at = stations.map(|list| list[a]);
                    let from = stations.map(|list| &list[start..end]);
                    self.add(gear, places, &at, &from, &mut row[start..end]);
                }
                start = end;
            }
        }
        compliance.mirror();
        compliance
    }

    /// Adds to `row` the part of one gear in the compliance between one cell and the cells of one line, which lie side
    /// by side. `places` are that cell and the first cell of the line; `at` and `from` are their stations.
    #[inline(always)]
    fn add(
        &self,
        gear: usize,
        places: [&Cell; 2],
        at: &Station,
        from: &Station<&[f64]>,
        row: &mut [f64],
    ) {
        let n = row.len();
        let from = from.map(|list| &list[..n]);
        let (body, face, even) = (&self.bodies[gear], &self.face, self.even);
        let scale = self.scale[gear];
        let [strip, first] = places.map(|cell| cell.strip);
        let distance = places[0].line.abs_diff(places[1].line) as usize;
        if distance == 0 {
            let (of_bending, of_foundation) = (
                face.bending.part(strip, first, n),
                face.foundation[gear].part(strip, first, n),
            );
            for (i, value) in row.iter_mut().enumerate() {
                let from = from.map(|list| list[i]);
                let [bending, foundation] = influence(at, &from, self.poisson[gear]);
                *value += scale
                    * (bending * of_bending[i]
                        + foundation * of_foundation[i]
                        + body.own(at.u, from.u) * even);
            }
            return;
        }
        let Some(neighbour) = body.neighbours.get(distance - 1) else {
            let far = scale * (body.twist + FAR) * even;
            row.iter_mut().for_each(|value| *value += far);
            return;
        };
        let of_even = face.neighbour[distance - 1].part(strip, first, n);
        let of_product = face.neighbour_product[distance - 1].part(strip, first, n);
        let (antisymmetric, symmetric) = (
            face.antisymmetric.part(strip, first, n),
            face.symmetric.part(strip, first, n),
        );
        let sign = if gear == 0 { 1.0 } else { -1.0 };
        for (i, value) in row.iter_mut().enumerate() {
            let u = from.u[i];
            let (lead, trail) = if gear == 0 { (at.u, u) } else { (u, at.u) };
            let product = lead * trail;
            *value += scale
                * (body.twist * even
                    + neighbour.even(lead, trail) * of_even[i]
                    + neighbour.product * product * of_product[i]
                    + neighbour.antisymmetric(product) * antisymmetric[i]
                    + sign * neighbour.symmetric(lead, trail) * symmetric[i]);
        }
    }
}
